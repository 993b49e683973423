//! The settings that evaluations record about their runs, enough to reproduce the images.

use crate::base::error::Error;
use crate::config::evaluation::EvaluationConfig;
use crate::config::train::TrainConfig;
use crate::config::validation::ValidationConfig;
use crate::config::{ArchiveConfig, BodyConfig, CheckpointConfig, Config, DataConfig, TaskConfig};
use crate::genome::MutationParams;
use crate::qd::EmitterParams;
use crate::sim::Physics;
use crate::store::folder;
use crate::store::images::ImageRef;
use crate::store::run::RunFile;
use crate::store::stored_run::StoredRun;
use crate::task::evaluation::Savings;
use crate::task::protocol::Protocol;
use crate::task::stimulus::StimulusParams;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A run that contributed robots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunRef {
    /// The name of the run.
    pub(crate) name: String,
    /// The seed of the run.
    pub seed: u64,
    /// The number of generations completed.
    pub(crate) generations: u64,
    /// The images of its last training.
    pub(crate) training_images: Vec<ImageRef>,
    /// The SHA-256 of its content.
    pub sha256: String,
    /// The name for `--archive`, if the run has a name in place of a path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) archive: Option<String>,
    /// The name in tables, if there are several runs: that of its folder, or of a run that ships.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) folder: Option<String>,
}

/// The settings that give networks the same images as the robots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunSetting {
    /// The rows and columns of a stimulus.
    pub(crate) body: BodyConfig,
    /// The classes and their groups.
    pub(crate) task: TaskConfig,
    /// The data.
    pub data: DataConfig,
    /// The conversion from image to stimulus.
    pub stimulus: StimulusParams,
    /// The SHA-256 of the training split.
    pub train_sha256: String,
}

impl RunRef {
    /// Describes runs that are tested together.
    pub(crate) fn of_all(sources: &[StoredRun]) -> Vec<Self> {
        let paths: Vec<&Path> = sources.iter().map(|source| source.path.as_path()).collect();
        let folders = (sources.len() > 1).then(|| folder::short_names(&paths));
        let mut folders = folders.into_iter().flatten();
        let of = |source| RunRef {
            folder: folders.next(),
            ..RunRef::of(source)
        };
        sources.iter().map(of).collect()
    }

    fn of(source: &StoredRun) -> Self {
        let run = &source.run;
        RunRef {
            name: run.name.clone(),
            seed: run.config.seed,
            generations: run.generations,
            training_images: run.training_images.clone(),
            sha256: run.fingerprint(),
            archive: folder::full_name(&source.path),
            folder: None,
        }
    }

    /// Returns the name in tables; earlier versions did not record the folder.
    pub(crate) fn in_tables(&self) -> &str {
        self.folder.as_deref().unwrap_or(&self.name)
    }
}

impl RunSetting {
    pub(crate) fn new(run: &RunFile) -> Self {
        RunSetting {
            body: run.config.body,
            task: run.config.task.clone(),
            data: run.config.data.clone(),
            stimulus: run.config.stimulus,
            train_sha256: run.dataset.train_sha256.clone(),
        }
    }

    /// Checks what types cannot: everything here is part of a config, which must be valid.
    pub(crate) fn validate(&self) -> Result<(), Error> {
        let config = Config {
            seed: 1,
            generations: 1,
            body: self.body,
            task: self.task.clone(),
            data: self.data.clone(),
            stimulus: self.stimulus,
            protocol: Protocol::default(),
            map_elites: EmitterParams::default(),
            archive: ArchiveConfig::default(),
            genome: MutationParams::default(),
            savings: Savings::default(),
            checkpoint: CheckpointConfig::default(),
            evaluation: EvaluationConfig::default(),
            train: TrainConfig::default(),
            validation: ValidationConfig::default(),
            physics: Physics::default(),
        };
        config.validate().map_err(|error| error.in_place("setting"))
    }
}
