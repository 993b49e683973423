//! [`StoredRun`]: a run and the place of its file.

use crate::base::error::Error;
use crate::base::remedy::{Invocation, Remedy};
use crate::store::folder;
use crate::store::run::RunFile;
use std::path::{Path, PathBuf};

#[derive(Clone, Debug)]
pub(crate) struct StoredRun {
    /// Its run.json; what else is known of its robots lies beside it.
    pub(crate) path: PathBuf,
    pub(crate) run: RunFile,
}

impl StoredRun {
    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        Ok(StoredRun {
            path: path.to_path_buf(),
            run: RunFile::read(path)?,
        })
    }

    /// Checks that its robots have a task: gaits have none yet.
    pub(crate) fn has_task(&self) -> Result<(), Error> {
        if !self.run.config.measures_response() {
            return Ok(());
        }
        let text = format!(
            "{}: these are gaits, which tell no images apart yet",
            self.path.display()
        );
        let train = Invocation::new("train").option("archive", folder::archive(&self.path));
        Err(Error::input(text).remedy(Remedy::Run(train.option("task", "4|9"), "trains one")))
    }
}
