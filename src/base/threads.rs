//! Pools of threads.

use crate::base::error::Error;

/// So many threads; `None`: one per core.
///
/// # Errors
/// If the system has none left.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|error| Error::other(format!("no threads: {error}")))
}
