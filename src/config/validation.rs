//! [`ValidationConfig`]: a config's section `[validation]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) const LEAST: usize = 40;

pub(crate) const IMAGES_KEY: &str = "validation.images";

/// Validation at a run's end: section `[validation]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationConfig {
    /// The number of images, evenly divided between the classes; never trained on. Default 400.
    pub images: usize,
    /// The number of robots per task that they choose at the run's end. Default 0: no validation.
    pub(crate) best: usize,
}

impl Default for ValidationConfig {
    fn default() -> Self {
        ValidationConfig {
            images: 400,
            best: 0,
        }
    }
}

impl ValidationConfig {
    /// Returns true if files may omit it.
    pub(crate) fn is_default(&self) -> bool {
        *self == ValidationConfig::default()
    }
}
