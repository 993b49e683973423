//! Pools of threads.

use crate::base::error::Error;

/// Most threads.
pub const MOST_THREADS: u16 = 1024;

/// Whether the environment's variable for threads (rayon's) can be followed.
///
/// # Errors
/// If it asks for more than [`MOST_THREADS`].
pub fn check_environment() -> Result<(), Error> {
    const NAME: &str = "RAYON_NUM_THREADS";
    let asked = std::env::var(NAME).ok().and_then(|text| text.parse::<usize>().ok());
    match asked.filter(|threads| *threads > usize::from(MOST_THREADS)) {
        Some(threads) => Err(Error::usage(format!("{NAME} = {threads}: expected at most {MOST_THREADS}"))),
        None => Ok(()),
    }
}

/// So many threads; `None`: one per core.
///
/// # Errors
/// If the system has none left.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|error| Error::other(format!("no threads: {error}")))
}
