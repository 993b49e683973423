//! Status of tasks, read from their folders.

use crate::base::error::Error;
use crate::base::files::open_file;
use crate::commands::tasks::steps::{lacking, was_done};
use crate::commands::tasks::task::{Run, Task, TaskFolders};
use crate::store::lock;
use crate::store::names::{METRICS, TASK_JSON, TASK_LOCK};
use crate::store::task::{TaskFile, TaskState};
use serde::Serialize;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes at the end of a metrics.csv that hold its last whole row; rows have about 150.
const ROW: u64 = 4096;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct TaskStatus {
    /// Its number, from 1.
    pub(crate) task: usize,
    pub(crate) name: String,
    pub(crate) state: TaskState,
    /// Generations done and requested; `None` for a training.
    pub(crate) generations: Option<[u64; 2]>,
    /// Wall-clock time so far \[s\]; for a running task, as far as its run has written it.
    pub(crate) seconds: Option<f64>,
    /// Estimated time left \[s\], if known.
    pub(crate) seconds_left: Option<f64>,
    /// Its error, or the process that works on it.
    pub(crate) about: Option<String>,
}

pub(crate) fn status(tasks: &[Task], place: &TaskFolders) -> Result<Vec<TaskStatus>, Error> {
    let locks: Vec<PathBuf> = tasks
        .iter()
        .map(|task| place.folder(task).join(TASK_LOCK))
        .collect();
    let mut all = Vec::new();
    for ((number, task), held) in (1..).zip(tasks).zip(lock::states(&locks)) {
        all.push(status_of(number, task, place, held)?);
    }
    // A task about which nothing else is known takes as long as the finished ones.
    let done: Vec<f64> = all
        .iter()
        .filter(|s| s.state == TaskState::Done)
        .filter_map(|s| s.seconds)
        .collect();
    let mean = (!done.is_empty()).then(|| done.iter().sum::<f64>() / done.len() as f64);
    for status in all
        .iter_mut()
        .filter(|s| s.state != TaskState::Done && s.seconds_left.is_none())
    {
        status.seconds_left = mean.map(|mean| (mean - status.seconds.unwrap_or(0.0)).max(0.0));
    }
    Ok(all)
}

fn status_of(
    number: usize,
    task: &Task,
    place: &TaskFolders,
    held: lock::LockState,
) -> Result<TaskStatus, Error> {
    let folder = place.folder(task);
    let known = TaskFile::read(&folder.join(TASK_JSON))?;
    let (state, about) = match (&known, held) {
        (_, lock::LockState::Held(holder)) => {
            (TaskState::Running, holder.map(|holder| holder.to_string()))
        }
        (None, _) => (TaskState::Waiting, None),
        (Some(known), _) if was_done(known, task) => match lacking(task, place) {
            None => (TaskState::Done, None),
            lacking => (TaskState::Stopped, lacking),
        },
        (
            Some(TaskFile {
                state: TaskState::Failed,
                error,
                ..
            }),
            _,
        ) => (TaskState::Failed, error.clone()),
        (
            Some(TaskFile {
                state: TaskState::Running,
                ..
            }),
            lock::LockState::Stale(holder),
        ) => (TaskState::Stopped, Some(format!("{holder} was ended"))),
        (Some(_), _) => (TaskState::Stopped, None),
    };
    let (generations, of_run) = match &task.run {
        Run::Evolve(config, ..) => {
            let (done, seconds) = last_generation(&folder.join(METRICS)).unwrap_or((0, 0.0));
            // Whatever metrics.csv says: it may have been removed, or cut.
            let done = match state {
                TaskState::Done => config.generations,
                _ => done,
            };
            (
                Some([done, config.generations]),
                Some((done, seconds)).filter(|_| state != TaskState::Waiting),
            )
        }
        Run::Train(_) | Run::Pair(_) => (None, None),
    };
    let seconds = match (state, of_run) {
        (TaskState::Waiting, _) => None,
        (TaskState::Running, Some((_, seconds))) => Some(seconds),
        _ => known.map(|known| known.seconds),
    };
    let left = |(done, seconds): (u64, f64)| {
        let todo = task.amount().saturating_sub(done);
        (done > 0 && todo > 0).then(|| seconds * todo as f64 / done as f64)
    };
    let seconds_left = if state == TaskState::Done {
        Some(0.0)
    } else {
        of_run.and_then(left)
    };
    Ok(TaskStatus {
        task: number,
        name: task.name.clone(),
        state,
        generations,
        seconds,
        seconds_left,
        about,
    })
}

/// Reads generations and wall-clock time \[s\] at the end of a metrics.csv, which may have
/// megabytes.
fn last_generation(path: &Path) -> Option<(u64, f64)> {
    let mut file = open_file(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(ROW)))
        .ok()?;
    let mut text = Vec::new();
    file.read_to_end(&mut text).ok()?;
    let text = String::from_utf8_lossy(&text);
    let line = text
        .split_inclusive('\n')
        .rfind(|line| line.ends_with('\n'))?
        .trim_end();
    let generation: u64 = line.split(',').next()?.parse().ok()?;
    Some((generation + 1, line.rsplit(',').next()?.parse().ok()?))
}
