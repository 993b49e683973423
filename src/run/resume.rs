//! Going on with a saved run: only from its own checkpoint, under the same config, on the same images.

use super::checkpoint::{self, Checkpoint};
use super::config::{CheckpointConfig, DataConfig};
use super::folder::{RUN_JSON, RunFolder};
use super::start::Start;
use super::training::Training;
use super::{Config, Error};
use crate::task::dataset::Dataset;
use crate::task::evaluation::Savings;
use std::collections::BTreeMap;

/// The key of the archive that a run starts from.
const START: &str = "start.archive";
const ANEW: &str = "start the run anew with --force";

/// What to go on from; `None` if there is no run in the folder yet. A broken newest checkpoint is passed over, and said
/// with `warn`.
///
/// # Errors
/// If there are only broken checkpoints, or none beside a `run.json`, or the run is another one; nothing is changed.
pub(super) fn saved(
    folder: &RunFolder,
    config: &Config,
    dataset: &Dataset,
    warn: impl FnMut(String),
) -> Result<Option<Checkpoint>, Error> {
    let place = folder.path().display().to_string();
    match checkpoint::read(folder.path(), warn)? {
        Some(saved) => {
            compatible(&saved, config, dataset).map_err(|error| error.within(&place))?;
            Ok(Some(saved))
        }
        None if folder.path().join(RUN_JSON).exists() => {
            let text = format!("{place}: there is a {RUN_JSON}, but no checkpoint to go on from");
            Err(Error::input(text).hint(format!("write elsewhere with --out, or {ANEW}")))
        }
        None => Ok(None),
    }
}

/// Whether a saved run can be gone on with under a config: all that its results depend on must be the same.
fn compatible(saved: &Checkpoint, config: &Config, dataset: &Dataset) -> Result<(), Error> {
    let hint = || format!("resume with the config it was started with, or {ANEW}");
    let (theirs, ours) = (keys(&saved.run.config), keys(config));
    let is_same_start = is_same_start(saved, config, dataset)?;
    let differs = |key: &&String| theirs.get(*key) != ours.get(*key) && !(is_same_start && *key == START);
    let value = |keys: &Keys, key: &str| keys.get(key).map_or("not set".to_string(), ToString::to_string);
    if let Some(key) = theirs.keys().chain(ours.keys()).find(differs) {
        let (theirs, ours) = (value(&theirs, key), value(&ours, key));
        let text = format!("the run in this folder has another config: {key} = {theirs} there, {ours} now");
        return Err(Error::input(text).hint(hint()));
    }
    let training = Training::of(config, dataset, config.period(saved.run.generations.saturating_sub(1)))?;
    if saved.run.dataset != training.dataset || saved.run.training_images != training.images {
        let text =
            "data: the run in this folder was made with other images: the dataset has changed".to_string();
        return Err(Error::input(text).hint(hint()));
    }
    let (done, asked) = (saved.run.generations, config.generations);
    if done > asked {
        let text = format!("generations = {asked}: the run in this folder has {done} already");
        return Err(Error::input(text).hint(format!("ask for {done} or more, or {ANEW}")));
    }
    Ok(())
}

/// Whether a run started from the archive that a config names by another path: it may lie elsewhere by now, and what counts is what
/// is in it.
fn is_same_start(saved: &Checkpoint, config: &Config, dataset: &Dataset) -> Result<bool, Error> {
    match (&saved.run.start, &config.start.archive) {
        (Some(origin), Some(_)) if config.start != saved.run.config.start => {
            Ok(Start::read(config, dataset)?.is_some_and(|start| start.origin.sha256 == origin.sha256))
        }
        _ => Ok(false),
    }
}

type Keys = BTreeMap<String, toml::Value>;

/// All keys that results depend on, as `map_elites.parents`, with their values.
fn keys(config: &Config) -> Keys {
    let essence = Config {
        generations: 1,
        savings: Savings::default(),
        checkpoint: CheckpointConfig::default(),
        data: DataConfig { dir: None, ..config.data.clone() },
        ..config.clone()
    };
    let mut keys = Keys::new();
    // Every field is a number, text, list or table, which TOML has.
    toml::Value::try_from(essence).into_iter().for_each(|root| flatten("", root, &mut keys));
    keys
}

fn flatten(name: &str, value: toml::Value, keys: &mut Keys) {
    match value {
        toml::Value::Table(table) => {
            let below = |key: String| if name.is_empty() { key } else { format!("{name}.{key}") };
            table.into_iter().for_each(|(key, value)| flatten(&below(key), value, keys));
        }
        value => {
            keys.insert(name.to_string(), value);
        }
    }
}
