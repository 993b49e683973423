//! Runs one task: its run, then its steps, unless they are done.

use crate::base::error::{Error, ErrorKind};
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::commands::evolve;
use crate::commands::tasks::task::{Run, Task, TaskFolders, selection};
use crate::commands::train;
use crate::commands::{audit, eval, pairs};
use crate::robots::selection::Selection;
use crate::search::{held_out_run, validation};
use crate::store::eval::EvalFile;
use crate::store::folder::IfExists;
use crate::store::lock::Lock;
use crate::store::names::{AUDIT_JSON, RUN_JSON, TASK_JSON, TASK_LOCK};
use crate::store::task::{TaskFile, TaskState};
use crate::task::answer;
use std::time::Instant;

/// Runs a task, or goes on with it.
pub(crate) fn run(task: &Task, place: &TaskFolders, session: &Session) -> Result<(), Error> {
    let folder = place.folder(task);
    std::fs::create_dir_all(&folder).map_err(|error| Error::writing(&folder, &error))?;
    let lock = folder.join(TASK_LOCK);
    let _lock = Lock::take_contended(&lock, session).map_err(|refusal| {
        let held = format!("{}: another process is at this task", folder.display());
        refusal.into_error(&lock, &held, "let it end, or stop it")
    })?;
    let path = folder.join(TASK_JSON);
    let known = TaskFile::read(&path)?;
    if is_done(known.as_ref(), task, place) {
        return Ok(());
    }
    let mut file = TaskFile::new(task.settings(), task.asked());
    let before = known.map_or(0.0, |known| known.seconds);
    file.seconds = before;
    file.write(&path)?;
    let began = Instant::now();
    let ended = steps(task, place, session);
    file.seconds = before + began.elapsed().as_secs_f64();
    (file.state, file.error) = match &ended {
        Ok(()) => (TaskState::Done, None),
        Err(error) if error.kind == ErrorKind::Stopped => (TaskState::Stopped, None),
        Err(error) => (TaskState::Failed, Some(error.to_string())),
    };
    // The reason it ended says more than a failure to record it.
    let written = file.write(&path);
    ended.and(written)
}

/// Returns true if a task is done, by the present plan, and its results are still there.
pub(super) fn is_done(known: Option<&TaskFile>, task: &Task, place: &TaskFolders) -> bool {
    known.is_some_and(|known| was_done(known, task)) && lacking(task, place).is_none()
}

/// Returns true if a task's file says that all of it is done.
pub(super) fn was_done(known: &TaskFile, task: &Task) -> bool {
    known.state == TaskState::Done
        && known.settings == task.settings()
        && known.asked == task.asked()
}

/// Returns the part of a finished task that is missing or not its own: the reason to redo it.
pub(super) fn lacking(task: &Task, place: &TaskFolders) -> Option<String> {
    let folder = place.folder(task);
    let audit = task.steps.audit.as_ref().map(|_| AUDIT_JSON);
    if let Some(name) = [Some(RUN_JSON), audit]
        .into_iter()
        .flatten()
        .find(|name| !folder.join(name).is_file())
    {
        return Some(format!("{name} is missing"));
    }
    let test = test_of(task, place).ok()??;
    let name = eval::own_name(test.split);
    match EvalFile::read(&test.out) {
        Err(_) if !test.out.exists() => Some(format!("{name} is missing")),
        Err(_) => Some(format!("{name} cannot be read")),
        Ok(known) => eval::differing(&known, &test, task.cycle_steps())
            .first()
            .map(|(key, there, asked)| format!("{name} has {key} {there}, not {asked}")),
    }
}

/// Returns the test that a task's plan requests, if any.
pub(crate) fn test_of(
    task: &Task,
    place: &TaskFolders,
) -> Result<Option<eval::EvalOptions>, Error> {
    let Some(step) = &task.steps.eval else {
        return Ok(None);
    };
    let folder = place.folder(task);
    Ok(Some(eval::EvalOptions {
        archives: vec![folder.join(RUN_JSON)],
        robots: selection("eval.robots", &step.robots)?.physical(step.physical_only),
        images: Some(step.images),
        split: step.split,
        validation: None,
        seed: 1,
        threshold: answer::THRESHOLD,
        cycles: held_out_run::CYCLES,
        dataset: None,
        out: folder.join(eval::own_name(step.split)),
    }))
}

/// Does the run and the steps after it, unless they are done.
fn steps(task: &Task, place: &TaskFolders, session: &Session) -> Result<(), Error> {
    let folder = place.folder(task);
    let stopped = || {
        Error::stopped("stopped; what is done so far is kept".to_string()).remedy(Remedy::Repeat)
    };
    match &task.run {
        Run::Evolve(config, name, _) => {
            let options = evolve::EvolveOptions {
                config: (**config).clone(),
                name: name.clone(),
                out: folder.clone(),
                if_exists: IfExists::Resume,
            };
            let finished = evolve::evolve(&options, session).map_err(with_task_remedies)?;
            if or_write_error(finished.stopped, finished.unwritten)? {
                return Err(stopped());
            }
        }
        Run::Train(training) => {
            let options = train::TrainOptions {
                archive: training.archive.clone(),
                robots: selection("robots", &training.robots)?,
                groups: training.groups.clone(),
                seed: Some(training.seed),
                set: training.set.clone(),
                name: task.name.clone(),
                out: folder.clone(),
                if_exists: IfExists::Resume,
            };
            let trained = train::train(&options, session).map_err(|error| match error.kind {
                ErrorKind::Stopped => stopped(),
                _ => with_task_remedies(error),
            })?;
            if trained.validated.is_none() {
                return Err(stopped());
            }
        }
        Run::Pair(pair) => {
            pairs::train_pair(&pair.gaits, &folder, session).map_err(|error| match error.kind {
                ErrorKind::Stopped => stopped(),
                _ => with_task_remedies(error),
            })?;
        }
    }
    let archive = folder.join(RUN_JSON);
    if let Some(step) = &task.steps.audit {
        let robots = match selection("audit.robots", &step.robots)? {
            Selection::Validated(best) => {
                let options = validation::ValidationOptions {
                    archive: archive.clone(),
                    best: Some(best),
                };
                let found = validation::validate(&options, session)?.ok_or_else(stopped)?;
                Selection::Ids(found.into_iter().map(|robot| robot.id).collect())
            }
            robots => robots,
        };
        let options = audit::AuditOptions {
            archive: archive.clone(),
            robots,
            seed: 1,
            criteria: step.criteria.clone(),
            fresh: false,
            out: folder.join(AUDIT_JSON),
        };
        let finished = audit::audit(&options, session)?;
        if or_write_error(finished.stopped, finished.unwritten)? {
            return Err(stopped());
        }
    }
    if let Some(options) = test_of(task, place)? {
        if eval::known(&options, session)?.is_some() {
            return Ok(());
        }
        let finished = eval::eval(&options, session)?;
        if or_write_error(finished.file.stopped, finished.unwritten)? {
            return Err(stopped());
        }
    }
    Ok(())
}

/// Adapts the remedies of a run's error. A task always resumes, so a run that cannot be resumed is
/// another one, in the way.
fn with_task_remedies(error: Error) -> Error {
    let is_in_the_way = error.remedies.iter().any(|remedy| match remedy {
        Remedy::Resume | Remedy::Replace => true,
        // A run of another kind, which another command goes on with.
        Remedy::Run(..) => error.kind == ErrorKind::Occupied,
        _ => false,
    });
    if is_in_the_way {
        let error = Error {
            kind: ErrorKind::Input,
            remedies: Vec::new(),
            ..error
        };
        return error.remedy(Remedy::MoveAway).remedy(Remedy::ChooseOut);
    }
    let by_itself = |remedy| {
        if remedy == Remedy::RepeatResuming {
            Remedy::Repeat
        } else {
            remedy
        }
    };
    Error {
        remedies: error.remedies.into_iter().map(by_itself).collect(),
        ..error
    }
}

/// Returns a result that later steps read from its file, or the error of writing it.
pub(crate) fn or_write_error<T>(found: T, unwritten: Option<Error>) -> Result<T, Error> {
    match unwritten {
        None => Ok(found),
        Some(error) => Err(error.remedy(Remedy::Repeat)),
    }
}
