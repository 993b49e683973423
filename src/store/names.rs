//! Names of the files in and beside a run's folder.

/// What `audit` found, beside `run.json`.
pub const AUDIT_JSON: &str = "audit.json";

/// What `capacity` found, beside `eval.json`.
pub const CAPACITY_JSON: &str = "capacity.json";

/// What `eval` found on test images, beside `run.json`.
pub const EVAL_JSON: &str = "eval.json";

/// What `eval` found on validation images.
pub const EVAL_VALIDATION_JSON: &str = "eval-validation.json";

/// What `response` found, beside `run.json`.
pub const RESPONSE_JSON: &str = "response.json";

/// What `team` found.
pub const TEAM_JSON: &str = "team.json";
/// The same on validation images.
pub const TEAM_VALIDATION_JSON: &str = "team-validation.json";

/// What a training keeps of its rollouts, beside `run.json`.
pub const TRAINING_JSON: &str = "training.json";

/// How far a task of a sweep is, beside `run.json`.
pub const TASK_JSON: &str = "task.json";

/// The robots that were chosen on validation images, beside `run.json`.
pub const VALIDATION_JSON: &str = "validation.json";

/// What a run remembers where its images were in, beside `run.json`.
pub const DATA_FOLDER: &str = "data-folder.json";

/// The archive with everything that made it.
pub const RUN_JSON: &str = "run.json";

/// The resolved config.
pub const CONFIG: &str = "config.toml";

/// The elites for pyribs.
pub const ELITES: &str = "elites.csv";

/// Figures per generation.
pub const METRICS: &str = "metrics.csv";

/// File names of the newest checkpoint and the one before.
pub const CHECKPOINTS: [&str; 2] = ["checkpoint.json", "checkpoint.previous.json"];

/// Who is at work in a run's folder.
pub const LOCK: &str = ".lock";

/// Who is at a task of a sweep.
pub const TASK_LOCK: &str = ".task.lock";
