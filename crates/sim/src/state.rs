//! [`State`]: the part of a simulation that must be saved.

use crate::simd::Buffer;
use crate::system::System;
use crate::terrain::height;

/// Height at which slots without a point are parked \[wu\]: far from every point, above the floor.
const PARKED: f64 = 1e6;

/// The two axes, as indices of a [`Pair`].
pub(crate) const X: usize = 0;
pub(crate) const Y: usize = 1;

/// Both coordinates of a quantity for all slots.
pub(crate) type Pair = [Buffer; 2];

/// Cuts both coordinates to a length, so that the compiler knows it to be the same for many slices.
#[inline(always)]
pub(crate) fn slices([x, y]: &Pair, len: usize) -> [&[f64]; 2] {
    [&x[..len], &y[..len]]
}

#[inline(always)]
pub(crate) fn slices_mut([x, y]: &mut Pair, len: usize) -> [&mut [f64]; 2] {
    [&mut x[..len], &mut y[..len]]
}

pub(crate) fn pair(len: usize) -> Pair {
    [Buffer::zeros(len), Buffer::zeros(len)]
}

/// The saved state of a simulation: 48 bytes a point and the clock. A simulation that continues
/// from a [restored](crate::World::restore) state gives the same bits as one that never stopped.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    /// Positions \[wu\], local x.
    pub(crate) position: Pair,
    /// Integrated velocities \[wu/s\].
    pub(crate) velocity: Pair,
    /// Positions at the end of the previous substep \[wu\]. *True* velocity: (x − previous x)/dt.
    pub(crate) previous: Pair,
    /// Number of control steps completed: the muscles' clock.
    pub(crate) control_step: u64,
}

impl State {
    /// Makes the undeformed body at rest, its bottom row (empty rows count) at a grid row. On a
    /// terrain heights are rounded as EvoGym's: whether a body that begins at a wall or on the
    /// ground touches it is decided by their last bits.
    pub(crate) fn at_rest(
        System { lattice, physics }: &System,
        start_row: u32,
        on_terrain: bool,
    ) -> Self {
        // Slots without a point get positions of their own, so that no distance is 0.
        let parked = (0..lattice.len).map(|i| -1e3 - i as f64).collect();
        let mut position: Pair = [parked, Buffer::filled(lattice.len, PARKED)];
        for &(point, (row, column)) in &lattice.points {
            // Computed from integer grid indices, so that coincident points have the same bits.
            position[X][point] = column as f64 * physics.cell_size;
            position[Y][point] = match on_terrain {
                true => {
                    let bottom = f64::from(start_row);
                    height(bottom, lattice.body_rows, row, physics.cell_size)
                }
                false => (start_row as usize + lattice.body_rows - row) as f64 * physics.cell_size,
            };
        }
        let velocity = pair(lattice.len);
        State {
            previous: position.clone(),
            position,
            velocity,
            control_step: 0,
        }
    }

    pub(crate) fn fits(&self, other: &State) -> bool {
        let lengths = |state: &State| {
            [&state.position, &state.velocity, &state.previous].map(|[x, y]| [x.len(), y.len()])
        };
        lengths(self) == lengths(other)
    }
}
