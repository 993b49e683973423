//! The evolution of bodies, resuming it, and the choice of robots on validation images.

pub mod evolve;
pub mod held_out_run;
pub mod one_by_one;
pub(crate) mod resume;
pub(crate) mod validation;
