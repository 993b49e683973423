//! `task.json`: the state of a sweep's task, in its run folder.

use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::config::{Settings, reading};
use crate::shipped::read_text;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

pub(crate) const FORMAT: &str = "morphcog-task";
pub(crate) const FORMAT_VERSION: u32 = 1;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum TaskState {
    /// All steps are done.
    Done,
    /// A process began it, and has not reported its end.
    Running,
    /// It began, and no process works on it; the same command continues it.
    Stopped,
    Failed,
    Waiting,
}

impl TaskState {
    pub(crate) const ALL: [TaskState; 5] = [
        TaskState::Done,
        TaskState::Running,
        TaskState::Stopped,
        TaskState::Failed,
        TaskState::Waiting,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            TaskState::Done => "done",
            TaskState::Running => "running",
            TaskState::Stopped => "stopped",
            TaskState::Failed => "failed",
            TaskState::Waiting => "waiting",
        }
    }
}

/// The content of `task.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TaskFile {
    pub(crate) format: String,
    pub(crate) format_version: u32,
    pub(crate) program_version: String,
    /// Everything that the run depends on: dotted keys with their values.
    pub(crate) settings: Settings,
    /// Requests that may change: generations or challengers, validation, steps after the run.
    pub(crate) asked: Value,
    pub(crate) state: TaskState,
    pub(crate) error: Option<String>,
    /// The wall-clock time of all sessions that ended by themselves or by a signal \[s\].
    pub(crate) seconds: f64,
}

impl TaskFile {
    pub(crate) fn new(settings: Settings, asked: Value) -> Self {
        TaskFile {
            format: FORMAT.to_string(),
            format_version: FORMAT_VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            settings,
            asked,
            state: TaskState::Running,
            error: None,
            seconds: 0.0,
        }
    }

    /// Reads the file, or returns `None` if there is none.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>, Error> {
        let text = match read_text(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            read => read.map_err(|error| Error::reading(path, &error))?,
        };
        let name = path.display().to_string();
        reading::read_versioned(&text, &name, FORMAT, FORMAT_VERSION)
            .map(Some)
            .map_err(|error| error.advice("delete it: its task goes on from its run"))
    }

    pub(crate) fn write(&self, path: &Path) -> Result<(), Error> {
        let text =
            serde_json::to_string(self).expect("keys are text and numbers are finite") + "\n";
        write_atomically(path, text.as_bytes()).map_err(|error| Error::writing(path, &error))
    }
}
