//! Threads and thread pools, all made here, so that running out of them is an error, not a panic.

use crate::base::error::Error;
use std::fmt::Display;
use std::sync::{PoisonError, RwLock};
use std::thread::{Builder, JoinHandle};

/// Most threads.
pub const MOST_THREADS: u16 = 1024;

/// Checks the number of threads that rayon's environment variable asks for.
pub(crate) fn check_environment() -> Result<(), Error> {
    const NAME: &str = "RAYON_NUM_THREADS";
    let asked = std::env::var(NAME)
        .ok()
        .and_then(|text| text.parse::<usize>().ok());
    match asked.filter(|threads| *threads > usize::from(MOST_THREADS)) {
        Some(threads) => Err(Error::usage(format!(
            "{NAME} = {threads}: expected at most {MOST_THREADS}"
        ))),
        None => Ok(()),
    }
}

/// Makes a pool of threads; `None` means one per core, as far as the address space has room.
///
/// # Errors
/// Returns an error if the system has no threads left.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let usual = || match room() {
        Some(room) if room < std::thread::available_parallelism().map_or(1, usize::from) => {
            room.max(1)
        }
        _ => 0,
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or_else(usual))
        .build()
        .map_err(none_left)
}

/// Runs work on the current pool, or on a new one if this thread belongs to none; on this thread
/// alone if there is no room for others.
pub(crate) fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, Error> {
    if rayon::current_thread_index().is_some() {
        return Ok(work());
    }
    let pool = match room() {
        Some(0) => rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .use_current_thread()
            .build(),
        _ => return Ok(pool(None)?.install(work)),
    };
    Ok(pool.map_err(none_left)?.install(work))
}

/// Returns the number of threads that a limit of the address space (`ulimit -v`) has room for.
fn room() -> Option<usize> {
    // The C library reserves this much for each thread that allocates. If that fails, it tries
    // again at every allocation: drawing a picture takes three times as long.
    const EACH: usize = 128 << 20;
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let limit = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: usize = limit.split_whitespace().next()?.parse().ok()?;
    // The process itself needs as much.
    Some((limit / EACH).saturating_sub(1))
}

pub(crate) fn start<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, Error> {
    Builder::new()
        .name(name.to_string())
        .spawn(work)
        .map_err(none_left)
}

/// Runs the same work on this many threads at once, to its end; nothing if they cannot start.
pub(crate) fn at_once(threads: usize, work: impl Fn() + Sync) -> Result<(), Error> {
    // Workers read it only after all of them have started.
    let all_there = RwLock::new(false);
    let worker = || {
        if *all_there.read().unwrap_or_else(PoisonError::into_inner) {
            work();
        }
    };
    std::thread::scope(|scope| {
        let mut holds = all_there.write().unwrap_or_else(PoisonError::into_inner);
        for _ in 0..threads {
            Builder::new()
                .spawn_scoped(scope, worker)
                .map_err(none_left)?;
        }
        *holds = true;
        Ok(())
    })
}

fn none_left(error: impl Display) -> Error {
    let advice = "raise the limit for processes and threads (ulimit -u, pids.max of a container) or for \
                memory, or use fewer threads";
    Error::other(format!("a thread cannot be started: {error}")).advice(advice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn work_is_done_once_on_each_of_so_many_threads() {
        let done = AtomicUsize::new(0);
        at_once(3, || _ = done.fetch_add(1, Ordering::Relaxed)).unwrap();
        assert_eq!(done.into_inner(), 3);
    }

    #[test]
    fn work_in_a_pool_stays_in_it() {
        let inner = pool(Some(3))
            .unwrap()
            .install(|| in_pool(rayon::current_num_threads));
        assert_eq!(inner.unwrap(), 3);
        assert!(in_pool(rayon::current_thread_index).unwrap().is_some());
    }
}
