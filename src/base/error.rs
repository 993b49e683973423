//! [`Error`]: what a command fails with, and the exit code it means.

use crate::base::ownership::{self, Lost};
use crate::base::stop::Stopped;
use crate::base::text::one_line;
use std::fmt;
use std::io;
use std::path::Path;

/// Kinds of failure; each has an exit code of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Anything without a code of its own, as a full disk.
    Other,
    /// The command line asks for what cannot be.
    Usage,
    /// A file the user gave is missing, broken or of the wrong kind.
    Input,
    /// A simulated rollout became unstable (`simulate` only).
    Unstable,
    /// Something is in the way: a run folder that exists, or is in use.
    Occupied,
    /// A folder that this process had locked is no longer its own: nothing more is written to it.
    Lost,
    /// Stopped by a signal; the run was saved and can be resumed.
    Stopped,
}

impl ErrorKind {
    /// The process's exit code.
    pub fn exit_code(self) -> u8 {
        match self {
            ErrorKind::Other => 1,
            ErrorKind::Usage => 2,
            ErrorKind::Input => 3,
            ErrorKind::Unstable => 4,
            ErrorKind::Occupied | ErrorKind::Lost => 5,
            ErrorKind::Stopped => 75,
        }
    }
}

/// What went wrong, where, what was expected; and in `hint`, what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// What kind of failure it is.
    pub kind: ErrorKind,
    /// One line for the user, whatever the files and names in it hold (see [`one_line`]).
    pub message: String,
    /// What to do about it.
    pub hint: Option<String>,
    /// The key that it is about, if it is about one of a config: its path in dots, items of lists
    /// by their number from 1.
    pub key: Option<String>,
}

impl Error {
    fn new(kind: ErrorKind, message: String) -> Self {
        Error { kind, message: one_line(&message), hint: None, key: None }
    }

    /// A file the user gave is wrong.
    pub fn input(message: String) -> Self {
        Error::new(ErrorKind::Input, message)
    }

    /// A key of a config has a value that cannot be.
    pub fn value(key: &str, found: impl fmt::Display, expected: &str) -> Self {
        Error::input(format!("{key} = {found}: expected {expected}")).of(key)
    }

    /// Something is wrong about a key of a config.
    pub fn at(key: &str, text: impl fmt::Display) -> Self {
        Error::input(format!("{key}: {text}")).of(key)
    }

    /// The command line is wrong.
    pub fn usage(message: String) -> Self {
        Error::new(ErrorKind::Usage, message)
    }

    /// Something is in the way.
    pub fn occupied(message: String) -> Self {
        Error::new(ErrorKind::Occupied, message)
    }

    /// A failure of another kind.
    pub fn other(message: String) -> Self {
        Error::new(ErrorKind::Other, message)
    }

    /// An unstable rollout.
    pub fn unstable(message: String) -> Self {
        Error::new(ErrorKind::Unstable, message)
    }

    /// Stopped by a signal.
    pub fn stopped(message: String) -> Self {
        Error::new(ErrorKind::Stopped, message)
    }

    /// A file the user gave cannot be read.
    pub fn reading(path: &Path, error: &io::Error) -> Self {
        Error::input(format!("{}: cannot be read: {error}", path.display()))
    }

    /// The same, and where there is no such file, what makes one or is meant instead.
    pub fn reading_or(path: &Path, error: &io::Error, hint: &str) -> Self {
        let text = Error::reading(path, error);
        if error.kind() == io::ErrorKind::NotFound { text.hint(hint.to_string()) } else { text }
    }

    /// A file is not written any more: its folder is another process's, or anybody's.
    fn lost(path: &Path, lost: &Lost) -> Self {
        let hint = match lost {
            Lost::Taken { .. } => "let that one end, or start this command again in another folder",
            Lost::Removed { .. } => "start the command again, and leave the folder to it as long as it runs",
        };
        let text = format!("{}: not written: {lost}", path.display());
        Error::new(ErrorKind::Lost, text).hint(hint.to_string())
    }

    /// A file cannot be written; if there is no room for it, or the lock of its folder is lost, with
    /// what to do.
    pub fn writing(path: &Path, error: &io::Error) -> Self {
        // A folder that was removed a moment ago fails in other ways, too.
        let now = ownership::check(path).err();
        if let Some(lost) = [Some(error), now.as_ref()].into_iter().flatten().find_map(Lost::of) {
            return Error::lost(path, lost);
        }
        let place = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let full = match error.kind() {
            io::ErrorKind::FileTooLarge => "raise the limit for the size of files (ulimit -f)".to_string(),
            _ => format!("make space on the disk that {} is on", place.display()),
        };
        let text = Error::other(format!("{}: cannot be written: {error}", path.display()));
        if is_full(error) { text.hint(format!("{full}, or write elsewhere with --out")) } else { text }
    }

    /// The same with what to do.
    #[must_use]
    pub fn hint(mut self, hint: String) -> Self {
        self.hint = Some(one_line(&hint));
        self
    }

    /// The same about a key.
    #[must_use]
    pub fn of(self, key: &str) -> Self {
        Error { key: Some(key.to_string()), ..self }
    }

    /// The same with where it is, unless it says that already.
    #[must_use]
    pub fn within(mut self, place: &str) -> Self {
        let place = one_line(place);
        let is_said = self.message.strip_prefix(&place).is_some_and(|rest| rest.starts_with(':'));
        if !is_said {
            self.message = one_line(&format!("{place}: {}", self.message));
        }
        self
    }
}

/// Whether there is no room: on the disk, in the user's quota, or in a file of the size that the
/// system allows.
pub fn is_full(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
}

impl From<Stopped> for Error {
    fn from(stopped: Stopped) -> Self {
        Error::stopped(stopped.to_string())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Error {}
