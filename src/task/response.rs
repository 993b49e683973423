//! The response of a gait: how far a body is moved by each voxel that is a little wider, and which
//! sensors that calls for.
//!
//! A body that walks is moved by the width of its passive voxels nearly in proportion, d ≈ c + Σ Jᵢ
//! wᵢ. Shown images whose pixels are drawn independently of each other, a body whose soft voxels
//! and sensors have all become expanding sensors tells its *slopes* J by linear regression: an
//! intervention on every voxel by itself. (Natural images only tell what goes together.) The slopes
//! belong to the gait, so they serve every task: for two groups of images, [`Lesson`] finds the
//! material at each place that makes the mean margin largest under that model.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::body::{Body, Material};
use crate::sim::{Physics, width};
use crate::task::fitness::ENOUGH;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// What a place can be made of, without changing what walks.
pub const CHOICES: [Material; 3] = [Material::Soft, Material::SensorExpand, Material::SensorShrink];

/// What a lesson makes places of: sensors. A response is measured with sensors at all
/// places, and says nothing of soft voxels. One is no sensor at rest: it has no goal, so the sides
/// that it shares are as wide as its neighbour wants, and its springs are others (`physics.md`,
/// "Actuation").
pub const SENSORS: [Material; 2] = [CHOICES[CHOSEN.start], CHOICES[CHOSEN.start + 1]];

/// Where these stand in [`CHOICES`].
const CHOSEN: Range<usize> = 1..CHOICES.len();

/// Penalties on slopes among which cross-validation chooses \[rollouts × squared rest widths\].
/// Larger ones shrink the slopes; smaller ones fit noise where there are few rollouts.
const RIDGES: [f64; 7] = [0.25, 1.0, 2.0, 4.0, 8.0, 16.0, 64.0];

/// Probability that a place is wide in a random image, and that it is narrow. A design has about as
/// many of either: larger values say nothing of what is between, as under grey pixels; smaller ones
/// tell less of the slopes.
const EXTREME: f64 = 0.4;

/// Folds of the cross-validation. More cost time and change little.
const FOLDS: usize = 5;

/// Least gain of the objective for which a design is changed: below it is rounding.
const LEAST_GAIN: f64 = 1e-9;

/// Most sweeps over all places; a search ends sooner when a sweep changes nothing.
const SWEEPS: usize = 12;

/// Random designs that a search from many starts from. More cost as much each, and seldom end
/// better.
const STARTS: usize = 6;

/// A body as something that walks: what its soft voxels and sensors are made of is left open.
#[derive(Clone, Debug, PartialEq)]
pub struct Gait {
    body: Body,
    places: Vec<(usize, usize)>,
}

/// A material of [`CHOICES`] for each place of a gait, in the places' order.
pub type Design = Vec<Material>;

impl Gait {
    /// The gait of a body; `None` if it has neither soft voxels nor sensors.
    pub fn of(body: &Body) -> Option<Self> {
        let is_place = |material: &Material| CHOICES.contains(material);
        let places: Vec<_> =
            body.voxels().iter().filter(|(_, m)| is_place(m)).map(|(place, _)| place).collect();
        (!places.is_empty()).then(|| Gait { body: body.clone(), places })
    }

    /// (Row, column) of each soft voxel and sensor, row-major.
    pub fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    /// What the places of its own body are made of.
    pub fn design(&self) -> Design {
        self.places.iter().map(|place| self.body.voxels()[*place]).collect()
    }

    /// The body with these materials at its places.
    ///
    /// # Panics
    /// If the design has not one material for each place.
    pub fn built(&self, design: &[Material]) -> Body {
        assert_eq!(design.len(), self.places.len(), "a design has one material for each place");
        let mut voxels = self.body.voxels().clone();
        for (place, material) in self.places.iter().zip(design) {
            voxels[*place] = *material;
        }
        Body::new(voxels).expect("a body with other materials is as large as before")
    }

    /// The body with an expanding sensor at every place: what its response is measured with.
    pub fn probe(&self) -> Body {
        self.body.probe()
    }

    /// The body with this design, but that all its sensors expand.
    pub fn probe_of(&self, design: &[Material]) -> Body {
        let expanding = |material: &Material| match material {
            Material::Soft => Material::Soft,
            _ => Material::SensorExpand,
        };
        self.built(&design.iter().map(expanding).collect::<Vec<_>>())
    }

    /// The image under which [`probe_of`](Gait::probe_of) a design walks as the design does under a
    /// stimulus.
    pub fn as_probe(&self, design: &[Material], stimulus: &Grid<f64>) -> Grid<f64> {
        let mut image = stimulus.clone();
        for (place, material) in self.places.iter().zip(design) {
            if *material == Material::SensorShrink {
                image[*place] = 1.0 - stimulus.or_default(*place);
            }
        }
        image
    }

    /// The target width of each place under an image \[rest widths\].
    pub fn widths(&self, design: &[Material], stimulus: &Grid<f64>, physics: &Physics) -> Vec<f64> {
        let width = |(place, material): (&(usize, usize), &Material)| {
            width(*material, stimulus.or_default(*place), physics)
        };
        self.places.iter().zip(design).map(width).collect()
    }
}

/// The pixel under which an expanding sensor is as wide as a soft voxel; 0 or 1 if it never is.
fn resting(physics: &Physics) -> f64 {
    let [narrow, wide] = [0.0, 1.0].map(|pixel| width(Material::SensorExpand, pixel, physics));
    let rest = width(Material::Soft, 0.0, physics);
    if wide > narrow { ((rest - narrow) / (wide - narrow)).clamp(0.0, 1.0) } else { 0.0 }
}

/// An image under which each place of a probe is, independently of all others, as wide as can be
/// (with probability 0.4), as narrow as can be (0.4), or at rest (0.2).
pub fn random_image(height: usize, width: usize, physics: &Physics, random: &mut Stream) -> Grid<f64> {
    let rest = resting(physics);
    Grid::from_fn(height, width, |_, _| {
        let drawn = random.unit();
        if drawn < EXTREME {
            1.0
        } else if drawn < 2.0 * EXTREME {
            0.0
        } else {
            rest
        }
    })
}

/// Sums over rollouts with one intercept: widths of the places, displacement, and their products.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    count: f64,
    widths: DVector<f64>,
    displacement: f64,
    products: DMatrix<f64>,
    with_displacement: DVector<f64>,
}

impl Moments {
    /// Of no rollout, for a gait with this number of places.
    pub fn new(places: usize) -> Self {
        Moments {
            count: 0.0,
            widths: DVector::zeros(places),
            displacement: 0.0,
            products: DMatrix::zeros(places, places),
            with_displacement: DVector::zeros(places),
        }
    }

    /// Adds a rollout: target widths of the places, and displacement in voxel lengths.
    pub fn add(&mut self, widths: &[f64], displacement: f64) {
        let widths = DVector::from_column_slice(widths);
        self.count += 1.0;
        self.displacement += displacement;
        self.with_displacement.axpy(displacement, &widths, 1.0);
        for (mut column, width) in self.products.column_iter_mut().zip(widths.iter()) {
            column.axpy(*width, &widths, 1.0);
        }
        self.widths += widths;
    }

    /// Mean displacement \[voxel lengths\]; 0 of no rollout.
    pub fn mean(&self) -> f64 {
        if self.count > 0.0 { self.displacement / self.count } else { 0.0 }
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

    /// The intercept that goes with slopes \[voxel lengths\]; `None` of no rollout.
    pub fn intercept(&self, slopes: &[f64]) -> Option<f64> {
        let explained: f64 = self.widths.iter().zip(slopes).map(|(width, slope)| width * slope).sum();
        (self.count > 0.0).then(|| (self.displacement - explained) / self.count)
    }
}

/// What is known of slopes: sums over sets of rollouts, each set about its own means, so that sets
/// may differ in their intercepts.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    matrix: DMatrix<f64>,
    vector: DVector<f64>,
}

impl Evidence {
    /// No evidence, for a gait with this number of places.
    pub fn new(places: usize) -> Self {
        Evidence { matrix: DMatrix::zeros(places, places), vector: DVector::zeros(places) }
    }

    /// Adds a set of rollouts with a weight.
    pub fn add(&mut self, set: &Moments, weight: f64) {
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

    /// Makes it count this much of what it did.
    pub fn fade(&mut self, factor: f64) {
        self.matrix *= factor;
        self.vector *= factor;
    }

    /// The slopes with the least bias: by ridge regression with the smallest penalty.
    pub fn least_biased(&self) -> Fit {
        let factor = self.factor(RIDGES[0]);
        Fit { slopes: factor.solve(&self.vector).as_slice().to_vec(), factor }
    }

    /// The slopes by ridge regression, and by what factor the noise of a rollout is in each (its
    /// standard error).
    ///
    /// # Panics
    /// If `ridge` is not above 0.
    pub fn slopes(&self, ridge: f64) -> (Vec<f64>, Vec<f64>) {
        let factor = self.factor(ridge);
        let inverse = factor.inverse();
        let errors = (0..self.vector.len()).map(|i| inverse[(i, i)].sqrt()).collect();
        (factor.solve(&self.vector).as_slice().to_vec(), errors)
    }

    /// The same of more places: the n-th place of before is the one with the n-th of these numbers.
    pub fn among(&self, numbers: &[usize], places: usize) -> Self {
        let mut all = Evidence::new(places);
        for (i, &row) in numbers.iter().enumerate() {
            all.vector[row] = self.vector[i];
            for (j, &column) in numbers.iter().enumerate() {
                all.matrix[(row, column)] = self.matrix[(i, j)];
            }
        }
        all
    }

    /// The slopes by ridge regression.
    ///
    /// # Panics
    /// If `ridge` is not above 0.
    pub fn slopes_alone(&self, ridge: f64) -> Vec<f64> {
        self.factor(ridge).solve(&self.vector).as_slice().to_vec()
    }

    fn factor(&self, ridge: f64) -> nalgebra::Cholesky<f64, nalgebra::Dyn> {
        assert!(ridge > 0.0, "a ridge is above 0");
        let mut matrix = self.matrix.clone();
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += ridge);
        matrix.cholesky().expect("sums of squares plus a ridge above 0 are positive definite")
    }
}

/// Slopes, and how other rollouts would have changed them.
pub struct Fit {
    /// The slopes, in the places' order \[voxel lengths\].
    pub slopes: Vec<f64>,
    factor: nalgebra::Cholesky<f64, nalgebra::Dyn>,
}

impl Fit {
    /// The expected squared error of the weighted sum of the slopes, and the part of it that is
    /// noise, not bias; both in units of a rollout's squared scatter. True slopes vary as `ridge`,
    /// the penalty that was chosen, supposes.
    pub fn variance(&self, weights: &[f64], ridge: f64) -> (f64, f64) {
        let weights = DVector::from_column_slice(weights);
        let solved = self.factor.solve(&weights);
        let held_back = RIDGES[0] * solved.dot(&solved);
        let noise = solved.dot(&weights) - held_back;
        (noise + held_back * RIDGES[0] / ridge, noise)
    }
}

/// What rollouts with random images tell of a gait.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// By how much a place that is wider by one rest width moves the body to the right \[voxel
    /// lengths\], in the places' order.
    pub slopes: Vec<f64>,
    /// Their standard errors, what the penalty shrinks included \[voxel lengths\].
    pub errors: Vec<f64>,
    /// The displacement of a body whose places all had no width, the mean over conditions \[voxel
    /// lengths\].
    pub intercept: f64,
    /// The same under each condition; none of one without rollouts.
    pub intercepts: Vec<Option<f64>>,
    /// What slopes fitted to other rollouts leave unexplained of a displacement: standard
    /// deviation, cross-validated \[voxel lengths\].
    pub noise: f64,
    /// What the true slopes would leave unexplained: the same without the errors of the slopes
    /// \[voxel lengths\].
    pub scatter: f64,
    /// Share of the displacements' variance that slopes fitted to other rollouts explain.
    pub r_squared: f64,
    /// The penalty that was chosen.
    pub ridge: f64,
    /// What it was fitted to.
    pub evidence: Evidence,
}

/// A rollout under a random image.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Target width of each place \[rest widths\].
    pub widths: Vec<f64>,
    /// How far the body walked to the right \[voxel lengths\].
    pub displacement: f64,
    /// What it was shown under: rollouts under different conditions have intercepts of their own.
    pub condition: usize,
}

impl Response {
    /// Fits slopes; the penalty is the one that predicts left-out rollouts best. `None` of fewer
    /// than two rollouts a fold.
    pub fn of(rollouts: &[Shown]) -> Option<Self> {
        let places = rollouts.first()?.widths.len();
        if rollouts.len() < 2 * FOLDS {
            return None;
        }
        let conditions = 1 + rollouts.iter().map(|shown| shown.condition).max()?;
        let mut folds = vec![vec![Moments::new(places); conditions]; FOLDS];
        for (number, shown) in rollouts.iter().enumerate() {
            // By turns within a condition, whichever order the conditions come in.
            folds[(number / conditions) % FOLDS][shown.condition].add(&shown.widths, shown.displacement);
        }
        let total = |condition: usize| {
            folds.iter().fold(Moments::new(places), |sum, fold| sum.plus(&fold[condition], 1.0))
        };
        let all: Vec<Moments> = (0..conditions).map(total).collect();
        let spread: f64 = rollouts.iter().map(|s| squared(s.displacement - all[s.condition].mean())).sum();
        let evidence = |sets: &[Moments]| {
            let mut evidence = Evidence::new(places);
            sets.iter().for_each(|set| evidence.add(set, 1.0));
            evidence
        };
        let missed = |ridge: f64| -> f64 {
            let mut sum = 0.0;
            for (number, fold) in folds.iter().enumerate() {
                let others: Vec<Moments> =
                    all.iter().zip(fold).map(|(all, own)| all.plus(own, -1.0)).collect();
                let slopes = evidence(&others).slopes_alone(ridge);
                let own = rollouts.iter().enumerate().filter(|(n, _)| (n / conditions) % FOLDS == number);
                for (_, shown) in own {
                    let Some(intercept) = others[shown.condition].intercept(&slopes) else { continue };
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
        let left = spread - 2.0 * found.dot(&evidence.vector) + (&evidence.matrix * &found).dot(&found);
        // The effective number of parameters: residuals are smaller than the scatter by these.
        let fitted = places as f64 - ridge * dot(&factors, &factors)
            + all.iter().filter(|moments| moments.count > 0.0).count() as f64;
        let scatter = (left.max(0.0) / (rollouts.len() as f64 - fitted).max(1.0)).sqrt();
        let intercepts: Vec<Option<f64>> = all.iter().map(|moments| moments.intercept(&slopes)).collect();
        let known = intercepts.iter().flatten();
        Some(Response {
            intercept: known.clone().sum::<f64>() / known.count() as f64,
            intercepts,
            slopes,
            errors: factors.into_iter().map(|factor| scatter * factor).collect(),
            noise,
            scatter,
            r_squared: if spread > 0.0 { 1.0 - least / spread } else { 0.0 },
            ridge,
            evidence,
        })
    }

    /// The error of the slopes relative to the slopes: from 0, known exactly, to 1, nothing known.
    /// Each place counts as much as its width varied, so this is the relative error of the
    /// displacements that are predicted for random images. Its square is the share of the variance
    /// that exact slopes would explain and these do not.
    pub fn relative_error(&self) -> f64 {
        let weighed = |numbers: &[f64]| -> f64 {
            numbers
                .iter()
                .enumerate()
                .map(|(i, number)| self.evidence.matrix[(i, i)] * squared(*number))
                .sum()
        };
        let off = weighed(&self.errors);
        if off > 0.0 { (off / (off + weighed(&self.slopes))).sqrt() } else { 0.0 }
    }
}

fn squared(x: f64) -> f64 {
    x * x
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// An image of a lesson.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// For each place the target width that each of [`CHOICES`] has under it \[rest widths\].
    pub choices: Vec<[f64; 3]>,
    /// How far the body with the lesson's first design walks, measured or predicted \[voxel
    /// lengths\].
    pub displacement: f64,
    /// 1 if walking right is the right answer, −1 if left.
    pub right: f64,
    /// What it weighs; the objective is the weighted mean over all examples.
    pub weight: f64,
}

impl Example {
    /// An image as a gait sees it.
    pub fn new(gait: &Gait, stimulus: &Grid<f64>, physics: &Physics) -> Self {
        let widths = |place: &(usize, usize)| {
            CHOICES.map(|material| width(material, stimulus.or_default(*place), physics))
        };
        Example {
            choices: gait.places().iter().map(widths).collect(),
            displacement: 0.0,
            right: 1.0,
            weight: 1.0,
        }
    }

    /// The target width of each place of a design under it \[rest widths\].
    pub fn widths(&self, design: &[Material]) -> Vec<f64> {
        self.choices.iter().zip(design).map(|(widths, material)| widths[choice(*material)]).collect()
    }
}

/// What the worst answer counts.
const WORST: f64 = -1.0;

fn choice(material: Material) -> usize {
    CHOICES.iter().position(|other| *other == material).expect("a design has materials of CHOICES only")
}

/// What a gait is to learn: examples, the first design, and the slopes that say how far another one
/// would walk.
pub struct Lesson {
    /// By place, by choice, by example: width \[rest widths\].
    widths: Vec<[Vec<f64>; 3]>,
    slopes: Vec<f64>,
    /// By example: displacement times the side that is right, under the present design.
    margins: Vec<f64>,
    right: Vec<f64>,
    weights: Vec<f64>,
    /// What the worst answer counts: −1, or −∞ while climbing to where answers are not hopeless.
    floor: f64,
    design: Vec<usize>,
    objective: f64,
}

impl Lesson {
    /// A lesson whose examples have the displacements of `design`.
    pub fn new(examples: &[&Example], slopes: &[f64], design: &[Material]) -> Self {
        let column =
            |place: usize, choice: usize| examples.iter().map(|e| e.choices[place][choice]).collect();
        let total: f64 = examples.iter().map(|example| example.weight).sum();
        let mut lesson = Lesson {
            widths: (0..slopes.len()).map(|place| [0, 1, 2].map(|choice| column(place, choice))).collect(),
            slopes: slopes.to_vec(),
            margins: examples.iter().map(|example| example.displacement * example.right).collect(),
            right: examples.iter().map(|example| example.right).collect(),
            weights: examples.iter().map(|example| example.weight / total).collect(),
            floor: WORST,
            design: design.iter().map(|material| choice(*material)).collect(),
            objective: 0.0,
        };
        lesson.count();
        lesson
    }

    /// A lesson whose examples have the displacements that the model says of `design`: by the slopes,
    /// and by an intercept for each example. With a `side` of −1 all walk the other way.
    pub fn predicted<'a>(
        examples: impl IntoIterator<Item = (&'a Example, f64)>,
        slopes: &[f64],
        design: &[Material],
        side: f64,
    ) -> Self {
        let displaced = |(example, intercept): (&Example, f64)| Example {
            displacement: intercept + dot(slopes, &example.widths(design)),
            right: side * example.right,
            ..example.clone()
        };
        let examples: Vec<Example> = examples.into_iter().map(displaced).collect();
        Lesson::new(&examples.iter().collect::<Vec<_>>(), slopes, design)
    }

    /// Counts the objective anew.
    fn count(&mut self) {
        let clipped = |(margin, weight): (&f64, &f64)| weight * (margin / ENOUGH).clamp(self.floor, 1.0);
        self.objective = self.margins.iter().zip(&self.weights).map(clipped).sum();
    }

    /// The weighted mean [clipped margin](crate::task::fitness::clipped_margin) of the margins: from −1 to 1, the
    /// best.
    pub fn objective(&self) -> f64 {
        self.objective
    }

    /// The present design.
    pub fn design(&self) -> Design {
        self.design.iter().map(|choice| CHOICES[*choice]).collect()
    }

    /// The objective with another material at a place.
    fn tried(&self, place: usize, choice: usize) -> f64 {
        let (slope, now) = (self.slopes[place] / ENOUGH, self.design[place]);
        let (before, after) = (&self.widths[place][now], &self.widths[place][choice]);
        let mut sum = 0.0;
        for example in 0..self.margins.len() {
            let change = slope * self.right[example] * (after[example] - before[example]);
            sum += self.weights[example] * (self.margins[example] / ENOUGH + change).clamp(self.floor, 1.0);
        }
        sum
    }

    fn change(&mut self, place: usize, choice: usize, objective: f64) {
        let (slope, now) = (self.slopes[place], self.design[place]);
        let (before, after) = (&self.widths[place][now], &self.widths[place][choice]);
        for example in 0..self.margins.len() {
            self.margins[example] += slope * self.right[example] * (after[example] - before[example]);
        }
        (self.design[place], self.objective) = (choice, objective);
    }

    /// Climbs until no change of one place helps: first with no answer too bad to count, so that a
    /// body which walks far to one side under every image is led back; then as answers count.
    pub fn solve(&mut self, random: &mut Stream) {
        for floor in [f64::NEG_INFINITY, WORST] {
            self.floor = floor;
            self.count();
            self.climb(random);
        }
    }

    /// The same from random designs, too; the best is taken.
    pub fn solve_from_many(&mut self, random: &mut Stream) {
        let (displacements, design) = (self.margins.clone(), self.design.clone());
        self.solve(random);
        let mut best = (self.objective, self.margins.clone(), self.design.clone());
        for _ in 0..STARTS {
            (self.margins, self.design) = (displacements.clone(), design.clone());
            for place in 0..design.len() {
                self.change(place, CHOSEN.start + random.below(CHOSEN.len()), 0.0);
            }
            self.solve(random);
            if self.objective > best.0 {
                best = (self.objective, self.margins.clone(), self.design.clone());
            }
        }
        (self.objective, self.margins, self.design) = best;
    }

    /// Changes some of these places, each time the one that helps most, until as many are changed
    /// or none helps.
    pub fn best_changes(&mut self, places: &[usize], most: usize) {
        for _ in 0..most {
            let all = places.iter().flat_map(|place| CHOSEN.map(move |choice| (*place, choice)));
            let others = all.filter(|(place, choice)| *choice != self.design[*place]);
            let tried = others.map(|(place, choice)| (self.tried(place, choice), (place, choice)));
            match tried.reduce(better) {
                Some((objective, (place, choice))) if objective > self.objective + LEAST_GAIN => {
                    self.change(place, choice, objective);
                }
                _ => return,
            }
        }
    }

    /// Place by place, in an order drawn anew for every sweep.
    fn climb(&mut self, random: &mut Stream) {
        let places = self.slopes.len();
        for _ in 0..SWEEPS {
            let before = self.objective;
            for place in random.sample(places, places) {
                let others = CHOSEN.filter(|choice| *choice != self.design[place]);
                let best = others.map(|choice| (self.tried(place, choice), choice)).reduce(better);
                if let Some((objective, choice)) = best.filter(|(o, _)| *o > self.objective + LEAST_GAIN) {
                    self.change(place, choice, objective);
                }
            }
            if self.objective <= before + LEAST_GAIN {
                return;
            }
        }
    }
}

/// The one with the larger objective; of equals the first.
fn better<T>(best: (f64, T), next: (f64, T)) -> (f64, T) {
    if next.0 > best.0 { next } else { best }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};

    fn random(child: u64) -> Stream {
        stream(1, Purpose::RandomImages, 0, child)
    }

    fn physics() -> Physics {
        Physics::default()
    }

    #[test]
    fn a_gait_is_what_walks_and_its_designs_are_what_it_is_made_of() {
        let body: Body = "2635/3104".parse().unwrap();
        let gait = Gait::of(&body).unwrap();
        assert_eq!(gait.places(), [(0, 0), (0, 1), (0, 3)]);
        assert_eq!(gait.built(&gait.design()), body);
        assert_eq!(gait.probe(), "6636/3104".parse().unwrap());
        let image = Grid::from_fn(2, 4, |_, column| if column == 1 { 1.0 } else { 0.25 });
        assert_eq!(gait.widths(&gait.design(), &image, &physics()), [1.0, 1.6, 1.35]);
        assert_eq!(Gait::of(&"3/1".parse().unwrap()), None);
    }

    #[test]
    fn random_images_make_places_wide_narrow_or_at_rest_independently_of_each_other() {
        let physics = physics();
        let mut random = random(0);
        let gait = Gait::of(&"65".parse().unwrap()).unwrap();
        let rest = gait.widths(&[Material::Soft; 2], &Grid::from_fn(1, 2, |_, _| 0.0), &physics)[0];
        let drawn: Vec<Vec<f64>> = (0..4000)
            .map(|_| {
                let image = random_image(1, 2, &physics, &mut random);
                gait.widths(&[Material::SensorExpand; 2], &image, &physics)
            })
            .collect();
        let share = |kind: &dyn Fn(&[f64]) -> bool| {
            drawn.iter().filter(|widths| kind(widths)).count() as f64 / 4000.0
        };
        for (width, expected) in [(1.6, 0.4), (0.6, 0.4), (rest, 0.2)] {
            for place in 0..2 {
                let share = share(&|widths| (widths[place] - width).abs() < 1e-9);
                assert!((share - expected).abs() < 0.03, "{width} at {place}: {share}");
            }
        }
        let both = share(&|widths| widths.iter().all(|width| (width - 1.6).abs() < 1e-9));
        assert!((both - 0.16).abs() < 0.03, "{both}");
    }

    #[test]
    fn a_probe_can_be_as_wide_as_any_design_under_any_image() {
        let gait = Gait::of(&"562/365".parse().unwrap()).unwrap();
        let image = Grid::from_fn(2, 3, |row, column| 0.1 * (3 * row + column) as f64);
        let mut random = random(3);
        for _ in 0..30 {
            let design: Design = gait.places().iter().map(|_| CHOICES[random.below(3)]).collect();
            let probe = Gait::of(&gait.probe_of(&design)).unwrap().design();
            let is_soft = |material: &Material| *material == Material::Soft;
            assert!(probe.iter().map(is_soft).eq(design.iter().map(is_soft)));
            let seen = gait.as_probe(&design, &image);
            let (found, expected) =
                (gait.widths(&probe, &seen, &physics()), gait.widths(&design, &image, &physics()));
            assert!(
                found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12),
                "{found:?} {expected:?}"
            );
        }
    }

    /// Rollouts of a linear body: slopes, an intercept for each condition, noise.
    fn planted(slopes: &[f64], intercepts: &[f64], noise: f64, count: usize, seed: u64) -> Vec<Shown> {
        let mut random = random(seed);
        let rollout = |number: usize| {
            let widths: Vec<f64> =
                slopes.iter().map(|_| if random.unit() < 0.45 { 1.6 } else { 0.6 }).collect();
            let condition = number % intercepts.len();
            let displacement = intercepts[condition] + dot(slopes, &widths) + noise * random.normal();
            Shown { widths, displacement, condition }
        };
        (0..count).map(rollout).collect()
    }

    #[test]
    fn the_response_of_a_linear_body_is_recovered_whatever_the_conditions_add() {
        let slopes: Vec<f64> = (0..30).map(|i| f64::from(i % 7) - 3.0).collect();
        let response = Response::of(&planted(&slopes, &[4.0, -9.0, 30.0], 0.0, 120, 1)).unwrap();
        let worst = response.slopes.iter().zip(&slopes).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 0.1 && response.r_squared > 0.999, "{worst} {}", response.r_squared);
        // Too few to say anything.
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
            inside += pairs.filter(|((found, error), slope)| (*found - *slope).abs() < 2.0 * *error).count();
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
                for ((found, error), slope) in response.slopes.iter().zip(&response.errors).zip(&slopes) {
                    let off = (found - slope) / error;
                    squares += off * off;
                    within += usize::from(off.abs() < 2.0);
                    all += 1.0;
                }
            }
            let (size, share) = ((squares / all).sqrt(), within as f64 / all);
            let case = format!("{places} places, {rollouts} rollouts: {size} {share}");
            assert!((0.88..1.12).contains(&size) && (0.92..0.98).contains(&share), "{case}");
        }
    }

    #[test]
    fn the_relative_error_is_that_of_what_is_predicted_and_1_where_nothing_is_known() {
        let slopes: Vec<f64> = (0..60).map(|i| 3.0 * f64::from(i % 5) - 6.0).collect();
        for (rollouts, noise) in [(120, 5.0), (600, 5.0), (600, 0.5)] {
            let (mut off, mut said) = (0.0, 0.0);
            for seed in 0..8 {
                let mut shown = planted(&slopes, &[0.0], noise, rollouts, seed);
                // Half of the places are never wider: of their slopes nothing is known, and nothing
                // need be.
                for shown in &mut shown {
                    for (width, slope) in shown.widths.iter_mut().zip(&slopes).skip(30) {
                        shown.displacement -= slope * (*width - 0.6);
                        *width = 0.6;
                    }
                }
                let response = Response::of(&shown).unwrap();
                let wrong: Vec<f64> = response.slopes.iter().zip(&slopes).map(|(a, b)| a - b).collect();
                off += dot(&wrong[..30], &wrong[..30]) / dot(&slopes[..30], &slopes[..30]) / 8.0;
                said += squared(response.relative_error()) / 8.0;
            }
            let (off, said) = (off.sqrt(), said.sqrt());
            assert!((said / off - 1.0).abs() < 0.15, "{rollouts} {noise}: {said}, in truth {off}");
        }
        let nothing = Response::of(&planted(&[0.0; 60], &[0.0], 5.0, 600, 3)).unwrap();
        assert!(nothing.relative_error() > 0.6, "{}", nothing.relative_error());
    }

    /// A gait of one row, and images of it.
    fn lesson(places: usize, images: usize, seed: u64) -> (Gait, Vec<Example>, Vec<f64>) {
        let body: Body = "6".repeat(places).parse().unwrap();
        let gait = Gait::of(&body).unwrap();
        let mut random = random(seed);
        let slopes: Vec<f64> = (0..places).map(|_| 8.0 * random.normal()).collect();
        let examples = (0..images)
            .map(|_| {
                let image = Grid::from_fn(1, places, |_, _| f64::from(u8::from(random.unit() < 0.5)));
                let right = if random.unit() < 0.5 { 1.0 } else { -1.0 };
                let displacement = 2.0 + dot(&slopes, &gait.widths(&gait.design(), &image, &physics()));
                Example {
                    displacement,
                    right,
                    weight: random.unit(),
                    ..Example::new(&gait, &image, &physics())
                }
            })
            .collect();
        (gait, examples, slopes)
    }

    /// The objective of a design, from the beginning.
    fn objective(gait: &Gait, examples: &[Example], slopes: &[f64], design: &[Material]) -> f64 {
        let weight: f64 = examples.iter().map(|example| example.weight).sum();
        let clipped = |example: &Example| {
            let change = dot(slopes, &example.widths(design)) - dot(slopes, &example.widths(&gait.design()));
            example.weight
                * crate::task::fitness::clipped_margin(example.right * (example.displacement + change))
        };
        examples.iter().map(clipped).sum::<f64>() / weight
    }

    #[test]
    fn the_best_design_of_small_gaits_is_found_as_a_rule_and_else_one_nearly_as_good() {
        let mut is_best = 0;
        for seed in 0..20 {
            let (gait, examples, slopes) = lesson(6, 40, seed);
            let all: Vec<&Example> = examples.iter().collect();
            let every = (0..64_usize).map(|code| -> Design {
                (0..6).map(|place| CHOICES[CHOSEN.start + code / 2_usize.pow(place) % 2]).collect()
            });
            let best =
                every.map(|design| objective(&gait, &examples, &slopes, &design)).fold(f64::MIN, f64::max);
            let mut lesson = Lesson::new(&all, &slopes, &gait.design());
            lesson.solve_from_many(&mut random(seed));
            let (found, design) = (lesson.objective(), lesson.design());
            assert!((found - objective(&gait, &examples, &slopes, &design)).abs() < 1e-9);
            assert!(found > best - 0.05, "seed {seed}: {found} of {best}");
            is_best += u32::from(found > best - 1e-9);
        }
        assert!(is_best >= 15, "{is_best}");
    }
}
