//! [`Judge`]: turns a walk into an answer about the image.

use crate::task::direction::{Assignment, Direction, THRESHOLD};
use crate::task::grouping::{Group, Split};
use serde::Serialize;

/// The classes that robots of a task name by walking left or right.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Judge {
    /// Classes named by walking left.
    pub left: Vec<u8>,
    /// Classes named by walking right.
    pub right: Vec<u8>,
}

/// The answer of a walk so far.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// Displacement under the current image, voxel lengths, right positive.
    pub moved: f64,
    /// Direction of the walk; none if not farther than [`THRESHOLD`].
    pub way: Option<&'static str>,
    /// Classes that this names; none for a body without a task.
    pub says: Vec<u8>,
}

impl Judge {
    /// Makes the judge of a task, given the direction of its first group; none if every class
    /// should walk the same way.
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

/// Returns the answer of a displacement, which names classes only if there is a judge.
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

/// Returns the answer in words: "says 0", "says 1 or 2", or nothing while it names no class. With
/// `over`, the walk has ended: "says 0: correct" or "says 0: wrong" if the image's `class` is one
/// of the task's, and "undecided" if it names no class. Empty without a judge.
pub fn verdict(judge: Option<&Judge>, moved: f64, class: u8, over: bool) -> String {
    let Some(judge) = judge else { return String::new() };
    let says = answer(Some(judge), moved).says;
    let classes = says.iter().map(u8::to_string).collect::<Vec<_>>().join(" or ");
    let is_known = judge.left.contains(&class) || judge.right.contains(&class);
    match (says.is_empty(), over && is_known) {
        (true, _) if over => "undecided".to_string(),
        (true, _) => String::new(),
        (false, false) => format!("says {classes}"),
        (false, true) => {
            format!("says {classes}: {}", if says.contains(&class) { "correct" } else { "wrong" })
        }
    }
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
        let words = |moved, class, over| verdict(judge.as_ref(), moved, class, over);
        assert_eq!(
            [words(5.0, 0, false), words(5.0, 0, true), words(5.0, 1, true)],
            ["says 0", "says 0: correct", "says 0: wrong"]
        );
        assert_eq!([words(-5.0, 2, true), words(-5.0, 7, true)], ["says 1 or 2: correct", "says 1 or 2"]);
        assert_eq!(
            [words(2.0, 0, false), words(2.0, 0, true), verdict(None, 9.0, 0, true)],
            ["", "undecided", ""]
        );
        let all = Grouping::all_splits(&[0, 1], true).unwrap();
        assert_eq!(Judge::of(&all.tasks()[1], Assignment { a: Direction::Left }), None);
    }
}
