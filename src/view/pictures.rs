//! What `morphcog replay` makes of a recording: files, or a view in the terminal.

use super::console::Console;
use super::{PictureError, Stage, Walk, gif, html, raster, terminal};
use crate::run::replay::Replay;
use crate::run::{Error, folder, gallery};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

/// A way to show a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Animated GIF.
    Gif,
    /// Self-contained page for the browser.
    Html,
    /// The last frame as PNG.
    Png,
    /// Played in the terminal.
    Terminal,
}

impl Format {
    const ALL: [(Format, &str); 4] =
        [(Format::Gif, "gif"), (Format::Html, "html"), (Format::Png, "png"), (Format::Terminal, "terminal")];
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Format::ALL.iter().filter(|(format, _)| format == self).try_for_each(|(_, name)| f.write_str(name))
    }
}

impl FromStr for Format {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let found = Format::ALL.iter().find(|(_, name)| *name == text.to_lowercase());
        found.map(|(format, _)| *format).ok_or_else(|| "expected gif, html, png or terminal".to_string())
    }
}

/// What to make, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Formats with their files (none for the terminal).
    pub files: Vec<(Format, PathBuf)>,
    /// Width of GIF and PNG, pixels.
    pub width: u32,
    /// Control steps from one frame of the GIF to the next.
    pub every: usize,
}

const WIDTH: u32 = 480;

impl Wanted {
    /// `replay-<name>.<format>` in a folder.
    pub fn beside(folder: &Path, name: &str, formats: &[Format]) -> Self {
        let file = |&format: &Format| (format, folder.join(format!("replay-{name}.{format}")));
        Wanted { files: formats.iter().map(file).collect(), width: WIDTH, every: EVERY }
    }

    /// A file whose ending says the format; without an ending, one file for each of `formats`.
    ///
    /// # Errors
    /// If the ending is none of the formats'.
    pub fn named(path: &Path, formats: &[Format]) -> Result<Self, Error> {
        let files = match path.extension().map(|ending| ending.to_string_lossy().into_owned()) {
            None => formats.iter().map(|format| (*format, path.with_extension(format.to_string()))).collect(),
            Some(ending) => {
                let format = Format::from_str(&ending).ok().filter(|format| *format != Format::Terminal);
                let format = format.ok_or_else(|| {
                    Error::usage(format!(
                        "{}: expected a file name that ends in .gif, .html or .png",
                        path.display()
                    ))
                })?;
                vec![(format, path.to_path_buf())]
            }
        };
        Ok(Wanted { files, width: WIDTH, every: EVERY })
    }
}

/// Where the pictures of a robot go if nobody says: beside its run.json; for a published robot, here.
///
/// # Errors
/// If there is no run.
pub fn folder(archive: Option<&Path>, robot: &str) -> Result<PathBuf, Error> {
    let archive = match archive {
        Some(path) => path.to_path_buf(),
        None if gallery::find(robot)?.is_some() => return Ok(PathBuf::new()),
        None => folder::newest_run()?,
    };
    Ok(archive.parent().unwrap_or(Path::new("")).to_path_buf())
}

/// Makes the pictures, says where they are and what the robot did; the files made.
///
/// # Errors
/// If a picture cannot be made or written.
pub fn make(console: &Console, replay: &Replay, wanted: &Wanted) -> Result<Vec<PathBuf>, Error> {
    let failed = |error: PictureError| match error {
        PictureError::Size { .. } => Error::usage(format!("--width: {error}")),
        error => Error::other(error.to_string()),
    };
    let mut made = Vec::new();
    let recording = &replay.recording;
    let title = format!("morphcog: robot {}", recording.robot);
    for (format, path) in &wanted.files {
        match format {
            Format::Gif => {
                let options = gif::GifOptions {
                    width: wanted.width,
                    every: wanted.every,
                    ..gif::GifOptions::default()
                };
                gif::write(path, recording, &options).map_err(failed)?;
            }
            Format::Html => html::write(path, recording, &title, &replay.about).map_err(failed)?,
            Format::Png => {
                let walk = Walk::new(recording).map_err(failed)?;
                let stage = Stage::new(&walk, wanted.width).map_err(failed)?;
                let picture = raster::picture(&walk, walk.len() - 1, &stage).map_err(failed)?;
                raster::write_png(path, &picture).map_err(failed)?;
            }
            Format::Terminal => {
                play(console, &Walk::new(recording).map_err(failed)?);
                continue;
            }
        }
        made.push(path.clone());
    }
    for phase in &recording.phases {
        let way = if phase.displacement < 0.0 { "left" } else { "right" };
        console.line(&format!(
            "{}: sees {}, moves {:.2} voxel lengths {way}",
            recording.robot,
            phase.label,
            phase.displacement.abs()
        ));
    }
    if recording.unstable {
        console.warning("this life ended early: the simulation became unstable");
    }
    made.iter().for_each(|path| console.line(&format!("wrote {}", path.display())));
    Ok(made)
}

/// Columns and rows of the view in the terminal: what fits the smallest usual one.
const VIEW: (usize, usize) = (78, 22);
/// Control steps between two pictures, if nobody says; at [`FRAME`] each that is the robot's own time.
const EVERY: usize = 2;
const FRAME: Duration = Duration::from_millis(40);

/// Plays a recording in the terminal, at the robot's own speed; elsewhere only its last frame.
fn play(console: &Console, walk: &Walk) {
    let picture = |frame| terminal::frame(walk, frame, VIEW.0, VIEW.1, console.has_colour());
    let Some(mut live) = console.live() else {
        return console.line(&picture(walk.len() - 1));
    };
    for frame in (0..walk.len()).step_by(EVERY) {
        if console.is_closed() {
            return;
        }
        live.show(&picture(frame));
        std::thread::sleep(FRAME);
    }
}
