//! What robots are compared with: networks (paper, "Morphological cognition capacity"), trained on a
//! library; linear classifiers and the nearest image.

pub mod curve;
pub mod linear;
pub mod nearest;
#[cfg(feature = "networks")]
pub mod network;
pub mod settings;
#[cfg(feature = "networks")]
pub mod training;

pub use settings::{Activation, Hyperparameters, Kind, Pooling, Trained, Watch};
#[cfg(feature = "networks")]
pub use training::{Samples, SamplesError, train};
