//! Floor 4: what the commands do, one file per command. Reports through observers, never prints.

pub mod archive;
pub mod audit;
pub mod audit_file;
pub mod bench;
pub mod capacity;
pub mod capacity_config;
pub mod capacity_file;
mod capacity_images;
pub mod checkpoint;
pub mod config;
pub mod curriculum;
pub mod data;
mod error;
pub mod eval;
pub mod eval_file;
pub mod evolve;
pub mod folder;
pub mod gallery;
mod hardest;
pub mod metrics;
pub mod plan;
pub mod plot;
pub mod published;
pub mod replay;
pub mod report;
pub mod reproduce;
mod resume;
pub mod robots;
pub mod robust;
#[cfg(test)]
mod samples;
pub mod sensitivity;
pub mod serve;
pub mod setting;
pub mod signals;
pub mod simulate;
pub mod statistics;
pub mod table;
mod toml_text;
pub mod training;
mod trainings;
pub mod validation;
mod variation;
pub mod verdict;

pub use config::Config;
pub use error::{Error, ErrorKind};
