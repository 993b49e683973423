//! Signals: the first one makes a command that has something to save stop and save. If there is
//! nothing to save, or after that, a signal ends the process as usual.

use crate::base::error::Error;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{SigId, flag, low_level};
use std::ops::Deref;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Exit code after a second SIGINT: a shell's code for a process that SIGINT ended.
const AT_ONCE: i32 = 130;

/// True if no flag watches signals; they then end the process.
static UNUSED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// A flag that SIGINT, SIGTERM, SIGUSR1 and SIGHUP set while it exists.
#[derive(Debug)]
pub(crate) struct StopFlag {
    stop: Arc<AtomicBool>,
    /// The signal that set it last.
    signal: Arc<AtomicUsize>,
    /// What was registered for it.
    actions: Vec<SigId>,
    /// True if no other flag watched signals before.
    were_unused: bool,
}

impl StopFlag {
    /// Ends the process by the signal that set the flag, as usual; does nothing if none did.
    pub(crate) fn end_process(self) {
        let signal = self.signal.load(Ordering::Relaxed);
        drop(self);
        if let Some(signal) = i32::try_from(signal).ok().filter(|signal| *signal > 0) {
            // A flag for it was registered a moment ago, so it can be raised.
            let _ = low_level::raise(signal);
        }
    }
}

impl Deref for StopFlag {
    type Target = AtomicBool;
    fn deref(&self) -> &AtomicBool {
        &self.stop
    }
}

impl Drop for StopFlag {
    fn drop(&mut self) {
        if let Some(unused) = UNUSED.get() {
            unused.store(self.were_unused, Ordering::Relaxed);
        }
        // A signal that this flag has seen must not count as the first of two for a later flag.
        for action in self.actions.drain(..) {
            low_level::unregister(action);
        }
    }
}

/// Makes writing beyond the file size limit an error instead of the end of the process.
pub(crate) fn heed_file_limit() {
    // If it cannot be handled, it ends the process as usual.
    #[cfg(unix)]
    let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

/// Returns a flag that SIGINT, SIGTERM, SIGUSR1 and SIGHUP set; a second SIGINT ends the process at
/// once. After the flag is dropped, signals end the process again. An ignored SIGHUP stays ignored,
/// so `nohup` keeps a process alive.
pub(crate) fn stop_flag() -> Result<StopFlag, Error> {
    let failed =
        |error: std::io::Error| Error::other(format!("signals cannot be handled: {error}"));
    let signals = stopping();
    let unused = match UNUSED.get() {
        Some(unused) => unused,
        None => {
            let unused = UNUSED.get_or_init(|| Arc::new(AtomicBool::new(true)));
            for &signal in &signals {
                flag::register_conditional_default(signal, Arc::clone(unused)).map_err(failed)?;
            }
            unused
        }
    };
    let stop = Arc::new(AtomicBool::new(false));
    // In this order: the first SIGINT finds its flag unset and sets it, the second finds it set.
    let interrupted = Arc::new(AtomicBool::new(false));
    let mut actions = vec![
        flag::register_conditional_shutdown(SIGINT, AT_ONCE, Arc::clone(&interrupted))
            .map_err(failed)?,
        flag::register(SIGINT, interrupted).map_err(failed)?,
    ];
    let by = Arc::new(AtomicUsize::new(0));
    for signal in signals {
        let number = usize::try_from(signal).expect("signals are positive");
        actions.push(flag::register_usize(signal, Arc::clone(&by), number).map_err(failed)?);
        actions.push(flag::register(signal, Arc::clone(&stop)).map_err(failed)?);
    }
    let were_unused = unused.swap(false, Ordering::Relaxed);
    Ok(StopFlag {
        stop,
        signal: by,
        actions,
        were_unused,
    })
}

fn stopping() -> Vec<i32> {
    let mut signals = vec![SIGINT, SIGTERM];
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGHUP, SIGUSR1};
        signals.push(SIGUSR1);
        signals.extend(is_heeded(SIGHUP).then_some(SIGHUP));
    }
    signals
}

/// Returns true if a signal is known not to be ignored; only Linux reports that.
#[cfg(unix)]
fn is_heeded(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask >> (signal - 1) & 1 == 0)
}
