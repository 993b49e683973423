//! Writing files so that none is ever half-written, and reading texts of limited size.

use crate::base::ownership::{self, folder_of};
use std::ffi::{OsStr, OsString};
use std::fs::{DirEntry, File, Metadata, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Prefix and suffix of the names of temporary files, around the name of the file to be written.
const TEMPORARY: [&str; 2] = [".", ".tmp"];

/// Age from which a temporary file is sure to be locked if its writer is alive.
const TO_LOCK: Duration = Duration::from_secs(10);

/// Most bytes of a text; far above the size of any file of ours.
const MOST_TEXT: u64 = 256 << 20;

/// Opens a file of a run or a dataset. Refuses a pipe, a socket or a device at once: anybody can
/// put one there, and it could block for ever. (A folder fails when read.)
pub(crate) fn open_file(path: &Path) -> io::Result<File> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        use std::os::unix::fs::OpenOptionsExt;
        // Otherwise opening a pipe waits for its other end.
        let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
        options.custom_flags(flags.bits().cast_signed());
    }
    let file = options.open(path)?;
    // The open file is checked, so that nothing can replace it in between.
    regular(&file.metadata()?)?;
    Ok(file)
}

fn regular(found: &Metadata) -> io::Result<()> {
    match found.is_file() || found.is_dir() {
        true => Ok(()),
        false => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "expected a regular file, found a pipe, a socket or a device",
        )),
    }
}

/// Checks that [`open_file`] would open a file, or that there is none. Call it before writing:
/// opening a pipe to write could block for ever, too.
pub(crate) fn check_file(path: &Path) -> io::Result<()> {
    std::fs::metadata(path).map_or(Ok(()), |found| regular(&found))
}

pub(crate) fn read_bytes(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_file(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    read_limited(open_file(path)?)
}

/// Reads a text that the user named. It may come through a pipe, as from `<(…)` of a shell. An
/// endless source, such as a device, is refused before it fills the memory.
pub(crate) fn read_given(path: &Path) -> io::Result<String> {
    match std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        true => read_limited(File::open(path)?),
        false => read_text(path),
    }
}

/// Reads a text of up to 256 MB: UTF-8, or UTF-16 with a byte order mark (as PowerShell's `>`).
pub(crate) fn read_limited(source: impl Read) -> io::Result<String> {
    let mut bytes = Vec::new();
    let read = source.take(MOST_TEXT + 1).read_to_end(&mut bytes)?;
    if read as u64 > MOST_TEXT {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            "expected at most 256 MB of text",
        ));
    }
    let text = match bytes.as_slice() {
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ => String::from_utf8(bytes).ok(),
    };
    text.ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, "expected text in UTF-8"))
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let text: Option<String> = char::decode_utf16(pairs.iter().copied().map(unit))
        .map(Result::ok)
        .collect();
    text.filter(|_| rest.is_empty())
}

/// Replaces a leading `~` by the user's home folder; in files and `--option=~/…` no shell does.
pub(crate) fn home_expanded(path: &Path) -> PathBuf {
    match (path.strip_prefix("~"), std::env::home_dir()) {
        (Ok(below), Some(home)) if !home.as_os_str().is_empty() => home.join(below),
        _ => path.to_path_buf(),
    }
}

/// Writes a file as a whole or not at all: to a temporary name in the same folder, synced, then
/// renamed. A symbolic link stays and its target is written. Anything but a regular file
/// (`/dev/stdout`, a pipe) is written to directly. Removes leftovers of killed writers.
pub(crate) fn write_atomically(path: &Path, content: &[u8]) -> io::Result<()> {
    write_whole(path, |file| file.write_all(content))
}

/// Acts as [`write_atomically`], but `write` writes the content, which need not be in memory.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> io::Result<()> {
    // A rename would replace a device or a link by an ordinary file.
    if std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return write(&mut File::options().write(true).open(path)?);
    }
    ownership::check(path)?;
    let asked = path;
    let path = &led_to(asked);
    let folder = folder_of(path);
    let mut file = temporary(path)?;
    // The lock tells others that the writer lives, if the file system has locks.
    let _ = file.as_file().try_lock();
    write(file.as_file_mut())?;
    file.as_file().sync_all()?;
    // The lock may have been lost while a long file was written.
    ownership::check(asked)?;
    file.persist(path).map_err(|error| error.error)?;
    remove_left_behind(path);
    sync_folder(folder)
}

fn temporary(path: &Path) -> io::Result<tempfile::NamedTempFile<File>> {
    let mut prefix = OsString::from(TEMPORARY[0]);
    prefix.extend([inner_name(path), OsStr::new(".")]);
    // Opened here for two reasons: it gets the permissions of any new file, not a temporary file's
    // owner-only ones; and the system's error does not name a file that the user never mentioned.
    let open = |name: &Path| File::options().write(true).create_new(true).open(name);
    tempfile::Builder::new()
        .prefix(&prefix)
        .suffix(TEMPORARY[1])
        .make_in(folder_of(path), open)
}

/// Returns the part of a file's name used in temporary names: names have at most 255 bytes.
fn inner_name(path: &Path) -> &OsStr {
    path.file_name()
        .filter(|name| name.len() <= 200)
        .unwrap_or_default()
}

fn temporary_of(name: &str) -> Option<&str> {
    let [begin, end] = TEMPORARY;
    let inner = name.strip_prefix(begin)?.strip_suffix(end)?;
    inner.rsplit_once('.').map(|(name, _)| name)
}

/// Removes temporary files of killed writers. Ignores failures: the file itself is written.
fn remove_left_behind(path: &Path) {
    let own = inner_name(path).to_string_lossy();
    let Ok(entries) = std::fs::read_dir(folder_of(path)) else {
        return;
    };
    for entry in entries.flatten() {
        let is_own =
            temporary_of(&entry.file_name().to_string_lossy()).is_some_and(|name| name == own);
        if is_own && is_left_behind(&entry).unwrap_or(false) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// True if a temporary file's writer has ended: a live one holds its lock, unless it is quite new.
fn is_left_behind(entry: &DirEntry) -> io::Result<bool> {
    let found = entry.metadata()?;
    let age = SystemTime::now()
        .duration_since(found.modified()?)
        .unwrap_or_default();
    // Only files can be leftovers, and network file systems lock only files open for writing.
    let opened = || File::options().write(true).open(entry.path());
    Ok(found.is_file() && age > TO_LOCK && opened()?.try_lock().is_ok())
}

/// Returns the target of a path, even if it is a symbolic link to a file that does not exist yet.
fn led_to(path: &Path) -> PathBuf {
    let beside = |link: PathBuf| path.with_file_name(link);
    path.canonicalize()
        .or_else(|_| path.read_link().map(beside))
        .unwrap_or_else(|_| path.to_path_buf())
}

/// Checks that [`write_atomically`] could write here; leaves nothing behind.
pub(crate) fn check_writable(path: &Path) -> io::Result<()> {
    match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        Ok(found) if !found.is_file() => Ok(()),
        _ => temporary(&led_to(path)).map(|_| ()),
    }
}

/// Removes temporary files of these names in a folder. Only their sole writer may call this.
pub(crate) fn remove_half_written(folder: &Path, names: &[&str]) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if temporary_of(&entry.file_name().to_string_lossy())
            .is_some_and(|name| names.contains(&name))
        {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Runs `work` while no other process runs such work in the folder of a file, so that of two which
/// read a file, add to it and write it, neither loses what the other adds. Where a folder cannot be
/// locked (Windows, NFS), and if others hold it for seconds, `work` runs all the same.
pub(crate) fn alone_beside<T>(file: &Path, work: impl FnOnce() -> T) -> T {
    const TRY: Duration = Duration::from_millis(5);
    const TRIES: u32 = 600;
    let folder = File::open(folder_of(file)).ok();
    for _ in 0..TRIES {
        match folder.as_ref().map(File::try_lock) {
            Some(Err(TryLockError::WouldBlock)) => std::thread::sleep(TRY),
            _ => break,
        }
    }
    let done = work();
    drop(folder);
    done
}

/// Makes a rename in a folder durable. (Only Unix can sync a folder.)
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) {
        File::open(folder)?.sync_all()
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_as_a_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.json");
        write_atomically(&path, b"first").unwrap();
        write_atomically(&path, b"second").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_failed_write_leaves_the_file_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        // A folder of that name is in the way.
        let path = folder.path().join("taken");
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join("content"), b"kept").unwrap();
        assert!(write_atomically(&path, b"new").is_err());
        assert_eq!(std::fs::read(path.join("content")).unwrap(), b"kept");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn no_error_names_a_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let nowhere = folder.path().join("none").join("eval.json");
        let file = folder.path().join("file");
        std::fs::write(&file, b"").unwrap();
        for path in [nowhere, file.join("eval.json")] {
            for error in [
                write_atomically(&path, b"{}").unwrap_err(),
                check_writable(&path).unwrap_err(),
            ] {
                let text = error.to_string();
                assert!(
                    !text.contains("tmp") && !text.contains("none") && !text.contains("path"),
                    "{text}"
                );
                assert!(
                    error.raw_os_error().is_some(),
                    "what the system says: {text}"
                );
            }
        }
    }

    #[test]
    fn what_cannot_be_written_is_known_before_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("eval.json");
        check_writable(&path).unwrap();
        assert!(check_writable(folder.path()).is_err());
        assert!(check_writable(&folder.path().join("no/eval.json")).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        write_atomically(&path, b"{}").unwrap();
        check_writable(&path).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"{}");
    }

    #[cfg(unix)]
    #[test]
    fn through_a_link_the_file_it_leads_to_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let [real, link] = ["real.json", "link.json"].map(|name| folder.path().join(name));
        std::fs::write(&real, b"old").unwrap();
        std::os::unix::fs::symlink("real.json", &link).unwrap();
        write_atomically(&link, b"new").unwrap();
        assert_eq!(std::fs::read(&real).unwrap(), b"new");
        assert!(link.symlink_metadata().unwrap().is_symlink());
        // Also if the target does not exist yet.
        std::fs::create_dir(folder.path().join("scratch")).unwrap();
        let link = folder.path().join("later.json");
        std::os::unix::fs::symlink("scratch/later.json", &link).unwrap();
        write_atomically(&link, b"later").unwrap();
        assert_eq!(
            std::fs::read(folder.path().join("scratch/later.json")).unwrap(),
            b"later"
        );
        assert!(link.symlink_metadata().unwrap().is_symlink());
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_written_to_and_stays_a_pipe() {
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::read(pipe).unwrap()
        });
        write_atomically(&pipe, b"content").unwrap();
        assert_eq!(reader.join().unwrap(), b"content");
        assert!(pipe.metadata().unwrap().file_type().is_fifo());
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_or_a_device_is_no_file_of_a_run_and_is_refused_without_waiting_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("run.json");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        let link = folder.path().join("link.json");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for path in [&pipe, &link] {
            for error in [open_file(path).unwrap_err(), read_text(path).unwrap_err()] {
                assert!(error.to_string().contains("regular file"), "{error}");
            }
        }
        // A folder gives the system's error; a link to a file opens that file.
        assert_eq!(
            read_text(folder.path()).unwrap_err().kind(),
            io::ErrorKind::IsADirectory
        );
        std::fs::write(folder.path().join("file"), "text").unwrap();
        std::fs::remove_file(&link).unwrap();
        std::os::unix::fs::symlink("file", &link).unwrap();
        assert_eq!(
            (read_text(&link).unwrap(), read_bytes(&link).unwrap()),
            ("text".into(), b"text".into())
        );
    }

    #[cfg(unix)]
    #[test]
    fn what_the_user_names_may_come_through_a_pipe() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("config.toml");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        let writer = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::write(pipe, "seed = 1").unwrap()
        });
        assert_eq!(read_given(&pipe).unwrap(), "seed = 1");
        writer.join().unwrap();
    }

    #[test]
    fn what_a_killed_process_left_of_a_file_goes_when_it_is_written_and_what_is_being_written_stays()
     {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("audit.json");
        let long_ago = SystemTime::now() - Duration::from_secs(3600);
        let made = |name: &str, is_old: bool| {
            let file = File::create(folder.path().join(name)).unwrap();
            if is_old {
                file.set_modified(long_ago).unwrap();
            }
            file
        };
        drop(made(".audit.json.dead.tmp", true));
        let alive = made(".audit.json.alive.tmp", true);
        alive.lock().unwrap();
        let others = [
            ".audit.json.fresh.tmp",
            ".audit.csv.Xy1.tmp",
            "audit.json.tmp",
            ".audit.json",
        ];
        others
            .iter()
            .for_each(|name| drop(made(name, name.contains("csv"))));
        write_atomically(&path, b"{}").unwrap();
        let is_there = |name: &str| folder.path().join(name).exists();
        assert!(!is_there(".audit.json.dead.tmp"));
        assert!(is_there(".audit.json.alive.tmp") && others.iter().all(|name| is_there(name)));
        drop(alive);
        write_atomically(&path, b"{}").unwrap();
        assert!(!is_there(".audit.json.alive.tmp"));
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            1 + others.len()
        );
    }

    #[test]
    fn only_half_written_files_of_these_names_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let kept = [
            "run.json",
            ".lock",
            ".eval.json.Ab1.tmp",
            ".hidden",
            "run.json.tmp",
            ".run.json",
            ".tmp",
        ];
        for name in kept
            .iter()
            .chain(&[".run.json.Xy2zz.tmp", ".elites.csv.q.tmp"])
        {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        remove_half_written(folder.path(), &["run.json", "elites.csv"]).unwrap();
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, kept.len());
        assert!(kept.iter().all(|name| folder.path().join(name).exists()));
    }
}
