//! Resuming a saved run under the same config and on the same images: from its checkpoint or, where
//! that is sufficient, from its `run.json` alone.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::config::{Config, differing};
use crate::images::training::TrainingImages;
use crate::store::checkpoint;
use crate::store::checkpoint::{Checkpoint, KnownBodies};
use crate::store::folder::RunFolder;
use crate::store::metrics::Totals;
use crate::store::names::{METRICS, RUN_JSON};
use crate::store::run::RunFile;
use std::path::Path;

/// Returns the state to resume from; `None` if the folder has no run yet. Skips a broken newest
/// checkpoint and resumes from a `run.json` without checkpoints; `warn` reports either. Errors
/// change nothing.
pub(crate) fn saved(
    folder: &RunFolder,
    config: &Config,
    training: &TrainingImages,
    mut warn: impl FnMut(String),
) -> Result<Option<Checkpoint>, Error> {
    let place = folder.path().display().to_string();
    let mut is_newest_broken = false;
    let tell = |text| {
        is_newest_broken = true;
        warn(text);
    };
    let run_json = folder.path().join(RUN_JSON);
    let checkpoint = checkpoint::read(folder.path(), tell).map_err(|error| {
        error.remedy(match without_checkpoint(&run_json) {
            Ok(_) => Remedy::advice(format!(
                "move checkpoint*.json away: the run then goes on from its {RUN_JSON}"
            )),
            Err(_) => Remedy::Replace,
        })
    })?;
    let has_checkpoint = checkpoint.is_some();
    let saved = match checkpoint {
        Some(saved) => saved,
        None => {
            if !run_json.exists() {
                return Ok(None);
            }
            without_checkpoint(&run_json)?
        }
    };
    compatible(&saved, config, training).map_err(|error| error.in_place(&place))?;
    if is_newest_broken {
        checkpoint::take_back(folder.path())?;
    }
    if !has_checkpoint {
        warn(format!(
            "{place}: no checkpoint; going on from {RUN_JSON}: the elites will be the same, but bodies that were \
             evaluated before are evaluated again, and the counts of {METRICS} begin anew"
        ));
    }
    Ok(Some(saved))
}

/// Builds a checkpoint from a `run.json` alone: later generations depend only on its elites, since
/// a body evaluated before would not become one now. Not so for a measured response (of gaits that
/// differ only in sensors, the first stays) or a training: errors.
fn without_checkpoint(path: &Path) -> Result<Checkpoint, Error> {
    let run = RunFile::read(path)?;
    let needs = if run.origin.is_some() {
        Some("the run is a training")
    } else if run.config.measures_response() {
        Some("fitness = response needs one")
    } else {
        None
    };
    if let Some(why) = needs {
        let text = format!("{}: expected a checkpoint beside it: {why}", path.display());
        return Err(Error::input(text)
            .remedy(Remedy::ChooseOut)
            .remedy(Remedy::Replace));
    }
    let mut known_bodies = KnownBodies::default();
    for robot in &run.elites {
        known_bodies.insert(run.config.objective().known_key(&robot.body));
    }
    Ok(Checkpoint {
        run,
        totals: Totals::default(),
        known_bodies,
    })
}

/// Checks that a run can resume under a config: everything its results depend on must match.
fn compatible(saved: &Checkpoint, config: &Config, training: &TrainingImages) -> Result<(), Error> {
    let differs = |text: String| {
        Error::input(text)
            .advice("resume with the config it was started with")
            .remedy(Remedy::Replace)
    };
    let (theirs, ours) = (&saved.run.program_version, env!("CARGO_PKG_VERSION"));
    if theirs != ours {
        let text = format!(
            "the run in this folder was made by morphcog {theirs}; this is {ours}, whose numbers may be others"
        );
        return Err(Error::input(text)
            .advice(format!("go on with morphcog {theirs}"))
            .remedy(Remedy::Replace));
    }
    let differing = differing(&saved.run.config.settings(), &config.settings());
    // Training keys only matter after the evolution has ended.
    if let Some((key, theirs, ours)) = differing
        .iter()
        .find(|(key, ..)| !key.starts_with("train."))
    {
        let text = format!(
            "the run in this folder has another config: {key} = {theirs} there, {ours} now"
        );
        return Err(differs(text));
    }
    if saved.run.dataset != training.dataset || saved.run.training_images != training.images {
        let text =
            "data: the run in this folder was made with other images: the dataset has changed"
                .to_string();
        return Err(differs(text));
    }
    let (done, asked) = (saved.run.generations, config.generations);
    if done > asked {
        let text = format!("generations = {asked}: the run in this folder has {done} already");
        return Err(Error::input(text)
            .advice(format!("ask for {done} or more"))
            .remedy(Remedy::Replace));
    }
    Ok(())
}
