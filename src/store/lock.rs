//! [`Lock`]: a file that marks a folder as in use by a process.
//!
//! If the file system has locks, the system releases one when its process ends, however it ends.
//! Some parallel file systems have none, and others limit them to one machine. So the file also
//! names host and process, and contains a heartbeat counter. Another process waits until it knows
//! whether the heart still beats.

use crate::base::error::Error;
use crate::base::files::read_bytes;
use crate::base::ownership::{Lost, Ownership};
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::base::threads;
use serde::{Deserialize, Serialize};
use std::fs::{File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// The time between two heartbeats. Larger values detect a dead process later; smaller ones write
/// more to a shared file system.
const BEAT: Duration = Duration::from_secs(5);

/// The silence after which a heart is dead. Larger values delay tasks that were killed elsewhere;
/// smaller ones mistake a slow file system for a death.
const DEAD_AFTER: Duration = Duration::from_secs(25);

/// The silence after which a heart is dead whatever the clocks say. Larger values watch more dead
/// processes; smaller ones mistake clock differences for deaths.
const LONG_DEAD: Duration = Duration::from_secs(3600);

/// The time between checks of a waiting process.
const LOOK: Duration = Duration::from_millis(500);

/// The number of attempts to take a lock, because another process may hold it briefly for a check.
const TRIES: u32 = 5;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Holder {
    pub(crate) host: String,
    pub(crate) process: u32,
    /// The heartbeat counter, which starts at the current time \[ns\]. Processes in containers may
    /// share numbers and machine names.
    pub(crate) beats: u64,
}

/// Returns the name of this machine; a browser has none.
fn host_name() -> String {
    #[cfg(not(target_family = "wasm"))]
    return gethostname::gethostname().to_string_lossy().into_owned();
    #[cfg(target_family = "wasm")]
    String::new()
}

impl std::fmt::Display for Holder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "process {} on {}", self.process, self.host)
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum LockState {
    Free,
    /// A process holds it, with its name if the file contains it.
    Held(Option<Holder>),
    /// A process held it, and ended without releasing it.
    Stale(Holder),
    /// A process held it, but its heart has been silent for too long by this machine's clock. The
    /// other clock may be behind.
    Silent(Holder),
}

#[derive(Debug)]
pub(crate) enum LockRefusal {
    Held(Option<Holder>),
    /// A stop signal ended the wait.
    Stopped,
    Io(io::Error),
    /// There is no thread for the heartbeat.
    NoThread(Error),
}

impl From<io::Error> for LockRefusal {
    fn from(error: io::Error) -> Self {
        LockRefusal::Io(error)
    }
}

impl From<Stopped> for LockRefusal {
    fn from(_: Stopped) -> Self {
        LockRefusal::Stopped
    }
}

impl LockRefusal {
    /// Converts to an error for the user: `held` describes the other process, `advice` the remedy.
    pub(crate) fn into_error(self, path: &Path, held: &str, advice: &str) -> Error {
        match self {
            LockRefusal::Held(holder) => {
                let by = holder.map_or(String::new(), |holder| format!(" ({holder})"));
                Error::occupied(format!("{held}{by}")).advice(advice)
            }
            LockRefusal::Stopped => Stopped.into(),
            LockRefusal::Io(error) => Error::writing(path, &error),
            LockRefusal::NoThread(error) => error,
        }
    }
}

/// The policy of taking locks: system locks, and the silence allowed.
#[derive(Clone, Copy, Debug)]
struct LockPolicy {
    /// True if the file system's own locks are used.
    by_system: bool,
    /// True if others may take the system's lock on another machine at the same time.
    is_contended: bool,
    beat: Duration,
    dead_after: Duration,
}

const DEFAULT: LockPolicy = LockPolicy {
    by_system: true,
    is_contended: false,
    beat: BEAT,
    dead_after: DEAD_AFTER,
};

/// A taken lock, released on drop. While it exists, this process writes to the folder only what it
/// may: see [`Ownership`].
#[derive(Debug)]
pub(crate) struct Lock {
    own: Arc<Own>,
    heart: Option<JoinHandle<()>>,
    _ownership: Ownership,
    /// Carries the system's lock.
    _file: File,
}

impl Lock {
    /// Takes a lock. If the file names a process that may be alive on another machine, it notes so
    /// and waits up to 25 seconds for the next heartbeat.
    pub(crate) fn take(path: &Path, session: &Session) -> Result<Self, LockRefusal> {
        Lock::take_in(path, DEFAULT, session)
    }

    /// Takes a lock that processes on several machines may want at once, as when a cluster's jobs
    /// begin with the same task. Locks of a file system may be limited to one machine, so it checks
    /// after half a second if the file still names this process.
    pub(crate) fn take_contended(path: &Path, session: &Session) -> Result<Self, LockRefusal> {
        Lock::take_in(
            path,
            LockPolicy {
                is_contended: true,
                ..DEFAULT
            },
            session,
        )
    }

    fn take_in(path: &Path, policy: LockPolicy, session: &Session) -> Result<Self, LockRefusal> {
        let file = File::options()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(path)?;
        let is_locked = lock(&file, policy)?;
        let host = host_name();
        if let Some(before) = read(path)? {
            // A process of this machine that no longer holds the system's lock has ended.
            let has_ended = is_locked && before.host == host;
            if !has_ended {
                let seconds = policy.dead_after.as_secs_f64().ceil();
                let text = format!(
                    "{before} was at work here: waiting up to {seconds} s for a sign of life"
                );
                session
                    .observer
                    .note(&format!("{}: {text}", path.display()));
                if is_alive(path, &before, policy.dead_after, session)? {
                    return Err(LockRefusal::Held(read(path)?));
                }
            }
        }
        let own = Holder {
            host,
            process: std::process::id(),
            beats: now(),
        };
        write(path, &own)?;
        if !is_locked || policy.is_contended {
            // If two processes found it free at once, the one whose name remains has it.
            std::thread::sleep(LOOK);
            if read(path)?.as_ref() != Some(&own) {
                return Err(LockRefusal::Held(read(path)?));
            }
        }
        let own = Arc::new(Own::new(path, own));
        let ownership = Ownership::claim(path, {
            let own = Arc::clone(&own);
            move || own.check()
        });
        let mut lock = Lock {
            own: Arc::clone(&own),
            heart: None,
            _ownership: ownership,
            _file: file,
        };
        let heart = threads::start("heartbeat", move || own.beat(policy.beat));
        lock.heart = Some(heart.map_err(LockRefusal::NoThread)?);
        Ok(lock)
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        self.own.state().is_over = true;
        self.own.wake.notify_all();
        if let Some(heart) = self.heart.take() {
            // The thread cannot panic; if it did, the lock is released all the same.
            let _ = heart.join();
        }
        // If this write fails, the lock is found stale.
        if self.own.check().is_ok() {
            let _ = File::options()
                .write(true)
                .truncate(true)
                .open(&self.own.path);
        }
    }
}

/// This process's name in a lock file, and its heart.
#[derive(Debug)]
struct Own {
    path: PathBuf,
    host: String,
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
        let state = Mutex::new(Heart {
            beats,
            is_over: false,
        });
        Own {
            path: path.to_path_buf(),
            host,
            first: beats,
            state,
            wake: Condvar::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, Heart> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Checks that the file still names this process; if it does not, the error is [`Lost`].
    fn check(&self) -> io::Result<()> {
        self.check_at(&self.state())
    }

    /// Does the same while no heartbeat is written.
    fn check_at(&self, heart: &Heart) -> io::Result<()> {
        let removed = || Lost::Removed {
            lock: self.path.clone(),
        };
        let found = match read(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(removed().into()),
            found => found?.ok_or_else(removed)?,
        };
        // A failed heartbeat may have been written all the same.
        let is_own = (&found.host, found.process) == (&self.host, std::process::id())
            && (self.first..=heart.beats + 1).contains(&found.beats);
        match is_own {
            true => Ok(()),
            false => Err(Lost::Taken {
                lock: self.path.clone(),
                holder: found.to_string(),
            }
            .into()),
        }
    }

    /// Beats until the end, as long as the file names this process.
    fn beat(&self, pause: Duration) {
        let mut heart = self.state();
        while !heart.is_over {
            let waited = self
                .wake
                .wait_timeout(heart, pause)
                .unwrap_or_else(PoisonError::into_inner);
            heart = waited.0;
            // The next beat retries a failed write.
            if !heart.is_over && waited.1.timed_out() && self.check_at(&heart).is_ok() {
                let (host, process) = (self.host.clone(), std::process::id());
                let beaten = write(
                    &self.path,
                    &Holder {
                        host,
                        process,
                        beats: heart.beats + 1,
                    },
                );
                heart.beats += u64::from(beaten.is_ok());
            }
        }
    }
}

/// Returns the nanoseconds since 1970.
fn now() -> u64 {
    let since = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or_default()
}

/// Returns the states of lock files. It watches hearts that are silent by this machine's clock
/// slightly longer than a heartbeat, all at once.
pub(crate) fn states(paths: &[PathBuf]) -> Vec<LockState> {
    // An unreadable file gives no information.
    let mut all: Vec<LockState> = paths
        .iter()
        .map(|path| state(path).unwrap_or(LockState::Free))
        .collect();
    let began = Instant::now();
    while all
        .iter()
        .any(|state| matches!(state, LockState::Silent(_)))
    {
        let is_over = began.elapsed() > BEAT + 2 * LOOK;
        std::thread::sleep(if is_over { Duration::ZERO } else { LOOK });
        for (path, state) in paths.iter().zip(&mut all) {
            let LockState::Silent(before) = state else {
                continue;
            };
            match read(path) {
                Ok(None) => *state = LockState::Free,
                Ok(Some(now)) if now != *before => *state = LockState::Held(Some(now)),
                _ if is_over => *state = LockState::Stale(before.clone()),
                _ => {}
            }
        }
    }
    all
}

/// Returns the state of a lock file at once. It takes the system's lock for a moment, to see if it
/// is held.
pub(crate) fn state(path: &Path) -> io::Result<LockState> {
    use io::ErrorKind::{NotFound, PermissionDenied, ReadOnlyFilesystem};
    let file = match File::options().read(true).write(true).open(path) {
        Err(error) if error.kind() == NotFound => return Ok(LockState::Free),
        // Other users may check, too, and from any machine.
        Err(error) if [PermissionDenied, ReadOnlyFilesystem].contains(&error.kind()) => {
            File::open(path)?
        }
        opened => opened?,
    };
    let is_locked = match file.try_lock() {
        Ok(()) => Some(false),
        Err(TryLockError::WouldBlock) => Some(true),
        Err(TryLockError::Error(_)) => None,
    };
    let holder = read(path)?;
    if is_locked == Some(true) {
        return Ok(LockState::Held(holder));
    }
    let Some(holder) = holder else {
        return Ok(LockState::Free);
    };
    let is_here = holder.host == host_name();
    let beaten = file.metadata()?.modified()?;
    // If the other machine's clock is ahead, no time has passed.
    let silent = SystemTime::now().duration_since(beaten).unwrap_or_default();
    let has_ended = silent > LONG_DEAD || is_here && is_locked == Some(false);
    Ok(match () {
        () if has_ended => LockState::Stale(holder),
        () if silent > DEAD_AFTER + BEAT => LockState::Silent(holder),
        () => LockState::Held(Some(holder)),
    })
}

/// Takes the system's lock; returns true if the system has locks.
fn lock(file: &File, policy: LockPolicy) -> Result<bool, LockRefusal> {
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
    Err(LockRefusal::Held(serde_json::from_str(&text).ok()))
}

/// Reads the holder in a lock file; invalid text, as after a power cut, gives `None`.
fn read(path: &Path) -> io::Result<Option<Holder>> {
    Ok(serde_json::from_slice(&read_bytes(path)?).ok())
}

/// Writes the holder. The text always has the same length, so that readers never see a part.
fn write(path: &Path, holder: &Holder) -> io::Result<()> {
    let text = serde_json::to_string(holder).expect("a text and two numbers are JSON");
    let mut file = File::options().write(true).truncate(false).open(path)?;
    let room = 400.max(text.len());
    file.write_all(format!("{text:room$}\n").as_bytes())?;
    file.set_len(room as u64 + 1)
}

/// Returns true if a heart beats, or another process takes the lock, within some time.
fn is_alive(
    path: &Path,
    before: &Holder,
    dead_after: Duration,
    session: &Session,
) -> Result<bool, LockRefusal> {
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
    use crate::base::error::ErrorKind;
    use crate::base::files::write_atomically;
    use crate::base::observer::Observer;

    use std::sync::atomic::AtomicBool;

    /// No system locks, and a fast heart.
    const WITHOUT: LockPolicy = LockPolicy {
        by_system: false,
        is_contended: false,
        beat: Duration::from_millis(40),
        dead_after: Duration::from_millis(400),
    };

    fn path(folder: &tempfile::TempDir) -> PathBuf {
        folder.path().join("lock")
    }

    fn own() -> Holder {
        let host = host_name();
        Holder {
            host,
            process: std::process::id(),
            beats: 0,
        }
    }

    fn elsewhere(path: &Path) {
        let dead = Holder {
            host: "another-machine".to_string(),
            process: 7,
            beats: 3,
        };
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
            let Err(LockRefusal::Held(Some(holder))) =
                Lock::take_in(&path, policy, &Session::default())
            else {
                panic!("{policy:?}: taken twice")
            };
            assert_eq!(
                (holder.process, &holder.host),
                (std::process::id(), &lock.own.host)
            );
            drop(lock);
            assert_eq!(state(&path).unwrap(), LockState::Free);
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
        assert!(matches!(
            Lock::take_in(&path, WITHOUT, &Session::default()),
            Err(LockRefusal::Held(_))
        ));
        drop(lock);
    }

    /// Keeps the notes, and stops at the first.
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
        assert!(matches!(
            Lock::take(&path, &session),
            Err(LockRefusal::Stopped)
        ));
        let notes = observer.1.into_inner().unwrap();
        assert!(
            matches!(&notes[..], [note] if note.contains("process 7 on another-machine")),
            "{notes:?}"
        );
        // The name stays: nobody knows yet if that process lives.
        assert_eq!(read(&path).unwrap().unwrap().process, 7);
    }

    #[test]
    fn with_locks_a_process_that_ended_here_is_no_reason_to_wait() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        let host = host_name();
        std::fs::write(&path, "").unwrap();
        write(
            &path,
            &Holder {
                host: host.clone(),
                process: 1,
                beats: 9,
            },
        )
        .unwrap();
        assert!(matches!(state(&path).unwrap(), LockState::Stale(holder) if holder.host == host));
        let began = Instant::now();
        let _lock = Lock::take(&path, &Session::default()).unwrap();
        assert!(began.elapsed() < Duration::from_secs(5));
    }

    #[test]
    fn a_process_on_another_machine_is_held_as_long_as_its_file_is_fresh() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(&folder);
        elsewhere(&path);
        assert!(matches!(state(&path).unwrap(), LockState::Held(Some(_))));
        let long_ago = SystemTime::now() - Duration::from_secs(3601);
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_modified(long_ago)
            .unwrap();
        assert!(matches!(state(&path).unwrap(), LockState::Stale(_)));
    }

    #[test]
    fn a_heart_that_beats_by_a_clock_that_goes_behind_is_alive() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["alive", "dead"].map(|name| folder.path().join(name));
        let age = |path: &Path| {
            let before = SystemTime::now() - Duration::from_secs(60);
            File::options()
                .write(true)
                .open(path)
                .unwrap()
                .set_modified(before)
                .unwrap();
        };
        for path in &paths {
            elsewhere(path);
            age(path);
            assert!(matches!(state(path).unwrap(), LockState::Silent(_)));
        }
        std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(LOOK);
                let name = Holder {
                    host: "another-machine".to_string(),
                    process: 7,
                    beats: 4,
                };
                write(&paths[0], &name).unwrap();
                age(&paths[0]);
            });
            let states = states(&paths);
            assert!(
                matches!(&states[..], [LockState::Held(Some(_)), LockState::Stale(_)]),
                "{states:?}"
            );
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
            let Err(LockRefusal::Held(Some(holder))) =
                Lock::take_contended(&path, &Session::default())
            else {
                panic!("taken by two")
            };
            assert_eq!(holder.host, "another-machine");
        });
        std::fs::write(&path, "").unwrap();
        drop(Lock::take_contended(&path, &Session::default()).unwrap());
    }

    #[test]
    fn a_process_that_lost_its_lock_writes_nothing_more_and_leaves_the_lock_to_the_other() {
        let same_name: fn(&Path) = |path| {
            write(
                path,
                &Holder {
                    beats: now(),
                    ..own()
                },
            )
            .unwrap()
        };
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
            assert!(
                error.message.contains("run.json: not written") && error.message.contains(&holder)
            );
            assert!(!error.remedies.is_empty());
            drop(lock);
            assert_eq!(
                std::fs::read(&path).unwrap(),
                before,
                "the other's name stays"
            );
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
