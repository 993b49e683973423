//! Names of the files in and beside a run's folder.

/// The verdicts of `audit`, beside `run.json`.
pub const AUDIT_JSON: &str = "audit.json";

/// The results of `capacity`, beside `eval.json`.
pub const CAPACITY_JSON: &str = "capacity.json";

/// The results of `eval` on test images, beside `run.json`.
pub const EVAL_JSON: &str = "eval.json";

/// The results of `eval` on validation images.
pub const EVAL_VALIDATION_JSON: &str = "eval-validation.json";

/// The results of `response`, beside `run.json`.
pub const RESPONSE_JSON: &str = "response.json";

/// The results of `team`.
pub const TEAM_JSON: &str = "team.json";
/// The results of `team` on validation images.
pub const TEAM_VALIDATION_JSON: &str = "team-validation.json";

/// The rollouts of a training, beside `run.json`.
pub const TRAINING_JSON: &str = "training.json";

/// The state of a sweep's task, beside `run.json`.
pub const TASK_JSON: &str = "task.json";

/// The robots chosen on validation images, beside `run.json`.
pub const VALIDATION_JSON: &str = "validation.json";

/// The folder that a run's images were in, beside `run.json`.
pub const DATA_FOLDER: &str = "data-folder.json";

/// The archive with everything that made it.
pub const RUN_JSON: &str = "run.json";

/// The resolved config.
pub const CONFIG: &str = "config.toml";

/// The elites for pyribs.
pub const ELITES: &str = "elites.csv";

/// The metrics per generation.
pub const METRICS: &str = "metrics.csv";

/// The file names of the newest and the previous checkpoint.
pub const CHECKPOINTS: [&str; 2] = ["checkpoint.json", "checkpoint.previous.json"];

/// The lock of a run's folder.
pub const LOCK: &str = ".lock";

/// The lock of a sweep's task.
pub const TASK_LOCK: &str = ".task.lock";
