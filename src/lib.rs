//! morphcog evolves soft robots whose bodies alone recognise images.
//!
//! A robot has no controller. Its muscle voxels oscillate, its sensor voxels swell or shrink with one pixel of an image
//! each, and it is to walk left under some classes of images and right under the others. MAP-Elites evolves such
//! bodies; the physics follows EvoGym's model.
//!
//! # The map of the house
//!
//! The house has floors; a room uses only rooms on lower floors, never one beside it.
//!
//! | floor | room | what is in it | begin with |
//! |---|---|---|---|
//! | 0 | [`base`] | grids, random streams, hashes, wide lanes, whole-file writes | [`base::Grid`] |
//! | 1 | [`body`] | materials and bodies | [`body::Body`] |
//! | 2 | [`sim`] | the physics, and nothing else | [`sim::World`] |
//! | 2 | [`genome`] | CPPNs and their mutations | [`genome::Genome`] |
//! | 2 | [`qd`] | archives and MAP-Elites over any type of solution | [`qd::MapElites`] |
//! | 2 | [`baseline`] | networks that robots are compared with | [`baseline::train`] |
//! | 3 | [`task`] | images, stimuli, protocols, rollouts, scores, baselines | [`task::evaluation`] |
//! | 4 | [`run`] | what the commands do, one file per command | [`run::evolve`] |
//! | 5 | [`view`] | pictures, the terminal, the page of `serve` | [`view::pictures`] |
//! | 6 | [`cli`] | the command line | [`cli::Cli`] |
//!
//! # A life
//!
//! ```
//! use morphcog::base::Grid;
//! use morphcog::body::Body;
//! use morphcog::sim::{Lattice, Physics, Start, World};
//!
//! // Two rows from the top: muscles in phase (3) and antiphase (4), an expanding sensor (6).
//! let body: Body = "336/446".parse()?;
//! let physics = Physics::default();
//! let lattice = Lattice::new(&body, &physics);
//! let mut world = World::new(&lattice, &physics, Start { column: 0, row: 2 });
//! world.set_stimulus(&Grid::from_fn(2, 3, |_, column| if column == 2 { 1.0 } else { 0.0 }));
//! for _ in 0..50 {
//!     world.step()?;
//! }
//! let [x, _] = world.centre_of_mass();
//! println!("after one actuation cycle at {:.2} voxel lengths", 10.0 * x);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod base;
pub mod baseline;
pub mod body;
pub mod cli;
pub mod genome;
pub mod qd;
pub mod run;
pub mod sim;
pub mod task;
pub mod view;
