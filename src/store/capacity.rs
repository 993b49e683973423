//! `capacity.json`: the networks that match the robots (paper, "Morphological cognition capacity").

use crate::base::error::Error;
use crate::base::number;
use crate::base::ranges;
use crate::base::table;
use crate::baseline::curve::Crossing;
use crate::store::eval::EvalFile;
use crate::store::names::{CAPACITY_JSON, EVAL_JSON};
use crate::store::results::{self, Stored};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "morphcog-capacity";
pub(crate) const FORMAT_VERSION: u32 = 1;

/// The content of `capacity.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CapacityFile {
    /// The constant "morphcog-capacity".
    #[schemars(extend("const" = FORMAT))]
    pub(crate) format: String,
    /// The version of this schema.
    #[schemars(range(min = 1, max = FORMAT_VERSION))]
    pub(crate) format_version: u32,
    /// The version of morphcog that wrote the file.
    pub(crate) program_version: String,
    /// The name of the evaluated run, or names of the runs.
    pub(crate) run: String,
    /// The identifier of the evaluation: its runs, images, robots and their walks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) eval_sha256: Option<String>,
    /// The selection of the robots, in words.
    pub(crate) selected: String,
    /// The name of the dataset.
    pub(crate) dataset: String,
    /// The images that stop a training: "test" as in the paper, or "validation".
    pub patience_on: String,
    /// The number of trainings from scratch per size.
    pub(crate) trainings: usize,
    /// True if only robots count that an audit found physical.
    #[serde(default, skip_serializing_if = "is_false")]
    pub(crate) physical_only: bool,
    /// True if a signal stopped the analysis before the end.
    pub stopped: bool,
    /// The tasks.
    pub tasks: Vec<TaskCapacity>,
}

fn is_false(value: &bool) -> bool {
    !value
}

/// The capacity of the robots of one task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TaskCapacity {
    /// The name of the task, such as "0|1".
    pub task: String,
    /// The number of robots evaluated.
    pub robots: usize,
    /// The mean accuracy of the robots on test images, 0 to 1.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) accuracy: f64,
    /// A curve per kind of network.
    pub curves: Vec<Curve>,
}

/// The accuracy of one kind of network over its size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// The kind: "mlp" (size: hidden neurons) or "cnn" (size: kernels).
    pub(crate) network: String,
    /// The points, by size.
    pub points: Vec<Point>,
    /// The coefficients c0, c1, c2 of accuracy ≈ c0 + c1·size + c2·size², least squares.
    #[serde(default, deserialize_with = "ranges::number")]
    pub fit: Option<[f64; 3]>,
    /// The smallest size at which the fit reaches the robots' accuracy, or a note that the smallest
    /// network already exceeds it; null if the fit never reaches it.
    pub(crate) capacity: Option<Crossing>,
    /// The 95 % interval of the capacity, by a bootstrap over trainings and robots. An end is the
    /// smallest size where the curve begins above the robots, and null where it never reaches them.
    /// Null if there is one training of each size and one robot, or in files of earlier versions.
    #[serde(default)]
    pub(crate) interval: Option<[Option<f64>; 2]>,
}

/// Networks of one size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// The number of hidden neurons, or of kernels.
    pub size: usize,
    /// The mean test accuracy over the trainings, 0 to 1.
    #[serde(deserialize_with = "ranges::share")]
    pub mean: f64,
    /// The standard deviation over the trainings; null for a single one.
    #[serde(default, deserialize_with = "ranges::share")]
    pub(crate) standard_deviation: Option<f64>,
    /// The number of trainable parameters.
    pub parameters: usize,
}

impl Stored for CapacityFile {
    const FORMAT: (&'static str, u32) = (FORMAT, FORMAT_VERSION);

    fn validate(&self) -> Result<(), Error> {
        for (number, task) in self.tasks.iter().enumerate() {
            let at = |key: &str| format!("tasks[{number}].{key}");
            if task.robots == 0 {
                return Err(Error::at_key(&at("robots"), "expected one or more"));
            }
            if self.tasks[..number]
                .iter()
                .any(|other| other.task == task.task)
            {
                return Err(Error::at_key(
                    &at("task"),
                    format!("{} is there twice", task.task),
                ));
            }
            for (number, curve) in task.curves.iter().enumerate() {
                let at = |key: &str| at(&format!("curves[{number}].{key}"));
                let sizes = || curve.points.iter().map(|point| point.size);
                if curve.points.is_empty() || !sizes().is_sorted_by(|a, b| a < b) {
                    return Err(Error::at_key(
                        &at("points"),
                        "expected one or more, by size, each size once",
                    ));
                }
                let [least, most] =
                    [sizes().min(), sizes().max()].map(|size| size.unwrap_or(0) as f64);
                let within = |key: &str, found: f64| {
                    if (least..=most).contains(&found) {
                        return Ok(());
                    }
                    let text = format!("expected a size from {least} to {most}, found {found:e}");
                    Err(Error::at_key(&at(key), text))
                };
                if let Some(Crossing::At(size) | Crossing::Below { below: size }) = curve.capacity {
                    within("capacity", size)?;
                }
                let ends = curve.interval.iter().flatten().flatten();
                ends.into_iter()
                    .try_for_each(|end| within("interval", *end))?;
            }
        }
        Ok(())
    }
}

impl CapacityFile {
    /// Reads `capacity.json`.
    ///
    /// # Errors
    /// Returns an error, with its line and key, if the file is missing or invalid.
    pub fn read(path: &Path) -> Result<Self, Error> {
        results::read(path, Some("capacity"))
    }

    /// Returns the default path for the analysis of an evaluation: `capacity.json` beside it, or
    /// `gallery-zero_one-capacity.json` beside `gallery-zero_one-eval.json`.
    pub(crate) fn beside(eval: &Path) -> PathBuf {
        let of = eval
            .file_name()
            .and_then(|name| name.to_str()?.strip_suffix(EVAL_JSON));
        eval.with_file_name(format!("{}{CAPACITY_JSON}", of.unwrap_or_default()))
    }

    /// Reads the analysis beside an `eval.json`, if it has the same robots and images.
    pub(crate) fn of(report: &EvalFile, eval: &Path) -> Option<Self> {
        let found = Self::read(&Self::beside(eval)).ok()?;
        found.is_of(report).then_some(found)
    }

    /// Returns true if the analysis has the same robots and images as an evaluation.
    pub(crate) fn is_of(&self, report: &EvalFile) -> bool {
        let same = |task: &TaskCapacity| {
            report.means.get(&task.task).is_some_and(|mean| {
                mean.robots == task.robots && (mean.accuracy - task.accuracy).abs() < 1e-9
            })
        };
        if let Some(known) = &self.eval_sha256 {
            return *known == report.fingerprint();
        }
        self.dataset == report.dataset
            && self.selected == report.selected
            && self.tasks.iter().all(same)
    }

    /// Encodes `capacity.csv`: a line per task, network and size.
    pub(crate) fn to_csv(&self) -> Vec<u8> {
        let columns = [
            "task",
            "network",
            "size",
            "parameters",
            "mean",
            "standard_deviation",
            "fit",
            "robots",
        ];
        let rows = self.tasks.iter().flat_map(|task| {
            task.curves.iter().flat_map(move |curve| {
                curve.points.iter().map(move |point| {
                    let network = (&task.task, &curve.network, point.size, point.parameters);
                    let fit = curve.value(point.size as f64);
                    (
                        network,
                        point.mean,
                        point.standard_deviation,
                        fit,
                        task.accuracy,
                    )
                })
            })
        });
        table::csv(columns, rows)
    }

    pub(crate) fn to_json(&self) -> String {
        // Numbers are finite and keys are text, so encoding cannot fail.
        serde_json::to_string_pretty(self).expect("JSON has all of it") + "\n"
    }
}

/// Returns a capacity with its interval for people: "17 (14–21)", "< 1", "< 1 (up to any size)", "no
/// match (38 or more)".
pub(crate) fn spoken(capacity: Option<Crossing>, interval: Option<[Option<f64>; 2]>) -> String {
    let whole = |size: f64| number::fixed(size, 0);
    let is_below = matches!(capacity, Some(Crossing::Below { .. }));
    let capacity = capacity.map_or_else(|| "no match".to_string(), |size| size.to_string());
    match interval {
        Some([Some(low), Some(high)]) if whole(low) != whole(high) => {
            format!("{capacity} ({}–{})", whole(low), whole(high))
        }
        // The interval's lower end is below the smallest size, too.
        Some([Some(_), None]) if is_below => format!("{capacity} (up to any size)"),
        Some([Some(low), None]) => format!("{capacity} ({} or more)", whole(low)),
        _ => capacity,
    }
}

impl TaskCapacity {
    /// Returns the curve of a kind of network, if it was trained.
    pub fn curve(&self, network: &str) -> Option<&Curve> {
        self.curves.iter().find(|curve| curve.network == network)
    }
}

impl Curve {
    /// Returns the fit at a size.
    pub(crate) fn value(&self, size: f64) -> Option<f64> {
        self.fit.map(|[c0, c1, c2]| c0 + size * (c1 + size * c2))
    }

    /// Returns the capacity for people, in whole neurons or kernels, with its interval: "17 (14–21)".
    pub(crate) fn spoken(&self) -> String {
        spoken(self.capacity, self.interval)
    }
}
