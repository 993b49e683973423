//! What networks robots are compared with, and how those are trained.

use crate::base::error::Error;
use crate::baseline::{Hyperparameters, Kind, Pooling};
use crate::config::{pair, reading};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Largest size of a network that can be asked for.
const MOST: usize = 1000;

/// Most trainings of a size that can be asked for.
const MOST_TRAININGS: usize = 100_000;

/// What is trained, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CapacityConfig {
    /// Kinds of network.
    pub networks: Vec<Kind>,
    /// Smallest and largest size.
    #[serde(deserialize_with = "pair::read")]
    pub sizes: [usize; 2],
    /// From one size to the next.
    pub step: usize,
    /// Trainings from scratch per size.
    pub trainings: usize,
    /// Whether training waits for an improvement on images of the training split, not, as in the
    /// paper, on the test images.
    pub clean: bool,
    /// So many such images, evenly divided between the classes.
    pub waiting_images: usize,
    /// Seed of the trainings.
    pub seed: u64,
    /// How networks with a hidden layer are trained.
    pub mlp: Hyperparameters,
    /// How convolutional networks are trained.
    pub cnn: Hyperparameters,
}

impl Default for CapacityConfig {
    fn default() -> Self {
        CapacityConfig {
            networks: Kind::ALL.to_vec(),
            sizes: [1, 45],
            step: 1,
            trainings: 50,
            clean: false,
            waiting_images: 400,
            seed: 1,
            mlp: Hyperparameters::default(),
            cnn: Hyperparameters { pooling: Pooling::Max2, ..Hyperparameters::default() },
        }
    }
}

impl CapacityConfig {
    /// Reads settings from a file, and sets `overrides`.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn load(path: Option<&Path>, overrides: &[String]) -> Result<Self, Error> {
        reading::load(path, overrides, CapacityConfig::check)
    }

    /// Checks what a type cannot.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let refuse = |key: &str, text: &str| Err(Error::input(format!("capacity: {text}")).with_key(key));
        let [from, to] = self.sizes;
        if from == 0 || to < from || to > MOST {
            return refuse(
                "sizes",
                &format!("sizes = [{from}, {to}]: expected two sizes from 1 to {MOST}, the smaller first"),
            );
        }
        if !(1..=MOST_TRAININGS).contains(&self.trainings) {
            return refuse(
                "trainings",
                &format!("trainings = {}: expected 1 to {MOST_TRAININGS}", self.trainings),
            );
        }
        for (key, count) in
            [("step", self.step), ("networks", self.networks.len()), ("waiting_images", self.waiting_images)]
        {
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
                return refuse(name, &format!("{name}: epochs, patience, kernel: expected 1 or more"));
            }
        }
        Ok(())
    }

    /// How a kind of network is trained.
    pub fn of(&self, kind: Kind) -> &Hyperparameters {
        match kind {
            Kind::Mlp => &self.mlp,
            Kind::Cnn => &self.cnn,
        }
    }

    /// The sizes.
    pub fn sizes(&self) -> impl Iterator<Item = usize> {
        (self.sizes[0]..=self.sizes[1]).step_by(self.step)
    }
}
