//! `training.json`: every rollout of a training, to continue it; and the origin of its gaits.

use crate::base::error::Error;
use crate::base::hash::sha256_hex;
use crate::base::number::is_zero;
use crate::base::ranges;
use crate::store::results::Stored;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) const FILE: (&str, u32) = ("morphcog-training", 2);

/// The run whose gaits a robot was trained from, wherever that run was.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// The name of the run.
    pub(crate) name: String,
    /// The number of its generations.
    pub(crate) generations: u64,
    /// The SHA-256 of its file.
    pub sha256: String,
    /// The indices of all images that its robots were ever trained on, if of the same data. They
    /// are not for validation.
    pub trained_on: Vec<usize>,
    /// The images of other data that its robots were trained on, run by run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub elsewhere: Vec<Elsewhere>,
    /// The number of windows tried, the best of which is in the config; 0: only the config's own.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub windows: usize,
}

/// The training images of a run on other data; those data need not be available.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Elsewhere {
    /// The SHA-256 of the training images.
    pub train_sha256: String,
    /// The indices of the run's last training images, and of those that its gaits were trained on.
    pub(crate) indices: Vec<usize>,
    /// The images that it drew, if its config names none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) drawn: Option<Drawn>,
}

/// Images that were drawn at random.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub(crate) struct Drawn {
    /// The classes.
    pub(crate) classes: Vec<u8>,
    /// The number of images of each class.
    pub(crate) images_per_class: usize,
    /// The seed.
    pub(crate) seed: u64,
}

/// Displacements that were simulated together, in the order of the images; `None` if unstable.
pub(crate) type Batch = Vec<Option<f64>>;

/// The content of `training.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    /// The `format` of the file.
    pub(crate) format: String,
    /// The version of its schema.
    pub(crate) format_version: u32,
    /// The SHA-256 of everything that the rollouts depend on.
    pub(crate) key: String,
    /// The SHA-256 of `key` and `rollouts`, to detect damage; absent in files of version 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) checksum: Option<String>,
    /// The rollouts in the order in which they were requested.
    #[serde(deserialize_with = "ranges::number")]
    pub(crate) rollouts: Vec<Batch>,
}

impl File {
    /// Creates the file of these rollouts, with its checksum.
    pub(crate) fn new(key: String, rollouts: Vec<Batch>) -> Self {
        let (format, format_version) = (FILE.0.to_string(), FILE.1);
        let file = File {
            format,
            format_version,
            key,
            checksum: None,
            rollouts,
        };
        File {
            checksum: Some(file.sum()),
            ..file
        }
    }

    fn sum(&self) -> String {
        let content = (&self.key, &self.rollouts);
        sha256_hex(
            serde_json::to_string(&content)
                .expect("texts, numbers and lists are JSON")
                .as_bytes(),
        )
    }
}

impl Stored for File {
    const FORMAT: (&'static str, u32) = FILE;

    fn validate(&self) -> Result<(), Error> {
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
