//! The design problem: choose the sensor at each place that makes the mean margin over two groups
//! of images largest, if displacements follow the slopes of the [response](super::regression).

use crate::base::Grid;
use crate::base::random::Stream;
use crate::body::Material;
use crate::response::gait::{CHOICES, CHOSEN, Design, Gait};
use crate::response::regression::dot;
use crate::sim::{Physics, width};
use crate::task::fitness::ENOUGH;

/// Least gain of the objective for which a design is changed; smaller gains are rounding.
const LEAST_GAIN: f64 = 1e-9;

/// Most sweeps over all places; a search ends sooner when a sweep changes nothing.
const SWEEPS: usize = 12;

/// Random designs that a search from many starts from; more cost as much each and seldom help.
const STARTS: usize = 6;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Example {
    /// Target width of each place under it, for each of [`CHOICES`] \[rest widths\].
    pub(crate) choices: Vec<[f64; 3]>,
    /// Displacement with the problem's first design, measured or predicted \[voxel lengths\].
    pub(crate) displacement: f64,
    /// Correct direction: 1 right, −1 left.
    pub(crate) right: f64,
    /// Weight; the objective is the weighted mean over all examples.
    pub(crate) weight: f64,
}

impl Example {
    pub(crate) fn new(gait: &Gait, stimulus: &Grid<f64>, physics: &Physics) -> Self {
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

    /// Returns the target width of each place of a design under it \[rest widths\].
    pub(crate) fn widths(&self, design: &[Material]) -> Vec<f64> {
        self.choices
            .iter()
            .zip(design)
            .map(|(widths, material)| widths[choice(*material)])
            .collect()
    }
}

const WORST: f64 = -1.0;

fn choice(material: Material) -> usize {
    CHOICES
        .iter()
        .position(|other| *other == material)
        .expect("a design has materials of CHOICES only")
}

/// A design problem: examples, first design, and slopes that predict displacements of others.
pub(crate) struct DesignProblem {
    /// Width by place, choice and example \[rest widths\].
    widths: Vec<[Vec<f64>; 3]>,
    slopes: Vec<f64>,
    /// Displacement in the correct direction by example, under the current design.
    margins: Vec<f64>,
    right: Vec<f64>,
    weights: Vec<f64>,
    /// Value of the worst answer: −1, or −∞ while climbing out of hopeless answers.
    floor: f64,
    design: Vec<usize>,
    objective: f64,
}

impl DesignProblem {
    /// Makes a problem whose examples have the displacements of `design`.
    pub(crate) fn new(examples: &[&Example], slopes: &[f64], design: &[Material]) -> Self {
        let column = |place: usize, choice: usize| {
            examples.iter().map(|e| e.choices[place][choice]).collect()
        };
        let total: f64 = examples.iter().map(|example| example.weight).sum();
        let mut problem = DesignProblem {
            widths: (0..slopes.len())
                .map(|place| [0, 1, 2].map(|choice| column(place, choice)))
                .collect(),
            slopes: slopes.to_vec(),
            margins: examples
                .iter()
                .map(|example| example.displacement * example.right)
                .collect(),
            right: examples.iter().map(|example| example.right).collect(),
            weights: examples
                .iter()
                .map(|example| example.weight / total)
                .collect(),
            floor: WORST,
            design: design.iter().map(|material| choice(*material)).collect(),
            objective: 0.0,
        };
        problem.count();
        problem
    }

    /// Makes a problem whose examples have the displacements predicted for `design`, by the slopes
    /// and an intercept each. A `side` of −1 reverses the correct directions.
    pub(crate) fn predicted<'a>(
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
        DesignProblem::new(&examples.iter().collect::<Vec<_>>(), slopes, design)
    }

    fn count(&mut self) {
        let clipped =
            |(margin, weight): (&f64, &f64)| weight * (margin / ENOUGH).clamp(self.floor, 1.0);
        self.objective = self.margins.iter().zip(&self.weights).map(clipped).sum();
    }

    /// Returns the answers' weighted mean clipped margin: from −1 to 1, the best.
    pub(crate) fn objective(&self) -> f64 {
        self.objective
    }

    pub(crate) fn design(&self) -> Design {
        self.design.iter().map(|choice| CHOICES[*choice]).collect()
    }

    /// Returns the objective with another material at a place.
    fn tried(&self, place: usize, choice: usize) -> f64 {
        let (slope, now) = (self.slopes[place] / ENOUGH, self.design[place]);
        let (before, after) = (&self.widths[place][now], &self.widths[place][choice]);
        let mut sum = 0.0;
        for example in 0..self.margins.len() {
            let change = slope * self.right[example] * (after[example] - before[example]);
            sum += self.weights[example]
                * (self.margins[example] / ENOUGH + change).clamp(self.floor, 1.0);
        }
        sum
    }

    fn change(&mut self, place: usize, choice: usize, objective: f64) {
        let (slope, now) = (self.slopes[place], self.design[place]);
        let (before, after) = (&self.widths[place][now], &self.widths[place][choice]);
        for example in 0..self.margins.len() {
            self.margins[example] +=
                slope * self.right[example] * (after[example] - before[example]);
        }
        (self.design[place], self.objective) = (choice, objective);
    }

    /// Climbs until no change of one place helps. At first no answer is too bad to count, so that a
    /// body that walks far to one side under every image is brought back; then margins are clipped.
    pub(crate) fn solve(&mut self, random: &mut Stream) {
        for floor in [f64::NEG_INFINITY, WORST] {
            self.floor = floor;
            self.count();
            self.climb(random);
        }
    }

    /// Solves from random designs, too, and keeps the best.
    pub(crate) fn solve_from_many(&mut self, random: &mut Stream) {
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

    /// Changes up to `most` of these places, each time the one that helps most, until none helps.
    pub(crate) fn best_changes(&mut self, places: &[usize], most: usize) {
        for _ in 0..most {
            let all = places
                .iter()
                .flat_map(|place| CHOSEN.map(move |choice| (*place, choice)));
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

    /// Climbs place by place, in a new random order for every sweep.
    fn climb(&mut self, random: &mut Stream) {
        let places = self.slopes.len();
        for _ in 0..SWEEPS {
            let before = self.objective;
            for place in random.sample(places, places) {
                let others = CHOSEN.filter(|choice| *choice != self.design[place]);
                let best = others
                    .map(|choice| (self.tried(place, choice), choice))
                    .reduce(better);
                if let Some((objective, choice)) =
                    best.filter(|(o, _)| *o > self.objective + LEAST_GAIN)
                {
                    self.change(place, choice, objective);
                }
            }
            if self.objective <= before + LEAST_GAIN {
                return;
            }
        }
    }
}

fn better<T>(best: (f64, T), next: (f64, T)) -> (f64, T) {
    if next.0 > best.0 { next } else { best }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};
    use crate::body::Body;

    fn random(child: u64) -> Stream {
        stream(1, Purpose::RandomImages, 0, child)
    }

    /// Makes a gait of one row, and images for it.
    fn problem(places: usize, images: usize, seed: u64) -> (Gait, Vec<Example>, Vec<f64>) {
        let body: Body = "6".repeat(places).parse().unwrap();
        let gait = Gait::of(&body).unwrap();
        let mut random = random(seed);
        let slopes: Vec<f64> = (0..places).map(|_| 8.0 * random.normal()).collect();
        let examples = (0..images)
            .map(|_| {
                let image =
                    Grid::from_fn(1, places, |_, _| f64::from(u8::from(random.unit() < 0.5)));
                let right = if random.unit() < 0.5 { 1.0 } else { -1.0 };
                let displacement = 2.0
                    + dot(
                        &slopes,
                        &gait.widths(&gait.design(), &image, &Physics::default()),
                    );
                Example {
                    displacement,
                    right,
                    weight: random.unit(),
                    ..Example::new(&gait, &image, &Physics::default())
                }
            })
            .collect();
        (gait, examples, slopes)
    }

    /// Computes the objective of a design from scratch.
    fn objective(gait: &Gait, examples: &[Example], slopes: &[f64], design: &[Material]) -> f64 {
        let weight: f64 = examples.iter().map(|example| example.weight).sum();
        let clipped = |example: &Example| {
            let change =
                dot(slopes, &example.widths(design)) - dot(slopes, &example.widths(&gait.design()));
            example.weight
                * crate::task::fitness::clipped_margin(
                    example.right * (example.displacement + change),
                )
        };
        examples.iter().map(clipped).sum::<f64>() / weight
    }

    #[test]
    fn the_best_design_of_small_gaits_is_found_as_a_rule_and_else_one_nearly_as_good() {
        let mut is_best = 0;
        for seed in 0..20 {
            let (gait, examples, slopes) = problem(6, 40, seed);
            let all: Vec<&Example> = examples.iter().collect();
            let every = (0..64_usize).map(|code| -> Design {
                (0..6)
                    .map(|place| CHOICES[CHOSEN.start + code / 2_usize.pow(place) % 2])
                    .collect()
            });
            let best = every
                .map(|design| objective(&gait, &examples, &slopes, &design))
                .fold(f64::MIN, f64::max);
            let mut problem = DesignProblem::new(&all, &slopes, &gait.design());
            problem.solve_from_many(&mut random(seed));
            let (found, design) = (problem.objective(), problem.design());
            assert!((found - objective(&gait, &examples, &slopes, &design)).abs() < 1e-9);
            assert!(found > best - 0.05, "seed {seed}: {found} of {best}");
            is_best += u32::from(found > best - 1e-9);
        }
        assert!(is_best >= 15, "{is_best}");
    }
}
