//! [`Recording`]: a rollout stored frame by frame, for pictures.

use crate::base::Grid;
use crate::body::Body;
use crate::task::answer::Readout;
use crate::task::class_names::ClassNames;

/// An image and its stimulus.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledStimulus {
    /// Its class.
    pub class: u8,
    /// Label for people, such as "0 (train 1)".
    pub label: String,
    /// Stimulus of the sensors: H × W in [0, 1].
    pub stimulus: Grid<f64>,
}

/// One part of a recording, under one stimulus.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    /// Index in [`Recording::frames`] of the frame before the phase's first control step.
    pub(crate) first_frame: usize,
    pub(crate) seen: LabelledStimulus,
    /// X displacement of the centre of mass over the phase, voxel lengths, right positive.
    pub displacement: f64,
}

/// One moment of the robot in voxel lengths: x from its starting box's left edge, y up from the
/// ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Position [x, y] of every point.
    pub points: Vec<[f64; 2]>,
    /// Centre of mass [x, y].
    pub centre: [f64; 2],
}

/// One voxel of the robot and the points at its corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoxelCorners {
    /// Row in the body, 0 on top.
    pub row: usize,
    /// Column in the body.
    pub column: usize,
    /// Indices into [`Frame::points`]: top left, top right, bottom right, bottom left (clockwise).
    pub corners: [usize; 4],
}

/// A rollout, one frame per control step (the first before the first step). With a reset between
/// images ("fresh" protocol) the robot jumps back at the first frame of a phase.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The robot's id or name.
    pub(crate) robot: String,
    pub(crate) body: Body,
    /// Its voxels with their corners, row-major; fixed for the rollout.
    pub voxels: Vec<VoxelCorners>,
    /// The phases in order, at least one; the first starts at frame 0.
    pub phases: Vec<Phase>,
    /// All frames.
    pub frames: Vec<Frame>,
    /// Control steps from one frame to the next: 1, except for a single moment.
    pub(crate) every: usize,
    /// Control steps per actuation cycle (50).
    pub(crate) cycle: usize,
    /// True if the rollout ended early as unstable.
    pub unstable: bool,
    /// Meaning of the robot's walks; none for a robot without a task.
    pub(crate) judge: Option<Readout>,
    /// Names of the classes.
    pub(crate) names: ClassNames,
}
