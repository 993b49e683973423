//! The output of `morphcog replay`: files, or a view in the terminal.

use crate::base::error::Error;
use crate::base::number;
use crate::base::remedy::Remedy;
use crate::base::stop::check;
use crate::cli::output::console::Console;
use crate::cli::output::player;
use crate::commands::replay::Replay;
use crate::draw::error::PictureError;
use crate::draw::film::{Film, FilmOptions};
use crate::draw::scene::Look;
use crate::draw::video::Container;
use crate::draw::walk::Walk;
use crate::draw::{gif, html, raster, video};
use crate::shipped;
use crate::store::folder;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::AtomicBool;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Gif,
    Html,
    /// The last frame as PNG.
    Png,
    /// A film for talks and players.
    Mp4,
    /// A film for pages.
    Webm,
    /// A folder with each picture of a film as PNG.
    Frames,
    Terminal,
}

impl Format {
    pub(crate) const ALL: [(Format, &str); 7] = [
        (Format::Gif, "gif"),
        (Format::Html, "html"),
        (Format::Png, "png"),
        (Format::Mp4, "mp4"),
        (Format::Webm, "webm"),
        (Format::Frames, "frames"),
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
            .ok_or_else(|| "expected gif, html, png, mp4, webm, frames or terminal".to_string())
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
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct PicturesWanted {
    /// The formats with their files (unused for the terminal).
    pub(crate) files: Vec<(Format, PathBuf)>,
    /// The width of pictures, pixels; by default 480, and 1280 of films.
    pub(crate) width: Option<u32>,
    /// The control steps from one frame to the next.
    pub(crate) every: Option<usize>,
    /// The frames per second.
    pub(crate) fps: Option<u32>,
    /// The look of the world.
    pub(crate) look: Look,
    /// True if pictures show all images at once.
    pub(crate) side_by_side: bool,
}

impl PicturesWanted {
    /// Returns how a format moves. A GIF has half of the frames unless the speed is chosen: it is
    /// large, and its viewers are slow.
    fn film(&self, format: Format) -> FilmOptions {
        let (every, fps) = match (self.every, self.fps) {
            (None, None) if format == Format::Gif => (2, 25),
            (every, fps) => (every.unwrap_or(1), fps.unwrap_or(50)),
        };
        let width = match format {
            Format::Mp4 | Format::Webm | Format::Frames => 1280,
            _ => 480,
        };
        FilmOptions {
            width: self.width.unwrap_or(width),
            every,
            fps: f64::from(fps),
            look: self.look,
            side_by_side: self.side_by_side,
            ..FilmOptions::default()
        }
    }

    /// Chooses `replay-<name>.<format>` in a folder.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written there.
    pub(crate) fn beside(folder: &Path, name: &str, formats: &[Format]) -> Result<Self, Error> {
        let file = |&format: &Format| {
            let ending = if format == Format::Frames { '-' } else { '.' };
            (
                format,
                folder.join(format!("replay-{name}{ending}{format}")),
            )
        };
        PicturesWanted::of(or_default(formats).iter().map(file).collect())
    }

    /// Returns the picture or film that a file's ending asks for, or the folder of a film's frames;
    /// none of any other file.
    ///
    /// # Errors
    /// Returns an error if it cannot be written.
    pub(crate) fn by_ending(path: &Path) -> Result<Option<Self>, Error> {
        let is_folder = folder::check_is_file_path(path).is_err();
        let ending = path.extension().map(|ending| ending.to_string_lossy());
        let is_picture = ending.is_some_and(|ending| Format::from_str(&ending).is_ok());
        match is_folder || is_picture {
            true => PicturesWanted::named(path, &[]).map(Some),
            false => Ok(None),
        }
    }

    /// Checks that files can be written, before hours of simulation.
    fn of(files: Vec<(Format, PathBuf)>) -> Result<Self, Error> {
        for (format, path) in &files {
            match format {
                Format::Terminal => {}
                Format::Frames => vacant(path)?,
                _ => folder::writable(path)?,
            }
        }
        Ok(PicturesWanted {
            files,
            ..PicturesWanted::default()
        })
    }

    /// Takes the format from a file's extension; without one, chooses a file for each of `formats`. A
    /// folder is for the frames of a film.
    pub(crate) fn named(path: &Path, formats: &[Format]) -> Result<Self, Error> {
        let is_folder = folder::check_is_file_path(path).is_err();
        if formats == [Format::Frames] || (formats.is_empty() && is_folder) {
            return PicturesWanted::of(vec![(Format::Frames, path.to_path_buf())]);
        }
        folder::check_is_file_path(path)?;
        let files = match path
            .extension()
            .map(|ending| ending.to_string_lossy().into_owned())
        {
            None => or_default(formats)
                .iter()
                .map(|format| match format {
                    Format::Frames => (*format, with_suffix(path, "-frames")),
                    format => (*format, path.with_extension(format.to_string())),
                })
                .collect(),
            Some(ending) => {
                let format = Format::from_str(&ending)
                    .ok()
                    .filter(|format| !matches!(format, Format::Terminal | Format::Frames));
                let format = format.ok_or_else(|| {
                    Error::usage(format!(
                        "{}: expected a file name that ends in .gif, .html, .png, .mp4 or .webm",
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
        PicturesWanted::of(files)
    }
}

/// Checks that frames can be written as a folder: that there is none, or an empty one.
fn vacant(folder: &Path) -> Result<(), Error> {
    let is_vacant = match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) => error.kind() == io::ErrorKind::NotFound,
    };
    match is_vacant {
        true => Ok(()),
        false => {
            let text = format!(
                "{}: expected a new folder, or an empty one",
                folder.display()
            );
            Err(Error::occupied(text).remedy(Remedy::ChooseOut))
        }
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
    let can = |format: &Format| !matches!(format, Format::Html | Format::Terminal);
    match or_default(formats).iter().any(can) {
        true => Ok(()),
        false => {
            let text = "it is for pictures and films; the page has a button for it";
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
    stop: &AtomicBool,
) -> Result<Vec<PathBuf>, Error> {
    let made = write(console, replay, wanted, stop)?;
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
    for (_, folder) in wanted
        .files
        .iter()
        .filter(|(format, _)| *format == Format::Frames)
    {
        let line = video::command(folder, wanted.film(Format::Frames).fps);
        console.info(&format!("to make a film of them: {line}"));
    }
    Ok(made)
}

/// Makes the pictures, the view in the terminal among them, and returns the files. If `stop` is set,
/// the file that is being made is left out.
pub(crate) fn write(
    console: &Console,
    replay: &Replay,
    wanted: &PicturesWanted,
    stop: &AtomicBool,
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
        check(stop)?;
        let options = wanted.film(*format);
        match format {
            Format::Gif => gif::write(path, recording, &options, stop).map_err(failed)?,
            Format::Mp4 => {
                video::write(path, Container::Mp4, recording, &options, stop).map_err(failed)?;
            }
            Format::Webm => {
                video::write(path, Container::Webm, recording, &options, stop).map_err(failed)?;
            }
            Format::Frames => {
                video::write_frames(path, recording, &options, stop).map_err(failed)?;
            }
            Format::Html => html::write(path, recording, &title, &replay.about).map_err(failed)?,
            Format::Png => {
                let walk = Walk::new(recording).map_err(failed)?;
                let film = Film::of(&walk, &options).map_err(failed)?;
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

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}
