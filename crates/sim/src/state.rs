//! [`State`]: what a simulation must remember.

use crate::simd::Buffer;
use crate::system::System;

/// Height at which slots without a point are parked [wu]: out of every point's way, and above the
/// floor.
const PARKED: f64 = 1e6;

/// The two axes, as indices of a [`Pair`].
pub(crate) const X: usize = 0;
pub(crate) const Y: usize = 1;

/// Both coordinates of something for all slots.
pub(crate) type Pair = [Buffer; 2];

/// Its coordinates, cut to a length that the compiler then knows to be the same for many.
#[inline(always)]
pub(crate) fn slices([x, y]: &Pair, len: usize) -> [&[f64]; 2] {
    [&x[..len], &y[..len]]
}

/// The same, to be written.
#[inline(always)]
pub(crate) fn slices_mut([x, y]: &mut Pair, len: usize) -> [&mut [f64]; 2] {
    [&mut x[..len], &mut y[..len]]
}

/// A pair of zeros.
pub(crate) fn pair(len: usize) -> Pair {
    [Buffer::zeros(len), Buffer::zeros(len)]
}

/// What a simulation must remember: 48 bytes a point and the clock. Going on from a
/// [restored](crate::World::restore) state is bit for bit the same as not having stopped.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    /// Positions \[wu\], local x.
    pub(crate) position: Pair,
    /// Integrated velocities \[wu/s\].
    pub(crate) velocity: Pair,
    /// Positions at the end of the previous substep \[wu\]: the *true* velocity is (x − previous x)
    /// / dt.
    pub(crate) previous: Pair,
    /// Control steps done: the muscles' clock.
    pub(crate) control_step: u64,
}

impl State {
    /// The undeformed body at rest, its bottom row (empty rows count) at a grid row.
    pub(crate) fn at_rest(System { lattice, physics }: &System, start_row: u32) -> Self {
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

    /// Whether it has as many slots as another.
    pub(crate) fn fits(&self, other: &State) -> bool {
        let lengths = |state: &State| {
            [&state.position, &state.velocity, &state.previous].map(|[x, y]| [x.len(), y.len()])
        };
        lengths(self) == lengths(other)
    }
}
