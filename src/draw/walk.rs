//! [`Walk`]: a recording, validated once, with the queries that pictures need.

use crate::body::Material;
use crate::draw::error::PictureError;
use crate::task::recording::{Phase, Recording};
use std::collections::BTreeMap;
use std::ops::Range;

/// Positions beyond this (voxel lengths) are not drawn: the body has exploded.
const FAR: f64 = 1e9;

/// A recording that can be drawn: it has frames, phases in order and corners that exist. Positions
/// may still be anything (NaN in the last moments of an unstable rollout): voxels without finite
/// corners are left out.
#[derive(Clone, Debug)]
pub struct Walk<'a> {
    recording: &'a Recording,
    centres: Vec<[f64; 2]>,
    fresh: Vec<bool>,
    sides: Vec<([usize; 2], u32)>,
}

/// The smallest and largest x and y of some points, voxel lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    pub(crate) left: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
    pub(crate) top: f64,
}

impl<'a> Walk<'a> {
    /// Validates a recording.
    ///
    /// # Errors
    /// Returns [`PictureError::Recording`] if there is no frame or phase, phases are not in order,
    /// or a corner does not exist.
    pub fn new(recording: &'a Recording) -> Result<Self, PictureError> {
        let bad = |what| Err(PictureError::Recording(what));
        let (frames, phases) = (&recording.frames, &recording.phases);
        let (Some(first), Some(first_phase)) = (frames.first(), phases.first()) else {
            return bad("expected at least one frame and one phase");
        };
        let rising = phases
            .windows(2)
            .all(|p| p[0].first_frame < p[1].first_frame);
        let last = phases.last().map_or(0, |p| p.first_frame);
        if first_phase.first_frame != 0 || !rising || last >= frames.len() {
            return bad(
                "expected phases in order, the first at frame 0 and each with at least one frame",
            );
        }
        let points = frames.iter().map(|f| f.points.len()).min().unwrap_or(0);
        if recording
            .voxels
            .iter()
            .flat_map(|v| v.corners)
            .any(|c| c >= points)
        {
            return bad("a voxel has a corner that is not among the points of every frame");
        }
        let fresh = phases.iter().map(|p| {
            frames
                .get(p.first_frame)
                .is_some_and(|f| f.points == first.points)
        });
        let fresh = fresh.collect();
        Ok(Walk {
            recording,
            centres: finite_centres(recording),
            fresh,
            sides: sides(recording),
        })
    }

    pub(crate) fn recording(&self) -> &'a Recording {
        self.recording
    }

    /// Returns the number of frames, at least 1.
    pub fn frames(&self) -> usize {
        self.recording.frames.len()
    }

    pub(crate) fn phase_index(&self, frame: usize) -> usize {
        self.recording
            .phases
            .iter()
            .rposition(|p| p.first_frame <= frame)
            .unwrap_or(0)
    }

    pub(crate) fn phase(&self, frame: usize) -> &'a Phase {
        &self.recording.phases[self.phase_index(frame)]
    }

    pub(crate) fn phase_frames(&self, phase: usize) -> Range<usize> {
        let first = |p: usize| {
            self.recording
                .phases
                .get(p)
                .map_or(self.frames(), |p| p.first_frame)
        };
        first(phase)..first(phase + 1)
    }

    /// Returns true if the phase begins with the robot reset to its start; the first always does.
    pub(crate) fn is_fresh(&self, phase: usize) -> bool {
        self.fresh.get(phase).copied().unwrap_or(false)
    }

    /// Returns the centre of mass at a frame, voxel lengths; the last finite one if necessary.
    pub(crate) fn centre(&self, frame: usize) -> [f64; 2] {
        self.centres[frame.min(self.centres.len() - 1)]
    }

    /// Returns the signed distance walked since the phase began, voxel lengths.
    pub(crate) fn displacement(&self, frame: usize) -> f64 {
        self.centre(frame)[0] - self.centre(self.phase(frame).first_frame)[0]
    }

    /// Returns the frames of the rollout that contains a frame, from the last reset to the next.
    pub(crate) fn rollout(&self, frame: usize) -> Range<usize> {
        let phase = self.phase_index(frame);
        let resets = || {
            self.fresh
                .iter()
                .enumerate()
                .filter(|(_, f)| **f)
                .map(|(p, _)| p)
        };
        let first = resets().rfind(|&p| p <= phase).unwrap_or(0);
        let next = resets().find(|&p| p > phase).unwrap_or(self.fresh.len());
        self.phase_frames(first).start..self.phase_frames(next).start
    }

    /// Returns every drawable voxel of a frame: material and corners (clockwise from the top left).
    pub(crate) fn voxels(&self, frame: usize) -> impl Iterator<Item = (Material, [[f64; 2]; 4])> {
        let body = &self.recording.body;
        self.recording.voxels.iter().filter_map(move |v| {
            let mut quad = [[0.0; 2]; 4];
            for (corner, &point) in quad.iter_mut().zip(&v.corners) {
                *corner = self.point(frame, point)?;
            }
            Some((body.at(v.row as isize, v.column as isize), quad))
        })
    }

    /// Returns the sides that belong to a single voxel (the body's outline) at a frame.
    pub(crate) fn outline(&self, frame: usize) -> impl Iterator<Item = [[f64; 2]; 2]> {
        self.sides_of(frame, true)
    }

    /// Returns the sides that two voxels share at a frame.
    pub(crate) fn seams(&self, frame: usize) -> impl Iterator<Item = [[f64; 2]; 2]> {
        self.sides_of(frame, false)
    }

    fn sides_of(&self, frame: usize, outer: bool) -> impl Iterator<Item = [[f64; 2]; 2]> {
        let sides = self
            .sides
            .iter()
            .filter(move |(_, voxels)| (*voxels == 1) == outer);
        sides.filter_map(move |([a, b], _)| Some([self.point(frame, *a)?, self.point(frame, *b)?]))
    }

    /// Returns the extent of the body over some frames, or its undeformed box if nothing is finite.
    pub(crate) fn extent(&self, frames: Range<usize>) -> Extent {
        let (height, width) = (
            self.recording.body.height() as f64,
            self.recording.body.width() as f64,
        );
        let nothing = Extent {
            left: f64::INFINITY,
            right: f64::NEG_INFINITY,
            bottom: f64::INFINITY,
            top: 0.0,
        };
        let extent = frames
            .flat_map(|f| self.recording.frames.get(f))
            .flat_map(|f| &f.points);
        let extent = extent.filter(|p| is_near(p)).fold(nothing, |e, p| Extent {
            left: e.left.min(p[0]),
            right: e.right.max(p[0]),
            bottom: e.bottom.min(p[1]),
            top: e.top.max(p[1]),
        });
        if extent.left <= extent.right {
            extent
        } else {
            Extent {
                left: 0.0,
                right: width,
                bottom: 0.0,
                top: height,
            }
        }
    }

    fn point(&self, frame: usize, point: usize) -> Option<[f64; 2]> {
        let position = self.recording.frames.get(frame)?.points.get(point)?;
        is_near(position).then_some(*position)
    }
}

/// Returns the area of a voxel from its corners (clockwise), square voxel lengths: 1 at rest,
/// negative when turned inside out.
pub(crate) fn area(quad: &[[f64; 2]; 4]) -> f64 {
    let [a, b, c, d] = quad;
    0.5 * ((c[0] - a[0]) * (b[1] - d[1]) - (b[0] - d[0]) * (c[1] - a[1]))
}

fn is_near(position: &[f64; 2]) -> bool {
    position.iter().all(|x| x.abs() < FAR)
}

fn finite_centres(recording: &Recording) -> Vec<[f64; 2]> {
    let mut last = [
        recording.body.width() as f64 / 2.0,
        recording.body.height() as f64 / 2.0,
    ];
    let centres = recording.frames.iter().map(|frame| {
        if is_near(&frame.centre) {
            last = frame.centre;
        }
        last
    });
    centres.collect()
}

/// Counts the voxels at every side (two points).
fn sides(recording: &Recording) -> Vec<([usize; 2], u32)> {
    let mut sides = BTreeMap::new();
    for [a, b, c, d] in recording.voxels.iter().map(|v| v.corners) {
        for (from, to) in [(a, b), (b, c), (c, d), (d, a)] {
            *sides.entry([from.min(to), from.max(to)]).or_insert(0) += 1;
        }
    }
    sides.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::simulated;

    #[test]
    fn recordings_without_frames_phases_or_corners_are_refused() {
        let good = simulated("33/44", 2, 10, false);
        assert!(Walk::new(&good).is_ok());
        let refused = |spoil: fn(&mut Recording)| {
            let mut bad = good.clone();
            spoil(&mut bad);
            matches!(Walk::new(&bad), Err(PictureError::Recording(_)))
        };
        assert!(refused(|r| r.frames.clear()));
        assert!(refused(|r| r.phases.clear()));
        assert!(refused(|r| r.phases[1].first_frame = 99));
        assert!(refused(|r| r.phases[1].first_frame = 0));
        assert!(refused(|r| r.frames[5].points.truncate(3)));
    }

    #[test]
    fn fresh_rollouts_end_at_each_phase_and_sequential_ones_go_on() {
        let fresh = simulated("33/44", 2, 10, true);
        let walk = Walk::new(&fresh).unwrap();
        assert_eq!((walk.rollout(3), walk.rollout(15)), (0..11, 11..22));
        assert_eq!(walk.displacement(11), 0.0);
        let sequential = simulated("33/44", 2, 10, false);
        let walk = Walk::new(&sequential).unwrap();
        assert_eq!((walk.rollout(3), walk.rollout(15)), (0..21, 0..21));
        assert_eq!((walk.phase_index(9), walk.phase_index(10)), (0, 1));
        assert!((walk.displacement(20) - sequential.phases[1].displacement).abs() < 1e-9);
    }

    #[test]
    fn area_is_1_at_rest_and_signed() {
        let quad = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        assert_eq!(area(&quad), 1.0);
        assert_eq!(area(&[quad[1], quad[0], quad[3], quad[2]]), -1.0);
        assert_eq!(area(&quad.map(|[x, y]| [3.0 * x, 0.5 * y])), 1.5);
    }

    #[test]
    fn outlines_are_the_sides_of_one_voxel_only() {
        let recording = simulated("333/303/333", 1, 2, false);
        let walk = Walk::new(&recording).unwrap();
        assert_eq!(
            (walk.outline(0).count(), walk.seams(0).count()),
            (12 + 4, 8)
        );
    }

    #[test]
    fn voxels_that_are_nowhere_are_left_out() {
        let mut recording = simulated("33/44", 1, 2, false);
        recording.frames[1].points[0] = [f64::NAN, 0.0];
        recording.frames[1].centre = [f64::INFINITY, 0.0];
        let walk = Walk::new(&recording).unwrap();
        assert_eq!((walk.voxels(0).count(), walk.voxels(1).count()), (4, 3));
        assert_eq!(walk.centre(1), walk.centre(0));
        assert!(walk.extent(1..2).right.is_finite());
    }
}
