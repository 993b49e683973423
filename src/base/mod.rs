//! The base of all modules: random generators, hashes and files; numbers, lines and tables as text.

pub mod clock;
pub mod error;
pub mod files;
pub mod hash;
pub mod number;
pub mod observer;
pub mod ownership;
pub mod random;
pub(crate) mod ranges;
pub mod ranks;
pub mod remedy;
pub mod session;
pub mod shell;
pub mod signals;
pub mod statistics;
pub mod table;
pub mod text;
pub mod threads;

pub use morphcog_sim::grid::{self, Grid};
pub use morphcog_sim::stop;
