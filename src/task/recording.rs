//! [`Recording`]: a rollout stored frame by frame, for pictures.

use crate::base::Grid;
use crate::body::Body;
use crate::sim::Terrain;
use crate::task::answer::Readout;
use crate::task::class_names::ClassNames;
use crate::task::margins::Margins;
use crate::task::stimulus::StimulusParams;
use serde::{Serialize, Serializer};
use std::sync::Arc;

/// An image of which a body covers a part: pictures frame that part in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FramedImage {
    /// The whole image, 0 paper … 255 ink.
    pub(crate) pixels: Grid<u8>,
    /// The rows and columns that the body does not cover: top, right, bottom, left.
    #[serde(serialize_with = "serialize_sides")]
    pub(crate) margin: Margins,
}

impl FramedImage {
    /// Returns the image for bodies with these parameters; `None` if they cover all of it, where
    /// the stimulus is a picture of the image already.
    pub(crate) fn of(pixels: &Grid<u8>, params: &StimulusParams) -> Option<Self> {
        let margin = params.margin;
        (!margin.is_none()).then(|| FramedImage {
            pixels: pixels.clone(),
            margin,
        })
    }

    /// Returns the covered rows and columns: the first of each, and the first behind them.
    pub(crate) fn window(&self) -> [[usize; 2]; 2] {
        let Margins {
            top,
            right,
            bottom,
            left,
        } = self.margin;
        [
            [top, self.pixels.height().saturating_sub(bottom)],
            [left, self.pixels.width().saturating_sub(right)],
        ]
    }
}

/// Writes margins always as top, right, bottom, left.
fn serialize_sides<S: Serializer>(margin: &Margins, serializer: S) -> Result<S::Ok, S::Error> {
    [margin.top, margin.right, margin.bottom, margin.left].serialize(serializer)
}

/// An image and its stimulus.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledStimulus {
    /// Its class.
    pub class: u8,
    /// Label for people, such as "0 (train 1)".
    pub label: String,
    /// Stimulus of the sensors: H × W in [0, 1].
    pub stimulus: Grid<f64>,
    /// The image that it is a part of, if the sensors do not cover all of it.
    pub image: Option<FramedImage>,
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
/// ground; on terrain from the left edge of column 0 and the lower edge of row 0.
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
    /// Its terrain; `None` is flat ground.
    pub(crate) terrain: Option<Arc<Terrain>>,
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
