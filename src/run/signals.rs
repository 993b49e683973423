//! Signals: the first one asks a command to finish what it is at and save.

use super::Error;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Exit code after a second SIGINT: the shell's for a process that SIGINT ended.
const AT_ONCE: i32 = 130;

/// A flag that SIGINT, SIGTERM and SIGUSR1 set; a second SIGINT ends the process at once.
///
/// # Errors
/// If the system does not let signals be handled.
pub fn stop_flag() -> Result<Arc<AtomicBool>, Error> {
    let stop = Arc::new(AtomicBool::new(false));
    let failed = |error: std::io::Error| Error::other(format!("signals cannot be handled: {error}"));
    // In this order: the first SIGINT finds its flag unset and sets it, the second one finds it set.
    let interrupted = Arc::new(AtomicBool::new(false));
    flag::register_conditional_shutdown(SIGINT, AT_ONCE, Arc::clone(&interrupted)).map_err(failed)?;
    flag::register(SIGINT, interrupted).map_err(failed)?;
    let mut signals = vec![SIGINT, SIGTERM];
    #[cfg(unix)]
    signals.push(signal_hook::consts::SIGUSR1);
    for signal in signals {
        flag::register(signal, Arc::clone(&stop)).map_err(failed)?;
    }
    Ok(stop)
}
