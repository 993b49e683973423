//! The base of all modules: random generators, hashes and files; numbers, lines and tables as text.

pub mod clock;
pub mod error;
pub(crate) mod files;
pub mod hash;
pub(crate) mod number;
pub mod observer;
pub(crate) mod ownership;
pub mod random;
pub(crate) mod ranges;
pub mod ranks;
pub mod remedy;
pub(crate) mod running;
pub mod session;
pub(crate) mod shell;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod signals;
pub(crate) mod statistics;
pub(crate) mod table;
pub mod text;
pub mod threads;

pub use morphcog_sim::grid::{self, Grid};
pub use morphcog_sim::stop;
