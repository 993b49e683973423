//! Independent tasks of `sweep` and `reproduce`, each in its own run folder. A task evolves or
//! trains, then does the steps of its plan. Its folder records its state, so that any process on
//! any machine can go on with it.

pub(crate) mod all;
pub(crate) mod status;
pub(crate) mod steps;
pub(crate) mod task;

pub(crate) use all::{TasksSummary, check_data, run_all};
pub(crate) use status::{TaskStatus, status};
pub(crate) use steps::run;
pub use task::Gaits;
pub(crate) use task::{
    AuditStep, EvalStep, PairRun, Run, Steps, Task, TaskFolders, TrainRun, check_folders,
};
