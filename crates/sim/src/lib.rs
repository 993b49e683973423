//! EvoGym's soft-robot physics: a fast mass–spring lattice on flat ground, the same bits anywhere.
//!
//! A [`Body`] is a grid of voxels: rigid, soft, muscles that oscillate, and sensors that follow a
//! pixel each. A [`System`] is a body under some [`Physics`]; a [`World`] simulates it. Neither
//! knows anything of evolution, images, files, clocks or random numbers.
//!
//! ```
//! use morphcog_sim::{Body, Grid, Physics, Start, System, World};
//!
//! // Two rows from the top: muscles in phase (3) and antiphase (4), an expanding sensor (6).
//! let body: Body = "336/446".parse()?;
//! let mut world = World::new(System::new(&body, Physics::default()), Start { column: 0, row: 2 });
//! world.set_stimulus(&Grid::from_rows(vec![vec![0.0, 0.0, 1.0], vec![0.0, 0.0, 1.0]])?);
//! for _ in 0..50 {
//!     world.step()?;
//! }
//! let [x, _] = world.centre_of_mass();
//! println!("after one actuation cycle at {:.2} voxel lengths", 10.0 * x);
//! # assert!(x > 0.0 && x < 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Worlds share a system: any number of them, on any number of threads, take an `Arc` of it.
//!
//! ```
//! # use morphcog_sim::{Body, Physics, Start, System, World};
//! use std::sync::Arc;
//!
//! # let body: Body = "336/446".parse()?;
//! let system = Arc::new(System::new(&body, Physics::default()));
//! let ways = [2, 3].map(|row| {
//!     let system = Arc::clone(&system);
//!     std::thread::spawn(move || {
//!         let mut world = World::new(system, Start { column: 0, row });
//!         (0..50).try_for_each(|_| world.step()).map(|()| world.centre_of_mass()[0])
//!     })
//! });
//! # for way in ways { way.join().unwrap()?; }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Simulations of a mostly rigid body are faster side by side, with the same bits: [`Worlds`].
//!
//! The feature `serde` (off by default) reads and writes bodies, grids, constants and states.
//!
//! # Same bits
//!
//! The loops are compiled for several [instruction sets](InstructionSet). The program chooses the
//! widest that the machine has when it runs. All of them give the same bits.
//!
//! Positions are *local*: x is measured from the left edge of the robot's starting box. So a
//! simulation does not depend on where on the ground the robot stands, except for the pegs below
//! it, which count columns.
//!
//! The rest of this page is the specification, `physics.md`, whose sections the code cites.
//!
#![doc = include_str!("../physics.md")]
// Tests may panic and print.
#![cfg_attr(
    not(test),
    deny(
        clippy::dbg_macro,
        clippy::panic,
        clippy::print_stderr,
        clippy::print_stdout,
        clippy::todo,
        clippy::unimplemented,
        clippy::unreachable,
        clippy::unwrap_used
    )
)]
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod body;
mod energy;
mod gauge;
pub mod grid;
mod lattice;
mod physics;
mod refine;
mod scratch;
mod simd;
mod state;
mod step;
pub mod stop;
mod system;
mod terrain;
mod unstable;
mod world;
mod worlds;

pub use body::{Body, Material};
pub use energy::Energy;
pub use gauge::{EnergyGauge, EnergyNow};
pub use grid::Grid;
pub use physics::{Physics, PhysicsError};
pub use simd::{FloatEnvironment, InstructionSet};
pub use state::State;
pub use step::actuation::width;
pub use system::System;
pub use terrain::{Terrain, TerrainError, TerrainObject};
pub use unstable::{StepError, Unstable, UnstableReason};
pub use world::{Start, StartError, StateMismatch, TargetsError, World};
pub use worlds::Worlds;
