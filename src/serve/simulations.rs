//! [`Simulations`]: what runs at the moment, and how it is told to change.

use crate::serve::catalogue::Who;
use crate::serve::refusal::Refusal;
use crate::serve::request::{Pace, Seen};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Most simulations at once.
pub const MAX_SIMULATIONS: usize = 8;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What the locks guard is whole after every statement, even if a thread panicked.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a simulation is to do now.
#[derive(Debug, Default)]
struct Wishes {
    pace: Option<Pace>,
    paused: Option<bool>,
    seen: Option<Seen>,
}

/// The way to a simulation that runs in another thread.
pub struct Control {
    /// The robot.
    pub who: Who,
    wishes: Mutex<Wishes>,
    changed: Condvar,
    /// Whether it is to end: looked at in every substep.
    pub(crate) over: AtomicBool,
}

/// What has been asked of a simulation since it last looked.
#[derive(Debug, Default)]
pub(crate) struct News {
    pub pace: Option<Pace>,
    pub paused: Option<bool>,
    pub seen: Option<Seen>,
    pub end: bool,
}

impl Control {
    /// Asks for a change.
    pub fn change(&self, pace: Option<Pace>, paused: Option<bool>, seen: Option<Seen>) {
        let mut wishes = lock(&self.wishes);
        wishes.pace = pace.or(wishes.pace);
        wishes.paused = paused.or(wishes.paused);
        if seen.is_some() {
            wishes.seen = seen;
        }
        drop(wishes);
        self.changed.notify_all();
    }

    /// Asks it to end, at once.
    pub fn end(&self) {
        let wishes = lock(&self.wishes);
        self.over.store(true, Ordering::Relaxed);
        drop(wishes);
        self.changed.notify_all();
    }

    /// Whether it was asked to.
    pub fn is_over(&self) -> bool {
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

    /// Waits, but not if something is asked for.
    pub(crate) fn wait(&self, time: Duration) {
        let idle = |wishes: &mut Wishes| {
            wishes.pace.is_none() && wishes.paused.is_none() && wishes.seen.is_none() && !self.is_over()
        };
        drop(self.changed.wait_timeout_while(lock(&self.wishes), time, idle));
    }
}

#[derive(Default)]
struct Running {
    simulations: BTreeMap<u64, Arc<Control>>,
    begun: u64,
    closed: bool,
}

/// The simulations that run.
#[derive(Default)]
pub struct Simulations {
    running: Mutex<Running>,
}

/// A simulation's place among [`Simulations`], free again when this goes.
pub struct Slot<'a> {
    simulations: &'a Simulations,
    /// Its number.
    pub id: u64,
    /// The way to it.
    pub control: Arc<Control>,
}

impl Simulations {
    /// Takes a place.
    ///
    /// # Errors
    /// If all are taken.
    pub fn begin(&self, who: Who) -> Result<Slot<'_>, Refusal> {
        let mut running = lock(&self.running);
        if running.closed || running.simulations.len() >= MAX_SIMULATIONS {
            let text =
                format!("{MAX_SIMULATIONS} simulations are running, the most at once; close a tab or wait");
            return Err(Refusal::Busy(text));
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
        Ok(Slot { simulations: self, id, control })
    }

    /// A simulation that runs.
    ///
    /// # Errors
    /// If there is none of that number (any more).
    pub fn simulation(&self, id: u64) -> Result<Arc<Control>, Refusal> {
        let found = lock(&self.running).simulations.get(&id).cloned();
        found.ok_or_else(|| Refusal::Unknown(format!("there is no simulation {id}; perhaps it has ended")))
    }

    /// How many run.
    pub fn running(&self) -> usize {
        lock(&self.running).simulations.len()
    }

    /// How many have been begun.
    pub fn begun(&self) -> u64 {
        lock(&self.running).begun
    }

    /// Ends all, and lets none begin.
    pub fn close(&self) {
        let mut running = lock(&self.running);
        running.closed = true;
        running.simulations.values().for_each(|control| control.end());
    }
}

impl Drop for Slot<'_> {
    fn drop(&mut self) {
        lock(&self.simulations.running).simulations.remove(&self.id);
    }
}
