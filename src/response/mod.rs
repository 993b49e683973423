//! How a body responds to images: the gait, random images, the regression on them, and what a
//! training could reach.

pub mod estimate;
pub mod gait;
pub mod lesson;
pub mod probing;
pub mod random_images;
pub mod regression;
