//! Selects robots for commands that handle them one by one (`replay`, `plot`).

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::robots;
use crate::robots::selection::{Selection, first_physical};
use crate::search::validation;
use crate::store::run::{Robot, different};
use crate::store::stored_run::StoredRun;
use crate::store::validation::Validated;
use std::path::PathBuf;

/// The robots to select, and the archives to search.
#[derive(Clone, Debug)]
pub struct RobotChoice {
    /// Robots to select.
    pub robots: Selection,
    /// Archives, searched as one; if empty, the published robots if those are named, else the
    /// newest run.
    pub archives: Vec<PathBuf>,
    /// True if only robots count that an audit found physical.
    pub physical_only: bool,
    /// Seed of random selections.
    pub seed: u64,
}

/// A robot, by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// The run.json.
    pub archive: PathBuf,
    /// Its id, the beginning of one, or "best".
    pub robot: String,
}

/// Returns the selected robots. Names in a single archive are not looked up yet.
///
/// # Errors
/// Returns an error if no robot matches, or if a signal stopped the validation.
pub fn named(options: &RobotChoice, session: &Session) -> Result<Vec<Named>, Error> {
    let RobotChoice { seed, .. } = options;
    let (archives, robots) = robots::archives(options.archives.clone(), options.robots.clone())?;
    if let (Selection::Ids(ids), [archive]) = (&robots, &archives[..]) {
        let one = |robot: &String| Named {
            archive: archive.clone(),
            robot: robot.clone(),
        };
        return Ok(ids.iter().map(one).collect());
    }
    let sources: Vec<StoredRun> = archives
        .iter()
        .map(|path| robots::open(path))
        .collect::<Result<_, _>>()?;
    different(
        sources
            .iter()
            .map(|source| (source.path.as_path(), &source.run)),
    )?;
    let name = |source: &StoredRun, robot: &Robot| Named {
        archive: source.path.clone(),
        robot: robot.id.clone(),
    };
    let Some(count) = robots.validated() else {
        let chosen = robots.physical(options.physical_only).of(&sources, *seed)?;
        return Ok(chosen
            .iter()
            .map(|chosen| name(&sources[chosen.source], chosen.robot))
            .collect());
    };
    let mut all = Vec::new();
    for source in &sources {
        let best = ranked(options, source, count, session)?;
        all.extend(best.iter().map(|(robot, _)| name(source, robot)));
    }
    Ok(all)
}

/// Returns the best `count` of each task of a run on validation images.
fn ranked<'a>(
    options: &RobotChoice,
    source: &'a StoredRun,
    count: usize,
    session: &Session,
) -> Result<Vec<(&'a Robot, Validated)>, Error> {
    // Some may not be physical: validate as many as the run does at its end.
    let known = if options.physical_only {
        source.run.config.validation.best
    } else {
        0
    };
    let search = validation::ValidationOptions {
        archive: source.path.clone(),
        best: Some(count.max(known)),
    };
    let Some(best) = validation::validate(&search, session)? else {
        let text = "stopped before the robots were chosen; nothing is shown";
        return Err(Error::stopped(text.to_string()).remedy(Remedy::Repeat));
    };
    let by_id = |validated: Validated| {
        let mut elites = source.run.elites.iter();
        let robot =
            elites.find(|robot| robot.id == validated.id && robot.task == validated.task)?;
        Some((robot, validated))
    };
    let best: Vec<_> = best.into_iter().filter_map(by_id).collect();
    if options.physical_only {
        first_physical(best, source, count)
    } else {
        Ok(best)
    }
}
