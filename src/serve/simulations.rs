//! [`Simulations`]: the running simulations and their controls.

use crate::serve::catalogue::Who;
use crate::serve::refusal::HttpRefusal;
use crate::serve::request::{Pace, SeenPixels};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Maximum number of simulations at once.
pub const MAX_SIMULATIONS: usize = 8;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The locks guard data that are valid after every statement, even if a thread panicked.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Debug, Default)]
struct Wishes {
    pace: Option<Pace>,
    paused: Option<bool>,
    seen: Option<SeenPixels>,
}

/// The control of a simulation in another thread.
pub(crate) struct Control {
    pub(crate) who: Who,
    wishes: Mutex<Wishes>,
    changed: Condvar,
    /// True if the simulation should end; checked in every substep.
    pub(crate) over: AtomicBool,
}

/// The changes requested since the simulation last checked.
#[derive(Debug, Default)]
pub(crate) struct News {
    pub(crate) pace: Option<Pace>,
    pub(crate) paused: Option<bool>,
    pub(crate) seen: Option<SeenPixels>,
    pub(crate) end: bool,
}

impl Control {
    pub(crate) fn change(
        &self,
        pace: Option<Pace>,
        paused: Option<bool>,
        seen: Option<SeenPixels>,
    ) {
        let mut wishes = lock(&self.wishes);
        wishes.pace = pace.or(wishes.pace);
        wishes.paused = paused.or(wishes.paused);
        if seen.is_some() {
            wishes.seen = seen;
        }
        drop(wishes);
        self.changed.notify_all();
    }

    pub(crate) fn end(&self) {
        let wishes = lock(&self.wishes);
        self.over.store(true, Ordering::Relaxed);
        drop(wishes);
        self.changed.notify_all();
    }

    pub(crate) fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }

    pub(crate) fn news(&self) -> News {
        let mut wishes = lock(&self.wishes);
        News {
            pace: wishes.pace.take(),
            paused: wishes.paused.take(),
            seen: wishes.seen.take(),
            end: self.is_over(),
        }
    }

    /// Waits for up to `time`, or until a change is requested.
    pub(crate) fn wait(&self, time: Duration) {
        let idle = |wishes: &mut Wishes| {
            wishes.pace.is_none()
                && wishes.paused.is_none()
                && wishes.seen.is_none()
                && !self.is_over()
        };
        drop(
            self.changed
                .wait_timeout_while(lock(&self.wishes), time, idle),
        );
    }
}

#[derive(Default)]
struct Running {
    simulations: BTreeMap<u64, Arc<Control>>,
    begun: u64,
    closed: bool,
}

#[derive(Default)]
pub(crate) struct Simulations {
    running: Mutex<Running>,
}

/// A slot among [`Simulations`], freed on drop.
pub(crate) struct Slot<'a> {
    simulations: &'a Simulations,
    pub(crate) id: u64,
    pub(crate) control: Arc<Control>,
}

impl Simulations {
    /// Reserves a slot.
    pub(crate) fn begin(&self, who: Who) -> Result<Slot<'_>, HttpRefusal> {
        let mut running = lock(&self.running);
        if running.closed || running.simulations.len() >= MAX_SIMULATIONS {
            let text = format!(
                "{MAX_SIMULATIONS} simulations are running, the most at once; close a tab or wait"
            );
            return Err(HttpRefusal::Busy(text));
        }
        running.begun += 1;
        let id = running.begun;
        let control = Arc::new(Control {
            who,
            wishes: Mutex::new(Wishes::default()),
            changed: Condvar::new(),
            over: AtomicBool::new(false),
        });
        running.simulations.insert(id, Arc::clone(&control));
        Ok(Slot {
            simulations: self,
            id,
            control,
        })
    }

    pub(crate) fn simulation(&self, id: u64) -> Result<Arc<Control>, HttpRefusal> {
        let found = lock(&self.running).simulations.get(&id).cloned();
        found.ok_or_else(|| {
            HttpRefusal::Unknown(format!("there is no simulation {id}; perhaps it has ended"))
        })
    }

    pub(crate) fn running(&self) -> usize {
        lock(&self.running).simulations.len()
    }

    pub(crate) fn begun(&self) -> u64 {
        lock(&self.running).begun
    }

    /// Ends all simulations and prevents new ones.
    pub(crate) fn close(&self) {
        let mut running = lock(&self.running);
        running.closed = true;
        running
            .simulations
            .values()
            .for_each(|control| control.end());
    }
}

impl Drop for Slot<'_> {
    fn drop(&mut self) {
        lock(&self.simulations.running).simulations.remove(&self.id);
    }
}
