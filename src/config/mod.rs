//! [`Config`]: everything a run depends on, in TOML or JSON with the same keys.

pub mod audit;
pub mod capacity;
pub(crate) mod evaluation;
mod expected;
pub(crate) mod pair;
pub(crate) mod reading;
pub(crate) mod task;
pub(crate) mod train;
pub(crate) mod validation;

use crate::base::error::Error;
use crate::base::files::{home_expanded, read_given};
use crate::base::remedy::{Invocation, Remedy};
use crate::body::MAX_SIDE;
use crate::config::evaluation::EvaluationConfig;
use crate::config::reading::Format;
pub(crate) use crate::config::task::TaskConfig;
use crate::config::train::TrainConfig;
use crate::config::validation::{LEAST, ValidationConfig};
use crate::data::builtin::BuiltinDigits;
use crate::data::dataset::{Dataset, is_drawn};
use crate::data::description::check_names;
use crate::data::files::check_name;
use crate::genome::{BodySpec, MutationParams};
use crate::qd::EmitterParams;
use crate::response::objective::GaitResponse;
use crate::sim::Physics;
use crate::task::class_names::ClassNames;
use crate::task::evaluation::Savings;
use crate::task::fitness::{Fitness, LEAST_IMAGES};
use crate::task::grouping::Grouping;
use crate::task::objective::{Objective, Recognition};
use crate::task::protocol::RolloutMode;
use crate::task::protocol::{MAX_COLUMN, MAX_ROW, MAX_STEPS, Protocol};
use crate::task::stimulus::{Reduction, StimulusParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The configs that are part of the program: name and text.
pub const BUILT_IN: [(&str, &str); 7] = [
    (
        "quickstart.toml",
        include_str!("../../configs/quickstart.toml"),
    ),
    ("gates.toml", include_str!("../../configs/gates.toml")),
    ("zero_one.toml", include_str!("../../configs/zero_one.toml")),
    (
        "zero_one_published.toml",
        include_str!("../../configs/zero_one_published.toml"),
    ),
    (
        "four_digit.toml",
        include_str!("../../configs/four_digit.toml"),
    ),
    (
        "four_digit_published.toml",
        include_str!("../../configs/four_digit_published.toml"),
    ),
    ("gaits.toml", include_str!("../../configs/gaits.toml")),
];

/// The largest whole number of a config, including seeds: TOML's are signed.
pub(crate) const MAX_NUMBER: u64 = i64::MAX as u64;

/// The largest absolute offset of the QD score \[voxel lengths\].
const MAX_OFFSET: f64 = 1e9;

/// Everything a run depends on. Every key except `task` and `data` has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The seed of all random numbers. Default 1.
    #[serde(default = "one")]
    pub seed: u64,
    /// Generations, including the first, random one. Default 30000, the paper's.
    #[serde(default = "paper_generations")]
    #[schemars(range(min = 1))]
    pub generations: u64,
    /// The size of bodies and the condition for valid ones.
    #[serde(default)]
    pub body: BodyConfig,
    /// The classes to tell apart.
    pub task: TaskConfig,
    /// The images.
    pub data: DataConfig,
    /// The conversion from image to stimulus.
    #[serde(default)]
    pub stimulus: StimulusParams,
    /// The presentation of images.
    #[serde(default)]
    pub protocol: Protocol,
    /// The sizes of generations.
    #[serde(default)]
    pub map_elites: EmitterParams,
    /// The settings of the archive.
    #[serde(default)]
    pub archive: ArchiveConfig,
    /// The sizes of mutations.
    #[serde(default)]
    pub genome: MutationParams,
    /// Savings that change no archive.
    #[serde(default)]
    pub savings: Savings,
    /// The times at which the run is saved.
    #[serde(default)]
    pub checkpoint: CheckpointConfig,
    /// The evaluation of robots. Files omit it if it is the default.
    #[serde(default, skip_serializing_if = "EvaluationConfig::is_default")]
    pub evaluation: EvaluationConfig,
    /// The choice of robots on validation images. Files omit it if it is the default.
    #[serde(default, skip_serializing_if = "ValidationConfig::is_default")]
    pub validation: ValidationConfig,
    /// The training of gaits by `morphcog train`. Files omit it if it is the default.
    #[serde(default, skip_serializing_if = "TrainConfig::is_default")]
    pub train: TrainConfig,
    /// The constants of the simulator.
    #[serde(default)]
    pub physics: Physics,
}

/// Dotted keys with their values.
pub(crate) type Settings = BTreeMap<String, toml::Value>;

/// Returns the keys in which two settings differ, with both values as text, in the keys' order.
pub(crate) fn differing(there: &Settings, now: &Settings) -> Vec<(String, String, String)> {
    let value = |settings: &Settings, key: &str| {
        settings
            .get(key)
            .map_or("not set".to_string(), ToString::to_string)
    };
    let keys: BTreeSet<&String> = there.keys().chain(now.keys()).collect();
    let differs = |key: &&String| there.get(*key) != now.get(*key);
    let with_values = |key: &String| (key.clone(), value(there, key), value(now, key));
    keys.into_iter().filter(differs).map(with_values).collect()
}

/// Flattens nested tables to dotted keys, below `name`.
pub(crate) fn flatten(name: &str, value: toml::Value, settings: &mut Settings) {
    match value {
        toml::Value::Table(table) => {
            let below = |key: String| {
                if name.is_empty() {
                    key
                } else {
                    format!("{name}.{key}")
                }
            };
            table
                .into_iter()
                .for_each(|(key, value)| flatten(&below(key), value, settings));
        }
        value => {
            settings.insert(name.to_string(), value);
        }
    }
}

fn one() -> u64 {
    1
}

fn paper_generations() -> u64 {
    30_000
}

/// The size of bodies and the condition for valid ones: section `[body]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BodyConfig {
    /// Rows of a body's grid. Default 14, the paper's.
    #[schemars(range(min = 1, max = MAX_SIDE))]
    pub height: usize,
    /// Columns of a body's grid. Default 14, the paper's.
    #[schemars(range(min = 1, max = MAX_SIDE))]
    pub width: usize,
    /// Least number of muscle voxels. Default 3, the paper's.
    ///
    /// A valid body is also connected through sides.
    pub(crate) min_muscles: usize,
}

impl Default for BodyConfig {
    fn default() -> Self {
        BodyConfig {
            height: 14,
            width: 14,
            min_muscles: 3,
        }
    }
}

/// The images: section `[data]`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DataConfig {
    /// `mnist`, `fashion-mnist`, `builtin`, `gates`, or a name of your own.
    pub dataset: String,
    /// Folder of its files; `--data`, `MORPHCOG_DATA` and what a run remembers go before it.
    /// Default `data/<dataset>`.
    ///
    /// No other folder is tried. If the folder has a subfolder with the dataset's name, that one is
    /// used. A leading `~` is the home folder, as in every path of a config or plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) dir: Option<PathBuf>,
    /// True to swap rows and columns of the images. Default true for EMNIST, which is published so.
    ///
    /// EMNIST is recognised by the names of its dataset, files or folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) transpose: Option<bool>,
    /// Names of the classes from class 0, for display. Default those in the dataset's
    /// `dataset.json`.
    ///
    /// A class without a name, or with the name "", has its number. No result depends on names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) class_names: Vec<String>,
    /// Indices of the training images, at least one per class, in the order of a sequential rollout.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub train_images: Option<Vec<usize>>,
    /// Without `train_images`: training images per class, drawn by the run's seed. Default 1.
    #[serde(default = "one_image")]
    #[schemars(range(min = 1))]
    pub images_per_class: usize,
    /// The built-in digits, for `dataset = "builtin"`.
    #[serde(default)]
    pub(crate) builtin: BuiltinDigits,
}

impl DataConfig {
    /// Returns the settings for a dataset; another one loses folder, file layout and images.
    #[must_use]
    pub(crate) fn of(&self, dataset: &str) -> Self {
        if dataset == self.dataset {
            return self.clone();
        }
        DataConfig {
            dataset: dataset.to_string(),
            dir: None,
            transpose: None,
            class_names: Vec::new(),
            train_images: None,
            ..self.clone()
        }
    }
}

fn one_image() -> usize {
    1
}

/// The settings of the archive: section `[archive]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ArchiveConfig {
    /// Fitness that adds 0 to the QD score; smaller ones count negatively. Default 0.
    pub qd_offset: f64,
    /// Fittest elites per task that stay after each generation. Few make the search greedy.
    /// Default all.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub keep: Option<usize>,
}

/// The times at which the run is saved: section `[checkpoint]`. Whichever comes first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CheckpointConfig {
    /// Generations between two checkpoints. Default 1000; larger values lose more at a power cut.
    #[schemars(range(min = 1))]
    pub(crate) generations: u64,
    /// Seconds between two checkpoints. Default 10.
    ///
    /// More if writing one takes over a fiftieth of that.
    #[schemars(range(min = 0))]
    pub(crate) seconds: f64,
}

impl Default for CheckpointConfig {
    fn default() -> Self {
        CheckpointConfig {
            generations: 1000,
            seconds: 10.0,
        }
    }
}

/// Returns a number at or below a place that is too large for a file, with its key.
fn too_large(place: &str, value: &serde_json::Value) -> Option<(String, u64)> {
    use serde_json::Value::{Array, Number, Object};
    let below = |key: &str| match place {
        "" => key.to_string(),
        section => format!("{section}.{key}"),
    };
    match value {
        Number(number) => number
            .as_u64()
            .filter(|&number| number > MAX_NUMBER)
            .map(|number| (place.to_string(), number)),
        Object(keys) => keys
            .iter()
            .find_map(|(key, value)| too_large(&below(key), value)),
        Array(values) => values.iter().find_map(|value| too_large(place, value)),
        _ => None,
    }
}

impl Config {
    /// Reads a config: a file (JSON if its name ends in `.json`, else TOML) or, without one, the
    /// built-in config of that name. Then applies `overrides` (`key=value`, with keys such as
    /// `map_elites.parents`).
    ///
    /// # Errors
    /// Returns an error, with file, line and key, if the config is missing or invalid.
    pub fn load(name: &str, overrides: &[String]) -> Result<Self, Error> {
        Config::load_from(Path::new(""), name, overrides)
    }

    /// Reads a config whose path is relative to a folder.
    pub(crate) fn load_from(
        folder: &Path,
        name: &str,
        overrides: &[String],
    ) -> Result<Self, Error> {
        let built_in = || {
            BUILT_IN
                .iter()
                .find(|(own, _)| *own == name || own.strip_suffix(".toml") == Some(name))
        };
        let path = folder.join(home_expanded(Path::new(name)));
        // A folder may have the name of a built-in config.
        let is_no_file = |error: &std::io::Error| match error.kind() {
            std::io::ErrorKind::NotFound => true,
            std::io::ErrorKind::IsADirectory => built_in().is_some(),
            _ => false,
        };
        let text = match read_given(&path) {
            Ok(text) => return Config::parse(&text, &path.to_string_lossy(), overrides),
            Err(error) if is_no_file(&error) => match built_in() {
                Some((_, text)) => (*text).to_string(),
                None => {
                    let names = BUILT_IN.map(|(name, _)| name).join(", ");
                    return Err(Error::input(format!(
                        "{}: there is no such file, and no built-in config of that name",
                        path.display()
                    ))
                    .advice(format!("the built-in configs are {names}")));
                }
            },
            Err(error) => return Err(Error::reading(&path, &error)),
        };
        Config::parse(&text, name, overrides)
    }

    /// Parses a config. `name` appears in messages; its extension tells JSON from TOML.
    ///
    /// # Errors
    /// Returns the errors of [`Config::load`].
    pub fn parse(text: &str, name: &str, overrides: &[String]) -> Result<Self, Error> {
        let format = Format::of(Path::new(name));
        let config: Config = reading::read(text, format, name).map_err(|error| {
            let is_lacking = error.message.contains("missing field");
            let config = Invocation::new("config").value("zero_one.toml");
            let remedy = Remedy::Run(config, "prints a whole one to start your own from");
            if is_lacking {
                error.remedy(remedy)
            } else {
                error
            }
        })?;
        reading::changed(config, overrides, Config::validate, |error| {
            reading::placed(error, text, format, name)
        })
    }

    /// Returns the config as TOML, every key with its value.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self)
            .expect("every field is a number, text, list or table, which TOML has")
    }

    /// Returns the settings that a generation's results depend on.
    pub(crate) fn essence(&self) -> Config {
        Config {
            generations: 1,
            savings: Savings::default(),
            validation: ValidationConfig::default(),
            checkpoint: CheckpointConfig::default(),
            data: DataConfig {
                dir: None,
                class_names: Vec::new(),
                ..self.data.clone()
            },
            ..self.clone()
        }
    }

    /// Returns all keys that results depend on, such as `map_elites.parents`, with their values.
    pub fn settings(&self) -> Settings {
        let root = toml::Value::try_from(self.essence());
        let mut settings = Settings::new();
        flatten(
            "",
            root.expect("every field is a number, text, list or table, which TOML has"),
            &mut settings,
        );
        settings
    }

    /// Returns the first config with all [`StimulusParams::together`]; `None` without one.
    pub(crate) fn together<'a>(all: impl IntoIterator<Item = &'a Config> + Clone) -> Option<Self> {
        let stimulus =
            StimulusParams::together(all.clone().into_iter().map(|config| config.stimulus))?;
        all.into_iter().next().map(|first| Config {
            stimulus,
            ..first.clone()
        })
    }

    /// Returns the specification of the bodies that evolve.
    pub fn body_spec(&self) -> BodySpec {
        let BodyConfig {
            height,
            width,
            min_muscles,
        } = self.body;
        BodySpec {
            height,
            width,
            min_muscles,
        }
    }

    /// Returns the tasks.
    ///
    /// # Errors
    /// Returns an error if the section `[task]` defines none.
    pub fn grouping(&self) -> Result<Grouping, Error> {
        Ok(self.task.grouping()?.named(&self.class_names()))
    }

    /// Returns the names of the classes, as far as they are known.
    pub(crate) fn class_names(&self) -> ClassNames {
        ClassNames::of(&self.data.class_names)
    }

    /// Calls the classes as the dataset does, unless the config names them.
    #[must_use]
    pub(crate) fn with_names_of(self, dataset: &Dataset) -> Self {
        match self.data.class_names.is_empty() {
            true => Config {
                data: DataConfig {
                    class_names: dataset.class_names().all().to_vec(),
                    ..self.data
                },
                ..self
            },
            false => self,
        }
    }

    pub(crate) fn classes(&self) -> Vec<u8> {
        self.task.classes()
    }

    pub(crate) fn validate(&self) -> Result<(), Error> {
        let refuse =
            |key: &str, found: String, expected: &str| Err(Error::value(key, found, expected));
        let numbers =
            serde_json::to_value(self).map_err(|error| Error::input(error.to_string()))?;
        if let Some((key, number)) = too_large("", &numbers) {
            return refuse(&key, number.to_string(), &format!("0 to {MAX_NUMBER}"));
        }
        self.grouping()?;
        self.physics.validate().map_err(|error| {
            Error::value(
                &format!("physics.{}", error.name),
                error.value,
                error.expected,
            )
        })?;
        self.stimulus
            .validate()
            .map_err(|error| Error::at_key("stimulus", error))?;
        check_name(&self.data.dataset).map_err(|error| Error::at_key("data.dataset", error))?;
        check_names(&self.data.class_names)
            .map_err(|error| Error::at_key("data.class_names", error))?;
        if is_drawn(&self.data.dataset) && self.data.transpose == Some(true) {
            return refuse(
                "data.transpose",
                true.to_string(),
                "false: images that the program draws are upright",
            );
        }
        self.data
            .builtin
            .validate()
            .map_err(|error| Error::at_key("data.builtin", error))?;
        for (key, side) in [
            ("body.height", self.body.height),
            ("body.width", self.body.width),
        ] {
            if side == 0 || side > MAX_SIDE {
                return refuse(key, side.to_string(), &format!("1 to {MAX_SIDE}"));
            }
        }
        self.train.validate()?;
        if self.train.windows > 0 && self.stimulus.reduction == Reduction::Stride {
            let expected = "0, or the stimulus.reduction \"area\": a stride fits few windows";
            return refuse("train.windows", self.train.windows.to_string(), expected);
        }
        if self.body.min_muscles > self.body.height * self.body.width {
            return refuse(
                "body.min_muscles",
                self.body.min_muscles.to_string(),
                "no more than there are voxels",
            );
        }
        self.validate_response()?;
        if self.validation.images < LEAST {
            let expected = format!("{} or more", LEAST);
            return refuse(
                "validation.images",
                self.validation.images.to_string(),
                &expected,
            );
        }
        if self.generations == 0 {
            return refuse("generations", self.generations.to_string(), "1 or more");
        }
        if self.map_elites.parents == 0 && self.map_elites.random_immigrants == 0 {
            return refuse(
                "map_elites.parents",
                "0".to_string(),
                "1 or more, or map_elites.random_immigrants above 0",
            );
        }
        if !(1..=MAX_STEPS).contains(&self.protocol.control_steps) {
            let expected = format!("1 to {MAX_STEPS}");
            return refuse(
                "protocol.control_steps",
                self.protocol.control_steps.to_string(),
                &expected,
            );
        }
        if !(self.physics.ground_row..=MAX_ROW).contains(&self.protocol.start_row) {
            let expected = format!("{} (on the ground) to {MAX_ROW}", self.physics.ground_row);
            return refuse(
                "protocol.start_row",
                self.protocol.start_row.to_string(),
                &expected,
            );
        }
        if !(-MAX_COLUMN..=MAX_COLUMN).contains(&self.protocol.start_column) {
            let expected = format!("−{MAX_COLUMN} to {MAX_COLUMN}");
            return refuse(
                "protocol.start_column",
                self.protocol.start_column.to_string(),
                &expected,
            );
        }
        // Sums over an archive must stay finite, because files cannot hold other values.
        if self.archive.qd_offset.is_nan() || self.archive.qd_offset.abs() > MAX_OFFSET {
            let expected = format!("a number from −{MAX_OFFSET} to {MAX_OFFSET}");
            return refuse(
                "archive.qd_offset",
                self.archive.qd_offset.to_string(),
                &expected,
            );
        }
        if self.archive.keep == Some(0) {
            return refuse("archive.keep", "0".to_string(), "1 or more");
        }
        if self.checkpoint.generations == 0 {
            return refuse("checkpoint.generations", "0".to_string(), "1 or more");
        }
        if !(self.checkpoint.seconds >= 0.0 && self.checkpoint.seconds.is_finite()) {
            return refuse(
                "checkpoint.seconds",
                self.checkpoint.seconds.to_string(),
                "a finite number, 0 or above",
            );
        }
        if self.data.images_per_class == 0
            || self.data.train_images.as_ref().is_some_and(Vec::is_empty)
        {
            return refuse(
                "data",
                "no images".to_string(),
                "at least one training image of each class",
            );
        }
        Ok(())
    }
}

impl Config {
    /// Returns true if fitness is the response of the bodies' probes to random images.
    pub(crate) fn measures_response(&self) -> bool {
        self.evaluation.fitness == Fitness::Response
    }

    pub(crate) fn objective(&self) -> &'static dyn Objective {
        match self.measures_response() {
            true => &GaitResponse,
            false => &Recognition,
        }
    }

    pub(crate) fn validate_response(&self) -> Result<(), Error> {
        if self.evaluation.fitness != Fitness::Response {
            return Ok(());
        }
        let (tasks, classes) = (self.grouping()?.tasks().len(), self.classes().len());
        let per_class = self.data.images_per_class;
        let (images_key, found, images) = match &self.data.train_images {
            Some(named) => (
                "data.train_images",
                format!("{} images", named.len()),
                named.len(),
            ),
            None => (
                "data.images_per_class",
                per_class.to_string(),
                per_class.saturating_mul(classes),
            ),
        };
        let enough = format!("an even number of training images in all, {LEAST_IMAGES} or more");
        let checks = [
            (
                tasks > 1,
                "task.splits",
                format!("{tasks} tasks"),
                "one task, as groups = [[0], [1]]: a response belongs to no task",
            ),
            (
                self.protocol.rollout == RolloutMode::Sequential,
                "protocol.rollout",
                "\"sequential\"".to_string(),
                "\"fresh\"",
            ),
            (
                self.validation.best > 0,
                "validation.best",
                self.validation.best.to_string(),
                "0: gaits tell no images apart yet",
            ),
            (
                images < LEAST_IMAGES || images % 2 == 1,
                images_key,
                found,
                enough.as_str(),
            ),
        ];
        match checks.into_iter().find(|(is_wrong, ..)| *is_wrong) {
            Some((_, key, found, expected)) => {
                let text = format!(
                    "{key} = {found}: with evaluation.fitness = \"response\" expected {expected}"
                );
                Err(Error::input(text).with_key(key))
            }
            None => Ok(()),
        }
    }
}
