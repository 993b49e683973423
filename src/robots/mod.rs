//! Which robots are meant: those of archives that an argument selects, and the published ones,
//! which are one more run.

pub mod published;
pub mod selection;

use crate::base::error::Error;
use crate::robots::selection::Selection;
use crate::store::folder;
use crate::store::run::StoredRun;
use std::path::{Path, PathBuf};

/// Opens a run.json, also that of the published robots.
///
/// # Errors
/// As [`StoredRun::read`].
pub fn open(path: &Path) -> Result<StoredRun, Error> {
    match path == published::archive() {
        true => Ok(StoredRun { path: path.to_path_buf(), run: published::run()? }),
        false => StoredRun::read(path),
    }
}

/// Returns the archives that a selection is from: those that are named, or else the published
/// robots if it names these, or else the newest run.
///
/// # Errors
/// If there is no run.
pub fn archives(named: Vec<PathBuf>, robots: Selection) -> Result<(Vec<PathBuf>, Selection), Error> {
    if !named.is_empty() {
        return Ok((named, robots));
    }
    if !published::is_meant(&robots)? {
        return Ok((vec![folder::newest_run()?], robots));
    }
    let all = matches!(&robots, Selection::Ids(ids) if ids.iter().any(|id| id == published::ALL));
    Ok((vec![published::archive()], if all { Selection::All } else { robots }))
}
