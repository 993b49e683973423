//! morphcog evolves soft robots whose bodies alone recognise images.
//!
//! A robot has no controller. Its muscle voxels oscillate, its sensor voxels swell or shrink with one pixel of an image
//! each, and it is to walk left under some classes of images and right under the others. MAP-Elites evolves such
//! bodies; the physics follows EvoGym's model.
//!
//! # The map of the house
//!
//! The house has floors; a room uses only rooms on lower floors, never one beside it. Below all of them is a crate of its own, the
//! simulator: [`sim`] (`morphcog-sim`), the physics and nothing else. Begin there with [`sim::World`].
//!
//! | floor | room | what is in it | begin with |
//! |---|---|---|---|
//! | 0 | [`base`] | random streams, hashes, whole-file writes, numbers as text | [`base::random`] |
//! | 1 | [`body`] | bodies, which are the simulator's, and what they are known by | [`body::Body`] |
//! | 2 | [`genome`] | CPPNs and their mutations | [`genome::Genome`] |
//! | 2 | [`qd`] | archives and MAP-Elites over any type of solution | [`qd::MapElites`] |
//! | 2 | [`baseline`] | networks that robots are compared with | [`baseline::train`] |
//! | 3 | [`task`] | images, stimuli, protocols, rollouts, scores, baselines | [`task::evaluation`] |
//! | 4 | [`run`] | what the commands do, one file per command | [`run::evolve`] |
//! | 5 | [`view`] | pictures, the terminal, the page of `serve` | [`view::pictures`] |
//! | 6 | [`cli`] | the command line | [`cli::Cli`] |
//!
//! # A rollout
//!
//! ```
//! use morphcog::base::Grid;
//! use morphcog::sim::{Body, Physics, System};
//! use morphcog::task::protocol::Protocol;
//! use morphcog::task::rollout::Rollout;
//! use std::sync::Arc;
//!
//! // Two rows from the top: muscles in phase (3) and antiphase (4), an expanding sensor (6).
//! let body: Body = "336/446".parse()?;
//! let system = Arc::new(System::new(&body, Physics::default()));
//! let protocol = Protocol { control_steps: 50, ..Protocol::default() };
//! let mut rollout = Rollout::new(&system, &protocol);
//! let image = Grid::from_fn(2, 3, |_, column| if column == 2 { 1.0 } else { 0.0 });
//! println!("walked {:.2} voxel lengths", rollout.show(&image, |_| ())?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]
// In tests all of this may be.
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

pub mod base;
pub mod baseline;
pub mod body;
pub mod cli;
pub mod genome;
pub mod qd;
pub mod run;
pub mod task;
pub mod view;

pub use morphcog_sim as sim;
