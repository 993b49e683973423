//! [`Observer`]: receives the progress of a command. Commands report through it and never print.

use crate::base::error::Error;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Receives the progress of a command, from several threads at once. Every method is optional.
pub trait Observer: Sync {
    /// Reports in words that a step begins, or that something was found.
    fn note(&self, _text: &str) {}
    /// Reports that a file was written; `about` is what else there is to say of it, if anything.
    fn wrote(&self, _path: &Path, _about: &str) {}
    /// Reports that counted work begins; the work before it has ended.
    fn begins(&self, _work: &Work) {}
    /// Reports the total done so far of the work that began last.
    fn progress(&self, _done: u64) {}
    /// Reports work that is done without taking time: known or not needed. No speed counts it.
    fn skips(&self, _count: u64) {}
    /// Reports a completed generation; first of all, those completed earlier.
    fn generation(&self, _generation: &Generation) {}
    /// Reports a finding for programs: its kind and its fields.
    fn finding(&self, _kind: &str, _fields: &serde_json::Value) {}
    /// Reports something that the user should know.
    fn warning(&self, _text: &str) {}
    /// Reports a failure that does not end the command; `then` says how it continues, if not plain.
    fn failed(&self, _error: &Error, _then: &str) {}
}

impl Observer for () {}

/// Work that is counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Work {
    /// Label, such as "auditing 3 robots:".
    pub label: String,
    /// Number of units in all.
    pub total: u64,
    /// Number of units done before.
    pub known: u64,
    /// Unit of the count, such as "rollouts".
    pub unit: String,
}

impl Work {
    pub(crate) fn new(label: String, total: u64, unit: &'static str) -> Self {
        Work {
            label,
            total,
            known: 0,
            unit: unit.to_string(),
        }
    }
}

/// Progress of an evolution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Generation {
    /// Generations done.
    #[serde(rename = "generation")]
    pub done: u64,
    #[serde(rename = "generations")]
    pub(crate) total: u64,
    /// Best fitness so far, in the fitness's unit; none if no robot has one.
    pub(crate) best: Option<f64>,
    /// Fraction of the possible cells that are filled, from 0 to 1.
    pub(crate) coverage: f64,
    pub(crate) evaluations: u64,
    pub(crate) qd_score: f64,
}
