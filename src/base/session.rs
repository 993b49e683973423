//! [`Session`]: the resources of a command, made once and passed by reference.

use crate::base::error::Error;
use crate::base::observer::Observer;
use crate::base::ranks::Ranks;
use crate::base::stop::{NEVER, Stopped, check};
use crate::base::threads;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

/// The threads and processes of a command, its stop flag, its observer, and the images' folder.
pub struct Session<'a> {
    /// Number of threads; `None`: one per core. Results do not depend on it.
    pub(crate) threads: Option<usize>,
    pub(crate) ranks: Ranks,
    /// Stops the command when set, by another thread or a signal; finished work is kept.
    pub(crate) stop: &'a AtomicBool,
    /// Receives progress, warnings and findings; nothing else is ever printed.
    pub(crate) observer: &'a dyn Observer,
    /// Folder of the images, if the user names one.
    pub(crate) data: Option<PathBuf>,
    pool: OnceLock<rayon::ThreadPool>,
}

impl Default for Session<'_> {
    /// Returns a session with one thread per core, one process and no observer; it never stops.
    fn default() -> Self {
        Session::new(&NEVER, &())
    }
}

impl<'a> Session<'a> {
    /// Returns a session of this process alone, with one thread per core.
    pub fn new(stop: &'a AtomicBool, observer: &'a dyn Observer) -> Self {
        let (ranks, pool) = (Ranks::ALONE, OnceLock::new());
        Session {
            threads: None,
            ranks,
            stop,
            observer,
            data: None,
            pool,
        }
    }

    /// Returns a session with another number of threads.
    #[must_use]
    pub fn threads(self, threads: Option<usize>) -> Self {
        Session {
            threads,
            pool: OnceLock::new(),
            ..self
        }
    }

    #[must_use]
    pub(crate) fn ranks(self, ranks: Ranks) -> Self {
        Session { ranks, ..self }
    }

    /// Returns a session with the images' folder that the user names.
    #[must_use]
    pub fn data(self, data: Option<PathBuf>) -> Self {
        Session { data, ..self }
    }

    /// Returns a session like this one with another observer, and threads of its own.
    pub(crate) fn watched<'b>(&self, observer: &'b dyn Observer) -> Session<'b>
    where
        'a: 'b,
    {
        Session::new(self.stop, observer)
            .threads(self.threads)
            .ranks(self.ranks)
            .data(self.data.clone())
    }

    pub(crate) fn data_folder(&self) -> Option<&Path> {
        self.data.as_deref()
    }

    /// Returns the pool of threads, which starts at the first call.
    pub(crate) fn pool(&self) -> Result<&rayon::ThreadPool, Error> {
        if let Some(pool) = self.pool.get() {
            return Ok(pool);
        }
        let pool = threads::pool(self.threads)?;
        Ok(self.pool.get_or_init(|| pool))
    }

    pub(crate) fn check(&self) -> Result<(), Stopped> {
        check(self.stop)
    }
}
