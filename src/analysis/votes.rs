//! How robots that tell two groups of classes apart answer together which class an image is of,
//! without any trained weight.

use crate::base::error::Error;
use crate::base::ranges;
use crate::base::statistics::wilson;
use crate::task::judge::Judge;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Walks count up to this far in a sum of walks \[voxel lengths\].
pub const CLIP: f64 = 10.0;

/// What all walks under one image come to, for every class.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ballot {
    /// Votes: one of each robot for every class of the side it walked to.
    pub votes: Vec<usize>,
    /// Sums of walks \[voxel lengths\]: towards a class's side positive, away from it negative.
    pub sums: Vec<f64>,
    /// Robots that gave no vote.
    pub silent: usize,
}

impl Ballot {
    /// Counts walks, one of each robot; `None` is that of an unstable simulation, which says
    /// nothing. A walk of at most `threshold` gives no vote; one longer than `clip` counts as `clip`.
    pub fn count<'a>(
        classes: &[u8],
        walks: impl IntoIterator<Item = (&'a Judge, Option<f64>)>,
        threshold: f64,
        clip: f64,
    ) -> Self {
        let mut ballot = Ballot { votes: vec![0; classes.len()], sums: vec![0.0; classes.len()], silent: 0 };
        for (sides, walk) in walks {
            let walk = walk.unwrap_or(0.0);
            let (towards, away) =
                if walk > 0.0 { (&sides.right, &sides.left) } else { (&sides.left, &sides.right) };
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

    /// The place of the class with most votes, and whether several have as many: then the largest
    /// sum of walks among them wins, then the first.
    pub fn by_votes(&self) -> (usize, bool) {
        let most = self.votes.iter().copied().max().unwrap_or(0);
        let among = || (0..self.votes.len()).filter(|place| self.votes[*place] == most);
        (self.largest(among()), among().count() > 1)
    }

    /// The place of the class with the largest sum of walks, the first of several.
    pub fn by_walks(&self) -> usize {
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

/// What the walks of a team come to under one image, at their end or before.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tally {
    /// How far each robot has walked \[voxel lengths\]; none of one that has become unstable.
    pub moved: Vec<Option<f64>>,
    /// Votes and sums of walks, for every class.
    #[serde(flatten)]
    pub ballot: Ballot,
    /// The class with most votes; none while there is no vote.
    pub says: Option<u8>,
}

impl Tally {
    /// Of walks, each with what it says; threshold and clip as of [`Ballot::count`].
    pub fn of(
        classes: &[u8],
        judges: &[&Judge],
        moved: Vec<Option<f64>>,
        (threshold, clip): (f64, f64),
    ) -> Self {
        let walks = judges.iter().copied().zip(moved.iter().copied());
        let ballot = Ballot::count(classes, walks, threshold, clip);
        let has_votes = ballot.votes.iter().any(|votes| *votes > 0);
        let says = has_votes.then(|| classes[ballot.by_votes().0]);
        Tally { moved, ballot, says }
    }
}

/// How many answers are correct.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Accuracy {
    /// Images answered correctly.
    pub right: usize,
    /// Share answered correctly.
    #[serde(deserialize_with = "ranges::share")]
    pub accuracy: f64,
    /// Its 95 % Wilson interval.
    #[serde(deserialize_with = "ranges::interval")]
    pub interval: [f64; 2],
}

impl Accuracy {
    /// Checks that it is about at most so many images.
    ///
    /// # Errors
    /// If more are right; the error names the key.
    pub(crate) fn check(&self, images: usize) -> Result<(), Error> {
        match self.right <= images {
            true => Ok(()),
            false => Err(Error::at_key("right", format!("expected at most {images}, found {}", self.right))),
        }
    }

    /// Of answers, each with what would be correct.
    pub fn of<T: PartialEq>(answers: impl IntoIterator<Item = (T, T)>) -> Self {
        let (mut right, mut all) = (0, 0);
        for (answer, expected) in answers {
            right += usize::from(answer == expected);
            all += 1;
        }
        Accuracy { right, accuracy: right as f64 / all.max(1) as f64, interval: wilson(right, all) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sides(left: &[u8], right: &[u8]) -> Judge {
        Judge { left: left.to_vec(), right: right.to_vec() }
    }

    fn count(walks: &[(&Judge, Option<f64>)]) -> Ballot {
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
        // One vote for 0, one for 2; 2 is walked to farther.
        assert_eq!(count(&[(&a, Some(-4.0)), (&b, Some(-6.0))]).by_votes(), (2, true));
        assert_eq!(count(&[(&a, Some(-4.0)), (&b, Some(-4.0))]).by_votes(), (0, true));
        // Nobody votes: all are tied, and sums decide.
        assert_eq!(count(&[(&a, Some(2.0)), (&b, Some(1.0))]).by_votes(), (1, true));
        assert_eq!(count(&[]).by_votes(), (0, true));
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
