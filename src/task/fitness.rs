//! [`Fitness`]: how good a robot's answers to several images are together.

use super::grouping::Group;
use serde::{Deserialize, Serialize};

/// Displacement at which an answer is as good as can be, if nothing else is said, for [`Fitness::MeanClipped`] and
/// [`Fitness::MeanHinge`]; and half as good as can be, for the tie-breaks of the others \[voxel lengths\].
pub const ENOUGH: u16 = 10;

/// Displacements up to this are wrong, as in the paper's test \[voxel lengths\].
pub(super) const WRONG: f64 = 3.0;

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
    /// The mean of the margins, each divided by ten voxel lengths (or what else is [`enough`](Criterion::enough)) and clipped to
    /// −1 … 1.
    MeanClipped,
    /// The mean of the margins, each divided by as much, but never more than 1 (hinge loss; Cortes & Vapnik 1995): the farther an answer leads astray, the more it costs, so that a robot which knows three classes and walks the wrong way
    /// for all of the fourth is drawn away from there.
    MeanHinge,
    /// How many images are answered right, by more than three voxel lengths; and, between 0 and the worth of an image, the
    /// mean of (1 + m/(|m| + 10))/2 over the margins m, which tells equals apart and never saturates.
    RightThenMargin,
    /// How many images are answered right, as above; and (1 + m/(|m| + 10))/2 of the smallest margin m alone. One image on
    /// which a robot is worse than an equally good elite rules it out: on many images, sooner than with the mean.
    RightThenMin,
    /// How many images are answered right before the fifth wrong answer, in the images' order, the classes by turns; ties
    /// as with [`Fitness::RightThenMargin`], of the images so far. What comes after need not be shown: bodies that know
    /// little are told after few images, and hundreds tell the good from the better.
    UntilFifthWrong,
    /// The same up to the twentieth wrong answer: for robots that know so little that up to the fifth they are shown a dozen
    /// images, and told by luck.
    UntilTwentiethWrong,
}

/// The two ways to assign sides to groups: group A is to walk right, or left.
pub(super) type Assignments = (f64, f64);

/// What answers are judged by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Criterion {
    /// How they become one number.
    pub fitness: Fitness,
    /// In a mean, the margin at which an answer is as good as can be \[voxel lengths\], above 0.
    pub enough: u16,
}

impl From<Fitness> for Criterion {
    fn from(fitness: Fitness) -> Self {
        Criterion { fitness, enough: ENOUGH }
    }
}

impl Criterion {
    /// Wrong answers after which nothing counts; `None` where all images do.
    pub fn last_wrong(self) -> Option<u16> {
        match self.fitness {
            Fitness::UntilFifthWrong => Some(5),
            Fitness::UntilTwentiethWrong => Some(20),
            _ => None,
        }
    }

    /// Fitness under both assignments, of answers by group and displacement in the images' order; if some are still to
    /// come (`None`), upper bounds of it. Infinite without any image; not a number if an answer is none.
    pub(super) fn of_assignments(
        self,
        answers: impl Iterator<Item = (Group, Option<f64>)> + Clone,
    ) -> Assignments {
        let margins = margins(answers);
        if self.fitness == Fitness::Min {
            let nothing = (f64::INFINITY, f64::INFINITY);
            let known = margins.filter_map(|(_, m)| m);
            return known.fold(nothing, |(right, left), m| (smaller(right, m), smaller(left, -m)));
        }
        let (images, weights) = weights(margins.clone());
        let all = images[0] + images[1];
        if all == 0 {
            return (f64::INFINITY, f64::INFINITY);
        }
        if let Some(last) = self.last_wrong() {
            return (run(margins.clone(), weights, 1.0, last).0, run(margins, weights, -1.0, last).0);
        }
        let mut to_come = images;
        margins.clone().filter(|(_, m)| m.is_some()).for_each(|(group, _)| to_come[group] -= 1);
        // What is to come is as good as can be.
        let best = weights[0] * to_come[0] as f64 + weights[1] * to_come[1] as f64;
        let (mut counts, mut sums, mut least) = ([to_come; 2], [best; 2], [1.0; 2]);
        for (group, margin) in margins.filter_map(|(group, m)| Some((group, m?))) {
            for (way, m) in [margin, -margin].into_iter().enumerate() {
                counts[way][group] += usize::from(m > WRONG);
                let worth = self.worth(m);
                sums[way] += weights[group] * worth;
                least[way] = smaller(least[way], worth);
            }
        }
        let slack = if to_come == [0, 0] { 0.0 } else { SLACK };
        let image = weights[0].min(weights[1]);
        let of = |way: usize| {
            let mean = sums[way] / all as f64;
            let right = weights[0] * counts[way][0] as f64 + weights[1] * counts[way][1] as f64;
            let fitness = match self.fitness {
                Fitness::RightThenMargin => right + image * mean,
                Fitness::RightThenMin => right + image * least[way],
                _ => mean,
            };
            fitness + slack
        };
        (of(0), of(1))
    }

    /// Whether it is nothing but the mean of what answers are worth, both groups weighing the same.
    pub fn is_mean(self) -> bool {
        matches!(self.fitness, Fitness::MeanClipped | Fitness::MeanHinge)
    }

    /// What an answer with this margin is worth, at most 1, in the mean that the fitness is, or that breaks its ties.
    pub(super) fn worth(self, margin: f64) -> f64 {
        let share = margin / f64::from(self.enough);
        match self.fitness {
            Fitness::MeanClipped => share.clamp(-1.0, 1.0),
            Fitness::MeanHinge => smaller(1.0, share),
            _ => grown(margin),
        }
    }

    /// Whether answers that are still to come (`None`) cannot change the fitness under either assignment.
    pub(super) fn is_settled(self, answers: impl Iterator<Item = (Group, Option<f64>)> + Clone) -> bool {
        let margins = margins(answers);
        let (_, weights) = weights(margins.clone());
        self.last_wrong().is_some_and(|last| {
            run(margins.clone(), weights, 1.0, last).1 && run(margins, weights, -1.0, last).1
        })
    }
}

/// By number of the group: displacements towards the right side if group A is to walk right; if it is to walk left, the
/// negatives of those.
pub(super) fn margins(
    answers: impl Iterator<Item = (Group, Option<f64>)> + Clone,
) -> impl Iterator<Item = (usize, Option<f64>)> + Clone {
    answers.map(|(group, d)| if group == Group::A { (0, d) } else { (1, d.map(|d| -d)) })
}

/// How many images each group has, and what one of them weighs: exactly 1 where both have as many, or one has none.
pub(super) fn weights(margins: impl Iterator<Item = (usize, Option<f64>)>) -> ([usize; 2], [f64; 2]) {
    let mut images = [0; 2];
    margins.for_each(|(group, _)| images[group] += 1);
    let all = images[0] + images[1];
    let weight = |of_group: usize| if images.contains(&0) { 1.0 } else { all as f64 / (2 * of_group) as f64 };
    (images, images.map(weight))
}

/// Fitness up to the `last` wrong answer under one of the assignments, or an upper bound of it; and whether it is known that
/// that was given, and when.
fn run(
    margins: impl Iterator<Item = (usize, Option<f64>)>,
    weights: [f64; 2],
    sign: f64,
    last: u16,
) -> (f64, bool) {
    let (mut right, mut wrong, mut shown, mut sum) = (0.0, 0.0, 0.0, 0.0);
    let (mut is_known, mut is_over) = (true, false);
    for (group, margin) in margins {
        // What is to come is as good as can be.
        let margin = margin.map(|m| sign * m);
        is_known &= margin.is_some();
        shown += weights[group];
        sum += weights[group] * margin.map_or(1.0, grown);
        let counts = if margin.is_none_or(|m| m > WRONG) { &mut right } else { &mut wrong };
        *counts += weights[group];
        is_over = wrong > f64::from(last) - SLACK;
        if is_over {
            break;
        }
    }
    let slack = if is_known { 0.0 } else { SLACK };
    (right + weights[0].min(weights[1]) * sum / shown + slack, is_known && is_over)
}

/// A margin as a number between 0 and 1 that never stops growing: 1/2 for standing still.
fn grown(margin: f64) -> f64 {
    (1.0 + margin / (margin.abs() + f64::from(ENOUGH))) / 2.0
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

    const MANY: [Fitness; 6] = [
        Fitness::MeanClipped,
        Fitness::MeanHinge,
        Fitness::RightThenMargin,
        Fitness::RightThenMin,
        Fitness::UntilFifthWrong,
        Fitness::UntilTwentiethWrong,
    ];

    fn fitness(kind: Fitness, answers: &[(Group, f64)]) -> f64 {
        better(Criterion::from(kind).of_assignments(answers.iter().map(|&(group, d)| (group, Some(d)))))
    }

    #[test]
    fn long_walks_count_no_more_than_enough() {
        let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
        assert_eq!(mean(&[(A, -5.0), (B, 40.0)]), 0.75);
        assert_eq!(mean(&[(A, 40.0), (A, -10.0), (B, 2.0), (B, -10.0)]), 0.2);
        assert_eq!(mean(&[(A, 4.0), (B, 4.0)]), 0.0);
    }

    #[test]
    fn the_farther_astray_the_worse_is_a_hinged_answer_but_enough_is_enough() {
        let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanHinge, answers);
        assert_eq!(mean(&[(A, 5.0), (B, -40.0)]), 0.75);
        assert_eq!(mean(&[(A, 40.0), (B, 40.0)]), -1.5);
        // Three of four known by far and one by far wrong is worth less than all four a little.
        let (three, four) =
            ([(A, 30.0), (A, 30.0), (B, -30.0), (B, 30.0)], [(A, 1.0), (A, 1.0), (B, -1.0), (B, -1.0)]);
        assert!(mean(&three) < mean(&four));
        let clipped = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
        assert!(clipped(&three) > clipped(&four));
        assert!(mean(&[(A, f64::NAN), (B, -9.0)]).is_nan());
    }

    #[test]
    fn how_far_is_enough_is_a_matter_of_the_criterion() {
        let mean = |fitness, enough, answers: &[(Group, f64)]| {
            let known = answers.iter().map(|&(group, d)| (group, Some(d)));
            better(Criterion { fitness, enough }.of_assignments(known))
        };
        let answers = [(A, 30.0), (A, -10.0), (B, -10.0), (B, -80.0)];
        assert_eq!(mean(Fitness::MeanHinge, 40, &answers), (0.75 - 0.25 + 0.25 + 1.0) / 4.0);
        assert_eq!(mean(Fitness::MeanClipped, 40, &answers), mean(Fitness::MeanHinge, 40, &answers));
        assert_eq!(mean(Fitness::MeanHinge, 5, &answers), (1.0 - 2.0 + 1.0 + 1.0) / 4.0);
        assert_eq!(mean(Fitness::MeanClipped, 5, &answers), 0.5);
        // Of two robots that are as often right, the one that walks farther.
        let (short, long) = ([(A, 12.0), (B, -12.0)], [(A, 36.0), (B, -36.0)]);
        assert_eq!(mean(Fitness::MeanHinge, ENOUGH, &short), mean(Fitness::MeanHinge, ENOUGH, &long));
        assert!(mean(Fitness::MeanHinge, 40, &short) < mean(Fitness::MeanHinge, 40, &long));
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
        let to_come = (0..40).flat_map(|_| [(A, None), (B, None)]);
        let known = [(A, Some(10.0)), (B, Some(-30.0))].into_iter();
        let right = Criterion::from(Fitness::RightThenMin);
        let bound = better(right.of_assignments(known.chain(to_come)));
        assert!((82.75..82.75 + 1e-6).contains(&bound), "{bound}");
    }

    #[test]
    fn the_fifth_wrong_answer_ends_it() {
        let until = |answers: &[(Group, f64)]| fitness(Fitness::UntilFifthWrong, answers);
        let (right, wrong) = ([(A, 9.0), (B, -9.0)], [(A, 3.0), (B, 1.0)]);
        // Six right, four wrong, two right: eight, and less than one for how far it walked.
        let alive = [right, right, right, wrong, wrong, right].concat();
        assert!((8.0..9.0).contains(&until(&alive)), "{}", until(&alive));
        // Then two wrong ones: with the first of them it is over, whatever comes.
        let over = [&alive[..], &wrong].concat();
        assert!((8.0..9.0).contains(&until(&over)));
        assert_eq!(until(&over), until(&[&over[..], &right, &right].concat()));
        // Two of three images are of group B, and weigh 3/4 each; one of A's, 3/2. Until seven of B are wrong, four of A.
        let same_way: Vec<_> = (0..12).flat_map(|_| [(A, -9.0), (B, -9.0), (B, -9.0)]).collect();
        assert!((6.0..6.75).contains(&until(&same_way)), "{}", until(&same_way));
        assert!(until(&[(A, f64::NAN), (B, 1.0)]).is_nan());
        // The other ends with the twentieth; walking one way is right on every second image until then.
        let longer = |answers: &[(Group, f64)]| fitness(Fitness::UntilTwentiethWrong, answers);
        let same_way = |images| vec![[(A, -9.0), (B, -9.0)]; images].concat();
        assert!((20.0..21.0).contains(&longer(&same_way(20))));
        assert_eq!(longer(&same_way(20)), longer(&same_way(30)));
        assert!(longer(&same_way(19)) < longer(&same_way(20)));
    }

    #[test]
    fn what_comes_after_the_fifth_wrong_answer_is_known_not_to_count() {
        let settled = |answers: &[(Group, Option<f64>)]| {
            Criterion::from(Fitness::UntilFifthWrong).is_settled(answers.iter().copied())
        };
        // Neither way right: both assignments are over after five.
        let (stood, to_come) = ([(A, Some(0.0)), (B, Some(0.0))], [(A, None), (B, None)]);
        assert!(settled(&[stood, stood, stood, to_come].concat()));
        assert!(!settled(&[stood, stood, to_come, to_come].concat()));
        // Something is missing before.
        assert!(!settled(&[stood, to_come, stood, stood].concat()));
        assert!(
            MANY[..4]
                .iter()
                .all(|&kind| !Criterion::from(kind).is_settled([stood, stood, stood].concat().into_iter()))
        );
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
            let all = answers.iter().map(|&(a, d, _)| (if a { A } else { B }, Some(d)));
            let known = answers.iter().map(|&(a, d, known)| (if a { A } else { B }, known.then_some(d)));
            for kind in MANY {
                let criterion = Criterion::from(kind);
                let fitness = criterion.of_assignments(all.clone());
                let bound = criterion.of_assignments(known.clone());
                prop_assert!(bound.0 >= fitness.0 && bound.1 >= fitness.1, "{kind:?}");
                if criterion.is_settled(known.clone()) {
                    prop_assert_eq!(bound, fitness);
                }
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
