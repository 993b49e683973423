//! `response.json` and `response.csv`: the responses of robots' gaits, beside the run's `run.json`.

use crate::base::error::Error;
use crate::base::number::is_zero;
use crate::base::ranges;
use crate::base::session::Session;
use crate::base::table;
use crate::body::Body;
use crate::response::estimate::{Estimate, Teachable};
use crate::response::gait::Gait;
use crate::response::regression::Response;
use crate::shipped::exists;
use crate::store::images::DatasetRef;
use crate::store::results::{self, Stored, by_lines, write_with_table};
use crate::task::margins::Margins;
use crate::task::perturbation::Condition;
use crate::task::stimulus::StimulusParams;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What `response.json` calls itself.
pub const FORMAT: &str = "morphcog-response";
/// Version of its schema.
pub const FORMAT_VERSION: u32 = 1;

/// Endings of a robot's picture beside the results.
pub const PICTURES: [&str; 2] = ["svg", "png"];

/// The content of `response.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponseFile {
    /// "morphcog-response".
    #[schemars(extend("const" = FORMAT))]
    pub format: String,
    /// Version of this schema.
    #[schemars(range(min = 1, max = FORMAT_VERSION))]
    pub format_version: u32,
    /// Version of morphcog that wrote it.
    pub program_version: String,
    /// Name of the run the robots are from.
    pub run: String,
    /// Its seed.
    pub run_seed: u64,
    /// SHA-256 of its `run.json`.
    pub run_sha256: String,
    /// How responses were measured.
    pub setting: Setting,
    /// Robots whose measurement was stopped: the same command goes on with them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unfinished: Vec<Unfinished>,
    /// The robots, in the order in which they were chosen.
    pub robots: Vec<RobotResponse>,
}

/// How responses were measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// Seed of the random images.
    pub seed: u64,
    /// Most rollouts of a robot, those left aside that were known before.
    pub images: usize,
    /// The relative error of the slopes at which a measurement ends.
    #[serde(deserialize_with = "ranges::share")]
    pub error: f64,
    /// The dataset that the task's images are of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dataset: Option<DatasetRef>,
    /// What images were shown under by turns.
    pub conditions: Vec<Condition>,
    /// For how many control steps each.
    pub control_steps: u32,
    /// The task that robots could be taught, if one was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// How they would see its images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stimulus: Option<StimulusParams>,
    /// How many windows of its images were tried for each robot; 0: only that of `stimulus`.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub windows: usize,
}

impl Setting {
    /// Whether both asked what gaits could be taught of the same task, seen in the same way.
    fn asks_as(&self, other: &Setting) -> bool {
        let asked = |setting: &Setting| {
            (setting.task.clone(), setting.dataset.clone(), setting.stimulus, setting.windows)
        };
        asked(self) == asked(other)
    }
}

/// Why a measurement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EndedBy {
    /// The slopes were known well enough.
    Error,
    /// There were as many rollouts as there might be.
    Images,
}

/// The response of a robot's gait.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotResponse {
    /// Its id, or the name of a published robot.
    pub id: String,
    /// Its body.
    pub body: Body,
    /// Rollouts that were simulated.
    pub rollouts: usize,
    /// Of these, how many became unstable; they tell nothing.
    pub unstable: usize,
    /// Why there were no more.
    pub ended_by: EndedBy,
    /// How far off the slopes are, as a share of what they are: 0 to 1.
    #[serde(deserialize_with = "ranges::share")]
    pub relative_error: f64,
    /// Share of the displacements' variance that slopes fitted to other rollouts explain.
    #[serde(deserialize_with = "ranges::at_most_one")]
    pub r_squared: f64,
    /// What these leave unexplained of a displacement: standard deviation \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub noise: f64,
    /// What the true slopes would leave unexplained \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub scatter: f64,
    /// The penalty of the ridge regression.
    #[serde(deserialize_with = "ranges::size")]
    pub ridge: f64,
    /// Displacement of a body whose places all had no width, the mean over conditions \[voxel
    /// lengths\].
    #[serde(deserialize_with = "ranges::number")]
    pub intercept: f64,
    /// The same under each condition; none of one without stable rollouts.
    #[serde(deserialize_with = "ranges::number")]
    pub intercepts: Vec<Option<f64>>,
    /// Displacement of the gait under each random image, in the order in which they are drawn \[voxel
    /// lengths\]; `null` where unstable. `train` begins with them.
    #[serde(deserialize_with = "ranges::number")]
    pub displacements: Vec<Option<f64>>,
    /// The soft voxels and sensors, row-major.
    pub places: Vec<Place>,
    /// What the gait could be taught, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taught: Option<Taught>,
}

/// A robot whose measurement was stopped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unfinished {
    /// Its id, or the name of a published robot.
    pub id: String,
    /// Its body.
    pub body: Body,
    /// Displacement of the gait under each random image so far, as of a measured robot \[voxel
    /// lengths\].
    #[serde(deserialize_with = "ranges::number")]
    pub displacements: Vec<Option<f64>>,
}

/// A soft voxel or a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Its row, from 0 at the top.
    pub row: usize,
    /// Its column, from 0 on the left.
    pub column: usize,
    /// By how much it moves the body to the right when it is wider by one rest width \[voxel
    /// lengths\].
    #[serde(deserialize_with = "ranges::number")]
    pub slope: f64,
    /// The standard error of that \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub error: f64,
}

impl Place {
    /// Whether the slope cannot be told from none: it is within two standard errors.
    pub fn is_uncertain(&self) -> bool {
        self.slope.abs() < 2.0 * self.error
    }
}

/// What a gait could be taught, by the linear model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Taught {
    /// Mean clipped margin of its answers, `mean_clipped`: from −1 to 1.
    #[serde(deserialize_with = "ranges::number")]
    pub fitness: f64,
    /// Its 95 % interval.
    #[serde(deserialize_with = "ranges::fitness_interval")]
    pub fitness_interval: [f64; 2],
    /// Share of correct answers, both groups weighing the same.
    #[serde(deserialize_with = "ranges::share")]
    pub accuracy: f64,
    /// Its 95 % interval.
    #[serde(deserialize_with = "ranges::interval")]
    pub accuracy_interval: [f64; 2],
    /// The best window of those that were tried, by `stimulus.margin`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<Margins>,
}

impl From<Teachable> for Taught {
    fn from(teachable: Teachable) -> Self {
        let interval = |estimate: Estimate, least: f64| estimate.interval().map(|end| end.clamp(least, 1.0));
        let Teachable { fitness, accuracy } = teachable;
        Taught {
            fitness: fitness.value,
            fitness_interval: interval(fitness, -1.0),
            accuracy: accuracy.value,
            accuracy_interval: interval(accuracy, 0.0),
            margin: None,
        }
    }
}

impl RobotResponse {
    /// What rollouts with random images told of a gait.
    pub(crate) fn new(
        id: &str,
        gait: &Gait,
        response: &Response,
        displacements: Vec<Option<f64>>,
        ended_by: EndedBy,
        taught: Option<Taught>,
    ) -> Self {
        let places = gait.places().iter().zip(response.slopes.iter().zip(&response.errors));
        let place = |(&(row, column), (&slope, &error)): (&(usize, usize), (&f64, &f64))| Place {
            row,
            column,
            slope,
            error,
        };
        RobotResponse {
            id: id.to_string(),
            body: gait.built(&gait.design()),
            rollouts: displacements.len(),
            unstable: displacements.iter().filter(|displacement| displacement.is_none()).count(),
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

    fn check(&self) -> Result<(), Error> {
        if self.setting.conditions.is_empty() {
            return Err(Error::at_key("setting.conditions", "expected one or more"));
        }
        for (number, robot) in self.robots.iter().enumerate() {
            let refuse = |key: &str, expected: &str| {
                Err(Error::at_key(&format!("robots[{number}].{key}"), format!("expected {expected}")))
            };
            if self.robots[..number].iter().any(|other| other.id == robot.id) {
                return refuse("id", "each robot once");
            }
            let places = robot.places.iter().map(|place| (place.row, place.column));
            let gait = Gait::of(&robot.body);
            if !gait.is_some_and(|gait| gait.places().iter().copied().eq(places)) {
                return refuse("places", "the soft voxels and sensors of its body, row-major");
            }
            if robot.rollouts != robot.displacements.len() {
                return refuse("displacements", "one for each of the rollouts");
            }
            if robot.unstable != robot.displacements.iter().filter(|walk| walk.is_none()).count() {
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
    /// What is wrong with the file, with its line and key.
    pub fn read(path: &Path) -> Result<Self, Error> {
        results::read(path, Some("response"))
    }

    /// The file at a path, if there is one. One that cannot be read is told, and left aside.
    pub(crate) fn found(path: &Path, session: &Session) -> Option<Self> {
        if !exists(path) {
            return None;
        }
        let told = |error| session.observer.warning(&format!("{error}; responses are measured again"));
        ResponseFile::read(path).map_err(told).ok()
    }

    /// The displacements of a gait under the first random images of a seed, if they were measured for
    /// the run with this SHA-256, by this version, under these conditions; also those of a
    /// measurement that was stopped. And how many of them are of one that ended.
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
        (if begun.len() > ended.len() { begun } else { ended }, ended.len())
    }

    /// Whether it was measured for the run with this SHA-256, by this version, under these
    /// conditions and random images.
    fn is_of(&self, run_sha256: &str, seed: u64, conditions: &[Condition]) -> bool {
        let by_this = self.program_version == env!("CARGO_PKG_VERSION");
        let Setting { seed: own, conditions: shown, .. } = &self.setting;
        self.run_sha256 == run_sha256 && by_this && *own == seed && shown == conditions
    }

    /// With the other robots of an earlier file, if that holds for the same run, seed and conditions;
    /// what these could be taught is left out if it was another task.
    pub(crate) fn with_others_of(&self, earlier: &ResponseFile) -> Self {
        let mut all = self.clone();
        if earlier.is_of(&self.run_sha256, self.setting.seed, &self.setting.conditions) {
            let is_other = |robot: &&RobotResponse| self.robots.iter().all(|own| own.id != robot.id);
            for robot in earlier.robots.iter().filter(is_other) {
                let taught = robot.taught.filter(|_| earlier.setting.asks_as(&self.setting));
                all.robots.push(RobotResponse { taught, ..robot.clone() });
            }
            let is_open = |robot: &&Unfinished| {
                let ended = self.robots.iter().map(|own| &own.id);
                ended.chain(self.unfinished.iter().map(|own| &own.id)).all(|id| *id != robot.id)
            };
            all.unfinished.extend(earlier.unfinished.iter().filter(is_open).cloned());
        }
        all
    }

    /// Its text: the head on one line, then one line per robot.
    pub fn to_json(&self) -> String {
        let head = ResponseFile { robots: Vec::new(), ..self.clone() };
        by_lines(&head, &self.robots)
    }

    /// `response.csv`: a line per robot and place.
    pub fn to_csv(&self) -> Vec<u8> {
        let rows = self.robots.iter().flat_map(|robot| {
            robot.places.iter().map(|Place { row, column, slope, error }| {
                let material = robot.body.voxels()[(*row, *column)].code();
                (&robot.id, *row, *column, material, *slope, *error)
            })
        });
        table::csv(["id", "row", "column", "material", "slope", "error"], rows)
    }

    /// Writes it, and its CSV beside it. Before it says anything new, `outdated` pictures go: they will
    /// be drawn anew.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(&self, path: &Path, outdated: &[[PathBuf; 2]]) -> Result<(), Error> {
        write_with_table(path, &self.to_json(), &self.to_csv(), outdated.iter().flatten().cloned())
    }
}

/// The pictures of robots beside results in `out`, as SVG and as PNG; of one robot they have the
/// results' name.
pub fn pictures(out: &Path, ids: &[&str]) -> Vec<[PathBuf; 2]> {
    let stem = out.file_stem().expect("its name was checked before anything was measured").to_string_lossy();
    let named = |id: &&str| match ids.len() {
        1 => PICTURES.map(|ending| out.with_extension(ending)),
        _ => PICTURES.map(|ending| out.with_file_name(format!("{stem}-{id}.{ending}"))),
    };
    ids.iter().map(named).collect()
}
