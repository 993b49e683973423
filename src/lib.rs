//! morphcog evolves soft robots whose bodies alone recognise images.
//!
//! A robot has no controller. Its muscle voxels oscillate, its sensor voxels swell or shrink with
//! one pixel of an image each, and it is to walk left under some classes of images and right under
//! the others. MAP-Elites evolves such bodies; the physics follows EvoGym's model.
//!
//! # The layers
//!
//! A module uses only modules of lower layers. Below them all is the simulator, [`sim`], a crate of
//! its own (`morphcog-sim`) for the physics alone. Begin there with [`sim::World`].
//!
//! | layer | module | contents | begin with |
//! |---|---|---|---|
//! | 0 | [`base`] | random streams, hashes, file writes, errors, sessions | [`base::session::Session`] |
//! | 1 | [`body`] | the simulator's bodies and their identities | [`body::Body`] |
//! | 1 | [`shipped`] | runs that ship with the program or lie in the atlas, by name | [`shipped::gallery`] |
//! | 2 | [`genome`] | CPPNs and their mutations | [`genome::Genome`] |
//! | 2 | [`qd`] | archives and MAP-Elites over any type of solution | [`qd::MapElites`] |
//! | 2 | [`baseline`] | networks that robots are compared with | [`baseline::train`] |
//! | 2 | [`data`] | the IDX reader, datasets, drawn digits | [`data::dataset::Dataset`] |
//! | 3 | [`task`] | stimuli, protocols, rollouts, answers and scores | [`task::evaluation`] |
//! | 4 | [`response`] | how a gait responds, and what training could reach with it | [`response::gait::Gait`] |
//! | 5 | [`config`] | everything a run depends on; errors with line and key | [`config::Config`] |
//! | 6 | [`store`] | the files of a run's folder as plain data | [`store::run::RunFile`] |
//! | 7 | [`images`] | which images are meant, and what robots see of them | [`images::training::Training`] |
//! | 8 | [`robots`] | which robots are meant | [`robots::selection::Selection`] |
//! | 9 | [`search`] | evolution and the choice of robots by validation | [`search::evolve`] |
//! | 10 | [`training`] | rounds and races that train a gait | [`training::rounds`] |
//! | 10 | [`analysis`] | verdicts, votes, the paper's numbers | [`analysis::verdict`] |
//! | 11 | [`draw`] | pictures, figures, reports | [`draw::Walk`] |
//! | 12 | [`commands`] | one file per command: options in, result out | [`commands::evolve`] |
//! | 13 | [`serve`] | the page on which the user draws digits, over HTTP | [`serve::Service`] |
//! | 14 | [`cli`] | the command line and its output | [`cli::Cli`] |
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
// Tests may use all of these.
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

pub mod analysis;
pub mod base;
pub mod baseline;
pub mod body;
#[cfg(feature = "cli")]
pub mod cli;
pub mod commands;
pub mod config;
pub mod data;
#[cfg(feature = "figures")]
pub mod draw;
pub mod genome;
pub mod images;
pub mod qd;
pub mod response;
pub mod robots;
pub mod search;
#[cfg(feature = "serve")]
pub mod serve;
pub mod shipped;
pub mod store;
pub mod task;
pub mod training;

pub use morphcog_sim as sim;
