//! `morphcog data fetch`: downloads the files of a dataset and accepts only the published ones. A
//! program of the system, curl or wget, downloads them: it knows the user's proxies and
//! certificates, and every file is checked in any case.

use crate::base::error::{Error, is_full};
use crate::base::files::{read_bytes, write_atomically};
use crate::base::hash::sha256_hex;
use crate::base::observer::Work;
use crate::base::remedy::Remedy;
use crate::base::running::Running;
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::base::threads;
use crate::data::catalogue::{Catalogue, RemoteFile};
use crate::data::files::default_folder;
use crate::data::idx;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Longest download of one file.
const LONGEST: Duration = Duration::from_secs(1800);

/// Interval at which a download checks whether to stop.
const LOOK: Duration = Duration::from_millis(50);

/// Most bytes to read of a program's error output.
const MOST_SAID: u64 = 1 << 14;

/// A program that downloads files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// Part of macOS, of Windows and of most Linux systems.
    Curl,
    /// Part of many Linux systems.
    Wget,
}

impl Program {
    /// All programs, the preferred one first.
    pub const ALL: [Program; 2] = [Program::Curl, Program::Wget];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Program::Curl => "curl",
            Program::Wget => "wget",
        }
    }

    /// Returns true if it is on the PATH.
    pub fn is_installed(self) -> bool {
        let mut command = Command::new(self.name());
        command
            .arg("--version")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command.status().is_ok()
    }

    /// Returns the command that writes a file to its output; only a dead mirror is given up.
    fn command(self, url: &str) -> Command {
        let agent = concat!("morphcog/", env!("CARGO_PKG_VERSION"));
        let mut command = Command::new(self.name());
        match self {
            // -q comes first: a user's .curlrc may change the meaning of anything.
            Program::Curl => command
                .args([
                    "-q",
                    "--silent",
                    "--show-error",
                    "--fail",
                    "--location",
                    "--globoff",
                ])
                .args([
                    "--proto",
                    "=http,https",
                    "--proto-redir",
                    "=http,https",
                    "--max-redirs",
                    "10",
                ])
                .args([
                    "--connect-timeout",
                    "15",
                    "--speed-limit",
                    "1",
                    "--speed-time",
                    "30",
                ])
                .args(["--user-agent", agent, "--url", url]),
            // The short forms of options are the same in all programs of this name.
            Program::Wget => command.args([
                "-nv", "-O", "-", "-t", "1", "-T", "20", "-U", agent, "--", url,
            ]),
        };
        command
            .env("LC_ALL", "C")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }
}

/// A user's choices for a download.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FetchOptions {
    /// The folder to write to, created if necessary; `data/<name>` if not given.
    pub to: Option<PathBuf>,
    /// Address of a folder with the files, used instead of the known mirrors.
    pub mirror: Option<String>,
    /// True to download and replace files that exist already, right or wrong.
    pub force: bool,
}

/// The reason why one attempt to download a file failed.
#[derive(Debug, thiserror::Error)]
pub enum AttemptError {
    /// There was no (good) answer, or the connection broke off: the program's message.
    #[error("{}: {text}", program.name())]
    Failed {
        /// The program.
        program: Program,
        /// One line of its message.
        text: String,
    },
    /// The address is not a web address.
    #[error("expected an address that begins with http:// or https://")]
    Address,
    /// The file has more or fewer bytes than the published one; at most one byte more is read.
    #[error("expected {expected} bytes, found {}",
        if found > expected { "more".to_string() } else { found.to_string() })]
    Size {
        /// Size of the published file.
        expected: u64,
        /// Bytes received.
        found: u64,
    },
    /// The file has the length of the published one, but another content.
    #[error("expected SHA-256 {expected}, found {found}")]
    Checksum {
        /// Checksum of the published file.
        expected: String,
        /// Checksum of the received file.
        found: String,
    },
}

/// One failed attempt.
#[derive(Debug)]
pub struct Attempt {
    pub(crate) url: String,
    /// The error.
    pub error: AttemptError,
}

fn tried(attempts: &[Attempt]) -> String {
    let mut all: Vec<(String, Vec<&str>)> = Vec::new();
    for Attempt { url, error } in attempts {
        let error = error.to_string();
        match all.iter_mut().find(|(other, _)| *other == error) {
            Some((_, urls)) => urls.push(url),
            None => all.push((error, vec![url])),
        }
    }
    let one = |(error, urls): &(String, Vec<&str>)| format!("{}: {error}", urls.join(", "));
    all.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// The reason why a dataset was not fetched. Files fetched before the error stay.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    /// Another file of that name exists; it stays, and nothing is downloaded.
    #[error(
        "{}: is there but is not the published file (expected SHA-256 {expected}, found {found}); \
         move it away, choose another folder with --to, or replace it with --force", file.display()
    )]
    Differs {
        /// The file.
        file: PathBuf,
        /// SHA-256 of the published file.
        expected: String,
        /// SHA-256 of the existing file.
        found: String,
    },
    /// The folder or a file in it cannot be read or written.
    #[error("{}: {source}", path.display())]
    Disk {
        /// The folder or file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// No mirror had the right file.
    #[error(
        "{file} could not be downloaded; tried: {}; try again later, or put the file into {} yourself",
        tried(attempts), folder.display()
    )]
    Mirrors {
        /// Name of the file.
        file: String,
        /// Its intended folder.
        folder: PathBuf,
        /// The attempts, in order.
        attempts: Vec<Attempt>,
    },
    /// No program for downloads is installed.
    #[error(
        "neither curl nor wget, which download files, is on the PATH: install one of them, or put these files \
         into {} yourself: {}", folder.display(), urls.join(", ")
    )]
    NoProgram {
        /// The intended folder of the files.
        folder: PathBuf,
        /// Their addresses.
        urls: Vec<String>,
    },
    /// The download was stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl From<FetchError> for Error {
    fn from(error: FetchError) -> Self {
        let text = error.to_string();
        match error {
            FetchError::Disk { path, source } if is_full(&source) => Error::writing(&path, &source),
            FetchError::Mirrors { .. } => {
                let error = Error::other(text).remedy(Remedy::NameMirror);
                error.remedy(Remedy::NameData).remedy(Remedy::UseBuiltin)
            }
            FetchError::NoProgram { .. } => Error::other(text)
                .remedy(Remedy::NameData)
                .remedy(Remedy::UseBuiltin),
            FetchError::Stopped(stopped) => stopped.into(),
            FetchError::Differs { .. } | FetchError::Disk { .. } => Error::other(text),
        }
    }
}

/// The origin of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FetchOutcome {
    /// It existed already, and was right.
    Kept,
    /// It was downloaded from this address.
    Downloaded(String),
}

/// A file that exists and is right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fetched {
    pub(crate) file: PathBuf,
    /// Its origin.
    pub outcome: FetchOutcome,
}

/// Downloads all files of a dataset with the first of these programs that is installed. Each is
/// checked against its published size and SHA-256 before anything is written, and then written
/// atomically. Existing right files are kept, however they are packed.
///
/// # Errors
/// Returns a [`FetchError`]. If any existing file differs from the published one (and `force` is
/// off), nothing is done. No empty folder and no process is left behind.
pub fn fetch(
    catalogue: &Catalogue,
    options: &FetchOptions,
    programs: &[Program],
    session: &Session,
) -> Result<Vec<Fetched>, FetchError> {
    let folder = options
        .to
        .clone()
        .unwrap_or_else(|| default_folder(&catalogue.name));
    let mirrors = options
        .mirror
        .as_ref()
        .map_or(catalogue.mirrors.as_slice(), std::slice::from_ref);
    let mut kept = Vec::new();
    for remote in &catalogue.files {
        kept.push(if options.force {
            None
        } else {
            found(&folder, remote)?
        });
    }
    let missing = catalogue
        .files
        .iter()
        .zip(&kept)
        .filter(|(_, kept)| kept.is_none());
    let missing: Vec<&RemoteFile> = missing.map(|(remote, _)| remote).collect();
    let program = programs
        .iter()
        .copied()
        .find(|program| !missing.is_empty() && program.is_installed());
    if program.is_none() && !missing.is_empty() {
        let of_first = |remote: &&RemoteFile| mirrors.first().map(|mirror| address(mirror, remote));
        return Err(FetchError::NoProgram {
            folder,
            urls: missing.iter().filter_map(of_first).collect(),
        });
    }
    let is_new = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let made: Vec<PathBuf> = folder
        .ancestors()
        .take_while(is_new)
        .map(Path::to_path_buf)
        .collect();
    let disk = |path: &Path, source| FetchError::Disk {
        path: path.to_path_buf(),
        source,
    };
    std::fs::create_dir_all(&folder).map_err(|source| disk(&folder, source))?;
    let bring = |remote: &RemoteFile| -> Result<Fetched, FetchError> {
        let program = program.expect("without one, nothing is missing");
        let (url, bytes) = from_any(program, mirrors, remote, session)?.map_err(|attempts| {
            FetchError::Mirrors {
                file: remote.name.clone(),
                folder: folder.clone(),
                attempts,
            }
        })?;
        let file = folder.join(&remote.name);
        write_atomically(&file, &bytes).map_err(|source| disk(&file, source))?;
        // Remove an unpacked file with other content: it would count as much as this one.
        let is_other = |other: &PathBuf| idx::unpacked(other).ok() != idx::unpacked(&file).ok();
        let other = unpacked(&folder, remote).filter(|other| options.force && other.exists());
        if let Some(other) = other.filter(is_other) {
            std::fs::remove_file(&other).map_err(|source| disk(&other, source))?;
        }
        Ok(Fetched {
            file,
            outcome: FetchOutcome::Downloaded(url),
        })
    };
    let fetched = catalogue
        .files
        .iter()
        .zip(kept)
        .map(|(remote, kept)| match kept {
            Some(file) => Ok(Fetched {
                file,
                outcome: FetchOutcome::Kept,
            }),
            None => bring(remote),
        });
    let fetched: Result<Vec<Fetched>, FetchError> = fetched.collect();
    if fetched.is_err() {
        // Folders that are not empty stay.
        made.iter()
            .for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
    fetched
}

fn unpacked(folder: &Path, remote: &RemoteFile) -> Option<PathBuf> {
    remote
        .name
        .strip_suffix(".gz")
        .map(|name| folder.join(name))
}

/// Returns the right file, packed or not, if it exists; another one is an error.
fn found(folder: &Path, remote: &RemoteFile) -> Result<Option<PathBuf>, FetchError> {
    let packed = folder.join(&remote.name);
    // An unpacked file can only be checked if its content is known.
    let unpacked = unpacked(folder, remote).filter(|_| remote.content_sha256.is_some());
    let mut right = None;
    for file in [Some(packed), unpacked].into_iter().flatten() {
        let bytes = match read_bytes(&file) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            Err(source) => return Err(FetchError::Disk { path: file, source }),
        };
        let (expected, found) = (remote.sha256.clone(), sha256_hex(&bytes));
        let content = || {
            idx::unpacked(&file)
                .ok()
                .map(|content| sha256_hex(&content))
        };
        if found != expected
            && (remote.content_sha256.is_none() || content() != remote.content_sha256)
        {
            return Err(FetchError::Differs {
                file,
                expected,
                found,
            });
        }
        right.get_or_insert(file);
    }
    Ok(right)
}

fn address(mirror: &str, remote: &RemoteFile) -> String {
    format!("{}/{}", mirror.trim_end_matches('/'), remote.name)
}

/// An address and its content, or the failed attempts.
type Downloaded = Result<(String, Vec<u8>), Vec<Attempt>>;

fn from_any(
    program: Program,
    mirrors: &[String],
    remote: &RemoteFile,
    session: &Session,
) -> Result<Downloaded, Stopped> {
    let mut attempts = Vec::new();
    for mirror in mirrors {
        let url = address(mirror, remote);
        session
            .observer
            .begins(&Work::new(remote.name.clone(), remote.bytes, "bytes"));
        let downloaded = download(program, &url, remote, session);
        // A signal from the keyboard ends the program, too.
        session.check()?;
        match downloaded {
            Ok(bytes) => {
                if !attempts.is_empty() {
                    session
                        .observer
                        .warning(&format!("{}: {}", remote.name, tried(&attempts)));
                }
                return Ok(Ok((url, bytes)));
            }
            Err(error) => attempts.push(Attempt { url, error }),
        }
    }
    Ok(Err(attempts))
}

/// Returns the file that a program downloads. A stop ends it early with an error.
fn download(
    program: Program,
    url: &str,
    remote: &RemoteFile,
    session: &Session,
) -> Result<Vec<u8>, AttemptError> {
    let scheme = url
        .split("://")
        .next()
        .unwrap_or_default()
        .to_ascii_lowercase();
    if !["http", "https"].contains(&scheme.as_str()) {
        return Err(AttemptError::Address);
    }
    let failed = |text: String| AttemptError::Failed { program, text };
    let io = |error: io::Error| failed(error.to_string());
    let mut running = Running(program.command(url).spawn().map_err(io)?);
    let output = running.0.stdout.take().expect("piped");
    // One byte more than expected is enough to detect a file that is too long.
    let pieces =
        pieces(output.take(remote.bytes + 1)).map_err(|error| failed(error.to_string()))?;
    let mut bytes = Vec::new();
    let begin = Instant::now();
    loop {
        match pieces.recv_timeout(LOOK) {
            Ok(piece) => bytes.extend(piece.map_err(io)?),
            Err(RecvTimeoutError::Timeout) => (),
            Err(RecvTimeoutError::Disconnected) => break,
        }
        session.observer.progress(bytes.len() as u64);
        if session.check().is_err() {
            return Err(failed(Stopped.to_string()));
        }
        if begin.elapsed() > LONGEST {
            return Err(failed(format!("took longer than {} s", LONGEST.as_secs())));
        }
    }
    let (expected, found) = (remote.bytes, bytes.len() as u64);
    if found <= expected {
        let mut said = Vec::new();
        let errors = running.0.stderr.take().expect("piped");
        errors.take(MOST_SAID).read_to_end(&mut said).map_err(io)?;
        let status = running.0.wait().map_err(io)?;
        let text = last_line(program, &String::from_utf8_lossy(&said));
        match (status.success(), text) {
            (false, Some(text)) => return Err(failed(text)),
            (false, None) if found == 0 || found == expected => {
                return Err(failed(status.to_string()));
            }
            _ => (),
        }
    }
    if found != expected {
        return Err(AttemptError::Size { expected, found });
    }
    let (expected, found) = (remote.sha256.clone(), sha256_hex(&bytes));
    if expected != found {
        return Err(AttemptError::Checksum { expected, found });
    }
    Ok(bytes)
}

/// Reads a program's output piece by piece until it ends.
fn pieces(mut output: impl Read + Send + 'static) -> Result<Receiver<io::Result<Vec<u8>>>, Error> {
    let (sender, receiver) = mpsc::sync_channel(4);
    let read = move || {
        let mut piece = vec![0; 1 << 16];
        loop {
            let read = match output.read(&mut piece) {
                Ok(0) => break,
                Ok(n) => Ok(piece[..n].to_vec()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => Err(error),
            };
            let is_error = read.is_err();
            if sender.send(read).is_err() || is_error {
                break;
            }
        }
    };
    threads::start("download", read)?;
    Ok(receiver)
}

/// Returns a program's last message, without its name and an error's address and time.
fn last_line(program: Program, said: &str) -> Option<String> {
    let line = said.lines().map(str::trim).rfind(|line| !line.is_empty())?;
    let line = line
        .strip_prefix(program.name())
        .and_then(|line| line.strip_prefix(": "))
        .unwrap_or(line);
    let line = line.split_once(" ERROR ").map_or(line, |(_, error)| error);
    Some(line.trim_end_matches('.').to_string())
}
