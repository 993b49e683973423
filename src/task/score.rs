//! From displacements to fitness and task: pure functions (paper, section "Fitness").
//!
//! The paper defines fitness by cases: all images answered right: the smallest |d|; else minus the largest |d| of
//! a wrong answer. Call an answer's *margin* its displacement towards the right side, negative on the wrong one:
//! both cases are then the smallest margin. Two things follow that make savings lossless: fitness is continuous
//! (d = 0 counts as wrong, with margin 0), and the fitness of some of the images bounds that of all from above.

use crate::task::direction::Assignment;
use crate::task::fitness::{Fitness, better};
use crate::task::grouping::{Group, Grouping, Split};

/// How a robot answered an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Class of the image.
    pub class: u8,
    /// How far the robot walked to the right while it saw it, in voxel lengths; `None` if it has not been shown it.
    pub displacement: Option<f64>,
}

/// Which task a robot performs, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Index in [`Grouping::tasks`].
    pub task: usize,
    /// See [`Fitness`]. The smallest margin is in voxel lengths and positive if every image is answered right.
    pub fitness: f64,
}

/// Fitness on two groups, in voxel lengths: of both assignments of directions to groups the better one's smallest
/// margin. Infinite without answers, not a number if an answer is none; never −0.
pub fn two_group_fitness(answers: &[(Group, f64)]) -> f64 {
    better(Fitness::Min.of_assignments(answers.iter().map(|&(group, d)| (group, Some(d)))))
}

pub(super) fn of_split(
    split: &Split,
    answers: &[Answer],
) -> impl Iterator<Item = (Group, Option<f64>)> + Clone {
    answers.iter().filter_map(|answer| Some((split.group(answer.class)?, answer.displacement)))
}

impl Grouping {
    /// Fitness on a task, or, while some images have not been shown, an **upper bound** of it. Images of classes in neither
    /// of its groups do not count.
    pub fn fitness_on(&self, split: &Split, answers: &[Answer]) -> f64 {
        better(self.fitness().of_assignments(of_split(split, answers)))
    }

    /// The task a robot performs, the one it is fittest on (the first wins a tie), and its fitness there.
    ///
    /// With one image per class and the smallest margin this is the paper's rule: min |d|, and the signs say which
    /// task. A robot that walks the same way for all classes goes to that bin with min |d| if there is one, else to its
    /// best split with that one's negative fitness.
    pub fn score(&self, answers: &[Answer]) -> Score {
        let mut best = Score { task: 0, fitness: f64::NEG_INFINITY };
        for (task, split) in self.tasks().iter().enumerate() {
            let fitness = self.fitness_on(split, answers);
            if fitness > best.fitness || fitness.is_nan() {
                best = Score { task, fitness };
            }
        }
        best
    }

    /// Whether a robot may still enter the archive: whether some task can be its own, and its fitness there above
    /// `incumbent(task)` (`None`: the cell is empty), if only the displacements known so far are fixed. Lossless: where this
    /// is false, no further answers put the robot in.
    pub fn can_still_win(&self, answers: &[Answer], incumbent: impl Fn(usize) -> Option<f64>) -> bool {
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

    /// The answers from the worst to the best on the task the robot performs, both groups by turns: a robot that always
    /// walks one way is right on all of a group. Images of classes in neither group, or not shown, are left out.
    pub fn hardest_first(&self, answers: &[Answer]) -> Vec<usize> {
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
        // Stable: of the two groups' next ones the worse comes first.
        turns.sort_by_key(|(worse, _)| *worse);
        turns.into_iter().map(|(_, image)| image).collect()
    }

    /// Whether the robot's fitness will surely be 0 or more, so that no task it is bound to fail can be its own:
    /// with one image per class every set of directions is some split's, or the same way for all.
    fn never_negative(&self, answers: &[Answer]) -> bool {
        let mut classes: Vec<u8> = answers.iter().map(|a| a.class).collect();
        let images = classes.len();
        classes.sort_unstable();
        classes.dedup();
        let asked = answers.iter().filter(|a| self.tasks().iter().any(|s| s.group(a.class).is_some()));
        let (mut left, mut right) = (false, false);
        asked.filter_map(|a| a.displacement).for_each(|d| {
            left |= d <= 0.0;
            right |= d >= 0.0;
        });
        self.has_all_splits() && classes.len() == images && (self.has_same_way_bin() || left && right)
    }
}

#[cfg(test)]
#[path = "score_tests.rs"]
mod tests;
