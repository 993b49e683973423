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
    /// Training images per class for the model, at most three quarters of the scarcest class's.
    /// Default 2000.
    ///
    /// Few of them are simulated. More make designs general, and cost little. Two thirds of the
    /// scarcest class's where validation would run short.
    #[schemars(range(min = 1))]
    pub(crate) images_per_class: usize,
    /// Random images that measure a gait's response, two or more per soft voxel and sensor. Default
    /// 300.
    ///
    /// With fewer, slopes are mostly noise.
    #[schemars(range(min = LEAST_RANDOM_IMAGES, max = MOST_RANDOM_IMAGES))]
    pub(crate) random_images: usize,
    /// Windows that the model compares for each gait; the best becomes `stimulus.margin`. They cost
    /// no rollouts, and require the reduction `area`. Default 0, only that of `stimulus.margin`.
    ///
    /// That of `stimulus.margin` is the first. With `rounds = 0` none are tried.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(max = MOST_WINDOWS))]
    pub windows: usize,
    /// Rounds of measuring around the latest design and solving again. Default 6, more seldom help.
    ///
    /// With 0, the fittest robot keeps its own soft voxels and sensors, and is only refined.
    pub(crate) rounds: usize,
    /// Training images per round. Default 120, fewer make slopes noisier.
    #[schemars(range(min = 2))]
    pub(crate) images: usize,
    /// Training images on which designs and challengers compete. Default 400, with fewer, small
    /// gains look like chance.
    ///
    /// At least one of every class, the groups alternating, and others after every thirty
    /// challengers.
    #[schemars(range(min = 2))]
    pub(crate) final_images: usize,
    /// Bodies that challenge the best design. Default 30, later ones win less often.
    ///
    /// They differ in sensors or in a few voxels of any material.
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
