//! [`Judge`]: what a walk says about the image.

use crate::task::direction::{Assignment, Direction};
use crate::task::grouping::{Group, Split};
use serde::Serialize;

/// Displacements up to this many voxel lengths say nothing (paper, section "Generalization test").
pub const THRESHOLD: f64 = 3.0;

/// What robots of a task say by walking one way or the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Judge {
    /// Classes it names by walking left.
    pub left: Vec<u8>,
    /// Classes it names by walking right.
    pub right: Vec<u8>,
}

/// What a walk comes to so far.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// Displacement while the present image was shown, voxel lengths, right positive.
    pub moved: f64,
    /// The way it went; none if not farther than [`THRESHOLD`].
    pub way: Option<&'static str>,
    /// The classes that means; none of a body without a task.
    pub says: Vec<u8>,
}

impl Judge {
    /// Of a task and the way its first group is to walk; none where every class is to walk the same
    /// way.
    pub fn of(split: &Split, assignment: Assignment) -> Option<Self> {
        if split.is_same_way() {
            return None;
        }
        let walkers = |way| {
            let group = if assignment.expected(Group::A) == way { Group::A } else { Group::B };
            split.classes(group).to_vec()
        };
        Some(Judge { left: walkers(Direction::Left), right: walkers(Direction::Right) })
    }
}

/// What a displacement says, to a judge if there is one.
pub fn answer(judge: Option<&Judge>, moved: f64) -> Answer {
    let way = Direction::of(moved, THRESHOLD);
    let says = match (judge, way) {
        (Some(judge), Some(Direction::Left)) => judge.left.clone(),
        (Some(judge), Some(Direction::Right)) => judge.right.clone(),
        _ => Vec::new(),
    };
    let name = |way| if way == Direction::Left { "left" } else { "right" };
    Answer { moved, way: way.map(name), says }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::grouping::Grouping;

    #[test]
    fn a_walk_names_the_group_that_was_trained_to_walk_there() {
        let grouping = Grouping::two_groups(&[0], &[1, 2]).unwrap();
        let judge = Judge::of(&grouping.tasks()[0], Assignment { a: Direction::Right });
        assert_eq!(judge, Some(Judge { left: vec![1, 2], right: vec![0] }));
        let says = |moved| answer(judge.as_ref(), moved);
        assert_eq!((says(12.4).says, says(12.4).way), (vec![0], Some("right")));
        assert_eq!((says(-3.1).says, says(-3.1).way), (vec![1, 2], Some("left")));
        assert_eq!((says(3.0).says, says(-3.0).way), (vec![], None));
        assert_eq!((answer(None, -8.0).says, answer(None, -8.0).way), (vec![], Some("left")));
        let all = Grouping::all_splits(&[0, 1], true).unwrap();
        assert_eq!(Judge::of(&all.tasks()[1], Assignment { a: Direction::Left }), None);
    }
}
