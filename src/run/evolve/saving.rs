//! A run's files: checkpoint, `run.json` and `elites.csv`.

use super::Run;
use crate::base::files::write_atomically;
use crate::run::Error;
use crate::run::archive::{FORMAT, FORMAT_VERSION, RunFile};
use crate::run::checkpoint::{self, Checkpoint};
use crate::run::folder::{self, RunFolder};

impl Run<'_> {
    /// Writes checkpoint, `run.json` and `elites.csv`.
    pub(super) fn save(&self, folder: &RunFolder) -> Result<(), Error> {
        let run = self.file();
        let (known_bodies, relatives) = (self.known.clone(), self.relatives.clone());
        let checkpoint = Checkpoint { run, totals: self.totals(), known_bodies, relatives };
        checkpoint::write(folder.path(), &checkpoint)?;
        let run = checkpoint.run;
        let csv = run.to_csv().map_err(|error| Error::other(error.to_string()))?;
        for (name, content) in [(folder::RUN_JSON, run.to_json().into_bytes()), (folder::ELITES, csv)] {
            let path = folder.path().join(name);
            write_atomically(&path, &content).map_err(|error| Error::writing(&path, &error))?;
        }
        Ok(())
    }

    /// The run as it is now.
    pub(super) fn file(&self) -> RunFile {
        RunFile {
            format: FORMAT.to_string(),
            format_version: FORMAT_VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            name: self.options.name.clone(),
            config: self.options.config.clone(),
            dataset: self.training.dataset.clone(),
            training_images: self.training.images.clone(),
            dimensions: self.dimensions.clone(),
            start: self.origin.clone(),
            generations: self.generation,
            stats: self.stats(),
            elites: self.search.archive().elites().map(|elite| elite.solution.clone()).collect(),
            read_sha256: None,
        }
    }
}
