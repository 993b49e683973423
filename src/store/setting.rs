//! What evaluations say of the runs they are of: enough to show others the same images.

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
use crate::store::run::StoredRun;
use crate::task::evaluation::Savings;
use crate::task::protocol::Protocol;
use crate::task::stimulus::StimulusParams;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A run that robots are from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunRef {
    /// Its name.
    pub name: String,
    /// Its seed.
    pub seed: u64,
    /// Generations it had done.
    pub generations: u64,
    /// The images it was trained on last.
    pub training_images: Vec<ImageRef>,
    /// SHA-256 of its content.
    pub sha256: String,
    /// How `--archive` names it, if it has a name and no path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub archive: Option<String>,
}

/// What networks need to know to be given the same images as the robots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setting {
    /// Rows and columns of a stimulus.
    pub body: BodyConfig,
    /// The classes and their groups.
    pub task: TaskConfig,
    /// The data.
    pub data: DataConfig,
    /// From image to stimulus.
    pub stimulus: StimulusParams,
    /// SHA-256 of the training split.
    pub train_sha256: String,
}

impl RunRef {
    pub(crate) fn of(source: &StoredRun) -> Self {
        let run = &source.run;
        RunRef {
            name: run.name.clone(),
            seed: run.config.seed,
            generations: run.generations,
            training_images: run.training_images.clone(),
            sha256: run.fingerprint(),
            archive: folder::full_name(&source.path),
        }
    }
}

impl Setting {
    pub(crate) fn new(run: &RunFile) -> Self {
        Setting {
            body: run.config.body,
            task: run.config.task.clone(),
            data: run.config.data.clone(),
            stimulus: run.config.stimulus,
            train_sha256: run.dataset.train_sha256.clone(),
        }
    }

    /// Checks what a type cannot: all that is here stands in a config, which must be valid.
    pub(crate) fn check(&self) -> Result<(), Error> {
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
