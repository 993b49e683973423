//! [`Network`]: the paper's two networks, on candle, with parameters from our own random streams.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::baseline::settings::{Activation, Kind, Pooling};
use candle_core::{Device, Result, Tensor, Var};

impl Activation {
    fn apply(self, x: &Tensor) -> Result<Tensor> {
        match self {
            Activation::Relu => x.relu(),
            Activation::Tanh => x.tanh(),
            Activation::Sigmoid => candle_nn::ops::sigmoid(x),
        }
    }
}

impl Pooling {
    /// Rows and columns of pixels that become one, in a map of this side.
    fn window(self, (rows, columns): (usize, usize)) -> (usize, usize) {
        match self {
            Pooling::None => (1, 1),
            Pooling::Max2 => (2, 2),
            Pooling::Mean | Pooling::Max => (rows, columns),
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

impl Shape {
    /// Rows and columns of what a hidden unit sees of an image.
    fn field(&self) -> (usize, usize) {
        match self.kind {
            Kind::Mlp => self.image,
            Kind::Cnn => (self.kernel, self.kernel),
        }
    }

    /// Places of that on an image, by rows and columns: one, of all of the image, for a hidden
    /// layer.
    fn places(&self) -> (usize, usize) {
        (self.image.0 + 1 - self.field().0, self.image.1 + 1 - self.field().1)
    }

    /// Numbers a hidden unit sees at a place, the constant one for its bias included.
    fn inputs(&self) -> usize {
        self.field().0 * self.field().1 + 1
    }

    /// Rows and columns of places of which pooling makes one, and of what it makes of them.
    fn pooled(&self) -> [(usize, usize); 2] {
        let (rows, columns) = self.places();
        let window = match self.kind {
            Kind::Mlp => (1, 1),
            Kind::Cnn => self.pooling.window((rows, columns)),
        };
        [window, (rows / window.0, columns / window.1)]
    }

    /// Outputs of the hidden layer per image, after pooling.
    fn features(&self) -> usize {
        let [_, (rows, columns)] = self.pooled();
        rows * columns * self.size
    }

    /// Images as [`Network::forward`] takes them: what the units see at every place, places of a
    /// pooling window × images × windows × inputs. A convolution is then a product of matrices, and
    /// made of fixed images only once.
    ///
    /// # Errors
    /// If an image is not of the shape's size.
    pub fn seen(&self, images: &[&Grid<f64>]) -> Result<Tensor> {
        if let Some(other) = images.iter().find(|image| (image.height(), image.width()) != self.image) {
            let (height, width) = self.image;
            candle_core::bail!(
                "expected images of {height} × {width} pixels, found {} × {}",
                other.height(),
                other.width()
            );
        }
        let [window, (rows, columns)] = self.pooled();
        let (height, width) = self.field();
        let grid = |(rows, columns): (usize, usize)| {
            (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)))
        };
        let mut seen = Vec::new();
        for within in grid(window) {
            for image in images {
                for place in grid((rows, columns)) {
                    let corner = (place.0 * window.0 + within.0, place.1 * window.1 + within.1);
                    let pixels =
                        grid((height, width)).map(|(row, column)| (corner.0 + row, corner.1 + column));
                    seen.extend(pixels.map(|pixel| image[pixel] as f32));
                    seen.push(1.0);
                }
            }
        }
        let dims = (window.0 * window.1, images.len(), rows * columns, self.inputs());
        Tensor::from_vec(seen, dims, &Device::Cpu)
    }
}

/// A network with two outputs.
pub struct Network {
    shape: Shape,
    /// Weights of the hidden layer (inputs × size), the biases in the last row; weights and biases
    /// of the outputs.
    parameters: [Var; 3],
}

/// Outputs: the two groups of a task.
const OUTPUTS: usize = 2;

impl Network {
    /// With random parameters: uniform within ±1/√(inputs of a unit), as PyTorch starts such
    /// layers.
    ///
    /// # Errors
    /// If the library has no memory for them.
    pub fn new(shape: Shape, rng: &mut Stream) -> Result<Self> {
        let (inputs, features) = (shape.inputs(), shape.features());
        let mut uniform = |dims: &[usize], inputs: usize| {
            let bound = 1.0 / (inputs as f64).sqrt();
            let count: usize = dims.iter().product();
            let values: Vec<f32> = (0..count).map(|_| rng.uniform(-bound, bound) as f32).collect();
            Var::from_tensor(&Tensor::from_vec(values, dims, &Device::Cpu)?)
        };
        let hidden = uniform(&[inputs, shape.size], inputs - 1)?;
        let weights = uniform(&[features, OUTPUTS], features)?;
        let biases = uniform(&[OUTPUTS], features)?;
        Ok(Network { shape, parameters: [hidden, weights, biases] })
    }

    /// What training changes.
    pub fn parameters(&self) -> Vec<Var> {
        self.parameters.to_vec()
    }

    /// Numbers that training changes.
    pub fn count(&self) -> usize {
        self.parameters.iter().map(|parameter| parameter.elem_count()).sum()
    }

    /// Images, [seen](Shape::seen) by its shape, to outputs (n × 2) before the softmax.
    ///
    /// # Errors
    /// If another shape saw them.
    pub fn forward(&self, seen: &Tensor) -> Result<Tensor> {
        let [hidden, weights, biases] = &self.parameters;
        let (within, images, _, inputs) = seen.dims4()?;
        let units = seen.reshape(((), inputs))?.matmul(hidden)?.reshape((within, ()))?;
        let activation = self.shape.activation;
        let features = match self.shape.pooling {
            Pooling::Mean if within > 1 => activation.apply(&units)?.mean(0)?,
            // No activation ever falls: the largest stays the largest.
            _ => activation.apply(&largest(&units, 0, within)?)?,
        };
        features.reshape((images, ()))?.matmul(weights)?.broadcast_add(biases)
    }
}

/// The largest of each column of some rows.
fn largest(rows: &Tensor, first: usize, count: usize) -> Result<Tensor> {
    if count <= 1 {
        return rows.get(first);
    }
    let half = count / 2;
    largest(rows, first, half)?.maximum(&largest(rows, first + half, count - half)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};

    const IMAGE: (usize, usize) = (7, 6);

    fn images() -> Vec<Grid<f64>> {
        let rng = &mut stream(5, Purpose::Networks, 0, 0);
        (0..3).map(|_| Grid::from_fn(IMAGE.0, IMAGE.1, |_, _| rng.uniform(0.0, 1.0))).collect()
    }

    fn shape(kind: Kind, activation: Activation, pooling: Pooling) -> Shape {
        Shape { kind, size: 4, image: IMAGE, kernel: 3, activation, pooling }
    }

    /// What one hidden unit makes of a place, by hand.
    fn unit(
        shape: &Shape,
        hidden: &[Vec<f32>],
        unit: usize,
        image: &Grid<f64>,
        corner: (usize, usize),
    ) -> f64 {
        let (height, width) = shape.field();
        let mut sum = f64::from(hidden[height * width][unit]);
        for row in 0..height {
            for column in 0..width {
                let weight = f64::from(hidden[row * width + column][unit]);
                sum += weight * image[(corner.0 + row, corner.1 + column)];
            }
        }
        match shape.activation {
            Activation::Relu => sum.max(0.0),
            Activation::Tanh => sum.tanh(),
            Activation::Sigmoid => 1.0 / (1.0 + (-sum).exp()),
        }
    }

    #[test]
    fn a_network_is_what_its_layers_say() {
        let images = images();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let most = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for activation in [Activation::Relu, Activation::Tanh, Activation::Sigmoid] {
            for (kind, pooling) in [
                (Kind::Mlp, Pooling::None),
                (Kind::Mlp, Pooling::Mean),
                (Kind::Cnn, Pooling::None),
                (Kind::Cnn, Pooling::Max2),
                (Kind::Cnn, Pooling::Mean),
                (Kind::Cnn, Pooling::Max),
            ] {
                let shape = shape(kind, activation, pooling);
                let network = Network::new(shape, &mut stream(1, Purpose::Networks, 0, 0)).unwrap();
                let [hidden, weights, biases] = &network.parameters;
                let (hidden, weights) = (hidden.to_vec2().unwrap(), weights.to_vec2::<f32>().unwrap());
                let biases = biases.to_vec1::<f32>().unwrap();
                let outputs = network.forward(&shape.seen(&images.iter().collect::<Vec<_>>()).unwrap());
                for (image, found) in images.iter().zip(outputs.unwrap().to_vec2::<f32>().unwrap()) {
                    // A 7 × 6 image has 5 × 4 places for 3 × 3 kernels, in 2 × 2 windows of 2 × 2.
                    let corners = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
                        rows.flat_map(|row| columns.clone().map(move |column| (row, column)))
                            .collect::<Vec<_>>()
                    };
                    let windows: Vec<Vec<(usize, usize)>> = match (kind, pooling) {
                        (Kind::Mlp, _) => vec![vec![(0, 0)]],
                        (_, Pooling::None) => {
                            corners(0..5, 0..4).into_iter().map(|corner| vec![corner]).collect()
                        }
                        (_, Pooling::Max2) => corners(0..2, 0..2)
                            .into_iter()
                            .map(|(row, column)| corners(2 * row..2 * row + 2, 2 * column..2 * column + 2))
                            .collect(),
                        (_, Pooling::Mean | Pooling::Max) => vec![corners(0..5, 0..4)],
                    };
                    let mut expected: Vec<f64> = biases.iter().map(|bias| f64::from(*bias)).collect();
                    for (number, window) in windows.iter().enumerate() {
                        for k in 0..shape.size {
                            let all: Vec<f64> = window
                                .iter()
                                .map(|corner| unit(&shape, &hidden, k, image, *corner))
                                .collect();
                            let pooled = if pooling == Pooling::Mean { mean(&all) } else { most(&all) };
                            for (output, sum) in expected.iter_mut().enumerate() {
                                *sum += pooled * f64::from(weights[number * shape.size + k][output]);
                            }
                        }
                    }
                    for (found, expected) in found.iter().zip(expected) {
                        let off = (f64::from(*found) - expected).abs();
                        assert!(off < 1e-5, "{kind:?} {activation:?} {pooling:?}: {found} {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn images_of_another_size_are_refused() {
        let other = Grid::from_fn(6, 7, |_, _| 0.0);
        let shape = shape(Kind::Cnn, Activation::Relu, Pooling::Max2);
        let error = shape.seen(&[&other]).unwrap_err().to_string();
        assert!(error.contains("7 × 6") && error.contains("6 × 7"), "{error}");
    }
}
