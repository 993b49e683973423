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
    pub(crate) done: u64,
    pub(crate) asked: u64,
    /// True if a process is working on the run.
    pub(crate) under_way: bool,
    /// The estimated seconds for the rest, at the pace of the last fifth.
    pub(crate) seconds_left: Option<f64>,
    /// The generations of the curves' points.
    pub(crate) generation: Vec<u64>,
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
        // Some of the first may be missing, if the run went on from its run.json.
        let done = moments.last().map_or(0, |last| last.generation + 1);
        let left = asked.saturating_sub(done);
        // Extrapolates from the last fifth.
        let known = moments.len();
        let fifth = (known / 5).max(1);
        let since = known
            .checked_sub(fifth + 1)
            .map(|before| moments[known - 1].seconds - moments[before].seconds);
        let seconds_left = since
            .filter(|_| left > 0)
            .map(|seconds| seconds / fifth as f64 * left as f64);
        let points: Vec<&Moment> = thinned(known).into_iter().map(|k| &moments[k]).collect();
        let of = |value: fn(&Moment) -> f64| points.iter().map(|moment| value(moment)).collect();
        Ok(Course {
            done,
            asked,
            under_way: folder::is_in_use(archive.parent().unwrap_or(Path::new(""))),
            seconds_left,
            qd_score: of(|moment| moment.qd_score),
            coverage: of(|moment| moment.coverage),
            obj_max: points.iter().map(|moment| moment.obj_max).collect(),
            generation: points.iter().map(|moment| moment.generation).collect(),
        })
    }
}

/// Returns the indices of up to [`POINTS`] of so many lines, evenly spaced, including the last.
fn thinned(lines: usize) -> Vec<usize> {
    match lines {
        0 => Vec::new(),
        lines if lines <= POINTS => (0..lines).collect(),
        lines => (0..POINTS)
            .map(|k| k * (lines - 1) / (POINTS - 1))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generations_are_those_of_the_lines_even_if_the_first_are_missing() {
        let folder = tempfile::tempdir().unwrap();
        let line = |generation: u64| {
            format!("{generation},3,0.5,7,0.1,4,2,20,20,0,0,0,0,0,{generation}\n")
        };
        let header = "generation,num_elites,coverage,qd_score,norm_qd_score,obj_max,obj_mean,evaluations,\
                      simulated,saved,\
                      saved_known_bodies,saved_early_stop,saved_shared_rollouts,unstable,seconds\n";
        let lines: String = (9000..9010).map(line).collect();
        std::fs::write(folder.path().join(METRICS), format!("{header}{lines}")).unwrap();
        let course = Course::of(&folder.path().join("run.json"), 9020).unwrap();
        assert_eq!((course.done, course.generation[0]), (9010, 9000));
        assert_eq!(course.seconds_left, Some(10.0));
    }
}
