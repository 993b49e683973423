//! [`Lock`]: a file that says that a process is at work in a folder.
//!
//! Where the file system has locks, the system lets one go when its process ends, however it ends.
//! Some parallel file systems have none, and others have them on one machine only. So the file also
//! names host and process, and a heartbeat counts up in it: another process waits until it knows
//! whether the heart still beats.

use crate::base::error::Error;
use crate::base::files::read_bytes;
use crate::base::ownership::{Lost, Ownership};
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::base::threads;
use gethostname::gethostname;
use serde::{Deserialize, Serialize};
use std::fs::{File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// Time between two heartbeats. Longer: a dead process is known later; shorter: more writes to a
/// shared file system.
const BEAT: Duration = Duration::from_secs(5);

/// A heart that did not beat for so long is dead. Longer: a task that was killed elsewhere begins
/// later; shorter: a file system that hesitates looks like a death.
const DEAD_AFTER: Duration = Duration::from_secs(25);

/// A heart that did not beat for so long is dead whatever the clocks say. Longer: more dead ones are
/// watched; shorter: clocks that differ more make living ones look dead.
const LONG_DEAD: Duration = Duration::from_secs(3600);

/// How often a waiting process looks.
const LOOK: Duration = Duration::from_millis(500);

/// How often a lock is tried: another process may hold it for a moment, only to see whether it is
/// held.
const TRIES: u32 = 5;

/// Who is at work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Holder {
    /// Name of the machine.
    pub host: String,
    /// Number of the process.
    pub process: u32,
    /// Heartbeats so far, counted from the time of its beginning \[ns\]: processes in containers may
    /// have the same number on machines of the same name.
    pub beats: u64,
}

impl std::fmt::Display for Holder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "process {} on {}", self.process, self.host)
    }
}

/// What a lock file says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// Nobody is at work.
    Free,
    /// A process is at work; its name, if the file says it.
    Held(Option<Holder>),
    /// A process was at work, and ended without letting go.
    Stale(Holder),
    /// A process was at work, and its heart has been silent for too long, by the clock of this
    /// machine: its own may go behind.
    Silent(Holder),
}

/// Why a lock could not be taken.
#[derive(Debug)]
pub enum Refusal {
    /// Another process has it; its name, if the file says it.
    Held(Option<Holder>),
    /// It was told to stop while it waited.
    Stopped,
    /// The file cannot be made or written.
    Io(io::Error),
    /// There is no thread for the heartbeat.
    NoThread(Error),
}

impl From<io::Error> for Refusal {
    fn from(error: io::Error) -> Self {
        Refusal::Io(error)
    }
}

impl From<Stopped> for Refusal {
    fn from(_: Stopped) -> Self {
        Refusal::Stopped
    }
}

impl Refusal {
    /// The error for the user: `held` says what another process does, `advice` what to do.
    pub fn into_error(self, path: &Path, held: &str, advice: &str) -> Error {
        match self {
            Refusal::Held(holder) => {
                let by = holder.map_or(String::new(), |holder| format!(" ({holder})"));
                Error::occupied(format!("{held}{by}")).advice(advice)
            }
            Refusal::Stopped => Stopped.into(),
            Refusal::Io(error) => Error::writing(path, &error),
            Refusal::NoThread(error) => error,
        }
    }
}

/// How locks are taken: the system's, and how long a heart may be silent.
#[derive(Clone, Copy, Debug)]
struct LockPolicy {
    /// Whether the file system's own locks are tried.
    by_system: bool,
    /// Whether others may have taken the system's lock elsewhere at the same time.
    is_contended: bool,
    beat: Duration,
    dead_after: Duration,
}

const DEFAULT: LockPolicy =
    LockPolicy { by_system: true, is_contended: false, beat: BEAT, dead_after: DEAD_AFTER };

/// A taken lock; let go when it is dropped. As long as it is there, this process writes to the folder
/// only what it may: see [`Ownership`].
#[derive(Debug)]
pub struct Lock {
    own: Arc<Own>,
    heart: Option<JoinHandle<()>>,
    _ownership: Ownership,
    /// With the system's lock on it.
    _file: File,
}

impl Lock {
    /// Takes a lock. If the file names a process that may be alive on another machine, it says so,
    /// and waits up to 25 seconds for its next heartbeat.
    ///
    /// # Errors
    /// If another process has it; if it is stopped while it waits; what the system says.
    pub fn take(path: &Path, session: &Session) -> Result<Self, Refusal> {
        Lock::take_in(path, DEFAULT, session)
    }

    /// The same of a lock that processes on several machines want at once, as those of a cluster's
    /// job begin with the same task. A file system's locks may be known on one machine only, so it
    /// looks after half a second whether its name is still there.
    ///
    /// # Errors
    /// As [`Lock::take`].
    pub fn take_contended(path: &Path, session: &Session) -> Result<Self, Refusal> {
        Lock::take_in(path, LockPolicy { is_contended: true, ..DEFAULT }, session)
    }

    fn take_in(path: &Path, policy: LockPolicy, session: &Session) -> Result<Self, Refusal> {
        let file = File::options().create(true).truncate(false).read(true).write(true).open(path)?;
        let is_locked = lock(&file, policy)?;
        let host = gethostname().to_string_lossy().into_owned();
        if let Some(before) = read(path)? {
            // What was on this machine and has no lock any more has ended.
            let has_ended = is_locked && before.host == host;
            if !has_ended {
                let seconds = policy.dead_after.as_secs_f64().ceil();
                let text = format!("{before} was at work here: waiting up to {seconds} s for a sign of life");
                session.observer.note(&format!("{}: {text}", path.display()));
                if is_alive(path, &before, policy.dead_after, session)? {
                    return Err(Refusal::Held(read(path)?));
                }
            }
        }
        let own = Holder { host, process: std::process::id(), beats: now() };
        write(path, &own)?;
        if !is_locked || policy.is_contended {
            // Two that found it free at once: the one whose name stays has it.
            std::thread::sleep(LOOK);
            if read(path)?.as_ref() != Some(&own) {
                return Err(Refusal::Held(read(path)?));
            }
        }
        let own = Arc::new(Own::new(path, own));
        let ownership = Ownership::claim(path, {
            let own = Arc::clone(&own);
            move || own.check()
        });
        let mut lock = Lock { own: Arc::clone(&own), heart: None, _ownership: ownership, _file: file };
        let heart = threads::start("heartbeat", move || own.beat(policy.beat));
        lock.heart = Some(heart.map_err(Refusal::NoThread)?);
        Ok(lock)
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        self.own.state().is_over = true;
        self.own.wake.notify_all();
        if let Some(heart) = self.heart.take() {
            // It does nothing that can panic; if it did, the lock goes all the same.
            let _ = heart.join();
        }
        // If this cannot be written, the lock is found stale.
        if self.own.check().is_ok() {
            let _ = File::options().write(true).truncate(true).open(&self.own.path);
        }
    }
}

/// The name of this process in a lock file, and its heart.
#[derive(Debug)]
struct Own {
    path: PathBuf,
    host: String,
    /// The first of its heartbeats.
    first: u64,
    state: Mutex<Heart>,
    /// Wakes the heart at the end.
    wake: Condvar,
}

#[derive(Debug)]
struct Heart {
    beats: u64,
    is_over: bool,
}

impl Own {
    fn new(path: &Path, Holder { host, beats, .. }: Holder) -> Self {
        let state = Mutex::new(Heart { beats, is_over: false });
        Own { path: path.to_path_buf(), host, first: beats, state, wake: Condvar::new() }
    }

    fn state(&self) -> MutexGuard<'_, Heart> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the file still names this process.
    ///
    /// # Errors
    /// [`Lost`]; what the system says if it cannot be read.
    fn check(&self) -> io::Result<()> {
        self.check_at(&self.state())
    }

    /// The same; no heartbeat is written meanwhile.
    fn check_at(&self, heart: &Heart) -> io::Result<()> {
        let removed = || Lost::Removed { lock: self.path.clone() };
        let found = match read(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(removed().into()),
            found => found?.ok_or_else(removed)?,
        };
        // A beat that failed may have been written all the same.
        let is_own = (&found.host, found.process) == (&self.host, std::process::id())
            && (self.first..=heart.beats + 1).contains(&found.beats);
        match is_own {
            true => Ok(()),
            false => Err(Lost::Taken { lock: self.path.clone(), holder: found.to_string() }.into()),
        }
    }

    /// Beats until the end, as long as the file names the process.
    fn beat(&self, pause: Duration) {
        let mut heart = self.state();
        while !heart.is_over {
            let waited = self.wake.wait_timeout(heart, pause).unwrap_or_else(PoisonError::into_inner);
            heart = waited.0;
            // A heartbeat that cannot be written is tried again.
            if !heart.is_over && waited.1.timed_out() && self.check_at(&heart).is_ok() {
                let (host, process) = (self.host.clone(), std::process::id());
                let beaten = write(&self.path, &Holder { host, process, beats: heart.beats + 1 });
                heart.beats += u64::from(beaten.is_ok());
            }
        }
    }
}

/// Nanoseconds since 1970.
fn now() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or_default()
}

/// What lock files say. Hearts that are silent by the clock of this machine are watched for a little
/// longer than a heartbeat, all of them at once.
pub fn states(paths: &[PathBuf]) -> Vec<State> {
    // What cannot be read says nothing.
    let mut all: Vec<State> = paths.iter().map(|path| state(path).unwrap_or(State::Free)).collect();
    let began = Instant::now();
    while all.iter().any(|state| matches!(state, State::Silent(_))) {
        let is_over = began.elapsed() > BEAT + 2 * LOOK;
        std::thread::sleep(if is_over { Duration::ZERO } else { LOOK });
        for (path, state) in paths.iter().zip(&mut all) {
            let State::Silent(before) = state else { continue };
            match read(path) {
                Ok(None) => *state = State::Free,
                Ok(Some(now)) if now != *before => *state = State::Held(Some(now)),
                _ if is_over => *state = State::Stale(before.clone()),
                _ => {}
            }
        }
    }
    all
}

/// What a lock file says; it takes no time, and the system's lock for a moment only, to see whether
/// it is held.
///
/// # Errors
/// What the system says.
pub fn state(path: &Path) -> io::Result<State> {
    use io::ErrorKind::{NotFound, PermissionDenied, ReadOnlyFilesystem};
    let file = match File::options().read(true).write(true).open(path) {
        Err(error) if error.kind() == NotFound => return Ok(State::Free),
        // Others may look, too, and from everywhere.
        Err(error) if [PermissionDenied, ReadOnlyFilesystem].contains(&error.kind()) => File::open(path)?,
        opened => opened?,
    };
    let is_locked = match file.try_lock() {
        Ok(()) => Some(false),
        Err(TryLockError::WouldBlock) => Some(true),
        Err(TryLockError::Error(_)) => None,
    };
    let holder = read(path)?;
    if is_locked == Some(true) {
        return Ok(State::Held(holder));
    }
    let Some(holder) = holder else { return Ok(State::Free) };
    let is_here = holder.host == gethostname().to_string_lossy();
    let beaten = file.metadata()?.modified()?;
    // A clock that goes ahead on the other machine counts as no time.
    let silent = SystemTime::now().duration_since(beaten).unwrap_or_default();
    let has_ended = silent > LONG_DEAD || is_here && is_locked == Some(false);
    Ok(match () {
        () if has_ended => State::Stale(holder),
        () if silent > DEAD_AFTER + BEAT => State::Silent(holder),
        () => State::Held(Some(holder)),
    })
}

/// Takes the system's lock; whether the system has locks.
fn lock(file: &File, policy: LockPolicy) -> Result<bool, Refusal> {
    if !policy.by_system {
        return Ok(false);
    }
    for _ in 0..TRIES {
        match file.try_lock() {
            Ok(()) => return Ok(true),
            Err(TryLockError::Error(_)) => return Ok(false),
            Err(TryLockError::WouldBlock) => std::thread::sleep(LOOK / 10),
        }
    }
    let mut text = String::new();
    let mut file = file;
    file.seek(SeekFrom::Start(0))?;
    file.read_to_string(&mut text)?;
    Err(Refusal::Held(serde_json::from_str(&text).ok()))
}

/// Who is named in a lock file; what is no name, as after a power cut, is none.
fn read(path: &Path) -> io::Result<Option<Holder>> {
    Ok(serde_json::from_slice(&read_bytes(path)?).ok())
}

/// Names a holder; the text has the same length at every heartbeat, so that it is never half there.
fn write(path: &Path, holder: &Holder) -> io::Result<()> {
    let text = serde_json::to_string(holder).expect("a text and two numbers are JSON");
    let mut file = File::options().write(true).truncate(false).open(path)?;
    let room = 400.max(text.len());
    file.write_all(format!("{text:room$}\n").as_bytes())?;
    file.set_len(room as u64 + 1)
}

/// Whether a heart beats, or lets go and is taken by another, within some time.
///
/// # Errors
/// If it is stopped before it knows; what the system says.
fn is_alive(path: &Path, before: &Holder, dead_after: Duration, session: &Session) -> Result<bool, Refusal> {
    let began = Instant::now();
    while began.elapsed() < dead_after {
        session.check()?;
        match read(path)? {
            None => return Ok(false),
            Some(now) if now != *before => return Ok(true),
            Some(_) => std::thread::sleep(LOOK.min(dead_after / 10)),
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::observer::Observer;
    use crate::base::error::ErrorKind;
    use crate::base::files::write_atomically;

    use std::sync::atomic::AtomicBool;

    /// No locks of the system, and a quick heart.
    const WITHOUT: LockPolicy = LockPolicy {
        by_system: false,
        is_contended: false,
        beat: Duration::from_millis(40),
        dead_after: Duration::from_millis(400),
    };

    fn path(folder: &tempfile::TempDir) -> PathBuf {
        folder.path().join("lock")
    }

    /// A name like that of this process.
    fn own() -> Holder {
        let host = gethostname().to_string_lossy().into_owned();
        Holder { host, process: std::process::id(), beats: 0 }
    }

    fn elsewhere(path: &Path) {
        let dead = Holder { host: "another-machine".to_string(), process: 7, beats: 3 };
        std::fs::write(path, "").unwrap();
        write(path, &dead).unwrap();
    }

    #[test]
    fn a_held_lock_is_refused_with_its_holder_and_free_again_when_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        for policy in [DEFAULT, WITHOUT] {
            assert_eq!(read(&path).ok().flatten(), None);
            let lock = Lock::take_in(&path, policy, &Session::default()).unwrap();
            let Err(Refusal::Held(Some(holder))) = Lock::take_in(&path, policy, &Session::default()) else {
                panic!("{policy:?}: taken twice")
            };
            assert_eq!((holder.process, &holder.host), (std::process::id(), &lock.own.host));
            drop(lock);
            assert_eq!(state(&path).unwrap(), State::Free);
            drop(Lock::take_in(&path, policy, &Session::default()).unwrap());
        }
    }

    #[test]
    fn without_locks_a_heart_that_beats_is_respected_and_a_silent_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        elsewhere(&path);
        let began = Instant::now();
        let lock = Lock::take_in(&path, WITHOUT, &Session::default()).unwrap();
        assert!(began.elapsed() >= WITHOUT.dead_after);
        let before = read(&path).unwrap().unwrap();
        std::thread::sleep(WITHOUT.beat * 5);
        assert!(read(&path).unwrap().unwrap().beats > before.beats);
        assert!(matches!(Lock::take_in(&path, WITHOUT, &Session::default()), Err(Refusal::Held(_))));
        drop(lock);
    }

    /// Keeps what is noted, and stops at the first note.
    struct Stopping<'a>(&'a AtomicBool, Mutex<Vec<String>>);

    impl Observer for Stopping<'_> {
        fn note(&self, text: &str) {
            self.1.lock().unwrap().push(text.to_string());
            self.0.store(true, std::sync::atomic::Ordering::Relaxed);
        }
    }

    #[test]
    fn waiting_for_a_process_elsewhere_is_said_and_can_be_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        elsewhere(&path);
        let stop = AtomicBool::new(false);
        let observer = Stopping(&stop, Mutex::default());
        let session = Session::new(&stop, &observer);
        assert!(matches!(Lock::take(&path, &session), Err(Refusal::Stopped)));
        let notes = observer.1.into_inner().unwrap();
        assert!(matches!(&notes[..], [note] if note.contains("process 7 on another-machine")), "{notes:?}");
        // The name stays: nobody knows yet whether that process lives.
        assert_eq!(read(&path).unwrap().unwrap().process, 7);
    }

    #[test]
    fn with_locks_a_process_that_ended_here_is_no_reason_to_wait() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        let host = gethostname().to_string_lossy().into_owned();
        std::fs::write(&path, "").unwrap();
        write(&path, &Holder { host: host.clone(), process: 1, beats: 9 }).unwrap();
        assert!(matches!(state(&path).unwrap(), State::Stale(holder) if holder.host == host));
        let began = Instant::now();
        let _lock = Lock::take(&path, &Session::default()).unwrap();
        assert!(began.elapsed() < Duration::from_secs(5));
    }

    #[test]
    fn a_process_on_another_machine_is_held_as_long_as_its_file_is_fresh() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        elsewhere(&path);
        assert!(matches!(state(&path).unwrap(), State::Held(Some(_))));
        let long_ago = SystemTime::now() - Duration::from_secs(3601);
        File::options().write(true).open(&path).unwrap().set_modified(long_ago).unwrap();
        assert!(matches!(state(&path).unwrap(), State::Stale(_)));
    }

    #[test]
    fn a_heart_that_beats_by_a_clock_that_goes_behind_is_alive() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["alive", "dead"].map(|name| folder.path().join(name));
        let age = |path: &Path| {
            let before = SystemTime::now() - Duration::from_secs(60);
            File::options().write(true).open(path).unwrap().set_modified(before).unwrap();
        };
        for path in &paths {
            elsewhere(path);
            age(path);
            assert!(matches!(state(path).unwrap(), State::Silent(_)));
        }
        std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(LOOK);
                let name = Holder { host: "another-machine".to_string(), process: 7, beats: 4 };
                write(&paths[0], &name).unwrap();
                age(&paths[0]);
            });
            let states = states(&paths);
            assert!(matches!(&states[..], [State::Held(Some(_)), State::Stale(_)]), "{states:?}");
        });
    }

    #[test]
    fn where_the_system_s_locks_are_one_machine_s_the_name_that_stays_has_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(LOOK / 3);
                elsewhere(&path);
            });
            let Err(Refusal::Held(Some(holder))) = Lock::take_contended(&path, &Session::default()) else {
                panic!("taken by two")
            };
            assert_eq!(holder.host, "another-machine");
        });
        std::fs::write(&path, "").unwrap();
        drop(Lock::take_contended(&path, &Session::default()).unwrap());
    }

    #[test]
    fn a_process_that_lost_its_lock_writes_nothing_more_and_leaves_the_lock_to_the_other() {
        let same_name: fn(&Path) = |path| write(path, &Holder { beats: now(), ..own() }).unwrap();
        for others in [elsewhere as fn(&Path), same_name] {
            let folder = tempfile::tempdir().unwrap();
            let path = path(&folder);
            let result = folder.path().join("run.json");
            let lock = Lock::take_in(&path, WITHOUT, &Session::default()).unwrap();
            std::thread::sleep(WITHOUT.beat * 3);
            write_atomically(&result, b"ours").unwrap();
            // The heart was silent for too long, and another process began.
            others(&path);
            std::thread::sleep(WITHOUT.beat * 3);
            let before = std::fs::read(&path).unwrap();
            let error = Error::writing(&result, &write_atomically(&result, b"more").unwrap_err());
            assert_eq!((error.kind, error.kind.exit_code()), (ErrorKind::Lost, 5));
            let holder = read(&path).unwrap().unwrap().to_string();
            assert!(error.message.contains("run.json: not written") && error.message.contains(&holder));
            assert!(!error.remedies.is_empty());
            drop(lock);
            assert_eq!(std::fs::read(&path).unwrap(), before, "the other's name stays");
            assert_eq!(std::fs::read(&result).unwrap(), b"ours");
        }
    }

    #[test]
    fn a_lock_that_was_removed_or_emptied_is_lost() {
        let removed: fn(&Path) = |path| std::fs::remove_file(path).unwrap();
        let emptied: fn(&Path) = |path| std::fs::write(path, "").unwrap();
        for lose in [removed, emptied] {
            let folder = tempfile::tempdir().unwrap();
            let path = path(&folder);
            let _lock = Lock::take(&path, &Session::default()).unwrap();
            lose(&path);
            let error = write_atomically(&folder.path().join("run.json"), b"{}").unwrap_err();
            assert_eq!(Lost::of(&error), Some(&Lost::Removed { lock: path }));
        }
    }

    #[test]
    fn what_is_no_name_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        std::fs::write(&path, b"\0\0\xff").unwrap();
        let _lock = Lock::take(&path, &Session::default()).unwrap();
        assert_eq!(read(&path).unwrap().unwrap().process, std::process::id());
    }
}
