//! `validation.json`: the robots of a run that were chosen on validation images.

use crate::base::error::Error;
use crate::base::ranges;
use crate::base::remedy::{Invocation, Remedy};
use crate::config::validation::ValidationConfig;
use crate::shipped::exists;
use crate::store::names::VALIDATION_JSON;
use crate::store::results::{self, Stored};
use crate::store::stored_run::StoredRun;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

pub(crate) const FORMAT: (&str, u32) = ("morphcog-validation", 1);

/// The results of a robot on all validation images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Validated {
    /// The id of the robot.
    pub id: String,
    /// The task of the robot.
    pub(crate) task: String,
    /// The number of images.
    pub images: usize,
    /// The number of images answered correctly.
    pub(crate) right: usize,
    /// The mean over the two groups of the share answered correctly.
    #[serde(deserialize_with = "ranges::share")]
    pub balanced_accuracy: f64,
}

/// The content of `validation.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ValidationFile {
    pub(crate) format: String,
    pub(crate) format_version: u32,
    /// The SHA-256 of the run's content; the file says nothing about later states of the run.
    pub(crate) run_sha256: String,
    /// The SHA-256 of all inputs of the result; empty if the run's own choice is unknown.
    pub(crate) key: String,
    /// The best robots of each task, best first, chosen as in the run's config.
    pub(crate) robots: Vec<Validated>,
    /// The robots chosen in other ways.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) others: Vec<Ranking>,
}

/// Robots not chosen as in the run's config: from others, by more images, or another threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Ranking {
    /// The SHA-256 of everything that the result depends on.
    pub(crate) key: String,
    /// The best robots of each task, best first.
    pub(crate) robots: Vec<Validated>,
}

impl Validated {
    /// Checks that the counts agree; errors name the key.
    pub(crate) fn validate(&self) -> Result<(), Error> {
        match self.right <= self.images && self.images > 0 {
            true => Ok(()),
            false => Err(Error::at_key(
                "right",
                format!("expected at most images, {}", self.images),
            )),
        }
    }
}

/// Checks that every robot occurs once per task, and that counts agree.
fn check_robots(robots: &[Validated]) -> Result<(), Error> {
    for (number, robot) in robots.iter().enumerate() {
        robot
            .validate()
            .map_err(|error| error.in_place(&format!("robots[{number}]")))?;
        let is_it = |other: &Validated| (&other.id, &other.task) == (&robot.id, &robot.task);
        if robots[..number].iter().any(is_it) {
            let text = format!("{} is there twice for {}", robot.id, robot.task);
            return Err(Error::at_key(&format!("robots[{number}].id"), text));
        }
    }
    Ok(())
}

impl Stored for ValidationFile {
    const FORMAT: (&'static str, u32) = FORMAT;

    fn validate(&self) -> Result<(), Error> {
        check_robots(&self.robots)?;
        let others = self.others.iter().enumerate();
        for (number, Ranking { robots, .. }) in others {
            check_robots(robots).map_err(|error| error.in_place(&format!("others[{number}]")))?;
        }
        Ok(())
    }
}

impl ValidationFile {
    /// Returns the robots that were chosen in the way that a key names.
    pub(crate) fn of(&self, key: &str) -> Option<&[Validated]> {
        match self.key == key {
            true => Some(&self.robots),
            false => self
                .others
                .iter()
                .find(|other| other.key == key)
                .map(|other| other.robots.as_slice()),
        }
    }

    /// Reads a file, or returns `None` if there is none.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>, Error> {
        if !exists(path) {
            return Ok(None);
        }
        let anew = Invocation::new("eval").option("robots", "best-validation:1");
        let remedy = Remedy::Run(anew, "chooses robots anew once the file is deleted");
        results::read(path, None)
            .map(Some)
            .map_err(|error| error.remedy(remedy))
    }
}

/// Returns the best robots of a run on validation images, chosen as in its config, if they are
/// known for its present state.
pub(crate) fn ranking(source: &StoredRun) -> Result<Option<Vec<Validated>>, Error> {
    let ValidationConfig { images, best } = source.run.config.validation;
    let file = ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))?;
    let is_of = |file: &ValidationFile| file.run_sha256 == source.run.fingerprint();
    // Earlier versions kept the latest choice, whatever it was.
    let is_own = |robots: &[Validated]| {
        let of_task = |task: &str| robots.iter().filter(|other| other.task == task).count();
        robots
            .iter()
            .all(|robot| robot.images == images && (best == 0 || of_task(&robot.task) <= best))
    };
    let is_known =
        |file: &ValidationFile| is_of(file) && !file.robots.is_empty() && is_own(&file.robots);
    Ok(file.filter(is_known).map(|file| file.robots))
}

/// Returns the largest number of images by which robots in the `validation.json` beside a run were
/// chosen, or `None` without such a file.
pub(crate) fn most_images(source: &StoredRun) -> Result<Option<usize>, Error> {
    let Some(file) = ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))? else {
        return Ok(None);
    };
    let all = file
        .others
        .iter()
        .flat_map(|other| &other.robots)
        .chain(&file.robots);
    Ok(all.map(|robot| robot.images).max())
}
