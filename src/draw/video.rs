//! Films of recordings: MP4 and WebM by ffmpeg, which most people who edit films have, and sequences
//! of pictures for any other program.

use crate::base::files;
use crate::base::shell::{in_shell, quoted};
use crate::base::stop::check;
use crate::base::threads::in_pool;
use crate::draw::error::PictureError;
use crate::draw::film::{Film, FilmOptions};
use crate::draw::raster::png_bytes;
use crate::draw::walk::Walk;
use crate::task::recording::Recording;
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use tiny_skia::Pixmap;

/// The environment variable that names the encoder.
pub(crate) const VARIABLE: &str = "MORPHCOG_FFMPEG";

/// The formats of films.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Container {
    Mp4,
    Webm,
}

impl Container {
    /// Returns the options of ffmpeg that choose the codec and its quality, visibly without loss.
    fn codec(self) -> &'static [&'static str] {
        match self {
            Container::Mp4 => &["-c:v", "libx264", "-crf", "18", "-movflags", "+faststart"],
            Container::Webm => &[
                "-c:v",
                "libvpx-vp9",
                "-crf",
                "24",
                "-b:v",
                "0",
                "-row-mt",
                "1",
            ],
        }
    }

    fn ending(self) -> &'static str {
        match self {
            Container::Mp4 => "mp4",
            Container::Webm => "webm",
        }
    }
}

/// Sides become even and colours those of television: every player shows such films.
const FILTER: &str =
    "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white,scale=out_color_matrix=bt709:out_range=tv";
const COLOURS: [&str; 10] = [
    "-pix_fmt",
    "yuv420p",
    "-colorspace",
    "bt709",
    "-color_primaries",
    "bt709",
    "-color_trc",
    "bt709",
    "-color_range",
    "tv",
];

/// Writes a recording as a film, unless `stop` is set in the meantime.
///
/// # Errors
/// Returns an error if the recording cannot be drawn, the encoder cannot be started or fails, the
/// file cannot be written, or `stop` was set.
pub(crate) fn write(
    path: &Path,
    container: Container,
    recording: &Recording,
    options: &FilmOptions,
    stop: &AtomicBool,
) -> Result<(), PictureError> {
    in_pool(|| encode(path, container, recording, options, stop))?
}

fn encode(
    path: &Path,
    container: Container,
    recording: &Recording,
    options: &FilmOptions,
    stop: &AtomicBool,
) -> Result<(), PictureError> {
    let walk = Walk::new(recording)?;
    let film = Film::of(&walk, options)?.until(stop);
    let program = std::env::var_os(VARIABLE).filter(|name| !name.is_empty());
    let program = program.unwrap_or_else(|| OsString::from("ffmpeg"));
    // The encoder writes elsewhere: whatever happens to it, no half of a film is left beside others.
    let write = |source| PictureError::Write {
        path: path.to_path_buf(),
        source,
    };
    let folder = tempfile::tempdir().map_err(write)?;
    let made = folder
        .path()
        .join("film")
        .with_extension(container.ending());
    // What it says goes to a file: a pipe that nobody reads would stop it.
    let said = folder.path().join("said");
    let [width, height] = film.size();
    let mut command = Command::new(&program);
    command
        .args(["-nostdin", "-hide_banner", "-loglevel", "error", "-y"])
        .args(["-f", "rawvideo", "-pixel_format", "rgb24"])
        .args(["-video_size", &format!("{width}x{height}")])
        .args(["-framerate", &options.fps.to_string(), "-i", "pipe:0"])
        .args(["-an", "-vf", FILTER])
        .args(container.codec())
        .args(COLOURS)
        // Neither versions nor times in the file: the same film is the same bytes.
        .args([
            "-fflags",
            "+bitexact",
            "-flags:v",
            "+bitexact",
            "-map_metadata",
            "-1",
        ])
        .arg(&made)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&said).map_err(write)?);
    let mut encoder = command.spawn().map_err(|source| PictureError::NoEncoder {
        program: program.to_string_lossy().into_owned(),
        source,
    })?;
    let mut input = encoder.stdin.take().expect("its input is a pipe");
    let shown = frames(&film, options, stop, |picture| {
        let rgb: Vec<u8> = picture
            .data()
            .chunks_exact(4)
            .flat_map(|p| [p[0], p[1], p[2]])
            .collect();
        input.write_all(&rgb).map_err(PictureError::Pipe)
    });
    drop(input);
    // Ctrl-C in a terminal reaches the encoder, too, which may fail by it.
    let stopped = check(stop);
    if stopped.is_err() {
        // It has ended if it cannot be killed.
        let _ = encoder.kill();
    }
    let ended = encoder.wait();
    stopped?;
    let failed = |how: String| PictureError::Encoder {
        program: program.to_string_lossy().into_owned(),
        how,
    };
    match ended {
        // If it ends before the film does, that is the reason, not its closed pipe.
        Ok(status) if !status.success() => {
            let said = files::read_bytes(&said).unwrap_or_default();
            let said = String::from_utf8_lossy(&said);
            let last = said.lines().map(str::trim).rfind(|line| !line.is_empty());
            return Err(failed(match last {
                Some(last) => format!("{status}: {last}"),
                None => status.to_string(),
            }));
        }
        Ok(_) => shown?,
        Err(error) => return Err(failed(error.to_string())),
    }
    let mut made =
        files::open_file(&made).map_err(|error| failed(format!("it wrote no film: {error}")))?;
    files::write_whole(path, |file| io::copy(&mut made, file).map(drop)).map_err(write)
}

/// Calls `show` with every picture of the film, in order, at a constant rate: the last of a phase
/// comes as often as it is to be held. Ends soon after `stop` is set.
fn frames(
    film: &Film,
    options: &FilmOptions,
    stop: &AtomicBool,
    mut show: impl FnMut(&Pixmap) -> Result<(), PictureError>,
) -> Result<(), PictureError> {
    let held = (options.hold * options.fps).round().clamp(1.0, 3600.0) as usize;
    film.each(
        &film.moments(options.every),
        |picture| picture,
        |moment, picture| {
            let times = if moment.is_last { held } else { 1 };
            (0..times).try_for_each(|_| {
                check(stop)?;
                show(picture)
            })
        },
    )
}

/// The name of a numbered picture, as ffmpeg and others write it.
const NUMBERED: &str = "frame-%05d.png";

/// Writes every picture of a film into a new folder, numbered from 1. The folder appears when it is
/// complete.
///
/// # Errors
/// Returns an error if the recording cannot be drawn, the folder cannot be written, or `stop` was
/// set in the meantime.
pub(crate) fn write_frames(
    folder: &Path,
    recording: &Recording,
    options: &FilmOptions,
    stop: &AtomicBool,
) -> Result<(), PictureError> {
    let failed = |source| PictureError::Write {
        path: folder.to_path_buf(),
        source,
    };
    let above = match folder.parent() {
        Some(above) if !above.as_os_str().is_empty() => above,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(above).map_err(failed)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".frames.").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Those of any new folder.
        builder.permissions(std::fs::Permissions::from_mode(0o777));
    }
    let temporary = builder.tempdir_in(above).map_err(failed)?;
    in_pool(|| {
        let walk = Walk::new(recording)?;
        let film = Film::of(&walk, options)?.until(stop);
        let mut number = 0;
        frames(&film, options, stop, |picture| {
            number += 1;
            let path = temporary.path().join(format!("frame-{number:05}.png"));
            std::fs::write(path, png_bytes(picture)?).map_err(failed)
        })
    })??;
    // An empty folder of that name may be there; any other is in the way.
    match std::fs::remove_dir(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(failed(error)),
        _ => std::fs::rename(temporary.path(), folder).map_err(failed),
    }
}

/// Returns the command that makes a film of numbered pictures.
pub(crate) fn command(folder: &Path, fps: f64) -> String {
    // A percent sign in a folder's name would be a number's place.
    let named = folder
        .to_str()
        .map(|name| PathBuf::from(name.replace('%', "%%")));
    let input = in_shell(&named.unwrap_or_else(|| folder.to_path_buf()).join(NUMBERED));
    let filter = quoted(FILTER);
    format!(
        "ffmpeg -framerate {fps} -i {input} -vf {filter} -c:v libx264 -crf 18 -pix_fmt yuv420p film.mp4"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_for_single_pictures_can_be_pasted_whatever_their_folder_is_called() {
        let input = |folder: &str| {
            let line = command(Path::new(folder), 50.0);
            let (_, rest) = line.split_once(" -i ").unwrap();
            rest.split_once(" -vf ").unwrap().0.to_string()
        };
        assert_eq!(input("frames"), "frames/frame-%05d.png");
        assert_eq!(input("a 5%/"), "'a 5%%/frame-%05d.png'");
        assert_eq!(input("-x"), "./-x/frame-%05d.png");
        assert!(command(Path::new("frames"), 12.0).starts_with("ffmpeg -framerate 12 "));
    }
}
