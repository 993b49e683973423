//! Stopping long computations: a flag that may be set at any time, and [`Stopped`], which the work
//! then returns, so that nobody takes an unfinished result for a finished one.

use std::sync::atomic::{AtomicBool, Ordering};

/// A flag for work that is never stopped.
pub static NEVER: AtomicBool = AtomicBool::new(false);

/// Work that was stopped early: there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stopped before the end")]
pub struct Stopped;

/// Checks the flag: cheap enough for every substep.
///
/// # Errors
/// Returns [`Stopped`] if the flag is set.
#[inline(always)]
pub fn check(stop: &AtomicBool) -> Result<(), Stopped> {
    if stop.load(Ordering::Relaxed) {
        Err(Stopped)
    } else {
        Ok(())
    }
}
