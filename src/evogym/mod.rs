//! EvoGym's tasks whose ground stands still: their worlds, observations, rewards and ends.
//!
//! Lengths of observations, rewards and limits are EvoGym's *world units*, a tenth of a voxel length.
//! [`tasks::find`] gives a task, [`course::Course`] its ground, and [`environment::Environments`]
//! simulate any number of robots on it.

pub mod course;
pub mod environment;
pub mod robot;
mod sense;
pub mod tasks;
pub mod worlds;
