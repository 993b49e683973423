//! Terminal output: messages, tables, progress, the results of commands, walks.

pub(crate) mod bar;
pub(crate) mod claims;
pub(crate) mod comparisons;
pub mod console;
pub(crate) mod networks;
pub(crate) mod pictures;
pub(crate) mod player;
pub mod progress;
pub mod reporters;
pub(crate) mod responses;
pub(crate) mod summary;
pub(crate) mod sweeps;
pub(crate) mod table;
pub(crate) mod teams;
pub(crate) mod terminal;
pub(crate) mod verdicts;
pub(crate) mod wrapping;
