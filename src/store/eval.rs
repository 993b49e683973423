//! `eval.json` and `eval.csv`: the results of an evaluation.

use crate::base::error::Error;
use crate::base::hash;
use crate::base::hash::sha256_hex;
use crate::base::ranges;
use crate::base::remedy::{Invocation, Remedy};
use crate::base::table;
use crate::config::{Config, DataConfig};
use crate::data::dataset;
use crate::data::dataset::Dataset;
use crate::store::images::{DatasetRef, HeldOut, ImageRef};
use crate::store::results::{self, Stored};
use crate::store::run::RunFile;
use crate::store::setting::{RunRef, RunSetting};
use crate::store::stored_run::StoredRun;
use crate::store::validation::Validated;
use crate::task::answer::Direction;
use crate::task::class_names::ClassNames;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::mem::replace;
use std::path::Path;

pub(crate) const FORMAT: &str = "morphcog-eval";
pub(crate) const FORMAT_VERSION: u32 = 1;

/// The tolerance of a share against its quotient: other programs round shares.
const ROUNDING: f64 = 1e-6;

/// The content of `eval.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EvalFile {
    /// The constant "morphcog-eval".
    #[schemars(extend("const" = FORMAT))]
    pub(crate) format: String,
    /// The version of this schema.
    #[schemars(range(min = 1, max = FORMAT_VERSION))]
    pub(crate) format_version: u32,
    /// The version of morphcog that wrote the file.
    pub(crate) program_version: String,
    /// The name of the (first) run of the robots.
    pub(crate) run: String,
    /// The seed of that run.
    pub(crate) run_seed: u64,
    /// All runs of the robots.
    #[serde(default)]
    pub runs: Vec<RunRef>,
    /// The task, data and stimulus; if robots use different windows, those of the common part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setting: Option<RunSetting>,
    /// The selection of the robots, in words.
    pub selected: String,
    /// The name of the dataset.
    pub dataset: String,
    /// The SHA-256 of its test split, if those images were used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) test_sha256: Option<String>,
    /// The robots' training data, if that is another dataset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trained_on: Option<DatasetRef>,
    /// The split of the images: test, or validation.
    #[serde(default, skip_serializing_if = "HeldOut::is_default")]
    pub split: HeldOut,
    /// The seed of all random draws.
    pub(crate) seed: u64,
    /// The number of control steps per image, each a fresh rollout.
    pub control_steps: u32,
    /// The displacement up to which an answer counts as wrong \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) threshold: f64,
    /// True if the evaluation ended before the last robot, by a signal or otherwise.
    pub stopped: bool,
    /// The images.
    pub images: Vec<ImageRef>,
    /// The baselines without bodies, by task.
    pub baselines: BTreeMap<String, Baselines>,
    /// The averages over the robots, by task.
    pub means: BTreeMap<String, Mean>,
    /// The robots, in the order of their selection.
    pub robots: Vec<RobotReport>,
}

/// Accuracies without a body on the same images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Baselines {
    /// The accuracy of always answering the larger group.
    #[serde(deserialize_with = "ranges::share")]
    pub larger_group: f64,
    /// The accuracy of one pixel and a threshold, chosen on training images.
    #[serde(deserialize_with = "ranges::share")]
    pub best_single_pixel: f64,
    /// That pixel: row, column.
    pub(crate) pixel: [usize; 2],
    /// The accuracy of the nearest of the run's training images; absent for another dataset.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "ranges::share"
    )]
    pub nearest_training_image: Option<f64>,
}

/// The averages over the robots of a task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mean {
    /// The number of robots.
    pub(crate) robots: usize,
    /// The mean accuracy.
    #[serde(deserialize_with = "ranges::share")]
    pub accuracy: f64,
    /// The mean balanced accuracy.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) balanced_accuracy: f64,
    /// The standard deviation of the accuracy over the robots; absent for a single one.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "ranges::share"
    )]
    pub(crate) standard_deviation: Option<f64>,
    /// The 95 % bootstrap interval of the mean accuracy: percentiles of 10,000 resamples. With
    /// several runs, it resamples runs and then the robots of each.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "ranges::interval"
    )]
    pub interval: Option<[f64; 2]>,
}

/// The results of one robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RobotReport {
    /// The id of the robot.
    pub id: String,
    /// The index of its run in `runs`.
    #[serde(default)]
    pub run: usize,
    /// The task of the robot.
    pub task: String,
    /// The fitness on the training images, voxel lengths.
    #[serde(deserialize_with = "ranges::number")]
    pub objective: f64,
    /// The direction of the classes before the task's bar on the training images: "left" or
    /// "right".
    pub first_group_walks: String,
    /// The number of images answered correctly.
    pub right: usize,
    /// The number of images.
    pub images: usize,
    /// The share of images answered correctly.
    #[serde(deserialize_with = "ranges::share")]
    pub accuracy: f64,
    /// The 95 % Wilson interval of the accuracy.
    #[serde(deserialize_with = "ranges::interval")]
    pub interval: [f64; 2],
    /// The mean over the two groups of the share answered correctly.
    #[serde(deserialize_with = "ranges::share")]
    pub balanced_accuracy: f64,
    /// The share answered correctly, by class.
    #[serde(deserialize_with = "ranges::share")]
    pub per_class: BTreeMap<u8, f64>,
    /// The mean |displacement| of the stable rollouts, voxel lengths.
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) mean_distance: f64,
    /// The share of images under which it moved no farther than the threshold.
    #[serde(deserialize_with = "ranges::share")]
    pub not_moved: f64,
    /// The number of images under which its rollout became unstable (counted as wrong).
    pub unstable: usize,
    /// The number of rollouts simulated.
    pub simulated: usize,
    /// The results on the validation images, if they selected the robot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation: Option<Validated>,
    /// The displacement under each image, voxel lengths; null if unstable.
    #[serde(deserialize_with = "ranges::number")]
    pub displacements: Vec<Option<f64>>,
}

impl RobotReport {
    pub(crate) fn without_displacements(&self) -> Self {
        RobotReport {
            displacements: Vec::new(),
            ..self.clone()
        }
    }
}

impl Stored for EvalFile {
    const FORMAT: (&'static str, u32) = (FORMAT, FORMAT_VERSION);

    fn validate(&self) -> Result<(), Error> {
        self.setting.as_ref().map_or(Ok(()), RunSetting::validate)?;
        if self.images.is_empty() {
            return Err(Error::at_key("images", "expected one or more"));
        }
        // Earlier versions evaluated one run, and did not list it.
        let runs = self.runs.len().max(1);
        for (number, robot) in self.robots.iter().enumerate() {
            let refuse = |key: &str, expected: String| {
                Err(Error::at_key(
                    &format!("robots[{number}].{key}"),
                    format!("expected {expected}"),
                ))
            };
            if robot.run >= runs {
                return refuse(
                    "run",
                    format!("a place among {runs} runs, from 0, found {}", robot.run),
                );
            }
            if Direction::named(&robot.first_group_walks).is_none() {
                return refuse("first_group_walks", "left or right".to_string());
            }
            let images = self.images.len();
            if robot.images != images || robot.displacements.len() != images {
                return refuse("displacements", format!("one for each of {images} images"));
            }
            if robot.right > images {
                return refuse(
                    "right",
                    format!("at most {images}, the images, found {}", robot.right),
                );
            }
            if (robot.accuracy - robot.right as f64 / images as f64).abs() > ROUNDING {
                return refuse(
                    "accuracy",
                    format!("right / images, {}/{images}", robot.right),
                );
            }
            if robot.unstable
                != robot
                    .displacements
                    .iter()
                    .filter(|walk| walk.is_none())
                    .count()
            {
                return refuse(
                    "unstable",
                    "as many as displacements that are null".to_string(),
                );
            }
            let labels: BTreeSet<u8> = self.images.iter().map(|image| image.label).collect();
            if !robot.per_class.keys().eq(&labels) {
                return refuse("per_class", "the classes of the images".to_string());
            }
            if let Some(validated) = &robot.validation {
                validated
                    .validate()
                    .map_err(|error| error.in_place(&format!("robots[{number}].validation")))?;
            }
        }
        for (task, mean) in &self.means {
            let robots = self
                .robots
                .iter()
                .filter(|robot| robot.task == *task)
                .count();
            if mean.robots != robots || robots == 0 {
                let text = format!("expected the {robots} of the task, found {}", mean.robots);
                return Err(Error::at_key(&format!("means.{task}.robots"), text));
            }
        }
        Ok(())
    }
}

impl EvalFile {
    /// Returns a hash of the runs, the images, the robots and their walks.
    pub(crate) fn fingerprint(&self) -> String {
        let runs: Vec<&String> = self.runs.iter().map(|run| &run.sha256).collect();
        let walked = self
            .robots
            .iter()
            .map(|robot| (robot.run, &robot.id, &robot.task, &robot.displacements));
        let all = (
            runs,
            &self.dataset,
            &self.images,
            self.threshold,
            walked.collect::<Vec<_>>(),
        );
        sha256_hex(
            serde_json::to_string(&all)
                .expect("texts, numbers and lists are JSON")
                .as_bytes(),
        )
    }

    /// Creates the evaluation of these runs' robots; `together` has their common images and tasks.
    pub(crate) fn new(
        (sources, together): (&[StoredRun], &Config),
        (selected, split, seed, threshold): (String, HeldOut, u64, f64),
        control_steps: u32,
        images: &[ImageRef],
        test_sha256: Option<String>,
    ) -> Self {
        let first = sources.first().map(|source| &source.run);
        EvalFile {
            format: FORMAT.to_string(),
            format_version: FORMAT_VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            run: first.map_or(String::new(), |run| run.name.clone()),
            run_seed: first.map_or(0, |run| run.config.seed),
            runs: RunRef::of_all(sources),
            setting: first.map(|run| RunSetting {
                stimulus: together.stimulus,
                task: together.task.clone(),
                ..RunSetting::new(run)
            }),
            selected,
            dataset: first.map_or(String::new(), |run| run.dataset.name.clone()),
            test_sha256,
            trained_on: None,
            split,
            seed,
            control_steps,
            threshold,
            stopped: false,
            images: images.to_vec(),
            baselines: BTreeMap::new(),
            means: BTreeMap::new(),
            robots: Vec::new(),
        }
    }

    /// Records that the images are of another dataset than the robots' training data.
    pub(crate) fn transfer(&mut self, name: &str, dataset: &Dataset) {
        self.dataset = name.to_string();
        if let Some(setting) = &mut self.setting {
            let train_sha256 = dataset
                .fingerprint(dataset::Split::Train)
                .expect("an evaluation loads both splits");
            let train_sha256 = replace(&mut setting.train_sha256, train_sha256);
            let shown = DataConfig {
                class_names: dataset.class_names().all().to_vec(),
                ..setting.data.of(name)
            };
            let own = replace(&mut setting.data, shown).dataset;
            self.trained_on = Some(DatasetRef {
                name: own,
                train_sha256,
            });
        }
    }

    /// Returns the names of the images' classes, as far as they are known.
    pub(crate) fn names(&self) -> ClassNames {
        let setting = self.setting.as_ref();
        setting.map_or_else(ClassNames::default, |setting| {
            ClassNames::of(&setting.data.class_names)
        })
    }

    /// Returns the name of a robot's run in tables; `None` unless there are several runs.
    pub(crate) fn run_of(&self, robot: &RobotReport) -> Option<&str> {
        let run = self.runs.get(robot.run).filter(|_| self.runs.len() > 1)?;
        Some(run.in_tables())
    }

    /// Returns the file without results, and without names of classes and folders, on which none
    /// depends.
    pub(crate) fn head(&self) -> Self {
        let nameless = |setting: RunSetting| RunSetting {
            data: DataConfig {
                class_names: Vec::new(),
                ..setting.data
            },
            ..setting
        };
        let nowhere = |run: &RunRef| RunRef {
            folder: None,
            ..run.clone()
        };
        EvalFile {
            stopped: false,
            setting: self.setting.clone().map(nameless),
            baselines: BTreeMap::new(),
            means: BTreeMap::new(),
            robots: Vec::new(),
            runs: self.runs.iter().map(nowhere).collect(),
            ..self.clone()
        }
    }

    /// Describes the selection of the robots for people, including training on another dataset and
    /// an early stop by a signal.
    pub(crate) fn selection(&self) -> String {
        let stopped = if self.stopped {
            "; stopped before the last of them"
        } else {
            ""
        };
        let trained = self
            .trained_on
            .as_ref()
            .map_or(String::new(), |own| format!(", trained on {}", own.name));
        format!("{}{trained}{stopped}", self.selected)
    }

    /// Calls its runs what their folders are called now, for people.
    fn called_as(mut self, runs: &[&RunFile]) -> Self {
        let first = self.runs.first().map(|first| first.sha256.clone());
        for run in runs {
            let sha256 = run.fingerprint();
            let same = self.runs.iter_mut().filter(|own| own.sha256 == sha256);
            same.for_each(|own| own.name = run.called().to_string());
            if first.as_ref() == Some(&sha256) {
                self.run = run.called().to_string();
            }
        }
        self
    }

    /// Reads an evaluation of robots of these runs in their present state, and of no others. It calls
    /// the runs what their folders are called.
    pub(crate) fn of_runs(path: &Path, runs: &[&RunFile]) -> Result<Self, Error> {
        let file = Self::read(path)?;
        let now: Vec<String> = runs.iter().map(|run| run.fingerprint()).collect();
        match file.runs.iter().find(|run| !now.contains(&run.sha256)) {
            None => Ok(file.called_as(runs)),
            Some(run) => {
                let text = format!(
                    "{}: stale: it is about another run, or another state of this one ({}, generation {}, SHA-256 \
                     of its \
                    content {}…)",
                    path.display(),
                    run.name,
                    run.generations,
                    hash::short(&run.sha256)
                );
                Err(Error::input(text).remedy(Remedy::Run(
                    Invocation::new("eval"),
                    "tests the run as it is now",
                )))
            }
        }
    }

    /// Reads `eval.json`.
    ///
    /// # Errors
    /// Returns an error, with its line and key, if the file is missing or invalid.
    pub fn read(path: &Path) -> Result<Self, Error> {
        results::read(path, Some("eval"))
    }

    /// Encodes the file as one line of JSON.
    pub(crate) fn to_json(&self) -> String {
        // Numbers are finite, keys are text or whole numbers, so encoding cannot fail.
        serde_json::to_string(self).expect("JSON has all of it") + "\n"
    }

    /// Encodes `eval.csv`: a line per robot; it begins with the run if there are several.
    pub(crate) fn to_csv(&self) -> Vec<u8> {
        let classes: Vec<u8> = self.robots.first().map_or(Vec::new(), |robot| {
            robot.per_class.keys().copied().collect()
        });
        let about = [
            "id",
            "run_seed",
            "task",
            "objective",
            "first_group_walks",
            "right",
            "images",
        ];
        let shares = [
            "accuracy",
            "accuracy_low",
            "accuracy_high",
            "balanced_accuracy",
        ];
        let run = (self.runs.len() > 1).then_some("run");
        let columns = run.into_iter().chain(about).chain(shares);
        let columns = columns.map(str::to_string);
        let columns = columns.chain(classes.iter().map(|class| format!("accuracy_{class}")));
        let columns = columns
            .chain(["mean_distance", "not_moved", "unstable", "simulated"].map(str::to_string));
        let rows = self.robots.iter().map(|robot| {
            let seed = self
                .runs
                .get(robot.run)
                .map_or(self.run_seed, |run| run.seed);
            // A list of one or none fills as many columns.
            let run: Vec<&str> = self.run_of(robot).into_iter().collect();
            let about = (
                run,
                &robot.id,
                seed,
                &robot.task,
                robot.objective,
                &robot.first_group_walks,
            );
            let shares = (robot.accuracy, robot.interval, robot.balanced_accuracy);
            let per_class: Vec<f64> = robot.per_class.values().copied().collect();
            let simulated = (
                robot.mean_distance,
                robot.not_moved,
                robot.unstable,
                robot.simulated,
            );
            (
                about,
                robot.right,
                robot.images,
                shares,
                per_class,
                simulated,
            )
        });
        table::csv(columns, rows)
    }
}
