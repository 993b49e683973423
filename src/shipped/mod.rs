//! Runs identified by a name instead of a path: shipped runs (`gallery:zero_one-1`) and those of
//! the atlas (`atlas:zero_one-1`). Their results go to the current folder.

pub(crate) mod atlas;
pub mod gallery;

use crate::base::files::{self, open_file, read_limited};
use flate2::read::MultiGzDecoder;

use std::io;
use std::path::{Path, PathBuf};

enum Place {
    Shipped(&'static str),
    Compressed(PathBuf),
}

/// Splits a path into a run's name (`gallery:zero_one-1`) and its file; `None` for other paths.
fn parts(path: &Path) -> Option<(&str, &str)> {
    let text = path.to_str()?;
    let (name, file) = text.split_once(['/', '\\']).unwrap_or((text, ""));
    [gallery::PREFIX, atlas::PREFIX]
        .iter()
        .any(|prefix| name.starts_with(prefix))
        .then_some((name, file))
}

/// Returns true if a path names a run, or a file of one.
pub fn is_named(path: &Path) -> bool {
    parts(path).is_some()
}

/// Returns the collection of a named run (`gallery`, `atlas`), and its name.
pub(crate) fn name(path: &Path) -> Option<(&str, &str)> {
    parts(path)?.0.split_once(':')
}

/// Returns the collection of a named run, and its set: the part before its seed or digits.
pub(crate) fn set(path: &Path) -> Option<(&str, &str)> {
    let (of, run) = name(path)?;
    Some((of, run.rsplit_once('-')?.0))
}

/// Returns the atlas folder that has a named run; `None` for other paths.
pub(crate) fn atlas_of(path: &Path) -> Option<PathBuf> {
    let (name, _) = parts(path)?;
    atlas::folder_of(name.strip_prefix(atlas::PREFIX)?)
}

/// Returns the place of a named run's file; `None` for other paths, and for unknown shipped files.
fn place(path: &Path) -> Option<io::Result<Place>> {
    let (name, file) = parts(path)?;
    match name.strip_prefix(atlas::PREFIX) {
        Some(run) => Some(atlas::file(run, file).map(Place::Compressed)),
        None if name == gallery::PUBLISHED => Some(Err(io::Error::other(
            "the published robots fill no archive, and have no files; \
             audit, eval, response, replay and plot body take them",
        ))),
        None => gallery::text(name, file).map(|text| Ok(Place::Shipped(text))),
    }
}

/// Reads a text file of a run, named or on the disk.
pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    match place(path).transpose()? {
        Some(Place::Shipped(text)) => Ok(text.to_string()),
        Some(Place::Compressed(file)) => read_limited(MultiGzDecoder::new(open_file(&file)?)),
        None => files::read_text(path),
    }
}

/// Returns true if a file exists, of a named run or on the disk.
pub(crate) fn exists(path: &Path) -> bool {
    place(path).map_or_else(|| path.exists(), |place| place.is_ok())
}

/// Returns the `run.json` of every run that a name stands for.
pub(crate) fn runs(path: &Path) -> Result<Vec<PathBuf>, String> {
    let (name, _) = parts(path).expect("callers ask is_named before");
    name.strip_prefix(atlas::PREFIX)
        .map_or_else(|| gallery::runs(name), |run| Ok(atlas::runs(run)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_a_named_run_has_its_name() {
        let named = |path| name(Path::new(path));
        assert_eq!(
            named("gallery:zero_one-1/run.json"),
            Some(("gallery", "zero_one-1"))
        );
        assert_eq!(named("atlas:four_digit-2"), Some(("atlas", "four_digit-2")));
        assert_eq!(named("runs/atlas:four_digit-2"), None);
        assert_eq!(
            set(Path::new("gallery:zero_one-1/run.json")),
            Some(("gallery", "zero_one"))
        );
        assert_eq!(set(Path::new("runs/atlas:four_digit-2")), None);
    }
}
