//! [`PaperPlan`]: the experiments and settings of a reproduction of the paper.

use crate::base::error::Error;
use crate::base::files::read_given;
use crate::config::audit::Criteria;
use crate::config::capacity::CapacityConfig;
use crate::config::{Config, reading};
use crate::store::folder;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The built-in plan, which is the paper's.
pub const PAPER_TOML: (&str, &str) = ("paper.toml", include_str!("../../configs/paper.toml"));

/// Plan of a reproduction: its experiments, and how their robots are tested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PaperPlan {
    /// Seeds of each experiment's runs.
    pub(crate) seeds: Vec<u64>,
    /// Number of robots tested per task.
    pub(crate) robots: usize,
    /// Number of test images.
    pub(crate) images: usize,
    /// The experiments.
    pub(crate) experiment: Vec<Experiment>,
    /// Criteria of the audits.
    #[serde(default)]
    pub(crate) audit: Criteria,
    /// Networks to compare robots with.
    #[serde(default)]
    pub(crate) capacity: CapacityConfig,
    /// Folder of the plan, to which paths of configs are relative.
    #[serde(skip)]
    pub(crate) folder: PathBuf,
}

/// An experiment: a config and changes to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Experiment {
    /// A config file, relative to the plan's folder, or the name of a built-in one.
    pub(crate) config: String,
    /// Changes, as with `--set`.
    #[serde(default)]
    pub(crate) set: Vec<String>,
}

/// Fewest test images and trainings at small scales.
const LEAST: [usize; 2] = [100, 5];

impl PaperPlan {
    /// Returns true if a name means the built-in plan, and no file.
    pub(crate) fn is_built_in(name: &str) -> bool {
        let own = PAPER_TOML.0;
        (name == own || own.strip_suffix(".toml") == Some(name)) && !Path::new(name).exists()
    }

    /// Returns the plan as TOML, with the value of every key.
    pub(crate) fn to_toml(&self) -> String {
        toml::to_string_pretty(self)
            .expect("every field is a number, text, list or table, which TOML has")
    }

    /// Reads a plan from a file or, if there is none, the built-in one of that name.
    pub(crate) fn load(name: &str, overrides: &[String]) -> Result<Self, Error> {
        let text = match read_given(Path::new(name)) {
            Err(_) if PaperPlan::is_built_in(name) => PAPER_TOML.1.to_string(),
            Err(error) => return Err(Error::reading(Path::new(name), &error)),
            Ok(text) => text,
        };
        PaperPlan::parse(&text, name, overrides)
    }

    /// Reads a plan from text; `name` is the path that its text has, or would have.
    pub(crate) fn parse(text: &str, name: &str, overrides: &[String]) -> Result<Self, Error> {
        let format = reading::Format::of(Path::new(name));
        let plan: PaperPlan = reading::read(text, format, name)?;
        let folder = Path::new(name).parent().unwrap_or(Path::new(""));
        let placed = |plan: &PaperPlan| PaperPlan {
            folder: folder.to_path_buf(),
            ..plan.clone()
        };
        let check = |plan: &PaperPlan| {
            plan.validate()
                .and_then(|()| placed(plan).experiments().map(|_| ()))
        };
        let plan = reading::changed(plan, overrides, check, |error| {
            reading::placed(error, text, format, name)
        })?;
        Ok(placed(&plan))
    }

    fn validate(&self) -> Result<(), Error> {
        let refuse = |key: &str, text: &str| Err(Error::input(text.to_string()).with_key(key));
        if self.seeds.is_empty() || self.experiment.is_empty() {
            return refuse(
                "experiment",
                "seeds, experiment: expected one or more of each",
            );
        }
        if self.seeds.iter().collect::<BTreeSet<_>>().len() < self.seeds.len() {
            return refuse("seeds", "seeds: expected different ones");
        }
        if self.robots == 0 || self.images == 0 {
            return refuse("images", "robots, images: expected 1 or more");
        }
        self.audit
            .validate()
            .map_err(|error| error.with_key("audit"))?;
        self.capacity
            .validate()
            .map_err(|error| error.with_key("capacity"))
    }

    /// Returns the experiments: names of their runs, and configs. It fails if any is wrong: a slip
    /// in the last one would otherwise show after hours.
    pub(crate) fn experiments(&self) -> Result<Vec<(String, Config)>, Error> {
        let mut experiments = Vec::<(String, Config)>::new();
        for (number, experiment) in (1..).zip(&self.experiment) {
            let key = format!("experiment.{number}");
            let within = |error: Error| {
                error
                    .in_place(&format!("experiment {number}"))
                    .with_key(&key)
            };
            let name = folder::name_of(&self.folder.join(&experiment.config).to_string_lossy());
            if experiments.iter().any(|(other, _)| *other == name) {
                return Err(within(Error::input(format!(
                    "config: {name}: expected once"
                ))));
            }
            if experiment.set.iter().any(|set| {
                set.split('=')
                    .next()
                    .is_some_and(|key| key.trim() == "seed")
            }) {
                return Err(within(Error::input(
                    "set: seed: expected in seeds".to_string(),
                )));
            }
            let config = Config::load_from(&self.folder, &experiment.config, &experiment.set)
                .map_err(within)?;
            for &seed in &self.seeds {
                let seeded = Config {
                    seed,
                    ..config.clone()
                };
                seeded
                    .validate()
                    .map_err(|error| error.in_place("seeds").with_key("seeds"))?;
            }
            let (images, least) = (self.images, config.classes().len());
            if images < least {
                let expected = format!("{least} or more, one of each class of {name}");
                return Err(Error::value("images", images, &expected));
            }
            experiments.push((name, config));
        }
        Ok(experiments)
    }

    /// Scales the plan: generations by `scale`, test images and trainings by its square root.
    #[must_use]
    pub(crate) fn at(&self, scale: f64) -> Self {
        let part = |count: usize, least: usize| {
            ((count as f64 * scale.sqrt()).round() as usize)
                .max(least)
                .min(count.max(least))
        };
        let trainings = part(
            self.capacity.trainings,
            LEAST[1].min(self.capacity.trainings),
        );
        PaperPlan {
            images: part(self.images, LEAST[0].min(self.images)),
            capacity: CapacityConfig {
                trainings,
                ..self.capacity.clone()
            },
            ..self.clone()
        }
    }
}

/// Returns a config with its generations multiplied by `scale`.
pub(crate) fn scaled(config: &Config, scale: f64) -> Config {
    let generations = ((config.generations as f64 * scale).round() as u64).max(1);
    Config {
        generations,
        ..config.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_scale_has_fewer_images_and_trainings_but_never_too_few() {
        let plan = PaperPlan::load(PAPER_TOML.0, &[]).unwrap();
        let sizes = |scale: f64| (plan.at(scale).images, plan.at(scale).capacity.trainings);
        assert_eq!(
            [1.0, 0.25, 0.01, 1e-6].map(sizes),
            [(1000, 50), (500, 25), (100, 5), (100, 5)]
        );
        let few = PaperPlan { images: 30, ..plan };
        assert_eq!(few.at(0.01).images, 30);
    }
}
