//! `task.json`: how far a task of a sweep is, in its run folder.

use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::config::{Settings, reading};
use crate::shipped::read_text;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// What the file calls itself.
pub const FORMAT: &str = "morphcog-task";

/// Version of its schema.
pub const FORMAT_VERSION: u32 = 1;

/// How far a task is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// All its steps are done.
    Done,
    /// A process began with it, and has not said that it ended.
    Running,
    /// It began, and no process is at it; the same command goes on.
    Stopped,
    /// It failed.
    Failed,
    /// It has not begun.
    Waiting,
}

impl State {
    /// All of them.
    pub const ALL: [State; 5] = [State::Done, State::Running, State::Stopped, State::Failed, State::Waiting];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            State::Done => "done",
            State::Running => "running",
            State::Stopped => "stopped",
            State::Failed => "failed",
            State::Waiting => "waiting",
        }
    }
}

/// The content of `task.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskFile {
    /// [`FORMAT`].
    pub format: String,
    /// [`FORMAT_VERSION`].
    pub format_version: u32,
    /// Version of the program that wrote it.
    pub program_version: String,
    /// Everything that the run depends on: keys in dots, with their values.
    pub settings: Settings,
    /// What is asked for beyond that, and may change: generations or challengers, validation, steps
    /// after the run.
    pub asked: Value,
    /// How far it is.
    pub state: State,
    /// What it failed with.
    pub error: Option<String>,
    /// Wall-clock time of all sessions that ended by themselves or by a signal \[s\].
    pub seconds: f64,
}

impl TaskFile {
    /// Of a task that begins.
    pub fn new(settings: Settings, asked: Value) -> Self {
        TaskFile {
            format: FORMAT.to_string(),
            format_version: FORMAT_VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            settings,
            asked,
            state: State::Running,
            error: None,
            seconds: 0.0,
        }
    }

    /// Reads it; `None` if there is none.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(path: &Path) -> Result<Option<Self>, Error> {
        let text = match read_text(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            read => read.map_err(|error| Error::reading(path, &error))?,
        };
        let name = path.display().to_string();
        reading::read_versioned(&text, &name, FORMAT, FORMAT_VERSION)
            .map(Some)
            .map_err(|error| error.advice("delete it: its task goes on from its run"))
    }

    /// Writes it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let text = serde_json::to_string(self).expect("keys are text and numbers are finite") + "\n";
        write_atomically(path, text.as_bytes()).map_err(|error| Error::writing(path, &error))
    }
}
