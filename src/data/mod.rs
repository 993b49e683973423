//! Images: the IDX reader, where datasets lie and where they come from, the digits that the program
//! draws.

pub mod builtin;
pub mod catalogue;
pub mod dataset;
pub mod fetch;
pub mod files;
pub mod idx;
pub mod info;
pub mod pen;
pub mod strokes;
