//! [`PictureError`]: why there is no picture; and files that are written whole.

use crate::base::error::Error;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Possible widths of pictures, pixels.
pub const WIDTHS: RangeInclusive<u32> = 320..=4096;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The recording does not hold what a picture needs.
    #[error("the recording cannot be drawn: {0}")]
    Recording(&'static str),
    /// The picture would be too small, too large or have no frame.
    #[error("a picture of {width} × {height} pixels is not possible; expected a width of {} … {} pixels",
            WIDTHS.start(), WIDTHS.end())]
    Size {
        /// Pixels asked for.
        width: u32,
        /// Pixels asked for, or that follow from the width.
        height: u32,
    },
    /// A figure would have no pixels or too many.
    #[error("a figure of {width} × {height} pixels is not possible; expected 1 … 16000 on each side")]
    Figure {
        /// Pixels asked for.
        width: f64,
        /// Pixels that follow.
        height: f64,
    },
    /// The encoder refused.
    #[error("the picture could not be encoded: {0}")]
    Encode(String),
    /// The system has no threads left.
    #[error(transparent)]
    Threads(#[from] Error),
    /// The file could not be written.
    #[error("could not write {}: {source}; check that the folder exists and is writable", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
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
            error => Error::other(error.to_string()),
        }
    }
}

/// Writes a file in one go: into a temporary file of the same folder, then renamed, so that a
/// reader sees the whole file or the old one.
///
/// # Errors
/// [`PictureError::Write`] with the path.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), PictureError> {
    crate::base::files::write_atomically(path, bytes)
        .map_err(|source| PictureError::Write { path: path.to_path_buf(), source })
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
        let error = write_whole(&folder.path().join("none/picture"), b"").unwrap_err().to_string();
        assert!(error.contains("none") && error.contains("folder"), "{error}");
    }
}
