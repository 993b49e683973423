//! Floor 3: what a robot is asked to do: images, stimuli, protocols, rollouts and their scores.

pub mod baselines;
pub mod builtin;
pub mod condition;
pub mod dataset;
pub mod direction;
pub mod evaluation;
pub mod files;
pub mod fitness;
pub mod grouping;
pub mod idx;
mod influences;
pub mod info;
mod pen;
pub mod perturbation;
pub mod protocol;
pub mod race;
pub mod recording;
pub mod response;
pub mod rollout;
pub mod score;
pub mod stimulus;
mod strokes;
pub mod surrogate;
pub mod teach;
