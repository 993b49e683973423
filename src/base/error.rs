//! [`Error`]: the failure of a command, and its exit code.

use crate::base::ownership::{self, Lost};
use crate::base::remedy::Remedy;
use crate::base::stop::Stopped;
use crate::base::text::one_line;
use std::fmt;
use std::io;
use std::path::Path;

/// Kinds of failure; each has an exit code of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Any failure without a code of its own, such as a full disk.
    Other,
    /// The command line asks for the impossible.
    Usage,
    /// A file the user gave is missing, broken or of the wrong kind.
    Input,
    /// A simulated rollout became unstable (`simulate` only).
    Unstable,
    /// Something is in the way: a run folder exists or is in use.
    Occupied,
    /// This process has lost its lock on a folder: it writes nothing more there.
    Lost,
    /// Stopped by a signal; the run was saved and can be resumed.
    Stopped,
}

impl ErrorKind {
    pub(crate) fn exit_code(self) -> u8 {
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

/// An error: what went wrong, where, what was expected, and what to do about it.
///
/// An error knows the field of a command's options that it is about, and its remedies, but no
/// option of the command line: the front end that prints it spells both for its users.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// The kind of failure.
    pub kind: ErrorKind,
    /// One line for the user, whatever is in it (see [`one_line`]); without the argument.
    pub message: String,
    /// The argument that the error is about, if any.
    pub argument: Option<Argument>,
    /// Alternatives for the user, the most likely one first.
    pub remedies: Vec<Remedy>,
    /// The config key that it is about, if any: a dotted path, items of lists by number from 1.
    pub(crate) key: Option<String>,
}

/// A field of a command's options.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Argument {
    /// Its name, such as "control_steps".
    pub name: &'static str,
    /// The given value, on one line, if the error is about the value.
    pub value: Option<String>,
}

impl Error {
    fn new(kind: ErrorKind, message: String) -> Self {
        Error {
            kind,
            message: one_line(&message),
            argument: None,
            remedies: Vec::new(),
            key: None,
        }
    }

    /// Reports that a file from the user is wrong.
    pub fn input(message: String) -> Self {
        Error::new(ErrorKind::Input, message)
    }

    pub(crate) fn value(key: &str, found: impl fmt::Display, expected: &str) -> Self {
        Error::input(format!("{key} = {found}: expected {expected}")).with_key(key)
    }

    pub(crate) fn at_key(key: &str, text: impl fmt::Display) -> Self {
        Error::input(format!("{key}: {text}")).with_key(key)
    }

    /// Reports that an argument of a command has an invalid value; `text` says what was expected.
    pub(crate) fn argument(
        name: &'static str,
        value: impl fmt::Display,
        text: impl Into<String>,
    ) -> Self {
        let value = Some(one_line(&value.to_string()));
        Error {
            argument: Some(Argument { name, value }),
            ..Error::usage(text.into())
        }
    }

    pub(crate) fn usage(message: String) -> Self {
        Error::new(ErrorKind::Usage, message)
    }

    pub(crate) fn occupied(message: String) -> Self {
        Error::new(ErrorKind::Occupied, message)
    }

    pub(crate) fn other(message: String) -> Self {
        Error::new(ErrorKind::Other, message)
    }

    /// Reports an unstable rollout.
    pub fn unstable(message: String) -> Self {
        Error::new(ErrorKind::Unstable, message)
    }

    pub(crate) fn stopped(message: String) -> Self {
        Error::new(ErrorKind::Stopped, message)
    }

    pub(crate) fn reading(path: &Path, error: &io::Error) -> Self {
        Error::input(format!("{}: cannot be read: {error}", path.display()))
    }

    /// Acts as [`Error::reading`], and adds a remedy if there is no such file.
    pub(crate) fn reading_or(path: &Path, error: &io::Error, remedy: Remedy) -> Self {
        let text = Error::reading(path, error);
        if error.kind() == io::ErrorKind::NotFound {
            text.remedy(remedy)
        } else {
            text
        }
    }

    fn lost(path: &Path, lost: &Lost) -> Self {
        let advice = match lost {
            Lost::Taken { .. } => "let that one end, or start this command again in another folder",
            Lost::Removed { .. } => {
                "start the command again, and leave the folder to it as long as it runs"
            }
        };
        let text = format!("{}: not written: {lost}", path.display());
        Error::new(ErrorKind::Lost, text).advice(advice)
    }

    /// Adds remedies if there is no room for the file or the lock of its folder is lost.
    pub(crate) fn writing(path: &Path, error: &io::Error) -> Self {
        // A folder removed a moment ago fails in other ways, too.
        let now = ownership::check(path).err();
        if let Some(lost) = [Some(error), now.as_ref()]
            .into_iter()
            .flatten()
            .find_map(Lost::of)
        {
            return Error::lost(path, lost);
        }
        let place = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let text = Error::other(format!("{}: cannot be written: {error}", path.display()));
        match error.kind() {
            io::ErrorKind::FileTooLarge => text
                .advice("raise the limit for the size of files (ulimit -f)")
                .remedy(Remedy::ChooseOut),
            _ if is_full(error) => text
                .remedy(Remedy::FreeSpace(place.to_path_buf()))
                .remedy(Remedy::ChooseOut),
            _ => text,
        }
    }

    #[must_use]
    pub(crate) fn remedy(mut self, remedy: Remedy) -> Self {
        self.remedies.push(match remedy {
            Remedy::Advice(text) => Remedy::Advice(one_line(&text)),
            remedy => remedy,
        });
        self
    }

    /// Adds advice in plain words, without names of options or commands.
    #[must_use]
    pub(crate) fn advice(self, text: impl Into<String>) -> Self {
        self.remedy(Remedy::advice(text))
    }

    /// Names the argument that the error is about.
    #[must_use]
    pub(crate) fn about(self, name: &'static str) -> Self {
        Error {
            argument: Some(Argument { name, value: None }),
            ..self
        }
    }

    #[must_use]
    pub(crate) fn with_key(self, key: &str) -> Self {
        Error {
            key: Some(key.to_string()),
            ..self
        }
    }

    /// Adds the place to the message unless it begins with it.
    #[must_use]
    pub fn in_place(mut self, place: &str) -> Self {
        let place = one_line(place);
        let is_said = self
            .message
            .strip_prefix(&place)
            .is_some_and(|rest| rest.starts_with(':'));
        if !is_said {
            self.message = one_line(&format!("{place}: {}", self.message));
        }
        self
    }
}

/// True if the disk, the user's quota or the file size limit leaves no room.
pub(crate) fn is_full(error: &io::Error) -> bool {
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
        match &self.argument {
            Some(Argument {
                name,
                value: Some(value),
            }) => write!(f, "{name} {value}: {}", self.message),
            Some(Argument { name, value: None }) => write!(f, "{name}: {}", self.message),
            None => f.write_str(&self.message),
        }
    }
}

impl std::error::Error for Error {}
