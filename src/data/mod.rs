//! Images: IDX files, places and sources of datasets, imports, and the digits that the program draws.

pub(crate) mod builtin;
pub mod catalogue;
pub(crate) mod class_names;
pub mod dataset;
pub(crate) mod description;
pub mod fetch;
pub mod files;
pub(crate) mod gates;
pub(crate) mod idx;
#[cfg(feature = "import")]
pub mod import;
pub(crate) mod info;
pub(crate) mod pen;
pub(crate) mod strokes;
