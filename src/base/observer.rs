//! [`Observer`]: what is told how a command goes on. Commands report through it and never print.

use crate::base::error::Error;
use serde::Serialize;

/// What is told how a command goes on; from several threads at once. Every method may be left out.
pub trait Observer: Sync {
    /// A step begins, or something was found, in words.
    fn note(&self, _text: &str) {}
    /// Work that is counted begins; the work before it has ended.
    fn begins(&self, _work: &Work) {}
    /// So much of the work that began last is done, in all.
    fn progress(&self, _done: u64) {}
    /// So much of the work counts as done without having taken time: it was known, or is not
    /// needed. No speed counts it.
    fn skips(&self, _count: u64) {}
    /// A generation is done; first of all, those that were done before.
    fn generation(&self, _generation: &Generation) {}
    /// A finding for programs: its kind, and its fields.
    fn finding(&self, _kind: &str, _fields: &serde_json::Value) {}
    /// Something that the user should know.
    fn warning(&self, _text: &str) {}
    /// Something failed without ending the command; `then` says how it goes on, if that is not plain.
    fn failed(&self, _error: &Error, _then: &str) {}
}

/// Ignores everything.
impl Observer for () {}

/// Work that is counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Work {
    /// What is done, as "auditing 3 robots:".
    pub label: String,
    /// How much there is.
    pub total: u64,
    /// How much of it was done before.
    pub known: u64,
    /// What is counted, as "rollouts".
    pub unit: &'static str,
}

impl Work {
    /// Work of which nothing was done before.
    pub fn new(label: String, total: u64, unit: &'static str) -> Self {
        Work { label, total, known: 0, unit }
    }
}

/// How far an evolution is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Generation {
    /// Generations done.
    #[serde(rename = "generation")]
    pub done: u64,
    /// Generations in all.
    #[serde(rename = "generations")]
    pub total: u64,
    /// Best fitness so far, in the fitness's unit; none if no robot has one.
    pub best: Option<f64>,
    /// Share of the possible cells that are filled, from 0 to 1.
    pub coverage: f64,
    /// Evaluations so far.
    pub evaluations: u64,
}
