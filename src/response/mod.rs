//! The response of a body to images: the gait, random images, the regression on them, and an
//! estimate of what training could reach.

pub(crate) mod design_problem;
pub(crate) mod estimate;
pub mod gait;
pub(crate) mod objective;
pub mod probing;
pub(crate) mod regression;
