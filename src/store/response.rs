//! `response.json` and `response.csv`: the responses of robots' gaits, beside the run's `run.json`.

use crate::base::error::Error;
use crate::base::number::is_zero;
use crate::base::ranges;
use crate::base::session::Session;
use crate::base::table;
use crate::body::Body;
use crate::response::estimate::{Estimate, Trainability};
use crate::response::gait::Gait;
use crate::response::regression::Response;
use crate::shipped::exists;
use crate::store::images::DatasetRef;
use crate::store::names::FigureFormat;
use crate::store::results::{self, Stored, by_lines, write_with_table};
use crate::task::margins::Margins;
use crate::task::perturbation::Condition;
use crate::task::stimulus::StimulusParams;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "morphcog-response";
pub(crate) const FORMAT_VERSION: u32 = 1;

/// The content of `response.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponseFile {
    /// The constant "morphcog-response".
    #[schemars(extend("const" = FORMAT))]
    pub(crate) format: String,
    /// The version of this schema.
    #[schemars(range(min = 1, max = FORMAT_VERSION))]
    pub(crate) format_version: u32,
    /// The version of morphcog that wrote the file.
    pub(crate) program_version: String,
    /// The name of the robots' run.
    pub run: String,
    /// The seed of the run.
    pub(crate) run_seed: u64,
    /// The SHA-256 of its `run.json`.
    pub run_sha256: String,
    /// The settings of the measurement.
    pub setting: ResponseSetting,
    /// The robots whose measurement was stopped; the same command continues them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unfinished: Vec<Unfinished>,
    /// The robots, in the order in which they were chosen.
    pub robots: Vec<RobotResponse>,
}

/// The settings of a measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponseSetting {
    /// The seed of the random images.
    pub seed: u64,
    /// The maximum number of rollouts per robot, not counting those known before.
    pub(crate) images: usize,
    /// The relative error of the slopes at which a measurement ends.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) error: f64,
    /// The dataset of the task's images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) dataset: Option<DatasetRef>,
    /// The conditions that alternate between images.
    pub conditions: Vec<Condition>,
    /// The number of control steps per image.
    pub(crate) control_steps: u32,
    /// The task whose trained accuracy is estimated, if one was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// The stimulus for that task's images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stimulus: Option<StimulusParams>,
    /// The number of windows tried for each robot; 0: only that of `stimulus`.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub windows: usize,
}

impl ResponseSetting {
    /// Returns true if both have the same task, dataset, stimulus and windows.
    fn asks_as(&self, other: &ResponseSetting) -> bool {
        let asked = |setting: &ResponseSetting| {
            (
                setting.task.clone(),
                setting.dataset.clone(),
                setting.stimulus,
                setting.windows,
            )
        };
        asked(self) == asked(other)
    }
}

/// The reason why a measurement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EndedBy {
    /// The slopes were accurate enough.
    Error,
    /// The maximum number of rollouts was reached.
    Images,
}

/// The response of a robot's gait.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotResponse {
    /// The id, or the name of a published robot.
    pub id: String,
    /// The body.
    pub body: Body,
    /// The number of rollouts simulated.
    pub rollouts: usize,
    /// The number of unstable rollouts among them, which do not count.
    pub unstable: usize,
    /// The reason why there were no more.
    pub ended_by: EndedBy,
    /// The error of the slopes relative to their size, 0 to 1.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) relative_error: f64,
    /// The share of the displacements' variance that slopes fitted to other rollouts explain.
    #[serde(deserialize_with = "ranges::at_most_one")]
    pub r_squared: f64,
    /// The standard deviation that these slopes leave unexplained \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) noise: f64,
    /// The part that the true slopes would leave unexplained \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) scatter: f64,
    /// The penalty of the ridge regression.
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) ridge: f64,
    /// The displacement if no place had any width, the mean over conditions \[voxel lengths\].
    #[serde(deserialize_with = "ranges::number")]
    pub(crate) intercept: f64,
    /// The intercept under each condition; null without stable rollouts.
    #[serde(deserialize_with = "ranges::number")]
    pub intercepts: Vec<Option<f64>>,
    /// The displacement of the gait under each random image, in the order of drawing \[voxel
    /// lengths\]; null if unstable. `train` begins with them.
    #[serde(deserialize_with = "ranges::number")]
    pub displacements: Vec<Option<f64>>,
    /// The soft voxels and sensors, row-major.
    pub places: Vec<ResponsePlace>,
    /// The estimate of what training could reach, if a task was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taught: Option<TrainingEstimate>,
}

/// A robot whose measurement was stopped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unfinished {
    /// The id, or the name of a published robot.
    pub(crate) id: String,
    /// The body.
    pub(crate) body: Body,
    /// The displacements under the random images so far, as for a measured robot \[voxel lengths\].
    #[serde(deserialize_with = "ranges::number")]
    pub displacements: Vec<Option<f64>>,
}

/// A soft voxel or a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponsePlace {
    /// The row, from 0 at the top.
    pub row: usize,
    /// The column, from 0 on the left.
    pub column: usize,
    /// The body's displacement to the right per rest width of this place \[voxel lengths\].
    #[serde(deserialize_with = "ranges::number")]
    pub slope: f64,
    /// The standard error of the slope \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) error: f64,
}

impl ResponsePlace {
    /// Returns true if the slope is within two standard errors of zero.
    pub(crate) fn is_uncertain(&self) -> bool {
        self.slope.abs() < 2.0 * self.error
    }
}

/// The linear model's estimate of what training a gait could reach.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainingEstimate {
    /// The mean clipped margin of its answers, `mean_clipped`: from −1 to 1.
    #[serde(deserialize_with = "ranges::number")]
    pub(crate) fitness: f64,
    /// The 95 % interval of the fitness.
    #[serde(deserialize_with = "ranges::fitness_interval")]
    pub fitness_interval: [f64; 2],
    /// The share of correct answers, with equal weight for both groups.
    #[serde(deserialize_with = "ranges::share")]
    pub accuracy: f64,
    /// The 95 % interval of the accuracy.
    #[serde(deserialize_with = "ranges::interval")]
    pub accuracy_interval: [f64; 2],
    /// The best window of those tried, as in `stimulus.margin`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<Margins>,
}

impl From<Trainability> for TrainingEstimate {
    fn from(teachable: Trainability) -> Self {
        let interval =
            |estimate: Estimate, least: f64| estimate.interval().map(|end| end.clamp(least, 1.0));
        let Trainability { fitness, accuracy } = teachable;
        TrainingEstimate {
            fitness: fitness.value,
            fitness_interval: interval(fitness, -1.0),
            accuracy: accuracy.value,
            accuracy_interval: interval(accuracy, 0.0),
            margin: None,
        }
    }
}

impl RobotResponse {
    /// Creates the response of a gait from rollouts with random images.
    pub(crate) fn new(
        id: &str,
        gait: &Gait,
        response: &Response,
        displacements: Vec<Option<f64>>,
        ended_by: EndedBy,
        taught: Option<TrainingEstimate>,
    ) -> Self {
        let places = gait
            .places()
            .iter()
            .zip(response.slopes.iter().zip(&response.errors));
        let place =
            |(&(row, column), (&slope, &error)): (&(usize, usize), (&f64, &f64))| ResponsePlace {
                row,
                column,
                slope,
                error,
            };
        RobotResponse {
            id: id.to_string(),
            body: gait.built(&gait.design()),
            rollouts: displacements.len(),
            unstable: displacements
                .iter()
                .filter(|displacement| displacement.is_none())
                .count(),
            displacements,
            ended_by,
            relative_error: response.relative_error(),
            r_squared: response.r_squared,
            noise: response.noise,
            scatter: response.scatter,
            ridge: response.ridge,
            intercept: response.intercept,
            intercepts: response.intercepts.clone(),
            places: places.map(place).collect(),
            taught,
        }
    }
}

impl Stored for ResponseFile {
    const FORMAT: (&'static str, u32) = (FORMAT, FORMAT_VERSION);

    fn validate(&self) -> Result<(), Error> {
        if self.setting.conditions.is_empty() {
            return Err(Error::at_key("setting.conditions", "expected one or more"));
        }
        for (number, robot) in self.robots.iter().enumerate() {
            let refuse = |key: &str, expected: &str| {
                Err(Error::at_key(
                    &format!("robots[{number}].{key}"),
                    format!("expected {expected}"),
                ))
            };
            if self.robots[..number]
                .iter()
                .any(|other| other.id == robot.id)
            {
                return refuse("id", "each robot once");
            }
            let places = robot.places.iter().map(|place| (place.row, place.column));
            let gait = Gait::of(&robot.body);
            if !gait.is_some_and(|gait| gait.places().iter().copied().eq(places)) {
                return refuse(
                    "places",
                    "the soft voxels and sensors of its body, row-major",
                );
            }
            if robot.rollouts != robot.displacements.len() {
                return refuse("displacements", "one for each of the rollouts");
            }
            if robot.unstable
                != robot
                    .displacements
                    .iter()
                    .filter(|walk| walk.is_none())
                    .count()
            {
                return refuse("unstable", "as many as displacements that are null");
            }
            if robot.intercepts.len() > self.setting.conditions.len() {
                return refuse("intercepts", "at most one for each of the conditions");
            }
        }
        Ok(())
    }
}

impl ResponseFile {
    /// Reads a file.
    ///
    /// # Errors
    /// Returns an error, with its line and key, if the file is missing or invalid.
    pub fn read(path: &Path) -> Result<Self, Error> {
        results::read(path, Some("response"))
    }

    /// The file at a path, if there is one. One that cannot be read is told, and left aside.
    pub(crate) fn found(path: &Path, session: &Session) -> Option<Self> {
        if !exists(path) {
            return None;
        }
        let told = |error| {
            session
                .observer
                .warning(&format!("{error}; responses are measured again"))
        };
        ResponseFile::read(path).map_err(told).ok()
    }

    /// Returns the known displacements of a gait under the first random images of a seed, and how
    /// many of them are of a finished measurement. They count only for the run with this SHA-256,
    /// this version and these conditions; stopped measurements count, too.
    pub(crate) fn known(
        &self,
        run_sha256: &str,
        seed: u64,
        conditions: &[Condition],
        gait: &Gait,
    ) -> (&[Option<f64>], usize) {
        if !self.is_of(run_sha256, seed, conditions) {
            return (&[], 0);
        }
        let has_gait = |body: &Body| Gait::of(body).is_some_and(|own| own.probe() == gait.probe());
        let ended = self.robots.iter().find(|robot| has_gait(&robot.body));
        let begun = self.unfinished.iter().find(|robot| has_gait(&robot.body));
        let ended: &[Option<f64>] = ended.map_or(&[], |robot| &robot.displacements);
        let begun: &[Option<f64>] = begun.map_or(&[], |robot| &robot.displacements);
        (
            if begun.len() > ended.len() {
                begun
            } else {
                ended
            },
            ended.len(),
        )
    }

    /// Returns true if it was measured for the run with this SHA-256, by this version, under these
    /// conditions and random images.
    fn is_of(&self, run_sha256: &str, seed: u64, conditions: &[Condition]) -> bool {
        let by_this = self.program_version == env!("CARGO_PKG_VERSION");
        let ResponseSetting {
            seed: own,
            conditions: shown,
            ..
        } = &self.setting;
        self.run_sha256 == run_sha256 && by_this && *own == seed && shown == conditions
    }

    /// Adds the other robots of an earlier file about the same run, seed and conditions. It drops
    /// estimates for another task.
    pub(crate) fn with_others_of(&self, earlier: &ResponseFile) -> Self {
        let mut all = self.clone();
        // Known robots keep their places, so that the order does not depend on stops.
        all.robots.clear();
        if earlier.is_of(
            &self.run_sha256,
            self.setting.seed,
            &self.setting.conditions,
        ) {
            for robot in &earlier.robots {
                let own = self.robots.iter().find(|own| own.id == robot.id);
                let taught = robot
                    .taught
                    .filter(|_| earlier.setting.asks_as(&self.setting));
                let other = || RobotResponse {
                    taught,
                    ..robot.clone()
                };
                all.robots.push(own.cloned().unwrap_or_else(other));
            }
            let is_open = |robot: &&Unfinished| {
                let ended = self.robots.iter().map(|own| &own.id);
                ended
                    .chain(self.unfinished.iter().map(|own| &own.id))
                    .all(|id| *id != robot.id)
            };
            all.unfinished
                .extend(earlier.unfinished.iter().filter(is_open).cloned());
        }
        for own in &self.robots {
            if all.robots.iter().all(|robot| robot.id != own.id) {
                all.robots.push(own.clone());
            }
        }
        all
    }

    /// Encodes the file as JSON: the head on one line, then one line per robot.
    pub(crate) fn to_json(&self) -> String {
        let head = ResponseFile {
            robots: Vec::new(),
            ..self.clone()
        };
        by_lines(&head, &self.robots)
    }

    /// Encodes `response.csv`: a line per robot and place.
    pub(crate) fn to_csv(&self) -> Vec<u8> {
        let rows = self.robots.iter().flat_map(|robot| {
            robot.places.iter().map(
                |ResponsePlace {
                     row,
                     column,
                     slope,
                     error,
                 }| {
                    let material = robot.body.voxels()[(*row, *column)].code();
                    (&robot.id, *row, *column, material, *slope, *error)
                },
            )
        });
        table::csv(["id", "row", "column", "material", "slope", "error"], rows)
    }

    /// Writes the file, and its CSV beside it. If the results have changed, it first removes the
    /// `outdated` pictures, to be redrawn.
    pub(crate) fn write(&self, path: &Path, outdated: &[[PathBuf; 3]]) -> Result<(), Error> {
        write_with_table(
            path,
            &self.to_json(),
            &self.to_csv(),
            outdated.iter().flatten().cloned(),
        )
    }
}

/// Returns the paths of robots' pictures beside `out`, one for each format; one robot alone has its
/// stem.
pub(crate) fn pictures(out: &Path, ids: &[&str]) -> Vec<[PathBuf; 3]> {
    let stem = out
        .file_stem()
        .expect("its name was checked before anything was measured")
        .to_string_lossy();
    let named = |id: &&str| match ids.len() {
        1 => FigureFormat::beside(out),
        _ => FigureFormat::ALL
            .map(|format| out.with_file_name(format!("{stem}-{id}.{}", format.ending()))),
    };
    ids.iter().map(named).collect()
}
