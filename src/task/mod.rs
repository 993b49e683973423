//! Floor 3: what a robot is asked to do: images, stimuli, protocols, rollouts and their scores.

pub mod baselines;
pub mod condition;
pub mod direction;
pub mod evaluation;
pub mod fitness;
pub mod grouping;
pub mod perturbation;
pub mod protocol;
pub mod recording;
pub mod refine;
pub mod response;
pub mod rollout;
pub mod score;
pub mod stimulus;
pub mod teach;
pub mod teachable;
