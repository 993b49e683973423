//! [`Course`]: the metrics of a run so far, for the page's curves.

use crate::base::error::Error;
use crate::shipped::exists;
use crate::store::folder;
use crate::store::metrics::{Moment, moments};
use crate::store::names::METRICS;
use serde::Serialize;
use std::path::Path;

/// The metrics of a run so far: `metrics.csv`, thinned.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Course {
    pub(crate) done: usize,
    pub(crate) asked: u64,
    /// True if a process is working on the run.
    pub(crate) under_way: bool,
    /// The estimated seconds for the rest, at the pace of the last fifth.
    pub(crate) seconds_left: Option<f64>,
    /// The generations of the curves' points.
    pub(crate) generation: Vec<usize>,
    pub(crate) qd_score: Vec<f64>,
    /// The share of cells that are filled.
    pub(crate) coverage: Vec<f64>,
    /// The largest fitness; `None` before the first elite.
    pub(crate) obj_max: Vec<Option<f64>>,
}

/// Maximum number of points of a curve: the page has no pixels for more.
const POINTS: usize = 240;

impl Course {
    /// Reads the course of a run.json's run; `asked` is the requested number of generations.
    pub(crate) fn of(archive: &Path, asked: u64) -> Result<Self, Error> {
        // Runs of the gallery and the atlas lack this file, as do runs that just began.
        let moments = if exists(&archive.with_file_name(METRICS)) {
            moments(archive)?
        } else {
            Vec::new()
        };
        let done = moments.len();
        let left = asked.saturating_sub(done as u64);
        // Extrapolates from its last fifth.
        let fifth = (done / 5).max(1);
        let since = done
            .checked_sub(fifth + 1)
            .map(|before| moments[done - 1].seconds - moments[before].seconds);
        let seconds_left = since
            .filter(|_| left > 0)
            .map(|seconds| seconds / fifth as f64 * left as f64);
        let generation = thinned(done);
        let of =
            |value: fn(&Moment) -> f64| generation.iter().map(|k| value(&moments[*k])).collect();
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

/// Returns up to [`POINTS`] generations, evenly spaced, including the last.
fn thinned(done: usize) -> Vec<usize> {
    match done {
        0 => Vec::new(),
        done if done <= POINTS => (0..done).collect(),
        done => (0..POINTS).map(|k| k * (done - 1) / (POINTS - 1)).collect(),
    }
}
