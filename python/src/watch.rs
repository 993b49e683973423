//! Work without Python's lock: Ctrl-C ends it, and its messages reach Python.

use crate::errors::{raised, refused};
use morphcog::base::error::Error;
use morphcog::base::observer::{Generation, Observer, Work};
use morphcog::base::session::Session;
use morphcog::cli::output::progress::{ProgressWords, Recent, count_line, generation_line};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Interval between checks for Ctrl-C.
const WATCH: Duration = Duration::from_millis(50);

/// Fails if Ctrl-C ends this work: in the main thread as Python says, in others if it is ending the
/// main thread, which would wait for them.
pub(crate) fn check_interrupt(py: Python) -> PyResult<()> {
    py.check_signals()?;
    match py
        .import("morphcog")?
        .getattr("_main_is_interrupted")?
        .call0()?
        .is_truthy()?
    {
        true => Err(PyKeyboardInterrupt::new_err(())),
        false => Ok(()),
    }
}

/// Runs `work` on its own thread, without Python's lock; Ctrl-C sets its flag.
pub(crate) fn watched<T: Send>(
    py: Python,
    work: impl FnOnce(&AtomicBool) -> T + Send,
) -> PyResult<T> {
    overheard(py, &Heard::new(false), None, work)
}

/// Listens to commands for Python.
pub(crate) struct Listener<'a, 'py> {
    /// A function of the kind of a message, its text and its fields as JSON. Work stops if it
    /// returns a true value.
    pub(crate) function: &'a Bound<'py, PyAny>,
    /// True if work waits at every generation and finding until the function has returned.
    pub(crate) waits: bool,
}

/// Runs a command, and passes its messages to a Python function.
pub(crate) fn heard<T: Send>(
    py: Python,
    listener: &Listener,
    (threads, data): (Option<usize>, Option<PathBuf>),
    work: impl FnOnce(&Session) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let heard = Heard::new(listener.waits);
    let found = overheard(py, &heard, Some(listener.function), |stop| {
        work(&Session::new(stop, &heard).threads(threads).data(data))
    })?;
    found.map_err(|error| raised(&error))
}

/// Runs `work` on its own thread; passes what `heard` collects to a Python function on this one,
/// whose errors end the work, too.
fn overheard<T: Send>(
    py: Python,
    heard: &Heard,
    listener: Option<&Bound<PyAny>>,
    work: impl FnOnce(&AtomicBool) -> T + Send,
) -> PyResult<T> {
    check_interrupt(py)?;
    let stop = AtomicBool::new(false);
    let stop = &stop;
    std::thread::scope(|scope| {
        let worker = std::thread::Builder::new().spawn_scoped(scope, move || {
            let _end = End(heard);
            work(stop)
        });
        let worker = worker.map_err(|error| refused(format!("no threads: {error}")))?;
        let mut interrupted = None;
        loop {
            let has_ended = py.detach(|| heard.wait());
            if interrupted.is_none() {
                let checked = match has_ended {
                    true => Ok(()),
                    false => check_interrupt(py),
                };
                let stops = checked.and_then(|()| match listener {
                    Some(listener) => heard.pass_on(listener),
                    None => Ok(false),
                });
                if !matches!(stops, Ok(false)) {
                    stop.store(true, Ordering::Relaxed);
                    heard.no_longer_waits();
                }
                interrupted = stops.err();
            }
            if has_ended {
                break;
            }
        }
        match (interrupted, py.detach(|| worker.join())) {
            (_, Err(_)) => Err(PyRuntimeError::new_err(
                "a bug of morphcog; what it said stands above",
            )),
            (Some(error), _) => Err(error),
            (None, Ok(found)) => Ok(found),
        }
    })
}

/// Reports the end of the work when it is dropped, even by a panic.
struct End<'a>(&'a Heard);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.said().ended = true;
        self.0.news.notify_all();
    }
}

/// Collects the messages of a command, for the calling thread to pass on.
struct Heard {
    began: Instant,
    said: Mutex<Said>,
    /// Wakes the calling thread.
    news: Condvar,
    /// Wakes the work.
    answered: Condvar,
}

/// A message: its kind, its text and its fields.
type Message = (&'static str, String, Value);

#[derive(Default)]
struct Said {
    /// Messages not passed on yet.
    messages: Vec<Message>,
    /// True if the work waits until its messages have been passed on.
    waits: bool,
    /// True if messages are being passed on.
    is_passing: bool,
    ended: bool,
    work: Option<(Work, Recent<u64>)>,
    evolution: Option<Recent<Generation>>,
}

/// Kinds of messages, as in `morphcog/_progress.py`.
const BEGINS: &str = "begins";
const PROGRESS: &str = "progress";
const GENERATION: &str = "generation";
const FINDING: &str = "finding";
const NOTE: &str = "note";
const WARNING: &str = "warning";

impl Said {
    /// Replaces the last message if it is of the same progress, else adds one.
    fn moved(&mut self, message: Message) {
        match self.messages.last_mut() {
            Some(last) if last.0 == message.0 && !self.waits => *last = message,
            _ => self.messages.push(message),
        }
    }
}

fn line(ProgressWords { label, parts }: &ProgressWords) -> String {
    format!("{label} {}", parts.join(" · "))
}

/// Describes counted work for Python.
fn counted(work: &Work, done: u64) -> Value {
    let Work {
        label, total, unit, ..
    } = work;
    json!({ "label": label, "total": total, "done": done, "unit": unit })
}

impl Heard {
    fn new(waits: bool) -> Self {
        Heard {
            began: Instant::now(),
            said: Mutex::new(Said {
                waits,
                ..Said::default()
            }),
            news: Condvar::new(),
            answered: Condvar::new(),
        }
    }

    fn said(&self) -> MutexGuard<'_, Said> {
        self.said.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// Waits until the work has ended or waits itself, or it is time to look; returns true if it
    /// has ended.
    fn wait(&self) -> bool {
        let is_quiet = |said: &mut Said| !said.ended && (!said.waits || said.messages.is_empty());
        let waited = self.news.wait_timeout_while(self.said(), WATCH, is_quiet);
        let (said, _) = waited.unwrap_or_else(PoisonError::into_inner);
        said.ended
    }

    /// Passes the messages to a Python function; returns true if it wants the work to stop.
    fn pass_on(&self, listener: &Bound<PyAny>) -> PyResult<bool> {
        let messages = {
            let mut said = self.said();
            said.is_passing = true;
            std::mem::take(&mut said.messages)
        };
        let mut stops = false;
        for (kind, text, fields) in messages {
            stops |= listener
                .call1((kind, text, fields.to_string()))?
                .is_truthy()?;
        }
        // Work that is to stop goes on waiting until its flag is set.
        self.said().is_passing = stops;
        self.answered.notify_all();
        Ok(stops)
    }

    fn no_longer_waits(&self) {
        self.said().waits = false;
        self.answered.notify_all();
    }

    /// Waits until all messages have been passed on, if the work is to wait.
    fn wait_for_answer(&self, said: MutexGuard<Said>) {
        self.news.notify_all();
        let is_unanswered =
            |said: &mut Said| said.waits && (said.is_passing || !said.messages.is_empty());
        drop(self.answered.wait_while(said, is_unanswered));
    }
}

impl Observer for Heard {
    fn note(&self, text: &str) {
        self.said()
            .messages
            .push((NOTE, text.to_string(), Value::Null));
    }

    fn begins(&self, work: &Work) {
        let recent = Recent::new(self.seconds(), work.known);
        let mut said = self.said();
        said.work = Some((work.clone(), recent));
        let fields = counted(work, work.known);
        said.messages.push((BEGINS, work.label.clone(), fields));
    }

    fn progress(&self, done: u64) {
        let mut said = self.said();
        let Some((work, recent)) = &mut said.work else {
            return;
        };
        let (seconds, before) = recent.since(self.seconds(), done, |done| *done);
        let words = count_line(&work.label, [before, done, work.total], &work.unit, seconds);
        let fields = counted(work, done);
        match said.messages.last_mut() {
            Some(last) if last.0 == PROGRESS => *last = (PROGRESS, line(&words), fields),
            _ => said.messages.push((PROGRESS, line(&words), fields)),
        }
    }

    fn generation(&self, now: &Generation) {
        let mut said = self.said();
        let recent = said
            .evolution
            .get_or_insert(Recent::new(self.seconds(), *now));
        let (seconds, before) = recent.since(self.seconds(), *now, |now| now.done);
        let words = generation_line(now, &before, seconds);
        let fields = json!(now);
        said.moved((GENERATION, line(&words), fields));
        self.wait_for_answer(said);
    }

    fn finding(&self, kind: &str, fields: &Value) {
        let mut event = json!({ "event": kind });
        if let (Value::Object(event), Value::Object(fields)) = (&mut event, fields) {
            event.extend(fields.clone());
        }
        let mut said = self.said();
        said.messages.push((FINDING, kind.to_string(), event));
        self.wait_for_answer(said);
    }

    fn warning(&self, text: &str) {
        self.said()
            .messages
            .push((WARNING, text.to_string(), Value::Null));
    }

    fn failed(&self, error: &Error, then: &str) {
        let text = match then {
            "" => error.message.clone(),
            then => format!("{}; {then}", error.message),
        };
        self.warning(&text);
    }
}
