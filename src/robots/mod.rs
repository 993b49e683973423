//! The robots that an argument selects, and the published ones.

pub mod published;
pub mod selection;
