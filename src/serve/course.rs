//! [`Course`]: how a run went so far, for the page's curves.

use crate::base::error::Error;
use crate::shipped::exists;
use crate::store::folder;
use crate::store::metrics::{Moment, moments};
use crate::store::names::METRICS;
use serde::Serialize;
use std::path::Path;

/// How a run went so far: `metrics.csv`, thinned.
#[derive(Clone, Debug, Serialize)]
pub struct Course {
    /// Generations done.
    pub done: usize,
    /// Generations that it was asked for.
    pub asked: u64,
    /// Whether a process is at work on it.
    pub under_way: bool,
    /// Seconds that the rest will take, if it goes on as in its last fifth.
    pub seconds_left: Option<f64>,
    /// Generations of which the curves tell.
    pub generation: Vec<usize>,
    /// QD score.
    pub qd_score: Vec<f64>,
    /// Share of cells that are filled.
    pub coverage: Vec<f64>,
    /// Largest fitness; none before the first elite.
    pub obj_max: Vec<Option<f64>>,
}

/// Most points of a curve: more than the page has pixels for.
const POINTS: usize = 240;

impl Course {
    /// Of the run of a run.json that was asked for so many generations.
    ///
    /// # Errors
    /// If its `metrics.csv` is there and cannot be read.
    pub fn of(archive: &Path, asked: u64) -> Result<Self, Error> {
        // Runs of the gallery and the atlas come without one, and one that has just begun has none yet.
        let moments = if exists(&archive.with_file_name(METRICS)) { moments(archive)? } else { Vec::new() };
        let done = moments.len();
        let left = asked.saturating_sub(done as u64);
        // As fast as in its last fifth.
        let fifth = (done / 5).max(1);
        let since =
            done.checked_sub(fifth + 1).map(|before| moments[done - 1].seconds - moments[before].seconds);
        let seconds_left = since.filter(|_| left > 0).map(|seconds| seconds / fifth as f64 * left as f64);
        let generation = thinned(done);
        let of = |value: fn(&Moment) -> f64| generation.iter().map(|k| value(&moments[*k])).collect();
        Ok(Course {
            done,
            asked,
            under_way: folder::is_in_use(archive.parent().unwrap_or(Path::new(""))),
            seconds_left,
            qd_score: of(|moment| moment.qd_score),
            coverage: of(|moment| moment.coverage),
            obj_max: generation.iter().map(|k| moments[*k].obj_max).collect(),
            generation,
        })
    }
}

/// So many of the generations, evenly, the last always.
fn thinned(done: usize) -> Vec<usize> {
    match done {
        0 => Vec::new(),
        done if done <= POINTS => (0..done).collect(),
        done => (0..POINTS).map(|k| k * (done - 1) / (POINTS - 1)).collect(),
    }
}
