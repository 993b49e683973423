//! `morphcog data fetch`: downloads the files of a dataset and lets none in that is not the
//! published one.

use crate::base::files::{read_bytes, write_atomically};
use crate::base::hash::sha256_hex;
use crate::base::observer::{Observer, Work};
use crate::data::catalogue::{Catalogue, RemoteFile};
use crate::data::files::default_folder;
use crate::data::idx;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;
use ureq::Agent;

/// What the user may choose about a download.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FetchOptions {
    /// The folder to write to, created if need be; `data/<name>` if not given.
    pub to: Option<PathBuf>,
    /// Address of a folder with the files, used instead of the known mirrors.
    pub mirror: Option<String>,
    /// Downloads and replaces files that are already there, right or wrong.
    pub force: bool,
}

/// Why one attempt to download a file failed.
#[derive(Debug, thiserror::Error)]
pub enum AttemptError {
    /// No (good) answer: address, connection, status, time.
    #[error("{0}")]
    Http(Box<ureq::Error>),
    /// The connection broke off while reading.
    #[error("{0}")]
    Read(io::Error),
    /// More or fewer bytes than the published file has; at most one byte more is read.
    #[error("expected {expected} bytes, found {}",
        if found > expected { "more".to_string() } else { found.to_string() })]
    Size {
        /// Size of the published file.
        expected: u64,
        /// Bytes received.
        found: u64,
    },
    /// As long as the published file, but not the same.
    #[error("expected SHA-256 {expected}, found {found}")]
    Checksum {
        /// Of the published file.
        expected: String,
        /// Of what was received.
        found: String,
    },
}

/// One failed attempt.
#[derive(Debug)]
pub struct Attempt {
    /// The address tried.
    pub url: String,
    /// What went wrong.
    pub error: AttemptError,
}

/// What was tried, and what went wrong: once where that was always the same.
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

/// Why a dataset was not fetched. Files fetched before the error stay.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    /// Another file of that name is there; it is not touched, and nothing is downloaded.
    #[error(
        "{}: is there but is not the published file (expected SHA-256 {expected}, found {found}); \
         move it away, choose another folder with --to, or replace it with --force", file.display()
    )]
    Differs {
        /// The file.
        file: PathBuf,
        /// SHA-256 of the published file.
        expected: String,
        /// SHA-256 of the file that is there.
        found: String,
    },
    /// The folder or a file in it cannot be read or written.
    #[error("{}: {source}", path.display())]
    Disk {
        /// The folder or file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// No mirror had the right file.
    #[error(
        "{file} could not be downloaded; try again later, give another mirror with --mirror, or put the file into \
         {} yourself; tried: {}", folder.display(),
         tried(attempts)
    )]
    Mirrors {
        /// Name of the file.
        file: String,
        /// Where it should have gone.
        folder: PathBuf,
        /// What was tried, in order.
        attempts: Vec<Attempt>,
    },
}

/// How a file came to be there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It was there already, and right.
    Kept,
    /// It was downloaded from this address.
    Downloaded(String),
}

/// A file that is there and right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fetched {
    /// The file.
    pub file: PathBuf,
    /// How it came to be there.
    pub outcome: Outcome,
}

/// Brings all files of a dataset to disk. Each is checked against its published size and SHA-256
/// before anything is written, and then written atomically; files that are there and right, however
/// they are packed, are kept.
///
/// # Errors
/// [`FetchError`]. If any file that is there differs from the published one (and `force` is off),
/// nothing is done. No empty folder is left.
pub fn fetch(
    catalogue: &Catalogue,
    options: &FetchOptions,
    observer: &dyn Observer,
) -> Result<Vec<Fetched>, FetchError> {
    let folder = options.to.clone().unwrap_or_else(|| default_folder(&catalogue.name));
    let mirrors = options.mirror.as_ref().map_or(catalogue.mirrors.as_slice(), std::slice::from_ref);
    let mut kept = Vec::new();
    for remote in &catalogue.files {
        kept.push(if options.force { None } else { found(&folder, remote)? });
    }
    let is_new = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let made: Vec<PathBuf> = folder.ancestors().take_while(is_new).map(Path::to_path_buf).collect();
    let disk = |path: &Path, source| FetchError::Disk { path: path.to_path_buf(), source };
    std::fs::create_dir_all(&folder).map_err(|source| disk(&folder, source))?;
    let agent = agent();
    let bring = |remote: &RemoteFile| -> Result<Fetched, FetchError> {
        let (url, bytes) = from_any(&agent, mirrors, remote, observer).map_err(|attempts| {
            FetchError::Mirrors { file: remote.name.clone(), folder: folder.clone(), attempts }
        })?;
        let file = folder.join(&remote.name);
        write_atomically(&file, &bytes).map_err(|source| disk(&file, source))?;
        // An unpacked file that says something else would be as good as this one.
        let is_other = |other: &PathBuf| idx::unpacked(other).ok() != idx::unpacked(&file).ok();
        let other = unpacked(&folder, remote).filter(|other| options.force && other.exists());
        if let Some(other) = other.filter(is_other) {
            std::fs::remove_file(&other).map_err(|source| disk(&other, source))?;
        }
        Ok(Fetched { file, outcome: Outcome::Downloaded(url) })
    };
    let fetched = catalogue.files.iter().zip(kept).map(|(remote, kept)| match kept {
        Some(file) => Ok(Fetched { file, outcome: Outcome::Kept }),
        None => bring(remote),
    });
    let fetched: Result<Vec<Fetched>, FetchError> = fetched.collect();
    if fetched.is_err() {
        // Those that hold something stay.
        made.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
    fetched
}

/// The path of a file in a folder once it is unpacked.
fn unpacked(folder: &Path, remote: &RemoteFile) -> Option<PathBuf> {
    remote.name.strip_suffix(".gz").map(|name| folder.join(name))
}

/// The right file, packed or not, if it is there; another one is an error.
fn found(folder: &Path, remote: &RemoteFile) -> Result<Option<PathBuf>, FetchError> {
    let packed = folder.join(&remote.name);
    // What is in it must be known to tell others apart.
    let unpacked = unpacked(folder, remote).filter(|_| remote.content_sha256.is_some());
    let mut right = None;
    for file in [Some(packed), unpacked].into_iter().flatten() {
        let bytes = match read_bytes(&file) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            Err(source) => return Err(FetchError::Disk { path: file, source }),
        };
        let (expected, found) = (remote.sha256.clone(), sha256_hex(&bytes));
        let content = || idx::unpacked(&file).ok().map(|content| sha256_hex(&content));
        if found != expected && (remote.content_sha256.is_none() || content() != remote.content_sha256) {
            return Err(FetchError::Differs { file, expected, found });
        }
        right.get_or_insert(file);
    }
    Ok(right)
}

/// The client. Limits are for a slow line, not for patience: a mirror that is dead is given up in
/// 15 s.
fn agent() -> Agent {
    let seconds = |s| Some(Duration::from_secs(s));
    Agent::config_builder()
        // None for names: they would be resolved in a thread that the client takes for granted. The
        // system's resolver has limits of its own.
        .timeout_connect(seconds(15))
        .timeout_recv_response(seconds(30))
        .timeout_per_read(seconds(30))
        .timeout_recv_body(seconds(1800))
        // The files are gzip files; a server must not pack them once more, nor the client unpack
        // them.
        .accept_encoding("identity")
        .user_agent(concat!("morphcog/", env!("CARGO_PKG_VERSION")))
        .build()
        .new_agent()
}

/// The file from the first mirror that has it right, and its address there.
fn from_any(
    agent: &Agent,
    mirrors: &[String],
    remote: &RemoteFile,
    observer: &dyn Observer,
) -> Result<(String, Vec<u8>), Vec<Attempt>> {
    let mut attempts = Vec::new();
    for mirror in mirrors {
        let url = format!("{}/{}", mirror.trim_end_matches('/'), remote.name);
        observer.begins(&Work::new(remote.name.clone(), remote.bytes, "bytes"));
        match download(agent, &url, remote, observer) {
            Ok(bytes) => {
                if !attempts.is_empty() {
                    observer.warning(&format!("{}: {}", remote.name, tried(&attempts)));
                }
                return Ok((url, bytes));
            }
            Err(error) => attempts.push(Attempt { url, error }),
        }
    }
    Err(attempts)
}

fn download(
    agent: &Agent,
    url: &str,
    remote: &RemoteFile,
    observer: &dyn Observer,
) -> Result<Vec<u8>, AttemptError> {
    let response = agent.get(url).call().map_err(|e| AttemptError::Http(Box::new(e)))?;
    // One byte more than expected is enough to know that it is too long.
    let mut body = response.into_body().into_reader().take(remote.bytes + 1);
    let mut bytes = Vec::new();
    let mut piece = vec![0; 1 << 16];
    loop {
        match body.read(&mut piece) {
            Ok(0) => break,
            Ok(n) => bytes.extend_from_slice(&piece[..n]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(AttemptError::Read(error)),
        }
        observer.progress(bytes.len() as u64);
    }
    let found = bytes.len() as u64;
    if found != remote.bytes {
        return Err(AttemptError::Size { expected: remote.bytes, found });
    }
    let (expected, found) = (remote.sha256.clone(), sha256_hex(&bytes));
    if expected != found {
        return Err(AttemptError::Checksum { expected, found });
    }
    Ok(bytes)
}
