//! Every file that a run folder may hold, as plain data with reading and writing; names and locks.

pub mod audit;
pub mod capacity;
pub mod checkpoint;
pub mod eval;
pub mod folder;
pub mod images;
pub(crate) mod lock;
pub mod metrics;
pub mod names;
pub mod response;
pub(crate) mod results;
pub mod run;
#[cfg(test)]
pub(crate) mod samples;
pub(crate) mod setting;
pub(crate) mod stored_run;
pub(crate) mod task;
pub mod team;
pub(crate) mod training;
pub(crate) mod trainings;
pub(crate) mod unwritten;
pub(crate) mod validation;
