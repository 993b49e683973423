//! [`TrainConfig`]: a config's section `[train]`.

use super::Error;
use super::curriculum::StageConfig;
use crate::task::fitness::Fitness;
use serde::{Deserialize, Serialize};

/// How gaits are taught by `morphcog train`: section `[train]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainConfig {
    /// Training images of each class that the model sees; only a few of them are shown to robots. Default 2000, or three
    /// quarters of the images of the scarcest class if that is less: more make designs general, and cost little.
    pub images_per_class: usize,
    /// Rollouts under random images that measure a gait's response. Default 300: with fewer than two for each soft voxel and
    /// sensor the slopes are mostly noise.
    pub random_images: usize,
    /// Rounds in which the response is measured around the latest design, and the lesson is solved again. Default 6: more seldom
    /// help.
    pub rounds: usize,
    /// Training images that a round shows. Default 120: with fewer, slopes are noisier, and the constant is off.
    pub images: usize,
    /// Training images under which the last four designs are compared. Default 200.
    pub final_images: usize,
    /// Rows up to which starts are raised, by turns, so that designs do not depend on the first touch of the ground. Default 2.
    pub raised_starts: u32,
    /// Whether half of the images are shown to robots without length limits, so that designs do not exploit those. Default true.
    pub without_limits: bool,
}

impl Default for TrainConfig {
    fn default() -> Self {
        TrainConfig {
            images_per_class: 2000,
            random_images: 300,
            rounds: 6,
            images: 120,
            final_images: 200,
            raised_starts: 2,
            without_limits: true,
        }
    }
}

/// Least number of random images: with fewer, nothing can be left out for the cross-validation.
const LEAST_RANDOM_IMAGES: usize = 20;

impl TrainConfig {
    /// Whether a file needs not say it.
    pub(super) fn is_default(&self) -> bool {
        *self == TrainConfig::default()
    }

    /// Checks what a type cannot.
    pub(super) fn validate(&self) -> Result<(), Error> {
        let least = [
            ("images_per_class", self.images_per_class, 1),
            ("random_images", self.random_images, LEAST_RANDOM_IMAGES),
            ("rounds", self.rounds, 1),
            ("images", self.images, 2),
            ("final_images", self.final_images, 2),
        ];
        match least.into_iter().find(|(_, value, least)| value < least) {
            Some((key, value, least)) => {
                Err(Error::input(format!("train.{key} = {value}: expected {least} or more")))
            }
            None => Ok(()),
        }
    }

    /// What a run that is so trained is trained on, as a stage: with so many images of each class.
    pub(super) fn stage(&self, images_per_class: usize) -> StageConfig {
        StageConfig {
            images_per_class: Some(images_per_class),
            fitness: Some(Fitness::MeanClipped),
            raised_starts: Some(self.raised_starts),
            without_limits: Some(self.without_limits),
            ..StageConfig::default()
        }
    }
}
