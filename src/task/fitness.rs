//! [`Fitness`]: how good a robot's answers to several images are together.

use super::grouping::Group;
use serde::{Deserialize, Serialize};

/// Displacement at which an answer is as good as can be, for [`Fitness::MeanClipped`]; and half as good as can be, for
/// the tie-breaks of [`Fitness::RightThenMargin`] and [`Fitness::RightThenMin`] \[voxel lengths\].
const ENOUGH: f64 = 10.0;

/// Displacements up to this are wrong, as in the paper's test \[voxel lengths\].
const WRONG: f64 = 3.0;

/// More than rounding can make of a sum over images.
const SLACK: f64 = 1e-9;

/// How answers to several images become one number. An answer's *margin* is its displacement towards the right side, in
/// voxel lengths, negative on the wrong one; of the two ways to assign sides to groups the fitter counts.
///
/// Where images are counted or averaged, both groups weigh the same, however many images they have: with one class
/// against three, a robot that always walks the way of the three would else be right on three quarters, and the fittest
/// for long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fitness {
    /// The smallest margin \[voxel lengths\]: the paper's. With many images one wrong answer makes standing still
    /// the best that is in reach.
    #[default]
    Min,
    /// The mean of the margins, each divided by ten voxel lengths and clipped to −1 … 1.
    MeanClipped,
    /// How many images are answered right, by more than three voxel lengths; and, between 0 and the worth of an image, the
    /// mean of (1 + m/(|m| + 10))/2 over the margins m, which tells equals apart and never saturates.
    RightThenMargin,
    /// How many images are answered right, as above; and (1 + m/(|m| + 10))/2 of the smallest margin m alone. One image on
    /// which a robot is worse than an equally good elite rules it out: on many images, sooner than with the mean.
    RightThenMin,
}

/// The two ways to assign sides to groups: group A is to walk right, or left.
pub(super) type Assignments = (f64, f64);

impl Fitness {
    /// Fitness under both assignments, of answers by group and displacement; if there are images `to_come` (of group A, of
    /// group B), upper bounds of it. Infinite without any; not a number if an answer is none.
    pub(super) fn of_assignments(
        self,
        answers: impl Iterator<Item = (Group, f64)> + Clone,
        to_come: [usize; 2],
    ) -> Assignments {
        // Towards the right side if group A is to walk right; if it is to walk left, the negative.
        let margins = answers.map(|(group, d)| if group == Group::A { (0, d) } else { (1, -d) });
        if self == Fitness::Min {
            let nothing = (f64::INFINITY, f64::INFINITY);
            return margins.fold(nothing, |(right, left), (_, m)| (smaller(right, m), smaller(left, -m)));
        }
        let mut images = to_come;
        margins.clone().for_each(|(group, _)| images[group] += 1);
        let all = images[0] + images[1];
        if all == 0 {
            return (f64::INFINITY, f64::INFINITY);
        }
        // Exactly 1 where both groups have as many, or one has none.
        let weight =
            |of_group: usize| if images.contains(&0) { 1.0 } else { all as f64 / (2 * of_group) as f64 };
        let weights = images.map(weight);
        // What is to come is as good as can be.
        let best = weights[0] * to_come[0] as f64 + weights[1] * to_come[1] as f64;
        let (mut counts, mut sums, mut least) = ([to_come; 2], [best; 2], [1.0; 2]);
        for (group, margin) in margins {
            for (way, m) in [margin, -margin].into_iter().enumerate() {
                counts[way][group] += usize::from(m > WRONG);
                let worth =
                    if self == Fitness::MeanClipped { (m / ENOUGH).clamp(-1.0, 1.0) } else { grown(m) };
                sums[way] += weights[group] * worth;
                least[way] = smaller(least[way], worth);
            }
        }
        let slack = if to_come == [0, 0] { 0.0 } else { SLACK };
        let image = weights[0].min(weights[1]);
        let of = |way: usize| {
            let mean = sums[way] / all as f64;
            let right = weights[0] * counts[way][0] as f64 + weights[1] * counts[way][1] as f64;
            let fitness = match self {
                Fitness::RightThenMargin => right + image * mean,
                Fitness::RightThenMin => right + image * least[way],
                _ => mean,
            };
            fitness + slack
        };
        (of(0), of(1))
    }
}

/// A margin as a number between 0 and 1 that never stops growing: 1/2 for standing still.
fn grown(margin: f64) -> f64 {
    (1.0 + margin / (margin.abs() + ENOUGH)) / 2.0
}

/// The smaller, or what is not a number: an answer that is none must never be overlooked.
fn smaller(x: f64, y: f64) -> f64 {
    if y < x || y.is_nan() { y } else { x }
}

/// The fitter of two assignments.
pub(super) fn better((x, y): Assignments) -> f64 {
    // + 0.0 makes −0 a 0: equal numbers, one text in files.
    (if x >= y { x } else { y }) + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use Group::{A, B};
    use proptest::prelude::*;

    const MANY: [Fitness; 3] = [Fitness::MeanClipped, Fitness::RightThenMargin, Fitness::RightThenMin];

    fn fitness(kind: Fitness, answers: &[(Group, f64)]) -> f64 {
        better(kind.of_assignments(answers.iter().copied(), [0, 0]))
    }

    #[test]
    fn long_walks_count_no_more_than_enough() {
        let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
        assert_eq!(mean(&[(A, -5.0), (B, 40.0)]), 0.75);
        assert_eq!(mean(&[(A, 40.0), (A, -10.0), (B, 2.0), (B, -10.0)]), 0.2);
        assert_eq!(mean(&[(A, 4.0), (B, 4.0)]), 0.0);
    }

    #[test]
    fn groups_weigh_the_same_however_many_images_they_have() {
        // One against three: always walking one way is worth nothing, and not three quarters.
        let same_way = [(A, 20.0), (B, 20.0), (B, 20.0), (B, 20.0)];
        assert!(fitness(Fitness::MeanClipped, &same_way).abs() < 1e-12);
        let right = |answers: &[(Group, f64)]| fitness(Fitness::RightThenMargin, answers);
        assert!((2.0..2.7).contains(&right(&same_way)), "{}", right(&same_way));
        // All of A and two of three of B: 2 + 2 · 2/3 of 4.
        let most = right(&[(A, 9.0), (B, -9.0), (B, -9.0), (B, 9.0)]);
        assert!((2.0 + 4.0 / 3.0..4.0).contains(&most), "{most}");
    }

    #[test]
    fn one_more_right_answer_beats_any_margin() {
        for kind in [Fitness::RightThenMargin, Fitness::RightThenMin] {
            let right = |answers: &[(Group, f64)]| fitness(kind, answers);
            let (short, long) =
                (right(&[(A, 3.1), (A, 3.1), (B, -3.1)]), right(&[(A, 90.0), (A, 3.0), (B, -90.0)]));
            assert!((3.0..4.0).contains(&short) && (2.0..3.0).contains(&long), "{kind:?} {short} {long}");
            let (short, long) = (right(&[(A, 3.1), (B, -3.1)]), right(&[(A, 3.0), (B, -1e9)]));
            assert!((2.0..3.0).contains(&short) && (1.0..2.0).contains(&long), "{kind:?} {short} {long}");
            // Nor does the tie-break ever saturate.
            assert!(right(&[(A, 1e4), (B, -1e4)]) > right(&[(A, 1e3), (B, -1e3)]));
            assert!(right(&[(A, f64::NAN), (B, -9.0)]).is_nan());
        }
        assert!(mean_of_nan().is_nan());
    }

    #[test]
    fn of_equals_in_right_answers_the_one_with_the_better_worst_is_fitter() {
        let right = |answers: &[(Group, f64)]| fitness(Fitness::RightThenMin, answers);
        // A worst margin of 10 is worth 3/4 of an image, here of one of A's, 3/4; what the others are does not matter.
        assert_eq!(right(&[(A, 90.0), (A, 10.0), (B, -30.0)]), 3.0 + 0.75 * 0.75);
        assert!(right(&[(A, 5.0), (B, -5.0)]) > right(&[(A, 4.0), (B, -90.0)]));
        assert!(right(&[(A, -1.0), (B, -5.0)]) > right(&[(A, -2.0), (B, -90.0)]));
        // The worst image known says at once how good a robot can become.
        let bound =
            better(Fitness::RightThenMin.of_assignments([(A, 10.0), (B, -30.0)].into_iter(), [40, 40]));
        assert!((82.75..82.75 + 1e-6).contains(&bound), "{bound}");
    }

    fn mean_of_nan() -> f64 {
        fitness(Fitness::MeanClipped, &[(A, 1.0), (B, f64::NAN)])
    }

    proptest! {
        #[test]
        fn what_is_known_bounds_what_can_come(
            answers in prop::collection::vec(
                (any::<bool>(), prop_oneof![-30.0..30.0f64, Just(10.0), Just(-10.0)], any::<bool>()),
                1..40,
            )
        ) {
            let answer = |a: &(bool, f64, bool)| (if a.0 { A } else { B }, a.1);
            let all: Vec<_> = answers.iter().map(answer).collect();
            let known: Vec<_> = answers.iter().filter(|a| a.2).map(answer).collect();
            for kind in MANY {
                let to_come = |group| answers.iter().filter(|a| !a.2 && answer(a).0 == group).count();
                let bound = better(kind.of_assignments(known.iter().copied(), [to_come(A), to_come(B)]));
                prop_assert!(bound >= fitness(kind, &all), "{kind:?}");
            }
        }

        #[test]
        fn mirrored_answers_are_as_fit(answers in prop::collection::vec((any::<bool>(), -30.0..30.0f64), 1..20)) {
            let of = |sign: f64| answers.iter().map(move |&(a, d)| (if a { A } else { B }, sign * d)).collect::<Vec<_>>();
            for kind in MANY {
                prop_assert_eq!(fitness(kind, &of(1.0)), fitness(kind, &of(-1.0)));
            }
        }
    }
}
