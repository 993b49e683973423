//! [`PictureError`]: the reasons why a picture cannot be made; and atomic writing of files.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::stop::Stopped;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// The widths that a picture can have, pixels.
pub(crate) const WIDTHS: RangeInclusive<u32> = 320..=4096;

/// A reason why a picture cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The recording lacks something that a picture needs.
    #[error("the recording cannot be drawn: {0}")]
    Recording(&'static str),
    /// The picture would be too small or too large, or have no frame.
    #[error("a picture of {width} × {height} pixels is not possible; expected a width of {} … {} pixels",
            WIDTHS.start(), WIDTHS.end())]
    Size {
        /// The requested width, pixels.
        width: u32,
        /// The requested height, or the height that follows from the width, pixels.
        height: u32,
    },
    /// Images of one rollout cannot be shown side by side.
    #[error("side by side needs a fresh rollout for each image (protocol.rollout = \"fresh\")")]
    OneRollout,
    /// Pictures side by side would be too large together.
    #[error(
        "{width} × {height} pixels side by side are too many; expected at most 4096 on each side"
    )]
    Large {
        /// The width together, pixels.
        width: u32,
        /// The height together, pixels.
        height: u32,
    },
    /// A figure would have no pixels or too many.
    #[error(
        "a figure of {width} × {height} pixels is not possible; expected 1 … 16000 on each side"
    )]
    Figure {
        /// The requested width, pixels.
        width: f64,
        /// The resulting height, pixels.
        height: f64,
    },
    /// The encoder refused.
    #[error("the picture could not be encoded: {0}")]
    Encode(String),
    /// The encoder of films could not be started.
    #[error("{program} cannot be started: {source}")]
    NoEncoder {
        /// Its name or path.
        program: String,
        /// The error from the operating system.
        source: std::io::Error,
    },
    /// The encoder of films failed.
    #[error("{program} failed: {how}")]
    Encoder {
        /// Its name or path.
        program: String,
        /// Its exit status, and the last line of what it said.
        how: String,
    },
    /// The encoder of films took no more pictures, though it did not fail.
    #[error("the encoder of films ended early: {0}")]
    Pipe(std::io::Error),
    /// Drawing was stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The system has no threads left.
    #[error(transparent)]
    Threads(#[from] Error),
    /// The file could not be written.
    #[error("could not write {}: {source}; check that the folder exists and is writable", path.display())]
    Write {
        /// The path of the file.
        path: PathBuf,
        /// The error from the operating system.
        source: std::io::Error,
    },
}

impl From<PictureError> for Error {
    fn from(error: PictureError) -> Self {
        match error {
            PictureError::Write { path, source } => {
                let error = Error::writing(&path, &source);
                match error.remedies.is_empty() {
                    true => error.advice("check that the folder exists and is writable"),
                    false => error,
                }
            }
            PictureError::Threads(error) => error,
            PictureError::Stopped(stopped) => stopped.into(),
            PictureError::NoEncoder { .. } => Error::other(error.to_string())
                .advice("install ffmpeg, or name it by MORPHCOG_FFMPEG")
                .remedy(Remedy::WriteFrames),
            PictureError::Encoder { .. } | PictureError::Pipe(_) => {
                Error::other(error.to_string()).remedy(Remedy::WriteFrames)
            }
            error => Error::other(error.to_string()),
        }
    }
}

/// Writes a file through a temporary one beside it: readers find the whole file or the old one.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), PictureError> {
    crate::base::files::write_atomically(path, bytes).map_err(|source| PictureError::Write {
        path: path.to_path_buf(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_replaced_whole_and_leave_no_rest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture");
        write_whole(&path, b"old").unwrap();
        write_whole(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let error = write_whole(&folder.path().join("none/picture"), b"")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("none") && error.contains("folder"),
            "{error}"
        );
    }
}
