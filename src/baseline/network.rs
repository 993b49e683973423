//! [`Network`]: the paper's two networks and their gradients, on nalgebra. Sums run in a fixed
//! order and functions come from `libm`, so training gives the same bits on any machine and any
//! number of threads.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::baseline::settings::{Activation, NetworkKind, Pooling};
use nalgebra::{DVector, DVectorView};
use std::ops::Range;

impl Activation {
    fn apply(self, numbers: &mut [f64]) {
        match self {
            Activation::Relu => {
                for x in numbers {
                    *x = if *x > 0.0 { *x } else { 0.0 };
                }
            }
            Activation::Tanh => {
                for x in numbers {
                    *x = libm::tanh(*x);
                }
            }
            Activation::Sigmoid => {
                for x in numbers {
                    *x = 1.0 / (1.0 + libm::exp(-*x));
                }
            }
        }
    }

    #[inline]
    fn slope(self, value: f64) -> f64 {
        match self {
            Activation::Relu => f64::from(u8::from(value > 0.0)),
            Activation::Tanh => 1.0 - value * value,
            Activation::Sigmoid => value * (1.0 - value),
        }
    }
}

impl Pooling {
    /// Returns the rows and columns of pixels that become one, in a map of this size.
    fn window(self, (rows, columns): (usize, usize)) -> (usize, usize) {
        match self {
            Pooling::None => (1, 1),
            Pooling::Max2 => (2, 2),
            Pooling::Mean | Pooling::Max => (rows, columns),
        }
    }
}

/// Shape of a network: all that determines it besides its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) kind: NetworkKind,
    /// Number of hidden neurons or kernels, 1 or more.
    pub(crate) size: usize,
    /// Rows and columns of an image.
    pub(crate) image: (usize, usize),
    /// Side of a convolution's kernels, at most the image's.
    pub(crate) kernel: usize,
    pub(crate) activation: Activation,
    pub(crate) pooling: Pooling,
}

/// Number of outputs: the two groups of a task.
pub(crate) const OUTPUTS: usize = 2;

impl Shape {
    /// Returns the rows and columns of an image that a hidden unit covers at one place.
    fn field(&self) -> (usize, usize) {
        match self.kind {
            NetworkKind::Mlp => self.image,
            NetworkKind::Cnn => (self.kernel, self.kernel),
        }
    }

    /// Returns the number of pixels that a hidden unit covers at one place.
    fn inputs(&self) -> usize {
        self.field().0 * self.field().1
    }

    /// Returns the rows and columns of places that pooling reduces to one, and of the places it
    /// leaves. An MLP has one place, the whole image.
    fn pooled(&self) -> [(usize, usize); 2] {
        let (rows, columns) = (
            self.image.0 + 1 - self.field().0,
            self.image.1 + 1 - self.field().1,
        );
        let window = match self.kind {
            NetworkKind::Mlp => (1, 1),
            NetworkKind::Cnn => self.pooling.window((rows, columns)),
        };
        [window, (rows / window.0, columns / window.1)]
    }

    /// Returns the number of places that pooling reduces to one, and the number that it leaves.
    fn places(&self) -> (usize, usize) {
        let [window, pooled] = self.pooled();
        (window.0 * window.1, pooled.0 * pooled.1)
    }

    /// Returns the number of outputs of the hidden layer per image, after pooling.
    fn features(&self) -> usize {
        self.places().1 * self.size
    }

    /// Returns the ranges of the parameters in one vector: hidden weights (by pixel, then by unit),
    /// hidden biases, output weights (by output, then by feature), output biases.
    fn layout(&self) -> [Range<usize>; 4] {
        let sizes = [
            self.inputs() * self.size,
            self.size,
            self.features() * OUTPUTS,
            OUTPUTS,
        ];
        let mut end = 0;
        sizes.map(|size| {
            end += size;
            end - size..end
        })
    }

    /// Prepares an image: the lit pixels under the hidden units at each place. Most pixels of a
    /// drawing are dark and add nothing to a sum, so leaving them out saves most of the work.
    ///
    /// # Panics
    /// If the image does not have the shape's size.
    pub(crate) fn patches(&self, image: &Grid<f64>) -> Patches {
        assert_eq!(
            (image.height(), image.width()),
            self.image,
            "an image of the shape's size"
        );
        let [window, pooled] = self.pooled();
        let grid = |(rows, columns): (usize, usize)| {
            (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)))
        };
        let mut patches = Patches {
            ends: Vec::new(),
            lit: Vec::new(),
        };
        for place in grid(pooled) {
            for within in grid(window) {
                let corner = (place.0 * window.0 + within.0, place.1 * window.1 + within.1);
                let pixels = grid(self.field())
                    .map(|(row, column)| image[(corner.0 + row, corner.1 + column)]);
                patches
                    .lit
                    .extend(pixels.enumerate().filter(|(_, value)| *value != 0.0));
                patches.ends.push(patches.lit.len());
            }
        }
        patches
    }
}

/// An image as the inputs of a network's hidden units.
#[derive(Clone, Debug)]
pub(crate) struct Patches {
    /// End of each place's pixels in `lit`; places that pooling reduces to one are neighbours.
    ends: Vec<usize>,
    /// Index of the pixel within its place, and its value.
    lit: Vec<(usize, f64)>,
}

impl Patches {
    fn at(&self, place: usize) -> &[(usize, f64)] {
        let begin = if place == 0 { 0 } else { self.ends[place - 1] };
        &self.lit[begin..self.ends[place]]
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Network {
    shape: Shape,
    parameters: DVector<f64>,
    /// Activations of the hidden units, by place, then by unit.
    units: Vec<f64>,
    /// Outputs of the hidden layer after pooling, by place, then by unit.
    features: DVector<f64>,
}

impl Network {
    /// Makes a network with parameters uniform within ±1/√(inputs of a unit), as in PyTorch.
    pub(crate) fn new(shape: Shape, rng: &mut Stream) -> Self {
        let [hidden, biases, weights, output_biases] = shape.layout();
        let (size, features) = (shape.size, shape.features());
        let mut parameters = DVector::zeros(output_biases.end);
        let mut draw = |inputs: usize| {
            let bound = 1.0 / (inputs as f64).sqrt();
            rng.uniform(-bound, bound)
        };
        for parameter in hidden.chain(biases) {
            parameters[parameter] = draw(shape.inputs());
        }
        for feature in 0..features {
            for output in 0..OUTPUTS {
                parameters[weights.start + output * features + feature] = draw(features);
            }
        }
        for parameter in output_biases {
            parameters[parameter] = draw(features);
        }
        let (within, places) = shape.places();
        let units = vec![0.0; within * places * size];
        Network {
            shape,
            parameters,
            units,
            features: DVector::zeros(features),
        }
    }

    pub(crate) fn parameters(&self) -> &DVector<f64> {
        &self.parameters
    }

    pub(crate) fn parameters_mut(&mut self) -> &mut DVector<f64> {
        &mut self.parameters
    }

    fn output_weights(&self, output: usize) -> DVectorView<'_, f64> {
        let [_, _, weights, _] = self.shape.layout();
        let features = self.shape.features();
        self.parameters
            .rows(weights.start + output * features, features)
    }

    /// Computes the outputs for an image, before the softmax.
    pub(crate) fn forward(&mut self, image: &Patches) -> [f64; OUTPUTS] {
        let Shape {
            size, activation, ..
        } = self.shape;
        let [hidden, biases, _, output_biases] = self.shape.layout();
        let hidden = &self.parameters.as_slice()[hidden];
        let biases = &self.parameters.as_slice()[biases];
        for place in 0..self.units.len() / size {
            let units = &mut self.units[place * size..][..size];
            weighted_sums(units, biases, image.at(place), hidden);
        }
        activation.apply(&mut self.units);
        let (within, _) = self.shape.places();
        let features = self.features.as_mut_slice();
        for first in (0..features.len()).step_by(size) {
            let units = &self.units[first * within..][..size * within];
            pool(&mut features[first..][..size], units, self.shape.pooling);
        }
        let output = |output: usize| {
            self.output_weights(output).dot(&self.features)
                + self.parameters[output_biases.start + output]
        };
        std::array::from_fn(output)
    }

    /// Adds to `gradient` a loss's derivatives, given those by the outputs, for the last `forward`.
    pub(crate) fn backward(
        &self,
        image: &Patches,
        outputs: [f64; OUTPUTS],
        gradient: &mut DVector<f64>,
    ) {
        let Shape {
            size,
            activation,
            pooling,
            ..
        } = self.shape;
        let [hidden, biases, weights, output_biases] = self.shape.layout();
        let features = self.shape.features();
        let mut by_features = DVector::zeros(features);
        for (output, derivative) in outputs.into_iter().enumerate() {
            gradient
                .rows_mut(weights.start + output * features, features)
                .axpy(derivative, &self.features, 1.0);
            gradient[output_biases.start + output] += derivative;
            by_features.axpy(derivative, &self.output_weights(output), 1.0);
        }
        let (within, _) = self.shape.places();
        let mut by_units = vec![0.0; size];
        for (place, units) in self.units.chunks_exact(size).enumerate() {
            let feature = place / within * size;
            for (number, derivative) in by_units.iter_mut().enumerate() {
                let share = match pooling {
                    _ if within == 1 => 1.0,
                    Pooling::Mean => 1.0 / within as f64,
                    // The first of equals gets all of it.
                    _ => {
                        let of_place = (place / within * within..place)
                            .all(|other| self.units[other * size + number] < units[number]);
                        f64::from(u8::from(
                            of_place && units[number] == self.features[feature + number],
                        ))
                    }
                };
                *derivative =
                    by_features[feature + number] * share * activation.slope(units[number]);
            }
            let gradient = gradient.as_mut_slice();
            add_scaled(&mut gradient[biases.clone()], 1.0, &by_units);
            for &(pixel, value) in image.at(place) {
                add_scaled(
                    &mut gradient[hidden.start + pixel * size..][..size],
                    value,
                    &by_units,
                );
            }
        }
    }
}

// Plain loops: most of the time goes here, and library iterators are not always inlined.

/// Computes units from their biases and the values of pixels; `weights` by pixel, then by unit.
fn weighted_sums(units: &mut [f64], biases: &[f64], pixels: &[(usize, f64)], weights: &[f64]) {
    let mut first = 0;
    while units.len() - first >= 8 {
        weighted_sums_of::<8>(units, biases, pixels, weights, first);
        first += 8;
    }
    if units.len() - first >= 4 {
        weighted_sums_of::<4>(units, biases, pixels, weights, first);
        first += 4;
    }
    while first < units.len() {
        weighted_sums_of::<1>(units, biases, pixels, weights, first);
        first += 1;
    }
}

/// Computes `N` units from `first` on, which stay in registers.
#[inline]
#[expect(clippy::manual_memcpy, reason = "so few numbers are not worth a call")]
fn weighted_sums_of<const N: usize>(
    units: &mut [f64],
    biases: &[f64],
    pixels: &[(usize, f64)],
    weights: &[f64],
    first: usize,
) {
    let size = units.len();
    let biases = &biases[first..][..N];
    let mut sums = [0.0; N];
    for i in 0..N {
        sums[i] = biases[i];
    }
    for &(pixel, value) in pixels {
        let weights = &weights[pixel * size + first..][..N];
        for i in 0..N {
            sums[i] += value * weights[i];
        }
    }
    let units = &mut units[first..][..N];
    for i in 0..N {
        units[i] = sums[i];
    }
}

/// Reduces the units of some places, place by place, to one feature per unit.
fn pool(features: &mut [f64], units: &[f64], pooling: Pooling) {
    let size = features.len();
    let within = units.len() / size;
    features.copy_from_slice(&units[..size]);
    for place in 1..within {
        let units = &units[place * size..][..size];
        if pooling == Pooling::Mean {
            for i in 0..size {
                features[i] += units[i];
            }
        } else {
            for i in 0..size {
                features[i] = if units[i] > features[i] {
                    units[i]
                } else {
                    features[i]
                };
            }
        }
    }
    if pooling == Pooling::Mean {
        for feature in features {
            *feature /= within as f64;
        }
    }
}

#[inline]
fn add_scaled(sums: &mut [f64], factor: f64, terms: &[f64]) {
    let terms = &terms[..sums.len()];
    for i in 0..sums.len() {
        sums[i] += factor * terms[i];
    }
}

/// Returns the cross-entropy of outputs against an image's group, and its derivatives by them.
pub(crate) fn cross_entropy(outputs: [f64; OUTPUTS], group: usize) -> (f64, [f64; OUTPUTS]) {
    let largest = outputs.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let powers = outputs.map(|output| libm::exp(output - largest));
    let sum: f64 = powers.iter().sum();
    let loss = libm::log(sum) - (outputs[group] - largest);
    let derivative = |output: usize| powers[output] / sum - f64::from(u8::from(output == group));
    (loss, std::array::from_fn(derivative))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};

    const IMAGE: (usize, usize) = (7, 6);

    /// Makes noise in which every third pixel is dark.
    fn images() -> Vec<Grid<f64>> {
        let rng = &mut stream(5, Purpose::Networks, 0, 0);
        let pixel = |row: usize, column: usize, rng: &mut Stream| {
            if (row + column).is_multiple_of(3) {
                0.0
            } else {
                rng.uniform(0.0, 1.0)
            }
        };
        (0..3)
            .map(|_| Grid::from_fn(IMAGE.0, IMAGE.1, |row, column| pixel(row, column, rng)))
            .collect()
    }

    fn shapes() -> impl Iterator<Item = Shape> {
        let layers = [
            (NetworkKind::Mlp, Pooling::None),
            (NetworkKind::Mlp, Pooling::Mean),
            (NetworkKind::Cnn, Pooling::None),
            (NetworkKind::Cnn, Pooling::Max2),
            (NetworkKind::Cnn, Pooling::Mean),
            (NetworkKind::Cnn, Pooling::Max),
        ];
        [Activation::Relu, Activation::Tanh, Activation::Sigmoid]
            .into_iter()
            .flat_map(move |activation| {
                layers.map(|(kind, pooling)| Shape {
                    kind,
                    size: 4,
                    image: IMAGE,
                    kernel: 3,
                    activation,
                    pooling,
                })
            })
    }

    fn network(shape: Shape) -> Network {
        Network::new(shape, &mut stream(1, Purpose::Networks, 0, 0))
    }

    /// Computes a hidden unit at a place by its definition.
    fn unit(network: &Network, unit: usize, image: &Grid<f64>, corner: (usize, usize)) -> f64 {
        let shape = network.shape;
        let (height, width) = shape.field();
        let weight = |input: usize| network.parameters[input * shape.size + unit];
        let mut sum = weight(height * width);
        for row in 0..height {
            for column in 0..width {
                sum += weight(row * width + column) * image[(corner.0 + row, corner.1 + column)];
            }
        }
        match shape.activation {
            Activation::Relu => sum.max(0.0),
            Activation::Tanh => sum.tanh(),
            Activation::Sigmoid => 1.0 / (1.0 + (-sum).exp()),
        }
    }

    #[test]
    fn outputs_follow_from_the_definition_of_the_layers() {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let most = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for shape in shapes() {
            let mut network = network(shape);
            // A 7 × 6 image has 5 × 4 places for 3 × 3 kernels, in 2 × 2 windows of 2 × 2.
            let corners = |rows: Range<usize>, columns: Range<usize>| {
                rows.flat_map(|row| columns.clone().map(move |column| (row, column)))
                    .collect::<Vec<_>>()
            };
            let windows: Vec<Vec<(usize, usize)>> = match (shape.kind, shape.pooling) {
                (NetworkKind::Mlp, _) => vec![vec![(0, 0)]],
                (_, Pooling::None) => corners(0..5, 0..4)
                    .into_iter()
                    .map(|corner| vec![corner])
                    .collect(),
                (_, Pooling::Max2) => corners(0..2, 0..2)
                    .into_iter()
                    .map(|(row, column)| corners(2 * row..2 * row + 2, 2 * column..2 * column + 2))
                    .collect(),
                (_, Pooling::Mean | Pooling::Max) => vec![corners(0..5, 0..4)],
            };
            let features = windows.len() * shape.size;
            let [_, _, weights, biases] = shape.layout();
            for image in images() {
                let found = network.forward(&shape.patches(&image));
                for (output, found) in found.into_iter().enumerate() {
                    let mut expected = network.parameters[biases.start + output];
                    for (number, window) in windows.iter().enumerate() {
                        for k in 0..shape.size {
                            let all: Vec<f64> = window
                                .iter()
                                .map(|corner| unit(&network, k, &image, *corner))
                                .collect();
                            let pooled = if shape.pooling == Pooling::Mean {
                                mean(&all)
                            } else {
                                most(&all)
                            };
                            let weight =
                                weights.start + output * features + number * shape.size + k;
                            expected += pooled * network.parameters[weight];
                        }
                    }
                    assert!(
                        (found - expected).abs() < 1e-12,
                        "{shape:?}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        const STEP: f64 = 1e-5;
        for shape in shapes() {
            let mut network = network(shape);
            let images: Vec<Patches> = images().iter().map(|image| shape.patches(image)).collect();
            let loss = |network: &mut Network| -> f64 {
                let of_image =
                    |(number, image)| cross_entropy(network.forward(image), number % 2).0;
                images.iter().enumerate().map(of_image).sum()
            };
            let mut gradient = DVector::zeros(network.parameters.len());
            for (number, image) in images.iter().enumerate() {
                let (_, by_outputs) = cross_entropy(network.forward(image), number % 2);
                network.backward(image, by_outputs, &mut gradient);
            }
            for parameter in 0..network.parameters.len() {
                let kept = network.parameters[parameter];
                let [above, below] = [STEP, -STEP].map(|step| {
                    network.parameters[parameter] = kept + step;
                    loss(&mut network)
                });
                network.parameters[parameter] = kept;
                let (found, expected) = (gradient[parameter], (above - below) / (2.0 * STEP));
                assert!(
                    (found - expected).abs() < 1e-8,
                    "{shape:?}, {parameter}: {found} {expected}"
                );
            }
        }
    }
}
