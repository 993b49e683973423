//! `morphcog train`: trains gaits to tell images apart.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::text::counted;
use crate::config::Config;
use crate::data::dataset::Split;
use crate::images::training::TrainingImages;
use crate::images::whereabouts;
use crate::images::whereabouts::Whereabouts;
use crate::qd::{Archive, DescriptorSpace, Elite};
use crate::response::probing::Probing;
use crate::robots;
use crate::robots::selection::{Selection, VALIDATED};
use crate::search::validation;
use crate::shipped;
use crate::store::folder::{self, IfExists, RunFolder};
use crate::store::images::ImageRef;
use crate::store::metrics::{Metrics, Totals};
use crate::store::names::{RUN_JSON, TRAINING_JSON};
use crate::store::run::{Robot, RunFile};
use crate::store::training::Origin;
use crate::store::validation::Validated;
use crate::task::grouping::Groups;
use crate::training::gaits::{Candidate, candidates, key, measured, origin};
use crate::training::log::Log;
use crate::training::rounds::TrainedDesign;
use crate::training::trainer::Trainer;
use crate::training::{self, check_groups, config_of, with_fitting_margin, with_images};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Default number of gaits to try of a single run.
pub const GAITS_OF_ONE: usize = 4;
/// Default number of gaits to try of each of several runs.
pub const GAITS_OF_EACH: usize = 5;

/// The gaits to train, the task, and the output folder.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// Path of the run.json with the gaits.
    pub archive: PathBuf,
    /// Robots whose gaits are tried; the one with the best prediction is trained.
    pub robots: Selection,
    /// The two groups of classes.
    pub groups: Groups,
    /// Seed of all random numbers; `None`: that of the run.
    pub seed: Option<u64>,
    /// Config keys that differ from those of the run, as `train.rounds=10`.
    pub set: Vec<String>,
    /// Name of the new run.
    pub name: String,
    /// Its folder.
    pub out: PathBuf,
    /// Action if the folder already has a run.
    pub if_exists: IfExists,
}

/// The result of a training.
#[derive(Clone, Debug)]
pub struct TrainOutcome {
    /// The run as written to `run.json`.
    pub run: RunFile,
    /// Total number of rollouts simulated, without validation.
    pub rollouts: usize,
    /// Height and width of the training images.
    pub(crate) size: [usize; 2],
    /// Results on validation images; `None` if validation was stopped.
    pub(crate) validated: Option<Vec<Validated>>,
}

impl TrainOutcome {
    /// Returns false if it was stopped while validating the robot.
    pub fn is_validated(&self) -> bool {
        self.validated.is_some()
    }
}

/// Trains a robot and validates it.
///
/// # Errors
/// Returns an error if the archive, an option, the data or the folder is unsuitable, or if it was
/// stopped ([`IfExists::Resume`] continues it). No existing results are lost,
/// except those that it is to replace ([`IfExists::Overwrite`]).
pub fn train(options: &TrainOptions, session: &Session) -> Result<TrainOutcome, Error> {
    if options.robots.validated().is_some() {
        let text = "expected another selection: gaits have no task to validate";
        let error = Error::argument("robots", VALIDATED, text);
        return Err(error.remedy(Remedy::ChooseRobots(Some("top:4"))));
    }
    let source = robots::open(&options.archive)?;
    let whereabouts = Whereabouts::given(session.data_folder())
        .and_of_resumed(options.if_exists, &options.out.join(RUN_JSON))
        .and_of(&options.archive);
    let config = config_of(
        &source.run.config,
        options.groups.classes(),
        options.seed,
        &options.set,
    )?;
    let dataset = whereabouts.load(&config.data, &[Split::Train])?;
    let config = config.with_names_of(&dataset);
    check_groups(&options.groups, &dataset)?;
    whereabouts::say_transposed(&dataset, &config.data, session);
    let of_gaits = &source.run;
    let config = with_fitting_margin(
        config,
        &of_gaits.dataset,
        &of_gaits.config,
        &dataset,
        &options.set,
        session,
    );
    let origin = origin(&source, &config, &dataset)?;
    let config = with_images(config, &origin.trained_on, &dataset, session)?;
    let mut training = TrainingImages::of(&config, &dataset)?;
    let classes = training.images.iter().map(|image| image.label);
    training.conditions = config.train.perturbations.of(classes);
    let walkers = candidates(&source, &options.robots, &config.train, config.seed)?;
    // The seed is that of the gaits: a response holds for every task and training seed.
    let probing = Probing::new(&training.conditions, source.run.config.seed);
    let measured = measured(&source, &config, &probing, &walkers, session);
    let [log, run] = [TRAINING_JSON, RUN_JSON].map(|name| options.out.join(name));
    if options.if_exists == IfExists::Resume && run.exists() && !log.exists() {
        let text = format!(
            "{}: the run in this folder is no training",
            options.out.display()
        );
        return Err(Error::occupied(text)
            .remedy(Remedy::ChooseOut)
            .remedy(Remedy::Replace));
    }
    apart(&options.out, &source.path)?;
    let folder = RunFolder::open(&options.out, options.if_exists, session)?;
    let key = key(&config, source.run.config.seed, &walkers, &training);
    let mut log = Log::open(log, key, session)?;
    folder.write_config(&config)?;
    whereabouts::remember(&folder, &dataset)?;
    let pool = session.pool()?;
    let began = Instant::now();
    let (gaits, images) = (walkers.len(), training.images.len());
    session.observer.note(&format!(
        "training in {}: {}, {images} training images",
        folder.path().display(),
        counted(gaits, "gait", "gaits")
    ));
    let trainer = Trainer {
        config: &config,
        dataset: &dataset,
        training: &training,
        probing,
        measured,
    };
    let taught = pool.install(|| trainer.train(&walkers, &mut log, session));
    // Rollouts are saved even after an error.
    log.save()?;
    let (walker, config, taught) = taught?;
    let run = run_file(options, &config, &training, origin, walker, &taught)?;
    let seconds = began.elapsed().as_secs_f64();
    let totals = Totals {
        evaluations: 1,
        simulated: log.simulated as u64,
        seconds,
        ..Totals::default()
    };
    let mut metrics = Metrics::open(folder.path(), 0)?;
    metrics.write(0, &run.stats, &totals)?;
    metrics.flush()?;
    folder.write_run(&run)?;
    let archive = folder.path().join(RUN_JSON);
    let validated = match config.validation.best {
        0 => Some(Vec::new()),
        _ => validation::at_end(&archive, &dataset, session)?,
    };
    let size = dataset
        .size(Split::Train)
        .expect("a training loads its training images");
    Ok(TrainOutcome {
        run,
        rollouts: log.simulated,
        size,
        validated,
    })
}

/// Parses the two groups of classes of a task, such as `4|9` or `cat|dog`, for gaits of a run.
///
/// # Errors
/// Returns an error if the run, a key of `set` or the task is unsuitable.
pub fn groups(
    archive: &Path,
    task: &str,
    set: &[String],
    data: Option<&Path>,
) -> Result<Groups, Error> {
    let of_gaits = robots::open(archive)?;
    let whereabouts = Whereabouts::given(data).and_of(archive);
    let groups = training::groups_of(task, &of_gaits.run.config, set, &whereabouts);
    groups.map_err(|error| match error.argument {
        None => error.about("task"),
        Some(_) => error,
    })
}

/// Returns the name of a training: the archive's folder and the task.
pub fn name(archive: &Path, groups: &Groups, seed: Option<u64>) -> String {
    let folder = archive
        .parent()
        .and_then(Path::file_name)
        .map(|name| name.to_string_lossy());
    let of = match shipped::name(archive) {
        Some((of, "")) => of,
        Some((_, name)) => name,
        None => folder.as_deref().unwrap_or("run"),
    };
    let seed = seed.map_or(String::new(), |seed| format!("-seed{seed}"));
    format!("{of}-{}{seed}", groups.in_files())
}

/// Returns the default folder of a training of this name: beside that of the gaits, or in `runs`.
pub fn default_out(archive: &Path, name: &str) -> PathBuf {
    let beside = match shipped::is_named(archive) {
        true => Some(Path::new(folder::RUNS)),
        false => archive.parent().and_then(|folder| folder.parent()),
    };
    beside.map_or_else(|| PathBuf::from(name), |folder| folder.join(name))
}

/// Checks that the output folder is not that of the gaits, whose run would be overwritten.
fn apart(out: &Path, archive: &Path) -> Result<(), Error> {
    let of_gaits = archive.parent().map(|folder| Path::new(".").join(folder));
    let [out_now, of_gaits] = [Some(out), of_gaits.as_deref()]
        .map(|folder| folder.and_then(|folder| folder.canonicalize().ok()));
    if out_now.is_some() && out_now == of_gaits {
        let text = "expected another folder: the gaits are in this one";
        return Err(Error::argument("out", out.display(), text));
    }
    Ok(())
}

fn run_file(
    options: &TrainOptions,
    config: &Config,
    training: &TrainingImages,
    origin: Origin,
    walker: &Candidate,
    taught: &TrainedDesign,
) -> Result<RunFile, Error> {
    let body = taught.body.clone();
    let genome = walker
        .robot
        .genome
        .with_body(&body)
        .map_err(|error| Error::other(error.to_string()))?;
    let training_images: Vec<ImageRef> = taught
        .shown
        .iter()
        .map(|image| training.images[*image])
        .collect();
    let grouping = config.grouping()?.with_fitness(config.evaluation.fitness);
    let answers = crate::store::images::answers(
        &training_images,
        taught.displacements.iter().copied().map(Some),
    );
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
    let space = DescriptorSpace::voxel_counts(grouping.tasks().len());
    let cell = space
        .index(&robot.cell)
        .expect("bins of voxel counts are a cell of one task's archive");
    let mut archive = Archive::new();
    let elite = Elite {
        cell,
        objective: robot.objective,
        solution: robot,
    };
    archive
        .insert(elite)
        .map_err(|error| Error::other(error.to_string()))?;
    let data = (&training.dataset, training_images);
    Ok(RunFile {
        origin: Some(origin),
        ..RunFile::new(&options.name, config, data, 1, &archive)?
    })
}
