//! Runs all tasks, several at once.

use crate::base::error::{Error, ErrorKind};
use crate::base::observer::{Generation, Observer, Work};
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::text::counted;
use crate::base::threads;
use crate::commands::tasks::steps::{is_done, run};
use crate::commands::tasks::task::{BEFORE_ROUNDS, Run, Task, TaskFolders};
use crate::config::{Config, DataConfig};
use crate::data::dataset::{Dataset, Split};
use crate::images::held_out;
use crate::images::training::TrainingImages;
use crate::images::whereabouts::Whereabouts;
use crate::store::images::{HeldOut, HowMany};
use crate::store::names::{DATA_FOLDER, TASK_JSON};
use crate::store::task::TaskFile;
use crate::training;
use serde_json::Value;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

#[derive(Clone, Debug, Default)]
pub(crate) struct TasksSummary {
    /// Number of tasks done, now or before.
    pub(crate) done: usize,
    /// Numbers of the failed tasks.
    pub(crate) failed: Vec<usize>,
    /// Number of tasks that other processes work on.
    pub(crate) elsewhere: usize,
    /// Number of tasks that were stopped or did not begin.
    pub(crate) open: usize,
}

impl TasksSummary {
    /// Returns an error if not all of `count` tasks are done.
    pub(crate) fn check(&self, count: usize) -> Result<(), Error> {
        let TasksSummary {
            done,
            failed,
            elsewhere,
            open,
        } = self;
        if !failed.is_empty() {
            let numbers: Vec<String> = failed.iter().map(usize::to_string).collect();
            let (count_failed, numbers) = (failed.len(), numbers.join(", "));
            let text = format!(
                "{count_failed} of {count} tasks failed: {numbers}; {done} are done, {open} are open"
            );
            return Err(Error::other(text).remedy(Remedy::Repeat));
        }
        if *open == 0 && *elsewhere > 0 {
            let text =
                format!("{done} of {count} tasks are done; other processes are at {elsewhere}");
            return Err(Error::occupied(text).remedy(Remedy::Repeat));
        }
        if *open > 0 {
            let at = if *elsewhere > 0 {
                format!(", {elsewhere} in the hands of other processes")
            } else {
                String::new()
            };
            let text = format!("stopped; {done} of {count} tasks are done{at}");
            return Err(Error::stopped(text).remedy(Remedy::Repeat));
        }
        Ok(())
    }
}

/// Checks that tasks that have not begun have images, also for their tests. Otherwise they would
/// fail one by one, or after hours of work.
pub(crate) fn check_data<'a>(
    tasks: impl Iterator<Item = (usize, &'a Task)>,
    place: &TaskFolders,
    data: Option<&Path>,
) -> Result<(), Error> {
    let has_begun = |task: &Task| place.folder(task).join(DATA_FOLDER).exists();
    let mut datasets: BTreeMap<String, Dataset> = BTreeMap::new();
    let mut known = BTreeSet::new();
    for (number, task) in tasks.filter(|(_, task)| !has_begun(task)) {
        let given = Whereabouts::given(data);
        let (config, whereabouts) = match &task.run {
            Run::Evolve(config, ..) => (&**config, given),
            Run::Train(training) => (&training.config, given.and_of(&training.archive)),
            Run::Pair(pair) => (&pair.config, given.and_of(&pair.gaits.archives[0])),
        };
        let test = task
            .steps
            .eval
            .as_ref()
            .filter(|step| step.split == HeldOut::Test);
        let splits = if test.is_some() {
            &Split::ALL[..]
        } else {
            &[Split::Train]
        };
        let DataConfig {
            dataset,
            dir,
            builtin,
            transpose,
            class_names,
            ..
        } = &config.data;
        let about = (dataset, dir, builtin, transpose, class_names);
        let name = format!("{:?}", (splits, about, &whereabouts));
        let dataset = match datasets.entry(name.clone()) {
            Entry::Occupied(loaded) => loaded.into_mut(),
            Entry::Vacant(place_of) => place_of.insert(whereabouts.load(&config.data, splits)?),
        };
        let named = |error: Error| error.in_place(&format!("task {number} ({})", task.name));
        if let Some(groups) = task.run.groups() {
            training::check_groups(groups, dataset).map_err(named)?;
        }
        match &task.run {
            Run::Evolve(config, ..) => {
                TrainingImages::images(config, dataset).map_err(named)?;
                held_out::check(config, &[], "data.images_per_class", dataset).map_err(named)?;
            }
            Run::Train(_) | Run::Pair(_) => {
                training::with_images(config.clone(), &[], dataset, &Session::default())
                    .map_err(named)?;
            }
        }
        let Some(step) = test.filter(|step| known.insert((name, step.images, config.classes())))
        else {
            continue;
        };
        check_test(config, dataset, step.images, "eval.images").map_err(named)?;
    }
    Ok(())
}

/// Checks that there are enough test images; `key` names the setting that requests them.
pub(crate) fn check_test(
    config: &Config,
    dataset: &Dataset,
    images: HowMany,
    key: &str,
) -> Result<(), Error> {
    let drawn = held_out::test_images(&config.classes(), dataset, images, 1);
    drawn
        .map(|_| ())
        .map_err(|error| error.in_place(&format!("{key} = {images}")))
}

/// Runs all tasks, `jobs` at once; `None`: one per core. A failing task does not stop others.
pub(crate) fn run_all(
    tasks: &[Task],
    place: &TaskFolders,
    jobs: Option<usize>,
    session: &Session,
) -> Result<TasksSummary, Error> {
    let is_open = |task: &&Task| {
        let known = TaskFile::read(&place.folder(task).join(TASK_JSON))
            .ok()
            .flatten();
        !is_done(known.as_ref(), task, place)
    };
    let numbered: Vec<(usize, &Task)> =
        (1..).zip(tasks).filter(|(_, task)| is_open(task)).collect();
    check_data(numbered.iter().copied(), place, session.data_folder())?;
    std::fs::create_dir_all(&place.out).map_err(|error| Error::writing(&place.out, &error))?;
    let before = tasks.len() - numbered.len();
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = session.threads.unwrap_or_else(cores);
    let jobs = jobs.unwrap_or(threads).min(numbered.len()).max(1);
    let threads = Some((threads / jobs).max(1));
    let sum = |tasks: &mut dyn Iterator<Item = &Task>| {
        tasks.map(Task::amount).fold(0, u64::saturating_add)
    };
    let total = sum(&mut tasks.iter());
    let known = total - sum(&mut numbered.iter().map(|(_, task)| *task));
    if !numbered.is_empty() {
        let label = format!(
            "{} of {}, {jobs} at once:",
            numbered.len(),
            counted(tasks.len(), "task", "tasks")
        );
        let unit = match tasks.first().map(|task| &task.run) {
            Some(Run::Train(_)) => "challengers",
            Some(Run::Pair(_)) => "steps",
            _ => "generations",
        };
        let work = Work::new(label, total, unit);
        session.observer.begins(&Work { known, ..work });
    }
    let all = All {
        session,
        known,
        parts: numbered.iter().map(|_| AtomicU64::new(0)).collect(),
    };
    let next = AtomicUsize::new(0);
    let summary = Mutex::new(TasksSummary {
        done: before,
        ..TasksSummary::default()
    });
    // Tasks that other processes worked on.
    let elsewhere: Mutex<Vec<&Task>> = Mutex::new(Vec::new());
    let worker = || {
        while session.check().is_ok() {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some((number, task)) = numbered.get(index) else {
                break;
            };
            let has_begun = AtomicBool::new(false);
            let part = Part {
                all: &all,
                index,
                amount: task.amount(),
                name: &task.name,
                is_pair: matches!(task.run, Run::Pair(_)),
                has_begun,
                steps: AtomicU64::new(0),
            };
            let ended = catch_unwind(AssertUnwindSafe(|| {
                run(task, place, &session.watched(&part).threads(threads))
            }));
            let ended = ended.unwrap_or_else(|_| {
                Err(Error::other(
                    "a bug of morphcog; what it said stands above".to_string(),
                ))
            });
            let mut summary = summary.lock().unwrap_or_else(PoisonError::into_inner);
            match ended {
                Ok(()) => {
                    summary.done += 1;
                    part.begins_at(part.amount);
                    part.is_at(part.amount);
                    session.observer.note(&format!(
                        "task {number} ({}): done, {} of {}",
                        task.name,
                        summary.done,
                        tasks.len()
                    ));
                }
                Err(error) if error.kind == ErrorKind::Stopped => {}
                Err(error) if error.kind == ErrorKind::Occupied => {
                    elsewhere
                        .lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push(*task);
                }
                Err(error) => {
                    session.observer.failed(
                        &error.in_place(&format!("task {number} ({}) failed", task.name)),
                        "",
                    );
                    summary.failed.push(*number);
                }
            }
        }
    };
    threads::at_once(jobs, worker)?;
    let mut summary = summary.into_inner().unwrap_or_else(PoisonError::into_inner);
    summary.failed.sort_unstable();
    // Some of them may be done by now.
    let elsewhere = elsewhere
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner);
    summary.elsewhere = elsewhere.iter().filter(|task| is_open(task)).count();
    summary.done += elsewhere.len() - summary.elsewhere;
    summary.open = tasks.len() - summary.done - summary.failed.len() - summary.elsewhere;
    Ok(summary)
}

struct All<'o> {
    session: &'o Session<'o>,
    /// Generations of tasks that were done before.
    known: u64,
    /// Generations done in each other task.
    parts: Vec<AtomicU64>,
}

struct Part<'a, 'o> {
    all: &'a All<'o>,
    index: usize,
    amount: u64,
    name: &'a str,
    is_pair: bool,
    /// Steps of a pair so far.
    steps: AtomicU64,
    /// True once it has reported the generations done before.
    has_begun: AtomicBool,
}

impl Part<'_, '_> {
    /// Reports the work done before it began here, unless it has done so.
    fn begins_at(&self, done: u64) {
        if !self.has_begun.swap(true, Ordering::Relaxed) {
            self.all.session.observer.skips(done.min(self.amount));
        }
    }

    fn is_at(&self, done: u64) {
        let All {
            session,
            known,
            parts,
        } = self.all;
        parts[self.index].fetch_max(done.min(self.amount), Ordering::Relaxed);
        let done = parts.iter().map(|part| part.load(Ordering::Relaxed));
        session
            .observer
            .progress(done.fold(*known, u64::saturating_add));
    }
}

impl Observer for Part<'_, '_> {
    fn generation(&self, generation: &Generation) {
        self.begins_at(generation.done);
        self.is_at(generation.done);
    }

    fn finding(&self, kind: &str, fields: &Value) {
        if self.is_pair {
            let done = match kind {
                "ranked" => 2,
                "window" => BEFORE_ROUNDS,
                "round" | "challenge" => self.steps.load(Ordering::Relaxed) + 1,
                _ => return,
            };
            // A second gait begins anew; the bar waits for it.
            self.steps.store(done, Ordering::Relaxed);
            self.begins_at(0);
            return self.is_at(done.min(self.amount - 1));
        }
        if let Some(challenger) = fields.get("challenger").and_then(Value::as_u64) {
            self.begins_at(0);
            self.is_at(challenger);
        }
    }

    fn warning(&self, text: &str) {
        self.all
            .session
            .observer
            .warning(&format!("{}: {text}", self.name));
    }
}
