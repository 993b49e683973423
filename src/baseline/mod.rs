//! Floor 2: networks that robots are compared with (paper, "Morphological cognition capacity"), trained on a library.

pub mod curve;
pub mod network;
pub mod training;

pub use network::{Activation, Kind, Pooling};
pub use training::{Hyperparameters, Samples, Trained, Untrained, Watch, train};
