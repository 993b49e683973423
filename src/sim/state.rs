//! [`State`]: what a life must remember; and the scratch memory of a substep, which is never kept.

use super::lattice::Lattice;
use super::neighbours::Neighbours;
use super::params::Physics;
use serde::{Deserialize, Serialize};

/// Height at which slots without a point are parked [wu]: out of every point's way, and above the floor.
const PARKED: f64 = 1e6;

/// What a life must remember: 48 bytes a point and the clock. Continuing from a state is bit for bit the same as
/// not having stopped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Positions \[wu\], local x.
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    /// Integrated velocities \[wu/s\].
    pub(super) vx: Vec<f64>,
    pub(super) vy: Vec<f64>,
    /// Positions at the end of the previous substep \[wu\]: the *true* velocity is (x − previous x) / dt.
    pub(super) previous_x: Vec<f64>,
    pub(super) previous_y: Vec<f64>,
    /// Control steps lived: the muscles' clock.
    pub(super) control_step: u64,
}

impl State {
    /// The undeformed body at rest, its bottom row (empty rows count) at a grid row.
    pub(super) fn at_rest(lattice: &Lattice, physics: &Physics, start_row: u32) -> Self {
        // Slots without a point get places of their own, so that no distance is 0.
        let mut x: Vec<f64> = (0..lattice.len).map(|i| -1e3 - i as f64).collect();
        let mut y = vec![PARKED; lattice.len];
        for &(point, (row, column)) in &lattice.points {
            // From integer grid indices, so that points which coincide do so bit for bit.
            x[point] = column as f64 * physics.cell_size;
            y[point] = (start_row as usize + lattice.body_rows - row) as f64 * physics.cell_size;
        }
        let still = vec![0.0; lattice.len];
        State {
            previous_x: x.clone(),
            previous_y: y.clone(),
            x,
            y,
            vx: still.clone(),
            vy: still,
            control_step: 0,
        }
    }
}

/// One of the two coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    X,
    Y,
}

/// Two coordinates of many points.
#[derive(Clone, Debug, Default)]
pub(super) struct Pair {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
}

impl Pair {
    fn zeros(len: usize) -> Self {
        Pair { x: vec![0.0; len], y: vec![0.0; len] }
    }

    #[inline(always)]
    pub fn along(&self, axis: Axis) -> &[f64] {
        if axis == Axis::X { &self.x } else { &self.y }
    }

    #[inline(always)]
    pub fn along_mut(&mut self, axis: Axis) -> &mut [f64] {
        if axis == Axis::X { &mut self.x } else { &mut self.y }
    }
}

/// Memory of a substep, allocated once.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    /// Goal lengths [wu]: horizontal slots, then extra springs.
    pub goals: Vec<f64>,
    /// Rest lengths of this substep [wu], by family; the extra springs' last.
    pub rest: [Vec<f64>; 4],
    pub extra_rest: Vec<f64>,
    /// What each spring adds to its first point (and takes from its second), by family; `margin` zeros in front.
    pub pull: [Pair; 4],
    /// Zeros in front of `pull`, so that a point can ask for springs of slots before the first.
    pub margin: usize,
    /// Contact force and weight per point [mass·wu/s²].
    pub external: Pair,
    /// Weight per point, 0 where there is none.
    pub weight: Vec<f64>,
    /// RK4: stage positions and velocities, accelerations, weighted sums of both.
    pub stage: Pair,
    pub stage_velocity: Pair,
    pub acceleration: Pair,
    pub sum_velocity: Pair,
    pub sum_acceleration: Pair,
    /// Which contacts are possible.
    pub neighbours: Neighbours,
}

impl Scratch {
    pub fn new(lattice: &Lattice, physics: &Physics) -> Self {
        let zeros = || Pair::zeros(lattice.len);
        let margin = lattice.families[2].to;
        let mut goals = vec![physics.cell_size; lattice.slots];
        goals.extend(lattice.extra_springs.iter().map(|spring| spring.length));
        let mut weight = vec![0.0; lattice.len];
        for &(point, _) in &lattice.points {
            weight[point] = -physics.mass * physics.gravity;
        }
        Scratch {
            goals,
            rest: lattice.families.each_ref().map(|family| vec![family.length; lattice.slots]),
            extra_rest: vec![0.0; lattice.extra_springs.len()],
            pull: std::array::from_fn(|_| Pair::zeros(margin + lattice.slots)),
            margin,
            external: zeros(),
            weight,
            stage: zeros(),
            stage_velocity: zeros(),
            acceleration: zeros(),
            sum_velocity: zeros(),
            sum_acceleration: zeros(),
            neighbours: Neighbours::default(),
        }
    }
}
