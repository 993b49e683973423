//! Every file that a run folder may hold, as plain data with reading and writing; names and locks.

pub mod audit;
pub mod capacity;
pub mod checkpoint;
pub mod eval;
pub mod folder;
pub mod images;
pub mod lock;
pub mod metrics;
pub mod names;
pub mod response;
pub(crate) mod results;
pub mod run;
#[cfg(test)]
pub(crate) mod samples;
pub mod setting;
pub mod stored_run;
pub mod task;
pub mod team;
pub mod training;
pub mod trainings;
pub mod unwritten;
pub mod validation;
