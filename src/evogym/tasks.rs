//! [`TASKS`]: what each task observes, rewards and ends with.

use crate::base::error::Error;
use std::f64::consts::PI;

/// A part of an observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// Mean velocity of the points, x and y \[wu/s\].
    Velocity,
    /// Orientation against the start \[radians\].
    Orientation,
    /// All points from their centre, first every x, then every y \[wu\].
    Shape,
    /// Goals reached so far, the current goal, and the way to it \[wu\].
    Goal,
    /// Free height below the centre, this many voxels to either side \[wu\].
    Floor(u32),
    /// Free height above the centre, this many voxels to either side \[wu\].
    Ceiling(u32),
}

/// Reward of a step; c is the centre \[wu\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reward {
    /// Growth of the weighted sum of c's coordinates.
    Way([f64; 2]),
    /// Approach to the current goal.
    Goals,
    /// Ten times the way upwards, less five times the way to either side.
    Jump,
    /// Turning, counter-clockwise \[radians\].
    Turn,
    /// Approach to a place, |Δx| + |Δy|.
    Place([f64; 2]),
    /// Growth of the area of the convex hull, times this.
    Area(f64),
    /// Growth of the extent along an axis.
    Extent(usize),
}

/// A reason to end, tested after every step. Several can hold at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    /// The centre is beyond a limit along an axis: axis, limit, reward.
    Above(usize, f64, f64),
    /// The centre is below a limit along an axis: axis, limit, reward.
    Below(usize, f64, f64),
    /// The orientation lies between two angles: those, and the reward.
    Tilted([f64; 2], f64),
    /// All goals are reached.
    Goals(f64),
}

/// One of EvoGym's tasks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// Its name, as EvoGym's.
    pub name: &'static str,
    /// Control steps after which an episode is cut off.
    pub max_episode_steps: u32,
    /// Column and row of the lower left cell of the robot's box.
    pub start: (i64, u32),
    pub(crate) world: &'static str,
    pub(crate) observation: &'static [Part],
    pub(crate) reward: Reward,
    pub(crate) ends: &'static [End],
}

impl Task {
    /// Returns true if it is about reaching goals, which every reset chooses.
    pub fn has_goals(&self) -> bool {
        self.reward == Reward::Goals
    }
}

/// The reward of a step that becomes unstable, besides the others.
pub(crate) const UNSTABLE: f64 = -3.0;
/// The distance from a goal at which it is reached \[wu\].
pub(crate) const REACHED: f64 = cells(2.0);
/// The range of sight \[voxel lengths\].
pub const RANGE: f64 = 5.0;
/// Bounds of observations in the space that is declared; they are not clipped.
pub const BOUND: f64 = 100.0;

const X: usize = 0;
const Y: usize = 1;

const fn cells(count: f64) -> f64 {
    count * 0.1
}

const LEANS: [Part; 4] = [
    Part::Velocity,
    Part::Orientation,
    Part::Shape,
    Part::Floor(5),
];
const MOVES: [Part; 2] = [Part::Velocity, Part::Shape];
const TURNS: [Part; 2] = [Part::Orientation, Part::Shape];
const LIES: End = End::Tilted([PI / 2.0, PI * 3.0 / 2.0], -3.0);
const ALONG: Reward = Reward::Way([1.0, 0.0]);

/// All tasks that are simulated.
pub const TASKS: &[Task] = &[
    Task {
        name: "Walker-v0",
        max_episode_steps: 500,
        start: (1, 1),
        world: "Walker-v0",
        observation: &MOVES,
        reward: ALONG,
        ends: &[End::Above(X, cells(99.0), 1.0)],
    },
    Task {
        name: "BidirectionalWalker-v0",
        max_episode_steps: 1000,
        start: (33, 1),
        world: "BidirectionalWalker-v0",
        observation: &[Part::Velocity, Part::Shape, Part::Goal],
        reward: Reward::Goals,
        ends: &[End::Goals(1.0)],
    },
    Task {
        name: "Jumper-v0",
        max_episode_steps: 500,
        start: (32, 1),
        world: "Jumper-v0",
        observation: &[Part::Velocity, Part::Shape, Part::Floor(2)],
        reward: Reward::Jump,
        ends: &[],
    },
    Task {
        name: "Flipper-v0",
        max_episode_steps: 600,
        start: (60, 1),
        world: "Flipper-v0",
        observation: &TURNS,
        reward: Reward::Turn,
        ends: &[End::Below(X, cells(1.0), 0.0)],
    },
    Task {
        name: "Balancer-v0",
        max_episode_steps: 600,
        start: (15, 3),
        world: "Balancer-v0",
        observation: &TURNS,
        reward: Reward::Place([cells(17.0), cells(5.0)]),
        ends: &[],
    },
    Task {
        name: "Balancer-v1",
        max_episode_steps: 600,
        start: (10, 1),
        world: "Balancer-v1",
        observation: &TURNS,
        reward: Reward::Place([cells(17.5), cells(6.0)]),
        ends: &[],
    },
    Task {
        name: "UpStepper-v0",
        max_episode_steps: 600,
        start: (1, 1),
        world: "UpStepper-v0",
        observation: &LEANS,
        reward: ALONG,
        ends: &[
            End::Above(X, cells(69.0), 2.0),
            End::Tilted([PI / 2.0 - PI / 12.0, PI * 3.0 / 2.0 + PI / 12.0], -3.0),
        ],
    },
    Task {
        name: "DownStepper-v0",
        max_episode_steps: 500,
        start: (1, 11),
        world: "DownStepper-v0",
        observation: &LEANS,
        reward: ALONG,
        ends: &[End::Above(X, cells(74.0), 2.0), LIES],
    },
    Task {
        name: "ObstacleTraverser-v0",
        max_episode_steps: 1000,
        start: (2, 1),
        world: "ObstacleTraverser-v0",
        observation: &LEANS,
        reward: ALONG,
        ends: &[End::Above(X, cells(79.0), 2.0), LIES],
    },
    Task {
        name: "ObstacleTraverser-v1",
        max_episode_steps: 1000,
        start: (2, 4),
        world: "ObstacleTraverser-v1",
        observation: &LEANS,
        reward: ALONG,
        ends: &[End::Above(X, cells(59.0), 2.0)],
    },
    Task {
        name: "Hurdler-v0",
        max_episode_steps: 1000,
        start: (2, 4),
        world: "Hurdler-v0",
        observation: &LEANS,
        reward: ALONG,
        ends: &[LIES],
    },
    Task {
        name: "GapJumper-v0",
        max_episode_steps: 1000,
        start: (1, 6),
        world: "GapJumper-v0",
        observation: &LEANS,
        reward: ALONG,
        ends: &[End::Below(Y, cells(4.0), -3.0)],
    },
    Task {
        name: "PlatformJumper-v0",
        max_episode_steps: 1000,
        start: (1, 6),
        world: "PlatformJumper-v0",
        observation: &LEANS,
        reward: ALONG,
        ends: &[End::Below(Y, cells(4.0), -3.0), LIES],
    },
    Task {
        name: "Climber-v0",
        max_episode_steps: 400,
        start: (1, 1),
        world: "Climber-v0",
        observation: &MOVES,
        reward: Reward::Way([0.0, 1.0]),
        ends: &[End::Above(Y, cells(86.0), 1.0)],
    },
    Task {
        name: "Climber-v2",
        max_episode_steps: 1000,
        start: (1, 1),
        world: "Climber-v2",
        observation: &[
            Part::Velocity,
            Part::Orientation,
            Part::Shape,
            Part::Ceiling(3),
        ],
        reward: Reward::Way([0.2, 1.0]),
        ends: &[],
    },
    Task {
        reward: Reward::Area(10.0),
        ..shape("AreaMaximizer-v0")
    },
    Task {
        reward: Reward::Area(-10.0),
        ..shape("AreaMinimizer-v0")
    },
    Task {
        reward: Reward::Extent(X),
        ..shape("WingspanMazimizer-v0")
    },
    Task {
        reward: Reward::Extent(Y),
        max_episode_steps: 500,
        ..shape("HeightMaximizer-v0")
    },
];

/// A task that is about the shape alone.
const fn shape(name: &'static str) -> Task {
    Task {
        name,
        max_episode_steps: 600,
        start: (7, 1),
        world: "ShapeChange",
        observation: &[Part::Shape],
        reward: Reward::Area(1.0),
        ends: &[],
    }
}

const MOVING: &str = "has an object that moves";
const SOFT: &str = "has ground that yields";

/// EvoGym's other tasks, and what they have that is not simulated.
pub const REFUSED: [(&str, &str); 13] = [
    ("BeamSlider-v0", MOVING),
    ("BeamToppler-v0", MOVING),
    ("BridgeWalker-v0", SOFT),
    ("Carrier-v0", MOVING),
    ("Carrier-v1", MOVING),
    ("Catcher-v0", MOVING),
    ("CaveCrawler-v0", SOFT),
    ("Climber-v1", SOFT),
    ("Lifter-v0", MOVING),
    ("Pusher-v0", MOVING),
    ("Pusher-v1", MOVING),
    ("Thrower-v0", MOVING),
    ("Traverser-v0", MOVING),
];

/// Returns a task by its name.
///
/// # Errors
/// Returns an error that says why EvoGym's task is not simulated, or which tasks there are.
pub fn find(name: &str) -> Result<&'static Task, Error> {
    if let Some(task) = TASKS.iter().find(|task| task.name == name) {
        return Ok(task);
    }
    if let Some((_, what)) = REFUSED.iter().find(|(refused, _)| *refused == name) {
        let text = format!("{name}: this task {what}, which morphcog does not simulate");
        return Err(Error::usage(text));
    }
    let names: Vec<_> = TASKS.iter().map(|task| task.name).collect();
    Err(Error::usage(format!(
        "{name}: expected one of EvoGym's tasks {}",
        names.join(", ")
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_32_tasks_of_evogym_are_simulated_or_refused_with_a_reason() {
        assert_eq!((TASKS.len(), REFUSED.len()), (19, 13));
        assert_eq!(find("Walker-v0").unwrap().max_episode_steps, 500);
        let refused = find("Pusher-v0").unwrap_err().message;
        assert_eq!(
            refused,
            "Pusher-v0: this task has an object that moves, which morphcog does not simulate"
        );
        assert!(
            find("Walker")
                .unwrap_err()
                .message
                .contains("HeightMaximizer-v0")
        );
    }
}
