//! Images: the IDX reader, places and sources of datasets, and the digits that the program draws.

pub mod builtin;
pub mod catalogue;
pub mod dataset;
pub mod fetch;
pub mod files;
pub mod idx;
pub mod info;
pub mod pen;
pub mod strokes;
