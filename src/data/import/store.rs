//! A dataset's folder that appears as a whole or not at all.

use crate::base::error::Error;
use crate::base::files::{sync_folder, write_atomically};
use crate::base::remedy::Remedy;
use crate::data::description::DATASET_JSON;
use std::path::{Path, PathBuf};

/// The table of the images' sources, in a dataset's folder.
pub(crate) const IMAGES_CSV: &str = "images.csv";

/// The name of the picture with some images of each class.
pub(crate) const SHEET_PNG: &str = "sheet.png";

/// A folder beside the one that is wanted, removed on drop unless it has taken its place.
#[derive(Debug)]
pub(crate) struct Staging {
    path: PathBuf,
    target: PathBuf,
    /// Folders that were made for it, the innermost first.
    made: Vec<PathBuf>,
    is_done: bool,
}

/// Checks that a folder may be written: there is none, it is empty, or it is to be replaced and is
/// a dataset's.
pub(crate) fn check_free(target: &Path, force: bool) -> Result<(), Error> {
    let place = target.display();
    let Ok(found) = std::fs::metadata(target) else {
        return Ok(());
    };
    if !found.is_dir() {
        return Err(Error::occupied(format!("{place}: there is a file")).remedy(Remedy::MoveAway));
    }
    let entries = std::fs::read_dir(target).map_err(|error| Error::reading(target, &error))?;
    let entries: Vec<std::fs::DirEntry> = entries.flatten().collect();
    let is_of_dataset = |entry: &std::fs::DirEntry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_idx = name.trim_end_matches(".gz").ends_with("-ubyte");
        // The last is a file manager's.
        let is_known = [DATASET_JSON, IMAGES_CSV, SHEET_PNG, ".DS_Store"].contains(&name.as_str());
        (is_known || is_idx) && !entry.path().is_dir()
    };
    match (entries.is_empty(), force) {
        (true, _) => Ok(()),
        (false, true) => match entries.iter().find(|entry| !is_of_dataset(entry)) {
            None => Ok(()),
            Some(other) => {
                let other = other.file_name().to_string_lossy().into_owned();
                let text =
                    format!("{place}: has {other}, which no dataset has: it is not replaced");
                Err(Error::occupied(text).remedy(Remedy::MoveAway))
            }
        },
        (false, false) => Err(Error::occupied(format!("{place}: is there already"))
            .remedy(Remedy::Replace)
            .advice("give it another name")),
    }
}

impl Staging {
    /// Makes a folder beside the target.
    pub(crate) fn beside(target: &Path) -> Result<Self, Error> {
        // A link stays, and what it leads to is replaced.
        let target = target
            .canonicalize()
            .unwrap_or_else(|_| target.to_path_buf());
        let parent = parent(&target);
        let is_new = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let made: Vec<PathBuf> = parent
            .ancestors()
            .take_while(is_new)
            .map(Path::to_path_buf)
            .collect();
        std::fs::create_dir_all(parent).map_err(|error| Error::writing(&target, &error))?;
        let mut staging = Staging {
            path: PathBuf::new(),
            target,
            made,
            is_done: false,
        };
        staging.path = staging.free_name("new")?;
        std::fs::create_dir(&staging.path)
            .map_err(|error| Error::writing(&staging.target, &error))?;
        Ok(staging)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn target(&self) -> &Path {
        &self.target
    }

    /// Writes a file of the folder.
    pub(crate) fn write(&self, name: &str, content: &[u8]) -> Result<(), Error> {
        let written = write_atomically(&self.path.join(name), content);
        written.map_err(|error| Error::writing(&self.target.join(name), &error))
    }

    /// Puts the folder in its place; what was there is removed.
    pub(crate) fn commit(mut self) -> Result<(), Error> {
        let failed = |error: std::io::Error| Error::writing(&self.target, &error);
        sync_folder(&self.path).map_err(failed)?;
        let old = match self.target.exists() {
            true => {
                let old = self.free_name("old")?;
                std::fs::rename(&self.target, &old).map_err(failed)?;
                Some(old)
            }
            false => None,
        };
        if let Err(error) = std::fs::rename(&self.path, &self.target) {
            let back = old.map(|old| std::fs::rename(old, &self.target));
            return Err(match back {
                Some(Err(error)) => failed(error),
                _ => failed(error),
            });
        }
        self.is_done = true;
        let _ = sync_folder(parent(&self.target));
        // The new one is in its place: what is left of the old one does no harm.
        old.map(std::fs::remove_dir_all);
        Ok(())
    }

    fn free_name(&self, what: &str) -> Result<PathBuf, Error> {
        let name = self
            .target
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let own = std::process::id();
        let beside =
            |number: u32| parent(&self.target).join(format!(".{name}.{what}-{own}-{number}.tmp"));
        let mut names = (0..1000)
            .map(beside)
            .filter(|path| path.symlink_metadata().is_err());
        let text = || format!("{}: there is no free name beside it", self.target.display());
        names.next().ok_or_else(|| Error::other(text()))
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        if !self.is_done {
            // Nothing helps against an error here, and none is worse than the one that led here.
            let _ = std::fs::remove_dir_all(&self.path);
            self.made
                .iter()
                .for_each(|folder| drop(std::fs::remove_dir(folder)));
        }
    }
}

fn parent(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_appears_as_a_whole_or_not_at_all() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("data/shapes");
        let staging = Staging::beside(&target).unwrap();
        staging.write("a", b"1").unwrap();
        assert!(!target.exists());
        drop(staging);
        assert!(names(root.path()).is_empty());
        let staging = Staging::beside(&target).unwrap();
        staging.write(DATASET_JSON, b"1").unwrap();
        staging.commit().unwrap();
        assert_eq!(
            (names(&target), names(&root.path().join("data"))),
            (vec![DATASET_JSON.to_string()], vec!["shapes".to_string()])
        );
        let staging = Staging::beside(&target).unwrap();
        staging.write("b", b"2").unwrap();
        staging.commit().unwrap();
        assert_eq!(
            (names(&target), names(&root.path().join("data")).len()),
            (vec!["b".to_string()], 1)
        );
    }

    #[test]
    fn only_a_dataset_is_replaced_and_only_if_that_is_asked_for() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        for (name, file) in [
            ("set", "dataset.json"),
            ("idx", "train-images-idx3-ubyte"),
            ("other", "letter.txt"),
        ] {
            std::fs::create_dir(at(name)).unwrap();
            std::fs::write(at(name).join(file), "x").unwrap();
            assert!(check_free(&at(name), false).is_err(), "{name}");
            assert_eq!(
                check_free(&at(name), true).is_ok(),
                name != "other",
                "{name}"
            );
        }
        // A folder of datasets is none itself.
        std::fs::create_dir(at("set/cat-images")).unwrap();
        assert!(check_free(&at("set"), true).is_err());
        std::fs::create_dir(at("empty")).unwrap();
        assert!(check_free(&at("empty"), false).is_ok() && check_free(&at("none"), false).is_ok());
        std::fs::write(at("file"), "x").unwrap();
        assert!(check_free(&at("file"), true).is_err());
    }
}
