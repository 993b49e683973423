//! The evolution of bodies and the training of gaits: ask, score, tell; resume; choice on
//! validation images.

pub mod evolve;
pub mod held_out_run;
pub mod one_by_one;
pub mod resume;
pub mod validation;
