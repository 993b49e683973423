//! From displacements to fitness and task: pure functions (paper, section "Fitness").
//!
//! The paper defines fitness by cases: the smallest |d| if all images are answered correctly, else
//! minus the largest |d| of a wrong answer. An answer's *margin* is its displacement in the correct
//! direction, negative in the wrong one; in both cases fitness is then the smallest margin. Two
//! things follow that make savings lossless: fitness is continuous (d = 0 counts as wrong, with
//! margin 0), and the fitness on some of the images is an upper bound of that on all.

use crate::task::answer::{Answer, Assignment, answers_of_split};
use crate::task::fitness::Group;
use crate::task::fitness::{Fitness, better};
use crate::task::grouping::{ClassSplit, Grouping};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Score {
    /// Index in [`Grouping::tasks`].
    pub(crate) task: usize,
    /// See [`Fitness`]. The smallest margin is in voxel lengths, above 0 if all is correct.
    pub(crate) fitness: f64,
}

/// Returns the fitness on two groups, in voxel lengths: the smallest margin under the better of
/// both assignments of directions. Infinite without answers, NaN with a NaN answer; never −0.
pub fn two_group_fitness(answers: &[(Group, f64)]) -> f64 {
    better(Fitness::Min.of_assignments(answers.iter().map(|&(group, d)| (group, Some(d)))))
}

impl Grouping {
    /// Returns the fitness on a task, or an **upper bound** while answers are missing.
    pub(crate) fn fitness_on(&self, split: &ClassSplit, answers: &[Answer]) -> f64 {
        better(
            self.fitness()
                .of_assignments(answers_of_split(split, answers)),
        )
    }

    /// Returns the task that a robot is fittest on (the first wins a tie), and its fitness there.
    /// With one image per class and the smallest margin this is the paper's rule, min |d|, and the
    /// signs determine the task. Walking the same way for all classes goes to that bin with min |d|
    /// if there is one, else to the best split, with a negative fitness.
    pub(crate) fn score(&self, answers: &[Answer]) -> Score {
        let mut best = Score {
            task: 0,
            fitness: f64::NEG_INFINITY,
        };
        for (task, split) in self.tasks().iter().enumerate() {
            let fitness = self.fitness_on(split, answers);
            if fitness > best.fitness || fitness.is_nan() {
                best = Score { task, fitness };
            }
        }
        best
    }

    /// Returns true if a robot may still enter the archive, given only the displacements known so
    /// far: some task may be its own, with a fitness above `incumbent(task)` (`None`: the cell is
    /// empty). Lossless: if this is false, no further answers get the robot in.
    pub fn can_still_win(
        &self,
        answers: &[Answer],
        incumbent: impl Fn(usize) -> Option<f64>,
    ) -> bool {
        let wins = |task, fitness| incumbent(task).is_none_or(|i| fitness > i);
        if answers.iter().all(|answer| answer.displacement.is_some()) {
            let Score { task, fitness } = self.score(answers);
            return wins(task, fitness);
        }
        let never_negative = self.fitness() == Fitness::Min && self.never_negative(answers);
        self.tasks().iter().enumerate().any(|(task, split)| {
            let bound = self.fitness_on(split, answers);
            let possible = bound >= 0.0 || !never_negative;
            possible && wins(task, bound)
        })
    }

    /// Returns the indices of the answers from the worst to the best on the robot's task. Both
    /// groups take turns, since a robot that always walks one way is right on all of a group.
    /// Images of classes in neither group, or without an answer, are left out.
    pub(crate) fn hardest_first(&self, answers: &[Answer]) -> Vec<usize> {
        let split = &self.tasks()[self.score(answers).task];
        let assignment = Assignment::from_training(split, self.fitness(), answers);
        let mut margins: Vec<(f64, Group, usize)> = (answers.iter().zip(0..))
            .filter_map(|(answer, image)| {
                let group = split.group(answer.class)?;
                Some((assignment.margin(group, answer.displacement?), group, image))
            })
            .collect();
        margins.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut worse = [0; 2];
        let mut turns: Vec<(usize, usize)> = Vec::new();
        for (_, group, image) in margins {
            let worse = &mut worse[usize::from(group == Group::B)];
            turns.push((*worse, image));
            *worse += 1;
        }
        // A stable sort: of the two groups' next images the worse one comes first.
        turns.sort_by_key(|(worse, _)| *worse);
        turns.into_iter().map(|(_, image)| image).collect()
    }

    /// True if the fitness will surely be 0 or more: with one image per class every set of
    /// directions is some split's, or the same way for all.
    fn never_negative(&self, answers: &[Answer]) -> bool {
        let mut classes: Vec<u8> = answers.iter().map(|a| a.class).collect();
        let images = classes.len();
        classes.sort_unstable();
        classes.dedup();
        let asked = answers
            .iter()
            .filter(|a| self.tasks().iter().any(|s| s.group(a.class).is_some()));
        let (mut left, mut right) = (false, false);
        asked.filter_map(|a| a.displacement).for_each(|d| {
            left |= d <= 0.0;
            right |= d >= 0.0;
        });
        self.has_all_splits()
            && classes.len() == images
            && (self.has_same_way_bin() || left && right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::answer::{Assignment, Direction};
    use Group::{A, B};
    use proptest::prelude::*;

    /// The paper's definition, literally.
    fn by_cases(answers: &[(Group, f64)]) -> f64 {
        let of = |a: Direction| {
            let assignment = Assignment { a };
            let is_wrong = |(group, d): &&(Group, f64)| !assignment.is_right(*group, *d, 0.0);
            let size = |(_, d): &(Group, f64)| d.abs();
            let wrong = answers.iter().filter(is_wrong).map(size).reduce(f64::max);
            let least = answers.iter().map(size).fold(f64::INFINITY, f64::min);
            wrong.map_or(least, |w| -w)
        };
        of(Direction::Left).max(of(Direction::Right))
    }

    fn answers(displacements: &[f64]) -> Vec<Answer> {
        displacements
            .iter()
            .zip(0..)
            .map(|(&d, class)| Answer {
                class,
                displacement: Some(d),
            })
            .collect()
    }

    fn digits(same_way_bin: bool) -> Grouping {
        Grouping::all_splits(&[0, 1, 2, 3], same_way_bin).unwrap()
    }

    fn named(grouping: &Grouping, displacements: &[f64]) -> (String, f64) {
        let score = grouping.score(&answers(displacements));
        (grouping.tasks()[score.task].name(), score.fitness)
    }

    #[test]
    fn opposite_ways_score_the_shorter_walk_the_same_way_minus_the_shorter() {
        assert_eq!(two_group_fitness(&[(A, -5.0), (B, 8.0)]), 5.0);
        assert_eq!(two_group_fitness(&[(A, 5.0), (B, -8.0)]), 5.0);
        assert_eq!(two_group_fitness(&[(A, 5.0), (B, 8.0)]), -5.0);
        assert_eq!(two_group_fitness(&[(A, -5.0), (B, -3.0)]), -3.0);
        // Several images: A left is wrong by 1, A right by 6.
        assert_eq!(two_group_fitness(&[(A, -6.0), (A, 1.0), (B, 4.0)]), -1.0);
    }

    #[test]
    fn standing_still_scores_0_and_never_minus_0() {
        for stand in [
            [(A, 0.0), (B, 2.0)],
            [(A, -0.0), (B, -2.0)],
            [(A, 0.0), (B, -0.0)],
        ] {
            assert_eq!(two_group_fitness(&stand).to_bits(), 0.0f64.to_bits());
        }
    }

    #[test]
    fn an_answer_that_is_not_a_number_is_not_overlooked() {
        assert!(two_group_fitness(&[(A, f64::NAN), (B, 2.0)]).is_nan());
        assert!(two_group_fitness(&[(A, 1.0), (B, f64::NAN), (A, 0.0)]).is_nan());
        assert!(
            digits(true)
                .score(&answers(&[1.0, f64::NAN]))
                .fitness
                .is_nan()
        );
    }

    #[test]
    fn signs_say_which_task_four_answers_perform() {
        let splits = digits(false);
        assert_eq!(
            named(&splits, &[-4.0, 5.0, 6.0, 7.0]),
            ("0|123".into(), 4.0)
        );
        assert_eq!(
            named(&splits, &[4.0, -5.0, -3.0, 7.0]),
            ("03|12".into(), 3.0)
        );
        assert_eq!(
            named(&splits, &[4.0, 5.0, 6.0, -2.0]),
            ("3|012".into(), 2.0)
        );
    }

    #[test]
    fn all_the_same_way_is_a_bin_of_its_own_or_the_least_failure() {
        assert_eq!(
            named(&digits(true), &[4.0, 5.0, 3.0, 7.0]),
            ("same way".into(), 3.0)
        );
        assert_eq!(
            named(&digits(false), &[4.0, 5.0, 3.0, 7.0]),
            ("2|013".into(), -3.0)
        );
        assert_eq!(
            named(&digits(false), &[-4.0, -4.0, -5.0, -7.0]),
            ("0|123".into(), -4.0)
        );
    }

    #[test]
    fn a_robot_stops_when_no_task_it_can_perform_is_open_to_it() {
        // 0 left and 1 right: only splits of these remain; 0|123 is empty, 01|23 out of reach.
        let shown = |classes: &[u8]| {
            let to_come = classes.iter().map(|&class| Answer {
                class,
                displacement: None,
            });
            answers(&[-5.0, 6.0])
                .into_iter()
                .chain(to_come)
                .collect::<Vec<_>>()
        };
        let taken_but = |free: usize| move |task: usize| (task != free).then_some(5.0);
        assert!(digits(false).can_still_win(&shown(&[2, 3]), taken_but(0)));
        assert!(!digits(false).can_still_win(&shown(&[2, 3]), taken_but(4)));
        // With two missing answers of a class, a robot may fail every task, and that one least.
        assert!(digits(false).can_still_win(&shown(&[2, 3, 3]), taken_but(4)));
        // A lone task is every robot's own, failed or not; only strictly fitter ones enter.
        let lone = Grouping::two_groups(&[0, 1], &[2]).unwrap();
        let against = |incumbent| lone.can_still_win(&shown(&[2]), |_| incumbent);
        assert_eq!(
            [None, Some(-5.1), Some(-5.0)].map(against),
            [true, true, false]
        );
        // Nothing is known: everything is possible.
        assert!(digits(false).can_still_win(&shown(&[2, 3])[2..], |_| Some(1e9)));
    }

    #[test]
    fn the_hardest_images_of_both_groups_come_first_by_turns() {
        // 0 left, 1 right; 2 is in neither group.
        let lone = Grouping::two_groups(&[0], &[1])
            .unwrap()
            .with_fitness(Fitness::MeanClipped);
        let answer = |(class, d)| Answer {
            class,
            displacement: Some(d),
        };
        let answers = [
            (0, -8.0),
            (0, -1.0),
            (1, 9.0),
            (1, -2.0),
            (2, 1.0),
            (0, -4.0),
            (0, -9.0),
            (1, 7.0),
        ]
        .map(answer);
        assert_eq!(lone.hardest_first(&answers), [3, 1, 5, 7, 0, 2, 6]);
        assert_eq!(
            lone.hardest_first(&answers.map(|a| Answer {
                displacement: a.displacement.map(|d| -d),
                ..a
            })),
            [3, 1, 5, 7, 0, 2, 6]
        );
        assert!(lone.hardest_first(&[]).is_empty());
    }

    fn group() -> impl Strategy<Value = Group> {
        prop::bool::ANY.prop_map(|a| if a { A } else { B })
    }

    /// Returns small whole numbers, so that ties and zeros are common; or any.
    fn displacement() -> impl Strategy<Value = f64> {
        prop_oneof![(-3..=3i32).prop_map(f64::from), -30.0..30.0f64]
    }

    fn any_grouping() -> impl Strategy<Value = Grouping> {
        prop_oneof![
            (2..6u8, prop::bool::ANY).prop_map(|(k, bin)| Grouping::all_splits(
                &(0..k).collect::<Vec<_>>(),
                bin
            )
            .unwrap()),
            Just(Grouping::two_groups(&[0, 2], &[1]).unwrap()),
            Just(Grouping::two_groups(&[0], &[1]).unwrap()),
        ]
    }

    proptest! {
        #[test]
        fn the_smallest_margin_is_the_papers_fitness_by_cases(
            answers in prop::collection::vec((group(), displacement()), 1..8)
        ) {
            prop_assert_eq!(two_group_fitness(&answers), by_cases(&answers));
        }

        #[test]
        fn fitness_is_continuous(
            answers in prop::collection::vec((group(), displacement()), 1..8),
            nudges in prop::collection::vec(-0.01..0.01f64, 8),
        ) {
            let nudged: Vec<_> = answers.iter().zip(&nudges).map(|((g, d), n)| (*g, d + n)).collect();
            prop_assert!((two_group_fitness(&answers) - two_group_fitness(&nudged)).abs() <= 0.0101);
        }

        #[test]
        fn fitness_of_some_images_bounds_that_of_all(
            answers in prop::collection::vec((group(), displacement(), prop::bool::ANY), 1..8)
        ) {
            let all: Vec<_> = answers.iter().map(|(g, d, _)| (*g, *d)).collect();
            let some: Vec<_> = answers.iter().filter(|a| a.2).map(|(g, d, _)| (*g, *d)).collect();
            prop_assert!(two_group_fitness(&some) >= two_group_fitness(&all));
        }

        #[test]
        fn with_one_image_per_class_signs_give_the_task_and_the_shortest_walk_the_fitness(
            displacements in prop::collection::vec(displacement().prop_filter("zero", |d| *d != 0.0), 2..7),
            bin: bool,
        ) {
            let classes: Vec<u8> = (0..displacements.len() as u8).collect();
            let grouping = Grouping::all_splits(&classes, bin).unwrap();
            let rightward = |class: u8| displacements[usize::from(class)] > 0.0;
            let same_way = classes.iter().all(|c| rightward(*c) == rightward(0));
            let score = grouping.score(&answers(&displacements));
            let least = displacements.iter().map(|d| d.abs()).fold(f64::INFINITY, f64::min);
            if same_way && !bin {
                prop_assert_eq!(score.fitness, -least);
                return Ok(());
            }
            prop_assert_eq!(score.fitness, least);
            let split = &grouping.tasks()[score.task];
            let parted = |class| (split.group(class) == split.group(0)) == (rightward(class) == rightward(0));
            prop_assert!(classes.iter().all(|class| parted(*class)));
        }

        #[test]
        fn robots_that_cannot_win_any_more_never_enter(
            grouping in any_grouping(),
            kind in prop_oneof![
                Just(Fitness::Min),
                Just(Fitness::MeanClipped),
                Just(Fitness::Response)
            ],
            images in prop::collection::vec((0..5u8, displacement(), prop::bool::weighted(0.7)), 1..24),
            one_each: bool,
            incumbents in prop::collection::vec(prop::option::of(displacement()), 32),
        ) {
            let mut images = images;
            let grouping = grouping.with_fitness(kind);
            if one_each {
                images.sort_by_key(|i| i.0);
                images.dedup_by_key(|i| i.0);
            }
            let answer = |i: &(u8, f64, bool)| Answer { class: i.0, displacement: Some(i.1) };
            let all: Vec<_> = images.iter().map(answer).collect();
            let known: Vec<_> =
                images.iter().map(|i| Answer { class: i.0, displacement: i.2.then_some(i.1) }).collect();
            let score = grouping.score(&all);
            let enters = incumbents[score.task].is_none_or(|incumbent| score.fitness > incumbent);
            let can = grouping.can_still_win(&known, |task| incumbents[task]);
            prop_assert!(can || !enters, "{:?} {:?}", known, score);
            if images.iter().all(|i| i.2) {
                prop_assert_eq!(can, enters);
            }
        }
    }
}
