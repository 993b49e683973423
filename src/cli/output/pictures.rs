//! The output of `morphcog replay`: files, or a view in the terminal.

use crate::base::error::Error;
use crate::base::number;
use crate::cli::output::console::Console;
use crate::cli::output::player;
use crate::commands::replay::Replay;
use crate::draw::error::PictureError;
use crate::draw::film::Film;
use crate::draw::scene::Look;
use crate::draw::walk::Walk;
use crate::draw::{gif, html, raster};
use crate::shipped;
use crate::store::folder;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Gif,
    Html,
    /// The last frame as PNG.
    Png,
    Terminal,
}

impl Format {
    const ALL: [(Format, &str); 4] = [
        (Format::Gif, "gif"),
        (Format::Html, "html"),
        (Format::Png, "png"),
        (Format::Terminal, "terminal"),
    ];
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Format::ALL
            .iter()
            .filter(|(format, _)| format == self)
            .try_for_each(|(_, name)| f.write_str(name))
    }
}

impl FromStr for Format {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let found = Format::ALL
            .iter()
            .find(|(_, name)| *name == text.to_lowercase());
        found
            .map(|(format, _)| *format)
            .ok_or_else(|| "expected gif, html, png or terminal".to_string())
    }
}

/// Returns the requested formats, or by default an animation and a page.
fn or_default(asked: &[Format]) -> &[Format] {
    if asked.is_empty() {
        &[Format::Gif, Format::Html]
    } else {
        asked
    }
}

/// The pictures to make, and their files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PicturesWanted {
    /// The formats with their files (unused for the terminal).
    pub(crate) files: Vec<(Format, PathBuf)>,
    /// The width of GIF and PNG, pixels.
    pub(crate) width: u32,
    /// The control steps from one frame of the GIF to the next.
    pub(crate) every: usize,
    /// The frames of the GIF per second.
    pub(crate) fps: u32,
    /// The look of the world in GIF and PNG.
    pub(crate) look: Look,
    /// True if GIF and PNG show all images at once.
    pub(crate) side_by_side: bool,
}

impl Default for PicturesWanted {
    fn default() -> Self {
        PicturesWanted {
            files: Vec::new(),
            width: 480,
            every: 1,
            fps: 50,
            look: Look::Plain,
            side_by_side: false,
        }
    }
}

impl PicturesWanted {
    /// Chooses `replay-<name>.<format>` in a folder.
    pub(crate) fn beside(folder: &Path, name: &str, formats: &[Format]) -> Self {
        let file = |&format: &Format| (format, folder.join(format!("replay-{name}.{format}")));
        PicturesWanted {
            files: or_default(formats).iter().map(file).collect(),
            ..PicturesWanted::default()
        }
    }

    /// Takes the format from a file's extension; without one, chooses a file for each of `formats`.
    pub(crate) fn named(path: &Path, formats: &[Format]) -> Result<Self, Error> {
        folder::check_is_file_path(path)?;
        let files = match path
            .extension()
            .map(|ending| ending.to_string_lossy().into_owned())
        {
            None => or_default(formats)
                .iter()
                .map(|format| (*format, path.with_extension(format.to_string())))
                .collect(),
            Some(ending) => {
                let format = Format::from_str(&ending)
                    .ok()
                    .filter(|format| *format != Format::Terminal);
                let format = format.ok_or_else(|| {
                    Error::usage(format!(
                        "{}: expected a file name that ends in .gif, .html or .png",
                        path.display()
                    ))
                })?;
                if let Some(other) = formats.iter().find(|asked| **asked != format) {
                    let text = format!(
                        "--format {other}: expected {format}, as --out {} says",
                        path.display()
                    );
                    return Err(Error::usage(text));
                }
                vec![(format, path.to_path_buf())]
            }
        };
        files
            .iter()
            .filter(|(format, _)| *format != Format::Terminal)
            .try_for_each(|(_, path)| folder::writable(path))?;
        Ok(PicturesWanted {
            files,
            ..PicturesWanted::default()
        })
    }
}

impl PicturesWanted {
    /// Returns the formats of the pictures.
    pub(crate) fn formats(&self) -> Vec<Format> {
        self.files.iter().map(|(format, _)| *format).collect()
    }
}

/// Checks that one of some formats (none: the default ones) can show rollouts side by side.
pub(crate) fn check_side_by_side(formats: &[Format]) -> Result<(), Error> {
    let can = |format: &Format| matches!(format, Format::Gif | Format::Png);
    match or_default(formats).iter().any(can) {
        true => Ok(()),
        false => {
            let text = "it is for GIF and PNG; the page has a button for it";
            Err(Error::usage(text.to_string()).about("side_by_side"))
        }
    }
}

/// Returns the default folder of a robot's pictures: that of its run.json, or, for a named run,
/// the present one.
pub(crate) fn folder(archive: &Path) -> PathBuf {
    match shipped::is_named(archive) {
        true => PathBuf::new(),
        false => archive.parent().unwrap_or(Path::new("")).to_path_buf(),
    }
}

/// Makes the pictures, reports their files and the robot's walk, and returns the files.
pub(crate) fn make(
    console: &Console,
    replay: &Replay,
    wanted: &PicturesWanted,
) -> Result<Vec<PathBuf>, Error> {
    let made = write(console, replay, wanted)?;
    let recording = &replay.recording;
    for phase in &recording.phases {
        let way = if phase.displacement < 0.0 {
            "left"
        } else {
            "right"
        };
        console.line(&format!(
            "{}: sees {}, moves {} voxel lengths {way}",
            recording.robot,
            phase.seen.label,
            number::fixed(phase.displacement.abs(), 2)
        ));
    }
    if recording.unstable {
        console.warning("the simulation became unstable and ended early");
    }
    made.iter()
        .for_each(|path| console.line_about(path, &format!("wrote {}", path.display())));
    Ok(made)
}

/// Makes the pictures, the view in the terminal among them, and returns the files.
pub(crate) fn write(
    console: &Console,
    replay: &Replay,
    wanted: &PicturesWanted,
) -> Result<Vec<PathBuf>, Error> {
    let failed = |error: PictureError| match error {
        PictureError::Size { .. } | PictureError::Large { .. } => {
            Error::usage(error.to_string()).about("width")
        }
        PictureError::OneRollout => Error::usage(error.to_string()).about("side_by_side"),
        error => error.into(),
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
                    fps: f64::from(wanted.fps),
                    look: wanted.look,
                    side_by_side: wanted.side_by_side,
                    ..gif::GifOptions::default()
                };
                gif::write(path, recording, &options).map_err(failed)?;
            }
            Format::Html => html::write(path, recording, &title, &replay.about).map_err(failed)?,
            Format::Png => {
                let walk = Walk::new(recording).map_err(failed)?;
                let film = Film::new(&walk, wanted.width, wanted.look, wanted.side_by_side);
                let film = film.map_err(failed)?;
                let moments = film.moments(usize::MAX);
                let last = moments.last().expect("a walk has a frame");
                let picture = film.picture(last).map_err(failed)?;
                raster::write_png(path, &picture).map_err(failed)?;
            }
            Format::Terminal => {
                player::play(console, &Walk::new(recording).map_err(failed)?)?;
                continue;
            }
        }
        made.push(path.clone());
    }
    Ok(made)
}
