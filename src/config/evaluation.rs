//! [`EvaluationConfig`]: a config's section `[evaluation]`, and the rules of response fitness.

use crate::base::error::Error;
use crate::config::Config;
use crate::response::objective::GaitResponse;
use crate::task::fitness::{Fitness, LEAST_IMAGES};
use crate::task::objective::{Objective, Recognition};
use crate::task::protocol::RolloutMode;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The evaluation of robots: section `[evaluation]`.
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

    /// Returns what evolution maximises.
    pub fn objective(&self) -> &'static dyn Objective {
        match self.measures_response() {
            true => &GaitResponse,
            false => &Recognition,
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
