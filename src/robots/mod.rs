//! The selection of robots: from the archives of an argument, or from the published run.

pub mod published;
pub mod selection;

use crate::base::error::Error;
use crate::robots::selection::Selection;
use crate::store::folder;
use crate::store::run::RunFile;
use crate::store::stored_run::StoredRun;
use std::path::{Path, PathBuf};

/// Reads a run.json, a shipped run, or the built-in run of the published robots.
///
/// # Errors
/// Returns an error if it cannot be read.
pub fn read(path: &Path) -> Result<RunFile, Error> {
    open(path).map(|stored| stored.run)
}

/// Opens a run.json, or the built-in run of the published robots.
pub(crate) fn open(path: &Path) -> Result<StoredRun, Error> {
    match path == published::archive() {
        true => Ok(StoredRun {
            path: path.to_path_buf(),
            run: published::run()?,
        }),
        false => StoredRun::read(path),
    }
}

/// Returns the archives to select from: the named ones, the published robots, or the newest run.
pub(crate) fn archives(
    named: Vec<PathBuf>,
    robots: Selection,
) -> Result<(Vec<PathBuf>, Selection), Error> {
    if !named.is_empty() {
        return Ok((named, robots));
    }
    if !published::is_meant(&robots)? {
        return Ok((vec![folder::newest_run()?], robots));
    }
    let all = matches!(&robots, Selection::Ids(ids) if ids.iter().any(|id| id == published::ALL));
    Ok((
        vec![published::archive()],
        if all { Selection::All } else { robots },
    ))
}
