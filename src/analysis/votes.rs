//! Combines robots for two groups of classes into one classifier, without trained weights.

use crate::base::statistics::wilson;
use crate::search::held_out_run::Trial;
use crate::store::images::ImageRef;
use crate::store::team::{Accuracy, Answers, Decoded, Member, TeamFile, Walk};
use crate::task::answer::{Assignment, Direction, Readout, is_correct};
use crate::task::fitness::Group;
use serde::Serialize;

/// Largest displacement that counts in a sum of walks \[voxel lengths\].
pub(crate) const CLIP: f64 = 10.0;

/// The votes and sums of walks under one image, for every class.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Ballot {
    /// Votes: each robot has one for every class of the side it walked to.
    pub(crate) votes: Vec<usize>,
    /// Sums of walks \[voxel lengths\]: positive towards a class's side, negative away from it.
    pub(crate) sums: Vec<f64>,
    /// Number of robots that gave no vote.
    pub(crate) silent: usize,
}

impl Ballot {
    /// Counts one walk of each robot; `None` is an unstable one, without effect. A walk of at most
    /// `threshold` gives no vote; one longer than `clip` counts as `clip`.
    pub(crate) fn count<'a>(
        classes: &[u8],
        walks: impl IntoIterator<Item = (&'a Readout, Option<f64>)>,
        threshold: f64,
        clip: f64,
    ) -> Self {
        let mut ballot = Ballot {
            votes: vec![0; classes.len()],
            sums: vec![0.0; classes.len()],
            silent: 0,
        };
        for (sides, walk) in walks {
            let walk = walk.unwrap_or(0.0);
            let (towards, away) = if walk > 0.0 {
                (&sides.right, &sides.left)
            } else {
                (&sides.left, &sides.right)
            };
            let votes = walk.abs() > threshold;
            ballot.silent += usize::from(!votes);
            let length = walk.abs().min(clip);
            for (place, class) in classes.iter().enumerate() {
                if towards.contains(class) {
                    ballot.votes[place] += usize::from(votes);
                    ballot.sums[place] += length;
                } else if away.contains(class) {
                    ballot.sums[place] -= length;
                }
            }
        }
        ballot
    }

    /// Returns the index of the class with most votes, and true if several tie. Among those the
    /// largest sum of walks wins, then the first.
    pub(crate) fn by_votes(&self) -> (usize, bool) {
        let first = self.first();
        (self.largest(first.iter().copied()), first.len() > 1)
    }

    /// Returns the indices of the classes with most votes.
    fn first(&self) -> Vec<usize> {
        let most = self.votes.iter().copied().max().unwrap_or(0);
        (0..self.votes.len())
            .filter(|place| self.votes[*place] == most)
            .collect()
    }

    /// Returns what breaks a tie of these classes: their sums of walks, or their order if these
    /// are equal, too.
    fn tie_breaker(&self, tied: &[usize]) -> TieBreaker {
        let best = self.sums[self.largest(tied.iter().copied())];
        match tied
            .iter()
            .filter(|place| self.sums[**place] == best)
            .count()
        {
            1 => TieBreaker::Walks,
            _ => TieBreaker::Order,
        }
    }

    /// Returns the index of the class with the largest sum of walks; the first wins a tie.
    pub(crate) fn by_walks(&self) -> usize {
        self.largest(0..self.sums.len())
    }

    fn largest(&self, among: impl Iterator<Item = usize>) -> usize {
        let mut best: Option<usize> = None;
        for place in among {
            if best.is_none_or(|best| self.sums[place] > self.sums[best]) {
                best = Some(place);
            }
        }
        best.unwrap_or(0)
    }
}

/// The rule that decides between classes with equally many votes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum TieBreaker {
    /// The largest sum of walks.
    Walks,
    /// The first class.
    Order,
}

/// The walks of a team under one image and their counts, at the end or before.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Tally {
    /// Displacement of each robot so far \[voxel lengths\]; `None` if it became unstable.
    pub(crate) moved: Vec<Option<f64>>,
    #[serde(flatten)]
    pub(crate) ballot: Ballot,
    /// The class with most votes; `None` while there is no vote.
    pub(crate) says: Option<u8>,
    /// The classes that share most votes; empty without votes or with a single winner.
    pub(crate) tied: Vec<u8>,
    /// The rule by which `says` is one of `tied`; `None` without a tie.
    pub(crate) tie_broken_by: Option<TieBreaker>,
}

impl Tally {
    pub(crate) fn of(
        classes: &[u8],
        judges: &[&Readout],
        moved: Vec<Option<f64>>,
        (threshold, clip): (f64, f64),
    ) -> Self {
        let walks = judges.iter().copied().zip(moved.iter().copied());
        let ballot = Ballot::count(classes, walks, threshold, clip);
        let has_votes = ballot.votes.iter().any(|votes| *votes > 0);
        let says = has_votes.then(|| classes[ballot.by_votes().0]);
        let first = ballot.first();
        let is_tie = has_votes && first.len() > 1;
        let tied = first.iter().filter(|_| is_tie).map(|place| classes[*place]);
        Tally {
            moved,
            says,
            tied: tied.collect(),
            tie_broken_by: is_tie.then(|| ballot.tie_breaker(&first)),
            ballot,
        }
    }
}

impl Accuracy {
    pub(crate) fn of<T: PartialEq>(answers: impl IntoIterator<Item = (T, T)>) -> Self {
        let (mut right, mut all) = (0, 0);
        for (answer, expected) in answers {
            right += usize::from(answer == expected);
            all += 1;
        }
        Accuracy {
            right,
            accuracy: right as f64 / all.max(1) as f64,
            interval: wilson(right, all),
        }
    }
}

impl Member {
    /// Creates a member from a run's robot and its walks so far, with its accuracy; `None` without
    /// any.
    pub(crate) fn of(trial: &Trial, run_sha256: &str, walks: &[Walk]) -> Option<Self> {
        let shown: Vec<usize> = (0..walks.len())
            .filter(|place| walks[*place].is_some())
            .collect();
        let images: Vec<ImageRef> = shown.iter().map(|place| trial.images[*place]).collect();
        let known: Vec<Option<f64>> = shown.iter().filter_map(|place| walks[*place]).collect();
        let trial = Trial {
            images: &images,
            ..*trial
        };
        let member = Member::new(&trial, run_sha256, known);
        match shown.len() {
            0 => None,
            all if all == walks.len() => Some(member),
            _ => Some(Member {
                displacements: walks.iter().map(|walk| walk.flatten()).collect(),
                shown,
                ..member
            }),
        }
    }

    fn new(trial: &Trial, run_sha256: &str, displacements: Vec<Option<f64>>) -> Self {
        let Trial {
            run,
            robot,
            split,
            images,
            threshold,
        } = *trial;
        let assignment = Assignment::from_training(split, run.fitness(), &run.answers(robot));
        let is_right = |(image, walk): (&ImageRef, &Option<f64>)| {
            is_correct(split, assignment, image.label, *walk, threshold)
        };
        let own = images
            .iter()
            .zip(&displacements)
            .filter_map(is_right)
            .map(|is_right| (is_right, true));
        let own = Accuracy::of(own);
        let is_still =
            |walk: &&Option<f64>| walk.is_none_or(|walk| Direction::of(walk, threshold).is_none());
        let still = displacements.iter().filter(is_still).count();
        Member {
            id: robot.id.clone(),
            run: run.name.clone(),
            run_sha256: run_sha256.to_string(),
            task: robot.task.clone(),
            groups: [Group::A, Group::B].map(|group| split.classes(group).to_vec()),
            first_group_walks: assignment.expected(Group::A).name().to_string(),
            body: robot.body.clone(),
            own,
            not_moved: still as f64 / images.len().max(1) as f64,
            displacements,
            shown: Vec::new(),
        }
    }
}

impl Decoded {
    fn new(classes: &[u8], images: &[ImageRef], places: &[usize]) -> Self {
        let place_of = |class: u8| {
            classes
                .iter()
                .position(|other| *other == class)
                .unwrap_or(0)
        };
        let mut confusion = vec![vec![0; classes.len()]; classes.len()];
        for (image, answer) in images.iter().zip(places) {
            confusion[place_of(image.label)][*answer] += 1;
        }
        let share = |(place, class): (usize, &u8)| {
            let all: usize = confusion[place].iter().sum();
            (*class, confusion[place][place] as f64 / all.max(1) as f64)
        };
        let answers: Vec<u8> = places.iter().map(|place| classes[*place]).collect();
        Decoded {
            accuracy: Accuracy::of(
                answers
                    .iter()
                    .copied()
                    .zip(images.iter().map(|image| image.label)),
            ),
            per_class: classes.iter().enumerate().map(share).collect(),
            confusion,
            answers,
        }
    }
}

impl TeamFile {
    /// Counts the votes of all walks under an image.
    fn ballot(&self, sides: &[Readout], image: usize) -> Ballot {
        let walks = sides
            .iter()
            .zip(&self.members)
            .map(|(sides, member)| (sides, member.displacements[image]));
        Ballot::count(&self.classes, walks, self.threshold, self.clip)
    }

    /// Returns the part of an unfinished test that all robots have done; `None` if there is none.
    pub(crate) fn so_far(&self) -> Option<Self> {
        let walks: Vec<Vec<Walk>> = self.members.iter().map(Member::walks).collect();
        let is_whole = |place: &usize| walks.iter().all(|walks| walks[*place].is_some());
        let whole: Vec<usize> = (0..self.images.len()).filter(is_whole).collect();
        if whole.is_empty() || self.members.len() < self.size {
            return None;
        }
        let part = |member: &Member| Member {
            displacements: whole
                .iter()
                .map(|place| member.displacements[*place])
                .collect(),
            shown: Vec::new(),
            ..member.clone()
        };
        Some(TeamFile {
            images: whole.iter().map(|place| self.images[*place]).collect(),
            members: self.members.iter().map(part).collect(),
            ..self.clone()
        })
    }

    /// Returns the members' joint answers to all images.
    pub(crate) fn decided(&self) -> Answers {
        let sides: Vec<Readout> = self.members.iter().map(Member::judge).collect();
        let ballots: Vec<Ballot> = (0..self.images.len())
            .map(|image| self.ballot(&sides, image))
            .collect();
        let knows = |class: &u8| {
            sides
                .iter()
                .filter(|sides| sides.left.contains(class) || sides.right.contains(class))
                .count()
        };
        let known: Vec<usize> = self.classes.iter().map(knows).collect();
        let by_votes: Vec<(usize, bool)> = ballots.iter().map(Ballot::by_votes).collect();
        let by_walks: Vec<usize> = ballots.iter().map(Ballot::by_walks).collect();
        let places: Vec<usize> = by_votes.iter().map(|(place, _)| *place).collect();
        let count = self.images.len().max(1) as f64;
        let agreement = ballots.iter().zip(&places);
        let agreement = agreement
            .map(|(ballot, place)| ballot.votes[*place] as f64 / known[*place].max(1) as f64);
        Answers {
            votes: Decoded::new(&self.classes, &self.images, &places),
            walks: Decoded::new(&self.classes, &self.images, &by_walks),
            ties: by_votes.iter().filter(|(_, tied)| *tied).count() as f64 / count,
            agreement: agreement.sum::<f64>() / count,
            not_moved: ballots
                .iter()
                .map(|ballot| ballot.silent as f64)
                .sum::<f64>()
                / count,
        }
    }

    /// Returns the index and accuracy of the best robot by itself, with votes like the team's.
    pub(crate) fn best_body(&self) -> Option<(usize, Accuracy)> {
        let alone = |(place, member): (usize, &Member)| {
            let sides = member.judge();
            let answer = |(image, walk): (&ImageRef, &Option<f64>)| {
                let ballot =
                    Ballot::count(&self.classes, [(&sides, *walk)], self.threshold, self.clip);
                (self.classes[ballot.by_votes().0], image.label)
            };
            (
                place,
                Accuracy::of(self.images.iter().zip(&member.displacements).map(answer)),
            )
        };
        // The first of several equal ones.
        self.members
            .iter()
            .enumerate()
            .map(alone)
            .reduce(|best, next| {
                if next.1.right > best.1.right {
                    next
                } else {
                    best
                }
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sides(left: &[u8], right: &[u8]) -> Readout {
        Readout {
            left: left.to_vec(),
            right: right.to_vec(),
        }
    }

    fn count(walks: &[(&Readout, Option<f64>)]) -> Ballot {
        Ballot::count(&[0, 1, 2], walks.iter().copied(), 3.0, CLIP)
    }

    #[test]
    fn each_robot_votes_once_for_every_class_of_the_side_it_walks_to() {
        let (a, b) = (sides(&[0], &[1, 2]), sides(&[2], &[1]));
        let ballot = count(&[(&a, Some(5.0)), (&b, Some(4.0))]);
        assert_eq!((ballot.votes.clone(), ballot.silent), (vec![0, 2, 1], 0));
        assert_eq!(ballot.sums, [-5.0, 9.0, 1.0]);
        assert_eq!((ballot.by_votes(), ballot.by_walks()), ((1, false), 1));
    }

    #[test]
    fn short_walks_and_unstable_ones_give_no_vote_and_long_ones_count_up_to_the_clip() {
        let a = sides(&[0], &[1]);
        let ballot = count(&[(&a, Some(3.0)), (&a, None), (&a, Some(-99.0))]);
        assert_eq!((ballot.votes.clone(), ballot.silent), (vec![1, 0, 0], 2));
        assert_eq!(ballot.sums, [7.0, -7.0, 0.0]);
    }

    #[test]
    fn a_tie_goes_to_the_larger_sum_of_walks_among_the_tied_and_then_to_the_lower_class() {
        let (a, b) = (sides(&[0], &[1]), sides(&[2], &[1]));
        // One vote each for 0 and 2; the walk towards 2 is longer.
        assert_eq!(
            count(&[(&a, Some(-4.0)), (&b, Some(-6.0))]).by_votes(),
            (2, true)
        );
        assert_eq!(
            count(&[(&a, Some(-4.0)), (&b, Some(-4.0))]).by_votes(),
            (0, true)
        );
        // Without votes all classes tie, and sums decide.
        assert_eq!(
            count(&[(&a, Some(2.0)), (&b, Some(1.0))]).by_votes(),
            (1, true)
        );
        assert_eq!(count(&[]).by_votes(), (0, true));
    }

    #[test]
    fn a_tally_names_the_classes_of_a_tie_and_what_breaks_it() {
        let (a, b) = (sides(&[0], &[1]), sides(&[2], &[1]));
        let tally = |walks: [f64; 2]| {
            let moved = walks.map(Some).to_vec();
            Tally::of(&[0, 1, 2], &[&a, &b], moved, (3.0, CLIP))
        };
        let broken = |walks| {
            let Tally {
                says,
                tied,
                tie_broken_by,
                ..
            } = tally(walks);
            (says, tied, tie_broken_by)
        };
        let (walks, order) = (Some(TieBreaker::Walks), Some(TieBreaker::Order));
        assert_eq!(broken([-4.0, -6.0]), (Some(2), vec![0, 2], walks));
        assert_eq!(broken([-11.0, -12.0]), (Some(0), vec![0, 2], order));
        assert_eq!(broken([4.0, 4.0]), (Some(1), vec![], None));
        assert_eq!(broken([1.0, 2.0]), (None, vec![], None));
    }

    #[test]
    fn the_order_of_robots_does_not_matter_for_votes() {
        let robots = [sides(&[0], &[1]), sides(&[1], &[2]), sides(&[2], &[0])];
        let walks = [4.0, -8.0, 5.0];
        let all: Vec<_> = robots.iter().zip(walks.map(Some)).collect();
        let reversed: Vec<_> = all.iter().rev().copied().collect();
        assert_eq!(count(&all).votes, count(&reversed).votes);
    }
}
