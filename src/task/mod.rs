//! A robot's task: stimuli, protocols, rollouts and scores; how a gait responds and is trained.

pub mod answer;
pub(crate) mod class_names;
pub mod evaluation;
pub mod fitness;
pub(crate) mod gates;
pub(crate) mod grouping;
pub mod margins;
pub(crate) mod objective;
pub(crate) mod perturbation;
pub mod protocol;
pub mod recording;
pub mod rollout;
pub mod score;
pub mod stimulus;
pub mod terrain;
pub mod trace;
