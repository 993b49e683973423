//! Folders that this process has locked. After losing a lock it writes nothing more there: another
//! process may be at work.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A lock on a folder that this process no longer holds.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Lost {
    #[error("{holder} has taken over {}", lock.display())]
    Taken {
        /// The lock file.
        lock: PathBuf,
        holder: String,
    },
    /// The lock file was removed or emptied.
    #[error("{}, the lock that keeps others out, was removed", lock.display())]
    Removed {
        /// The lock file.
        lock: PathBuf,
    },
}

impl From<Lost> for io::Error {
    fn from(lost: Lost) -> Self {
        io::Error::other(lost)
    }
}

impl Lost {
    pub(crate) fn of(error: &io::Error) -> Option<&Self> {
        error.get_ref()?.downcast_ref()
    }
}

type Look = dyn Fn() -> io::Result<()> + Send + Sync;

struct Claim {
    number: u64,
    /// The folder's absolute path, and its path without links.
    places: Vec<PathBuf>,
    look: Arc<Look>,
}

static CLAIMS: Mutex<Vec<Claim>> = Mutex::new(Vec::new());

fn claims() -> MutexGuard<'static, Vec<Claim>> {
    CLAIMS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A claim on a folder, given up on drop.
#[derive(Debug)]
pub(crate) struct Ownership(u64);

impl Ownership {
    /// Claims the folder of a lock. Before this process writes a file there, it calls `look`, which
    /// fails if it no longer may.
    pub(crate) fn claim(
        lock: &Path,
        look: impl Fn() -> io::Result<()> + Send + Sync + 'static,
    ) -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        claims().push(Claim {
            number,
            places: places(folder_of(lock)),
            look: Arc::new(look),
        });
        Ownership(number)
    }
}

impl Drop for Ownership {
    fn drop(&mut self) {
        claims().retain(|claim| claim.number != self.0);
    }
}

/// Checks that this process may write a file: it has not lost its lock on the file's folder.
pub(crate) fn check(file: &Path) -> io::Result<()> {
    if claims().is_empty() {
        return Ok(());
    }
    let places = places(folder_of(file));
    let is_there = |claim: &&Claim| claim.places.iter().any(|place| places.contains(place));
    let looks: Vec<Arc<Look>> = claims()
        .iter()
        .filter(is_there)
        .map(|claim| Arc::clone(&claim.look))
        .collect();
    looks.iter().try_for_each(|look| look())
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Returns the paths of a folder by which it is found again, even after it was removed.
fn places(folder: &Path) -> Vec<PathBuf> {
    [std::path::absolute(folder), folder.canonicalize()]
        .into_iter()
        .flatten()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::files::write_atomically;

    #[test]
    fn nothing_is_written_to_a_folder_whose_lock_is_lost_by_whatever_name_it_is_called() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("own");
        std::fs::create_dir_all(own.join("inner")).unwrap();
        let lost = || Lost::Removed {
            lock: "own/.lock".into(),
        };
        let ownership = Ownership::claim(&own.join(".lock"), move || Err(lost().into()));
        for name in ["own/run.json", "own/inner/../run.json", "own/./run.json"] {
            let error = write_atomically(&folder.path().join(name), b"{}").unwrap_err();
            assert_eq!(Lost::of(&error), Some(&lost()), "{name}");
        }
        assert_eq!(std::fs::read_dir(&own).unwrap().count(), 1);
        write_atomically(&folder.path().join("run.json"), b"{}").unwrap();
        drop(ownership);
        write_atomically(&own.join("run.json"), b"{}").unwrap();
    }
}
