//! [`Direction`] and [`Assignment`]: the way a robot walks, and the way it should (paper, section
//! "Generalization test").

use crate::task::fitness::Fitness;
use crate::task::grouping::{Group, Split};
use crate::task::score::{Answer, of_split};

/// Displacements up to this many voxel lengths are no answer (paper, "Generalization test").
pub const THRESHOLD: f64 = 3.0;

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
        let direction = if displacement > 0.0 { Direction::Right } else { Direction::Left };
        (displacement.abs() > threshold).then_some(direction)
    }

    /// Returns its name in files: "left" or "right".
    pub fn name(self) -> &'static str {
        match self {
            Direction::Left => "left",
            Direction::Right => "right",
        }
    }

    /// Returns the direction with a name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        [Direction::Left, Direction::Right].into_iter().find(|direction| direction.name() == name)
    }
}

/// The direction in which group A should walk; group B should walk the other way. The training
/// answers fix it before any test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// The direction of group A.
    pub a: Direction,
}

impl Assignment {
    /// Returns the assignment under which a robot's training answers are fitter (A left in a tie).
    pub fn from_training(split: &Split, fitness: Fitness, answers: &[Answer]) -> Self {
        let (a_right, a_left) = fitness.of_assignments(of_split(split, answers));
        Assignment { a: if a_right > a_left { Direction::Right } else { Direction::Left } }
    }

    /// Returns the direction in which a group should walk.
    pub fn expected(self, group: Group) -> Direction {
        match (group, self.a) {
            (Group::A, way) => way,
            (Group::B, Direction::Left) => Direction::Right,
            (Group::B, Direction::Right) => Direction::Left,
        }
    }

    /// Returns a displacement's length in the correct direction; negative in the wrong one.
    pub fn margin(self, group: Group, displacement: f64) -> f64 {
        match self.expected(group) {
            Direction::Right => displacement,
            Direction::Left => -displacement,
        }
    }

    /// Returns true if a displacement is the correct answer to an image of a group: farther than
    /// `threshold`, the correct way.
    pub fn is_right(self, group: Group, displacement: f64, threshold: f64) -> bool {
        Direction::of(displacement, threshold) == Some(self.expected(group))
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
            let of = |class| Answer { class, displacement: Some(displacements[usize::from(class)]) };
            Assignment::from_training(split, Fitness::Min, &[of(0), of(1)])
        };
        assert_eq!((fixed([-5.0, 8.0]).a, fixed([5.0, -8.0]).a), (Left, Right));
        // Both walk right: the shorter walk is the wrong one. No difference: left.
        assert_eq!((fixed([8.0, 5.0]).a, fixed([5.0, 8.0]).a, fixed([5.0, 5.0]).a), (Right, Left, Left));
        let a_right = Assignment { a: Right };
        assert!(a_right.is_right(A, 3.1, 3.0) && a_right.is_right(B, -3.1, 3.0));
        assert!(!a_right.is_right(A, 3.0, 3.0) && !a_right.is_right(A, -9.0, 3.0));
        assert_eq!((a_right.expected(A), a_right.expected(B)), (Right, Left));
    }
}
