//! Floor 5: pictures and the terminal. Recordings of lives become images, animations, pages and text here.
//!
//! A [`Walk`] is a checked [`Recording`](crate::task::recording::Recording); a [`Stage`] decides what part of the
//! world a picture shows; `scene` and `panel` make drawing primitives of one frame; `raster` paints them. On top of
//! these stand the animated GIF, the self-contained HTML page and the view in a terminal. Figures for print are vectors and
//! stand apart, in [`plot`].
//! these stand the animated GIF, the self-contained HTML page and the view in a terminal. `serve` is a page of its own,
//! over HTTP.

pub mod bar;
pub mod colour;
pub mod console;
pub mod figures;
pub mod font;
pub mod gif;
pub mod html;
pub mod networks;
pub mod palette;
pub mod panel;
pub mod pictures;
pub mod player;
pub mod plot;
pub mod progress;
pub mod raster;
pub mod report;
pub mod reporters;
pub mod scene;
pub mod serve;
pub mod sheet;
pub mod stage;
pub mod summary;
pub mod table;
pub mod terminal;
pub mod verdicts;
pub mod walk;

pub use stage::Stage;
pub use walk::Walk;

use crate::run::Error;
use std::path::{Path, PathBuf};

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The recording does not hold what a picture needs.
    #[error("the recording cannot be drawn: {0}")]
    Recording(&'static str),
    /// The picture would be too small, too large or have no frame.
    #[error("a picture of {width} × {height} pixels is not possible; expected a width of {} … {} pixels",
            stage::WIDTHS.start(), stage::WIDTHS.end())]
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
                match error.hint {
                    Some(_) => error,
                    None => error.hint("check that the folder exists and is writable".to_string()),
                }
            }
            error => Error::other(error.to_string()),
        }
    }
}

/// Writes a file in one go: into a temporary file of the same folder, then renamed, so that a reader sees the whole
/// file or the old one.
///
/// # Errors
/// [`PictureError::Write`] with the path.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), PictureError> {
    crate::base::files::write_atomically(path, bytes)
        .map_err(|source| PictureError::Write { path: path.to_path_buf(), source })
}

/// For tests: the simulation of a body (text form) that is shown `phases` images, dark and bright ones by turns, each for
/// `steps` control steps.
#[cfg(test)]
fn simulated(body: &str, phases: usize, steps: u32, fresh: bool) -> crate::task::recording::Recording {
    use crate::body::Body;
    use crate::{base::Grid, sim::Physics, task::protocol::Protocol, task::rollout::record};
    let body: Body = body.parse().expect("tests name bodies");
    let image = |phase: usize| {
        let pixel =
            |row: usize, column: usize| if (row + column + phase).is_multiple_of(3) { 1.0 } else { 0.0 };
        let stimulus = Grid::from_fn(body.height(), body.width(), pixel);
        (format!("{} (train {})", phase % 2, 2 * phase + 1), stimulus)
    };
    let images: Vec<(String, Grid<f64>)> = (0..phases).map(image).collect();
    let protocol = Protocol { control_steps: steps, ..Protocol::default() };
    record("ROBOT", &body, &Physics::default(), &protocol, fresh, &images)
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
