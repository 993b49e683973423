//! [`EvaluationConfig`]: a config's section `[evaluation]`, and the rules of response fitness.

use crate::base::error::Error;
use crate::body::{Body, key};
use crate::config::Config;
use crate::task::fitness::{Fitness, LEAST_IMAGES};
use crate::task::protocol::RolloutMode;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How robots are evaluated: section `[evaluation]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EvaluationConfig {
    /// The fitness of answers to several images. Default the smallest margin, the paper's.
    pub fitness: Fitness,
}

impl EvaluationConfig {
    pub(crate) fn is_default(&self) -> bool {
        *self == EvaluationConfig::default()
    }
}

impl Config {
    /// Returns true if fitness is the response of the bodies' probes to random images.
    pub fn measures_response(&self) -> bool {
        self.evaluation.fitness == Fitness::Response
    }

    /// Returns the key of an evaluated body: its own, or that of its probe if fitness is a
    /// response. Then a gait is evaluated once, whatever its sensors.
    pub(crate) fn known_key(&self, body: &Body) -> [u8; 16] {
        match self.measures_response() {
            true => key(&body.probe()),
            false => key(body),
        }
    }

    /// Returns the factor of a body's fitness: 1, or for a response the square root of the number
    /// of its soft voxels and sensors, up to two thirds of its grid. Of two gaits with equally
    /// strong responses, the one with more places can be trained further: together they can move it
    /// by at most this factor (Cauchy's inequality), and only if all respond alike. The limit is
    /// there because something has to walk.
    pub(crate) fn place_factor(&self, body: &Body) -> f64 {
        match self.measures_response() {
            true => {
                let most = body.height() * body.width() * 2 / 3;
                (body.probe().counts().sensor.clamp(1, most.max(1)) as f64).sqrt()
            }
            false => 1.0,
        }
    }

    /// Checks the rules of `fitness = "response"`, if it is set.
    pub(crate) fn validate_response(&self) -> Result<(), Error> {
        if self.evaluation.fitness != Fitness::Response {
            return Ok(());
        }
        let (tasks, classes) = (self.grouping()?.tasks().len(), self.classes().len());
        let per_class = self.data.images_per_class;
        let (images_key, found, images) = match &self.data.train_images {
            Some(named) => ("data.train_images", format!("{} images", named.len()), named.len()),
            None => ("data.images_per_class", per_class.to_string(), per_class.saturating_mul(classes)),
        };
        let enough = format!("an even number of training images in all, {LEAST_IMAGES} or more");
        let checks = [
            (
                tasks > 1,
                "task.splits",
                format!("{tasks} tasks"),
                "one task, as groups = [[0], [1]]: a response belongs to no task",
            ),
            (
                self.protocol.rollout == RolloutMode::Sequential,
                "protocol.rollout",
                "\"sequential\"".to_string(),
                "\"fresh\"",
            ),
            (
                self.validation.best > 0,
                "validation.best",
                self.validation.best.to_string(),
                "0: gaits tell no images apart yet",
            ),
            (images < LEAST_IMAGES || images % 2 == 1, images_key, found, enough.as_str()),
        ];
        match checks.into_iter().find(|(is_wrong, ..)| *is_wrong) {
            Some((_, key, found, expected)) => {
                let text =
                    format!("{key} = {found}: with evaluation.fitness = \"response\" expected {expected}");
                Err(Error::input(text).with_key(key))
            }
            None => Ok(()),
        }
    }
}
