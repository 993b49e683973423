//! Animated GIFs of recordings, with one palette; each frame stores only the pixels that changed.

use crate::base::threads::in_pool;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::error::{PictureError, write_whole};
use crate::draw::film::{Film, Moment};
use crate::draw::palette::Palette;
use crate::draw::panel::present;
use crate::draw::scene::Look;
use crate::draw::walk::Walk;
use crate::task::recording::Recording;
use ::gif::{DisposalMethod, Encoder, Frame, Repeat};
use rayon::prelude::*;
use std::path::Path;

/// The size and speed of an animation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GifOptions {
    /// Width in pixels ([`stage::WIDTHS`](crate::draw::stage::WIDTHS)) of the picture, or of each
    /// side by side; the body gives the height.
    pub width: u32,
    /// Frames per second, at most 50 (GIFs count hundredths of a second; viewers slow faster ones).
    pub fps: f64,
    /// The control steps from one frame to the next, at least 1. A second of the robot's time has
    /// 50 control steps, so 1 at 50 frames per second is real time.
    pub every: usize,
    pub(crate) look: Look,
    /// The seconds for which the last frame of each phase stays.
    pub(crate) hold: f64,
    /// True if all rollouts are shown at once.
    pub side_by_side: bool,
}

impl Default for GifOptions {
    fn default() -> Self {
        GifOptions {
            width: 480,
            fps: 50.0,
            every: 1,
            look: Look::Plain,
            hold: 0.6,
            side_by_side: false,
        }
    }
}

/// The number of frames sampled for the palette.
const SAMPLES: usize = 24;
/// Shades of a material in the palette: few enough that voxels keep their colour between frames.
const SHADES: u32 = 9;
/// The number of frames rendered at a time.
const BATCH: usize = 32;

/// Writes a recording as an animated GIF that loops for ever.
pub(crate) fn write(
    path: &Path,
    recording: &Recording,
    options: &GifOptions,
) -> Result<(), PictureError> {
    write_whole(path, &encode(recording, options)?)
}

/// Encodes a recording as an animated GIF that loops for ever.
///
/// # Errors
/// Returns a [`PictureError`] if the recording cannot be drawn with these options.
pub fn encode(recording: &Recording, options: &GifOptions) -> Result<Vec<u8>, PictureError> {
    in_pool(|| encoded(recording, options))?
}

fn encoded(recording: &Recording, options: &GifOptions) -> Result<Vec<u8>, PictureError> {
    let walk = Walk::new(recording)?;
    let film = Film::new(&walk, options.width, options.look, options.side_by_side)?.crisp();
    let moments = film.moments(options.every);
    let palette = palette(&film, &moments)?;
    let unchanged = palette.colours().len() as u8;
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
    let mut number = 0;
    let mut before: Vec<u8> = Vec::new();
    for batch in moments.chunks(BATCH) {
        // In parallel but in order, and only one batch in memory.
        let mut images = vec![before];
        let batch_images: Vec<_> = batch
            .par_iter()
            .map(|moment| indexed(&film, &palette, moment))
            .collect();
        for image in batch_images {
            images.push(image?);
        }
        let pairs: Vec<_> = images.windows(2).collect();
        let encoded = pairs
            .par_iter()
            .map(|p| difference(&p[0], &p[1], width, height, unchanged));
        for (moment, mut encoded) in batch.iter().zip(encoded.collect::<Vec<_>>()) {
            encoded.delay = if moment.is_last {
                delay(number).max(hold)
            } else {
                delay(number)
            };
            number += 1;
            encoder
                .write_lzw_pre_encoded_frame(&encoded)
                .map_err(failed)?;
        }
        before = images
            .pop()
            .expect("the image before the batch is among them");
    }
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
    let palette = palette(&film, std::slice::from_ref(&moment))?;
    let failed = |e: ::gif::EncodingError| PictureError::Encode(e.to_string());
    let [width, height] = film.size().map(|side| side as u16);
    let buffer = indexed(&film, &palette, &moment)?.into();
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

fn palette(film: &Film, moments: &[Moment]) -> Result<Palette, PictureError> {
    let mut fixed: Vec<Colour> = vec![
        colour::PAPER,
        colour::INK,
        colour::GROUND,
        colour::TRACE,
        colour::FAINT,
        colour::SEAM,
    ];
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
    Ok(Palette::new(&fixed, pictures?.iter().map(|p| p.data())))
}

fn indexed(film: &Film, palette: &Palette, moment: &Moment) -> Result<Vec<u8>, PictureError> {
    let picture = film.picture(moment)?;
    Ok(picture
        .data()
        .chunks_exact(4)
        .map(|p| palette.index([p[0], p[1], p[2]]))
        .collect())
}

/// Compresses the difference of two images: the smallest rectangle that contains every change.
/// Pixels without a change are `unchanged`, unless the plain rectangle is shorter.
fn difference(before: &[u8], now: &[u8], width: u16, height: u16, unchanged: u8) -> Frame<'static> {
    let row = usize::from(width);
    let is_changed = |i: usize| before.get(i) != Some(&now[i]);
    let changed_row = |r: &usize| (r * row..(r + 1) * row).any(is_changed);
    let changed_column = |c: &usize| (0..usize::from(height)).any(|r| is_changed(r * row + c));
    let rows = 0..usize::from(height);
    let columns = 0..row;
    // If nothing changed, a single unchanged pixel remains.
    let top = rows.clone().find(changed_row).unwrap_or(0);
    let bottom = rows.rev().find(changed_row).unwrap_or(0);
    let left = columns.clone().find(changed_column).unwrap_or(0);
    let right = columns.rev().find(changed_column).unwrap_or(0);
    let rectangle = || (top..=bottom).flat_map(|r| (left..=right).map(move |c| r * row + c));
    let frame = |pixels: Vec<u8>| {
        let mut frame = Frame {
            left: left as u16,
            top: top as u16,
            width: (right - left + 1) as u16,
            height: (bottom - top + 1) as u16,
            dispose: DisposalMethod::Keep,
            transparent: Some(unchanged),
            buffer: pixels.into(),
            ..Frame::default()
        };
        frame.make_lzw_pre_encoded();
        frame
    };
    let sparse = frame(
        rectangle()
            .map(|i| if is_changed(i) { now[i] } else { unchanged })
            .collect(),
    );
    let full = frame(rectangle().map(|i| now[i]).collect());
    if full.buffer.len() < sparse.buffer.len() {
        full
    } else {
        sparse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
        let options = GifOptions {
            width: 320,
            every: 4,
            ..GifOptions::default()
        };
        let film = Film::new(&walk, 320, Look::Plain, false).unwrap().crisp();
        let (width, height, repeat, frames) = decode(&encode(&recording, &options).unwrap());
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
                far += usize::from(error > 24.0);
            }
            let count = seen.len() as f64 / 3.0;
            assert!(
                sum / count < 2.0 && (far as f64) < 0.002 * count,
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
        let options = GifOptions {
            width: 320,
            every: 4,
            fps: 20.0,
            hold: 0.5,
            ..GifOptions::default()
        };
        let (.., frames) = decode(&encode(&recording, &options).unwrap());
        let delays: Vec<u16> = frames.iter().map(|f| f.1).collect();
        assert_eq!(delays, [5, 5, 5, 50, 5, 5, 5, 50]);
        let thirds = GifOptions {
            width: 320,
            every: 4,
            fps: 30.0,
            hold: 0.0,
            ..GifOptions::default()
        };
        let delays: Vec<u16> = decode(&encode(&recording, &thirds).unwrap())
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
        let options = GifOptions {
            width: 320,
            fps: f64::NAN,
            hold: f64::INFINITY,
            ..GifOptions::default()
        };
        assert_eq!(decode(&encode(&recording, &options).unwrap()).3.len(), 2);
        recording.frames.truncate(1);
        assert_eq!(decode(&encode(&recording, &options).unwrap()).3.len(), 1);
    }

    #[test]
    fn the_largest_body_thrown_a_million_voxels_away_is_drawn() {
        let mut recording = simulated(&[&*"3".repeat(64); 64].join("/"), 1, 3, false);
        for (frame, shift) in recording.frames.iter_mut().zip([0.0, 40.0, 1e6, -1e6]) {
            frame.points.iter_mut().for_each(|p| p[0] += shift);
            frame.centre[0] += shift;
        }
        let options = GifOptions {
            every: 1,
            ..GifOptions::default()
        };
        assert_eq!(decode(&encode(&recording, &options).unwrap()).3.len(), 4);
    }
}
