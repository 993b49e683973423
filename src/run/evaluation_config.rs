//! [`EvaluationConfig`]: how robots are evaluated, section `[evaluation]`.

use crate::task::fitness::{ENOUGH, Fitness};
use serde::{Deserialize, Serialize};

/// How robots are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EvaluationConfig {
    /// How answers to several images are judged together. Default the smallest margin, the paper's.
    #[serde(skip_serializing_if = "is_min")]
    pub fitness: Fitness,
    /// Where fitness is a mean, the margin at which an answer is as good as can be \[voxel lengths\]. Default 10; then left out of
    /// files.
    #[serde(skip_serializing_if = "is_ten")]
    pub enough: u16,
}

fn is_min(fitness: &Fitness) -> bool {
    *fitness == Fitness::Min
}

fn is_ten(enough: &u16) -> bool {
    *enough == ENOUGH
}

impl Default for EvaluationConfig {
    fn default() -> Self {
        EvaluationConfig { fitness: Fitness::default(), enough: ENOUGH }
    }
}

impl EvaluationConfig {
    /// Whether all is as by default; it is then left out of files.
    pub fn is_default(&self) -> bool {
        *self == EvaluationConfig::default()
    }
}
