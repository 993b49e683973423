//! `training.json`: every rollout of a training, so that it goes on where it was stopped; and which
//! run its gaits are from.

use crate::base::number::is_zero;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What the file calls itself, and the version of its schema.
pub(crate) const FILE: (&str, u32) = ("morphcog-training", 1);

/// The run whose gaits a robot was trained from, wherever that lay.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Name of the run.
    pub name: String,
    /// Its generations.
    pub generations: u64,
    /// SHA-256 of its file.
    pub sha256: String,
    /// Indices of the images that its robots were ever trained on, if they are of the same data:
    /// not for validation.
    pub trained_on: Vec<usize>,
    /// The same of other data, by the SHA-256 of their training images.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub elsewhere: BTreeMap<String, Vec<usize>>,
    /// How many windows of the images were tried, of which the run's config has the best; 0 if none
    /// but the config's own.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub windows: usize,
}

/// Displacements that were simulated together, in the order of the images; `None` where unstable.
pub type Batch = Vec<Option<f64>>;

/// The content of `training.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// What it calls itself.
    pub format: String,
    /// Version of its schema.
    pub format_version: u32,
    /// SHA-256 of all that the rollouts depend on.
    pub key: String,
    /// Rollouts in the order in which they were asked for.
    pub rollouts: Vec<Batch>,
}
