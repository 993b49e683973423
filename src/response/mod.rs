//! The response of a body to images: the gait, random images, the regression on them, and an
//! estimate of what training could reach.

pub mod estimate;
pub mod gait;
pub mod lesson;
pub mod objective;
pub mod probing;
pub mod regression;
