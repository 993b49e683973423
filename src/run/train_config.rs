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
    /// Training images that the first design is shown. Default 100.
    pub images: usize,
    /// Most training images that designs are shown; those that are added are hard ones. Default 400: more tell better designs
    /// from good ones, and cost as many rollouts a proposal.
    pub most_images: usize,
    /// Rollouts under training images of the gait that is taught. Default 4000.
    pub rollouts: usize,
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
            images: 100,
            most_images: 400,
            rollouts: 4000,
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
            ("images", self.images, 2),
            ("most_images", self.most_images, self.images),
            ("rollouts", self.rollouts, self.images),
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
