//! [`Criteria`]: the changes of an audit and the criteria of its verdicts.

use crate::base::error::Error;
use crate::config::reading;
use crate::task::perturbation::Sizes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The changes and criteria of an audit; keys of `--criteria FILE` and `--set`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Criteria {
    /// The walk up to which a robot gives no answer \[voxel lengths\]. Default 3, as in `eval`.
    pub(crate) threshold: f64,
    /// The limit in a changed simulation \[voxel lengths\]. Lower than `threshold`, so that
    /// borderline walkers do not fail on a tiny change. Default 1.5.
    pub(crate) least_walk: f64,
    /// The least share of training images that a walker answers, correctly or not. Default 0.75.
    pub(crate) least_answered: f64,
    /// The least share of correct answers that a persistent rollout keeps. Default 0.9.
    pub(crate) least_kept: f64,
    /// The least share of the total walk under these images that it keeps. Default 0.5.
    pub(crate) least_distance: f64,
    /// The least share of rollouts in a changed world (stiffness, friction, gravity, pixels) that a
    /// robust robot keeps. If another change breaks a robust robot, it exploits what was changed;
    /// other robots are fragile. Default 0.75.
    pub(crate) least_robust: f64,
    /// The kinds and sizes of changes.
    pub(crate) perturbations: Sizes,
}

impl Default for Criteria {
    fn default() -> Self {
        Criteria {
            threshold: 3.0,
            least_walk: 1.5,
            least_answered: 0.75,
            least_kept: 0.9,
            least_distance: 0.5,
            least_robust: 0.75,
            perturbations: Sizes::default(),
        }
    }
}

impl Criteria {
    /// Reads criteria from TOML (or JSON, if the name ends so); missing keys have their defaults.
    pub(crate) fn load(path: Option<&Path>, overrides: &[String]) -> Result<Self, Error> {
        reading::load(path, overrides, Criteria::validate)
    }

    /// Checks what types cannot.
    pub(crate) fn validate(&self) -> Result<(), Error> {
        let Sizes {
            start,
            time_step,
            share,
            pixels,
            least_sensors: _,
            seed,
        } = &self.perturbations;
        let shares = [
            self.least_answered,
            self.least_kept,
            self.least_distance,
            self.least_robust,
        ];
        let refuse = |key: &str, text: &str| {
            Err(Error::input(format!("audit criteria: {text}")).with_key(key))
        };
        if ![self.threshold, self.least_walk]
            .iter()
            .all(|walk| (0.0..1e9).contains(walk))
        {
            return refuse(
                "threshold",
                "threshold, least_walk: expected 0 or more voxel lengths",
            );
        }
        if !shares.iter().all(|share| (0.0..=1.0).contains(share)) {
            return refuse("least_kept", "least_…: expected shares from 0 to 1");
        }
        if start.iter().any(|&rows| rows == 0 || rows > 100) {
            return refuse(
                "perturbations.start",
                "perturbations.start: expected 1 to 100 rows",
            );
        }
        if time_step.iter().any(|&by| !(2..=64).contains(&by)) {
            return refuse(
                "perturbations.time_step",
                "perturbations.time_step: expected divisors from 2 to 64",
            );
        }
        if !(*share > 0.0 && *share < 1.0) || *pixels > 1000 || *seed > i64::MAX as u64 {
            return refuse(
                "perturbations",
                "perturbations: expected share above 0 and below 1, pixels up to 1000, seed below 2⁶³",
            );
        }
        Ok(())
    }
}
