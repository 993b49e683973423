//! [`State`]: what a life must remember; and the scratch memory of a substep, which is never kept.

use super::extra::Extra;
use super::forces::{Pulls, Springs, Wide};
use super::lattice::Lattice;
use super::limits::Reach;
use super::neighbours::Neighbours;
use super::params::Physics;
use crate::base::lanes::{BLOCK, Buffer};
use serde::{Deserialize, Serialize};

/// Height at which slots without a point are parked [wu]: out of every point's way, and above the floor.
const PARKED: f64 = 1e6;

/// The two axes, as indices of a [`Pair`].
pub(super) const X: usize = 0;
pub(super) const Y: usize = 1;

/// Both coordinates of something for all slots.
pub(super) type Pair = [Buffer; 2];

/// Its coordinates, cut to a length that the compiler then knows to be the same for many.
#[inline(always)]
pub(super) fn slices([x, y]: &Pair, len: usize) -> [&[f64]; 2] {
    [&x[..len], &y[..len]]
}

/// The same, to be written.
#[inline(always)]
pub(super) fn slices_mut([x, y]: &mut Pair, len: usize) -> [&mut [f64]; 2] {
    [&mut x[..len], &mut y[..len]]
}

/// A pair of zeros.
pub(super) fn pair(len: usize) -> Pair {
    [Buffer::zeros(len), Buffer::zeros(len)]
}

/// What a life must remember: 48 bytes a point and the clock. Continuing from a state is bit for bit the same as
/// not having stopped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Positions \[wu\], local x.
    pub(super) position: Pair,
    /// Integrated velocities \[wu/s\].
    pub(super) velocity: Pair,
    /// Positions at the end of the previous substep \[wu\]: the *true* velocity is (x − previous x) / dt.
    pub(super) previous: Pair,
    /// Control steps lived: the muscles' clock.
    pub(super) control_step: u64,
}

impl State {
    /// The undeformed body at rest, its bottom row (empty rows count) at a grid row.
    pub(super) fn at_rest(lattice: &Lattice, physics: &Physics, start_row: u32) -> Self {
        // Slots without a point get places of their own, so that no distance is 0.
        let parked = (0..lattice.len).map(|i| -1e3 - i as f64).collect();
        let mut position: Pair = [parked, Buffer::filled(lattice.len, PARKED)];
        for &(point, (row, column)) in &lattice.points {
            // From integer grid indices, so that points which coincide do so bit for bit.
            position[X][point] = column as f64 * physics.cell_size;
            position[Y][point] = (start_row as usize + lattice.body_rows - row) as f64 * physics.cell_size;
        }
        let velocity = pair(lattice.len);
        State { previous: position.clone(), position, velocity, control_step: 0 }
    }
}

/// What the stages of a substep leave to each other about a block of slots.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Work {
    pub pulls: Pulls,
    /// Acceleration by all but springs and the stages' differences in drag.
    pub load: [Wide; 2],
    /// Accelerations of the first three stages.
    pub first: [Wide; 2],
    pub second: [Wide; 2],
    pub third: [Wide; 2],
}

/// Memory of a substep, allocated once.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    /// Goal lengths [wu]: horizontal springs by slot, then extra springs.
    pub goals: Buffer,
    /// By blocks.
    pub springs: Vec<Springs>,
    pub work: Vec<Work>,
    /// See [`Gather`](super::forces::Gather).
    pub passing: Pair,
    /// Contact force per point [mass·wu/s²].
    pub contact: Pair,
    /// Positions of the second, third and fourth stage.
    pub stages: [Pair; 3],
    /// New positions and velocities.
    pub position: Pair,
    pub velocity: Pair,
    pub extra: Option<Extra>,
    /// Whether the springs' lengths are forgotten.
    pub anew: bool,
    /// What the latest length limits had to reckon with.
    pub reach: Reach,
    /// Which contacts are possible.
    pub neighbours: Neighbours,
}

impl Scratch {
    pub fn new(lattice: &Lattice, physics: &Physics, state: &State) -> Self {
        let horizontal = (0..lattice.len).map(|_| physics.cell_size);
        let extra = lattice.extra_springs.iter().map(|spring| spring.length);
        let padding = [physics.cell_size; super::extra::GROUP];
        let zeros = [[0.0; BLOCK]; 2];
        let work = Work { pulls: Pulls::ZERO, load: zeros, first: zeros, second: zeros, third: zeros };
        // Slots without a point stay where they are parked.
        let parked = || state.position.clone();
        Scratch {
            goals: horizontal.chain(extra).chain(padding).collect(),
            springs: Springs::blocks(&lattice.stiffness, physics.mass, physics.servo_gain),
            work: vec![work; lattice.slots / BLOCK],
            passing: pair(lattice.len),
            contact: pair(lattice.len),
            stages: [parked(), parked(), parked()],
            position: parked(),
            velocity: pair(lattice.len),
            extra: Extra::new(lattice, physics.mass, physics.servo_gain),
            anew: true,
            reach: Reach::default(),
            neighbours: Neighbours::default(),
        }
    }

    /// At the start of a control step: what a substep leaves to the next but is not part of the state.
    pub fn begin(&mut self) {
        self.anew = true;
        self.springs.iter_mut().for_each(Springs::forget);
        self.extra.iter_mut().for_each(Extra::forget);
    }
}
