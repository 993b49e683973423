//! Checkpoints: everything a run needs to go on, written so that one good checkpoint always survives.

use super::archive::RunFile;
use super::metrics::Totals;
use super::{Error, toml_text};
use crate::base::files::{sync_folder, write_atomically};
use crate::base::hash::sha256_hex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;

/// File names of the newest checkpoint and the one before.
pub const NAMES: [&str; 2] = ["checkpoint.json", "checkpoint.previous.json"];

/// What a run must remember besides `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// The run as `run.json` would have it.
    pub run: RunFile,
    /// Counts so far.
    pub totals: Totals,
    /// Bodies evaluated so far.
    pub known_bodies: KnownBodies,
}

/// Content keys of bodies. In files one text of 32 hexadecimal digits each, in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct KnownBodies(BTreeSet<[u8; 16]>);

impl KnownBodies {
    /// Adds a body's key; whether it is new.
    pub fn insert(&mut self, key: [u8; 16]) -> bool {
        self.0.insert(key)
    }
}

impl From<KnownBodies> for String {
    fn from(known: KnownBodies) -> String {
        known.0.iter().map(|key| crate::base::hash::hex(key)).collect()
    }
}

impl TryFrom<String> for KnownBodies {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        let number = |digits: &[u8]| {
            let digits = std::str::from_utf8(digits).ok().filter(|d| d.len() == 32)?;
            u128::from_str_radix(digits, 16).ok().map(u128::to_be_bytes)
        };
        let keys: Option<BTreeSet<_>> = text.as_bytes().chunks(32).map(number).collect();
        keys.map(KnownBodies).ok_or_else(|| "expected 32 hexadecimal digits per body".to_string())
    }
}

/// Writes a checkpoint; the one before is kept. The first line is the checksum of the second.
///
/// # Errors
/// If it cannot be written; the checkpoints before are as they were.
pub fn write(folder: &Path, checkpoint: &Checkpoint) -> Result<(), Error> {
    let [newest, previous] = NAMES.map(|name| folder.join(name));
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |error| Error::writing(&path, &error)
    };
    let text = serde_json::to_string(checkpoint).map_err(|error| Error::other(error.to_string()))?;
    let text = format!("{}\n{text}\n", sha256_hex(text.as_bytes()));
    // Only a good newest becomes the previous one: a broken one must not push the last good one out.
    if let Ok(Some(_)) = content(&newest) {
        std::fs::rename(&newest, &previous).map_err(failed(&previous))?;
        sync_folder(folder).map_err(failed(folder))?;
    }
    write_atomically(&newest, text.as_bytes()).map_err(failed(&newest))
}

/// Reads the newest good checkpoint; `None` if there never was one. A broken newest one is passed over, and said
/// with `warn`.
///
/// # Errors
/// If there are only broken ones.
pub fn read(folder: &Path, mut warn: impl FnMut(String)) -> Result<Option<Checkpoint>, Error> {
    let [newest, previous] = NAMES.map(|name| folder.join(name));
    let first = match read_one(&newest) {
        Ok(Some(checkpoint)) => return Ok(Some(checkpoint)),
        Ok(None) => None,
        Err(error) => Some(error),
    };
    match (read_one(&previous), first) {
        (Ok(Some(checkpoint)), Some(error)) => {
            warn(format!("{error}; going on from the checkpoint before"));
            Ok(Some(checkpoint))
        }
        (Ok(found), None) => Ok(found),
        (Ok(None), Some(error)) | (Err(error), _) => {
            Err(error.hint("start the run anew with --force".to_string()))
        }
    }
}

fn read_one(path: &Path) -> Result<Option<Checkpoint>, Error> {
    let Some(content) = content(path)? else { return Ok(None) };
    toml_text::read_json(&content, &path.display().to_string()).map(Some)
}

/// What a checkpoint file holds, if its checksum is right; `None` if there is no such file.
fn content(path: &Path) -> Result<Option<String>, Error> {
    let text = match std::fs::read(path) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(Error::reading(path, &error)),
    };
    let whole = text.split_once('\n').map(|(sum, content)| (sum, content.trim_end()));
    match whole.filter(|(sum, content)| sha256_hex(content.as_bytes()) == *sum) {
        Some((_, content)) => Ok(Some(content.to_string())),
        None => {
            let what = "the checkpoint is cut short or damaged: its checksum is wrong";
            Err(Error::input(format!("{}: {what}", path.display())))
        }
    }
}
