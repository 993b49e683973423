//! `morphcog train`: the gaits of an archive are taught to tell two groups of images apart.
//!
//! [`teach`](crate::task::teach) says how. Everything that is simulated is kept in `training.json`
//! beside `run.json`; a training that goes on takes from there what was simulated before, so that
//! it ends with the same bits.

use crate::base::error::Error;
use crate::base::files::{read_text, write_atomically};
use crate::base::hash::sha256_hex;
use crate::base::observer::{Observer, Work};
use crate::base::text::counted;
use crate::base::threads::pool;
use crate::base::{Grid, number};
use crate::body::Body;
use crate::config::evaluation::EvaluationConfig;
use crate::config::task::TaskConfig;
use crate::config::train::TrainConfig;
use crate::config::validation::{LEAST, ValidationConfig};
use crate::config::{BodyConfig, Config, DataConfig, reading};
use crate::data::dataset::{Dataset, Split};
use crate::qd::{Archive, DescriptorSpace, Elite};
use crate::search::probing::{Probing, response};
use crate::search::training::{Training, scarcest};
use crate::search::windows::{Found, Windows};
use crate::search::{held_out, validation};
use crate::store::folder::{self, IfExists, RunFolder};
use crate::store::images::ImageRef;
use crate::store::metrics::{Metrics, Totals};
use crate::store::names::{ELITES, RESPONSE_JSON, RUN_JSON, TRAINING_JSON};
use crate::store::response::ResponseFile;
use crate::store::robots::{Selection, Source};
use crate::store::run::{Dimensions, FORMAT, FORMAT_VERSION, Robot, RunFile};
use crate::store::training::{Batch, Drawn, Elsewhere, FILE, File, Origin};
use crate::store::validation::Validated;
use crate::store::whereabouts;
use crate::store::whereabouts::{Whereabouts, see};
use crate::task::evaluation::fresh_rollouts;
use crate::task::fitness::Fitness;
use crate::task::grouping::balanced;
use crate::task::perturbation::Condition;
use crate::task::protocol::{Protocol, RolloutMode};
use crate::task::refine::Challenge;
use crate::task::response::{Example, Gait, Response};
use crate::task::teach::{Image, Plan, Rollouts, Round, Taught, Teacher};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

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
pub fn train(options: &Options, stop: &AtomicBool, observer: &dyn Observer) -> Result<Finished, Error> {
    if options.robots.validated().is_some() {
        let text = "--robots best-validation: expected another selection: gaits have no task to validate";
        return Err(Error::usage(text.to_string()).hint("the fittest four are --robots top:4".to_string()));
    }
    let source = Source::read(&options.archive)?;
    let whereabouts = Whereabouts::given(options.data.as_deref())
        .and_of(&options.out.join(RUN_JSON))
        .and_of(&options.archive);
    let config = config_of(&source.run.config, &options.groups, options.seed, &options.set)?;
    let dataset = whereabouts.load(&config.data, &[Split::Train])?;
    let origin = origin(&source, &config, &dataset)?;
    let config = with_images(config, &origin.trained_on, &dataset, observer)?;
    let mut training = Training::of(&config, &dataset)?;
    let classes = training.images.iter().map(|image| image.label);
    training.conditions = config.train.perturbations.of(classes);
    let mut walkers = walkers(&source, &options.robots, config.seed)?;
    if config.train.rounds == 0 {
        // One of them is refined as it is: the fittest, the first of several.
        walkers.sort_by(|a, b| b.robot.objective.total_cmp(&a.robot.objective));
    }
    // A gait's response is the same for every task and every seed of a training.
    let probing = Probing::new(&training.conditions, source.run.config.seed);
    let measured = measured(&source, &config, &probing, &walkers, observer);
    let [log, run] = [TRAINING_JSON, RUN_JSON].map(|name| options.out.join(name));
    if options.if_exists == IfExists::Resume && run.exists() && !log.exists() {
        let text = format!("{}: the run in this folder is no training", options.out.display());
        return Err(
            Error::occupied(text).hint("write elsewhere with --out, or replace it by --force".to_string())
        );
    }
    apart(&options.out, &source.path)?;
    let folder = RunFolder::open(&options.out, options.if_exists, stop, observer)?;
    let write = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        write_atomically(&path, content).map_err(|error| Error::writing(&path, &error))
    };
    let key = key(&config, source.run.config.seed, &walkers, &training);
    let mut log = Log::open(log, key, stop, observer)?;
    folder.write_config(&config)?;
    whereabouts::remember(&folder, &dataset)?;
    let pool = pool(options.threads)?;
    let began = Instant::now();
    let (gaits, images) = (walkers.len(), training.images.len());
    observer.note(&format!(
        "training in {}: {}, {images} training images",
        folder.path().display(),
        counted(gaits, "gait", "gaits")
    ));
    let trainer = Trainer { config: &config, dataset: &dataset, training: &training, probing, measured };
    let taught = pool.install(|| trainer.train(&walkers, &mut log, observer));
    // What was simulated is kept, however it ended.
    log.save()?;
    let (walker, config, taught) = taught?;
    let run = run_file(options, &config, &training, origin, walker, &taught)?;
    let seconds = began.elapsed().as_secs_f64();
    let totals = Totals { evaluations: 1, simulated: log.simulated as u64, seconds, ..Totals::default() };
    let csv = run.to_csv();
    let mut metrics = Metrics::open(folder.path(), 0)?;
    metrics.write(0, &run.stats, &totals)?;
    metrics.flush()?;
    write(ELITES, &csv)?;
    write(RUN_JSON, run.to_json().as_bytes())?;
    let archive = folder.path().join(RUN_JSON);
    let validated = match config.validation.best {
        0 => Some(Vec::new()),
        _ => validation::at_end(&archive, &dataset, &pool, stop, observer)?,
    };
    Ok(Finished { run, rollouts: log.simulated, validated })
}

/// Whether a training has a folder of its own: that of its gaits would be lost.
fn apart(out: &Path, archive: &Path) -> Result<(), Error> {
    let of_gaits = archive.parent().map(|folder| Path::new(".").join(folder));
    let [out_now, of_gaits] =
        [Some(out), of_gaits.as_deref()].map(|folder| folder.and_then(|folder| folder.canonicalize().ok()));
    if out_now.is_some() && out_now == of_gaits {
        let text = format!("--out {}: expected another folder: the gaits are in this one", out.display());
        return Err(Error::usage(text));
    }
    Ok(())
}

/// The config of the run that is made: that of the walkers' run with another task, perhaps another
/// seed, and the keys that are set.
///
/// # Errors
/// What is wrong with these.
pub(crate) fn config_of(
    of_walkers: &Config,
    groups: &[Vec<u8>; 2],
    seed: Option<u64>,
    set: &[String],
) -> Result<Config, Error> {
    let evaluation = EvaluationConfig { fitness: Fitness::MeanClipped };
    let base = Config {
        seed: seed.unwrap_or(of_walkers.seed),
        generations: 1,
        task: TaskConfig { groups: Some(groups.clone()), ..TaskConfig::default() },
        data: DataConfig { train_images: None, ..of_walkers.data.clone() },
        protocol: Protocol { rollout: RolloutMode::Fresh, ..of_walkers.protocol.clone() },
        evaluation,
        validation: ValidationConfig { best: 1, ..of_walkers.validation },
        ..of_walkers.clone()
    };
    let asked = base.clone();
    let check = |config: &Config| fixed(config, &asked).and_then(|()| config.validate());
    let config = reading::changed(base, set, check, |error| error)?;
    let BodyConfig { height, width, .. } = of_walkers.body;
    if (config.body.height, config.body.width) != (height, width) {
        let found = format!("{} × {} voxels", config.body.height, config.body.width);
        return Err(Error::value("body", found, &format!("{height} × {width}, as the gaits have")));
    }
    if config.task != asked.task {
        return Err(Error::at(
            "task",
            "expected the groups that are trained to be said once, not as a key, too",
        ));
    }
    if config.seed != asked.seed {
        return Err(Error::value("seed", config.seed, &format!("{}, as said elsewhere", asked.seed)));
    }
    Ok(config)
}

/// Whether a config has what trainings have, and nothing in its place.
fn fixed(config: &Config, asked: &Config) -> Result<(), Error> {
    let fixed = [
        ("generations", config.generations != asked.generations, "has rounds and challengers"),
        (
            "data.images_per_class",
            config.data.images_per_class != asked.data.images_per_class,
            "has train.images_per_class",
        ),
        ("evaluation", config.evaluation != asked.evaluation, "has a fitness of its own"),
        ("protocol.rollout", config.protocol.rollout != asked.protocol.rollout, "has fresh rollouts"),
    ];
    match fixed.into_iter().find(|(_, is_set, _)| *is_set) {
        Some((key, _, has)) => Err(Error::at(key, format!("expected without: a training {has}"))),
        None => Ok(()),
    }
}

/// The same with as many training images as there are beside those that validate; of few images
/// fewer validate than the config asks for, too. `before`: what the gaits were trained on.
///
/// # Errors
/// If there are too few to train on, or to validate with.
pub(crate) fn with_images(
    config: Config,
    before: &[usize],
    dataset: &Dataset,
    observer: &dyn Observer,
) -> Result<Config, Error> {
    let classes = config.classes();
    let fewest = scarcest(dataset, &classes, LEAST_PER_CLASS)?;
    let ValidationConfig { images, best } = config.validation;
    let mut per_class = config.train.images_per_class.min((fewest * 3 / 4).max(1));
    let mut validation = config.validation;
    let wanted = images.div_ceil(classes.len());
    if best > 0 && fewest - per_class < wanted {
        per_class = per_class.min((fewest * 2 / 3).max(1));
        let there = (fewest - per_class).min(wanted) * classes.len();
        // What was asked for by a number of one's own is kept, or refused.
        let is_asked = images != ValidationConfig::default().images;
        if !is_asked && (LEAST..images).contains(&there) {
            observer
                .warning(&format!("validating on {there} images in place of {images}: there are no more"));
            validation.images = there;
        }
    }
    let data = DataConfig { images_per_class: per_class, ..config.data.clone() };
    let config = Config { data, validation, ..config };
    config.validate()?;
    held_out::check(&config, before, "train.images_per_class", dataset)?;
    Ok(config)
}

/// Whether a run's gaits, when they have evolved, can be trained to tell these groups apart: to be
/// known before they evolve.
///
/// # Errors
/// If the config, or the images there are, do not allow it.
pub fn check(evolved: &Config, groups: &[Vec<u8>; 2], data: Option<&Path>) -> Result<(), Error> {
    let config = config_of(evolved, groups, None, &[])?;
    let dataset = Whereabouts::given(data).load(&config.data, &[Split::Train])?;
    with_images(config, &Training::indices(evolved, &dataset)?, &dataset, &()).map(|_| ())
}

/// Where the walkers are from, and what they were trained on: not for validation.
fn origin(source: &Source, config: &Config, dataset: &Dataset) -> Result<Origin, Error> {
    let run = &source.run;
    let sha256 = dataset.fingerprint(Split::Train).expect("a training loads its training images");
    let all = run.origin.as_ref().map_or(Vec::new(), |origin| origin.elsewhere.clone());
    let (here, mut elsewhere): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|other| other.train_sha256 == sha256);
    let mut trained_on = BTreeSet::new();
    match sha256 == run.dataset.train_sha256 {
        true => trained_on = held_out::trained_on(run, dataset)?,
        // Some day it may be trained on that data again.
        false => elsewhere.push(Elsewhere::of(run)),
    }
    for earlier in here {
        trained_on.extend(earlier.indices);
        if let Some(Drawn { classes, images_per_class, seed }) = earlier.drawn {
            let drawn = dataset.draw(Split::Train, &classes, images_per_class, seed, 0);
            trained_on.extend(drawn.map_err(|error| Error::input(error.to_string()))?);
        }
    }
    Ok(Origin {
        name: run.name.clone(),
        generations: run.generations,
        sha256: run.fingerprint(),
        trained_on: trained_on.into_iter().collect(),
        elsewhere,
        windows: if config.train.rounds == 0 { 0 } else { config.train.windows },
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

/// What `morphcog response` measured of each gait, where it lies beside the run and holds for this
/// training: what would be simulated again otherwise.
fn measured(
    source: &Source,
    config: &Config,
    probing: &Probing,
    walkers: &[Walker],
    observer: &dyn Observer,
) -> Vec<Batch> {
    let nothing = || vec![Vec::new(); walkers.len()];
    // That of a named run is in the present folder, if it was measured.
    let made = folder::beside(&source.path, RESPONSE_JSON);
    let path = if made.exists() { made } else { source.path.with_file_name(RESPONSE_JSON) };
    let of_run = &source.run.config;
    // A response is measured in fresh rollouts.
    let protocol = Protocol { rollout: RolloutMode::Fresh, ..of_run.protocol.clone() };
    if (&config.physics, &config.protocol) != (&of_run.physics, &protocol) {
        return nothing();
    }
    let Some(file) = ResponseFile::found(&path, observer) else { return nothing() };
    let (run, seed, conditions) = (source.run.fingerprint(), of_run.seed, probing.conditions());
    walkers.iter().map(|walker| file.known(&run, seed, conditions, &walker.gait).to_vec()).collect()
}

/// Of all that rollouts depend on; more challengers come after those that there were.
fn key(config: &Config, seed_of_gaits: u64, walkers: &[Walker], training: &Training) -> String {
    let bodies: Vec<String> = walkers.iter().map(|walker| walker.robot.body.to_string()).collect();
    let images: Vec<usize> = training.images.iter().map(|image| image.index).collect();
    let train = TrainConfig { challengers: 0, ..config.train };
    let essence = Config { train, ..config.essence() }.to_toml();
    let text = format!(
        "{} {essence} {seed_of_gaits} {bodies:?} {} {images:?}",
        env!("CARGO_PKG_VERSION"),
        training.dataset.train_sha256
    );
    sha256_hex(text.as_bytes())
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
    /// Rollouts of the work that began last; none if others are counted than rollouts.
    done: Option<AtomicU64>,
    stop: &'a AtomicBool,
    observer: &'a dyn Observer,
}

impl<'a> Log<'a> {
    fn open(
        path: PathBuf,
        key: String,
        stop: &'a AtomicBool,
        observer: &'a dyn Observer,
    ) -> Result<Self, Error> {
        let mut batches = Vec::new();
        if path.exists() {
            let text = read_text(&path).map_err(|error| Error::reading(&path, &error))?;
            let name = path.display().to_string();
            let anew = || "train anew with --force".to_string();
            let file: File =
                reading::read_versioned(&text, &name, FILE.0, FILE.1).map_err(|e| e.hint(anew()))?;
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
        Ok(Log { path, key, batches, asked: 0, simulated: 0, saved, done: None, stop, observer })
    }

    /// Work begins whose rollouts are counted.
    fn begins(&mut self, label: String, rollouts: usize) {
        self.observer.begins(&Work::new(label, rollouts as u64, "rollouts"));
        self.done = Some(AtomicU64::new(0));
    }

    /// A round begins, or, where there are none, the look at the robot as it is.
    fn begins_round(&mut self, robot: &str, number: usize, plan: &Plan) {
        match plan.rounds {
            0 => self.begins(format!("{robot}: as it is:"), plan.images),
            rounds => self.begins(format!("{robot}: round {number} of {rounds}:"), plan.images),
        }
    }

    /// Work begins of which each challenger is told by itself.
    fn begins_challenges(&mut self, challengers: usize) {
        self.observer.begins(&Work::new("refining:".to_string(), challengers as u64, "challengers"));
        self.done = None;
    }

    fn rolled(&self, count: u64) {
        if let Some(done) = &self.done {
            self.observer.progress(done.fetch_add(count, Ordering::Relaxed) + count);
        }
    }

    /// Rollouts of a body under stimuli and conditions; the first are `known`.
    fn rollouts(
        &mut self,
        body: &Body,
        (stimuli, conditions): (&[Grid<f64>], &[Condition]),
        known: &[Option<f64>],
        config: &Config,
    ) -> Result<Batch, Error> {
        let number = self.asked;
        self.asked += 1;
        self.simulated += stimuli.len();
        if let Some(batch) = self.batches.get(number) {
            return match batch.len() == stimuli.len() {
                true => {
                    self.rolled(batch.len() as u64);
                    Ok(batch.clone())
                }
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
        let setting = (&config.physics, &config.protocol);
        let known = &known[..known.len().min(stimuli.len())];
        let (stimuli, conditions) = (&stimuli[known.len()..], &conditions[known.len()..]);
        self.rolled(known.len() as u64);
        let told = |count| self.rolled(count);
        let found = fresh_rollouts(body, stimuli, conditions, setting, &told, self.stop);
        let (found, _) = found.map_err(|_| stopped())?;
        let batch: Batch = known.iter().copied().chain(found.into_iter().map(Result::ok)).collect();
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

fn stopped() -> Error {
    Error::stopped("stopped; what was simulated is saved".to_string())
        .hint("the same command with --resume goes on".to_string())
}

/// What all gaits are trained with.
struct Trainer<'a> {
    config: &'a Config,
    dataset: &'a Dataset,
    training: &'a Training,
    probing: Probing,
    /// Displacements of each gait with random images that are known before.
    measured: Vec<Batch>,
}

/// Rollouts that are kept.
struct Kept<'a, 'b> {
    config: &'a Config,
    conditions: &'a [Condition],
    log: &'a mut Log<'b>,
}

impl Rollouts for Kept<'_, '_> {
    type Error = Error;

    fn roll(&mut self, body: &Body, stimuli: &[Grid<f64>], conditions: &[usize]) -> Result<Batch, Error> {
        let conditions: Vec<Condition> =
            conditions.iter().map(|number| self.conditions[*number].clone()).collect();
        self.log.rollouts(body, (stimuli, &conditions), &[], self.config)
    }
}

impl Trainer<'_> {
    /// Measures a gait's response; `None` if most of its rollouts are unstable.
    fn response(
        &self,
        gait: &Gait,
        measured: &[Option<f64>],
        log: &mut Log,
    ) -> Result<Option<Response>, Error> {
        let Trainer { config, probing, .. } = self;
        let count = config.train.random_images;
        let shown = probing.shown(gait, &config.physics, 0..count, |probe, stimuli, conditions| {
            log.rollouts(probe, (stimuli, conditions), measured, config)
        })?;
        Ok(response(&shown, count))
    }

    /// The config with the window under which a gait could be taught most.
    fn with_window(
        &self,
        walker: &Walker,
        response: &Response,
        log: &Log,
        observer: &dyn Observer,
    ) -> Result<Config, Error> {
        let Trainer { config, training, .. } = self;
        let (count, robot) = (config.train.windows, &walker.robot.id);
        let mut with = (*config).clone();
        with.train.windows = 0;
        if count == 0 {
            return Ok(with);
        }
        observer.begins(&Work::new(format!("{robot}: windows:"), count as u64, "windows"));
        let windows = Windows::of(config, self.dataset, &training.images, self.groups())?;
        let told = |tried: usize| observer.progress(tried as u64);
        let found = windows.best(&walker.gait, response, log.stop, &told).map_err(|_| stopped())?;
        told_window(observer, robot, &found, count);
        with.stimulus.margin = found.margins;
        Ok(with)
    }

    fn groups(&self) -> &[Vec<u8>; 2] {
        self.config.task.groups.as_ref().expect("a training has two groups")
    }

    /// The training images as a gait sees them by a config; both groups weigh the same.
    fn images(&self, gait: &Gait, config: &Config) -> Result<Vec<Image>, Error> {
        let Trainer { training, probing, .. } = self;
        let all = probing.conditions();
        let [first, _] = self.groups();
        let ways = balanced(training.images.iter().map(|image| image.label), first);
        let image = |((image, condition), (right, weight)): ((&ImageRef, &Condition), (f64, f64))| {
            let stimulus = see(config, self.dataset, Split::Train, image.index)?;
            let condition = all.iter().position(|other| other == condition).expect("it is one of all");
            let example = Example { right, weight, ..Example::new(gait, &stimulus, &config.physics) };
            Ok(Image { stimulus, example, condition })
        };
        training.images.iter().zip(&training.conditions).zip(ways).map(image).collect()
    }

    fn plan(&self) -> Plan {
        let train = &self.config.train;
        Plan {
            seed: self.config.seed,
            rounds: train.rounds,
            images: train.images,
            final_images: train.final_images,
            challengers: train.challengers,
            min_muscles: self.config.body.min_muscles,
        }
    }

    /// Teaches all gaits in one round, and goes on with the one that could be taught most.
    fn train<'w>(
        &self,
        walkers: &'w [Walker<'w>],
        log: &mut Log,
        observer: &dyn Observer,
    ) -> Result<(&'w Walker<'w>, Config, Taught), Error> {
        let plan = self.plan();
        let Trainer { config, probing, .. } = self;
        let mut best: Option<(&Walker, Config, Teacher)> = None;
        for (walker, measured) in walkers.iter().zip(&self.measured) {
            let (gait, robot) = (&walker.gait, &walker.robot.id);
            log.begins(format!("{robot}: response:"), self.config.train.random_images);
            let Some(response) = self.response(gait, measured, log)? else { continue };
            told_response(observer, &walker.robot.id, gait, &response);
            let seeing = match plan.rounds {
                // It keeps its own sensors, which are for the images as it sees them.
                0 => Config { train: TrainConfig { windows: 0, ..config.train }, ..(*config).clone() },
                _ => self.with_window(walker, &response, log, observer)?,
            };
            let images = self.images(gait, &seeing)?;
            let mut teacher = Teacher::new(gait, &response, images, plan, &config.physics);
            let conditions = probing.conditions();
            log.begins_round(robot, 1, &plan);
            let mut rollouts = Kept { config, conditions, log };
            if plan.rounds == 0 {
                let fitness = teacher.own(&mut rollouts)?;
                told_own(observer, &walker.robot.id, fitness);
                best = Some((walker, seeing, teacher));
                break;
            }
            told_round(observer, &walker.robot.id, &teacher.round(&mut rollouts)?, &plan);
            if best.as_ref().is_none_or(|(_, _, best)| teacher.predicted() > best.predicted()) {
                best = Some((walker, seeing, teacher));
            }
        }
        let Some((walker, seeing, mut teacher)) = best else {
            let text = "none of the chosen robots is stable with random images: there is nothing to train";
            return Err(Error::input(text.to_string()).hint("choose others with --robots".to_string()));
        };
        let mut rollouts = Kept { config, conditions: probing.conditions(), log };
        for number in 2..=plan.rounds {
            rollouts.log.begins_round(&walker.robot.id, number, &plan);
            let round = teacher.round(&mut rollouts)?;
            told_round(observer, &walker.robot.id, &round, &plan);
        }
        let challengers = teacher.challengers();
        rollouts.log.begins_challenges(challengers);
        let told = |challenge: &Challenge| told_challenge(observer, challenge, challengers);
        Ok((walker, seeing, teacher.finish(&mut rollouts, told)?))
    }
}

fn told_response(observer: &dyn Observer, robot: &str, gait: &Gait, response: &Response) {
    let (places, share) = (gait.places().len(), number::fixed(100.0 * response.r_squared, 0));
    let noise = number::fixed(response.noise, 1);
    observer.note(&format!(
        "{robot}: {places} soft voxels and sensors explain {share} % of its response; the rest is {noise} voxel lengths"
    ));
}

fn told_window(observer: &dyn Observer, robot: &str, found: &Found, tried: usize) {
    let Found { margins, predicted, predicted_before } = found;
    let [after, before] = [predicted, predicted_before].map(|fitness| number::fixed(*fitness, 2));
    observer.note(&format!(
        "{robot}: of {tried} windows, stimulus.margin = {margins} is predicted to be best: fitness {after}, before {before}"
    ));
    observer.finding(
        "window",
        &serde_json::json!({
            "robot": robot, "windows": tried, "margin": margins, "predicted": predicted,
            "predicted_before": predicted_before,
        }),
    );
}

fn told_own(observer: &dyn Observer, robot: &str, fitness: f64) {
    observer.note(&format!("{robot}: fitness {} as it is", number::fixed(fitness, 2)));
    observer.finding("own", &serde_json::json!({ "robot": robot, "fitness": fitness }));
}

fn told_round(observer: &dyn Observer, robot: &str, round: &Round, plan: &Plan) {
    let Round { round, predicted, measured, off, changed, rollouts } = round;
    let [p, m] = [predicted, measured].map(|fitness| number::fixed(*fitness, 2));
    observer.note(&format!("{robot}: round {round} of {}: fitness {m}, predicted {p}", plan.rounds));
    observer.finding(
        "round",
        &serde_json::json!({
            "robot": robot, "round": round, "rollouts": rollouts, "predicted": predicted, "measured": measured,
            "off": off,
            "changed": changed,
        }),
    );
}

fn told_challenge(observer: &dyn Observer, challenge: &Challenge, challengers: usize) {
    let Challenge { number, other_gait, shown, fitness, won } = challenge;
    let what = if *other_gait { "another gait" } else { "other sensors" };
    if *won {
        let fitness = number::fixed(*fitness, 3);
        observer.note(&format!("challenger {number} of {challengers}: {what}: fitness {fitness}"));
    }
    observer.progress(*number as u64);
    observer.finding(
        "challenge",
        &serde_json::json!({
            "challenger": number, "other_gait": other_gait, "images": shown, "fitness": fitness, "won": won,
        }),
    );
}

/// The run with the robot that was taught.
fn run_file(
    options: &Options,
    config: &Config,
    training: &Training,
    origin: Origin,
    walker: &Walker,
    taught: &Taught,
) -> Result<RunFile, Error> {
    let body = taught.body.clone();
    let genome = walker.robot.genome.with_body(&body).map_err(|error| Error::other(error.to_string()))?;
    let training_images: Vec<ImageRef> = taught.shown.iter().map(|image| training.images[*image]).collect();
    let grouping = config.grouping()?.with_fitness(config.evaluation.fitness);
    let answers =
        crate::store::images::answers(&training_images, taught.displacements.iter().copied().map(Some));
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
        origin: Some(origin),
        generations: 1,
        stats,
        elites: archive.elites().map(|elite| elite.solution.clone()).collect(),
        read_sha256: None,
    })
}
