//! [`ValidationConfig`]: a config's section `[validation]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) const LEAST: usize = 40;

pub(crate) const IMAGES_KEY: &str = "validation.images";

/// Validation at a run's end: section `[validation]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationConfig {
    /// Images in all, equally many per class, of the training split but not trained on. Default 400.
    #[schemars(range(min = LEAST))]
    pub images: usize,
    /// Robots per task chosen on the images when a run ends; its `best` robot is then the first.
    /// Default 0, no validation.
    ///
    /// They are kept in `validation.json`.
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
