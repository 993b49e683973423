//! morphcog evolves soft robots whose bodies alone recognise images.
//!
//! The house has floors; a room uses only rooms on lower floors (`tests/architecture.rs` holds it to that):
//!
//! | floor | rooms |
//! |---|---|
//! | 0 | [`base`]: grids, random streams, hashes |
//! | 1 | [`body`]: voxels and materials |
//! | 2 | `sim`: the physics; `genome`: CPPNs; `qd`: archives and MAP-Elites |
//! | 3 | [`task`]: images, stimuli, protocols, rollouts, scores |
//! | 4 | `run`: one file per command |
//! | 5 | `view`: pictures and the terminal |
//! | 6 | `cli` |

pub mod base;
pub mod body;
pub mod cli;
pub mod genome;
pub mod qd;
pub mod run;
pub mod sim;
pub mod task;
pub mod view;
