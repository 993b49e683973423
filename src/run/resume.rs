//! Going on with a saved run: only from its own checkpoint, under the same config so far, on the same images. Stages that have not
//! begun may be others: no result depends on them yet.

use super::checkpoint::{self, Checkpoint};
use super::curriculum::StageConfig;
use super::folder::{RUN_JSON, RunFolder};
use super::start::Start;
use super::training::Training;
use super::{Config, Error};
use crate::task::dataset::Dataset;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

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
    stop: &AtomicBool,
    mut warn: impl FnMut(String),
) -> Result<Option<Checkpoint>, Error> {
    let place = folder.path().display().to_string();
    let mut is_newest_broken = false;
    let tell = |text| {
        is_newest_broken = true;
        warn(text);
    };
    match checkpoint::read(folder.path(), tell)? {
        Some(saved) => {
            compatible(&saved, config, dataset, stop).map_err(|error| error.within(&place))?;
            if is_newest_broken {
                checkpoint::take_back(folder.path())?;
            }
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
fn compatible(
    saved: &Checkpoint,
    config: &Config,
    dataset: &Dataset,
    stop: &AtomicBool,
) -> Result<(), Error> {
    let hint = || format!("resume with the config it was started with, or {ANEW}");
    let (theirs, ours) = (&saved.run.program_version, env!("CARGO_PKG_VERSION"));
    if theirs != ours {
        let text = format!(
            "the run in this folder was made by morphcog {theirs}; this is {ours}, whose numbers may be others"
        );
        return Err(Error::input(text).hint(format!("go on with morphcog {theirs}, or {ANEW}")));
    }
    let last = saved.run.generations.saturating_sub(1);
    let begun = saved.run.config.period(last).stage + 1;
    let (theirs, ours) = (keys(&saved.run.config, begun), keys(config, begun));
    let is_same_start = is_same_start(saved, config, dataset)?;
    let differs = |key: &&String| theirs.get(*key) != ours.get(*key) && !(is_same_start && *key == START);
    let value = |keys: &Keys, key: &str| keys.get(key).map_or("not set".to_string(), ToString::to_string);
    if let Some(key) = theirs.keys().chain(ours.keys()).find(differs) {
        let (theirs, ours) = (value(&theirs, key), value(&ours, key));
        let text = format!("the run in this folder has another config: {key} = {theirs} there, {ours} now");
        return Err(Error::input(text).hint(hint()));
    }
    if config.period(last) != saved.run.config.period(last) {
        let before = config.stage.iter().take(begun - 1).filter_map(|stage| stage.generations).sum::<u64>();
        let text = format!("stage {begun}: generations: expected {} or more", last + 1 - before);
        let text = format!("{text}: so many of it have been done in this folder");
        return Err(Error::input(text).hint(hint()));
    }
    let training = Training::unless(config, dataset, config.period(last), stop)?;
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

/// All keys that results of the first `begun` stages depend on, as `map_elites.parents` or `stage 2: keep`, with their values. The last
/// of these stages may last longer, or end.
fn keys(config: &Config, begun: usize) -> Keys {
    let essence = Config { stage: Vec::new(), ..config.essence() };
    let mut keys = Keys::new();
    let root = toml::Value::try_from(essence);
    flatten("", root.expect("every field is a number, text, list or table, which TOML has"), &mut keys);
    for (number, stage) in (1..=begun).zip(&config.stage) {
        let generations = stage.generations.filter(|_| number < begun);
        let stage = toml::Table::try_from(StageConfig { generations, ..*stage });
        let stage = stage.expect("every field of a stage is a number, text or list, which TOML has");
        keys.extend(stage.into_iter().map(|(key, value)| (format!("stage {number}: {key}"), value)));
    }
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
