//! Helpers that several test programs share.
#![allow(dead_code, reason = "every test program uses its own part")]

#[cfg(unix)]
pub mod browser;
pub mod hostile;
pub mod program;
#[path = "../../crates/sim/tests/common/mod.rs"]
pub mod reference;
pub mod server;
