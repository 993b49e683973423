//! Which robots an audit found physical: what `--physical-only` takes.

use super::Error;
use super::archive::Robot;
use super::audit_file::{AUDIT_JSON, AuditFile};
use super::robots::{BEST, Chosen, Selection, Source, by_id};
use super::validation::Validated;
use std::path::PathBuf;

/// The file of verdicts beside a run.
fn path(source: &Source) -> PathBuf {
    source.path.with_file_name(AUDIT_JSON)
}

fn audits(sources: &[Source]) -> Result<Vec<AuditFile>, Error> {
    sources.iter().map(|source| AuditFile::of_run(&source.run, &path(source))).collect()
}

/// Whether there are verdicts on all of them.
///
/// # Errors
/// As of [`AuditFile::of_run`].
pub(super) fn all_audited(robots: &[Chosen], sources: &[Source]) -> Result<bool, Error> {
    let audits = audits(sources)?;
    Ok(robots.iter().all(|chosen| audits[chosen.source].robot(&chosen.robot.id).is_some()))
}

/// The physical ones, fittest first; those that are named must be among them.
pub(super) fn physical<'a>(
    selection: &Selection,
    fittest: Vec<Chosen<'a>>,
    sources: &'a [Source],
) -> Result<Vec<Chosen<'a>>, Error> {
    let audits = audits(sources)?;
    let name = |chosen: &Chosen| path(&sources[chosen.source]).display().to_string();
    let found = |chosen: &Chosen| audits[chosen.source].robot(&chosen.robot.id);
    let hint = "morphcog audit goes on with the robots that are missing; give it the same --archive";
    let mut named = Vec::new();
    if let Selection::Ids(ids) = selection {
        for id in ids.iter().filter(|id| *id != BEST) {
            named.extend(by_id(&fittest, id)?);
        }
    }
    // Who names robots needs to know of those only; of a part of an archive nothing can be drawn fairly.
    let is_named = matches!(selection, Selection::Ids(ids) if !ids.iter().any(|id| id == BEST));
    for chosen in if is_named { &named } else { &fittest } {
        if found(chosen).is_none() {
            let audit = &audits[chosen.source];
            let (name, known, all) = (name(chosen), audit.robots.len(), audit.elites);
            let id = &chosen.robot.id;
            let text = format!("{name}: robot {id} has not been audited ({known} of {all} have)");
            return Err(Error::input(text).hint(hint.to_string()));
        }
    }
    for chosen in &named {
        if let Some(found) = found(chosen).filter(|found| !found.is_physical()) {
            let text =
                format!("{}: robot {} is not physical: {}", name(chosen), found.id, found.conclusion());
            return Err(
                Error::input(text).hint("leave --physical-only away to take it all the same".to_string())
            );
        }
    }
    let physical: Vec<Chosen> =
        fittest.iter().filter(|chosen| found(chosen).is_some_and(|r| r.is_physical())).copied().collect();
    if physical.is_empty() {
        let names: Vec<String> = sources.iter().map(|source| path(source).display().to_string()).collect();
        return Err(Error::input(format!(
            "{}: none of {} robots is physical",
            names.join(", "),
            fittest.len()
        )));
    }
    Ok(physical)
}

/// Of robots of a run, best on validation images first, the first so many of each task that are physical. What comes after them
/// need not have been audited.
///
/// # Errors
/// If one that comes before them has not been, or none of a task is physical.
pub(super) fn first_physical<'a>(
    ranked: Vec<(&'a Robot, Validated)>,
    source: &Source,
    count: usize,
) -> Result<Vec<(&'a Robot, Validated)>, Error> {
    let path = path(source);
    let audit = AuditFile::of_run(&source.run, &path)?;
    let (name, archive) = (path.display(), source.path.display());
    let mut chosen = Vec::new();
    for task in &source.run.dimensions.tasks {
        let of_task: Vec<_> = ranked.iter().filter(|(robot, _)| robot.task == *task).collect();
        let mut physical = 0;
        for (place, (robot, validated)) in of_task.iter().enumerate() {
            if physical == count {
                break;
            }
            let Some(found) = audit.robot(&robot.id) else {
                let (id, place) = (&robot.id, place + 1);
                let text = format!(
                    "{name}: robot {id}, number {place} of {task} on validation images, has not been audited"
                );
                let hint = format!("morphcog audit --archive {archive} --robots best-validation:{place}");
                return Err(Error::input(text).hint(hint));
            };
            if found.is_physical() {
                physical += 1;
                chosen.push((*robot, validated.clone()));
            }
        }
        if physical == 0 && !of_task.is_empty() {
            let text = format!(
                "{name}: none of the {} best of {task} on validation images is physical",
                of_task.len()
            );
            let hint = format!("morphcog audit --archive {archive} makes all its robots eligible");
            return Err(Error::input(text).hint(hint));
        }
    }
    Ok(chosen)
}
