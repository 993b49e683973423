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
    /// With constants that [`Physics::validate`] refuses a simulation ends, too, but mostly as
    /// unstable.
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
