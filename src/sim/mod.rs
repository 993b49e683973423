//! Floor 2: the physics, a mass–spring lattice on flat ground as in EvoGym (`physics.md` is the specification).
//!
//! A [`Lattice`] is what is fixed for a life, a [`State`] what changes, a [`World`] both together with the
//! constants ([`Physics`]). The simulator knows no evolution, digits, files, clocks or random numbers.
//!
//! Positions are *local*: x is measured from the left edge of the robot's starting box. So a life does not
//! depend on where on the ground the robot stands (but for the pegs below it, which count columns).

mod actuation;
mod contact;
mod energy;
mod extra;
mod forces;
mod geometry;
mod integrator;
mod lattice;
mod limits;
mod neighbours;
pub mod params;
mod refinement;
mod series;
mod state;
mod world;

pub use actuation::width;
pub use energy::Energy;
pub use lattice::Lattice;
pub use params::{Physics, PhysicsError};
pub use state::State;
pub use world::{Start, Unstable, UnstableReason, World};
