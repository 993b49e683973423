//! `morphcog evolve`: MAP-Elites over bodies, resumable, the same bits however it is run.

mod judging;
mod saving;

use super::archive::{Dimensions, Robot};
use super::checkpoint::{Checkpoint, KnownBodies};
use super::curriculum::Period;
use super::folder::{self, IfExists, RunFolder};
use super::keep::Floors;
use super::metrics::{Metrics, Totals};
use super::relatives::Relatives;
pub use super::session::{Finished, Observer, Options, Progress};
use super::start::{Start, StartRef};
use super::train::TRAINING_JSON;
use super::training::Training;
use super::variation::{Lessons, Mutations, unmade};
use super::whereabouts::{self, Whereabouts};
use super::{Error, ErrorKind, eval, held_out, resume, validation};
use crate::base::files::write_atomically;
use crate::base::stop::check;
use crate::body::Body;
use crate::qd::{Archive, ArchiveStats, DescriptorSpace, MapElites, Proposal};
use crate::task::dataset::{Dataset, Split};
use crate::task::evaluation::{Job, Outcome, evaluate};
use crate::task::grouping::Grouping;
use rayon::prelude::*;
use std::mem::{replace, take};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Lives, or a few more, of elites that are evaluated at the beginning of a period between two looks at whether to stop: few
/// enough for nobody to wait long. What is simulated depends on it, so not on the number of threads.
const LIVES_AT_ONCE: usize = 256;

/// Runs a config, or goes on with a run, and at its end chooses robots on validation images if the config says so. When `stop`
/// is set, a generation under way, or the beginning of a stage, is dropped: the run is saved as it was before.
///
/// # Errors
/// What is wrong with config, data or folder; nothing that was there is lost.
pub fn evolve(
    options: &Options,
    stop: &AtomicBool,
    observer: &mut (dyn Observer + Send),
) -> Result<Finished, Error> {
    let config = &options.config;
    if options.if_exists == IfExists::Resume && options.out.join(TRAINING_JSON).exists() {
        let text = format!("{}: the run in this folder is a training", options.out.display());
        return Err(Error::occupied(text).hint("go on with it by morphcog train --resume".to_string()));
    }
    let mut whereabouts = Whereabouts::given(options.data.as_deref());
    if options.if_exists == IfExists::Resume {
        whereabouts = whereabouts.and_of(&options.out.join(folder::RUN_JSON));
    }
    let dataset = whereabouts.load(&config.data, &[Split::Train])?;
    // Whether there are images and bodies for it is to be known before anything is written.
    let first = Training::unless(config, &dataset, config.period(0), stop)?;
    for stage in (0..config.stage.len()).map(|stage| Period { stage, draw: 0 }) {
        Training::unless(config, &dataset, stage, stop)?;
    }
    Mutations { seed: config.seed, spec: config.body_spec(), params: &config.genome, lessons: None, stop }
        .check()?;
    let resumes = options.if_exists == IfExists::Resume;
    // A run that goes on may have begun, and then has its elites: that is not known before its folder is open.
    let may_have_begun = resumes && options.out.exists();
    let start = if may_have_begun { None } else { Start::read(config, &dataset)? };
    if !may_have_begun {
        held_out::check(config, start.as_ref().map(|start| &start.origin), &dataset)?;
    }
    let folder = RunFolder::open(&options.out, options.if_exists)?;
    let saved = match resumes {
        true => resume::saved(&folder, config, &dataset, stop, |text| observer.warning(&text))?,
        false => None,
    };
    // One without a generation has counted nothing that counts: its start is evaluated again.
    let saved = saved.filter(|saved| saved.run.generations > 0);
    let start = if may_have_begun && saved.is_none() { Start::read(config, &dataset)? } else { start };
    if may_have_begun {
        let origin = saved.as_ref().and_then(|saved| saved.run.start.as_ref());
        held_out::check(config, origin.or(start.as_ref().map(|start| &start.origin)), &dataset)?;
    }
    let write = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        write_atomically(&path, content).map_err(|error| Error::writing(&path, &error))
    };
    // A config that says the same stays as it is, with its comments: it may be what this run was asked for with.
    let there = super::Config::load(&folder.path().join(folder::CONFIG).to_string_lossy(), &[]);
    if there.ok().as_ref() != Some(config) {
        write(folder::CONFIG, config.to_toml().as_bytes())?;
    }
    whereabouts::remember(&folder, &dataset)?;
    let pool = eval::pool(options.threads)?;
    let mut run = Run::new(options, &dataset, first, saved, stop)?;
    let mut metrics = Metrics::open(folder.path(), run.generation)?;
    if metrics.missing > 0 {
        let (path, missing) = (folder.path().join(folder::METRICS).display().to_string(), metrics.missing);
        observer.warning(&format!("{path}: {missing} of {} generations are missing in it", run.generation));
    }
    pool.install(|| run.live(start, &folder, &mut metrics, stop, observer)).map_err(goes_on)?;
    let unwritten = metrics.flush().and_then(|()| run.save(&folder)).err().map(goes_on);
    let (file, totals) = (run.file(), run.totals());
    let is_whole = run.generation >= config.generations;
    // Those of a run that is not in its file would be chosen from another.
    let chooses = is_whole && unwritten.is_none() && config.validation.best > 0 && !file.elites.is_empty();
    let validated = match chooses {
        true => {
            let archive = folder.path().join(folder::RUN_JSON);
            validation::at_end(&archive, &dataset, &pool, stop, &*observer.validation())?
        }
        false => Some(Vec::new()),
    };
    let stopped = !is_whole || validated.is_none();
    Ok(Finished { run: file, totals, validated: validated.unwrap_or_default(), stopped, unwritten })
}

/// An error, if it is one of a full disk, with how to go on when there is space again.
fn goes_on(error: Error) -> Error {
    match &error.hint {
        Some(hint) if error.kind == ErrorKind::Other => {
            let hint = format!("{hint}; with --resume the same command goes on from the last checkpoint");
            error.hint(hint)
        }
        _ => error,
    }
}

/// A run under way.
struct Run<'a> {
    options: &'a Options,
    dataset: &'a Dataset,
    /// What is being trained on, and since when it is.
    period: Period,
    training: Training,
    grouping: Grouping,
    space: DescriptorSpace,
    dimensions: Dimensions,
    search: MapElites<Robot>,
    known: KnownBodies,
    relatives: Relatives,
    totals: Totals,
    /// The archive it started from.
    origin: Option<StartRef>,
    /// Generations done.
    generation: u64,
    began: Instant,
}

/// What a run was before a period began.
type Before = (Period, Training, Grouping, MapElites<Robot>, KnownBodies, Relatives, Totals);

impl<'a> Run<'a> {
    fn new(
        options: &'a Options,
        dataset: &'a Dataset,
        first: Training,
        saved: Option<Checkpoint>,
        stop: &AtomicBool,
    ) -> Result<Self, Error> {
        let config = &options.config;
        let (archive, known, relatives, totals, generation, origin) = match saved {
            Some(Checkpoint { run, totals, known_bodies, relatives }) => {
                (run.archive()?, known_bodies, relatives, totals, run.generations, run.start)
            }
            None => Default::default(),
        };
        let latest = generation.saturating_sub(1);
        let period = config.period(latest);
        let grouping = config.grouping()?.with_fitness(config.criterion(latest));
        let training =
            if period == config.period(0) { first } else { Training::unless(config, dataset, period, stop)? };
        Ok(Run {
            options,
            dataset,
            period,
            training,
            space: DescriptorSpace::voxel_counts(grouping.tasks().len()),
            dimensions: Dimensions::of(config)?,
            grouping,
            search: MapElites::new(config.seed, config.map_elites.clone(), archive),
            known,
            relatives,
            totals,
            origin,
            generation,
            began: Instant::now(),
        })
    }

    /// Counts so far, with the time of this session.
    fn totals(&self) -> Totals {
        Totals { seconds: self.totals.seconds + self.began.elapsed().as_secs_f64(), ..self.totals }
    }

    fn progress(&self) -> Progress {
        let (done, generations) = (self.generation, self.options.config.generations);
        Progress { done, generations, stats: self.stats(), totals: self.totals() }
    }

    fn stats(&self) -> ArchiveStats {
        self.search.archive().stats(self.dimensions.possible_cells, self.options.config.archive.qd_offset)
    }

    fn live(
        &mut self,
        start: Option<Start>,
        folder: &RunFolder,
        metrics: &mut Metrics,
        stop: &AtomicBool,
        observer: &mut (dyn Observer + Send),
    ) -> Result<(), Error> {
        let config = &self.options.config;
        observer.started(folder, &self.training, &self.progress());
        let every = Duration::try_from_secs_f64(config.checkpoint.seconds).unwrap_or(Duration::MAX);
        let mut saved = Instant::now();
        if let Some(Start { origin, robots }) = start {
            observer.starting_from(&origin, robots.len());
            self.origin = Some(origin);
            if self.begin(self.period, robots, stop)?.is_none() {
                return Ok(());
            }
            observer.period(self.period, &self.training, &self.progress());
        }
        while self.generation < config.generations && !stop.load(Ordering::Relaxed) {
            let period = config.period(self.generation);
            let mut before_period = None;
            if period != self.period {
                // In the order of their cells: of equals that now share a cell the first stays.
                let mut before = self.search.archive().clone();
                if let Some(most) = config.start_with(period) {
                    before.retain_fittest(most, |robot| robot.task.clone());
                }
                let elites = before.elites().map(|elite| elite.solution.clone()).collect();
                before_period = self.begin(period, elites, stop)?;
                if before_period.is_none() {
                    break;
                }
                observer.period(period, &self.training, &self.progress());
            }
            match self.next_generation(stop) {
                Err(error) if error.kind == ErrorKind::Stopped => {
                    // What is saved is of the period of its last generation.
                    before_period.into_iter().for_each(|before| self.go_back(before));
                    break;
                }
                done => done?,
            }
            let progress = self.progress();
            metrics.write((self.generation - 1, period.stage), &progress.stats, &progress.totals)?;
            observer.generation(&progress);
            if self.generation.is_multiple_of(config.checkpoint.generations) || saved.elapsed() >= every {
                metrics.flush()?;
                self.save(folder)?;
                saved = Instant::now();
            }
        }
        Ok(())
    }

    /// Begins a period: other images, perhaps another fitness, and elites of before evaluated anew. What there was before; `None`
    /// if stopped meanwhile: nothing has changed then.
    fn begin(
        &mut self,
        period: Period,
        mut elites: Vec<Robot>,
        stop: &AtomicBool,
    ) -> Result<Option<Before>, Error> {
        let config = &self.options.config;
        let training = match Training::unless(config, self.dataset, period, stop) {
            Err(error) if error.kind == ErrorKind::Stopped => return Ok(None),
            training => training?,
        };
        let grouping = config.grouping()?.with_fitness(config.criterion(self.generation));
        if config.keep(period).is_some() {
            // The fitter ones first: of those who come after, most are told early that they cannot stay.
            elites.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        }
        let search = MapElites::new(config.seed, config.map_elites.clone(), Archive::new());
        let before = (
            replace(&mut self.period, period),
            replace(&mut self.training, training),
            replace(&mut self.grouping, grouping),
            replace(&mut self.search, search),
            take(&mut self.known),
            take(&mut self.relatives),
            self.totals,
        );
        let is_gait = config.measures_response(period);
        elites.retain(|robot| self.known.insert(config.known_key(&robot.body, period)) || !is_gait);
        self.totals.evaluations += elites.len() as u64;
        let at_once = LIVES_AT_ONCE.div_ceil(self.training.images.len().max(1));
        let mut elites = (0..).zip(elites).map(|(number, robot)| (number, None, robot)).peekable();
        while elites.peek().is_some() {
            match self.evaluate(elites.by_ref().take(at_once).collect(), None, stop) {
                Err(error) if error.kind == ErrorKind::Stopped => {
                    self.go_back(before);
                    return Ok(None);
                }
                done => done?,
            }
        }
        Ok(Some(before))
    }

    /// As it was before a period began.
    fn go_back(&mut self, before: Before) {
        (self.period, self.training, self.grouping, self.search, self.known, self.relatives, self.totals) =
            before;
    }

    /// Makes, evaluates and tells one generation.
    ///
    /// # Errors
    /// Of kind [`ErrorKind::Stopped`] if it was stopped meanwhile: all is then as it was before.
    fn next_generation(&mut self, stop: &AtomicBool) -> Result<(), Error> {
        let config = &self.options.config;
        let params = config.mutation_in(self.period);
        let lessons = Some(Lessons {
            training: &self.training,
            grouping: &self.grouping,
            physics: &config.physics,
            relatives: &self.relatives,
        });
        let mutations =
            Mutations { seed: config.seed, spec: config.body_spec(), params: &params, lessons, stop };
        let proposals = self.search.ask(self.generation);
        let make = |&proposal: &Proposal| {
            check(stop)?;
            self.search.make(proposal, &mutations).map_err(unmade)
        };
        let robots = proposals.par_iter().map(make).collect::<Result<Vec<Robot>, Error>>()?;
        let before = self.totals;
        self.totals.evaluations += robots.len() as u64;

        let saves_known = config.savings_in(self.period).known_bodies;
        let (images, mut fresh, mut new) = (self.training.stimuli.len() as u64, Vec::new(), Vec::new());
        for (proposal, robot) in proposals.iter().zip(robots) {
            let key = config.known_key(&robot.body, self.period);
            let is_new = self.known.insert(key);
            if is_new {
                new.push(key);
            }
            if is_new || !saves_known {
                fresh.push((proposal.child, proposal.parent, robot));
            } else {
                self.totals.saved_known_bodies += images;
            }
        }
        if let Err(error) = self.evaluate(fresh, config.threshold_min(self.period), stop) {
            self.totals = before;
            new.iter().for_each(|key| self.known.remove(key));
            return Err(error);
        }
        let bodies: Vec<&Body> = self.search.archive().elites().map(|elite| &elite.solution.body).collect();
        self.relatives.keep(&bodies, usize::from(params.voxel_relatives));
        self.generation += 1;
        Ok(())
    }

    /// Evaluates robots, each with its number and its parent's cell, counts that, and puts those into the archive who walked
    /// and are fit enough, fitter than `least` in any case. If it is stopped meanwhile, nothing is counted or put there.
    fn evaluate(
        &mut self,
        robots: Vec<(u64, Option<usize>, Robot)>,
        least: Option<f64>,
        stop: &AtomicBool,
    ) -> Result<(), Error> {
        let config = &self.options.config;
        let Training { stimuli, conditions, .. } = &self.training;
        let floors = Floors::of(self.search.archive(), &self.grouping, config.keep(self.period), least);
        let probes: Vec<Body> = match config.measures_response(self.period) {
            true => robots.iter().map(|(_, _, robot)| robot.body.probe()).collect(),
            false => Vec::new(),
        };
        let jobs = robots.iter().map(|(_, parent, robot)| self.job(*parent, robot, &floors));
        let mut jobs: Vec<Job> = jobs.collect();
        jobs.iter_mut().zip(&probes).for_each(|(job, probe)| job.body = probe);
        let savings = config.savings_in(self.period);
        let evaluations =
            evaluate(&jobs, stimuli, conditions, &config.physics, &config.protocol, savings, stop)?;
        drop(jobs);

        let mut told = Vec::new();
        let relatives = usize::from(config.mutation_in(self.period).voxel_relatives);
        for ((child, _, robot), evaluation) in robots.into_iter().zip(evaluations) {
            self.totals.count(&evaluation);
            if relatives > 0
                && let Some(known) = evaluation.outcome.known()
            {
                self.relatives.add(&robot.body, known);
            }
            match evaluation.outcome {
                Outcome::Walked(displacements) => {
                    told.extend(self.scored(child, robot, displacements, &floors))
                }
                Outcome::Unstable(_) => self.totals.unstable += 1,
                Outcome::Stopped(_) => {}
            }
        }
        self.search.tell(told).map_err(|error| Error::other(error.to_string()))?;
        if let Some(keep) = config.keep(self.period) {
            self.search.retain_fittest(keep, |robot| robot.task.clone());
        }
        Ok(())
    }
}
