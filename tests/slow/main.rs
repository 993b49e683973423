//! What takes long to prove: the same bits however a run is made, stops at any moment, hostile inputs.

#[path = "../common/mod.rs"]
mod common;

mod hostile;
mod pinned_runs;
mod resume;
mod stop;
