//! The time that a thread's own work takes, whatever else the machine does.

use std::time::Duration;

/// The clock of [`thread_time`]: "processor", or "wall" if the system does not report that.
pub(crate) const CLOCK: &str = if IS_KNOWN { "processor" } else { "wall" };

#[cfg(all(
    unix,
    not(any(
        target_os = "solaris",
        target_os = "illumos",
        target_os = "netbsd",
        target_os = "redox",
        target_os = "horizon",
        target_os = "vita"
    ))
))]
mod system {
    use super::Duration;
    use rustix::time::{ClockId, clock_gettime};

    pub(crate) const IS_KNOWN: bool = true;

    pub(crate) fn now() -> Duration {
        Duration::try_from(clock_gettime(ClockId::ThreadCPUTime))
            .expect("no thread has run for less than nothing")
    }
}

#[cfg(not(all(
    unix,
    not(any(
        target_os = "solaris",
        target_os = "illumos",
        target_os = "netbsd",
        target_os = "redox",
        target_os = "horizon",
        target_os = "vita"
    ))
)))]
mod system {
    use super::Duration;
    use std::sync::LazyLock;
    use std::time::Instant;

    pub(crate) const IS_KNOWN: bool = false;

    static BEGIN: LazyLock<Instant> = LazyLock::new(Instant::now);

    pub(crate) fn now() -> Duration {
        BEGIN.elapsed()
    }
}

use system::IS_KNOWN;

/// Returns the calling thread's processor time so far, or, where the system does not report it,
/// wall-clock time since the first call. Only differences mean anything.
pub fn thread_time() -> Duration {
    system::now()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_waits_spends_no_time_and_one_that_works_does() {
        let begin = thread_time();
        std::thread::sleep(Duration::from_millis(100));
        let waited = thread_time() - begin;
        let wall = std::time::Instant::now();
        let mut sum = 0.0_f64;
        while thread_time() - begin < waited + Duration::from_millis(20) {
            sum = std::hint::black_box(sum.sqrt() + 1.0);
        }
        assert!(
            wall.elapsed() >= Duration::from_millis(19),
            "no more than what passed"
        );
        if CLOCK == "processor" {
            assert!(waited < Duration::from_millis(50), "{waited:?}");
        }
    }
}
