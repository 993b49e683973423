//! [`Remedy`]: what a user can do about an error, without saying with which option. The command
//! line, Python and the tasks of a sweep each word it in their own way.

use std::path::{Path, PathBuf};

/// An action that a user can take about an error; several of one error are alternatives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// Advice in plain words, without names of options or commands.
    Advice(String),
    /// Run a command; the text says what it does ("audits the run as it is now"), and may be empty.
    Run(Invocation, &'static str),
    /// Run the same command again: it continues.
    Repeat,
    /// Run the same command again and resume the run that it has saved.
    RepeatResuming,
    /// Resume the run in the folder.
    Resume,
    /// Replace what is in the folder.
    Replace,
    /// Write to another place.
    ChooseOut,
    /// Move the file or folder that is in the way.
    MoveAway,
    /// Name the run.
    NameRun,
    /// Name more runs.
    AddRuns,
    /// Choose other robots, with one way to select some where that is worth a word.
    ChooseRobots(Option<&'static str>),
    /// Take robots that the audit did not find physical.
    TakeUnphysical,
    /// Name the folder of the images.
    NameData,
    /// Use the digits that the program draws.
    UseBuiltin,
    /// Use the images of another dataset.
    ShowOtherDataset,
    /// Let the seed draw the training images.
    DrawTrainingImages,
    /// Name the classes of a team.
    NameClasses,
    /// Measure with the random images of this seed.
    MeasureWithSeed(u64),
    /// Make a report without moving pictures.
    LeaveOutRollouts,
    /// Name another mirror.
    NameMirror,
    /// Name another port, or none.
    ChoosePort,
    /// Name one robot, for example this one.
    NameRobot(String),
    /// Write the frames of a film, for another encoder.
    WriteFrames,
    /// Free space on the disk of a folder.
    FreeSpace(PathBuf),
}

impl Remedy {
    pub(crate) fn advice(text: impl Into<String>) -> Self {
        Remedy::Advice(text.into())
    }
}

/// A command of the program with its options, not yet spelled for a shell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Invocation {
    /// The command, such as "data fetch".
    pub(crate) command: &'static str,
    /// Values without an option.
    pub(crate) values: Vec<Value>,
    /// Options by their names, in order; those without a value are switches.
    pub(crate) options: Vec<(&'static str, Option<Value>)>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    Word(String),
    Path(PathBuf),
    /// A placeholder that the user fills in.
    Placeholder(&'static str),
}

impl Invocation {
    pub(crate) fn new(command: &'static str) -> Self {
        Invocation {
            command,
            values: Vec::new(),
            options: Vec::new(),
        }
    }

    #[must_use]
    pub(crate) fn value(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    #[must_use]
    pub(crate) fn option(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.options.push((name, Some(value.into())));
        self
    }

    #[must_use]
    pub(crate) fn switch(mut self, name: &'static str, is_on: bool) -> Self {
        if is_on {
            self.options.push((name, None));
        }
        self
    }
}

impl From<&str> for Value {
    fn from(word: &str) -> Self {
        Value::Word(word.to_string())
    }
}

impl From<String> for Value {
    fn from(word: String) -> Self {
        Value::Word(word)
    }
}

impl From<&Path> for Value {
    fn from(path: &Path) -> Self {
        Value::Path(path.to_path_buf())
    }
}
