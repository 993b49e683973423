//! The images of a run: its dataset; training, validation and test images; what its robots see.

pub mod held_out;
pub mod training;
pub mod whereabouts;
