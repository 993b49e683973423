//! `capacity.json`: what networks the robots are worth (paper, "Morphological cognition capacity").

use super::{Error, toml_text};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What `capacity.json` calls itself.
pub const FORMAT: &str = "morphcog-capacity";
/// Version of its schema.
pub const FORMAT_VERSION: u32 = 1;
/// Its name beside `eval.json`.
pub const CAPACITY_JSON: &str = "capacity.json";

/// The content of `capacity.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CapacityFile {
    /// [`FORMAT`].
    pub format: String,
    /// [`FORMAT_VERSION`].
    pub format_version: u32,
    /// Version of morphcog that wrote it.
    pub program_version: String,
    /// Name of the evaluated run, or of the runs.
    pub run: String,
    /// How the robots were selected, for people.
    pub selected: String,
    /// Name of the dataset.
    pub dataset: String,
    /// What training waited on: "test" as in the paper, or "validation".
    pub patience_on: String,
    /// Trainings from scratch per size.
    pub trainings: usize,
    /// Whether a signal stopped it before the end.
    pub stopped: bool,
    /// The tasks.
    pub tasks: Vec<TaskCapacity>,
}

/// The capacity of the robots of one task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskCapacity {
    /// Its name, as "0|1".
    pub task: String,
    /// Robots evaluated.
    pub robots: usize,
    /// Their mean accuracy on test images, 0 to 1.
    pub accuracy: f64,
    /// A curve per kind of network.
    pub curves: Vec<Curve>,
}

/// Accuracy over size for one kind of network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// "mlp" (size: hidden neurons) or "cnn" (size: kernels).
    pub network: String,
    /// The points, by size.
    pub points: Vec<Point>,
    /// c0, c1, c2 of accuracy ≈ c0 + c1·size + c2·size², least squares through the points.
    pub fit: Option<[f64; 3]>,
    /// The smallest size at which the fit reaches the robots' accuracy; none if it never does.
    pub capacity: Option<f64>,
}

/// One size of network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Hidden neurons, or kernels.
    pub size: usize,
    /// Mean test accuracy over the trainings, 0 to 1.
    pub mean: f64,
    /// Standard deviation over the trainings.
    pub standard_deviation: f64,
    /// Trainable parameters.
    pub parameters: usize,
}

impl CapacityFile {
    /// Reads `capacity.json`.
    ///
    /// # Errors
    /// What is wrong with the file, with its line and key.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|error| Error::reading(path, &error))?;
        let name = path.display().to_string();
        #[derive(Deserialize)]
        struct Head {
            format: Option<String>,
            format_version: Option<u32>,
        }
        let head: Head = toml_text::read_json(&text, &name)?;
        if head.format.as_deref() != Some(FORMAT) || head.format_version.is_none_or(|v| v > FORMAT_VERSION) {
            let text =
                format!("{name}: expected \"format\": \"{FORMAT}\", \"format_version\": {FORMAT_VERSION}");
            return Err(Error::input(text).hint("morphcog capacity makes such a file".to_string()));
        }
        toml_text::read_json(&text, &name)
    }

    /// Its text.
    pub fn to_json(&self) -> String {
        // Numbers are finite, keys are text: JSON has all of it.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}
