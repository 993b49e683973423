//! Baselines for robots: networks (paper, "Morphological cognition capacity"), linear classifiers
//! and the nearest image.

pub mod curve;
pub mod linear;
pub mod nearest;
pub mod network;
pub mod settings;
pub mod training;

pub use settings::{Activation, Hyperparameters, NetworkKind, Pooling, Trained, Watch};
pub use training::{Samples, SamplesError, train};
