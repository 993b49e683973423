//! A run that starts from another run's archive: section `[start]`.

use super::archive::{Robot, RunFile};
use super::config::BodyConfig;
use super::folder::run_json;
use super::held_out::trained_on;
use super::{Config, Error};
use crate::task::dataset::{Dataset, Split};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Where a run starts: section `[start]`. Default: with random individuals.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StartConfig {
    /// The run.json of a run, of whatever task, whose elites are evaluated before the first generation and are its
    /// parents.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub archive: Option<PathBuf>,
}

impl StartConfig {
    /// Whether runs start with random individuals; it is then left out of files.
    pub fn is_default(&self) -> bool {
        *self == StartConfig::default()
    }
}

/// Which archive a run started from, wherever that lay.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartRef {
    /// Name of the run.
    pub name: String,
    /// Its generations.
    pub generations: u64,
    /// SHA-256 of its content.
    pub sha256: String,
    /// Indices of the images that its robots were ever trained on, or that those were chosen among, if they are of the same data:
    /// not for validation.
    pub trained_on: Vec<usize>,
}

/// An archive to start from.
pub(super) struct Start {
    pub origin: StartRef,
    /// Its elites with which the first stage begins, in the order of their cells, as individuals of no generation of this run.
    pub robots: Vec<Robot>,
}

impl Start {
    /// What a config says to start from; `None`: random individuals.
    ///
    /// # Errors
    /// If the file is missing or broken, or its bodies are not what the config asks for.
    pub fn read(config: &Config, dataset: &Dataset) -> Result<Option<Self>, Error> {
        let Some(path) = config.start.archive.clone().map(run_json) else { return Ok(None) };
        let refuse = |text: String| Error::input(format!("start.archive: {}: {text}", path.display()));
        let run = RunFile::read(&path).map_err(|error| {
            let hint = "the run.json of the run to start from is named with --set start.archive=PATH; make that run first";
            let error = error.within("start.archive");
            if path.exists() { error } else { error.hint(hint.to_string()) }
        })?;
        let BodyConfig { height, width, min_muscles } = config.body;
        let BodyConfig { height: rows, width: columns, .. } = run.config.body;
        if (rows, columns) != (height, width) {
            return Err(refuse(format!(
                "its bodies are {rows} × {columns} voxels, expected {height} × {width}, as in this config's [body]"
            )));
        }
        if let Some(robot) = run.elites.iter().find(|robot| robot.voxels.muscle < min_muscles) {
            return Err(refuse(format!(
                "elite {} has {} muscles, expected {min_muscles} or more (body.min_muscles)",
                robot.id, robot.voxels.muscle
            )));
        }
        if run.elites.is_empty() {
            return Err(refuse("it has no elites".to_string()));
        }
        let same_data =
            dataset.fingerprint(Split::Train).is_some_and(|sha256| sha256 == run.dataset.train_sha256);
        let trained_on = if same_data { trained_on(&run, dataset)? } else { BTreeSet::new() };
        let mut archive = run.archive().map_err(|error| error.within("start.archive"))?;
        if let Some(most) = config.start_with(config.period(0)) {
            archive.retain_fittest(most, |robot| robot.task.clone());
        }
        let origin = StartRef {
            sha256: run.fingerprint(),
            name: run.name,
            generations: run.generations,
            trained_on: trained_on.into_iter().collect(),
        };
        let robots =
            archive.elites().map(|elite| Robot { generation: 0, ..elite.solution.clone() }).collect();
        Ok(Some(Start { origin, robots }))
    }
}
