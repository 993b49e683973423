//! `validation.json`: the robots of a run that were chosen on validation images.

use crate::base::error::Error;
use crate::base::files::{exists, read_text};
use crate::config::reading;
use crate::store::names::VALIDATION_JSON;
use crate::store::robots::Source;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What `validation.json` calls itself, and the version of its schema.
pub(crate) const FORMAT: (&str, u32) = ("morphcog-validation", 1);

/// How a robot did on all validation images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Validated {
    /// Its id.
    pub id: String,
    /// Its task.
    pub task: String,
    /// Images.
    pub images: usize,
    /// Images answered correctly.
    pub right: usize,
    /// Mean over the two groups of the share answered correctly.
    pub balanced_accuracy: f64,
}

/// The content of `validation.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ValidationFile {
    pub format: String,
    pub format_version: u32,
    /// SHA-256 of the run's content: of a run that has gone on since, this says nothing.
    pub run_sha256: String,
    /// SHA-256 of all that the result depends on.
    pub key: String,
    /// The best of each task, best first.
    pub robots: Vec<Validated>,
}

impl ValidationFile {
    /// What is in a file, if there is one.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Option<Self>, Error> {
        if !exists(path) {
            return Ok(None);
        }
        let text = read_text(path).map_err(|error| Error::reading(path, &error))?;
        let hint = || "delete it: morphcog eval --robots best-validation:1 chooses robots anew".to_string();
        reading::read_versioned(&text, &path.display().to_string(), FORMAT.0, FORMAT.1)
            .map(Some)
            .map_err(|error| error.hint(hint()))
    }
}

/// The best robots of a run on validation images, as far as they are known for the run as it is;
/// `None` if none are.
///
/// # Errors
/// If the file that says so cannot be read.
pub(crate) fn ranking(source: &Source) -> Result<Option<Vec<Validated>>, Error> {
    let file = ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))?;
    let is_of = |file: &ValidationFile| file.run_sha256 == source.run.fingerprint();
    Ok(file.filter(|file| is_of(file) && !file.robots.is_empty()).map(|file| file.robots))
}

/// How many images the robots in the `validation.json` beside a run were chosen by; `None` without
/// such a file.
///
/// # Errors
/// If it cannot be read.
pub(crate) fn shown(source: &Source) -> Result<Option<usize>, Error> {
    let file = ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))?;
    Ok(file.and_then(|file| file.robots.first().map(|robot| robot.images)))
}
