//! [`System`]: a body under some physics.

use crate::body::Body;
use crate::lattice::Lattice;
use crate::physics::Physics;

/// A body under some physics: all that stays as it is during a simulation.
///
/// Worlds share it by `Arc`. Points, springs and surface are worked out from the body and the
/// constants here and nowhere else, so they cannot belong to other constants than those that the
/// simulation uses.
#[derive(Clone, Debug)]
pub struct System {
    pub(crate) physics: Physics,
    pub(crate) lattice: Lattice,
}

impl System {
    /// A body under some physics.
    ///
    /// Constants are not checked here: call [`Physics::validate`] first. With those that it refuses,
    /// a simulation mostly ends as unstable; it may also take very long.
    ///
    /// # Panics
    /// With some constants that [`Physics::validate`] refuses the simulation panics: if `cycle_steps`
    /// or `peg_spacing` is 0, if `target_min` is above `target_max`, if one of these two is NaN.
    /// Others may.
    pub fn new(body: &Body, physics: Physics) -> Self {
        System { lattice: Lattice::new(body, &physics), physics }
    }

    /// The constants.
    pub fn physics(&self) -> &Physics {
        &self.physics
    }

    /// Number of points.
    pub fn point_count(&self) -> usize {
        self.lattice.points.len()
    }
}
