//! [`Floors`]: what a robot must exceed to be in the archive at all, where a stage keeps only the fittest (`keep`) or lets in only who
//! is fit enough (`threshold_min`).

use super::archive::Robot;
use crate::qd::Archive;
use crate::task::grouping::Grouping;

/// By task the fitness that a stage wants, or that of the last elite that it keeps; none while it wants none and keeps all, or has
/// fewer.
///
/// Within a period a floor never sinks (but that of elites of before, who need not be as fit as those who are born), so that what did not exceed it, or lost its cell, never can: early stop and known
/// bodies stay lossless.
pub(super) struct Floors(Vec<Option<f64>>);

impl Floors {
    /// Of an archive of which the `keep` fittest of each task stay (`None`: all), for robots who must exceed `least`.
    pub fn of(
        archive: &Archive<Robot>,
        grouping: &Grouping,
        keep: Option<usize>,
        least: Option<f64>,
    ) -> Self {
        let last = |name: String| archive.nth_fittest(keep?, |robot| robot.task == name);
        let floor = |name: String| last(name).into_iter().chain(least).reduce(f64::max);
        Floors(grouping.tasks().iter().map(|task| floor(task.name())).collect())
    }

    /// What a robot must exceed that performs a task, in a cell with this fitness.
    pub fn to_beat(&self, task: usize, in_cell: Option<f64>) -> Option<f64> {
        in_cell.into_iter().chain(self.0.get(task).copied().flatten()).reduce(f64::max)
    }
}
