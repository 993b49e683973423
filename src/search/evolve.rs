//! The loop of evolution: ask, vary, score, tell.

use crate::base::error::{Error, ErrorKind};
use crate::base::observer::Generation;
use crate::base::random::{Purpose, stream};
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::body::Body;
use crate::config::Config;
use crate::genome::{BodySpec, Genome, GenomeError, MutationParams};
use crate::images::training::TrainingImages;
use crate::qd::{ArchiveStats, DescriptorSpace, Evaluated, MapElites, Proposal, Variation};
use crate::store::checkpoint;
use crate::store::checkpoint::{Checkpoint, KnownBodies};
use crate::store::folder::RunFolder;
use crate::store::metrics::{Metrics, Totals};
use crate::store::run::{Dimensions, Robot, RunFile};
use crate::task::evaluation::{Evaluation, Job, Outcome, evaluate};
use crate::task::grouping::Grouping;
use rayon::prelude::*;
use std::path::Path;
use std::time::{Duration, Instant};

/// Interval at which lines of `metrics.csv` reach the file, for those who watch it.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// Least time between timed checkpoints, in costs of the last one: at most two percent of the time.
const MOST_SHARE: u32 = 50;

pub(crate) struct Files {
    pub(crate) folder: RunFolder,
    pub(crate) metrics: Metrics,
}

impl Files {
    /// Writes metrics, checkpoint, `run.json` and `elites.csv`.
    pub(crate) fn save(&mut self, run: &Run) -> Result<(), Error> {
        self.metrics.sync()?;
        run.save(&self.folder)
    }
}

pub(crate) struct Run<'a> {
    config: &'a Config,
    name: &'a str,
    pub(crate) session: &'a Session<'a>,
    training: TrainingImages,
    grouping: Grouping,
    space: DescriptorSpace,
    dimensions: Dimensions,
    search: MapElites<Robot>,
    known: KnownBodies,
    totals: Totals,
    pub(crate) generation: u64,
    began: Instant,
}

/// A robot to be evaluated: its number in the generation, its parent's cell, and itself.
type Child = (u64, Option<usize>, Robot);

impl<'a> Run<'a> {
    pub(crate) fn new(
        (config, name): (&'a Config, &'a str),
        session: &'a Session,
        training: TrainingImages,
        saved: Option<Checkpoint>,
    ) -> Result<Self, Error> {
        let (archive, known, totals, generation) = match saved {
            Some(Checkpoint {
                run,
                totals,
                known_bodies,
            }) => (run.archive()?, known_bodies, totals, run.generations),
            None => Default::default(),
        };
        let grouping = config.grouping()?.with_fitness(config.evaluation.fitness);
        Ok(Run {
            config,
            name,
            session,
            training,
            space: DescriptorSpace::voxel_counts(grouping.tasks().len()),
            dimensions: Dimensions::of(config)?,
            grouping,
            search: MapElites::new(config.seed, config.map_elites.clone(), archive),
            known,
            totals,
            generation,
            began: Instant::now(),
        })
    }

    /// Says what begins in a folder.
    pub(crate) fn beginning(&self, out: &Path) -> String {
        let verb = if self.generation > 0 {
            "going on with"
        } else {
            "evolving in"
        };
        let (out, dataset) = (out.display(), &self.training.dataset.name);
        format!(
            "{verb} {out}; images from {dataset}: {}",
            self.training.listed()
        )
    }

    /// Repeats ask, evaluate, tell. A stopped generation leaves the run as it was before.
    pub(crate) fn evolve(
        &mut self,
        mutations: &Mutations,
        files: &mut Option<Files>,
        session: &Session,
    ) -> Result<(), Error> {
        let config = self.config;
        session.observer.generation(&self.progress());
        let every = Duration::try_from_secs_f64(config.checkpoint.seconds).unwrap_or(Duration::MAX);
        if let Some(files) = files.as_mut().filter(|_| self.generation == 0) {
            // A watcher of the folder sees at once what has begun.
            files.save(self)?;
        }
        let [mut saved, mut flushed] = [Instant::now(); 2];
        let mut cost = Duration::ZERO;
        while self.generation < config.generations {
            match self.next_generation(mutations, session) {
                Err(error) if error.kind == ErrorKind::Stopped => break,
                done => done?,
            }
            if let Some(files) = files {
                files
                    .metrics
                    .write(self.generation - 1, &self.stats(), &self.totals())?;
            }
            session.observer.generation(&self.progress());
            let Some(files) = files else { continue };
            let is_due = saved.elapsed() >= every.max(cost * MOST_SHARE);
            if is_due
                || self
                    .generation
                    .is_multiple_of(config.checkpoint.generations)
            {
                let began = Instant::now();
                files.save(self)?;
                cost = began.elapsed();
                [saved, flushed] = [Instant::now(); 2];
            } else if flushed.elapsed() >= FLUSH_EVERY {
                files.metrics.flush()?;
                flushed = Instant::now();
            }
        }
        Ok(())
    }

    /// Makes, evaluates and adds a generation. Each rank evaluates only its share. If it was
    /// stopped, the run is as it was before.
    fn next_generation(&mut self, mutations: &Mutations, session: &Session) -> Result<(), Error> {
        let proposals = self.search.ask(self.generation);
        let make = |&proposal: &Proposal| {
            session.check()?;
            self.search.make(proposal, mutations).map_err(unmade)
        };
        let robots = proposals
            .par_iter()
            .map(make)
            .collect::<Result<Vec<Robot>, Error>>();
        let robots = self.together(robots)?;
        let children = proposals
            .iter()
            .zip(robots)
            .map(|(asked, robot)| (asked.child, asked.parent, robot));
        let children: Vec<Child> = children.collect();
        let count = children.len() as u64;
        let (fresh, new) = self.unknown(children);
        let saved = (count - fresh.len() as u64) * self.training.stimuli.len() as u64;
        let evaluations = match self.scored(&fresh, session) {
            Ok(evaluations) => evaluations,
            Err(error) => {
                new.iter().for_each(|key| self.known.remove(key));
                return Err(error);
            }
        };
        self.totals.evaluations += count;
        self.totals.saved_known_bodies += saved;
        self.tell(fresh, evaluations)?;
        self.generation += 1;
        Ok(())
    }

    /// Returns the children to evaluate, and the keys of the bodies that are new.
    fn unknown(&mut self, children: Vec<Child>) -> (Vec<Child>, Vec<[u8; 16]>) {
        let config = self.config;
        let objective = config.objective();
        let saves_known = config.savings.known_bodies || !objective.may_repeat();
        let (mut fresh, mut new) = (Vec::new(), Vec::new());
        for child in children {
            let key = objective.known_key(&child.2.body);
            let is_new = self.known.insert(key);
            if is_new {
                new.push(key);
            }
            if is_new || !saves_known {
                fresh.push(child);
            }
        }
        (fresh, new)
    }

    /// Shows the training images to what is simulated for children.
    fn scored(&self, children: &[Child], session: &Session) -> Result<Vec<Evaluation>, Error> {
        let config = self.config;
        let TrainingImages {
            stimuli,
            conditions,
            ..
        } = &self.training;
        let simulated =
            |(_, _, robot): &'_ Child| config.objective().simulated(&robot.body).into_owned();
        let bodies: Vec<Body> = children.iter().map(simulated).collect();
        let thresholds = self.admission_thresholds();
        let children = children.iter().zip(&bodies);
        let jobs: Vec<Job> = children
            .map(|((_, parent, robot), body)| self.job(*parent, robot, body, &thresholds))
            .collect();
        let (physics, protocol) = (&config.physics, &config.protocol);
        let ranks = self.session.ranks;
        let sizes: Vec<u64> = jobs
            .iter()
            .map(|job| job.body.counts().total as u64)
            .collect();
        let evaluate = |jobs: &[Job]| {
            evaluate(
                jobs,
                stimuli,
                conditions,
                physics,
                protocol,
                config.savings,
                session,
            )
            .ok()
        };
        // If one rank drops a generation, all do.
        Ok(ranks
            .scatter_gather(jobs, &sizes, evaluate)
            .ok_or(Stopped)?)
    }

    /// Returns this rank's own result if all ranks have one.
    fn together<T>(&self, own: Result<T, Error>) -> Result<T, Error> {
        let is_made = own.is_ok();
        let are_made = self.session.ranks.share(is_made);
        let own = own?;
        if are_made.contains(&false) {
            Err(Stopped.into())
        } else {
            Ok(own)
        }
    }

    fn tell(&mut self, children: Vec<Child>, evaluations: Vec<Evaluation>) -> Result<(), Error> {
        let thresholds = self.admission_thresholds();
        let mut told = Vec::new();
        for ((child, _, robot), evaluation) in children.into_iter().zip(evaluations) {
            self.totals.count(&evaluation);
            match evaluation.outcome {
                Outcome::Walked(displacements) => {
                    told.extend(self.judged(child, robot, displacements, &thresholds))
                }
                Outcome::Unstable(_) => self.totals.unstable += 1,
                Outcome::Stopped(_) => {}
            }
        }
        self.search
            .tell(told)
            .map_err(|error| Error::other(error.to_string()))?;
        if let Some(keep) = self.config.archive.keep {
            self.search.retain_fittest(keep, |robot| robot.task.clone());
        }
        Ok(())
    }

    /// Makes the job that evaluates a robot by simulating `body`; `parent` is the cell of its parent.
    fn job<'b>(
        &'b self,
        parent: Option<usize>,
        robot: &Robot,
        body: &'b Body,
        thresholds: &[Option<f64>],
    ) -> Job<'b> {
        let (archive, training, grouping) = (self.search.archive(), &self.training, &self.grouping);
        let objective = self.config.objective();
        let factor = objective.factor(&robot.body);
        let bins = robot.bins();
        let to_beat = |task: usize| {
            let cell = self.space.index(&self.cell(bins.clone(), task));
            let in_cell = cell.and_then(|cell| archive.objective(cell));
            in_cell
                .into_iter()
                .chain(thresholds[task])
                .reduce(f64::max)
                .map(|least| least / factor)
        };
        let to_beat: Vec<Option<f64>> = (0..grouping.tasks().len()).map(to_beat).collect();
        let of_parent = parent
            .and_then(|cell| archive.get(cell))
            .map(|elite| training.answers(elite.solution.displacements.iter().copied().map(Some)));
        let (order, given_up) = (
            objective.order(grouping, of_parent.as_deref()),
            objective.given_up(&to_beat),
        );
        let may_win = move |known: &[Option<f64>]| {
            grouping.can_still_win(&training.answers(known.iter().copied()), |task| {
                to_beat[task]
            })
        };
        Job {
            body,
            order,
            may_win: Box::new(may_win),
            given_up,
        }
    }

    /// Scores a robot for the archive; `None` if `archive.keep` would remove it at once.
    fn judged(
        &self,
        child: u64,
        robot: Robot,
        displacements: Vec<f64>,
        thresholds: &[Option<f64>],
    ) -> Option<Evaluated<Robot>> {
        let answers = self
            .training
            .answers(displacements.iter().copied().map(Some));
        let score = self.grouping.score(&answers);
        let coordinates = self.cell(robot.bins(), score.task);
        let cell = self
            .space
            .index(&coordinates)
            .expect("the coordinates are bins of this very space");
        let task = self.grouping.tasks()[score.task].name();
        let objective = self.config.objective().factor(&robot.body) * score.fitness;
        let solution = Robot {
            cell: coordinates,
            task,
            objective,
            displacements,
            ..robot
        };
        let is_in = thresholds[score.task].is_none_or(|threshold| objective > threshold);
        is_in.then_some(Evaluated {
            child,
            cell,
            objective,
            solution,
        })
    }

    /// Returns by task the fitness of the last elite that `archive.keep` keeps; `None` with fewer.
    /// It never decreases, so early stop and known bodies stay lossless.
    fn admission_thresholds(&self) -> Vec<Option<f64>> {
        let keep = self.config.archive.keep;
        let last = |name: String| {
            self.search
                .archive()
                .nth_fittest(keep?, |robot| robot.task == name)
        };
        self.grouping
            .tasks()
            .iter()
            .map(|task| last(task.name()))
            .collect()
    }

    fn cell(&self, mut bins: Vec<usize>, task: usize) -> Vec<usize> {
        bins.extend((self.grouping.tasks().len() > 1).then_some(task));
        bins
    }

    /// Returns the counts so far, including the time of this session.
    pub(crate) fn totals(&self) -> Totals {
        Totals {
            seconds: self.totals.seconds + self.began.elapsed().as_secs_f64(),
            ..self.totals
        }
    }

    fn progress(&self) -> Generation {
        let stats = self.stats();
        Generation {
            done: self.generation,
            total: self.config.generations,
            best: stats.obj_max,
            coverage: stats.coverage,
            evaluations: self.totals.evaluations,
            qd_score: stats.qd_score,
        }
    }

    fn stats(&self) -> ArchiveStats {
        self.search.archive().stats(
            self.dimensions.possible_cells,
            self.config.archive.qd_offset,
        )
    }

    /// Writes checkpoint, `run.json` and `elites.csv`.
    pub(crate) fn save(&self, folder: &RunFolder) -> Result<(), Error> {
        let checkpoint = Checkpoint {
            run: self.file(),
            totals: self.totals(),
            known_bodies: self.known.clone(),
        };
        checkpoint::write(folder.path(), &checkpoint)?;
        folder.write_run(&checkpoint.run)
    }

    pub(crate) fn file(&self) -> RunFile {
        let Run { name, config, .. } = self;
        let data = (&self.training.dataset, self.training.images.clone());
        RunFile::new(name, config, data, self.generation, self.search.archive())
            .expect("the tasks of the config were read when the run began")
    }
}

/// Random immigrants and mutated offspring, each from a random stream of its own.
pub struct Mutations<'a> {
    seed: u64,
    spec: BodySpec,
    params: &'a MutationParams,
    /// Makes no more robots once it is stopped.
    session: &'a Session<'a>,
}

impl<'a> Mutations<'a> {
    /// Returns those of a config; `seed` is that of the random streams.
    pub fn new(config: &'a Config, seed: u64, session: &'a Session<'a>) -> Self {
        Mutations {
            seed,
            spec: config.body_spec(),
            params: &config.genome,
            session,
        }
    }

    /// Makes the random individual that a run with this seed makes in a generation as its
    /// `child`-th.
    ///
    /// # Errors
    /// Returns an error if the config has no valid body, or the session was stopped.
    pub fn random(&self, generation: u64, child: u64) -> Result<(Genome, Body), Error> {
        self.immigrant(generation, child).map_err(unmade)
    }

    /// Makes the offspring of a genome that a run with this seed makes in a generation as its
    /// `child`-th.
    ///
    /// # Errors
    /// Returns an error if no mutation gives a valid body, or the session was stopped.
    pub fn mutated(
        &self,
        parent: &Genome,
        generation: u64,
        child: u64,
    ) -> Result<(Genome, Body), Error> {
        self.child(parent, generation, child).map_err(unmade)
    }

    fn immigrant(&self, generation: u64, child: u64) -> Result<(Genome, Body), GenomeError> {
        let rng = &mut stream(self.seed, Purpose::RandomImmigrant, generation, child);
        Genome::random_unless(self.spec, self.params, rng, self.session)
    }

    fn child(
        &self,
        parent: &Genome,
        generation: u64,
        child: u64,
    ) -> Result<(Genome, Body), GenomeError> {
        let rng = &mut stream(self.seed, Purpose::Mutation, generation, child);
        parent.offspring_unless(self.spec, self.params, rng, self.session)
    }
}

fn unevaluated((genome, body): (Genome, Body), generation: u64, parent: Option<&Robot>) -> Robot {
    Robot {
        id: genome.id(),
        cell: Vec::new(),
        task: String::new(),
        objective: 0.0,
        displacements: Vec::new(),
        voxels: body.counts(),
        generation,
        parent: parent.map(|parent| parent.id.clone()),
        body,
        genome,
    }
}

fn unmade(error: GenomeError) -> Error {
    match error {
        GenomeError::Stopped(stopped) => stopped.into(),
        error => Error::input(format!("body: {error}")),
    }
}

impl Variation<Robot> for Mutations<'_> {
    type Error = GenomeError;

    fn random_immigrant(&self, generation: u64, child: u64) -> Result<Robot, GenomeError> {
        Ok(unevaluated(
            self.immigrant(generation, child)?,
            generation,
            None,
        ))
    }

    fn offspring(&self, parent: &Robot, generation: u64, child: u64) -> Result<Robot, GenomeError> {
        let made = self.child(&parent.genome, generation, child)?;
        Ok(unevaluated(made, generation, Some(parent)))
    }
}
