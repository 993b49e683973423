//! The networks to compare with robots, and their training.

use crate::base::error::Error;
use crate::baseline::{Hyperparameters, NetworkKind, Pooling};
use crate::config::{pair, reading};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

const MOST: usize = 1000;

const MOST_TRAININGS: usize = 100_000;

/// The networks of a capacity analysis and their training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CapacityConfig {
    /// The kinds of network.
    pub(crate) networks: Vec<NetworkKind>,
    /// The smallest and the largest size.
    #[serde(deserialize_with = "pair::read")]
    pub(crate) sizes: [usize; 2],
    /// The step from one size to the next.
    pub(crate) step: usize,
    /// The number of trainings from scratch per size.
    pub(crate) trainings: usize,
    /// True if training waits for an improvement on images of the training split, not on the test
    /// images as in the paper.
    pub(crate) clean: bool,
    /// The number of such images, evenly divided between the classes.
    pub(crate) waiting_images: usize,
    /// The seed of the trainings.
    pub(crate) seed: u64,
    /// The training of networks with a hidden layer.
    pub(crate) mlp: Hyperparameters,
    /// The training of convolutional networks.
    pub(crate) cnn: Hyperparameters,
}

impl Default for CapacityConfig {
    fn default() -> Self {
        CapacityConfig {
            networks: NetworkKind::ALL.to_vec(),
            sizes: [1, 45],
            step: 1,
            trainings: 50,
            clean: false,
            waiting_images: 400,
            seed: 1,
            mlp: Hyperparameters::default(),
            cnn: Hyperparameters {
                pooling: Pooling::Max2,
                ..Hyperparameters::default()
            },
        }
    }
}

impl CapacityConfig {
    /// Reads settings from a file, and applies `overrides`.
    ///
    /// # Errors
    /// Returns an error if they are invalid.
    pub fn load(path: Option<&Path>, overrides: &[String]) -> Result<Self, Error> {
        reading::load(path, overrides, CapacityConfig::validate)
    }

    /// Checks what types cannot.
    pub(crate) fn validate(&self) -> Result<(), Error> {
        let refuse =
            |key: &str, text: &str| Err(Error::input(format!("capacity: {text}")).with_key(key));
        let [from, to] = self.sizes;
        if from == 0 || to < from || to > MOST {
            return refuse(
                "sizes",
                &format!(
                    "sizes = [{from}, {to}]: expected two sizes from 1 to {MOST}, the smaller first"
                ),
            );
        }
        if !(1..=MOST_TRAININGS).contains(&self.trainings) {
            return refuse(
                "trainings",
                &format!(
                    "trainings = {}: expected 1 to {MOST_TRAININGS}",
                    self.trainings
                ),
            );
        }
        for (key, count) in [
            ("step", self.step),
            ("networks", self.networks.len()),
            ("waiting_images", self.waiting_images),
        ] {
            if count == 0 {
                return refuse(key, &format!("{key}: expected one or more"));
            }
        }
        for (name, hyper) in [("mlp", &self.mlp), ("cnn", &self.cnn)] {
            let rate = hyper.learning_rate;
            if !(rate > 0.0 && rate <= 10.0) {
                return refuse(
                    &format!("{name}.learning_rate"),
                    &format!("{name}.learning_rate = {rate}: expected more than 0, up to 10"),
                );
            }
            if hyper.epochs == 0 || hyper.patience == 0 || hyper.kernel == 0 {
                return refuse(
                    name,
                    &format!("{name}: epochs, patience, kernel: expected 1 or more"),
                );
            }
        }
        Ok(())
    }

    pub(crate) fn of(&self, kind: NetworkKind) -> &Hyperparameters {
        match kind {
            NetworkKind::Mlp => &self.mlp,
            NetworkKind::Cnn => &self.cnn,
        }
    }

    pub(crate) fn sizes(&self) -> impl Iterator<Item = usize> {
        (self.sizes[0]..=self.sizes[1]).step_by(self.step)
    }
}
