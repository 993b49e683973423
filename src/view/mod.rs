//! Floor 5: pictures and the terminal.

pub mod sheet;
