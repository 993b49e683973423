//! Independent tasks, each in a run folder of its own: what `sweep` and `reproduce` are made of.
//!
//! A task evolves or trains, and then does the steps that its plan asks for. How far it is stands
//! in its folder, so that any process on any machine goes on with it.

pub mod all;
pub mod status;
pub mod steps;
pub mod task;

pub use all::{Summary, check_data, run_all};
pub use status::{Status, status};
pub use steps::run;
pub use task::{AuditStep, EvalStep, Place, Run, Steps, Task, Training, check_folders};
