//! Linear classifiers by least squares: without a body, on the stimuli of robots. Their answers
//! depend on the images alone, to the bit.

use crate::base::Grid;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A stimulus with its class.
pub(crate) type LabelledPixels<'a> = (&'a Grid<f64>, u8);

/// Weight of the penalty on the weights' size, relative to a pixel's mean square over the images.
const RIDGE: f64 = 1e-3;

/// Sums over the training images of each class: all that least squares need.
#[derive(Clone, Debug)]
pub(crate) struct PixelMoments {
    /// Number of pixels of an image, plus one for the constant 1.
    size: usize,
    /// Sum of *x xᵀ* over a class's images; its last column is the sum of *x*.
    by_class: BTreeMap<u8, DMatrix<f64>>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Linear {
    weights: DVector<f64>,
}

/// Returns the nonzero pixels by their indices, followed by the constant 1.
fn sparse(stimulus: &Grid<f64>) -> Vec<(usize, f64)> {
    let pixels = stimulus.cells();
    let lit = pixels
        .iter()
        .copied()
        .enumerate()
        .filter(|(_, value)| *value != 0.0);
    lit.chain([(pixels.len(), 1.0)]).collect()
}

impl PixelMoments {
    /// Sums up training images, all of one size.
    pub(crate) fn new(images: &[LabelledPixels]) -> Self {
        let size = images
            .first()
            .map_or(0, |(stimulus, _)| stimulus.cells().len())
            + 1;
        let mut classes: Vec<u8> = images.iter().map(|(_, class)| *class).collect();
        classes.sort_unstable();
        classes.dedup();
        let of_class = |class: u8| {
            let mut sum = DMatrix::zeros(size, size);
            for (stimulus, _) in images.iter().filter(|(_, other)| *other == class) {
                let lit = sparse(stimulus);
                for (place, &(column, b)) in lit.iter().enumerate() {
                    for &(row, a) in &lit[..=place] {
                        sum[(row, column)] += a * b;
                    }
                }
            }
            sum.fill_lower_triangle_with_upper_triangle();
            (class, sum)
        };
        PixelMoments {
            size,
            by_class: classes.into_par_iter().map(of_class).collect(),
        }
    }

    /// Returns the linear function nearest to 1 under one group, −1 under the other (squares).
    pub(crate) fn apart(&self, first: &[u8], second: &[u8]) -> Linear {
        let mut square = DMatrix::zeros(self.size, self.size);
        let mut towards = DVector::zeros(self.size);
        for (classes, sign) in [(first, 1.0), (second, -1.0)] {
            for sum in classes.iter().filter_map(|class| self.by_class.get(class)) {
                square += sum;
                towards += sum.column(self.size - 1) * sign;
            }
        }
        let penalty = RIDGE * square.trace() / self.size as f64;
        // Without images every function is as good.
        let penalty = if penalty > 0.0 { penalty } else { 1.0 };
        for place in 0..self.size {
            square[(place, place)] += penalty;
        }
        let solved =
            Cholesky::new(square).expect("a sum of squares with a penalty is positive definite");
        Linear {
            weights: solved.solve(&towards),
        }
    }
}

impl Linear {
    /// Returns its value for an image: about 1 for the first group, −1 for the second.
    pub(crate) fn value(&self, stimulus: &Grid<f64>) -> f64 {
        sparse(stimulus)
            .into_iter()
            .map(|(place, value)| self.weights[place] * value)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes images: in class 0 the left of two pixels is brighter, in class 1 the right one.
    fn images() -> Vec<(Grid<f64>, u8)> {
        let of = |k: usize| {
            let (a, b) = ((k % 7) as f64 / 10.0, (k % 5) as f64 / 10.0);
            let class = u8::from(k % 2 == 1);
            let pixels = if class == 0 {
                [a + 0.35, b]
            } else {
                [a, b + 0.65]
            };
            (Grid::from_fn(1, 2, |_, column| pixels[column]), class)
        };
        (0..140).map(of).collect()
    }

    fn labelled(images: &[(Grid<f64>, u8)]) -> Vec<LabelledPixels<'_>> {
        images
            .iter()
            .map(|(stimulus, class)| (stimulus, *class))
            .collect()
    }

    #[test]
    fn least_squares_recover_a_planted_plane() {
        // The mean of ±1 over equally many images of uninformative pixels is the plane itself.
        let images = images();
        let linear = PixelMoments::new(&labelled(&images)).apart(&[0], &[1]);
        let right = images
            .iter()
            .filter(|(image, class)| (linear.value(image) > 0.0) == (*class == 0))
            .count();
        assert!(right >= 120, "{right} of 140");
        // Normal equations: the residual is orthogonal to every pixel, up to the penalty.
        for pixel in [0, 1] {
            let residual = |(image, class): &(Grid<f64>, u8)| {
                (linear.value(image) - if *class == 0 { 1.0 } else { -1.0 }) * image.cells()[pixel]
            };
            let sum: f64 = images.iter().map(residual).sum();
            assert!(sum.abs() < 0.5, "{sum}");
        }
    }

    #[test]
    fn pixels_that_are_always_dark_do_no_harm() {
        let dark: Vec<(Grid<f64>, u8)> = (0..4).map(|k| (Grid::filled(2, 2, 0.0), k % 2)).collect();
        let value = PixelMoments::new(&labelled(&dark))
            .apart(&[0], &[1])
            .value(&dark[0].0);
        assert!(value.abs() < 1e-12);
    }
}
