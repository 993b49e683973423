//! The evolution of bodies and the training of gaits: ask, score, tell; resume; choice on
//! validation images.

pub mod evolve;
pub mod held_out;
pub mod probing;
pub mod response;
pub mod resume;
pub mod showing;
pub mod train;
pub mod training;
pub mod validation;
pub(crate) mod windows;
