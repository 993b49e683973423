//! Independent tasks, each in a run folder of its own: what `sweep` and `reproduce` are made of.
//!
//! A task evolves or trains, and then does the steps that its plan asks for. How far it is stands
//! in its folder, so that any process on any machine goes on with it.

use crate::base::error::{Error, ErrorKind};
use crate::base::named;
use crate::base::observer::{Generation, Observer, Work};
use crate::base::ranks::Ranks;
use crate::base::text::counted;
use crate::commands::{audit, eval};
use crate::config::audit::Criteria;
use crate::config::{Config, Settings, differing};
use crate::data::dataset::{Dataset, Split};
use crate::search::showing::task_of;
use crate::search::{evolve, held_out, showing, train, training, validation};
use crate::store::audit::{AuditFile, RobotAudit};
use crate::store::eval::EvalFile;
use crate::store::folder::IfExists;
use crate::store::images::{HeldOut, HowMany};
use crate::store::lock::{self, Lock};
use crate::store::names::{AUDIT_JSON, DATA_FOLDER, METRICS, RUN_JSON, TASK_JSON, TASK_LOCK};
use crate::store::robots::{BEST, Selection, Source};
use crate::store::run::{Robot, RunFile};
use crate::store::setting::RunRef;
use crate::store::task::{State, TaskFile};
use crate::store::whereabouts::Whereabouts;
use crate::task::direction;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

/// Bytes at the end of a metrics.csv that hold its last whole row; rows have about 150.
const ROW: u64 = 4096;

/// A task.
#[derive(Clone, Debug)]
pub struct Task {
    /// Its name, which is its run folder's, too.
    pub name: String,
    /// What makes its run.
    pub run: Run,
    /// What is done with that.
    pub steps: Steps,
    /// Keys that are not the same in all tasks, with their values as text; for tables.
    pub varied: Vec<(String, String)>,
}

/// What makes a run.
#[derive(Clone, Debug)]
pub enum Run {
    /// `evolve`, with the name of the run.
    Evolve(Box<Config>, String),
    /// `train`.
    Train(Box<Training>),
}

/// A training.
#[derive(Clone, Debug)]
pub struct Training {
    /// The run.json whose robots walk.
    pub archive: PathBuf,
    /// SHA-256 of that.
    pub sha256: String,
    /// Which of its robots.
    pub robots: String,
    /// The two groups of classes.
    pub groups: [Vec<u8>; 2],
    /// Seed of all chance.
    pub seed: u64,
    /// Keys that differ from those of the run.
    pub set: Vec<String>,
    /// The config that results.
    pub config: Config,
}

/// What is done after a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Steps {
    /// An audit, as by `morphcog audit`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub audit: Option<AuditStep>,
    /// A test on held-out images, as by `morphcog eval`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub eval: Option<EvalStep>,
}

/// An audit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AuditStep {
    /// Which robots, as `--robots` of `morphcog audit`. Default "all".
    pub robots: String,
    /// How they are judged.
    pub criteria: Criteria,
}

impl Default for AuditStep {
    fn default() -> Self {
        AuditStep { robots: "all".to_string(), criteria: Criteria::default() }
    }
}

/// A test on held-out images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EvalStep {
    /// Which robots, as `--robots` of `morphcog eval`. Default "best".
    pub robots: String,
    /// Images in all, evenly divided between the classes, or "all" that there are. Default 1000.
    pub images: HowMany,
    /// Which images. Default "test".
    pub split: HeldOut,
    /// Only robots that the audit found physical. Default false.
    pub physical_only: bool,
}

impl Default for EvalStep {
    fn default() -> Self {
        EvalStep {
            robots: "best".to_string(),
            images: HowMany::Evenly(1000),
            split: HeldOut::Test,
            physical_only: false,
        }
    }
}

impl Steps {
    /// Checks what a type cannot; `trains`: of tasks that train, not evolve.
    ///
    /// # Errors
    /// What is wrong.
    pub(crate) fn check(&self, trains: bool) -> Result<(), Error> {
        if let Some(step) = &self.audit {
            selection("audit.robots", &step.robots)?;
            step.criteria.check().map_err(|error| error.of("audit.criteria"))?;
        }
        let Some(step) = &self.eval else { return Ok(()) };
        let tested = selection("eval.robots", &step.robots)?;
        let Some(audit) = self.audit.as_ref().filter(|_| step.physical_only) else {
            return match step.physical_only {
                true => Err(Error::value("eval.physical_only", true, "it with [audit] only")),
                false => Ok(()),
            };
        };
        // A training has one robot, whichever way it is chosen.
        let is_whole = trains || selection("audit.robots", &audit.robots)? == Selection::All;
        let is_named = matches!(&tested, Selection::Ids(ids) if !ids.iter().any(|id| id == BEST));
        if !is_whole && tested.validated().is_none() && !is_named {
            let expected =
                "audit.robots = \"all\" with it: from a part of an archive nothing is drawn fairly";
            return Err(Error::value("eval.physical_only", true, expected));
        }
        Ok(())
    }
}

/// Reads a selection of robots.
pub(crate) fn selection(key: &str, text: &str) -> Result<Selection, Error> {
    text.parse().map_err(|error: String| Error::at(key, error))
}

/// Where tasks are done, and with what.
#[derive(Clone, Debug)]
pub struct Place {
    /// The folder that all run folders lie in.
    pub out: PathBuf,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// Number of threads in all; `None`: one per core.
    pub threads: Option<usize>,
}

impl Place {
    fn folder(&self, task: &Task) -> PathBuf {
        self.out.join(&task.name)
    }
}

impl Task {
    /// Everything that its run depends on.
    fn settings(&self) -> Settings {
        let (config, more) = match &self.run {
            Run::Evolve(config, _) => (config.settings(), Vec::new()),
            Run::Train(training) => (
                training.config.settings(),
                vec![("archive", training.sha256.clone()), ("robots", training.robots.clone())],
            ),
        };
        let config = config.into_iter().filter(|(key, _)| key != "train.challengers");
        config.chain(more.into_iter().map(|(key, value)| (key.to_string(), value.into()))).collect()
    }

    /// What is asked for beyond that: it may grow or change, and the task goes on.
    fn asked(&self) -> Value {
        let config = match &self.run {
            Run::Evolve(config, _) => config,
            Run::Train(training) => &training.config,
        };
        serde_json::json!({ "amount": self.amount(), "validation": config.validation, "steps": self.steps })
    }

    /// In which keys a run in its folder is another than this task makes: the key, its value there,
    /// and in the plan.
    pub(crate) fn differing(&self, run: &RunFile) -> Vec<(String, String, String)> {
        match &self.run {
            Run::Evolve(config, _) => differing(&run.config.settings(), &config.settings()),
            // Of a training's config windows and numbers of images are found on the way.
            Run::Train(training) => {
                let of = |config: &Config, archive: String| -> Settings {
                    let all = config.settings().into_iter();
                    let own = all.filter(|(key, _)| key == "seed" || key.starts_with("task."));
                    own.chain([("archive".to_string(), archive.into())]).collect()
                };
                let there = run.origin.as_ref().map_or("none".to_string(), |origin| origin.sha256.clone());
                differing(&of(&run.config, there), &of(&training.config, training.sha256.clone()))
            }
        }
    }

    /// The folder that its images are looked for in if no other is named, if it is there: one that
    /// depends on the present folder.
    pub fn data_here(&self) -> Option<PathBuf> {
        let (data, whereabouts) = match &self.run {
            Run::Evolve(config, _) => (&config.data, Whereabouts::given(None)),
            Run::Train(training) => {
                (&training.config.data, Whereabouts::given(None).and_of(&training.archive))
            }
        };
        whereabouts.by_default(data)
    }

    /// The folder of the atlas that its gaits are from, if they are.
    pub fn atlas(&self) -> Option<PathBuf> {
        let Run::Train(training) = &self.run else { return None };
        named::atlas_of(&training.archive)
    }

    /// How much of it there is to show on a bar: generations, or challengers.
    fn amount(&self) -> u64 {
        match &self.run {
            Run::Evolve(config, _) => config.generations,
            Run::Train(training) => training.config.train.challengers as u64,
        }
    }
}

/// Refuses tasks whose folders hold runs of other settings, all at once.
///
/// # Errors
/// Which, and the keys in which they differ.
pub fn check_folders(tasks: &[Task], place: &Place) -> Result<(), Vec<Error>> {
    let check = |(number, task): (usize, &Task)| {
        let path = place.folder(task).join(TASK_JSON);
        let of = |known: TaskFile| differing(&known.settings, &task.settings());
        let differing = TaskFile::read(&path).map(|known| known.map(of));
        let error = match differing {
            Ok(None) => return None,
            Ok(Some(keys)) if keys.is_empty() => return None,
            Ok(Some(keys)) => another(&place.folder(task), &keys),
            Err(error) => error,
        };
        Some(error.within(&format!("task {number} ({})", task.name)))
    };
    let refused: Vec<Error> = (1..).zip(tasks).filter_map(check).collect();
    if refused.is_empty() { Ok(()) } else { Err(refused) }
}

/// That there is another run in a folder than its task makes, with the keys in which it differs.
pub(crate) fn another(folder: &Path, keys: &[(String, String, String)]) -> Error {
    let said =
        |(key, there, now): &(String, String, String)| format!("{key} = {there} there, {now} in the plan");
    let keys: Vec<String> = keys.iter().map(said).collect();
    let text = format!("{}: the run there differs: {}", folder.display(), keys.join("; "));
    Error::input(text).hint("move that folder away, or name another with --out".to_string())
}

/// Does a task, or goes on with it.
///
/// # Errors
/// Why it failed; that it was stopped; that another process is at it.
pub fn run(task: &Task, place: &Place, stop: &AtomicBool, observer: &dyn Observer) -> Result<(), Error> {
    let folder = place.folder(task);
    std::fs::create_dir_all(&folder).map_err(|error| Error::writing(&folder, &error))?;
    let lock = folder.join(TASK_LOCK);
    let _lock = Lock::take(&lock, stop, observer).map_err(|refusal| {
        let held = format!("{}: another process is at this task", folder.display());
        refusal.into_error(&lock, &held, "let it end, or stop it")
    })?;
    let path = folder.join(TASK_JSON);
    let known = TaskFile::read(&path)?;
    if is_done(known.as_ref(), task) {
        return Ok(());
    }
    let mut file = TaskFile::new(task.settings(), task.asked());
    let before = known.map_or(0.0, |known| known.seconds);
    file.seconds = before;
    file.write(&path)?;
    let began = Instant::now();
    let ended = steps(task, place, stop, observer);
    file.seconds = before + began.elapsed().as_secs_f64();
    (file.state, file.error) = match &ended {
        Ok(()) => (State::Done, None),
        Err(error) if error.kind == ErrorKind::Stopped => (State::Stopped, None),
        Err(error) => (State::Failed, Some(error.message.clone())),
    };
    file.write(&path)?;
    ended
}

/// Whether all of a task is done. More generations, or other steps, are still to do.
fn is_done(known: Option<&TaskFile>, task: &Task) -> bool {
    known.is_some_and(|known| {
        known.state == State::Done && known.settings == task.settings() && known.asked == task.asked()
    })
}

/// The run, and the steps after it. What was done before is not done again.
fn steps(task: &Task, place: &Place, stop: &AtomicBool, observer: &dyn Observer) -> Result<(), Error> {
    let folder = place.folder(task);
    let stopped = || Error::stopped("stopped; what is done so far is kept".to_string());
    match &task.run {
        Run::Evolve(config, name) => {
            let options = evolve::Options {
                config: (**config).clone(),
                name: name.clone(),
                out: folder.clone(),
                if_exists: IfExists::Resume,
                data: place.data.clone(),
                threads: place.threads,
                ranks: Ranks::ALONE,
            };
            let finished = evolve::evolve(&options, stop, observer).map_err(elsewhere)?;
            if written(finished.stopped, finished.unwritten)? {
                return Err(stopped());
            }
        }
        Run::Train(training) => {
            let options = train::Options {
                archive: training.archive.clone(),
                robots: selection("robots", &training.robots)?,
                groups: training.groups.clone(),
                seed: Some(training.seed),
                set: training.set.clone(),
                name: task.name.clone(),
                out: folder.clone(),
                if_exists: IfExists::Resume,
                data: place.data.clone(),
                threads: place.threads,
            };
            if train::train(&options, stop, observer).map_err(elsewhere)?.validated.is_none() {
                return Err(stopped());
            }
        }
    }
    let archive = folder.join(RUN_JSON);
    if let Some(step) = &task.steps.audit {
        let robots = match selection("audit.robots", &step.robots)? {
            Selection::Validated(best) => {
                let options = validation::Options {
                    archive: archive.clone(),
                    best: Some(best),
                    data: place.data.clone(),
                    threads: place.threads,
                };
                let found = validation::validate(&options, stop, observer)?.ok_or_else(stopped)?;
                Selection::Ids(found.into_iter().map(|robot| robot.id).collect())
            }
            robots => robots,
        };
        let options = audit::Options {
            source: audit::Source::Archive(archive.clone()),
            robots,
            seed: 1,
            criteria: step.criteria.clone(),
            data: place.data.clone(),
            out: folder.join(AUDIT_JSON),
            threads: place.threads,
            ranks: Ranks::ALONE,
        };
        let finished = audit::audit(&options, stop, observer)?;
        if written(finished.stopped, finished.unwritten)? {
            return Err(stopped());
        }
    }
    if let Some(step) = &task.steps.eval {
        let sources = [Source::read(&archive)?];
        let options = eval::Options {
            archives: vec![archive],
            robots: selection("eval.robots", &step.robots)?.physical(step.physical_only),
            images: step.images,
            split: step.split,
            validation: None,
            seed: 1,
            threshold: direction::THRESHOLD,
            cycles: showing::CYCLES,
            data: place.data.clone(),
            dataset: None,
            out: folder.join(eval::own_name(step.split)),
            threads: place.threads,
            ranks: Ranks::ALONE,
        };
        if let Ok(known) = EvalFile::read(&options.out)
            && is_of(&known, &sources, &options)
            && is_of_robots(&known, &sources[0], &options)?
        {
            return Ok(());
        }
        let finished = eval::eval(&options, stop, observer)?;
        if written(finished.file.stopped, finished.unwritten)? {
            return Err(stopped());
        }
    }
    Ok(())
}

/// Tasks have no options of their own, as hints of `evolve` and `train` name them; and a run of
/// another kind in the folder is no process that works there.
fn elsewhere(error: Error) -> Error {
    match &error.hint {
        Some(hint) if hint.contains("--force") || hint.contains("--resume") => {
            let hint = "move that folder away, or name another with --out".to_string();
            Error { kind: ErrorKind::Input, ..error }.hint(hint)
        }
        _ => error,
    }
}

/// Whether an evaluation is whole, and of these runs and images; its robots are another question.
pub(crate) fn is_of(known: &EvalFile, sources: &[Source], options: &eval::Options) -> bool {
    let runs: Vec<RunRef> = sources.iter().map(RunRef::of).collect();
    let same = (known.seed, known.split, HowMany::Evenly(known.images.len()), known.threshold)
        == (options.seed, options.split, options.images, options.threshold);
    let is_ours = known.program_version == env!("CARGO_PKG_VERSION");
    is_ours && !known.stopped && known.trained_on.is_none() && known.runs == runs && same
}

/// Whether an evaluation is of the robots that would be chosen from a run now: verdicts may be others
/// than they were.
fn is_of_robots(known: &EvalFile, source: &Source, options: &eval::Options) -> Result<bool, Error> {
    let run = &source.run;
    let is_known = |robot: &Robot| known.robots.iter().any(|other| other.id == robot.id);
    if known.selected != options.robots.describe() {
        return Ok(false);
    }
    if options.robots.validated().is_some() {
        // Validation images choose the same robots again, of those that are physical now.
        let audit = AuditFile::if_any(run, &source.path)?;
        let is_physical = |robot: &Robot| {
            audit.as_ref().and_then(|audit| audit.robot(&robot.id)).is_some_and(RobotAudit::is_physical)
        };
        let wants_physical = matches!(options.robots, Selection::Physical(_));
        return Ok(!wants_physical || run.elites.iter().filter(|robot| is_known(robot)).all(is_physical));
    }
    let grouping = run.config.grouping()?;
    let chosen = options.robots.of(std::slice::from_ref(source), options.seed)?;
    let mut ids: BTreeSet<&str> = BTreeSet::new();
    ids.extend(chosen.iter().filter(|c| task_of(&grouping, c.robot).is_some()).map(|c| c.robot.id.as_str()));
    Ok(ids == known.robots.iter().map(|robot| robot.id.as_str()).collect())
}

/// What later steps read from its file, which must be there.
pub(crate) fn written<T>(found: T, unwritten: Option<Error>) -> Result<T, Error> {
    match unwritten {
        None => Ok(found),
        Some(error) => {
            let hint = error.hint.clone().map_or(String::new(), |hint| format!("{hint}; "));
            Err(error.hint(format!("{hint}the same command goes on")))
        }
    }
}

/// How tasks ended.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Tasks that are done, now or before.
    pub done: usize,
    /// Numbers of the tasks that failed.
    pub failed: Vec<usize>,
    /// Tasks that other processes are at.
    pub elsewhere: usize,
    /// Tasks that were stopped or did not begin.
    pub open: usize,
}

/// Whether there are images for tasks that have not begun, also for their tests: else they would
/// fail, one after the other, or when hours of work are done.
///
/// # Errors
/// If not.
pub fn check_data<'a>(tasks: impl Iterator<Item = (usize, &'a Task)>, place: &Place) -> Result<(), Error> {
    let has_begun = |task: &Task| place.folder(task).join(DATA_FOLDER).exists();
    let mut datasets: BTreeMap<String, Dataset> = BTreeMap::new();
    let mut known = BTreeSet::new();
    for (number, task) in tasks.filter(|(_, task)| !has_begun(task)) {
        let config = match &task.run {
            Run::Evolve(config, _) => config,
            Run::Train(training) => &training.config,
        };
        let test = task.steps.eval.as_ref().filter(|step| step.split == HeldOut::Test);
        let splits = if test.is_some() { &Split::ALL[..] } else { &[Split::Train] };
        let name = format!("{:?}", (splits, &config.data.dataset, &config.data.dir, &config.data.builtin));
        let dataset = match datasets.entry(name.clone()) {
            Entry::Occupied(loaded) => loaded.into_mut(),
            Entry::Vacant(place_of) => {
                place_of.insert(Whereabouts::given(place.data.as_deref()).load(&config.data, splits)?)
            }
        };
        let named = |error: Error| error.within(&format!("task {number} ({})", task.name));
        match &task.run {
            Run::Evolve(config, _) => {
                training::Training::images(config, dataset).map_err(named)?;
                held_out::check(config, &[], "data.images_per_class", dataset).map_err(named)?;
            }
            Run::Train(training) => {
                train::with_images(training.config.clone(), &[], dataset, &()).map_err(named)?;
            }
        }
        let Some(step) = test.filter(|step| known.insert((name, step.images, config.classes()))) else {
            continue;
        };
        check_test(config, dataset, step.images, "eval.images").map_err(named)?;
    }
    Ok(())
}

/// Whether there are so many test images; `key` says where they are asked for.
///
/// # Errors
/// If not.
pub(crate) fn check_test(
    config: &Config,
    dataset: &Dataset,
    images: HowMany,
    key: &str,
) -> Result<(), Error> {
    let drawn = held_out::test_images(&config.classes(), dataset, images, 1);
    drawn.map(|_| ()).map_err(|error| error.within(&format!("{key} = {images}")))
}

/// Does all tasks here, `jobs` at once; `None`: one per core. One that fails does not stop others.
///
/// # Errors
/// If the folder cannot be made, or there are no images.
pub fn run_all(
    tasks: &[Task],
    place: &Place,
    jobs: Option<usize>,
    stop: &AtomicBool,
    observer: &dyn Observer,
) -> Result<Summary, Error> {
    let is_open = |task: &&Task| {
        let known = TaskFile::read(&place.folder(task).join(TASK_JSON)).ok().flatten();
        !is_done(known.as_ref(), task)
    };
    let numbered: Vec<(usize, &Task)> = (1..).zip(tasks).filter(|(_, task)| is_open(task)).collect();
    check_data(numbered.iter().copied(), place)?;
    std::fs::create_dir_all(&place.out).map_err(|error| Error::writing(&place.out, &error))?;
    let before = tasks.len() - numbered.len();
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = place.threads.unwrap_or_else(cores);
    let jobs = jobs.unwrap_or(threads).min(numbered.len()).max(1);
    let place = Place { threads: Some((threads / jobs).max(1)), ..place.clone() };
    let sum = |tasks: &mut dyn Iterator<Item = &Task>| tasks.map(Task::amount).fold(0, u64::saturating_add);
    let total = sum(&mut tasks.iter());
    let known = total - sum(&mut numbered.iter().map(|(_, task)| *task));
    if !numbered.is_empty() {
        let label =
            format!("{} of {}, {jobs} at once:", numbered.len(), counted(tasks.len(), "task", "tasks"));
        let train = tasks.iter().all(|task| matches!(task.run, Run::Train(_)));
        let unit = if train { "challengers" } else { "generations" };
        observer.begins(&Work { label, total, known, unit });
    }
    let all = All { observer, known, parts: numbered.iter().map(|_| AtomicU64::new(0)).collect() };
    let next = AtomicUsize::new(0);
    let summary = Mutex::new(Summary { done: before, ..Summary::default() });
    let worker = || {
        while !stop.load(Ordering::Relaxed) {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some((number, task)) = numbered.get(index) else { break };
            let part = Part { all: &all, index, amount: task.amount(), name: &task.name };
            let ended = catch_unwind(AssertUnwindSafe(|| run(task, &place, stop, &part)));
            let ended = ended.unwrap_or_else(|_| {
                Err(Error::other("a bug of morphcog; what it said stands above".to_string()))
            });
            let mut summary = summary.lock().unwrap_or_else(PoisonError::into_inner);
            match ended {
                Ok(()) => {
                    summary.done += 1;
                    part.is_at(part.amount);
                    observer.note(&format!(
                        "task {number} ({}): done, {} of {}",
                        task.name,
                        summary.done,
                        tasks.len()
                    ));
                }
                Err(error) if error.kind == ErrorKind::Stopped => {}
                Err(error) if error.kind == ErrorKind::Occupied => summary.elsewhere += 1,
                Err(error) => {
                    let hint = error.hint.as_ref().map_or(String::new(), |hint| format!("; {hint}"));
                    observer.warning(&format!("task {number} ({}) failed: {error}{hint}", task.name));
                    summary.failed.push(*number);
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(worker);
        }
    });
    let mut summary = summary.into_inner().unwrap_or_else(PoisonError::into_inner);
    summary.failed.sort_unstable();
    summary.open = tasks.len() - summary.done - summary.failed.len() - summary.elsewhere;
    Ok(summary)
}

/// One progress over all tasks.
struct All<'o> {
    observer: &'o dyn Observer,
    /// Generations of tasks that were done before.
    known: u64,
    /// Generations done of each other task.
    parts: Vec<AtomicU64>,
}

/// A task's part in it.
struct Part<'a, 'o> {
    all: &'a All<'o>,
    index: usize,
    amount: u64,
    name: &'a str,
}

impl Part<'_, '_> {
    fn is_at(&self, done: u64) {
        let All { observer, known, parts } = self.all;
        parts[self.index].fetch_max(done.min(self.amount), Ordering::Relaxed);
        let done = parts.iter().map(|part| part.load(Ordering::Relaxed));
        observer.progress(done.fold(*known, u64::saturating_add));
    }
}

impl Observer for Part<'_, '_> {
    fn generation(&self, generation: &Generation) {
        self.is_at(generation.done);
    }

    fn finding(&self, _kind: &str, fields: &Value) {
        if let Some(challenger) = fields.get("challenger").and_then(Value::as_u64) {
            self.is_at(challenger);
        }
    }

    fn warning(&self, text: &str) {
        self.all.observer.warning(&format!("{}: {text}", self.name));
    }
}

/// How far a task is, as its folder says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Status {
    /// Its number, from 1.
    pub task: usize,
    /// Its name.
    pub name: String,
    /// How far it is.
    pub state: State,
    /// Generations done, of how many; none for a training.
    pub generations: Option<[u64; 2]>,
    /// Wall-clock time so far \[s\]; of a running task, that of its run as far as it is written.
    pub seconds: Option<f64>,
    /// Time it will probably take still \[s\], as far as that is known.
    pub seconds_left: Option<f64>,
    /// What it failed with, or who is at it.
    pub about: Option<String>,
}

/// How far all tasks are.
///
/// # Errors
/// If a folder cannot be read.
pub fn status(tasks: &[Task], place: &Place) -> Result<Vec<Status>, Error> {
    let mut all = Vec::new();
    for (number, task) in (1..).zip(tasks) {
        all.push(status_of(number, task, &place.folder(task))?);
    }
    // A task of which nothing else is known takes as long as those that are done.
    let done: Vec<f64> = all.iter().filter(|s| s.state == State::Done).filter_map(|s| s.seconds).collect();
    let mean = (!done.is_empty()).then(|| done.iter().sum::<f64>() / done.len() as f64);
    for status in all.iter_mut().filter(|s| s.state != State::Done && s.seconds_left.is_none()) {
        status.seconds_left = mean.map(|mean| (mean - status.seconds.unwrap_or(0.0)).max(0.0));
    }
    Ok(all)
}

fn status_of(number: usize, task: &Task, folder: &Path) -> Result<Status, Error> {
    let known = TaskFile::read(&folder.join(TASK_JSON))?;
    let held = lock::state(&folder.join(TASK_LOCK)).unwrap_or(lock::State::Free);
    let (state, about) = match (&known, held) {
        (_, lock::State::Held(holder)) => (State::Running, holder.map(|holder| holder.to_string())),
        (None, _) => (State::Waiting, None),
        (Some(known), _) if is_done(Some(known), task) => (State::Done, None),
        (Some(TaskFile { state: State::Failed, error, .. }), _) => (State::Failed, error.clone()),
        (Some(TaskFile { state: State::Running, .. }), lock::State::Stale(holder)) => {
            (State::Stopped, Some(format!("{holder} was ended")))
        }
        (Some(_), _) => (State::Stopped, None),
    };
    let (generations, of_run) = match &task.run {
        Run::Evolve(config, _) => {
            let (done, seconds) = last_generation(&folder.join(METRICS)).unwrap_or((0, 0.0));
            (Some([done, config.generations]), Some((done, seconds)).filter(|_| state != State::Waiting))
        }
        Run::Train(_) => (None, None),
    };
    let seconds = match (state, of_run) {
        (State::Waiting, _) => None,
        (State::Running, Some((_, seconds))) => Some(seconds),
        _ => known.map(|known| known.seconds),
    };
    let left = |(done, seconds): (u64, f64)| {
        let todo = task.amount().saturating_sub(done);
        (done > 0 && todo > 0).then(|| seconds * todo as f64 / done as f64)
    };
    let seconds_left = if state == State::Done { Some(0.0) } else { of_run.and_then(left) };
    Ok(Status { task: number, name: task.name.clone(), state, generations, seconds, seconds_left, about })
}

/// Generations that a metrics.csv has, and the wall-clock time they took \[s\]. Only the end of the
/// file is read: a long run's has megabytes.
fn last_generation(path: &Path) -> Option<(u64, f64)> {
    let mut file = std::fs::File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(ROW))).ok()?;
    let mut text = Vec::new();
    file.read_to_end(&mut text).ok()?;
    let text = String::from_utf8_lossy(&text);
    let line = text.split_inclusive('\n').rfind(|line| line.ends_with('\n'))?.trim_end();
    let generation: u64 = line.split(',').next()?.parse().ok()?;
    Some((generation + 1, line.rsplit(',').next()?.parse().ok()?))
}
