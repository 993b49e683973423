//! Folders that this process has locked. Nothing is written to one after its lock was lost: another
//! process may be at work there.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// This process had locked a folder, and the lock is no longer its own.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Lost {
    /// Another process has it.
    #[error("{holder} has taken over {}", lock.display())]
    Taken {
        /// The file of the lock.
        lock: PathBuf,
        /// The name of that process.
        holder: String,
    },
    /// The file of the lock was removed or emptied.
    #[error("{}, the lock that keeps others out, was removed", lock.display())]
    Removed {
        /// The file of the lock.
        lock: PathBuf,
    },
}

impl From<Lost> for io::Error {
    fn from(lost: Lost) -> Self {
        io::Error::other(lost)
    }
}

impl Lost {
    /// The loss that an error of a write stands for, if it does.
    pub fn of(error: &io::Error) -> Option<&Self> {
        error.get_ref()?.downcast_ref()
    }
}

type Look = dyn Fn() -> io::Result<()> + Send + Sync;

struct Claim {
    number: u64,
    /// The folder as an absolute path, and as it is without links.
    places: Vec<PathBuf>,
    look: Arc<Look>,
}

static CLAIMS: Mutex<Vec<Claim>> = Mutex::new(Vec::new());

fn claims() -> MutexGuard<'static, Vec<Claim>> {
    CLAIMS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A claim on a folder; given up when it is dropped.
#[derive(Debug)]
pub struct Ownership(u64);

impl Ownership {
    /// Claims the folder that a lock is in: before this process writes a file there, `look` says whether
    /// it still may.
    pub fn claim(lock: &Path, look: impl Fn() -> io::Result<()> + Send + Sync + 'static) -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        claims().push(Claim { number, places: places(folder_of(lock)), look: Arc::new(look) });
        Ownership(number)
    }
}

impl Drop for Ownership {
    fn drop(&mut self) {
        claims().retain(|claim| claim.number != self.0);
    }
}

/// Whether this process may write a file: it has not lost the lock of the file's folder, if it took
/// one.
///
/// # Errors
/// [`Lost`]; what the system says if the lock cannot be read.
pub fn check(file: &Path) -> io::Result<()> {
    if claims().is_empty() {
        return Ok(());
    }
    let places = places(folder_of(file));
    let is_there = |claim: &&Claim| claim.places.iter().any(|place| places.contains(place));
    let looks: Vec<Arc<Look>> =
        claims().iter().filter(is_there).map(|claim| Arc::clone(&claim.look)).collect();
    looks.iter().try_for_each(|look| look())
}

/// The folder that a file is in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The names of a folder under which it is found again, also when it was removed.
fn places(folder: &Path) -> Vec<PathBuf> {
    [std::path::absolute(folder), folder.canonicalize()].into_iter().flatten().collect()
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
        let lost = || Lost::Removed { lock: "own/.lock".into() };
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
