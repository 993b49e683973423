//! [`Network`]: the paper's two networks, on candle, with parameters from our own random streams.

use crate::base::random::Stream;
use candle_core::{Device, Result, Tensor, Var};
use serde::{Deserialize, Serialize};

/// Kinds of network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Activation {
    /// max(0, x)
    Relu,
    /// tanh(x)
    Tanh,
    /// 1/(1 + e^−x)
    Sigmoid,
}

impl Activation {
    fn apply(self, x: &Tensor) -> Result<Tensor> {
        match self {
            Activation::Relu => x.relu(),
            Activation::Tanh => x.tanh(),
            Activation::Sigmoid => candle_nn::ops::sigmoid(x),
        }
    }
}

/// What a convolution's maps are made to before the output head.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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

impl Pooling {
    /// Pixels of a map of so many rows and columns afterwards.
    fn pixels(self, (rows, columns): (usize, usize)) -> usize {
        match self {
            Pooling::None => rows * columns,
            Pooling::Max2 => (rows / 2) * (columns / 2),
            Pooling::Mean | Pooling::Max => 1,
        }
    }

    /// n × k × rows × columns to n × features.
    fn apply(self, maps: &Tensor) -> Result<Tensor> {
        match self {
            Pooling::None => maps.flatten_from(1),
            Pooling::Max2 => maps.max_pool2d(2)?.flatten_from(1),
            Pooling::Mean => maps.flatten_from(2)?.mean(2),
            Pooling::Max => maps.flatten_from(2)?.max(2),
        }
    }
}

/// Shape of a network: all that its parameters do not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Its kind.
    pub kind: Kind,
    /// Hidden neurons, or kernels; 1 or more.
    pub size: usize,
    /// Rows and columns of an image.
    pub image: (usize, usize),
    /// Side of a convolution's kernels, not larger than the image's.
    pub kernel: usize,
    /// What follows the hidden layer.
    pub activation: Activation,
    /// What becomes of a convolution's maps.
    pub pooling: Pooling,
}

/// A network with two outputs.
pub struct Network {
    shape: Shape,
    /// Weights and biases of the hidden layer, then of the outputs.
    parameters: [Var; 4],
}

/// Outputs: the two groups of a task.
const OUTPUTS: usize = 2;

impl Network {
    /// With random parameters: uniform within ±1/√(inputs of a unit), as PyTorch starts such layers.
    ///
    /// # Errors
    /// If the library has no memory for them.
    pub fn new(shape: Shape, rng: &mut Stream) -> Result<Self> {
        let Shape { kind, size, image: (height, width), kernel, pooling, .. } = shape;
        let (hidden_inputs, features) = match kind {
            Kind::Mlp => (height * width, size),
            Kind::Cnn => (kernel * kernel, size * pooling.pixels((height - kernel + 1, width - kernel + 1))),
        };
        let mut uniform = |dims: &[usize], inputs: usize| {
            let bound = 1.0 / (inputs as f64).sqrt();
            let count: usize = dims.iter().product();
            let values: Vec<f32> = (0..count).map(|_| rng.uniform(-bound, bound) as f32).collect();
            Var::from_tensor(&Tensor::from_vec(values, dims, &Device::Cpu)?)
        };
        let weights = match kind {
            Kind::Mlp => uniform(&[hidden_inputs, size], hidden_inputs)?,
            Kind::Cnn => uniform(&[size, 1, kernel, kernel], hidden_inputs)?,
        };
        let biases = uniform(&[size], hidden_inputs)?;
        let out_weights = uniform(&[features, OUTPUTS], features)?;
        let out_biases = uniform(&[OUTPUTS], features)?;
        Ok(Network { shape, parameters: [weights, biases, out_weights, out_biases] })
    }

    /// What training changes.
    pub fn parameters(&self) -> Vec<Var> {
        self.parameters.to_vec()
    }

    /// Numbers that training changes.
    pub fn count(&self) -> usize {
        self.parameters.iter().map(|parameter| parameter.elem_count()).sum()
    }

    /// Images (n × 1 × height × width) to outputs (n × 2) before the softmax.
    ///
    /// # Errors
    /// If the images are of another size.
    pub fn forward(&self, images: &Tensor) -> Result<Tensor> {
        let [weights, biases, out_weights, out_biases] = &self.parameters;
        let hidden = match self.shape.kind {
            Kind::Mlp => images.flatten_from(1)?.matmul(weights)?.broadcast_add(biases)?,
            Kind::Cnn => {
                let biases = biases.reshape((1, self.shape.size, 1, 1))?;
                images.conv2d(weights, 0, 1, 1, 1)?.broadcast_add(&biases)?
            }
        };
        let hidden = self.shape.activation.apply(&hidden)?;
        let hidden = if self.shape.kind == Kind::Cnn { self.shape.pooling.apply(&hidden)? } else { hidden };
        hidden.matmul(out_weights)?.broadcast_add(out_biases)
    }
}
