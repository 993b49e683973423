//! [`Remedy`]: what a user can do about an error. It says what, never with which option: the command
//! line, Python and the tasks of a sweep each put it in their own words.

use std::path::{Path, PathBuf};

/// What a user can do about an error. Several of one error are alternatives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// In plain words, which name no option and no command.
    Advice(String),
    /// Run a command; the text says what it does ("audits the run as it is now"), and may be empty.
    Run(Invocation, &'static str),
    /// Run the same command again: it goes on.
    Repeat,
    /// Run the same command again, resuming the run that it has saved.
    RepeatResuming,
    /// Resume the run in the folder.
    Resume,
    /// Replace what is in the folder.
    Replace,
    /// Write to another place.
    ChooseOut,
    /// Move the file or folder away that is in the way.
    MoveAway,
    /// Name the run that is meant.
    NameRun,
    /// Name more runs.
    AddRuns,
    /// Choose other robots; one way to select some, where one is worth a word.
    ChooseRobots(Option<&'static str>),
    /// Take robots that the audit did not find physical.
    TakeUnphysical,
    /// Name the folder of the images.
    NameData,
    /// Use the digits that the program draws.
    UseBuiltin,
    /// Show the images of another dataset.
    ShowOtherDataset,
    /// Let the training images be drawn by the seed.
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
    /// Name one robot, such as this.
    NameRobot(String),
    /// Make space on the disk of a folder.
    FreeSpace(PathBuf),
}

impl Remedy {
    /// Advice in plain words.
    pub fn advice(text: impl Into<String>) -> Self {
        Remedy::Advice(text.into())
    }
}

/// A command of the program with its options: what to run, before anybody has spelled it for a shell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Invocation {
    /// The command, as "data fetch".
    pub command: &'static str,
    /// Values without an option.
    pub values: Vec<Value>,
    /// Options by their names, in order; those without a value are switches.
    pub options: Vec<(&'static str, Option<Value>)>,
}

/// The value of an option.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// A word of any characters.
    Word(String),
    /// A path.
    Path(PathBuf),
    /// Stands for what the user has to fill in.
    Placeholder(&'static str),
}

impl Invocation {
    /// A command without options.
    pub fn new(command: &'static str) -> Self {
        Invocation { command, values: Vec::new(), options: Vec::new() }
    }

    /// Adds a value without an option.
    #[must_use]
    pub fn value(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// Adds an option with its value.
    #[must_use]
    pub fn option(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.options.push((name, Some(value.into())));
        self
    }

    /// Adds a switch, if `is_on`.
    #[must_use]
    pub fn switch(mut self, name: &'static str, is_on: bool) -> Self {
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
