//! Runs that are named, and not found by a path: those that ship with the program
//! (`gallery:zero_one-1`), and those of the atlas (`atlas:zero_one-1`). Results of such a run do not go
//! beside it, but to the present folder.

use crate::base::{atlas, shipped};
use std::io;
use std::path::{Path, PathBuf};

/// Where the text of a file of a named run is.
pub enum Place {
    /// In the program.
    Shipped(&'static str),
    /// In this file, compressed by gzip.
    Compressed(PathBuf),
}

/// Whether a path names a run, or a file of one.
pub fn is_named(path: &Path) -> bool {
    shipped::is_shipped(path) || atlas::is_of_atlas(path)
}

/// Where a file of a named run is; none of other paths.
///
/// # Errors
/// That there is no such file, and what to do.
pub fn place(path: &Path) -> Option<io::Result<Place>> {
    if let Some(text) = shipped::text(path) {
        return Some(Ok(Place::Shipped(text)));
    }
    atlas::is_of_atlas(path).then(|| atlas::file(path).map(Place::Compressed))
}

/// The `run.json` of every run that a name means.
///
/// # Errors
/// What ships with the program, if there is no such run of it.
pub fn runs(path: &Path) -> Result<Vec<PathBuf>, String> {
    if atlas::is_of_atlas(path) { Ok(atlas::runs(path)) } else { shipped::runs(path) }
}

/// Whose a named run is (`gallery`, `atlas`), and its name.
pub fn name(path: &Path) -> Option<(&str, &str)> {
    let (of, run) = path.to_str().filter(|_| is_named(path))?.split_once(':')?;
    Some((of, run.split_once(['/', '\\']).map_or(run, |(run, _)| run)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_a_named_run_has_its_name() {
        let named = |path| name(Path::new(path));
        assert_eq!(named("gallery:zero_one-1/run.json"), Some(("gallery", "zero_one-1")));
        assert_eq!(named("atlas:four_digit-2"), Some(("atlas", "four_digit-2")));
        assert_eq!(named("runs/atlas:four_digit-2"), None);
    }
}
