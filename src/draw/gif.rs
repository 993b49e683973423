//! Animated GIFs of recordings, with one small palette. Each frame stores only the pixels that changed
//! visibly, with colours that make it short.

use crate::base::threads::in_pool;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::error::{PictureError, write_whole};
use crate::draw::film::{Film, FilmOptions, Moment};
use crate::draw::palette::Palette;
use crate::draw::panel::present;
use crate::draw::scene::Look;
use crate::draw::walk::Walk;
use crate::draw::{lzw, palette};
use crate::task::recording::Recording;
use ::gif::{DisposalMethod, Encoder, Frame, Repeat};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use tiny_skia::Pixmap;

/// The number of frames sampled for the palette.
const SAMPLES: usize = 24;
/// Shades of a material in the palette: few enough that voxels keep their colour between frames.
const SHADES: u32 = 5;
/// Most colours of an animation, one of them for "unchanged": with fewer, indices take fewer bits.
const COLOURS: usize = 64;
/// A pixel may have a colour that is at most so far off (Euclidean, 255 per channel) where that makes
/// the file smaller. Larger values make smaller files and speckled voxels.
const TOLERANCE: u32 = 38;

/// Writes a recording as an animated GIF that loops for ever.
pub(crate) fn write(
    path: &Path,
    recording: &Recording,
    options: &FilmOptions,
    stop: &AtomicBool,
) -> Result<(), PictureError> {
    write_whole(path, &encode(recording, options, stop)?)
}

/// Encodes a recording as an animated GIF that loops for ever.
///
/// # Errors
/// Returns a [`PictureError`] if the recording cannot be drawn with these options, or if `stop` was
/// set in the meantime.
pub fn encode(
    recording: &Recording,
    options: &FilmOptions,
    stop: &AtomicBool,
) -> Result<Vec<u8>, PictureError> {
    in_pool(|| encoded(recording, options, stop))?
}

fn encoded(
    recording: &Recording,
    options: &FilmOptions,
    stop: &AtomicBool,
) -> Result<Vec<u8>, PictureError> {
    let walk = Walk::new(recording)?;
    let film = Film::of(&walk, options)?.crisp().until(stop);
    let moments = film.moments(options.every);
    let palette = palette(&film, &moments, COLOURS - 1)?;
    let tolerance = Tolerance::of(&palette);
    // The last entry is never drawn: its index means "unchanged".
    let colours = [palette.colours(), &[[0, 0, 0]]].concat().concat();
    let failed = |e: ::gif::EncodingError| PictureError::Encode(e.to_string());
    let [width, height] = film.size().map(|side| side as u16);
    let mut encoder = Encoder::new(Vec::new(), width, height, &colours).map_err(failed)?;
    encoder
        .set_repeat(Repeat::Infinite)
        .map_err(|e| PictureError::Encode(e.to_string()))?;
    let centiseconds = |seconds: f64| {
        if seconds > 0.0 {
            (100.0 * seconds).round().min(6e3) as u16
        } else {
            0
        }
    };
    // Delays are whole hundredths of a second, rounded so that their sum stays correct.
    let until = |frame: usize| f64::from(centiseconds(1.0)) * frame as f64 / options.fps.max(0.1);
    let delay =
        |frame: usize| ((until(frame + 1).round() - until(frame).round()).min(6e3) as u16).max(2);
    let hold = centiseconds(options.hold);
    let mut shown: Vec<u8> = Vec::new();
    let mut number = 0;
    film.each(
        &moments,
        |picture| indices(&picture, &palette),
        |moment, image| {
            let mut frame = tolerance.difference(&mut shown, image, width);
            frame.delay = match moment.is_last {
                true => delay(number).max(hold),
                false => delay(number),
            };
            number += 1;
            encoder.write_lzw_pre_encoded_frame(&frame).map_err(failed)
        },
    )?;
    encoder
        .into_inner()
        .map_err(|e| PictureError::Encode(e.to_string()))
}

/// Returns a single frame as a GIF, which is a third of the size of a PNG.
///
/// # Errors
/// Returns the errors of [`encode`].
pub fn still(walk: &Walk, frame: usize, width: u32) -> Result<Vec<u8>, PictureError> {
    let film = Film::new(walk, width, Look::Plain, false)?.crisp();
    let moment = Moment {
        frames: vec![frame],
        is_last: true,
    };
    let palette = palette(&film, std::slice::from_ref(&moment), palette::MOST)?;
    let failed = |e: ::gif::EncodingError| PictureError::Encode(e.to_string());
    let [width, height] = film.size().map(|side| side as u16);
    let buffer = indices(&film.picture(&moment)?, &palette).into();
    let mut encoder =
        Encoder::new(Vec::new(), width, height, &palette.colours().concat()).map_err(failed)?;
    encoder
        .write_frame(&Frame {
            width,
            height,
            buffer,
            ..Frame::default()
        })
        .map_err(failed)?;
    encoder
        .into_inner()
        .map_err(|e| PictureError::Encode(e.to_string()))
}

fn palette(film: &Film, moments: &[Moment], most: usize) -> Result<Palette, PictureError> {
    let mut fixed: Vec<Colour> = vec![
        colour::PAPER,
        colour::INK,
        colour::GROUND,
        colour::TRACE,
        colour::FAINT,
        colour::SEAM,
    ];
    let mut phases = film.walk().recording().phases.iter();
    if phases.any(|phase| phase.seen.image.is_some()) {
        fixed.push(colour::WINDOW);
    }
    if film.look() == Look::Paper {
        fixed.extend([colour::GRID, colour::PEG]);
    }
    let [small, _, large] = colour::TONE_AREAS;
    for material in present(&film.walk().recording().body) {
        fixed.extend((0..SHADES).map(|k| {
            colour::shade(
                material,
                small + (large - small) / f64::from(SHADES - 1) * f64::from(k),
            )
        }));
    }
    let fixed: Vec<[u8; 3]> = fixed.into_iter().map(|c| c.rgb).collect();
    let some: Vec<&Moment> = moments
        .iter()
        .step_by(moments.len().div_ceil(SAMPLES))
        .collect();
    let pictures: Result<Vec<_>, _> = some.par_iter().map(|moment| film.picture(moment)).collect();
    Ok(Palette::new(
        &fixed,
        pictures?.iter().map(|p| p.data()),
        most,
    ))
}

fn indices(picture: &Pixmap, palette: &Palette) -> Vec<u8> {
    let pixels = picture.data().chunks_exact(4);
    pixels.map(|p| palette.index([p[0], p[1], p[2]])).collect()
}

/// The colours of a palette that may stand for each other.
struct Tolerance {
    count: usize,
    /// The squared distance of two colours, by both indices; `None` if it is too far.
    errors: Vec<Option<u32>>,
}

impl Tolerance {
    fn of(palette: &Palette) -> Self {
        let colours = palette.colours();
        // Large areas of one colour stay clean: nothing else stands for them.
        let is_plain = |c: &[u8; 3]| [colour::PAPER.rgb, colour::GROUND.rgb].contains(c);
        let error = |wanted: &[u8; 3], other: &[u8; 3]| {
            let error = palette::distance(*wanted, *other).cast_unsigned();
            let is_near = error <= TOLERANCE * TOLERANCE && !is_plain(wanted);
            (error == 0 || is_near).then_some(error)
        };
        let errors = colours
            .iter()
            .flat_map(|wanted| colours.iter().map(move |other| error(wanted, other)));
        Tolerance {
            count: colours.len(),
            errors: errors.collect(),
        }
    }

    fn error(&self, wanted: u8, other: u8) -> Option<u32> {
        self.errors[usize::from(wanted) * self.count + usize::from(other)]
    }

    /// Compresses what an image changes of what is `shown` (empty at first), and updates that: the
    /// smallest rectangle that holds every change that is not tolerated.
    fn difference(&self, shown: &mut Vec<u8>, now: &[u8], width: u16) -> Frame<'static> {
        let (row, unchanged) = (usize::from(width), self.count as u8);
        let rows = 0..now.len() / row;
        let columns = 0..row;
        let is_first = shown.is_empty();
        // What never changes stays as it is in the first image, so that has no error.
        let error = |wanted: u8, other: u8| match is_first {
            true => (wanted == other).then_some(0),
            false => self.error(wanted, other),
        };
        let kept = |i: usize| error(now[i], *shown.get(i)?);
        let is_changed = |i: usize| kept(i).is_none();
        let changed_row = |r: &usize| (r * row..(r + 1) * row).any(is_changed);
        let changed_column = |c: &usize| rows.clone().any(|r| is_changed(r * row + c));
        // If nothing changed, a single unchanged pixel remains.
        let top = rows.clone().find(changed_row).unwrap_or(0);
        let bottom = rows.clone().rev().find(changed_row).unwrap_or(0);
        let left = columns.clone().find(changed_column).unwrap_or(0);
        let right = columns.rev().find(changed_column).unwrap_or(0);
        let size = [right - left + 1, bottom - top + 1];
        let place = |k: usize| (top + k / size[0]) * row + left + k % size[0];
        // Indices from 0 to `unchanged`.
        let bits = (8 - unchanged.leading_zeros()).max(2) as u8;
        let mut next = shown.clone();
        next.resize(now.len(), 0);
        let buffer = lzw::compress(
            size[0] * size[1],
            bits,
            |k, other| match other == unchanged {
                true => kept(place(k)),
                false if other < unchanged => error(now[place(k)], other),
                false => None,
            },
            |k, index| {
                if index != unchanged {
                    next[place(k)] = index;
                }
            },
        );
        *shown = next;
        Frame {
            left: left as u16,
            top: top as u16,
            width: size[0] as u16,
            height: size[1] as u16,
            dispose: DisposalMethod::Keep,
            transparent: Some(unchanged),
            buffer: buffer.into(),
            ..Frame::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::stop::NEVER;
    use crate::draw::simulated;

    /// Decodes every frame of a GIF as a viewer displays it (RGB bytes), with its delay.
    fn decode(bytes: &[u8]) -> (u16, u16, Repeat, Vec<(Vec<u8>, u16)>) {
        let mut decoder = ::gif::DecodeOptions::new().read_info(bytes).unwrap();
        let (width, height) = (decoder.width(), decoder.height());
        let palette = decoder.global_palette().unwrap().to_vec();
        let mut canvas = vec![0; usize::from(width) * usize::from(height) * 3];
        let mut frames = vec![];
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            for (i, index) in frame
                .buffer
                .iter()
                .enumerate()
                .filter(|(_, p)| Some(**p) != frame.transparent)
            {
                let (r, c) = (i / usize::from(frame.width), i % usize::from(frame.width));
                let at =
                    (usize::from(frame.top) + r) * usize::from(width) + usize::from(frame.left) + c;
                canvas[3 * at..3 * at + 3]
                    .copy_from_slice(&palette[3 * usize::from(*index)..][..3]);
            }
            frames.push((canvas.clone(), frame.delay));
        }
        (width, height, decoder.repeat(), frames)
    }

    #[test]
    fn a_gif_decodes_to_the_rendered_frames_within_the_palette() {
        let recording = simulated("3344/1256/5612", 2, 30, true);
        let walk = Walk::new(&recording).unwrap();
        let options = FilmOptions {
            width: 320,
            every: 4,
            ..FilmOptions::default()
        };
        let film = Film::new(&walk, 320, Look::Plain, false).unwrap().crisp();
        let (width, height, repeat, frames) =
            decode(&encode(&recording, &options, &NEVER).unwrap());
        let shown = film.moments(4);
        assert_eq!([width, height].map(u32::from), film.size());
        assert_eq!(repeat, Repeat::Infinite);
        assert_eq!(frames.len(), shown.len());
        for ((seen, _), moment) in frames.iter().zip(&shown) {
            let full = film.picture(moment).unwrap();
            let mut far = 0;
            let pixels = full.data().chunks(4).zip(seen.chunks(3));
            let mut sum = 0.0;
            for (a, b) in pixels {
                let error = (0..3)
                    .map(|k| (f64::from(a[k]) - f64::from(b[k])).abs())
                    .fold(0.0, f64::max);
                sum += error;
                // A tolerated colour of a voxel, or of one that was rounded to the palette.
                far += usize::from(error > 72.0);
            }
            let count = seen.len() as f64 / 3.0;
            assert!(
                sum / count < 2.5 && (far as f64) < 0.002 * count,
                "{moment:?}: {} {far}",
                sum / count
            );
        }
    }

    #[test]
    fn phases_play_in_order_and_their_ends_are_held() {
        let recording = simulated("33/44", 2, 10, true);
        let walk = Walk::new(&recording).unwrap();
        let film = Film::new(&walk, 320, Look::Plain, false).unwrap();
        let moments = film.moments(4);
        let frames: Vec<usize> = moments
            .iter()
            .flat_map(|moment| moment.frames.clone())
            .collect();
        assert_eq!(frames, [0, 4, 8, 10, 11, 15, 19, 21]);
        assert_eq!(film.moments(0).len(), 22);
        let options = FilmOptions {
            width: 320,
            every: 4,
            fps: 20.0,
            hold: 0.5,
            ..FilmOptions::default()
        };
        let (.., frames) = decode(&encode(&recording, &options, &NEVER).unwrap());
        let delays: Vec<u16> = frames.iter().map(|f| f.1).collect();
        assert_eq!(delays, [5, 5, 5, 50, 5, 5, 5, 50]);
        let thirds = FilmOptions {
            width: 320,
            every: 4,
            fps: 30.0,
            hold: 0.0,
            ..FilmOptions::default()
        };
        let delays: Vec<u16> = decode(&encode(&recording, &thirds, &NEVER).unwrap())
            .3
            .iter()
            .map(|f| f.1)
            .collect();
        assert_eq!(delays[..6], [3, 4, 3, 3, 4, 3]);
    }

    #[test]
    fn single_frames_still_bodies_and_odd_options_work() {
        let mut recording = simulated("1", 1, 2, false);
        recording.frames[1] = recording.frames[0].clone();
        recording.frames.truncate(2);
        let options = FilmOptions {
            width: 320,
            fps: f64::NAN,
            hold: f64::INFINITY,
            ..FilmOptions::default()
        };
        assert_eq!(
            decode(&encode(&recording, &options, &NEVER).unwrap())
                .3
                .len(),
            2
        );
        recording.frames.truncate(1);
        assert_eq!(
            decode(&encode(&recording, &options, &NEVER).unwrap())
                .3
                .len(),
            1
        );
    }

    #[test]
    fn the_largest_body_thrown_a_million_voxels_away_is_drawn() {
        let mut recording = simulated(&[&*"3".repeat(64); 64].join("/"), 1, 3, false);
        for (frame, shift) in recording.frames.iter_mut().zip([0.0, 40.0, 1e6, -1e6]) {
            frame.points.iter_mut().for_each(|p| p[0] += shift);
            frame.centre[0] += shift;
        }
        let options = FilmOptions {
            every: 1,
            ..FilmOptions::default()
        };
        assert_eq!(
            decode(&encode(&recording, &options, &NEVER).unwrap())
                .3
                .len(),
            4
        );
    }
}
