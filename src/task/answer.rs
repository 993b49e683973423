//! The answers of robots: the way one walks ([`Direction`]), the way it should ([`Assignment`]),
//! and the classes that a walk names ([`Readout`]) (paper, section "Generalization test").

use crate::task::class_names::ClassNames;
use crate::task::fitness::Fitness;
use crate::task::fitness::Group;
use crate::task::grouping::ClassSplit;
use serde::Serialize;

/// Displacements up to this many voxel lengths are no answer (paper, "Generalization test").
pub const THRESHOLD: f64 = 3.0;

/// A robot's answer to an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Class of the image.
    pub(crate) class: u8,
    /// Displacement to the right under it, in voxel lengths; `None` if not simulated yet.
    pub(crate) displacement: Option<f64>,
}

pub(super) fn answers_of_split(
    split: &ClassSplit,
    answers: &[Answer],
) -> impl Iterator<Item = (Group, Option<f64>)> + Clone {
    answers
        .iter()
        .filter_map(|answer| Some((split.group(answer.class)?, answer.displacement)))
}

/// A way to walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Towards smaller x.
    Left,
    /// Towards larger x.
    Right,
}

impl Direction {
    /// Returns a displacement's direction; `None` up to `threshold` (paper: 3 voxel lengths).
    pub fn of(displacement: f64, threshold: f64) -> Option<Self> {
        let direction = if displacement > 0.0 {
            Direction::Right
        } else {
            Direction::Left
        };
        (displacement.abs() > threshold).then_some(direction)
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Direction::Left => "left",
            Direction::Right => "right",
        }
    }

    pub(crate) fn named(name: &str) -> Option<Self> {
        [Direction::Left, Direction::Right]
            .into_iter()
            .find(|direction| direction.name() == name)
    }
}

/// The direction in which group A should walk; group B should walk the other way. The training
/// answers fix it before any test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Assignment {
    /// The direction of group A.
    pub(crate) a: Direction,
}

impl Assignment {
    /// Returns the assignment under which a robot's training answers are fitter (A left in a tie).
    pub(crate) fn from_training(split: &ClassSplit, fitness: Fitness, answers: &[Answer]) -> Self {
        let (a_right, a_left) = fitness.of_assignments(answers_of_split(split, answers));
        Assignment {
            a: if a_right > a_left {
                Direction::Right
            } else {
                Direction::Left
            },
        }
    }

    pub(crate) fn expected(self, group: Group) -> Direction {
        match (group, self.a) {
            (Group::A, way) => way,
            (Group::B, Direction::Left) => Direction::Right,
            (Group::B, Direction::Right) => Direction::Left,
        }
    }

    /// Returns a displacement's length in the correct direction; negative in the wrong one.
    pub(crate) fn margin(self, group: Group, displacement: f64) -> f64 {
        match self.expected(group) {
            Direction::Right => displacement,
            Direction::Left => -displacement,
        }
    }

    /// True if a displacement is the correct answer: farther than `threshold`, the group's way.
    pub(crate) fn is_right(self, group: Group, displacement: f64, threshold: f64) -> bool {
        Direction::of(displacement, threshold) == Some(self.expected(group))
    }
}

/// True if a walk is the correct answer to a class: farther than `threshold`, its group's way;
/// `None` if it is in neither group. An unstable walk (`None`) is wrong.
pub(crate) fn is_correct(
    split: &ClassSplit,
    assignment: Assignment,
    class: u8,
    walk: Option<f64>,
    threshold: f64,
) -> Option<bool> {
    let group = split.group(class)?;
    Some(walk.is_some_and(|walk| assignment.is_right(group, walk, threshold)))
}

/// The classes that robots of a task name by walking left or right.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Readout {
    /// Classes named by walking left.
    pub left: Vec<u8>,
    /// Classes named by walking right.
    pub right: Vec<u8>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Reading {
    /// Displacement under the current image, voxel lengths, right positive.
    pub(crate) moved: f64,
    /// Direction of the walk; none if not farther than [`THRESHOLD`].
    pub(crate) way: Option<&'static str>,
    /// Classes that this names; none for a body without a task.
    pub(crate) says: Vec<u8>,
}

impl Readout {
    /// Makes a task's judge, given the first group's direction; none if all should walk one way.
    pub(crate) fn of(split: &ClassSplit, assignment: Assignment) -> Option<Self> {
        if split.is_same_way() {
            return None;
        }
        let walkers = |way| {
            let group = if assignment.expected(Group::A) == way {
                Group::A
            } else {
                Group::B
            };
            split.classes(group).to_vec()
        };
        Some(Readout {
            left: walkers(Direction::Left),
            right: walkers(Direction::Right),
        })
    }
}

/// Returns the answer of a displacement, which names classes only if there is a judge.
pub(crate) fn answer(readout: Option<&Readout>, moved: f64) -> Reading {
    let way = Direction::of(moved, THRESHOLD);
    let says = match (readout, way) {
        (Some(readout), Some(Direction::Left)) => readout.left.clone(),
        (Some(readout), Some(Direction::Right)) => readout.right.clone(),
        _ => Vec::new(),
    };
    let name = |way| {
        if way == Direction::Left {
            "left"
        } else {
            "right"
        }
    };
    Reading {
        moved,
        way: way.map(name),
        says,
    }
}

/// Returns the answer in words: "says 0", "says 1 or 2", or nothing while it names no class. With
/// `over`, the walk has ended: "says 0: correct" or "says 0: wrong" if the image's `class` is one
/// of the task's, and "undecided" if it names no class. Empty without a judge.
pub(crate) fn verdict(
    readout: Option<&Readout>,
    names: &ClassNames,
    moved: f64,
    class: u8,
    over: bool,
) -> String {
    let Some(readout) = readout else {
        return String::new();
    };
    let says = answer(Some(readout), moved).says;
    let classes = says
        .iter()
        .map(|class| names.name(*class))
        .collect::<Vec<_>>()
        .join(" or ");
    let is_known = readout.left.contains(&class) || readout.right.contains(&class);
    match (says.is_empty(), over && is_known) {
        (true, _) if over => "undecided".to_string(),
        (true, _) => String::new(),
        (false, false) => format!("says {classes}"),
        (false, true) => {
            format!(
                "says {classes}: {}",
                if says.contains(&class) {
                    "correct"
                } else {
                    "wrong"
                }
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::fitness::Fitness;
    use crate::task::grouping::Grouping;
    use Direction::{Left, Right};
    use Group::{A, B};

    #[test]
    fn directions_are_fixed_by_training_and_short_walks_are_wrong() {
        let grouping = Grouping::two_groups(&[0], &[1]).unwrap();
        let split = &grouping.tasks()[0];
        let fixed = |displacements: [f64; 2]| {
            let of = |class| Answer {
                class,
                displacement: Some(displacements[usize::from(class)]),
            };
            Assignment::from_training(split, Fitness::Min, &[of(0), of(1)])
        };
        assert_eq!((fixed([-5.0, 8.0]).a, fixed([5.0, -8.0]).a), (Left, Right));
        // Both walk right: the shorter walk is the wrong one. No difference: left.
        assert_eq!(
            (
                fixed([8.0, 5.0]).a,
                fixed([5.0, 8.0]).a,
                fixed([5.0, 5.0]).a
            ),
            (Right, Left, Left)
        );
        let a_right = Assignment { a: Right };
        assert!(a_right.is_right(A, 3.1, 3.0) && a_right.is_right(B, -3.1, 3.0));
        assert!(!a_right.is_right(A, 3.0, 3.0) && !a_right.is_right(A, -9.0, 3.0));
        assert_eq!((a_right.expected(A), a_right.expected(B)), (Right, Left));
    }

    #[test]
    fn a_walk_names_the_group_that_was_trained_to_walk_there() {
        let grouping = Grouping::two_groups(&[0], &[1, 2]).unwrap();
        let readout = Readout::of(
            &grouping.tasks()[0],
            Assignment {
                a: Direction::Right,
            },
        );
        assert_eq!(
            readout,
            Some(Readout {
                left: vec![1, 2],
                right: vec![0]
            })
        );
        let says = |moved| answer(readout.as_ref(), moved);
        assert_eq!((says(12.4).says, says(12.4).way), (vec![0], Some("right")));
        assert_eq!(
            (says(-3.1).says, says(-3.1).way),
            (vec![1, 2], Some("left"))
        );
        assert_eq!((says(3.0).says, says(-3.0).way), (vec![], None));
        assert_eq!(
            (answer(None, -8.0).says, answer(None, -8.0).way),
            (vec![], Some("left"))
        );
        let none = ClassNames::default();
        let words = |moved, class, over| verdict(readout.as_ref(), &none, moved, class, over);
        assert_eq!(
            [
                words(5.0, 0, false),
                words(5.0, 0, true),
                words(5.0, 1, true)
            ],
            ["says 0", "says 0: correct", "says 0: wrong"]
        );
        assert_eq!(
            [words(-5.0, 2, true), words(-5.0, 7, true)],
            ["says 1 or 2: correct", "says 1 or 2"]
        );
        assert_eq!(
            [
                words(2.0, 0, false),
                words(2.0, 0, true),
                verdict(None, &none, 9.0, 0, true)
            ],
            ["", "undecided", ""]
        );
        let names = ClassNames::of(&["circle", "square"].map(String::from));
        assert_eq!(
            verdict(readout.as_ref(), &names, -5.0, 2, true),
            "says square or 2: correct"
        );
        let all = Grouping::all_splits(&[0, 1], true).unwrap();
        assert_eq!(
            Readout::of(&all.tasks()[1], Assignment { a: Direction::Left }),
            None
        );
    }
}
