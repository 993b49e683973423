//! Floor 3: what a robot is asked to do: images, stimuli, protocols, rollouts and their scores.

pub mod evaluation;
pub mod protocol;
pub mod recording;
pub mod rollout;
pub mod direction;
pub mod grouping;
pub mod recording;
pub mod score;
pub mod builtin;
pub mod dataset;
pub mod files;
pub mod idx;
pub mod info;
mod pen;
pub mod recording;
pub mod stimulus;
mod strokes;
