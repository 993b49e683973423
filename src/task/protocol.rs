//! [`Protocol`]: the presentation of images to a robot.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Farthest start column either way \[voxels\]: world coordinates stay exact to far below a voxel.
pub(crate) const MAX_COLUMN: i64 = 1_000_000;

/// Most control steps of an image or a scenario: twenty thousand actuation cycles of the paper's.
pub const MAX_STEPS: u32 = 1_000_000;

/// Highest row of a start \[voxels\].
pub const MAX_ROW: u32 = 2_000_000;

/// The choice between one rollout per image and one for all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RolloutMode {
    /// One per image (the paper's text).
    Fresh,
    /// One in which the images follow each other (the published zero-one runs).
    Sequential,
}

/// The presentation of images to a robot (paper, "Protocol"); keys of a config's `[protocol]`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Protocol {
    /// Simulations per robot. Default fresh.
    pub rollout: RolloutMode,
    /// Control steps per image; 50 are an actuation cycle. Default 500, the paper's.
    #[schemars(range(min = 1, max = MAX_STEPS))]
    pub control_steps: u32,
    /// Grid row of the body's bottom row at the start; 2 is on the ground. Default 2, EvoGym's.
    #[schemars(range(max = MAX_ROW))]
    pub start_row: u32,
    /// Grid column of the body's left edge; only pegs below the ground distinguish columns. Default
    /// 493, EvoGym's.
    #[schemars(range(min = -MAX_COLUMN, max = MAX_COLUMN))]
    pub start_column: i64,
}

impl Default for Protocol {
    fn default() -> Self {
        Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: 500,
            start_row: 2,
            start_column: 493,
        }
    }
}
