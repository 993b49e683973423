//! Stopping what computes for long: a flag that may be set at any time, and [`Stopped`],
//! which the work then ends with, so that what is unfinished is not taken for a result.

use std::sync::atomic::{AtomicBool, Ordering};

/// For work that is never stopped.
pub static NEVER: AtomicBool = AtomicBool::new(false);

/// The work was stopped before its end: there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stopped before the end")]
pub struct Stopped;

/// Looks whether to stop: cheap enough to do in every substep.
///
/// # Errors
/// [`Stopped`] if the flag is set.
#[inline(always)]
pub fn check(stop: &AtomicBool) -> Result<(), Stopped> {
    if stop.load(Ordering::Relaxed) { Err(Stopped) } else { Ok(()) }
}
