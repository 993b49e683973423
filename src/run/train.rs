//! `morphcog train`: the gaits of an archive are taught to tell two groups of images apart.
//!
//! [`teach`](crate::task::teach) says how. Everything that is simulated is kept in `training.json` beside `run.json`; a
//! training that goes on takes from there what was simulated before, so that it ends with the same bits.

use super::archive::{Dimensions, FORMAT, FORMAT_VERSION, Robot, RunFile};
use super::config::DataConfig;
use super::curriculum::Period;
use super::evaluation_config::EvaluationConfig;
use super::folder::{self, IfExists, RunFolder};
use super::metrics::{Metrics, Totals};
use super::probing::{Probing, response};
use super::robots::{Selection, Source};
use super::start::{StartConfig, StartRef};
use super::task_config::TaskConfig;
use super::training::{ImageRef, Training};
use super::validation::{self, Validated, ValidationConfig};
use super::whereabouts::{self, Whereabouts};
use super::{Config, Error, eval, held_out, toml_text};
use crate::base::Grid;
use crate::base::files::{read_text, write_atomically};
use crate::base::hash::sha256_hex;
use crate::body::{Body, Material};
use crate::qd::{Archive, DescriptorSpace, Elite};
use crate::task::condition::Condition;
use crate::task::dataset::{Dataset, Split};
use crate::task::evaluation::fresh_rollouts;
use crate::task::fitness::Fitness;
use crate::task::protocol::{Life, Protocol};
use crate::task::response::{Example, Gait, Response};
use crate::task::teach::{Image, Plan, Rollouts, Round, Taught, Teacher};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// What a training keeps of its rollouts, beside `run.json`.
pub const TRAINING_JSON: &str = "training.json";

/// What the file calls itself, and the version of its schema.
const FILE: (&str, u32) = ("morphcog-training", 1);

/// How often the rollouts are saved. A power cut costs as much.
const SAVE_EVERY: Duration = Duration::from_secs(5);

/// Least number of training images of a class.
const LEAST_PER_CLASS: usize = 2;

/// What to train and where to.
#[derive(Clone, Debug)]
pub struct Options {
    /// The run.json whose robots walk.
    pub archive: PathBuf,
    /// Which of them are tried; the one that can be taught most is taught.
    pub robots: Selection,
    /// The two groups of classes.
    pub groups: [Vec<u8>; 2],
    /// Seed of all chance; `None`: that of the run.
    pub seed: Option<u64>,
    /// Keys of the config that differ from those of the run, as `train.rounds=10`.
    pub set: Vec<String>,
    /// Name of the run that is made.
    pub name: String,
    /// Its folder.
    pub out: PathBuf,
    /// What to do if there is a run in it.
    pub if_exists: IfExists,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// Number of threads; `None`: one per core.
    pub threads: Option<usize>,
}

/// What is told how a training goes.
pub trait Observer {
    /// Before the first rollout: the folder, how many gaits are tried, and how many training images there are.
    fn started(&mut self, folder: &RunFolder, gaits: usize, images: usize);
    /// The response of a robot's gait is known.
    fn response(&mut self, robot: &str, gait: &Gait, response: &Response);
    /// A robot's gait was taught in a round.
    fn round(&mut self, robot: &str, round: &Round, plan: &Plan);
    /// What is told how the robot is validated.
    fn validation(&mut self) -> Box<dyn eval::Observer + '_> {
        Box::new(())
    }
}

/// How a training ended.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The run as it stands in `run.json`.
    pub run: RunFile,
    /// Rollouts simulated in all, validation left out.
    pub rollouts: usize,
    /// How the robot did on validation images; `None` if that was stopped.
    pub validated: Option<Vec<Validated>>,
}

/// Reads two groups of classes, as in "4|9", "0|123" or "10,11|3".
///
/// # Errors
/// What was expected.
pub fn groups(text: &str) -> Result<[Vec<u8>; 2], String> {
    let expected = || format!("{text}: expected two groups of classes, as in 4|9, 0|123 or 10,11|3");
    let group = |part: &str| -> Result<Vec<u8>, String> {
        let classes: Option<Vec<u8>> = match part.contains(',') {
            true => part.split(',').map(|class| class.trim().parse().ok()).collect(),
            false => part.trim().chars().map(|c| c.to_digit(10).and_then(|d| u8::try_from(d).ok())).collect(),
        };
        classes.filter(|classes| !classes.is_empty()).ok_or_else(expected)
    };
    let (a, b) = text.split_once('|').ok_or_else(expected)?;
    let groups = [group(a)?, group(b)?];
    crate::task::grouping::Grouping::two_groups(&groups[0], &groups[1])
        .map_err(|error| format!("{text}: {error}"))?;
    Ok(groups)
}

/// A gait to be tried.
struct Walker<'a> {
    robot: &'a Robot,
    gait: Gait,
}

/// Trains a robot, and validates it.
///
/// # Errors
/// What is wrong with archive, options, data or folder; that it was stopped (the same with
/// [`IfExists::Resume`] goes on). Nothing that was there is lost.
pub fn train(
    options: &Options,
    stop: &AtomicBool,
    observer: &mut (dyn Observer + Send),
) -> Result<Finished, Error> {
    let source = Source::read(&options.archive)?;
    let whereabouts = Whereabouts::given(options.data.as_deref())
        .and_of(&options.out.join(folder::RUN_JSON))
        .and_of(&options.archive);
    let config = config(&source.run.config, options)?;
    let dataset = whereabouts.load(&config.data, &[Split::Train])?;
    let config = with_images(config, &dataset)?;
    let period = Period { stage: 0, draw: 0 };
    let training = Training::unless(&config, &dataset, period, stop)?;
    let origin = origin(&source, &dataset)?;
    held_out::check(&config, Some(&origin), &dataset)?;
    let walkers = walkers(&source, &options.robots, config.seed)?;
    let [log, run] = [TRAINING_JSON, folder::RUN_JSON].map(|name| options.out.join(name));
    if options.if_exists == IfExists::Resume && run.exists() && !log.exists() {
        let text = format!("{}: the run in this folder is no training", options.out.display());
        return Err(
            Error::occupied(text).hint("write elsewhere with --out, or replace it by --force".to_string())
        );
    }
    let folder = RunFolder::open(&options.out, options.if_exists)?;
    let write = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        write_atomically(&path, content).map_err(|error| Error::writing(&path, &error))
    };
    let key = key(&config, &walkers, &training);
    let mut log = Log::open(log, key, stop)?;
    write(folder::CONFIG, config.to_toml().as_bytes())?;
    whereabouts::remember(&folder, &dataset)?;
    let pool = eval::pool(options.threads)?;
    let began = Instant::now();
    observer.started(&folder, walkers.len(), training.images.len());
    let probing = Probing::new(&training.conditions, config.seed);
    let trainer = Trainer { config: &config, training: &training, probing };
    let taught = pool.install(|| trainer.train(&walkers, &mut log, observer));
    // What was simulated is kept, however it ended.
    let saved = log.save();
    let (walker, taught) = taught?;
    saved?;
    let run = run_file(options, &config, &training, origin, walker, &taught)?;
    let seconds = began.elapsed().as_secs_f64();
    let totals = Totals { evaluations: 1, simulated: log.simulated as u64, seconds, ..Totals::default() };
    let csv = run.to_csv().map_err(|error| Error::other(error.to_string()))?;
    let mut metrics = Metrics::open(folder.path(), 0)?;
    metrics.write((0, 0), &run.stats, &totals)?;
    metrics.flush()?;
    write(folder::ELITES, &csv)?;
    write(folder::RUN_JSON, run.to_json().as_bytes())?;
    let archive = folder.path().join(folder::RUN_JSON);
    let validated = match config.validation.best {
        0 => Some(Vec::new()),
        _ => validation::at_end(&archive, &dataset, &pool, stop, &*observer.validation())?,
    };
    Ok(Finished { run, rollouts: log.simulated, validated })
}

/// The config of the run that is made: that of the walkers' run with another task.
fn config(of_walkers: &Config, options: &Options) -> Result<Config, Error> {
    let evaluation = EvaluationConfig { fitness: Fitness::MeanClipped, ..EvaluationConfig::default() };
    let base = Config {
        seed: options.seed.unwrap_or(of_walkers.seed),
        generations: 1,
        task: TaskConfig { groups: Some(options.groups.clone()), ..TaskConfig::default() },
        data: DataConfig { train_images: None, ..of_walkers.data.clone() },
        protocol: Protocol { life: Life::Fresh, ..of_walkers.protocol.clone() },
        stage: Vec::new(),
        evaluation,
        start: StartConfig::default(),
        validation: ValidationConfig { best: 1, ..ValidationConfig::default() },
        ..of_walkers.clone()
    };
    toml_text::changed(base, &options.set, |config: &Config| config.validate(), |error| error)
}

/// The same with its training images as a stage, as many as there are beside those that validate.
fn with_images(config: Config, dataset: &Dataset) -> Result<Config, Error> {
    let mut fewest = usize::MAX;
    for class in config.classes() {
        let count = dataset.indices_of(Split::Train, class).len();
        if count < LEAST_PER_CLASS {
            let text = format!(
                "--task: class {class}: expected {LEAST_PER_CLASS} training images or more, found {count}"
            );
            let classes = dataset.classes(Split::Train);
            return Err(Error::input(text).hint(format!("{} has the classes {classes:?}", dataset.name())));
        }
        fewest = fewest.min(count);
    }
    let per_class = config.train.images_per_class.min((fewest * 3 / 4).max(1));
    let stage = vec![config.train.stage(per_class)];
    let config = Config { stage, ..config };
    config.validate()?;
    Ok(config)
}

/// What the walkers were trained on: not for validation.
fn origin(source: &Source, dataset: &Dataset) -> Result<StartRef, Error> {
    let run = &source.run;
    let is_same = dataset.fingerprint(Split::Train).is_some_and(|sha256| sha256 == run.dataset.train_sha256);
    let trained_on = if is_same { held_out::trained_on(run, dataset)? } else { Default::default() };
    Ok(StartRef {
        name: run.name.clone(),
        generations: run.generations,
        sha256: run.fingerprint(),
        trained_on: trained_on.into_iter().collect(),
    })
}

/// The gaits of the chosen robots, each once.
fn walkers<'a>(source: &'a Source, robots: &Selection, seed: u64) -> Result<Vec<Walker<'a>>, Error> {
    let mut walkers: Vec<Walker> = Vec::new();
    for chosen in robots.of(std::slice::from_ref(source), seed)? {
        let Some(gait) = Gait::of(&chosen.robot.body) else { continue };
        if walkers.iter().all(|other| other.gait.probe() != gait.probe()) {
            walkers.push(Walker { robot: chosen.robot, gait });
        }
    }
    if walkers.is_empty() {
        let text = format!(
            "{}: none of the chosen robots has a soft voxel or a sensor: there is nothing to train",
            source.path.display()
        );
        return Err(Error::input(text).hint("choose others with --robots".to_string()));
    }
    Ok(walkers)
}

/// Of all that rollouts depend on.
fn key(config: &Config, walkers: &[Walker], training: &Training) -> String {
    let bodies: Vec<String> = walkers.iter().map(|walker| walker.robot.body.to_string()).collect();
    let images: Vec<usize> = training.images.iter().map(|image| image.index).collect();
    let essence = config.essence().to_toml();
    let train = config.train;
    let text = format!(
        "{} {essence} {train:?} {bodies:?} {} {images:?}",
        env!("CARGO_PKG_VERSION"),
        training.dataset.train_sha256
    );
    sha256_hex(text.as_bytes())
}

/// Displacements that were simulated together, in the order of the images; `None` where unstable.
type Batch = Vec<Option<f64>>;

/// The content of `training.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    format_version: u32,
    /// SHA-256 of all that the rollouts depend on.
    key: String,
    /// Rollouts in the order in which they were asked for.
    rollouts: Vec<Batch>,
}

/// What is simulated, and was in sessions before.
struct Log<'a> {
    path: PathBuf,
    key: String,
    batches: Vec<Batch>,
    /// Batches asked for so far.
    asked: usize,
    /// Rollouts in them.
    simulated: usize,
    saved: (usize, Instant),
    stop: &'a AtomicBool,
}

impl<'a> Log<'a> {
    fn open(path: PathBuf, key: String, stop: &'a AtomicBool) -> Result<Self, Error> {
        let mut batches = Vec::new();
        if path.exists() {
            let text = read_text(&path).map_err(|error| Error::reading(&path, &error))?;
            let name = path.display().to_string();
            let anew = || "train anew with --force".to_string();
            let file: File =
                toml_text::read_versioned(&text, &name, FILE.0, FILE.1).map_err(|e| e.hint(anew()))?;
            if file.key != key {
                let text = format!(
                    "{name}: expected the training that began here: other robots, images or settings"
                );
                return Err(Error::usage(text).hint(
                    "go on with those, write elsewhere with --out, or train anew with --force".to_string(),
                ));
            }
            batches = file.rollouts;
        }
        let saved = (batches.len(), Instant::now());
        Ok(Log { path, key, batches, asked: 0, simulated: 0, saved, stop })
    }

    /// Rollouts of a body under stimuli and conditions.
    fn rollouts(
        &mut self,
        body: &Body,
        stimuli: &[Grid<f64>],
        conditions: &[Condition],
        config: &Config,
    ) -> Result<Batch, Error> {
        let number = self.asked;
        self.asked += 1;
        self.simulated += stimuli.len();
        if let Some(batch) = self.batches.get(number) {
            return match batch.len() == stimuli.len() {
                true => Ok(batch.clone()),
                false => {
                    let text = format!(
                        "{}: rollouts {number}: expected {}, found {}",
                        self.path.display(),
                        stimuli.len(),
                        batch.len()
                    );
                    Err(Error::input(text).hint("train anew with --force".to_string()))
                }
            };
        }
        let found = fresh_rollouts(body, stimuli, conditions, &config.physics, &config.protocol, self.stop);
        let found = found.map_err(|_| {
            Error::stopped("stopped; what was simulated is saved".to_string())
                .hint("the same command with --resume goes on".to_string())
        })?;
        let batch: Batch = found.into_iter().map(Result::ok).collect();
        self.batches.push(batch.clone());
        if self.saved.1.elapsed() >= SAVE_EVERY {
            self.save()?;
        }
        Ok(batch)
    }

    fn save(&mut self) -> Result<(), Error> {
        if self.saved.0 == self.batches.len() && self.path.exists() {
            return Ok(());
        }
        let file = File {
            format: FILE.0.to_string(),
            format_version: FILE.1,
            key: self.key.clone(),
            rollouts: self.batches.clone(),
        };
        let text = serde_json::to_string(&file).expect("numbers are finite and keys are text") + "\n";
        write_atomically(&self.path, text.as_bytes()).map_err(|error| Error::writing(&self.path, &error))?;
        self.saved = (self.batches.len(), Instant::now());
        Ok(())
    }
}

/// What all gaits are trained with.
struct Trainer<'a> {
    config: &'a Config,
    training: &'a Training,
    probing: Probing,
}

/// Rollouts of one gait's designs.
struct OfGait<'a, 'b> {
    config: &'a Config,
    conditions: &'a [Condition],
    gait: &'a Gait,
    log: &'a mut Log<'b>,
}

impl Rollouts for OfGait<'_, '_> {
    type Error = Error;

    fn roll(
        &mut self,
        design: &[Material],
        stimuli: &[Grid<f64>],
        conditions: &[usize],
    ) -> Result<Batch, Error> {
        let conditions: Vec<Condition> = conditions.iter().map(|number| self.conditions[*number]).collect();
        self.log.rollouts(&self.gait.built(design), stimuli, &conditions, self.config)
    }
}

impl Trainer<'_> {
    /// Measures a gait's response; `None` if most of its rollouts are unstable.
    fn response(&self, gait: &Gait, log: &mut Log) -> Result<Option<Response>, Error> {
        let Trainer { config, probing, .. } = self;
        let count = config.train.random_images;
        let shown = probing.shown(gait, &config.physics, 0..count, |probe, stimuli, conditions| {
            log.rollouts(probe, stimuli, conditions, config)
        })?;
        Ok(response(&shown, count))
    }

    /// The training images as a gait sees them; both groups weigh the same.
    fn images(&self, gait: &Gait) -> Vec<Image> {
        let Trainer { config, training, probing } = self;
        let all = probing.conditions();
        let [a, b] = config.task.groups.as_ref().expect("a training has two groups");
        let of =
            |classes: &[u8]| training.images.iter().filter(|image| classes.contains(&image.label)).count();
        let (of_a, of_b) = (of(a) as f64, of(b) as f64);
        let image = |((image, stimulus), condition): ((&ImageRef, &Grid<f64>), &Condition)| {
            let is_a = a.contains(&image.label);
            let (right, weight) = if is_a { (1.0, 0.5 / of_a) } else { (-1.0, 0.5 / of_b) };
            let condition = all.iter().position(|other| other == condition).expect("it is one of all");
            Image {
                stimulus: stimulus.clone(),
                example: Example { right, weight, ..Example::new(gait, stimulus, &config.physics) },
                condition,
            }
        };
        training.images.iter().zip(&training.stimuli).zip(&training.conditions).map(image).collect()
    }

    fn plan(&self) -> Plan {
        let train = &self.config.train;
        Plan {
            seed: self.config.seed,
            rounds: train.rounds,
            images: train.images,
            final_images: train.final_images,
            enough: f64::from(self.config.evaluation.enough),
        }
    }

    /// Teaches all gaits in one round, and goes on with the one that could be taught most.
    fn train<'w>(
        &self,
        walkers: &'w [Walker<'w>],
        log: &mut Log,
        observer: &mut (dyn Observer + Send),
    ) -> Result<(&'w Walker<'w>, Taught), Error> {
        let plan = self.plan();
        let Trainer { config, probing, .. } = self;
        let mut best: Option<(&Walker, Teacher)> = None;
        for walker in walkers {
            let gait = &walker.gait;
            let Some(response) = self.response(gait, log)? else { continue };
            observer.response(&walker.robot.id, gait, &response);
            let mut teacher = Teacher::new(gait, &response, self.images(gait), plan, &config.physics);
            let conditions = probing.conditions();
            let round = teacher.round(&mut OfGait { config, conditions, gait, log })?;
            observer.round(&walker.robot.id, &round, &plan);
            if best.as_ref().is_none_or(|(_, best)| teacher.predicted() > best.predicted()) {
                best = Some((walker, teacher));
            }
        }
        let Some((walker, mut teacher)) = best else {
            let text = "none of the chosen robots is stable under random images: there is nothing to train";
            return Err(Error::input(text.to_string()).hint("choose others with --robots".to_string()));
        };
        let (gait, conditions) = (&walker.gait, probing.conditions());
        let mut rollouts = OfGait { config, conditions, gait, log };
        for _ in 1..plan.rounds {
            let round = teacher.round(&mut rollouts)?;
            observer.round(&walker.robot.id, &round, &plan);
        }
        Ok((walker, teacher.finish(&mut rollouts)?))
    }
}

/// The run with the robot that was taught.
fn run_file(
    options: &Options,
    config: &Config,
    training: &Training,
    origin: StartRef,
    walker: &Walker,
    taught: &Taught,
) -> Result<RunFile, Error> {
    let body = walker.gait.built(&taught.design);
    let genome = walker.robot.genome.with_body(&body).map_err(|error| Error::other(error.to_string()))?;
    let training_images: Vec<ImageRef> = taught.shown.iter().map(|image| training.images[*image]).collect();
    let grouping = config.grouping()?.with_fitness(config.criterion(0));
    let answers = super::training::answers(&training_images, taught.displacements.iter().copied().map(Some));
    let score = grouping.score(&answers);
    let mut robot = Robot {
        id: genome.id(),
        cell: Vec::new(),
        task: grouping.tasks()[score.task].name(),
        objective: score.fitness,
        displacements: taught.displacements.clone(),
        voxels: body.counts(),
        generation: 0,
        parent: Some(walker.robot.id.clone()),
        body,
        genome,
    };
    robot.cell = robot.bins();
    let dimensions = Dimensions::of(config)?;
    let space = DescriptorSpace::voxel_counts(grouping.tasks().len());
    let cell = space.index(&robot.cell).expect("bins of voxel counts are a cell of one task's archive");
    let mut archive = Archive::new();
    let elite = Elite { cell, objective: robot.objective, solution: robot };
    archive.insert(elite).map_err(|error| Error::other(error.to_string()))?;
    let stats = archive.stats(dimensions.possible_cells, config.archive.qd_offset);
    Ok(RunFile {
        format: FORMAT.to_string(),
        format_version: FORMAT_VERSION,
        program_version: env!("CARGO_PKG_VERSION").to_string(),
        name: options.name.clone(),
        config: config.clone(),
        dataset: training.dataset.clone(),
        training_images,
        dimensions,
        start: Some(origin),
        generations: 1,
        stats,
        elites: archive.elites().map(|elite| elite.solution.clone()).collect(),
        read_sha256: None,
    })
}
