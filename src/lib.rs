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
//! | 2 | [`qd`] | archives and MAP-Elites over any type of solution | [`qd::map_elites`] |
//! | 2 | [`baseline`] | networks that robots are compared with | [`baseline::train`] |
//! | 2 | [`data`] | datasets: IDX files, imports, drawn digits | [`data::dataset::Dataset`] |
//! | 3 | [`task`] | stimuli, protocols, rollouts, answers and scores | [`task::evaluation`] |
//! | 3 | [`evogym`] | EvoGym's tasks: worlds, observations, rewards, ends | [`evogym::environment::Environments`] |
//! | 4 | [`response`] | how a gait responds, and what training could reach with it | [`response::gait::Gait`] |
//! | 5 | [`config`] | everything a run depends on; errors with line and key | [`config::Config`] |
//! | 6 | [`store`] | the files of a run's folder as plain data | [`store::run::RunFile`] |
//! | 7 | [`images`] | which images are meant, and what robots see of them | [`images::training::TrainingImages`] |
//! | 8 | [`robots`] | which robots are meant | [`robots::selection::Selection`] |
//! | 9 | [`search`] | evolution and the choice of robots by validation | [`search::evolve`] |
//! | 10 | [`training`] | rounds and races that train a gait | [`training::rounds`] |
//! | 10 | [`analysis`] | verdicts, votes, the paper's numbers | [`analysis::verdict`] |
//! | 11 | [`draw`] | pictures, figures, reports | [`draw::walk`] |
//! | 12 | [`commands`] | one file per command: options in, result out | [`commands::evolve`] |
//! | 13 | [`serve`] | the page on which the user draws digits, over HTTP | [`serve::Service`] |
//! | 14 | [`cli`] | the command line and its output | [`cli::Cli`] |
//!
//! # Examples
//!
//! Simulate a body:
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
//!
//! Evolve bodies; the run's folder is what `morphcog evolve` writes:
//!
//! ```
//! use morphcog::base::session::Session;
//! use morphcog::commands::evolve::{EvolveOptions, evolve};
//! use morphcog::config::Config;
//! use morphcog::store::folder::IfExists;
//!
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! let set = ["generations=3", "validation.best=0"].map(String::from);
//! let options = EvolveOptions {
//!     config: Config::load("quickstart.toml", &set)?,
//!     name: "quickstart".to_string(),
//!     out: folder.join("run"),
//!     if_exists: IfExists::Refuse,
//! };
//! let run = evolve(&options, &Session::default())?.run;
//! assert_eq!(run.generations, 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Train a gait that ships with the program to tell two digits apart, here with far too few
//! rollouts:
//!
//! ```
//! use morphcog::base::session::Session;
//! use morphcog::commands::train::{TrainOptions, train};
//! use morphcog::robots::selection::Selection;
//! use morphcog::store::folder::IfExists;
//!
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! let few = [
//!     "data.dataset=builtin", "train.random_images=60", "train.rounds=1", "train.images=20",
//!     "train.final_images=20", "train.challengers=1", "train.images_per_class=40",
//!     "train.windows=0", "validation.best=0",
//! ];
//! let options = TrainOptions {
//!     archive: "gallery:gaits-6/run.json".into(),
//!     robots: Selection::Top(1),
//!     groups: "4|9".parse()?,
//!     seed: Some(1),
//!     set: few.map(String::from).to_vec(),
//!     name: "4v9".to_string(),
//!     out: folder.join("4v9"),
//!     if_exists: IfExists::Refuse,
//! };
//! let robot = &train(&options, &Session::default())?.run.elites[0];
//! println!("robot {} has a fitness of {:.2}", robot.id, robot.objective);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Read a run, and draw a figure of its archive:
//!
//! ```
//! use morphcog::draw::plot;
//! use morphcog::store::run::RunFile;
//! use std::path::Path;
//!
//! // Any run.json; this one ships with the program.
//! let run = RunFile::read(Path::new("gallery:zero_one-1/run.json"))?;
//! let best = run.best().ok_or("the archive is empty")?;
//! println!("robot {} performs {}: {}", best.id, best.task, best.body);
//! let svg = plot::archive(&run, &plot::Style::default()).svg();
//! assert!(svg.starts_with("<svg"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]
// Links to private items lead somewhere in the docs for maintainers, which are built with them.
#![allow(rustdoc::private_intra_doc_links)]
// Without the command line, much of the crate has no caller.
#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]
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
pub mod evogym;
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
