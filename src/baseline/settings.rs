//! Which networks there are, how they are trained, and how well a trained one does: plain data.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kinds of network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// One hidden layer; its size is the number of hidden neurons.
    Mlp,
    /// One convolution and an output head; its size is the number of kernels.
    Cnn,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 2] = [Kind::Mlp, Kind::Cnn];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Mlp => "mlp",
            Kind::Cnn => "cnn",
        }
    }
}

/// What follows the hidden layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Activation {
    /// max(0, x)
    Relu,
    /// tanh(x)
    Tanh,
    /// 1/(1 + e^−x)
    Sigmoid,
}

/// What a convolution's maps are made to before the output head.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pooling {
    /// Nothing: every pixel of every map goes into the head.
    None,
    /// The largest of 2 × 2 pixels.
    Max2,
    /// The mean of a whole map.
    Mean,
    /// The largest of a whole map.
    Max,
}

/// What training waits for an improvement of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Watch {
    /// Share answered correctly: larger is better.
    Accuracy,
    /// Cross-entropy: smaller is better.
    Loss,
}

/// How networks are trained.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Hyperparameters {
    /// Passes over the training images. Default 50, the paper's.
    pub epochs: usize,
    /// Epochs without an improvement after which training ends. Default 5, the paper's.
    pub patience: usize,
    /// What is to improve.
    pub watch: Watch,
    /// Whether the best epoch's network is tested, not the last epoch's.
    pub restore_best: bool,
    /// Adam's learning rate.
    pub learning_rate: f64,
    /// Images per step; 0: all at once.
    pub batch: usize,
    /// What follows the hidden layer.
    pub activation: Activation,
    /// Side of the convolution's kernels.
    pub kernel: usize,
    /// What becomes of the convolution's maps.
    pub pooling: Pooling,
}

impl Default for Hyperparameters {
    fn default() -> Self {
        Hyperparameters {
            epochs: 50,
            patience: 5,
            watch: Watch::Accuracy,
            restore_best: false,
            learning_rate: 5e-4,
            batch: 1,
            activation: Activation::Relu,
            kernel: 3,
            pooling: Pooling::None,
        }
    }
}

/// How a training ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trained {
    /// Share of the test images answered correctly.
    pub accuracy: f64,
    /// Epochs it took.
    pub epochs: usize,
    /// Numbers that training changed.
    pub parameters: usize,
}
