//! Checkpoints hold everything a run needs to continue; one valid checkpoint always survives.

use crate::base::error::Error;
use crate::base::files::{read_bytes, sync_folder, write_atomically};
use crate::base::hash::sha256_hex;
use crate::base::ownership;
use crate::config::reading;
use crate::store::metrics::Totals;
use crate::store::names::CHECKPOINTS;
use crate::store::results::Stored;
use crate::store::run::{Robot, RunFile};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;

/// The state that a run needs besides `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// The run as in `run.json`.
    pub run: RunFile,
    /// The counts so far.
    pub totals: Totals,
    /// The bodies evaluated so far.
    pub known_bodies: KnownBodies,
}

impl Checkpoint {
    /// Checks as strictly as when reading a `run.json`, because the run continues from here.
    fn validate(&self) -> Result<(), Error> {
        self.run.validate().map_err(|error| error.in_place("run"))?;
        let RunFile { config, elites, .. } = &self.run;
        let key = |robot: &Robot| config.objective().known_key(&robot.body);
        match elites
            .iter()
            .find(|robot| !self.known_bodies.0.contains(&key(robot)))
        {
            Some(robot) => Err(Error::input(format!(
                "known_bodies: expected the body of elite {} among them",
                robot.id
            ))),
            None => Ok(()),
        }
    }
}

/// The content keys of bodies; in files, 32 hexadecimal digits per key, in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct KnownBodies(BTreeSet<[u8; 16]>);

impl KnownBodies {
    /// Adds a body's key; returns true if it is new.
    pub fn insert(&mut self, key: [u8; 16]) -> bool {
        self.0.insert(key)
    }

    pub(crate) fn remove(&mut self, key: &[u8; 16]) {
        self.0.remove(key);
    }
}

impl From<KnownBodies> for String {
    fn from(known: KnownBodies) -> String {
        known
            .0
            .iter()
            .map(|key| crate::base::hash::hex(key))
            .collect()
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
        keys.map(KnownBodies)
            .ok_or_else(|| "expected 32 hexadecimal digits per body".to_string())
    }
}

/// Writes a checkpoint and keeps the previous one. The first line is the checksum of the second.
///
/// # Errors
/// Returns an error if it cannot be written; the previous one survives, perhaps under its new name.
pub fn write(folder: &Path, checkpoint: &Checkpoint) -> Result<(), Error> {
    let [newest, previous] = CHECKPOINTS.map(|name| folder.join(name));
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |error| Error::writing(&path, &error)
    };
    let text =
        serde_json::to_string(checkpoint).map_err(|error| Error::other(error.to_string()))?;
    let text = format!("{}\n{text}\n", sha256_hex(text.as_bytes()));
    // Only a valid newest checkpoint becomes the previous one: a damaged one must not replace it.
    if let Ok(Some(_)) = content(&newest) {
        ownership::check(&newest).map_err(failed(&newest))?;
        std::fs::rename(&newest, &previous).map_err(failed(&previous))?;
        sync_folder(folder).map_err(failed(folder))?;
    }
    write_atomically(&newest, text.as_bytes()).map_err(failed(&newest))
}

/// Reads the newest valid checkpoint; `None` if there never was one, an error if all are damaged.
/// It skips a damaged newest one and reports it with `warn`.
pub(crate) fn read(
    folder: &Path,
    mut warn: impl FnMut(String),
) -> Result<Option<Checkpoint>, Error> {
    let [newest, previous] = CHECKPOINTS.map(|name| folder.join(name));
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
        (Ok(None), Some(error)) | (Err(error), _) => Err(error),
    }
}

/// Replaces a damaged newest checkpoint with the previous one, which the next write would otherwise
/// discard.
pub(crate) fn take_back(folder: &Path) -> Result<(), Error> {
    let [newest, previous] = CHECKPOINTS.map(|name| folder.join(name));
    let renamed = ownership::check(&newest)
        .and_then(|()| std::fs::rename(&previous, &newest))
        .and_then(|()| sync_folder(folder));
    renamed.map_err(|error| Error::writing(&newest, &error))
}

fn read_one(path: &Path) -> Result<Option<Checkpoint>, Error> {
    let Some(content) = content(path)? else {
        return Ok(None);
    };
    let name = path.display().to_string();
    // The checksum covers the second line, which holds the text.
    let checkpoint: Checkpoint = reading::read_json(&content, &name)?;
    checkpoint
        .validate()
        .map_err(|error| error.in_place(&name))?;
    Ok(Some(checkpoint))
}

/// Returns the content of a checkpoint file if its checksum is right, or `None` without a file.
fn content(path: &Path) -> Result<Option<String>, Error> {
    let text = match read_bytes(path) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(Error::reading(path, &error)),
    };
    let whole = text
        .split_once('\n')
        .map(|(sum, content)| (sum, content.trim_end()));
    match whole.filter(|(sum, content)| sha256_hex(content.as_bytes()) == *sum) {
        Some((_, content)) => Ok(Some(content.to_string())),
        None => {
            let what = "the checkpoint is cut short or damaged: its checksum is wrong";
            Err(Error::input(format!("{}: {what}", path.display())))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body;
    use crate::store::samples;

    fn after(generations: u64) -> Checkpoint {
        let mut known_bodies = KnownBodies::default();
        (0..generations).for_each(|n| assert!(known_bodies.insert([n as u8; 16])));
        let mut run = RunFile {
            generations,
            ..samples::run(&[("a", 1.5), ("b", -0.25)])
        };
        for robot in &mut run.elites {
            robot.id = robot.genome.id();
            known_bodies.insert(body::key(&robot.body));
        }
        Checkpoint {
            run,
            totals: Totals {
                evaluations: 20 * generations,
                ..Totals::default()
            },
            known_bodies,
        }
    }

    fn read_quietly(folder: &Path) -> (Option<Checkpoint>, bool) {
        let mut warned = false;
        let found = read(folder, |text| warned = text.contains("checkpoint.json")).unwrap();
        (found, warned)
    }

    #[test]
    fn the_newest_checkpoint_is_read_and_the_one_before_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert_eq!(read_quietly(folder), (None, false));
        for generations in 1..4 {
            write(folder, &after(generations)).unwrap();
            assert_eq!(read_quietly(folder), (Some(after(generations)), false));
        }
        assert_eq!(
            read_one(&folder.join(CHECKPOINTS[1])).unwrap(),
            Some(after(2))
        );
    }

    #[test]
    fn a_broken_newest_one_is_passed_over_and_never_pushes_the_good_one_out() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(folder, &after(1)).unwrap();
        write(folder, &after(2)).unwrap();
        let newest = folder.join(CHECKPOINTS[0]);
        let whole = std::fs::read(&newest).unwrap();
        for at in [0, 63, 64, 65, whole.len() / 2, whole.len() - 3] {
            let mut broken = whole.clone();
            broken[at] ^= 0x10;
            std::fs::write(&newest, &broken).unwrap();
            assert_eq!(read_quietly(folder), (Some(after(1)), true), "byte {at}");
            std::fs::write(&newest, &whole[..at]).unwrap();
            assert_eq!(read_quietly(folder), (Some(after(1)), true), "cut at {at}");
        }
        // Two failed writes in a row.
        write(folder, &after(3)).unwrap();
        assert_eq!(
            read_one(&folder.join(CHECKPOINTS[1])).unwrap(),
            Some(after(1))
        );
        std::fs::write(&newest, b"").unwrap();
        assert_eq!(read_quietly(folder), (Some(after(1)), true));
    }

    #[test]
    fn a_checkpoint_is_checked_as_strictly_as_a_run_and_errors_name_it() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(folder, &after(1)).unwrap();
        type Spoil = fn(&mut Checkpoint);
        let spoilt: [(&str, Spoil); 6] = [
            ("voxel counts", |saved| {
                saved.run.elites[1].voxels.muscle += 1
            }),
            ("id", |saved| {
                saved.run.elites[0].id = "0123456789".to_string()
            }),
            ("cell", |saved| {
                saved.run.elites[1].cell = saved.run.elites[0].cell.clone()
            }),
            ("dimensions", |saved| {
                saved.run.dimensions.possible_cells += 1
            }),
            ("format", |saved| saved.run.format_version += 1),
            ("known_bodies", |saved| {
                saved.known_bodies = KnownBodies::default()
            }),
        ];
        for (word, spoil) in spoilt {
            let mut wrong = after(2);
            spoil(&mut wrong);
            write(folder, &wrong).unwrap();
            let error = read_one(&folder.join(CHECKPOINTS[0])).unwrap_err();
            assert!(
                error.message.contains(CHECKPOINTS[0]) && error.message.contains(word),
                "{error}"
            );
            // Continues from the previous checkpoint, which is valid.
            assert_eq!(read_quietly(folder), (Some(after(1)), true), "{word}");
            std::fs::remove_file(folder.join(CHECKPOINTS[1])).unwrap();
            write(folder, &after(1)).unwrap();
            std::fs::remove_file(folder.join(CHECKPOINTS[1])).unwrap();
        }
    }

    #[test]
    fn a_write_that_fails_leaves_a_good_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(folder, &after(1)).unwrap();
        std::fs::rename(folder.join(CHECKPOINTS[0]), folder.join(CHECKPOINTS[1])).unwrap();
        // A folder blocks the newest.
        std::fs::create_dir(folder.join(CHECKPOINTS[0])).unwrap();
        assert!(write(folder, &after(2)).is_err());
        assert_eq!(
            read_one(&folder.join(CHECKPOINTS[1])).unwrap(),
            Some(after(1))
        );
        assert_eq!(
            std::fs::read_dir(folder).unwrap().count(),
            2,
            "nothing half-written is left"
        );
    }

    #[test]
    fn two_broken_ones_are_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        CHECKPOINTS
            .iter()
            .for_each(|name| std::fs::write(folder.join(name), "x").unwrap());
        let error = read(folder, |_| ()).unwrap_err();
        assert_eq!(error.kind, crate::base::error::ErrorKind::Input);
        assert!(error.message.contains("checksum"));
    }

    #[test]
    fn known_bodies_survive_their_text_form_and_other_texts_are_refused() {
        let mut known = KnownBodies::default();
        (0..5).for_each(|n| assert!(known.insert([n; 16])));
        let text = String::from(known.clone());
        assert_eq!(text.len(), 5 * 32);
        assert_eq!(KnownBodies::try_from(text.clone()), Ok(known));
        assert_eq!(
            KnownBodies::try_from(String::new()),
            Ok(KnownBodies::default())
        );
        for wrong in [
            &text[1..],
            "g0000000000000000000000000000000",
            "\u{e9}0000000000000000000000000000000",
        ] {
            assert!(KnownBodies::try_from(wrong.to_string()).is_err(), "{wrong}");
        }
    }
}
