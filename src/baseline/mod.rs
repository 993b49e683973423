//! Networks that robots are compared with (paper, "Morphological cognition capacity"), trained on a
//! library.

pub mod curve;
#[cfg(feature = "networks")]
pub mod network;
pub mod settings;
#[cfg(feature = "networks")]
pub mod training;

pub use settings::{Activation, Hyperparameters, Kind, Pooling, Trained, Watch};
#[cfg(feature = "networks")]
pub use training::{Samples, Untrained, train};
