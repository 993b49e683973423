//! Independent tasks of `sweep` and `reproduce`, each in its own run folder. A task evolves or
//! trains, then does the steps of its plan. Its folder records its state, so that any process on
//! any machine can go on with it.

pub mod all;
pub mod status;
pub mod steps;
pub mod task;

pub use all::{TasksSummary, check_data, run_all};
pub use status::{TaskStatus, status};
pub use steps::run;
pub use task::{AuditStep, EvalStep, Run, Steps, Task, TaskFolders, TrainRun, check_folders};
