//! Estimates the accuracy that training could reach, from the linear response alone.
//!
//! A design looks best under the very slopes and images it was solved with. Both are noisy, so it
//! looks better than it is. Here one half of rollouts and images solves the design problem, and the
//! other half evaluates the design (cross-fitting).

use crate::base::random::{Purpose, stream};
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::body::Material;
use crate::response::design_problem::{DesignProblem, Example};
use crate::response::regression::{RandomRollout, Response};
use crate::task::fitness::ENOUGH;
use std::f64::consts::{PI, SQRT_2};

/// Standard errors on either side of a 95 % interval.
const INTERVAL: f64 = 1.96;

/// Least scatter about a prediction, relative to the whole: below, last digits decide answers.
const LEAST_SCATTER: f64 = 0.25;

/// Scatter used in place of 0 \[voxel lengths\], to avoid a division by 0.
const NONE: f64 = 1e-9;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

impl Estimate {
    pub(crate) fn interval(&self) -> [f64; 2] {
        [-INTERVAL, INTERVAL].map(|errors| self.value + errors * self.error)
    }

    fn mean([a, b]: [Estimate; 2]) -> Self {
        Estimate {
            value: (a.value + b.value) / 2.0,
            error: (a.error * a.error + b.error * b.error).sqrt() / 2.0,
        }
    }
}

/// The estimated results of training a gait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trainability {
    /// Mean clipped margin of its answers: from −1 to 1.
    pub(crate) fitness: Estimate,
    /// Fraction of its answers that are correct.
    pub(crate) accuracy: Estimate,
}

/// Estimates the results of training a gait on examples, from its rollouts with random images;
/// `None` if these are too few to be halved.
///
/// The estimates are means over two designs. Each is solved for with one half of the rollouts and
/// of the examples. The other half of the rollouts predicts its displacements under the other half
/// of the examples; its slopes are hardly shrunk, so predictions have noise but little bias. A real
/// displacement scatters about the prediction of exact slopes by `scatter` \[voxel lengths\].
/// Predictions are noisy already, so the scatter about them is smaller by as much. Standard errors
/// cover changes of rollouts and of images. An answer is correct if its margin is above `threshold`
/// \[voxel lengths\].
pub(crate) fn teachable(
    shown: &[RandomRollout],
    scatter: f64,
    examples: &[Example],
    threshold: f64,
    seed: u64,
    session: &Session,
) -> Result<Option<Trainability>, Stopped> {
    let Some(halves) = Half::both(shown, examples) else {
        return Ok(None);
    };
    let mut estimates = Vec::new();
    for (number, (own, other)) in (0..).zip([(&halves[0], &halves[1]), (&halves[1], &halves[0])]) {
        session.check()?;
        let design = own.solved(seed, number);
        estimates.push(other.judged(&design, scatter, threshold));
    }
    let of = |which: usize| Estimate::mean([estimates[0][which], estimates[1][which]]);
    Ok(Some(Trainability {
        fitness: of(0),
        accuracy: of(1),
    }))
}

struct Half<'a> {
    response: Response,
    rollouts: f64,
    /// Mean width of each place over the rollouts.
    widths: Vec<f64>,
    /// Mean displacement \[voxel lengths\].
    mean: f64,
    examples: Vec<&'a Example>,
}

type Solved = (Vec<Material>, f64);

impl<'a> Half<'a> {
    fn both(shown: &[RandomRollout], examples: &'a [Example]) -> Option<[Self; 2]> {
        let mut rollouts = [Vec::new(), Vec::new()];
        let mut seen: Vec<usize> = Vec::new();
        for shown in shown {
            // The halves alternate within a condition.
            seen.resize(seen.len().max(shown.condition + 1), 0);
            rollouts[seen[shown.condition] % 2].push(shown.clone());
            seen[shown.condition] += 1;
        }
        let half = |number: usize| {
            let own = &rollouts[number];
            let mut widths = vec![0.0; own.first()?.widths.len()];
            for shown in own {
                widths
                    .iter_mut()
                    .zip(&shown.widths)
                    .for_each(|(sum, width)| *sum += width / own.len() as f64);
            }
            let rollouts = own.len() as f64;
            let mean = own.iter().map(|shown| shown.displacement).sum::<f64>() / rollouts;
            let examples = examples.iter().skip(number).step_by(2).collect();
            Some(Half {
                response: Response::of(own)?,
                rollouts,
                widths,
                mean,
                examples,
            })
        };
        Some([half(0)?, half(1)?])
    }

    /// Returns the best design by this half's slopes, and its side: −1 if `right` 1 walks left.
    fn solved(&self, seed: u64, number: u64) -> Solved {
        let Response {
            slopes, intercept, ..
        } = &self.response;
        let any = vec![Material::SensorExpand; slopes.len()];
        let solved = |side: f64, draw: u64| {
            let examples = self.examples.iter().map(|example| (*example, *intercept));
            let mut problem = DesignProblem::predicted(examples, slopes, &any, side);
            problem.solve_from_many(&mut stream(seed, Purpose::Training, 0, 2 * number + draw));
            (problem.objective(), problem.design())
        };
        let (right, left) = (solved(1.0, 0), solved(-1.0, 1));
        if right.0 >= left.0 {
            (right.1, 1.0)
        } else {
            (left.1, -1.0)
        }
    }

    /// Returns the mean clipped margin of a design's answers, and the fraction that are correct.
    fn judged(&self, (design, side): &Solved, scatter: f64, threshold: f64) -> [Estimate; 2] {
        let total: f64 = self.examples.iter().map(|example| example.weight).sum();
        let fit = self.response.evidence.least_biased();
        let answer = |example: &&Example| {
            let off: Vec<f64> = example
                .widths(design)
                .iter()
                .zip(&self.widths)
                .map(|(width, mean)| width - mean)
                .collect();
            let moved: f64 = off
                .iter()
                .zip(&fit.slopes)
                .map(|(off, slope)| off * slope)
                .sum();
            let noise = fit.variance(&off, self.response.ridge).1 + 1.0 / self.rollouts;
            let right = side * example.right;
            Answer {
                weight: example.weight / total,
                right,
                margin: right * (self.mean + moved),
                scatter: (scatter * (1.0 - noise).max(LEAST_SCATTER * LEAST_SCATTER).sqrt())
                    .max(NONE),
                off,
            }
        };
        let answers: Vec<Answer> = self.examples.iter().map(answer).collect();
        let estimate = |judged: &dyn Fn(&Answer) -> (f64, f64)| {
            let found: Vec<(f64, f64)> = answers.iter().map(judged).collect();
            let pairs = || answers.iter().zip(&found);
            let value: f64 = pairs()
                .map(|(answer, (clipped, _))| answer.weight * clipped)
                .sum();
            // Variance over other images.
            let by_images = pairs().map(|(answer, (clipped, _))| answer.weight * (clipped - value));
            let by_images: f64 = by_images.map(|off| off * off).sum();
            // Variance over other rollouts, to first order: by slopes and by mean displacement.
            let (mut of_slopes, mut of_mean) = (vec![0.0; self.widths.len()], 0.0);
            for (answer, (_, growth)) in pairs() {
                let change = answer.weight * answer.right * growth;
                of_mean += change;
                of_slopes
                    .iter_mut()
                    .zip(&answer.off)
                    .for_each(|(sum, off)| *sum += change * off);
            }
            let by_rollouts = scatter
                * scatter
                * (fit.variance(&of_slopes, self.response.ridge).0
                    + of_mean * of_mean / self.rollouts);
            Estimate {
                value,
                error: (by_images + by_rollouts).sqrt(),
            }
        };
        [
            estimate(&|answer| expected_clipped_margin(answer.margin, answer.scatter, ENOUGH)),
            estimate(&|answer| right(answer.margin, answer.scatter, threshold)),
        ]
    }
}

/// The predicted answer of a design to an example.
struct Answer {
    weight: f64,
    /// Correct direction: 1 right, −1 left.
    right: f64,
    /// Displacement in the correct direction \[voxel lengths\].
    margin: f64,
    /// Unknown difference of the truth from the margin \[voxel lengths\].
    scatter: f64,
    /// Difference of each place's width from its mean over the rollouts.
    off: Vec<f64>,
}

/// Returns the mean of clipped margins scattered normally about `margin`, and its derivative by it.
fn expected_clipped_margin(margin: f64, scatter: f64, enough: f64) -> (f64, f64) {
    let [low, high] = [-enough, enough].map(|end| (end - margin) / scatter);
    let [below, under] = [low, high].map(normal);
    let inside = under - below;
    let clipped =
        enough * (1.0 - under - below) + margin * inside + scatter * (density(low) - density(high));
    (clipped / enough, inside / enough)
}

/// Returns the fraction of normally scattered margins above `threshold`, and its derivative.
fn right(margin: f64, scatter: f64, threshold: f64) -> (f64, f64) {
    let beyond = (margin - threshold) / scatter;
    (normal(beyond), density(beyond) / scatter)
}

fn normal(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

fn density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / (2.0 * PI).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Grid;
    use crate::base::random::Stream;

    use crate::body::Body;
    use crate::response::gait::Gait;
    use crate::sim::Physics;
    use std::sync::atomic::AtomicBool;

    const THRESHOLD: f64 = 3.0;

    /// A linear body of one row, whose displacements scatter.
    struct Planted {
        gait: Gait,
        slopes: Vec<f64>,
        noise: f64,
        random: Stream,
    }

    impl Planted {
        fn new(places: usize, slope: f64, noise: f64, seed: u64) -> Self {
            let body: Body = "6".repeat(places).parse().unwrap();
            let mut random = stream(seed, Purpose::RandomImages, 9, 0);
            let slopes = (0..places).map(|_| slope * random.normal()).collect();
            Planted {
                gait: Gait::of(&body).unwrap(),
                slopes,
                noise,
                random,
            }
        }

        fn walks(&self, widths: &[f64], condition: usize) -> f64 {
            let moved: f64 = widths
                .iter()
                .zip(&self.slopes)
                .map(|(width, slope)| (width - 1.1) * slope)
                .sum();
            moved + [2.0, -2.0][condition]
        }

        fn shown(&mut self, count: usize) -> Vec<RandomRollout> {
            let rollout = |number: usize| {
                let widths: Vec<f64> = self
                    .slopes
                    .iter()
                    .map(|_| if self.random.unit() < 0.4 { 1.6 } else { 0.6 })
                    .collect();
                (widths, number % 2)
            };
            let all: Vec<_> = (0..count).map(rollout).collect();
            let scattered = |(widths, condition): (Vec<f64>, usize)| {
                let displacement =
                    self.walks(&widths, condition) + self.noise * self.random.normal();
                RandomRollout {
                    displacement,
                    widths,
                    condition,
                }
            };
            all.into_iter().map(scattered).collect()
        }

        /// Makes images of two classes, in which every pixel is a little informative.
        fn examples(&mut self, count: usize) -> Vec<Example> {
            let example = |number: usize| {
                let right = if number < count / 2 { 1.0 } else { -1.0 };
                let bright = |c: usize| {
                    0.5 + if c.is_multiple_of(2) {
                        0.1 * right
                    } else {
                        -0.1 * right
                    }
                };
                let pixel =
                    |_: usize, c: usize| f64::from(u8::from(self.random.unit() < bright(c)));
                let image = Grid::from_fn(1, self.slopes.len(), pixel);
                Example {
                    right,
                    ..Example::new(&self.gait, &image, &Physics::default())
                }
            };
            (0..count).map(example).collect()
        }

        /// Returns a design's true mean clipped margin and true fraction of correct answers.
        fn truth(&self, (design, side): &Solved, examples: &[Example]) -> [f64; 2] {
            let (mut clipped, mut share) = (0.0, 0.0);
            for example in examples {
                // Either condition in turn, whose effect is their mean's.
                let walks = [0, 1].map(|condition| self.walks(&example.widths(design), condition));
                let margin = side * example.right * (walks[0] + walks[1]) / 2.0;
                clipped +=
                    expected_clipped_margin(margin, self.noise, ENOUGH).0 / examples.len() as f64;
                share += right(margin, self.noise, THRESHOLD).0 / examples.len() as f64;
            }
            [clipped, share]
        }
    }

    #[test]
    fn an_expected_clipped_margin_is_the_mean_of_clipped_margins_and_grows_as_it_says() {
        for (margin, scatter) in [
            (0.0, 1.0),
            (4.0, 3.0),
            (-12.0, 5.0),
            (9.0, 20.0),
            (30.0, 2.0),
        ] {
            let steps = || (0..20_000).map(|k| -10.0 + 0.001 * (f64::from(k) + 0.5));
            let mean = |of: &dyn Fn(f64) -> f64| -> f64 {
                steps()
                    .map(|x| 0.001 * density(x) * of(margin + scatter * x))
                    .sum()
            };
            let (clipped, slope) = expected_clipped_margin(margin, scatter, 10.0);
            assert!(
                (clipped - mean(&|m| crate::task::fitness::clipped_margin(m))).abs() < 1e-6,
                "{margin} {scatter}"
            );
            assert!((slope - mean(&|m| if m.abs() < 10.0 { 0.1 } else { 0.0 })).abs() < 1e-4);
            let (share, slope) = right(margin, scatter, 3.0);
            assert!((share - mean(&|m| if m > 3.0 { 1.0 } else { 0.0 })).abs() < 1e-3);
            let more = right(margin + 1e-4, scatter, 3.0).0;
            assert!(((more - share) / 1e-4 - slope).abs() < 1e-4);
        }
    }

    #[test]
    fn an_estimate_is_within_its_interval_of_what_the_designs_are_worth_in_truth() {
        let (mut inside, mut off) = (0, [0.0; 2]);
        let seeds = 40;
        for seed in 0..seeds {
            let mut planted = Planted::new(40, 4.0, 6.0, seed);
            let (shown, examples) = (planted.shown(240), planted.examples(400));
            let scatter = Response::of(&shown).unwrap().scatter;
            let found = teachable(
                &shown,
                scatter,
                &examples,
                THRESHOLD,
                seed,
                &Session::default(),
            )
            .unwrap()
            .unwrap();
            let halves = Half::both(&shown, &examples).unwrap();
            let others = planted.examples(2000);
            let truths = [0, 1].map(|half| {
                let design = halves[half].solved(seed, half as u64);
                planted.truth(&design, &others)
            });
            for (which, estimate) in [found.fitness, found.accuracy].into_iter().enumerate() {
                let truth = (truths[0][which] + truths[1][which]) / 2.0;
                let [low, high] = estimate.interval();
                inside += usize::from(low <= truth && truth <= high);
                off[which] += (estimate.value - truth) / f64::from(seeds as u32);
            }
        }
        assert!(inside >= 70, "{inside} of 80");
        // Nearly unbiased on average, and rather too low than too high.
        assert!(off.iter().all(|off| (-0.03..0.01).contains(off)), "{off:?}");
    }

    #[test]
    fn a_gait_that_nothing_moves_could_be_taught_nothing() {
        let (mut fitness, mut naive, mut inside) = (0.0, 0.0, 0);
        for seed in 0..20 {
            let mut planted = Planted::new(40, 0.0, 6.0, seed);
            let (shown, examples) = (planted.shown(200), planted.examples(200));
            let found = teachable(&shown, 6.0, &examples, THRESHOLD, seed, &Session::default())
                .unwrap()
                .unwrap();
            fitness += found.fitness.value / 20.0;
            let [low, high] = found.fitness.interval();
            inside += usize::from(low <= 0.0 && 0.0 <= high);
            let half = &Half::both(&shown, &examples).unwrap()[0];
            naive += half.judged(&half.solved(seed, 0), 6.0, THRESHOLD)[0].value / 20.0;
        }
        assert!(
            fitness.abs() < 0.04 && naive > 0.2 && inside >= 17,
            "{fitness} {naive} {inside}"
        );
    }

    #[test]
    fn a_few_rollouts_say_nothing() {
        let mut planted = Planted::new(5, 1.0, 1.0, 1);
        let (shown, examples) = (planted.shown(19), planted.examples(20));
        assert_eq!(
            teachable(&shown, 1.0, &examples, THRESHOLD, 1, &Session::default()),
            Ok(None)
        );
        assert_eq!(
            teachable(&[], 1.0, &examples, THRESHOLD, 1, &Session::default()),
            Ok(None)
        );
        let enough = planted.shown(20);
        assert!(
            teachable(&enough, 1.0, &examples, THRESHOLD, 1, &Session::default())
                .unwrap()
                .is_some()
        );
        let stop = AtomicBool::new(true);
        assert_eq!(
            teachable(
                &enough,
                1.0,
                &examples,
                THRESHOLD,
                1,
                &Session::new(&stop, &())
            ),
            Err(Stopped)
        );
    }
}
