//! [`Stage`]: the part of the world that a picture shows, and the layout around it.

use crate::draw::error::PictureError;
use crate::draw::panel::least_width;
use crate::draw::scene::{Look, Window};
use crate::draw::walk::Walk;
use std::ops::RangeInclusive;

pub(crate) use crate::draw::error::WIDTHS;

/// The height of the panel above the world (stimulus, read-outs, legend), pixels at zoom 1.
const PANEL: f64 = 104.0;
/// The height of the ground under its surface, pixels at zoom 1.
const GROUND: f64 = 24.0;
/// The sky left and right of the whole walk, voxel lengths.
const MARGIN: f64 = 2.5;
/// The least sky between a body that the camera follows and the edges, voxel lengths.
const EDGE: f64 = 1.0;
/// The terrain below a body that a picture shows at least, voxel lengths.
const BELOW: f64 = 2.0;
/// Smallest and largest voxel, pixels at zoom 1. The camera follows walks that need smaller ones.
const VOXEL: RangeInclusive<f64> = 5.5..=22.0;
/// The frames before and after over which the camera's path is averaged: a cycle, so that the
/// camera does not shake with the body.
const SMOOTHING: usize = 50;

/// The camera and the layout of a picture: the panel on top, the world below it, the ground at the
/// lower edge. If the whole recording fits, the view is fixed; otherwise the camera follows the
/// centre of mass smoothly, on terrain up and down, too.
#[derive(Clone, Debug)]
pub(crate) struct Stage {
    /// The width of the picture, pixels.
    pub(crate) width: u32,
    /// The height of the picture, pixels.
    pub(crate) height: u32,
    /// The size of letters and lines: 1 up to 720 pixels of width, then larger if the words fit.
    pub(crate) zoom: f64,
    /// True if the legend fits beside these words.
    pub(crate) has_legend: bool,
    /// The height of the panel, pixels.
    pub(crate) panel: f64,
    crisp: bool,
    look: Look,
    scale: f64,
    /// The pixel of `floor`.
    surface: f64,
    left: Vec<f64>,
    /// The height above which the world is shown in each frame, voxel lengths: 0 on flat ground.
    floor: Vec<f64>,
}

impl Stage {
    /// Creates the stage for a recording in a picture `width` pixels wide; the height follows from
    /// the body.
    pub(crate) fn new(walk: &Walk, width: u32) -> Result<Self, PictureError> {
        if !WIDTHS.contains(&width) {
            return Err(PictureError::Size { width, height: 0 });
        }
        let least = least_width(walk);
        let zoom = (f64::from(width) / 480.0)
            .round()
            .min((f64::from(width) / least).floor())
            .max(1.0);
        let has_legend = f64::from(width) >= least * zoom;
        let (smallest, largest) = (VOXEL.start() * zoom, VOXEL.end() * zoom);
        let (first, all) = (walk.extent(0..1), walk.extent(0..walk.frames()));
        let size = (first.right - first.left).clamp(1.0, 128.0);
        let is_flat = walk.recording().terrain.is_none();
        let top = match is_flat {
            true => {
                let standing = first.top.clamp(1.0, 128.0);
                // Leaves room for hops; a body thrown higher leaves the picture for a moment.
                (all.top + 1.0).clamp(standing + 1.5, 2.0 * standing + 2.0)
            }
            false => {
                let tall = (first.top - first.bottom).clamp(1.0, 128.0);
                let climbed = all.top - all.bottom + BELOW + 1.0;
                climbed.clamp(tall + BELOW + 1.5, 2.0 * tall + BELOW + 4.0)
            }
        };
        let (left, right) = reach(walk);
        let fixed = f64::from(width) / (right - left + 2.0 * MARGIN);
        let highest = 1.2 * f64::from(width) / top;
        let follow = fixed < smallest.min(highest);
        let scale = if follow {
            f64::from(width) / (1.7 * size + 8.0)
        } else {
            fixed
        }
        .min(highest)
        .min(largest);
        let panel = PANEL * zoom;
        let surface = (panel + top * scale).round();
        let height = (surface + GROUND * zoom) as u32;
        let middle = if follow {
            followed(walk, f64::from(width) / scale)
        } else {
            vec![(left + right) / 2.0; walk.frames()]
        };
        // Whole pixels, so that the ground scrolls without flicker.
        let snap = |x: f64| ((x * scale - f64::from(width) / 2.0).round()) / scale;
        let floor = if is_flat {
            Vec::new()
        } else {
            let floor = floors(walk, top).into_iter();
            floor.map(|y| (y * scale).round() / scale).collect()
        };
        let crisp = false;
        Ok(Stage {
            width,
            height,
            zoom,
            has_legend,
            panel,
            crisp,
            look: Look::Plain,
            scale,
            surface,
            left: middle.into_iter().map(snap).collect(),
            floor,
        })
    }

    /// Gives voxels hard edges, whose fewer colours keep animations small.
    pub(crate) fn crisp(self) -> Self {
        Stage {
            crisp: true,
            ..self
        }
    }

    pub(crate) fn look(self, look: Look) -> Self {
        Stage { look, ..self }
    }

    /// Maps a point of the world to pixels, y down, in the picture of a frame.
    pub(crate) fn to_pixels(&self, frame: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            (x - self.left_edge(frame)) * self.scale,
            self.surface - (y - self.floor(frame)) * self.scale,
        ]
    }

    /// Returns the part of the world in the picture of a frame.
    pub(crate) fn window(&self, frame: usize) -> Window {
        let (left, floor) = (self.left_edge(frame), self.floor(frame));
        Window {
            left,
            right: left + f64::from(self.width) / self.scale,
            bottom: floor + (self.surface - f64::from(self.height)) / self.scale,
            top: floor + (self.surface - self.panel) / self.scale,
            scale: self.scale,
            zoom: self.zoom,
            crisp: self.crisp,
            look: self.look,
        }
    }

    fn left_edge(&self, frame: usize) -> f64 {
        self.left
            .get(frame)
            .or(self.left.last())
            .copied()
            .unwrap_or(0.0)
    }

    fn floor(&self, frame: usize) -> f64 {
        let floor = self.floor.get(frame).or(self.floor.last());
        floor.copied().unwrap_or(0.0)
    }
}

/// Returns the lowest height that each picture shows of terrain, if it is `tall` voxel lengths high:
/// one for all if the whole walk fits, else it follows the body. Nothing lies below 0.
fn floors(walk: &Walk, tall: f64) -> Vec<f64> {
    let all = walk.extent(0..walk.frames());
    if all.top - all.bottom + BELOW + 1.0 <= tall {
        return vec![(all.bottom - BELOW).max(0.0); walk.frames()];
    }
    let path = averaged(walk, 1);
    let follow = |(frame, centre): (usize, f64)| {
        let extent = walk.extent(frame..frame + 1);
        let high = extent.top.min(walk.centre(frame)[1] + tall / 2.0) + EDGE - tall;
        (centre - tall / 2.0).max(high).max(0.0)
    };
    path.into_iter().enumerate().map(follow).collect()
}

/// Returns the leftmost and rightmost x of the walk. A body that breaks apart counts only up to
/// about a body width beyond its centre.
fn reach(walk: &Walk) -> (f64, f64) {
    let all = walk.extent(0..walk.frames());
    let size = walk.recording().body.width() as f64;
    let centres = (0..walk.frames()).map(|f| walk.centre(f)[0]);
    let (low, high) = centres.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
        (l.min(x), h.max(x))
    });
    (
        all.left.max(low - size - 2.0).min(low),
        all.right.min(high + size + 2.0).max(high),
    )
}

/// Returns the camera's x per frame: the centres, averaged twice over [`SMOOTHING`] frames on both
/// sides, each rollout by itself. It moves farther where the body would leave a picture `wide`
/// voxel lengths wide; parts that are flung off do not count.
fn followed(walk: &Walk, wide: f64) -> Vec<f64> {
    let mut path = averaged(walk, 0);
    let size = walk.recording().body.width() as f64;
    for (f, x) in path.iter_mut().enumerate() {
        let centre = walk.centre(f)[0];
        let extent = walk.extent(f..f + 1);
        let left = extent.left.clamp(centre - size, centre) - EDGE;
        let right = extent.right.clamp(centre, centre + size) + EDGE;
        let [low, high] = [right - wide / 2.0, left + wide / 2.0];
        *x = match low < high {
            true => x.clamp(low, high),
            false => (left + right) / 2.0,
        };
    }
    path
}

/// Returns a coordinate of the centres, averaged twice, each rollout by itself.
fn averaged(walk: &Walk, axis: usize) -> Vec<f64> {
    let mut path: Vec<f64> = (0..walk.frames()).map(|f| walk.centre(f)[axis]).collect();
    let mut start = 0;
    while start < path.len() {
        let rollout = walk.rollout(start);
        for _ in 0..2 {
            smooth(&mut path[rollout.clone()]);
        }
        start = rollout.end.max(start + 1);
    }
    path
}

fn smooth(path: &mut [f64]) {
    let mut sums = vec![0.0];
    sums.extend(path.iter().scan(0.0, |sum, x| {
        *sum += x;
        Some(*sum)
    }));
    let n = path.len();
    for (i, x) in path.iter_mut().enumerate() {
        // The average shrinks near the ends and stays symmetric.
        let reach = SMOOTHING.min(i).min(n - 1 - i);
        *x = (sums[i + reach + 1] - sums[i - reach]) / (2 * reach + 1) as f64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::simulated;

    #[test]
    fn a_walk_that_fits_has_a_fixed_view_that_holds_all_of_it() {
        let recording = simulated("3344/5566", 2, 100, true);
        let walk = Walk::new(&recording).unwrap();
        let stage = Stage::new(&walk, 480).unwrap();
        let extent = walk.extent(0..walk.frames());
        assert!((0..walk.frames()).all(|f| stage.window(f) == stage.window(0)));
        let window = stage.window(0);
        assert!(
            window.left < extent.left && extent.right < window.right && extent.top < window.top
        );
        assert!((stage.to_pixels(0, [window.left, 0.0])[0]).abs() < 1e-6);
    }

    #[test]
    fn a_long_walk_is_followed_smoothly_and_stays_in_the_picture() {
        let mut recording = simulated("3344/5566", 1, 1000, false);
        for (step, frame) in recording.frames.iter_mut().enumerate() {
            let shift = 0.3 * step as f64 + 2.0 * (step as f64 / 4.0).sin();
            frame.points.iter_mut().for_each(|p| p[0] += shift);
            frame.centre[0] += shift;
        }
        let walk = Walk::new(&recording).unwrap();
        let stage = Stage::new(&walk, 480).unwrap();
        for f in 0..walk.frames() {
            let x = stage.to_pixels(f, walk.centre(f))[0];
            assert!((100.0..380.0).contains(&x), "frame {f}: {x}");
            let (all, window) = (walk.extent(f..f + 1), stage.window(f));
            assert!(
                window.left < all.left && all.right < window.right,
                "frame {f}"
            );
        }
        let speed = |f: usize| stage.window(f + 1).left - stage.window(f).left;
        assert!((200..800).all(|f| (0.1..0.5).contains(&speed(f))));
    }

    #[test]
    fn any_recording_gives_a_picture_of_modest_size() {
        for body in [
            "3",
            &"3".repeat(64),
            &["3"; 64].join("/"),
            &[&*"3".repeat(64); 64].join("/"),
        ] {
            let mut recording = simulated(body, 1, 3, false);
            for x in [0.0, 1e6, -1e30, f64::NAN] {
                let moved = [x, x];
                recording.frames[2]
                    .points
                    .iter_mut()
                    .for_each(|p| *p = moved);
                recording.frames[2].centre = moved;
                let walk = Walk::new(&recording).unwrap();
                let stage = Stage::new(&walk, 480).unwrap();
                assert!(
                    (120..=800).contains(&stage.height),
                    "{body} {x}: {}",
                    stage.height
                );
                let window = stage.window(2);
                assert!(
                    window.left.is_finite() && window.right > window.left && window.scale >= 1.0
                );
                let seen = stage.to_pixels(2, walk.centre(2))[0];
                assert!((0.0..=480.0).contains(&seen), "{x}: {seen}");
            }
        }
        let recording = simulated("3", 1, 1, false);
        let walk = Walk::new(&recording).unwrap();
        assert!(matches!(
            Stage::new(&walk, 10),
            Err(PictureError::Size { width: 10, .. })
        ));
    }
}
