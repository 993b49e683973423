//! Possible contacts: lists that stay complete while no point has moved further than a budget.
//!
//! Without them every substep would test all pairs of surface voxels. A list holds every pair whose
//! boxes come within twice the budget. Until a point has moved by more than the budget, along x or
//! y, since the lists were made, no other pair can have met. So the lists affect only speed. On flat
//! ground, motion along x counts relative to one of the points: it is the same everywhere, so
//! walking alone does not invalidate a list.

use crate::lattice::{FAMILIES, Lattice, SurfaceVoxel};
use crate::simd::{BLOCK, Buffer, Lanes, each};
use crate::state::{Pair, State, X, Y, slices};
use crate::step::geometry::{Bounds, Vector};
use crate::step::springs::vectors;
use crate::system::System;
use crate::terrain::Ground;
use crate::unstable::UnstableReason;

/// Distance that a point may move before the lists are rebuilt \[voxel lengths\].
const BUDGET: f64 = 0.2;

/// Most candidates per surface voxel. More are a heap of overlapping voxels, which would take
/// seconds; stable simulations stay far below.
const MOST_CANDIDATES: usize = 256;

/// A corner of one surface voxel that may enter another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// The voxel of the corner, and the corner (clockwise from the top left).
    pub mover: usize,
    pub corner: usize,
    /// The voxel it may enter.
    pub host: usize,
}

/// The lists, and the positions at which they were made.
#[derive(Clone, Debug, Default)]
pub(crate) struct BroadPhase {
    made: Pair,
    /// Surface voxels that may touch the ground, in order.
    pub low: Vec<usize>,
    /// Corners that may enter a voxel, by mover, then host.
    pub candidates: Vec<Candidate>,
    /// Pairs of surface voxels, not neighbours in the body, whose boxes may overlap.
    pub distant: Vec<[usize; 2]>,
    bounds: Vec<Bounds>,
    /// `bounds` for wide lanes, in whole blocks: low x, low y, high x, high y. NaN after the last.
    sides: [Buffer; 4],
}

#[inline]
pub(crate) fn place(point: usize, state: &State) -> Vector {
    Vector::new(state.position[X][point], state.position[Y][point])
}

/// Returns the corners of a surface voxel, clockwise from the top left.
#[inline]
pub(crate) fn quad(voxel: &SurfaceVoxel, state: &State) -> [Vector; 4] {
    voxel.corners.map(|point| place(point, state))
}

/// Returns true if no voxel is larger than the physics allows, and all coordinates are finite.
#[cold]
fn sane(System { lattice, physics }: &System, state: &State) -> bool {
    lattice.voxels.iter().all(|(_, corners)| {
        let bounds = Bounds::of(&corners.map(|point| place(point, state)));
        let extent = bounds.high - bounds.low;
        let small = extent.x <= physics.blow_up_extent && extent.y <= physics.blow_up_extent;
        let is_number = |point: Vector| point.x.is_finite() && point.y.is_finite();
        small && corners.iter().all(|&point| is_number(place(point, state)))
    })
}

/// Returns true if all sides are numbers and so short that every voxel is [`sane`]: any two of its
/// corners are at most two sides apart.
#[inline(always)]
fn short_sides<L: Lanes>(System { lattice, physics }: &System, state: &State) -> bool {
    if !lattice.off_lattice_springs.is_empty() {
        return false;
    }
    let half = L::splat(physics.blow_up_extent / 2.0);
    let (exists, _) = lattice.exists.as_chunks::<{ FAMILIES * BLOCK }>();
    let mut short = half.gt(L::splat(0.0));
    for slot in lattice
        .active_ranges
        .iter()
        .flat_map(|range| range.clone().step_by(L::WIDTH))
    {
        let vectors = vectors::<L>(slices(&state.position, lattice.len), slot, lattice.pitch);
        let (exists, lane) = (&exists[slot / BLOCK], slot % BLOCK);
        for along in vectors {
            for family in [0, 1] {
                let side = along[family].bits_and(L::load(exists, family * BLOCK + lane));
                // NaN counts as not short.
                short = short & half.gt(side);
            }
        }
    }
    L::all(short)
}

impl BroadPhase {
    /// Rebuilds the lists if a point has moved too far since they were made.
    #[inline(always)]
    pub fn refresh<L: Lanes>(
        &mut self,
        system: &System,
        ground: Ground,
        state: &State,
    ) -> Result<(), UnstableReason> {
        let System { lattice, physics } = system;
        if self.made[X].len() == lattice.len {
            let budget = L::splat(BUDGET * physics.cell_size);
            // A terrain is not the same everywhere.
            let first = lattice.points.first().filter(|_| ground.terrain.is_none());
            let walked = first.map_or(0.0, |&(p, _)| state.position[X][p] - self.made[X][p]);
            let mut near = budget.gt(L::splat(0.0));
            for slot in lattice
                .active_ranges
                .iter()
                .flat_map(|range| range.clone().step_by(L::WIDTH))
            {
                let moved = each!(axis in [X, Y] => {
                    L::load(&state.position[axis], slot) - L::load(&self.made[axis], slot)
                });
                let strayed = moved[X] - L::splat(walked) * L::load(&lattice.present, slot);
                // NaN counts as beyond the budget.
                near = near & budget.gt(strayed.abs()) & budget.gt(moved[Y].abs());
            }
            if L::all(near) {
                return Ok(());
            }
        }
        self.make::<L>(system, ground, state)
    }

    #[inline(always)]
    fn make<L: Lanes>(
        &mut self,
        system: &System,
        ground: Ground,
        state: &State,
    ) -> Result<(), UnstableReason> {
        let System { lattice, physics } = system;
        let slack = 2.0 * BUDGET * physics.cell_size;
        if self.made[X].len() == lattice.len {
            // `clone_from` would allocate.
            for axis in [X, Y] {
                self.made[axis].copy_from_slice(&state.position[axis]);
            }
        } else {
            self.made.clone_from(&state.position);
            // Room for all but crumpled bodies, for which the lists grow.
            let surface = lattice.surface.len();
            self.low.reserve(surface);
            self.candidates.reserve(16 * surface);
            self.distant.reserve(4 * surface);
            let blocks = surface.next_multiple_of(BLOCK);
            self.sides = each!(_side in [0, 1, 2, 3] => Buffer::filled(blocks, f64::NAN));
        }
        if !short_sides::<L>(system, state) && !sane(system, state) {
            return Err(UnstableReason::BlownUp);
        }
        self.bounds.clear();
        self.bounds.extend(
            lattice
                .surface
                .iter()
                .map(|voxel| Bounds::of(&quad(voxel, state))),
        );
        for (i, Bounds { low, high }) in self.bounds.iter().enumerate() {
            let ends = [low.x, low.y, high.x, high.y];
            self.sides
                .iter_mut()
                .zip(ends)
                .for_each(|(side, end)| side[i] = end);
        }
        let ground_top = f64::from(physics.ground_row) * physics.cell_size;
        self.low.clear();
        self.candidates.clear();
        self.distant.clear();
        for mover in 0..lattice.surface.len() {
            if self.candidates.len() > MOST_CANDIDATES * lattice.surface.len() {
                return Err(UnstableReason::Overlaps);
            }
            let bounds = self.bounds[mover];
            let may_touch = match ground.terrain {
                None => bounds.low.y <= ground_top + slack,
                Some(terrain) => {
                    let mut is_near = false;
                    let reach = (physics.cell_size, slack);
                    terrain.near(&bounds, ground.start_column, reach, |_| is_near = true);
                    is_near
                }
            };
            if may_touch {
                self.low.push(mover);
            }
            for block in (0..lattice.surface.len()).step_by(L::WIDTH) {
                // Most blocks are far away as a whole.
                if !self.any_near::<L>(&bounds, block, slack) {
                    continue;
                }
                for host in block..lattice.surface.len().min(block + L::WIDTH) {
                    if host != mover && bounds.near(&self.bounds[host], slack) {
                        self.add(lattice, state, [mover, host], slack);
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns true if any surface voxel of a block may be near a box.
    #[inline(always)]
    fn any_near<L: Lanes>(&self, bounds: &Bounds, block: usize, slack: f64) -> bool {
        let [low_x, low_y, high_x, high_y] =
            each!(i in [0, 1, 2, 3] => L::load(&self.sides[i], block));
        // A little more, since these comparisons are strict and touching counts.
        let reach = 1.001 * slack;
        let (left, right) = (
            L::splat(bounds.low.x - reach),
            L::splat(bounds.high.x + reach),
        );
        let (bottom, top) = (
            L::splat(bounds.low.y - reach),
            L::splat(bounds.high.y + reach),
        );
        let across = high_x.gt(left) & right.gt(low_x);
        L::any(across & high_y.gt(bottom) & top.gt(low_y))
    }

    fn add(&mut self, lattice: &Lattice, state: &State, [mover, host]: [usize; 2], slack: f64) {
        let (voxel, other) = (&lattice.surface[mover], &lattice.surface[host]);
        let apart = voxel
            .row
            .abs_diff(other.row)
            .max(voxel.column.abs_diff(other.column));
        if apart > 1 && mover < host {
            self.distant.push([mover, host]);
        }
        for (corner, point) in voxel.corners.iter().enumerate() {
            let place = place(*point, state);
            if !other.corners.contains(point) && self.bounds[host].holds(place, slack) {
                self.candidates.push(Candidate {
                    mover,
                    corner,
                    host,
                });
            }
        }
    }

    /// Returns true if so many distant surface voxels overlap that the simulation is unstable
    /// (physics.md, "Instability").
    pub fn too_many_overlaps(&self, System { lattice, physics }: &System, state: &State) -> bool {
        let most = physics.unstable_ratio * lattice.surface.len() as f64;
        // Ordered pairs: each counts twice. The list is usually too short for a search.
        if (2 * self.distant.len()) as f64 <= most {
            return false;
        }
        let bounds = |voxel: usize| Bounds::of(&quad(&lattice.surface[voxel], state));
        let overlaps = self
            .distant
            .iter()
            .filter(|[a, b]| bounds(*a).near(&bounds(*b), 0.0))
            .count();
        (2 * overlaps) as f64 > most
    }
}
