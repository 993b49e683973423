//! Terminal output: messages, tables, progress, the results of commands, walks.

pub mod bar;
pub mod console;
pub mod networks;
pub mod pictures;
pub mod player;
pub mod progress;
pub mod reporters;
pub mod responses;
pub mod summary;
pub mod sweeps;
pub mod table;
pub mod teams;
pub mod terminal;
pub mod verdicts;
pub mod wrapping;
