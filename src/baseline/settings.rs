//! Networks, their training, and the accuracy of a trained one: plain data.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kinds of network.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub(crate) enum NetworkKind {
    /// One hidden layer; its size is the number of hidden neurons.
    Mlp,
    /// One convolution and an output head; its size is the number of kernels.
    Cnn,
}

impl NetworkKind {
    pub(crate) const ALL: [NetworkKind; 2] = [NetworkKind::Mlp, NetworkKind::Cnn];

    pub(crate) fn name(self) -> &'static str {
        match self {
            NetworkKind::Mlp => "mlp",
            NetworkKind::Cnn => "cnn",
        }
    }
}

/// The function after the hidden layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Activation {
    /// max(0, x)
    Relu,
    /// tanh(x)
    Tanh,
    /// 1/(1 + e^−x)
    Sigmoid,
}

/// The reduction of a convolution's maps before the output head.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Pooling {
    /// No reduction: every pixel of every map is an input of the head.
    None,
    /// The maximum of each 2 × 2 pixels.
    Max2,
    /// The mean of a whole map.
    Mean,
    /// The maximum of a whole map.
    Max,
}

/// The measure whose improvement training waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Watch {
    /// Fraction of correct answers: larger is better.
    Accuracy,
    /// Cross-entropy: smaller is better.
    Loss,
}

/// Settings of the training of networks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Hyperparameters {
    /// Most passes over the training images. Default 50, the paper's.
    pub(crate) epochs: usize,
    /// Epochs without an improvement after which training ends. Default 5, the paper's.
    pub(crate) patience: usize,
    /// Measure of improvement. Default accuracy.
    pub(crate) watch: Watch,
    /// True to test the best epoch's network instead of the last epoch's. Default false.
    pub(crate) restore_best: bool,
    /// Learning rate of Adam. Default 0.0005.
    pub(crate) learning_rate: f64,
    /// Images per step; 0 means all at once. Default 1.
    pub(crate) batch: usize,
    /// Function after the hidden layer. Default relu.
    pub(crate) activation: Activation,
    /// Side of the convolution's kernels. Default 3.
    pub(crate) kernel: usize,
    /// Reduction of the convolution's maps. Default none.
    pub(crate) pooling: Pooling,
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

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trained {
    /// Fraction of the test images answered correctly.
    pub(crate) accuracy: f64,
    pub(crate) epochs: usize,
    pub(crate) parameters: usize,
}
