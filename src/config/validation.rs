//! [`ValidationConfig`]: a config's section `[validation]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Least number of validation images.
pub const LEAST: usize = 40;

/// What messages say of the number of images that the section asks for, before it.
pub(crate) const IMAGES_KEY: &str = "validation.images";

/// Validation at a run's end: section `[validation]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationConfig {
    /// Images in all, evenly divided between the classes; none of them is trained on. Default 400.
    pub images: usize,
    /// Robots of each task that are chosen by them at the run's end. Default 0: nothing is done
    /// then.
    pub best: usize,
}

impl Default for ValidationConfig {
    fn default() -> Self {
        ValidationConfig { images: 400, best: 0 }
    }
}

impl ValidationConfig {
    /// Whether a file needs not say it.
    pub(crate) fn is_default(&self) -> bool {
        *self == ValidationConfig::default()
    }
}
