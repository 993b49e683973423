//! Baselines for robots: networks (paper, "Morphological cognition capacity"), linear classifiers
//! and the nearest image.

pub(crate) mod curve;
pub(crate) mod linear;
pub(crate) mod nearest;
pub(crate) mod network;
pub(crate) mod settings;
pub(crate) mod training;

pub(crate) use settings::{Hyperparameters, NetworkKind, Pooling, Trained};
pub(crate) use training::{Samples, train};
