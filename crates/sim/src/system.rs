//! [`System`]: a body under some physics.

use crate::body::Body;
use crate::lattice::Lattice;
use crate::physics::Physics;

/// A body under some physics: all that stays constant during a simulation.
///
/// Worlds share it by `Arc`. Points, springs and surface are derived from the body and the
/// constants only here, so they always match the constants that the simulation uses.
#[derive(Clone, Debug)]
pub struct System {
    pub(crate) physics: Physics,
    pub(crate) lattice: Lattice,
}

impl System {
    /// Builds the system of a body under some physics.
    ///
    /// Constants are not checked here: call [`Physics::validate`] first. With constants that it
    /// refuses, a simulation mostly ends as unstable; it may also take very long.
    ///
    /// # Panics
    /// The simulation panics with some constants that [`Physics::validate`] refuses: if
    /// `cycle_steps` or `peg_spacing` is 0, if `target_min` is above `target_max`, or if one of
    /// these two is NaN. It may with others.
    pub fn new(body: &Body, physics: Physics) -> Self {
        System {
            lattice: Lattice::new(body, &physics),
            physics,
        }
    }

    /// Returns the constants.
    pub fn physics(&self) -> &Physics {
        &self.physics
    }

    /// Returns the number of points.
    pub fn point_count(&self) -> usize {
        self.lattice.points.len()
    }
}
