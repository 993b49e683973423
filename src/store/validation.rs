//! `validation.json`: the robots of a run that were chosen on validation images.

use crate::base::files::read_text;
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
    /// What is in a file; `None` if that cannot be read: then robots are chosen anew.
    pub fn read(path: &Path) -> Option<Self> {
        let text = read_text(path).ok()?;
        reading::read_versioned(&text, &path.display().to_string(), FORMAT.0, FORMAT.1).ok()
    }
}

/// The best robots of a run on validation images, as far as they are known for the run as it is;
/// `None` if none are.
pub(crate) fn ranking(source: &Source) -> Option<Vec<Validated>> {
    let file = ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))?;
    (file.run_sha256 == source.run.fingerprint() && !file.robots.is_empty()).then_some(file.robots)
}

/// How many images the robots in the `validation.json` beside a run were chosen by; `None` without
/// such a file.
pub(crate) fn shown(source: &Source) -> Option<usize> {
    ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))?
        .robots
        .first()
        .map(|robot| robot.images)
}
