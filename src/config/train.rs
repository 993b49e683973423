//! [`TrainConfig`]: a config's section `[train]`.

use crate::base::error::Error;
use crate::base::number::is_zero;
use crate::task::perturbation::ByTurns;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The training of gaits by `morphcog train`: section `[train]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TrainConfig {
    /// The training images of each class for the model; robots walk under only a few of them.
    /// Default 2000, or three quarters of the scarcest class if that is less: more make designs
    /// general, and cost little.
    pub(crate) images_per_class: usize,
    /// The rollouts with random images that measure a gait's response. Default 300: with fewer than
    /// two for each soft voxel and sensor the slopes are mostly noise.
    pub(crate) random_images: usize,
    /// The windows of the images tried for each gait, that of `stimulus.margin` first; the robot
    /// gets the one that the model finds best for the task. Default 0: only that of
    /// `stimulus.margin`. Values above 0 require the reduction "area". They cost no rollouts.
    #[serde(skip_serializing_if = "is_zero")]
    pub windows: usize,
    /// The rounds in which the response is measured around the latest design, and the design
    /// problem is solved again. Default 6: more seldom help. With 0, the robot keeps its own soft
    /// voxels and sensors, and is only refined; of several robots, the fittest.
    pub(crate) rounds: usize,
    /// The training images per round. Default 120: fewer make slopes noisier and the constant
    /// wrong.
    pub(crate) images: usize,
    /// The training images on which designs and challengers compete: at least one of every class,
    /// the groups alternating. Default 400: with fewer, small gains look like chance.
    pub(crate) final_images: usize,
    /// The bodies that challenge the best design, in sensors or in a few voxels of any material.
    /// Default 30; later ones win more seldom.
    pub challengers: usize,
    /// The conditions that alternate between images, so that designs do not depend on the first
    /// touch of the ground or exploit length limits.
    pub(crate) perturbations: ByTurns,
}

impl Default for TrainConfig {
    fn default() -> Self {
        TrainConfig {
            images_per_class: 2000,
            random_images: 300,
            windows: 0,
            rounds: 6,
            images: 120,
            final_images: 400,
            challengers: 30,
            perturbations: ByTurns::default(),
        }
    }
}

/// The minimum number of random images: with fewer, cross-validation can leave nothing out.
const LEAST_RANDOM_IMAGES: usize = 20;

/// The maximum number of random images of a gait: all are kept in memory, and more reveal no more.
pub(crate) const MOST_RANDOM_IMAGES: usize = 100_000;

/// The maximum number of windows of a gait: about a minute of a core.
const MOST_WINDOWS: usize = 10_000;

const MOST_ROWS: u32 = 100;

impl TrainConfig {
    /// Returns the number of windows tried: none without rounds, since the robot keeps its sensors.
    pub(crate) fn windows_tried(&self) -> usize {
        if self.rounds == 0 { 0 } else { self.windows }
    }

    /// Returns true if files may omit it.
    pub(crate) fn is_default(&self) -> bool {
        *self == TrainConfig::default()
    }

    pub(crate) fn validate(&self) -> Result<(), Error> {
        let least = [
            ("images_per_class", self.images_per_class, 1),
            ("random_images", self.random_images, LEAST_RANDOM_IMAGES),
            ("images", self.images, 2),
            ("final_images", self.final_images, 2),
        ];
        match least.into_iter().find(|(_, value, least)| value < least) {
            Some((key, value, least)) => Err(Error::value(
                &format!("train.{key}"),
                value,
                &format!("{least} or more"),
            )),
            None if self.random_images > MOST_RANDOM_IMAGES => {
                let expected = format!("at most {MOST_RANDOM_IMAGES}");
                Err(Error::value(
                    "train.random_images",
                    self.random_images,
                    &expected,
                ))
            }
            None if self.windows > MOST_WINDOWS => Err(Error::value(
                "train.windows",
                self.windows,
                &format!("at most {MOST_WINDOWS}"),
            )),
            None if self.perturbations.start > MOST_ROWS => {
                let expected = format!("at most {MOST_ROWS} rows");
                Err(Error::value(
                    "train.perturbations.start",
                    self.perturbations.start,
                    &expected,
                ))
            }
            None => Ok(()),
        }
    }
}
