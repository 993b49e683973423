//! [`Fitness`]: combines a robot's answers to several images into one number.

use crate::task::perturbation::CONDITIONS_OF_RESPONSE;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One of the two groups of a [`ClassSplit`](crate::task::grouping::ClassSplit).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// The first, named before the bar.
    A,
    /// The second.
    B,
}

/// Fewest images under which a response is measured: two pairs in each condition.
pub(crate) const LEAST_IMAGES: usize = 8;

/// Margin at which an answer is as good as can be \[voxel lengths\]. With less, a small change
/// flips many answers; with more, bodies that walk far count more than those that are correct.
pub(crate) const ENOUGH: f64 = 10.0;

/// Larger than any rounding error of a sum over images.
const SLACK: f64 = 1e-9;

/// The rule that turns answers to several images into one number. An answer's *margin* is its
/// displacement in the correct direction, in voxel lengths, negative in the wrong one. Of the two
/// ways to assign directions to groups the fitter one counts.
///
/// Where images are averaged, both groups weigh the same, however many images they have. Otherwise,
/// with one class against three, a robot that always walks the way of the three would be right on
/// three quarters, and the fittest for long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fitness {
    /// The smallest margin, the paper's, for one image per class.
    ///
    /// In voxel lengths. With many images, one wrong answer makes standing still the best result
    /// within reach.
    #[default]
    Min,
    /// The mean of margins / 10, clipped to −1 … 1, for several images per class.
    MeanClipped,
    /// The strength of a gait's response to its voxels' pixels, for gaits to be trained.
    ///
    /// In voxel lengths: `√(mean(o²) − var(e)) − |mean(e)| / 8`, whatever the task. Images are used
    /// as they are and inverted:
    ///
    /// - `o` is half the difference of the two displacements: the part linear in voxel widths;
    /// - `e` is half their sum: the nonlinear part, and the distance that the body walks anyway;
    /// - `var(e)` is the variance within each of [the
    ///   conditions](crate::task::perturbation::of_response) that pairs take in turn. Chance is in
    ///   both terms, and adds nothing on average.
    ///
    /// The sensors have to make up for an eighth of the distance that the body walks anyway. Both
    /// ways to assign directions have the same fitness.
    ///
    /// A run simulates the body's [probe](crate::body::Body::probe): every soft voxel and sensor
    /// becomes an expanding sensor. It sees as many images as there are training images, in pairs of
    /// opposites: pixels are bright, dark or at rest at random, and those that are the same in all
    /// training images stay. Every second pair starts one voxel higher and without length limits.
    /// The result is multiplied by the root of the number of the probe's sensors, which counts up to
    /// two thirds of the grid. A body that is not half as good as it must be after half of its pairs
    /// (four at least) is simulated no further.
    Response,
}

impl Fitness {
    /// Returns its unit; a mean of clipped margins has none.
    pub(crate) fn unit(self) -> Option<&'static str> {
        match self {
            Fitness::Min | Fitness::Response => Some("voxel lengths"),
            Fitness::MeanClipped => None,
        }
    }
}

/// Fitness under the two ways to assign directions to groups: group A should walk right, or left.
pub(super) type Assignments = (f64, f64);

impl Fitness {
    /// Returns the fitness under both assignments, of answers by group in the images' order:
    ///
    /// - if some are still missing (`None`): upper bounds;
    /// - without any image: infinite;
    /// - if an answer is NaN: NaN.
    pub(super) fn of_assignments(
        self,
        answers: impl Iterator<Item = (Group, Option<f64>)> + Clone,
    ) -> Assignments {
        if self == Fitness::Response {
            let response = response(answers.map(|(_, d)| d));
            return (response, response);
        }
        let margins = margins(answers);
        if self == Fitness::Min {
            let nothing = (f64::INFINITY, f64::INFINITY);
            let known = margins.filter_map(|(_, m)| m);
            return known.fold(nothing, |(right, left), m| {
                (smaller(right, m), smaller(left, -m))
            });
        }
        let (images, weights) = weights(margins.clone());
        let all = images[0] + images[1];
        if all == 0 {
            return (f64::INFINITY, f64::INFINITY);
        }
        let mut to_come = images;
        margins
            .clone()
            .filter(|(_, m)| m.is_some())
            .for_each(|(group, _)| to_come[group] -= 1);
        // Missing answers count as perfect.
        let best = weights[0] * to_come[0] as f64 + weights[1] * to_come[1] as f64;
        let mut sums = [best; 2];
        for (group, margin) in margins.filter_map(|(group, m)| Some((group, m?))) {
            for (way, m) in [margin, -margin].into_iter().enumerate() {
                sums[way] += weights[group] * clipped_margin(m);
            }
        }
        let slack = if to_come == [0, 0] { 0.0 } else { SLACK };
        let of = |way: usize| sums[way] / all as f64 + slack;
        (of(0), of(1))
    }
}

/// Returns a margin as it counts in a mean: divided by ten voxel lengths and clipped to −1 … 1.
pub(crate) fn clipped_margin(margin: f64) -> f64 {
    (margin / ENOUGH).clamp(-1.0, 1.0)
}

/// Cost of a voxel length that the body walks anyway. With more, bodies that stand still win at
/// first; with less, so do bodies that walk one way and that no sensors could turn.
const OFFSET_COST: f64 = 0.125;

/// Returns the response of the known pairs of displacements; `None` if no condition has two.
pub(crate) fn response_so_far(displacements: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let known: Vec<f64> = displacements
        .map_while(|displacement| displacement)
        .collect();
    let pairs = known.chunks_exact(2);
    let (odd, even): (Vec<f64>, Vec<f64>) = pairs
        .map(|pair| ((pair[0] - pair[1]) / 2.0, (pair[0] + pair[1]) / 2.0))
        .unzip();
    let conditions = CONDITIONS_OF_RESPONSE;
    let (mut squares, mut free) = (0.0, 0_usize);
    for turn in 0..conditions {
        let within = || even.iter().skip(turn).step_by(conditions);
        // Relative to the first: if all are the same, rounding of their mean makes no difference.
        let Some(first) = within().next() else {
            continue;
        };
        let count = within().count();
        let mean = within().map(|even| even - first).sum::<f64>() / count as f64;
        squares += within()
            .map(|even| (even - first - mean) * (even - first - mean))
            .sum::<f64>();
        free += count - 1;
    }
    let pairs = odd.len() as f64;
    let linear = odd.iter().map(|odd| odd * odd).sum::<f64>() / pairs - squares / free as f64;
    let anyway = (even.iter().sum::<f64>() / pairs).abs();
    (free > 0).then(|| linear.signum() * linear.abs().sqrt() - OFFSET_COST * anyway)
}

/// Returns the response of all pairs: infinite without any, or while a displacement is missing.
fn response(displacements: impl Iterator<Item = Option<f64>> + Clone) -> f64 {
    let mut all = displacements.clone().peekable();
    if all.peek().is_none() || all.any(|displacement| displacement.is_none()) {
        return f64::INFINITY;
    }
    response_so_far(displacements).unwrap_or(0.0)
}

/// Returns the group's number and the margin of each answer if A walks right; negate for left.
pub(super) fn margins(
    answers: impl Iterator<Item = (Group, Option<f64>)> + Clone,
) -> impl Iterator<Item = (usize, Option<f64>)> + Clone {
    answers.map(|(group, d)| {
        if group == Group::A {
            (0, d)
        } else {
            (1, d.map(|d| -d))
        }
    })
}

/// Returns the images of each group, and one's weight: exactly 1 for equal numbers or one group.
pub(super) fn weights(
    margins: impl Iterator<Item = (usize, Option<f64>)>,
) -> ([usize; 2], [f64; 2]) {
    let mut images = [0; 2];
    margins.for_each(|(group, _)| images[group] += 1);
    let all = images[0] + images[1];
    let weight = |of_group: usize| {
        if images.contains(&0) {
            1.0
        } else {
            all as f64 / (2 * of_group) as f64
        }
    };
    (images, images.map(weight))
}

/// Returns the smaller number, or NaN if `y` is NaN: a NaN answer must never be overlooked.
fn smaller(x: f64, y: f64) -> f64 {
    if y < x || y.is_nan() { y } else { x }
}

pub(super) fn better((x, y): Assignments) -> f64 {
    // + 0.0 makes −0 a 0, so that equal numbers have the same text in files.
    (if x >= y { x } else { y }) + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use Group::{A, B};
    use proptest::prelude::*;

    const MANY: [Fitness; 2] = [Fitness::MeanClipped, Fitness::Response];

    fn fitness(kind: Fitness, answers: &[(Group, f64)]) -> f64 {
        better(kind.of_assignments(answers.iter().map(|&(group, d)| (group, Some(d)))))
    }

    #[test]
    fn long_walks_count_no_more_than_enough() {
        let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
        assert_eq!(mean(&[(A, -5.0), (B, 40.0)]), 0.75);
        assert_eq!(mean(&[(A, 40.0), (A, -10.0), (B, 2.0), (B, -10.0)]), 0.2);
        assert_eq!(mean(&[(A, 4.0), (B, 4.0)]), 0.0);
    }

    #[test]
    fn a_response_is_what_moves_the_two_of_a_pair_apart_within_conditions_that_take_turns() {
        let response = |d: &[f64]| {
            let answers: Vec<(Group, f64)> = d
                .iter()
                .zip([A, B, B].iter().cycle())
                .map(|(&d, &g)| (g, d))
                .collect();
            fitness(Fitness::Response, &answers)
        };
        // Half differences 3, 2, −1, −2; half sums 0, 0, 10 and 10, 5 on average.
        let pairs = [3.0, -3.0, 12.0, 8.0, -1.0, 1.0, 8.0, 12.0];
        assert_eq!(response(&pairs), 4.5_f64.sqrt() - 5.0 / 8.0);
        // The direction and differences between conditions do not matter; the offset costs.
        assert_eq!(response(&pairs.map(|d| -d)), 4.5_f64.sqrt() - 5.0 / 8.0);
        assert_eq!(
            response(&[3.0, -3.0, 2.0, -2.0, -1.0, 1.0, -2.0, 2.0]),
            4.5_f64.sqrt()
        );
        assert_eq!(
            response(&[13.0, 7.0, -8.0, -12.0, 9.0, 11.0, -12.0, -8.0]),
            4.5_f64.sqrt()
        );
        // A displacement common to both of a pair is no response.
        assert_eq!(
            response(&[2.0, 2.0, 0.0, 0.0, -2.0, -2.0, 0.0, 0.0]),
            -(4.0_f64).sqrt()
        );
        // Rounding: ten times 0.1 is not 1 in binary.
        assert!((response(&[0.1; 20]) + 0.0125).abs() < 1e-12 && response(&[0.0; 20]) == 0.0);
        assert!(response(&[1.0, 2.0, 1.0, 2.0, f64::NAN, 2.0]).is_nan());
        // Too few pairs, and none.
        assert_eq!(
            (response(&[1.0, 9.0]), response(&[1.0]), response(&[])),
            (0.0, 0.0, f64::INFINITY)
        );
        // A missing answer may have any value.
        let some = [(A, Some(1.0)), (B, None), (A, Some(1.0)), (B, Some(1.0))];
        assert_eq!(
            better(Fitness::Response.of_assignments(some.iter().copied())),
            f64::INFINITY
        );
        assert_eq!(Fitness::Response.unit(), Some("voxel lengths"));
    }

    #[test]
    fn groups_weigh_the_same_however_many_images_they_have() {
        // One against three: always walking one way scores nothing, not three quarters.
        let same_way = [(A, 20.0), (B, 20.0), (B, 20.0), (B, 20.0)];
        assert!(fitness(Fitness::MeanClipped, &same_way).abs() < 1e-12);
        // All of A, and two of three of B: 1/2 + 1/2 · 1/3.
        let most = fitness(
            Fitness::MeanClipped,
            &[(A, 20.0), (B, -20.0), (B, -20.0), (B, 20.0)],
        );
        assert!((most - 2.0 / 3.0).abs() < 1e-12, "{most}");
    }

    #[test]
    fn an_answer_that_is_no_number_makes_none_of_the_mean() {
        assert!(fitness(Fitness::MeanClipped, &[(A, 1.0), (B, f64::NAN)]).is_nan());
    }

    proptest! {
        #[test]
        fn what_is_known_bounds_what_can_come(
            answers in prop::collection::vec(
                (any::<bool>(), prop_oneof![-30.0..30.0f64, Just(10.0), Just(-10.0)], any::<bool>()),
                1..40,
            )
        ) {
            let all = answers.iter().map(|&(a, d, _)| (if a { A } else { B }, Some(d)));
            let known = answers.iter().map(|&(a, d, known)| (if a { A } else { B }, known.then_some(d)));
            for kind in MANY {
                let fitness = kind.of_assignments(all.clone());
                let bound = kind.of_assignments(known.clone());
                prop_assert!(bound.0 >= fitness.0 && bound.1 >= fitness.1, "{kind:?}");
            }
        }

        #[test]
        fn mirrored_answers_are_as_fit(answers in prop::collection::vec((any::<bool>(), -30.0..30.0f64), 1..20)) {
            let group = |is_a: bool| if is_a { A } else { B };
            let of = |sign: f64| answers.iter().map(move |&(a, d)| (group(a), sign * d)).collect::<Vec<_>>();
            for kind in MANY {
                prop_assert_eq!(fitness(kind, &of(1.0)), fitness(kind, &of(-1.0)));
            }
        }
    }
}
