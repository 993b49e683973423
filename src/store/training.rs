//! `training.json`: every rollout of a training, so that it goes on where it was stopped; and which
//! run its gaits are from.

use crate::base::error::Error;
use crate::base::hash::sha256_hex;
use crate::base::number::is_zero;
use crate::base::ranges;
use crate::store::results::Stored;
use crate::store::run::RunFile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the file calls itself, and the version of its schema.
pub(crate) const FILE: (&str, u32) = ("morphcog-training", 2);

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
    /// The same of other data, run by run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub elsewhere: Vec<Elsewhere>,
    /// How many windows of the images were tried, of which the run's config has the best; 0 if none
    /// but the config's own.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub windows: usize,
}

/// Which images of other data a run was trained on; those data need not be there.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Elsewhere {
    /// SHA-256 of the training images.
    pub train_sha256: String,
    /// Indices of those that the run was shown last, or that its gaits were trained on.
    pub indices: Vec<usize>,
    /// Those that it drew, if its config names none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawn: Option<Drawn>,
}

/// Images that were drawn.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Drawn {
    /// Of these classes.
    pub classes: Vec<u8>,
    /// So many of each.
    pub images_per_class: usize,
    /// By this seed.
    pub seed: u64,
}

impl Elsewhere {
    /// What a run was trained on.
    pub(crate) fn of(run: &RunFile) -> Self {
        let config = &run.config;
        let before = run.origin.iter().flat_map(|origin| origin.trained_on.iter().copied());
        let drawn = || Drawn {
            classes: config.classes(),
            images_per_class: config.data.images_per_class,
            seed: config.seed,
        };
        Elsewhere {
            train_sha256: run.dataset.train_sha256.clone(),
            indices: run.training_images.iter().map(|image| image.index).chain(before).collect(),
            drawn: config.data.train_images.is_none().then(drawn),
        }
    }
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
    /// SHA-256 of `key` and `rollouts`, so that no damage changes what is trained. Files of version
    /// 1 have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// Rollouts in the order in which they were asked for.
    #[serde(deserialize_with = "ranges::number")]
    pub rollouts: Vec<Batch>,
}

impl File {
    /// The file of these rollouts, with its checksum.
    pub(crate) fn new(key: String, rollouts: Vec<Batch>) -> Self {
        let (format, format_version) = (FILE.0.to_string(), FILE.1);
        let file = File { format, format_version, key, checksum: None, rollouts };
        File { checksum: Some(file.sum()), ..file }
    }

    fn sum(&self) -> String {
        let content = (&self.key, &self.rollouts);
        sha256_hex(serde_json::to_string(&content).expect("texts, numbers and lists are JSON").as_bytes())
    }
}

impl Stored for File {
    const FORMAT: (&'static str, u32) = FILE;

    fn check(&self) -> Result<(), Error> {
        match &self.checksum {
            None if self.format_version == 1 => Ok(()),
            Some(checksum) if *checksum == self.sum() => Ok(()),
            _ => Err(Error::at_key(
                "checksum",
                "it is not that of the rollouts: the file is damaged or was edited",
            )),
        }
    }
}
