//! morphcog evolves soft robots whose bodies alone recognise images.
//!
//! A robot has no controller. Its muscle voxels oscillate, its sensor voxels swell or shrink with
//! one pixel of an image each, and it is to walk left under some classes of images and right under
//! the others. MAP-Elites evolves such bodies; the physics follows EvoGym's model.
//!
//! # The layers
//!
//! A module uses only modules of lower layers. Below all of them is a crate of its own, the
//! simulator: [`sim`] (`morphcog-sim`), the physics and nothing else. Begin there with
//! [`sim::World`].
//!
//! | layer | module | what is in it | begin with |
//! |---|---|---|---|
//! | 0 | [`base`] | random streams, hashes, whole-file writes, errors, observers, tables | [`base::error::Error`] |
//! | 1 | [`body`] | bodies, which are the simulator's, and what they are known by | [`body::Body`] |
//! | 2 | [`genome`] | CPPNs and their mutations | [`genome::Genome`] |
//! | 2 | [`qd`] | archives and MAP-Elites over any type of solution | [`qd::MapElites`] |
//! | 2 | [`baseline`] | networks that robots are compared with | [`baseline::train`] |
//! | 2 | [`data`] | the IDX reader, where datasets lie and come from, drawn digits | [`data::dataset::Dataset`] |
//! | 3 | [`task`] | stimuli, protocols, rollouts, scores, responses and teaching | [`task::evaluation`] |
//! | 4 | [`config`] | everything a run depends on, with line and key of what is wrong | [`config::Config`] |
//! | 5 | [`store`] | every file of a run's folder as plain data; which robots are meant | [`store::run::RunFile`] |
//! | 6 | [`search`] | evolution, training, choice on validation images | [`search::evolve`] |
//! | 7 | [`analysis`] | responses, verdicts, the published robots and numbers | [`analysis::measure`] |
//! | 8 | [`commands`] | what the commands do, one file a command: options in, result out | [`commands::eval`] |
//! | 9 | [`view`] | pictures, figures, reports | [`view::Walk`] |
//! | 10 | [`serve`] | the page on which one draws a digit, over HTTP | [`serve::Service`] |
//! | 11 | [`cli`] | the command line, and what it shows on a terminal | [`cli::Cli`] |
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
