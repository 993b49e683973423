//! `morphcog train`: trains the gaits of an archive to tell two groups of images apart.
//!
//! The method is described in [`rounds`]. Every rollout is kept in `training.json` beside
//! `run.json`. A resumed training reuses them, so it ends with the same bits.

mod config;
pub(crate) mod gaits;
pub(crate) mod log;
pub(crate) mod prediction;
pub(crate) mod race;
pub(crate) mod rollouts;
pub(crate) mod rounds;
pub(crate) mod trainer;
pub(crate) mod window;

pub(crate) use config::check;
pub(crate) use config::{
    changed, check_groups, class_names, config_of, groups_of, with_fitting_margin, with_images,
};
