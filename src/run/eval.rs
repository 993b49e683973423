//! `morphcog eval`: how well robots do on held-out images (paper, "Generalization test").

use super::archive::{Robot, different};
use super::eval_file::{EVAL_JSON, EVAL_VALIDATION_JSON, EvalFile, RobotReport, Trial};
use super::eval_images::HeldOutImages;
use super::held_out::HeldOut;
use super::robots::{Chosen, Selection, Source};
use super::training::load_dataset_of;
use super::unwritten::Unwritten;
use super::validation::{self, Validated};
use super::whereabouts::Whereabouts;
use super::{Config, Error, folder::check_out, gallery};
use crate::base::Grid;
use crate::base::files::write_atomically;
use crate::sim::System;
use crate::task::dataset::Split;
use crate::task::grouping::{self, Grouping};
use crate::task::protocol::{Life, MAX_STEPS, Protocol};
use crate::task::rollout::{fresh_life, same_to_sensors};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Displacements up to this count as wrong in the paper's test \[voxel lengths\].
pub const THRESHOLD: f64 = 3.0;
/// Actuation cycles per image in the paper's test.
pub const CYCLES: u32 = 10;

/// What to evaluate, and on what.
#[derive(Clone, Debug)]
pub struct Options {
    /// The run.json, or those of several runs that differ in their seeds only; none: the published robots.
    pub archives: Vec<PathBuf>,
    /// Which of its robots.
    pub robots: Selection,
    /// Images in all, evenly divided between the classes.
    pub images: usize,
    /// Which images.
    pub split: HeldOut,
    /// Validation images in all, for a selection by them; `None`: as the config says.
    pub validation: Option<usize>,
    /// Seed of what is drawn: images, and robots with `random:N`.
    pub seed: u64,
    /// Displacements up to this count as wrong \[voxel lengths\].
    pub threshold: f64,
    /// Actuation cycles per image.
    pub cycles: u32,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// Another dataset than the runs', whose test images are shown.
    pub dataset: Option<String>,
    /// Where the results go (eval.json; eval.csv beside it).
    pub out: PathBuf,
    /// Number of threads; `None`: one per core.
    pub threads: Option<usize>,
}

/// Who is told how an evaluation goes.
pub trait Observer: Sync {
    /// Before a validation: so many robots, the best of them on so many images; showings in all.
    fn validating(&self, robots: usize, images: usize, showings: u64);
    /// Before the first life: robots × images.
    fn started(&self, robots: usize, images: usize);
    /// Showings done so far, of robots × images.
    fn progress(&self, done: u64);
    /// Something the user should know.
    fn warning(&self, text: &str);
}

/// Nobody is told.
impl Observer for () {
    fn validating(&self, _robots: usize, _images: usize, _showings: u64) {}
    fn started(&self, _robots: usize, _images: usize) {}
    fn progress(&self, _done: u64) {}
    fn warning(&self, _text: &str) {}
}

/// An evaluation's end.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The content of eval.json.
    pub file: EvalFile,
    /// Why that is not, or not as a whole, in its file, if so.
    pub unwritten: Option<Error>,
}

/// Evaluates robots; results are written after every robot, so that stopping keeps what is finished.
///
/// # Errors
/// What is wrong with archive, data or selection.
pub fn eval(options: &Options, stop: &AtomicBool, observer: &dyn Observer) -> Result<Finished, Error> {
    if !(options.threshold >= 0.0 && options.threshold.is_finite()) {
        return Err(Error::usage(format!(
            "--threshold {}: expected 0 or more voxel lengths",
            options.threshold
        )));
    }
    let sources: Vec<Source> = match options.archives.as_slice() {
        [] => vec![gallery::source(options.data.as_deref(), options.dataset.as_deref())?],
        archives => archives.iter().map(|path| Source::read(path)).collect::<Result<_, _>>()?,
    };
    let first = &sources[0];
    for source in &sources {
        check_out(&options.out, &source.path, own_name(options.split))?;
        same_setting(first, source)?;
    }
    different(sources.iter().map(|source| (source.path.as_path(), &source.run)))?;
    let config = &first.run.config;
    if options.validation.is_some() && options.robots.validated().is_none() {
        let text =
            "--validation: expected with --robots best-validation:N: only those are chosen by such images";
        return Err(Error::usage(text.to_string()));
    }
    let validated = options.validation.unwrap_or(config.validation.images);
    if options.robots.validated().is_some() && validated < validation::LEAST {
        let least = validation::LEAST;
        return Err(Error::usage(format!("--validation {validated}: expected {least} or more images")));
    }
    let grouping = config.grouping()?;
    let other = options.dataset.as_deref().filter(|name| *name != config.data.dataset);
    if other.is_some() && options.split == HeldOut::Validation {
        let text = "--dataset: expected with --split test only: validation images are of the runs' own data";
        return Err(Error::usage(text.to_string()));
    }
    let mut whereabouts = Whereabouts::given(options.data.as_deref());
    for archive in &options.archives {
        whereabouts = whereabouts.and_of(archive);
    }
    let own = |splits: &[Split]| {
        load_dataset_of(Some(&first.run.dataset), config, &whereabouts, splits).map_err(|error| {
            let hint =
                error.hint.clone().unwrap_or("name the folder of the run's data with --data".to_string());
            error.hint(format!("{hint}; robots are shown another dataset's images with --dataset NAME"))
        })
    };
    let dataset = match other {
        None => own(&Split::ALL)?,
        Some(name) => whereabouts.load(&config.data.of(name), &Split::ALL)?,
    };
    let robots = options.robots.of(&sources, options.seed)?;
    let (robots, unskilled): (Vec<Chosen>, Vec<Chosen>) =
        robots.into_iter().partition(|chosen| task_of(&grouping, chosen.robot).is_some());
    if let Some(chosen) = unskilled.first().filter(|_| !robots.is_empty()) {
        let (count, id) = (unskilled.len(), &chosen.robot.id);
        observer.warning(&format!("{count} robots ({id} …) walk the same way for every class; left out"));
    }
    if robots.is_empty() {
        let text = "there is no robot to evaluate: those selected walk the same way for every class";
        return Err(Error::input(text.to_string()));
    }
    let shown = HeldOutImages::draw(config, &sources, &dataset, options)?;
    let test_sha256 = dataset.fingerprint(Split::Test).unwrap_or_default();
    let steps = checked_steps(config, options.cycles)?;
    let mut report = EvalFile::new(&sources, options, steps, &shown.images, test_sha256);
    if let Some(name) = other {
        report.transfer(name, &dataset);
    }
    let splits = robots.iter().filter_map(|chosen| task_of(&grouping, chosen.robot));
    report.baselines = shown.baselines(&sources, splits)?;
    let pool = pool(options.threads)?;
    let walker =
        || Walker { config, control_steps: steps, pool: &pool, stop, observer, done: AtomicU64::new(0) };
    let (robots, scores): (Vec<Chosen>, Vec<Validated>) = match options.robots.validated() {
        None => (robots, Vec::new()),
        Some(count) => {
            let wanted = validation::Wanted { count, images: validated, threshold: options.threshold };
            // Which images are for validation is known by their indices, in the run's own data only.
            let others = other.map(|_| own(&[Split::Train])).transpose()?;
            let Some(best) = validation::chosen(
                &sources,
                &robots,
                &options.robots,
                others.as_ref().unwrap_or(&dataset),
                &grouping,
                &wanted,
                &walker,
            )?
            else {
                report.stopped = true;
                return Ok(Finished { file: report, unwritten: None });
            };
            best.into_iter().unzip()
        }
    };
    observer.started(robots.len(), shown.images.len());
    let walker = walker();
    let mut scores = scores.into_iter();
    let mut left = robots.len();
    report.stopped = left > 0;
    let mut unwritten = Unwritten::default();
    for Chosen { source, robot } in robots {
        let Some(split) = task_of(&grouping, robot) else { continue };
        let Some((displacements, simulated)) = walker.lives(robot, &shown.stimuli) else { break };
        left -= 1;
        report.stopped = left > 0;
        let run = &sources[source].run;
        let trial = Trial { run, robot, split, images: &shown.images, threshold: options.threshold };
        let (validation, of_trial) = (scores.next(), RobotReport::new(&trial, displacements, simulated));
        report.robots.push(RobotReport { run: source, validation, ..of_trial });
        report.conclude();
        unwritten.tried(write(options, &report), |text| observer.warning(text));
    }
    Ok(Finished { file: report, unwritten: unwritten.error() })
}

/// So many threads; `None`: one per core.
pub(super) fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|error| Error::other(format!("no threads: {error}")))
}

/// The name of the results beside a run.json if nobody says otherwise.
pub fn own_name(split: HeldOut) -> &'static str {
    match split {
        HeldOut::Test => EVAL_JSON,
        HeldOut::Validation => EVAL_VALIDATION_JSON,
    }
}

/// Whether robots of two runs can be tested together: what they are shown, and where they live, is the same.
fn same_setting(first: &Source, other: &Source) -> Result<(), Error> {
    let (a, b) = (&first.run.config, &other.run.config);
    let of_data = |config: &Config| (config.data.dataset.clone(), config.data.builtin.clone());
    let differing = [
        ("task", a.task != b.task),
        ("body", a.body != b.body),
        ("stimulus", a.stimulus != b.stimulus),
        ("protocol", a.protocol != b.protocol),
        ("physics", a.physics != b.physics),
        ("data", of_data(a) != of_data(b) || first.run.dataset != other.run.dataset),
    ];
    match differing.into_iter().find(|(_, differs)| *differs) {
        None => Ok(()),
        Some((section, _)) => {
            let (other, first) = (other.path.display(), first.path.display());
            let text = format!("{other}: expected the same [{section}] in its config as {first}");
            Err(Error::input(text).hint("evaluate runs of different experiments one by one".to_string()))
        }
    }
}

/// Control steps of so many actuation cycles.
pub(super) fn control_steps(config: &Config, cycles: u32) -> u32 {
    cycles.saturating_mul(config.physics.cycle_steps)
}

/// The same, if a robot can be shown an image for so long.
fn checked_steps(config: &Config, cycles: u32) -> Result<u32, Error> {
    let steps = control_steps(config, cycles);
    match steps <= MAX_STEPS {
        true => Ok(steps),
        false => {
            let most = MAX_STEPS / config.physics.cycle_steps;
            Err(Error::usage(format!(
                "--cycles {cycles}: expected at most {most}, {MAX_STEPS} control steps"
            )))
        }
    }
}

/// The recognition task a robot performs; none if it always walks the same way.
pub(super) fn task_of<'a>(grouping: &'a Grouping, robot: &Robot) -> Option<&'a grouping::Split> {
    grouping.tasks().iter().find(|split| split.name() == robot.task && !split.is_same_way())
}

fn write(options: &Options, report: &EvalFile) -> Result<(), Error> {
    let csv_path = options.out.with_extension("csv");
    let csv = report.to_csv().map_err(|error| Error::other(error.to_string()))?;
    for (path, content) in [(&options.out, report.to_json().into_bytes()), (&csv_path, csv)] {
        write_atomically(path, &content).map_err(|error| Error::writing(path, &error))?;
    }
    Ok(())
}

/// Shows images to robots.
pub(super) struct Walker<'a> {
    pub config: &'a Config,
    /// Of one showing.
    pub control_steps: u32,
    pub pool: &'a rayon::ThreadPool,
    pub stop: &'a AtomicBool,
    pub observer: &'a dyn Observer,
    /// Showings so far.
    pub done: AtomicU64,
}

impl Walker<'_> {
    /// A validation begins; see [`Observer::validating`].
    pub fn validating(&self, robots: usize, images: usize, showings: u64) {
        self.observer.validating(robots, images, showings);
    }

    /// The displacement under each image (`None`: unstable), and the number of lives it took: images that show the sensors
    /// the same pixels are one life. `None` if stopped before the end.
    pub fn lives(&self, robot: &Robot, stimuli: &[Grid<f64>]) -> Option<(Vec<Option<f64>>, usize)> {
        let Walker { config, stop, observer, done, .. } = self;
        let protocol =
            Protocol { life: Life::Fresh, control_steps: self.control_steps, ..config.protocol.clone() };
        let system = Arc::new(System::new(&robot.body, config.physics.clone()));
        let views: Vec<&Grid<f64>> = stimuli.iter().collect();
        let same_as = same_to_sensors(&robot.body, &views);
        let mut shared = BTreeMap::<usize, u64>::new();
        same_as.iter().for_each(|&first| *shared.entry(first).or_default() += 1);
        let life = |(&image, &count): (&usize, &u64)| {
            let displacement = fresh_life(&system, &protocol, &stimuli[image], stop).ok()?.ok();
            observer.progress(done.fetch_add(count, Ordering::Relaxed) + count);
            Some((image, displacement))
        };
        let lives: Option<BTreeMap<usize, Option<f64>>> =
            self.pool.install(|| shared.par_iter().map(life).collect());
        let lives = lives?;
        Some((same_as.iter().map(|first| lives.get(first).copied().flatten()).collect(), lives.len()))
    }
}
