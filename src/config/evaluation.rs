//! [`EvaluationConfig`]: a config's section `[evaluation]`, and the rules of response fitness.

use crate::task::fitness::Fitness;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The evaluation of robots: section `[evaluation]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EvaluationConfig {
    /// The rule that turns answers to several images into one number. Default min.
    pub fitness: Fitness,
}

impl EvaluationConfig {
    pub(crate) fn is_default(&self) -> bool {
        *self == EvaluationConfig::default()
    }
}
