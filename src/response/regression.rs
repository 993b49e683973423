//! The response of a gait: the displacement of a body for each voxel that is a little wider.
//!
//! The displacement of a walking body depends nearly linearly on the widths of its passive voxels,
//! d ≈ c + Σ Jᵢ wᵢ. Linear regression finds the *slopes* J from a body whose soft voxels and
//! sensors are all expanding sensors, under images with independent random pixels: an intervention
//! on every voxel by itself. (Natural images only reveal what goes together.) The slopes belong to
//! the gait, so they serve every task: a [`DesignProblem`](super::design_problem::DesignProblem) finds its sensors.

use nalgebra::{DMatrix, DVector};

/// Penalties on slopes among which cross-validation chooses \[rollouts × squared rest widths\].
/// Larger ones shrink the slopes; smaller ones fit noise if there are few rollouts.
const RIDGES: [f64; 7] = [0.25, 1.0, 2.0, 4.0, 8.0, 16.0, 64.0];

/// Folds of the cross-validation. More cost time and change little.
const FOLDS: usize = 5;

/// Sums over rollouts with one intercept: widths of the places, displacement, and their products.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    count: f64,
    widths: DVector<f64>,
    displacement: f64,
    products: DMatrix<f64>,
    with_displacement: DVector<f64>,
}

impl Moments {
    pub(crate) fn new(places: usize) -> Self {
        Moments {
            count: 0.0,
            widths: DVector::zeros(places),
            displacement: 0.0,
            products: DMatrix::zeros(places, places),
            with_displacement: DVector::zeros(places),
        }
    }

    /// Adds a rollout: target widths of the places, and displacement in voxel lengths.
    pub(crate) fn add(&mut self, widths: &[f64], displacement: f64) {
        let widths = DVector::from_column_slice(widths);
        self.count += 1.0;
        self.displacement += displacement;
        self.with_displacement.axpy(displacement, &widths, 1.0);
        for (mut column, width) in self.products.column_iter_mut().zip(widths.iter()) {
            column.axpy(*width, &widths, 1.0);
        }
        self.widths += widths;
    }

    /// Returns the mean displacement \[voxel lengths\]; 0 without rollouts.
    pub(crate) fn mean(&self) -> f64 {
        if self.count > 0.0 {
            self.displacement / self.count
        } else {
            0.0
        }
    }

    fn plus(&self, other: &Moments, sign: f64) -> Self {
        Moments {
            count: self.count + sign * other.count,
            widths: &self.widths + &other.widths * sign,
            displacement: self.displacement + sign * other.displacement,
            products: &self.products + &other.products * sign,
            with_displacement: &self.with_displacement + &other.with_displacement * sign,
        }
    }

    /// Returns the intercept that fits these slopes \[voxel lengths\]; `None` without rollouts.
    pub(crate) fn intercept(&self, slopes: &[f64]) -> Option<f64> {
        let explained: f64 = self
            .widths
            .iter()
            .zip(slopes)
            .map(|(width, slope)| width * slope)
            .sum();
        (self.count > 0.0).then(|| (self.displacement - explained) / self.count)
    }
}

/// Sums over sets of rollouts, each about its own means: sets may differ in intercepts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Evidence {
    matrix: DMatrix<f64>,
    vector: DVector<f64>,
}

impl Evidence {
    pub(crate) fn new(places: usize) -> Self {
        Evidence {
            matrix: DMatrix::zeros(places, places),
            vector: DVector::zeros(places),
        }
    }

    pub(crate) fn add(&mut self, set: &Moments, weight: f64) {
        if set.count == 0.0 {
            return;
        }
        let mean = &set.widths / set.count;
        self.matrix += &set.products * weight;
        for (mut column, width) in self.matrix.column_iter_mut().zip(set.widths.iter()) {
            column.axpy(-weight * width, &mean, 1.0);
        }
        self.vector += &set.with_displacement * weight;
        self.vector.axpy(-weight * set.displacement, &mean, 1.0);
    }

    /// Scales the weight of the evidence so far by a factor.
    pub(crate) fn fade(&mut self, factor: f64) {
        self.matrix *= factor;
        self.vector *= factor;
    }

    /// Returns the slopes with the least bias: by ridge regression with the smallest penalty.
    pub(crate) fn least_biased(&self) -> Fit {
        let factor = self.factor(RIDGES[0]);
        Fit {
            slopes: factor.solve(&self.vector).as_slice().to_vec(),
            factor,
        }
    }

    /// Returns the slopes by ridge regression, and their standard errors in units of a rollout's
    /// noise.
    ///
    /// # Panics
    /// If `ridge` is not above 0.
    pub(crate) fn slopes(&self, ridge: f64) -> (Vec<f64>, Vec<f64>) {
        let factor = self.factor(ridge);
        let inverse = factor.inverse();
        let errors = (0..self.vector.len())
            .map(|i| inverse[(i, i)].sqrt())
            .collect();
        (factor.solve(&self.vector).as_slice().to_vec(), errors)
    }

    /// Embeds the evidence in more places: its n-th place gets the n-th of these numbers.
    pub(crate) fn among(&self, numbers: &[usize], places: usize) -> Self {
        let mut all = Evidence::new(places);
        for (i, &row) in numbers.iter().enumerate() {
            all.vector[row] = self.vector[i];
            for (j, &column) in numbers.iter().enumerate() {
                all.matrix[(row, column)] = self.matrix[(i, j)];
            }
        }
        all
    }

    /// Returns the slopes by ridge regression.
    ///
    /// # Panics
    /// If `ridge` is not above 0.
    pub(crate) fn slopes_alone(&self, ridge: f64) -> Vec<f64> {
        self.factor(ridge).solve(&self.vector).as_slice().to_vec()
    }

    fn factor(&self, ridge: f64) -> nalgebra::Cholesky<f64, nalgebra::Dyn> {
        assert!(ridge > 0.0, "a ridge is above 0");
        let mut matrix = self.matrix.clone();
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += ridge);
        matrix
            .cholesky()
            .expect("sums of squares plus a ridge above 0 are positive definite")
    }
}

/// Slopes, and their variance over other rollouts.
pub(crate) struct Fit {
    /// The slopes, in the places' order \[voxel lengths\].
    pub(crate) slopes: Vec<f64>,
    factor: nalgebra::Cholesky<f64, nalgebra::Dyn>,
}

impl Fit {
    /// Returns the expected squared error of the weighted sum of the slopes, and its part due to
    /// noise, not bias; both in units of a rollout's squared scatter. Assumes that true slopes vary
    /// as `ridge`, the chosen penalty, implies.
    pub(crate) fn variance(&self, weights: &[f64], ridge: f64) -> (f64, f64) {
        let weights = DVector::from_column_slice(weights);
        let solved = self.factor.solve(&weights);
        let held_back = RIDGES[0] * solved.dot(&solved);
        let noise = solved.dot(&weights) - held_back;
        (noise + held_back * RIDGES[0] / ridge, noise)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Response {
    /// Displacement to the right per place that is wider by a rest width \[voxel lengths\].
    pub(crate) slopes: Vec<f64>,
    /// Standard errors of the slopes, including the shrinkage by the penalty \[voxel lengths\].
    pub(crate) errors: Vec<f64>,
    /// Displacement of a body with all places of width 0, mean over conditions \[voxel lengths\].
    pub(crate) intercept: f64,
    /// Intercept under each condition; none without rollouts.
    pub(crate) intercepts: Vec<Option<f64>>,
    /// Standard deviation about cross-validated predictions \[voxel lengths\].
    pub(crate) noise: f64,
    /// Standard deviation about predictions from the true slopes \[voxel lengths\].
    pub(crate) scatter: f64,
    /// Fraction of the displacements' variance that slopes fitted to other rollouts explain.
    pub(crate) r_squared: f64,
    pub(crate) ridge: f64,
    pub(crate) evidence: Evidence,
}

/// A rollout under a random image.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomRollout {
    /// Target width of each place \[rest widths\].
    pub widths: Vec<f64>,
    /// Displacement to the right \[voxel lengths\].
    pub displacement: f64,
    /// Number of its condition; each condition has an intercept of its own.
    pub condition: usize,
}

impl Response {
    /// Fits slopes with the penalty that predicts left-out rollouts best; `None` if too few.
    pub(crate) fn of(rollouts: &[RandomRollout]) -> Option<Self> {
        let places = rollouts.first()?.widths.len();
        if rollouts.len() < 2 * FOLDS {
            return None;
        }
        let conditions = 1 + rollouts.iter().map(|shown| shown.condition).max()?;
        let mut folds = vec![vec![Moments::new(places); conditions]; FOLDS];
        for (number, shown) in rollouts.iter().enumerate() {
            // Folds alternate within a condition, whatever the order of the conditions.
            folds[(number / conditions) % FOLDS][shown.condition]
                .add(&shown.widths, shown.displacement);
        }
        let total = |condition: usize| {
            folds.iter().fold(Moments::new(places), |sum, fold| {
                sum.plus(&fold[condition], 1.0)
            })
        };
        let all: Vec<Moments> = (0..conditions).map(total).collect();
        let spread: f64 = rollouts
            .iter()
            .map(|s| squared(s.displacement - all[s.condition].mean()))
            .sum();
        let evidence = |sets: &[Moments]| {
            let mut evidence = Evidence::new(places);
            sets.iter().for_each(|set| evidence.add(set, 1.0));
            evidence
        };
        let missed = |ridge: f64| -> f64 {
            let mut sum = 0.0;
            for (number, fold) in folds.iter().enumerate() {
                let others: Vec<Moments> = all
                    .iter()
                    .zip(fold)
                    .map(|(all, own)| all.plus(own, -1.0))
                    .collect();
                let slopes = evidence(&others).slopes_alone(ridge);
                let own = rollouts
                    .iter()
                    .enumerate()
                    .filter(|(n, _)| (n / conditions) % FOLDS == number);
                for (_, shown) in own {
                    let Some(intercept) = others[shown.condition].intercept(&slopes) else {
                        continue;
                    };
                    sum += squared(shown.displacement - intercept - dot(&slopes, &shown.widths));
                }
            }
            sum
        };
        let (mut ridge, mut least) = (RIDGES[0], f64::INFINITY);
        for candidate in RIDGES {
            let sum = missed(candidate);
            if sum < least {
                (ridge, least) = (candidate, sum);
            }
        }
        let noise = (least / rollouts.len() as f64).sqrt();
        let evidence = evidence(&all);
        let (slopes, factors) = evidence.slopes(ridge);
        let found = DVector::from_column_slice(&slopes);
        let left =
            spread - 2.0 * found.dot(&evidence.vector) + (&evidence.matrix * &found).dot(&found);
        // The effective number of parameters, by which residuals are smaller than the scatter.
        let fitted = places as f64 - ridge * dot(&factors, &factors)
            + all.iter().filter(|moments| moments.count > 0.0).count() as f64;
        let scatter = (left.max(0.0) / (rollouts.len() as f64 - fitted).max(1.0)).sqrt();
        let intercepts: Vec<Option<f64>> = all
            .iter()
            .map(|moments| moments.intercept(&slopes))
            .collect();
        let known = intercepts.iter().flatten();
        Some(Response {
            intercept: known.clone().sum::<f64>() / known.count() as f64,
            intercepts,
            slopes,
            errors: factors.into_iter().map(|factor| scatter * factor).collect(),
            noise,
            scatter,
            r_squared: if spread > 0.0 {
                1.0 - least / spread
            } else {
                0.0
            },
            ridge,
            evidence,
        })
    }

    /// Returns the error of the slopes relative to the slopes, 0 to 1: the relative error of
    /// predictions for random images. Its square is the share of the variance that exact slopes
    /// would explain and these do not.
    pub(crate) fn relative_error(&self) -> f64 {
        let weighed = |numbers: &[f64]| -> f64 {
            numbers
                .iter()
                .enumerate()
                .map(|(i, number)| self.evidence.matrix[(i, i)] * squared(*number))
                .sum()
        };
        let off = weighed(&self.errors);
        if off > 0.0 {
            (off / (off + weighed(&self.slopes))).sqrt()
        } else {
            0.0
        }
    }
}

fn squared(x: f64) -> f64 {
    x * x
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, Stream, stream};

    fn random(child: u64) -> Stream {
        stream(1, Purpose::RandomImages, 0, child)
    }

    /// Simulates a linear body: slopes, an intercept for each condition, noise.
    fn planted(
        slopes: &[f64],
        intercepts: &[f64],
        noise: f64,
        count: usize,
        seed: u64,
    ) -> Vec<RandomRollout> {
        let mut random = random(seed);
        let rollout = |number: usize| {
            let widths: Vec<f64> = slopes
                .iter()
                .map(|_| if random.unit() < 0.45 { 1.6 } else { 0.6 })
                .collect();
            let condition = number % intercepts.len();
            let displacement =
                intercepts[condition] + dot(slopes, &widths) + noise * random.normal();
            RandomRollout {
                widths,
                displacement,
                condition,
            }
        };
        (0..count).map(rollout).collect()
    }

    #[test]
    fn the_response_of_a_linear_body_is_recovered_whatever_the_conditions_add() {
        let slopes: Vec<f64> = (0..30).map(|i| f64::from(i % 7) - 3.0).collect();
        let response = Response::of(&planted(&slopes, &[4.0, -9.0, 30.0], 0.0, 120, 1)).unwrap();
        let worst = response
            .slopes
            .iter()
            .zip(&slopes)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(
            worst < 0.1 && response.r_squared > 0.999,
            "{worst} {}",
            response.r_squared
        );
        // Too few for a fit.
        assert_eq!(Response::of(&planted(&slopes, &[0.0], 0.0, 9, 1)), None);
    }

    #[test]
    fn standard_errors_cover_the_slopes_and_noise_is_not_explained() {
        let slopes: Vec<f64> = (0..40).map(|i| 3.0 * f64::from(i % 5) - 6.0).collect();
        let (mut inside, mut all) = (0, 0);
        for seed in 0..10 {
            let response = Response::of(&planted(&slopes, &[1.0, 5.0], 5.0, 400, seed)).unwrap();
            assert!((4.5..6.5).contains(&response.noise), "{}", response.noise);
            let pairs = response.slopes.iter().zip(&response.errors).zip(&slopes);
            inside += pairs
                .filter(|((found, error), slope)| (*found - *slope).abs() < 2.0 * *error)
                .count();
            all += slopes.len();
        }
        let share = f64::from(inside as u32) / f64::from(all as u32);
        assert!((0.9..0.99).contains(&share), "{share}");
        let nothing = Response::of(&planted(&[0.0; 40], &[0.0], 5.0, 200, 1)).unwrap();
        assert!(
            nothing.r_squared < 0.1 && nothing.slopes.iter().all(|slope| slope.abs() < 3.0),
            "{nothing:?}"
        );
    }

    #[test]
    fn standard_errors_are_as_large_as_slopes_are_off_with_few_rollouts_and_many() {
        for (places, rollouts, noise, kind) in [
            (60, 120, 3.0, 0),
            (100, 60, 3.0, 0),
            (100, 300, 10.0, 1),
            (150, 300, 3.0, 2),
            (60, 1000, 10.0, 0),
            (60, 300, 0.5, 1),
        ] {
            let (mut squares, mut within, mut all) = (0.0, 0, 0.0);
            for seed in 0..8 {
                let mut random = random(seed);
                let slope = |place: usize| match kind {
                    0 => 3.0 * random.normal(),
                    // A few are strong.
                    1 if place.is_multiple_of(10) => 10.0 * random.normal(),
                    1 => 0.3 * random.normal(),
                    // All push the same way.
                    _ => 3.0 + random.normal(),
                };
                let slopes: Vec<f64> = (0..places).map(slope).collect();
                let intercepts = [0.0, 3.0, -2.0, 7.0, 1.0, 4.0];
                let shown = planted(&slopes, &intercepts, noise, rollouts, 100 + seed);
                let response = Response::of(&shown).unwrap();
                for ((found, error), slope) in
                    response.slopes.iter().zip(&response.errors).zip(&slopes)
                {
                    let off = (found - slope) / error;
                    squares += off * off;
                    within += usize::from(off.abs() < 2.0);
                    all += 1.0;
                }
            }
            let (size, share) = ((squares / all).sqrt(), within as f64 / all);
            let case = format!("{places} places, {rollouts} rollouts: {size} {share}");
            assert!(
                (0.88..1.12).contains(&size) && (0.92..0.98).contains(&share),
                "{case}"
            );
        }
    }

    #[test]
    fn the_relative_error_is_that_of_what_is_predicted_and_1_where_nothing_is_known() {
        let slopes: Vec<f64> = (0..60).map(|i| 3.0 * f64::from(i % 5) - 6.0).collect();
        for (rollouts, noise) in [(120, 5.0), (600, 5.0), (600, 0.5)] {
            let (mut off, mut said) = (0.0, 0.0);
            for seed in 0..8 {
                let mut shown = planted(&slopes, &[0.0], noise, rollouts, seed);
                // Half of the places are never wider: their slopes are unknown, and irrelevant.
                for shown in &mut shown {
                    for (width, slope) in shown.widths.iter_mut().zip(&slopes).skip(30) {
                        shown.displacement -= slope * (*width - 0.6);
                        *width = 0.6;
                    }
                }
                let response = Response::of(&shown).unwrap();
                let wrong: Vec<f64> = response
                    .slopes
                    .iter()
                    .zip(&slopes)
                    .map(|(a, b)| a - b)
                    .collect();
                off += dot(&wrong[..30], &wrong[..30]) / dot(&slopes[..30], &slopes[..30]) / 8.0;
                said += squared(response.relative_error()) / 8.0;
            }
            let (off, said) = (off.sqrt(), said.sqrt());
            assert!(
                (said / off - 1.0).abs() < 0.15,
                "{rollouts} {noise}: {said}, in truth {off}"
            );
        }
        let nothing = Response::of(&planted(&[0.0; 60], &[0.0], 5.0, 600, 3)).unwrap();
        assert!(
            nothing.relative_error() > 0.6,
            "{}",
            nothing.relative_error()
        );
    }
}
