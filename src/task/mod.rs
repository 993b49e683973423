//! A robot's task: stimuli, protocols, rollouts and scores; how a gait responds and is trained.

pub mod answer;
pub mod evaluation;
pub mod fitness;
pub mod grouping;
pub mod margins;
pub mod objective;
pub mod perturbation;
pub mod protocol;
pub mod recording;
pub mod rollout;
pub mod score;
pub mod stimulus;
