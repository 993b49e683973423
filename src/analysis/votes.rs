//! Combines robots for two groups of classes into one classifier, without trained weights.

use crate::base::error::Error;
use crate::base::ranges;
use crate::base::statistics::wilson;
use crate::task::judge::Judge;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest displacement that counts in a sum of walks \[voxel lengths\].
pub const CLIP: f64 = 10.0;

/// The votes and sums of walks under one image, for every class.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ballot {
    /// Votes: each robot has one for every class of the side it walked to.
    pub votes: Vec<usize>,
    /// Sums of walks \[voxel lengths\]: positive towards a class's side, negative away from it.
    pub sums: Vec<f64>,
    /// Number of robots that gave no vote.
    pub silent: usize,
}

impl Ballot {
    /// Counts one walk of each robot; `None` is an unstable one, without effect. A walk of at most
    /// `threshold` gives no vote; one longer than `clip` counts as `clip`.
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

    /// Returns the index of the class with most votes, and true if several tie. Among those the
    /// largest sum of walks wins, then the first.
    pub fn by_votes(&self) -> (usize, bool) {
        let most = self.votes.iter().copied().max().unwrap_or(0);
        let among = || (0..self.votes.len()).filter(|place| self.votes[*place] == most);
        (self.largest(among()), among().count() > 1)
    }

    /// Returns the index of the class with the largest sum of walks; the first wins a tie.
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

/// The walks of a team under one image and their counts, at the end or before.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tally {
    /// Displacement of each robot so far \[voxel lengths\]; `None` if it became unstable.
    pub moved: Vec<Option<f64>>,
    /// Votes and sums of walks, for every class.
    #[serde(flatten)]
    pub ballot: Ballot,
    /// The class with most votes; `None` while there is no vote.
    pub says: Option<u8>,
}

impl Tally {
    /// Counts walks; threshold and clip are those of [`Ballot::count`].
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

/// The accuracy on some images.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Accuracy {
    /// Images answered correctly.
    pub right: usize,
    /// Fraction answered correctly.
    #[serde(deserialize_with = "ranges::share")]
    pub accuracy: f64,
    /// Its 95 % Wilson interval.
    #[serde(deserialize_with = "ranges::interval")]
    pub interval: [f64; 2],
}

impl Accuracy {
    /// Checks that it covers at most this many images.
    ///
    /// # Errors
    /// If more are correct, the error names the key.
    pub(crate) fn check(&self, images: usize) -> Result<(), Error> {
        match self.right <= images {
            true => Ok(()),
            false => Err(Error::at_key("right", format!("expected at most {images}, found {}", self.right))),
        }
    }

    /// Computes the accuracy from pairs of an answer and the correct one.
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
        // One vote each for 0 and 2; the walk towards 2 is longer.
        assert_eq!(count(&[(&a, Some(-4.0)), (&b, Some(-6.0))]).by_votes(), (2, true));
        assert_eq!(count(&[(&a, Some(-4.0)), (&b, Some(-4.0))]).by_votes(), (0, true));
        // Without votes all classes tie, and sums decide.
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
