//! The images of a run: where its dataset lies, which images it is trained on, which it is tested
//! on, and what its robots see of them.

pub mod held_out;
pub mod training;
pub mod whereabouts;
