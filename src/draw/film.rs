//! [`Film`]: the pictures of a recording: one image's rollout after the other, or the same moment
//! of all rollouts side by side.

use crate::base::stop::{NEVER, check};
use crate::base::threads::in_pool;
use crate::draw::colour;
use crate::draw::error::{PictureError, WIDTHS};
use crate::draw::raster;
use crate::draw::scene::Look;
use crate::draw::stage::Stage;
use crate::draw::walk::Walk;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;
use tiny_skia::{Pixmap, PixmapPaint, Transform};

/// Line between pictures side by side, pixels.
const GAP: u32 = 2;

/// The number of pictures rendered at a time.
const BATCH: usize = 32;

/// Options of moving pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmOptions {
    /// Width in pixels ([`stage::WIDTHS`](crate::draw::stage::WIDTHS)) of the picture, or of each
    /// side by side; the body gives the height.
    pub width: u32,
    /// Frames per second, at most 50 (GIFs count hundredths of a second; viewers slow faster ones).
    pub fps: f64,
    /// The control steps from one frame to the next, at least 1. A second of the robot's time has
    /// 50 control steps, so 2 at 25 frames per second is real time.
    pub every: usize,
    pub(crate) look: Look,
    /// The seconds for which the last frame of each phase stays.
    pub(crate) hold: f64,
    /// True if all rollouts are shown at once.
    pub side_by_side: bool,
}

impl Default for FilmOptions {
    fn default() -> Self {
        FilmOptions {
            width: 480,
            fps: 25.0,
            every: 2,
            look: Look::Plain,
            hold: 0.6,
            side_by_side: false,
        }
    }
}

/// A picture of a film.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Moment {
    /// The frame of each picture side by side.
    pub(crate) frames: Vec<usize>,
    /// True for the last moment of a phase.
    pub(crate) is_last: bool,
}

/// Returns every `every`-th of some steps, and the last.
fn steps(length: usize, every: usize) -> impl Iterator<Item = usize> {
    let last = length.saturating_sub(1);
    let steps = (0..length).step_by(every.max(1));
    steps.filter(move |step| *step != last).chain([last])
}

/// Returns the frames to draw: every `every`-th of each phase, and each phase's last.
pub(crate) fn shown(walk: &Walk, every: usize) -> Vec<usize> {
    let phases = (0..walk.recording().phases.len()).map(|phase| walk.phase_frames(phase));
    phases
        .flat_map(|frames| steps(frames.len(), every).map(move |step| frames.start + step))
        .collect()
}

/// Layout of the pictures of a recording.
pub(crate) struct Film<'a> {
    walk: &'a Walk<'a>,
    stage: Stage,
    side_by_side: bool,
    /// Stops [`Film::each`] when set.
    stop: &'a AtomicBool,
}

impl<'a> Film<'a> {
    /// Creates a film of pictures that are `width` pixels wide, each of those side by side.
    ///
    /// # Errors
    /// Returns an error if the width is out of range, or if rollouts are wanted side by side that
    /// follow each other.
    pub(crate) fn new(
        walk: &'a Walk<'a>,
        width: u32,
        look: Look,
        side_by_side: bool,
    ) -> Result<Self, PictureError> {
        let phases = walk.recording().phases.len();
        if side_by_side && !(0..phases).all(|phase| walk.is_fresh(phase)) {
            return Err(PictureError::OneRollout);
        }
        let film = Film {
            walk,
            stage: Stage::new(walk, width)?.look(look),
            side_by_side,
            stop: &NEVER,
        };
        let [width, height] = film.size();
        // A film keeps dozens of pictures in memory.
        match side_by_side && width.max(height) > *WIDTHS.end() {
            true => Err(PictureError::Large { width, height }),
            false => Ok(film),
        }
    }

    /// Creates a film with these options.
    ///
    /// # Errors
    /// Returns the errors of [`Film::new`].
    pub(crate) fn of(walk: &'a Walk<'a>, options: &FilmOptions) -> Result<Self, PictureError> {
        Film::new(walk, options.width, options.look, options.side_by_side)
    }

    /// Returns the same film, which stops when `stop` is set.
    pub(crate) fn until(self, stop: &'a AtomicBool) -> Self {
        Film { stop, ..self }
    }

    /// Calls `show` with what `make` makes of each moment's picture, in order. Pictures are made in
    /// parallel, with few in memory.
    pub(crate) fn each<T: Send>(
        &self,
        moments: &[Moment],
        make: impl Fn(Pixmap) -> T + Sync,
        mut show: impl FnMut(&Moment, &T) -> Result<(), PictureError>,
    ) -> Result<(), PictureError> {
        for batch in moments.chunks(BATCH) {
            check(self.stop)?;
            let pictures = || {
                batch
                    .par_iter()
                    .map(|moment| self.picture(moment).map(&make))
            };
            let made: Vec<_> = in_pool(|| pictures().collect())?;
            for (moment, made) in batch.iter().zip(made) {
                show(moment, &made?)?;
            }
        }
        Ok(())
    }

    /// Gives voxels hard edges.
    pub(crate) fn crisp(self) -> Self {
        Film {
            stage: self.stage.crisp(),
            ..self
        }
    }

    pub(crate) fn look(&self) -> Look {
        self.stage.window(0).look
    }

    pub(crate) fn walk(&self) -> &'a Walk<'a> {
        self.walk
    }

    /// Returns the numbers of pictures beside each other and below each other.
    fn grid(&self) -> [u32; 2] {
        let tiles = match self.side_by_side {
            true => self.walk.recording().phases.len() as u32,
            false => 1,
        };
        let columns = (1..=tiles).find(|n| n * n >= tiles).unwrap_or(1);
        [columns, tiles.div_ceil(columns)]
    }

    /// Returns width and height in pixels.
    pub(crate) fn size(&self) -> [u32; 2] {
        let [columns, rows] = self.grid();
        let along = |count: u32, side: u32| count * (side + GAP) - GAP;
        [
            along(columns, self.stage.width),
            along(rows, self.stage.height),
        ]
    }

    /// Returns the moments to draw: every `every`-th of each phase, and each phase's last. Side by
    /// side, a rollout that ends before others stays as it ended.
    pub(crate) fn moments(&self, every: usize) -> Vec<Moment> {
        let walk = self.walk;
        if !self.side_by_side {
            let of = |frame: usize| Moment {
                frames: vec![frame],
                is_last: frame + 1 == walk.phase_frames(walk.phase_index(frame)).end,
            };
            return shown(walk, every).into_iter().map(of).collect();
        }
        let phases = (0..walk.recording().phases.len()).map(|phase| walk.phase_frames(phase));
        let phases: Vec<_> = phases.collect();
        let longest = phases.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        let at = |step: usize| Moment {
            frames: phases
                .iter()
                .map(|frames| (frames.start + step).min(frames.end - 1))
                .collect(),
            is_last: step + 1 == longest,
        };
        steps(longest, every).map(at).collect()
    }

    /// Renders a moment as opaque RGBA.
    pub(crate) fn picture(&self, moment: &Moment) -> Result<Pixmap, PictureError> {
        let tile = |frame: usize| raster::picture(self.walk, frame, &self.stage);
        if let [frame] = moment.frames[..] {
            return tile(frame);
        }
        let ([columns, _], [width, height]) = (self.grid(), self.size());
        let mut all = Pixmap::new(width, height).ok_or(PictureError::Size { width, height })?;
        let [red, green, blue] = colour::GROUND_LINE.rgb;
        all.fill(tiny_skia::Color::from_rgba8(red, green, blue, 255));
        for (number, frame) in (0..).zip(&moment.frames) {
            let at = |place: u32, side: u32| (place * (side + GAP)) as i32;
            all.draw_pixmap(
                at(number % columns, self.stage.width),
                at(number / columns, self.stage.height),
                tile(*frame)?.as_ref(),
                &PixmapPaint::default(),
                Transform::identity(),
                None,
            );
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::simulated;

    #[test]
    fn rollouts_side_by_side_share_a_clock_and_none_goes_on_from_another() {
        let fresh = simulated("33/44", 3, 10, true);
        let walk = Walk::new(&fresh).unwrap();
        let film = Film::new(&walk, 320, Look::Plain, true).unwrap();
        let moments = film.moments(4);
        let frames: Vec<&[usize]> = moments.iter().map(|moment| &*moment.frames).collect();
        assert_eq!(
            frames,
            [[0, 11, 22], [4, 15, 26], [8, 19, 30], [10, 21, 32]]
        );
        let last: Vec<bool> = moments.iter().map(|moment| moment.is_last).collect();
        assert_eq!(last, [false, false, false, true]);
        let picture = film.picture(&moments[1]).unwrap();
        let one = Film::new(&walk, 320, Look::Plain, false).unwrap();
        let second = one.picture(&one.moments(4)[5]).unwrap();
        let [width, height] = one.size();
        assert_eq!([picture.width(), picture.height()], film.size());
        assert_eq!(film.size(), [2 * width + GAP, 2 * height + GAP]);
        let at = |x, y| picture.pixel(width + GAP + x, y) == second.pixel(x, y);
        assert!((0..width).all(|x| (0..height).all(|y| at(x, y))));
        let pair = simulated("33/44", 2, 10, true);
        let walk = Walk::new(&pair).unwrap();
        let film = Film::new(&walk, 320, Look::Plain, true).unwrap();
        assert_eq!(film.size()[0], 2 * 320 + GAP);
        let wide = Film::new(&walk, 4096, Look::Plain, true).map(drop);
        assert!(matches!(wide, Err(PictureError::Large { .. })));
        let continued = simulated("33/44", 2, 10, false);
        let walk = Walk::new(&continued).unwrap();
        assert!(Film::new(&walk, 320, Look::Plain, true).is_err());
    }
}
