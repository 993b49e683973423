//! [`Network`]: the paper's two networks and their gradients, on nalgebra. Sums run in a fixed
//! order and functions come from `libm`, so training gives the same bits on any machine and any
//! number of threads.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::baseline::settings::{Activation, NetworkKind, Pooling};
use nalgebra::{DVector, DVectorView};
use std::collections::HashMap;
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

    /// Prepares images: which pixels are lit under the hidden units at each place.
    ///
    /// # Panics
    /// If an image does not have the shape's size.
    pub(crate) fn patches(&self, images: &[&Grid<f64>]) -> Patches {
        let [window, pooled] = self.pooled();
        let grid = |(rows, columns): (usize, usize)| {
            (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)))
        };
        let mut counts: Vec<usize> = Vec::new();
        let mut lit_pixels: Vec<Vec<(usize, f64)>> = Vec::new();
        let mut known: HashMap<Vec<(usize, u64)>, usize> = HashMap::new();
        let mut places = Vec::new();
        for image in images {
            assert_eq!(
                (image.height(), image.width()),
                self.image,
                "an image of the shape's size"
            );
            for place in grid(pooled) {
                for within in grid(window) {
                    let corner = (place.0 * window.0 + within.0, place.1 * window.1 + within.1);
                    let lit: Vec<(usize, f64)> = grid(self.field())
                        .map(|(row, column)| image[(corner.0 + row, corner.1 + column)])
                        .enumerate()
                        .filter(|(_, value)| *value != 0.0)
                        .collect();
                    let bits = lit.iter().map(|(pixel, value)| (*pixel, value.to_bits()));
                    let patch = *known.entry(bits.collect()).or_insert_with(|| {
                        counts.push(0);
                        lit_pixels.push(lit);
                        counts.len() - 1
                    });
                    counts[patch] += 1;
                    places.push(patch);
                }
            }
        }
        drop(known);
        let mut order: Vec<usize> = (0..counts.len()).collect();
        order.sort_by_key(|&patch| counts[patch] == 1);
        let mut numbers = vec![0; order.len()];
        let mut patches = Patches {
            ends: Vec::new(),
            lit: Vec::new(),
            repeated: counts.iter().filter(|&&count| count > 1).count(),
            places,
            per_image: self.places().0 * self.places().1,
        };
        for (number, patch) in order.into_iter().enumerate() {
            numbers[patch] = number;
            patches.lit.append(&mut lit_pixels[patch]);
            patches.ends.push(patches.lit.len());
        }
        for patch in &mut patches.places {
            *patch = numbers[*patch];
        }
        patches
    }
}

/// Images as the inputs of a network's hidden units. A patch is what these cover at a place. Most
/// pixels of a drawing are dark and add nothing to a sum, and most patches occur many times, so
/// leaving out dark pixels and computing repeated patches once saves most of the work.
#[derive(Clone, Debug)]
pub(crate) struct Patches {
    /// End of each patch's pixels in `lit`.
    ends: Vec<usize>,
    /// Index of the pixel within its patch, and its value.
    lit: Vec<(usize, f64)>,
    /// Number of patches that occur more than once; they come first.
    repeated: usize,
    /// Patches by image, then by place; places that pooling reduces to one are neighbours.
    places: Vec<usize>,
    /// Number of places of an image.
    per_image: usize,
}

impl Patches {
    /// Returns the patches of an image, by place.
    fn of(&self, image: usize) -> &[usize] {
        &self.places[image * self.per_image..][..self.per_image]
    }

    /// Returns a patch's lit pixels.
    fn lit(&self, patch: usize) -> &[(usize, f64)] {
        let begin = if patch == 0 { 0 } else { self.ends[patch - 1] };
        &self.lit[begin..self.ends[patch]]
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Network {
    shape: Shape,
    parameters: DVector<f64>,
    /// Activations of the hidden units, by place, then by unit.
    units: Vec<f64>,
    /// Activations after pooling, by place, then by unit; empty if each place is one feature.
    pooled: Vec<f64>,
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
        Network {
            shape,
            parameters,
            units: vec![0.0; within * places * size],
            pooled: vec![0.0; if within == 1 { 0 } else { features }],
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

    /// Returns the outputs of the hidden layer for the last image.
    fn features(&self) -> DVectorView<'_, f64> {
        let features = if self.pooled.is_empty() {
            &self.units
        } else {
            &self.pooled
        };
        DVectorView::from_slice(features, features.len())
    }

    /// Computes the activations of the hidden units for a patch.
    fn activate(&self, lit: &[(usize, f64)], units: &mut [f64]) {
        let [hidden, biases, ..] = self.shape.layout();
        let parameters = self.parameters.as_slice();
        weighted_sums(units, &parameters[biases], lit, &parameters[hidden]);
        self.shape.activation.apply(units);
    }

    /// Computes the activations for all patches that occur more than once, for [`Self::forward`]
    /// with the present parameters.
    pub(crate) fn repeated(&self, images: &Patches) -> Vec<f64> {
        let size = self.shape.size;
        let mut repeated = vec![0.0; images.repeated * size];
        for (patch, units) in repeated.chunks_exact_mut(size).enumerate() {
            self.activate(images.lit(patch), units);
        }
        repeated
    }

    /// Computes the outputs for an image, before the softmax. `repeated` is empty or has the
    /// activations for repeated patches.
    pub(crate) fn forward(
        &mut self,
        images: &Patches,
        image: usize,
        repeated: &[f64],
    ) -> [f64; OUTPUTS] {
        let Shape { size, pooling, .. } = self.shape;
        // Taken out, since `activate` borrows the whole network.
        let mut units = std::mem::take(&mut self.units);
        for (units, &patch) in units.chunks_exact_mut(size).zip(images.of(image)) {
            match repeated.get(patch * size..(patch + 1) * size) {
                Some(known) => units.copy_from_slice(known),
                None => self.activate(images.lit(patch), units),
            }
        }
        self.units = units;
        let (within, _) = self.shape.places();
        let features = self.pooled.chunks_exact_mut(size);
        for (features, units) in features.zip(self.units.chunks_exact(size * within)) {
            pool(features, units, pooling);
        }
        let [.., output_biases] = self.shape.layout();
        let output = |output: usize| {
            self.output_weights(output).dot(&self.features())
                + self.parameters[output_biases.start + output]
        };
        std::array::from_fn(output)
    }

    /// Adds to `gradient` a loss's derivatives, given those by the outputs, for the last `forward`.
    pub(crate) fn backward(
        &self,
        images: &Patches,
        image: usize,
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
        let pooled = self.features();
        let mut by_features = DVector::zeros(features);
        for (output, derivative) in outputs.into_iter().enumerate() {
            gradient
                .rows_mut(weights.start + output * features, features)
                .axpy(derivative, &pooled, 1.0);
            gradient[output_biases.start + output] += derivative;
            by_features.axpy(derivative, &self.output_weights(output), 1.0);
        }
        let (within, _) = self.shape.places();
        let mut by_units = vec![0.0; size];
        let places = self.units.chunks_exact(size).zip(images.of(image));
        for (place, (units, &patch)) in places.enumerate() {
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
                            of_place && units[number] == pooled[feature + number],
                        ))
                    }
                };
                *derivative =
                    by_features[feature + number] * share * activation.slope(units[number]);
            }
            let gradient = gradient.as_mut_slice();
            add_scaled(&mut gradient[biases.clone()], 1.0, &by_units);
            for &(pixel, value) in images.lit(patch) {
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
    const COUNT: usize = 3;

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
        (0..COUNT)
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
            let images = images();
            let patches = shape.patches(&images.iter().collect::<Vec<_>>());
            for (number, image) in images.iter().enumerate() {
                let found = network.forward(&patches, number, &[]);
                for (output, found) in found.into_iter().enumerate() {
                    let mut expected = network.parameters[biases.start + output];
                    for (number, window) in windows.iter().enumerate() {
                        for k in 0..shape.size {
                            let all: Vec<f64> = window
                                .iter()
                                .map(|corner| unit(&network, k, image, *corner))
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
            let images = shape.patches(&images().iter().collect::<Vec<_>>());
            let loss = |network: &mut Network| -> f64 {
                let of_image =
                    |image| cross_entropy(network.forward(&images, image, &[]), image % 2).0;
                (0..COUNT).map(of_image).sum()
            };
            let mut gradient = DVector::zeros(network.parameters.len());
            for image in 0..COUNT {
                let (_, by_outputs) =
                    cross_entropy(network.forward(&images, image, &[]), image % 2);
                network.backward(&images, image, by_outputs, &mut gradient);
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
    #[test]
    fn repeated_patches_change_no_bit_of_the_outputs() {
        // Stripes repeat patches within an image, two equal images all of them.
        let stripes = |period: usize| {
            Grid::from_fn(IMAGE.0, IMAGE.1, |row, column| {
                f64::from(u8::from((row + column).is_multiple_of(period))) * 0.7
            })
        };
        let mut all = images();
        all.extend([stripes(2), stripes(3), stripes(3)]);
        for shape in shapes() {
            let mut network = network(shape);
            let together = shape.patches(&all.iter().collect::<Vec<_>>());
            let repeated = network.repeated(&together);
            assert!(!repeated.is_empty() && together.repeated < together.ends.len());
            for (number, image) in all.iter().enumerate() {
                let found = network.forward(&together, number, &repeated);
                let alone = network.forward(&shape.patches(&[image]), 0, &[]);
                assert_eq!(
                    found.map(f64::to_bits),
                    alone.map(f64::to_bits),
                    "{shape:?}"
                );
            }
        }
    }
}
