//! Names of the files in and beside a run's folder.

use std::path::{Path, PathBuf};

/// The verdicts of `audit`, beside `run.json`.
pub const AUDIT_JSON: &str = "audit.json";
pub(crate) const CAPACITY_JSON: &str = "capacity.json";

/// The results of `eval` on test images, beside `run.json`.
pub(crate) const EVAL_JSON: &str = "eval.json";

/// The results of `eval` on validation images.
pub(crate) const EVAL_VALIDATION_JSON: &str = "eval-validation.json";
/// The responses that `response` measures.
pub const RESPONSE_JSON: &str = "response.json";
pub(crate) const TEAM_JSON: &str = "team.json";
/// The results of `team` on validation images.
pub(crate) const TEAM_VALIDATION_JSON: &str = "team-validation.json";

/// The rollouts of a training, beside `run.json`.
pub(crate) const TRAINING_JSON: &str = "training.json";
pub(crate) const TASK_JSON: &str = "task.json";

/// The robots chosen on validation images, beside `run.json`.
pub(crate) const VALIDATION_JSON: &str = "validation.json";

/// The folder that a run's images were in, beside `run.json`.
pub(crate) const DATA_FOLDER: &str = "data-folder.json";

/// The archive with everything that made it.
pub const RUN_JSON: &str = "run.json";
pub(crate) const CONFIG: &str = "config.toml";

/// The elites for pyribs.
pub(crate) const ELITES: &str = "elites.csv";
pub(crate) const METRICS: &str = "metrics.csv";
pub(crate) const CHECKPOINTS: [&str; 2] = ["checkpoint.json", "checkpoint.previous.json"];
pub(crate) const LOCK: &str = ".lock";
pub(crate) const TASK_LOCK: &str = ".task.lock";

/// The formats of a figure's files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FigureFormat {
    Svg,
    Png,
    Pdf,
}

impl FigureFormat {
    pub(crate) const ALL: [FigureFormat; 3] =
        [FigureFormat::Svg, FigureFormat::Png, FigureFormat::Pdf];

    /// Returns the extension of such a file.
    pub(crate) fn ending(self) -> &'static str {
        match self {
            FigureFormat::Svg => "svg",
            FigureFormat::Png => "png",
            FigureFormat::Pdf => "pdf",
        }
    }

    /// Returns a path with the extension of each format in place of its own.
    pub(crate) fn beside(path: &Path) -> [PathBuf; 3] {
        FigureFormat::ALL.map(|format| path.with_extension(format.ending()))
    }
}
