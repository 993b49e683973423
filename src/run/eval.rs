//! `morphcog eval`: how well robots do on held-out images (paper, "Generalization test").

use super::archive::Robot;
use super::eval_file::{Baselines, EvalFile, RobotReport, Trial};
use super::robots::{Chosen, Selection, Source};
use super::training::{ImageRef, load_dataset, see};
use super::validation::{self, Validated};
use super::{Config, Error, folder::RunFolder, gallery};
use crate::base::Grid;
use crate::base::files::{check_writable, write_atomically};
use crate::sim::Lattice;
use crate::task::baselines::{Labelled, best_pixel, larger_group, nearest_training_image};
use crate::task::dataset::{Dataset, Split};
use crate::task::grouping::{self, Grouping};
use crate::task::protocol::{Life, Protocol};
use crate::task::rollout::{fresh_life, same_to_sensors};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Training images per class on which the single-pixel baseline is chosen.
const PIXEL_IMAGES_PER_CLASS: usize = 500;

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
    /// Test images in all, evenly divided between the classes.
    pub images: usize,
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

/// The images of a test and how robots see them.
struct Test {
    images: Vec<ImageRef>,
    stimuli: Vec<Grid<f64>>,
}

/// Evaluates robots; results are written after every robot, so that stopping keeps what is finished.
///
/// # Errors
/// What is wrong with archive, data or selection.
pub fn eval(options: &Options, stop: &AtomicBool, observer: &dyn Observer) -> Result<EvalFile, Error> {
    if !(options.threshold >= 0.0 && options.threshold.is_finite()) {
        return Err(Error::usage(format!(
            "--threshold {}: expected 0 or more voxel lengths",
            options.threshold
        )));
    }
    let sources: Vec<Source> = match options.archives.as_slice() {
        [] => vec![gallery::source(options.data.as_deref())?],
        archives => archives.iter().map(|path| Source::read(path)).collect::<Result<_, _>>()?,
    };
    let first = &sources[0];
    for source in &sources {
        check_out(&options.out, &source.path)?;
        same_setting(first, source)?;
    }
    let config = &first.run.config;
    let validated = options.validation.unwrap_or(config.validation.images);
    if options.robots.validated().is_some() && validated < validation::LEAST {
        let least = validation::LEAST;
        return Err(Error::usage(format!("--validation {validated}: expected {least} or more images")));
    }
    let grouping = config.grouping()?;
    let dataset = load_dataset(config, options.data.as_deref(), &Split::ALL)?;
    if dataset.fingerprint(Split::Train).unwrap_or_default() != first.run.dataset.train_sha256 {
        observer.warning("the training images here are not those the run was made with (another SHA-256)");
    }
    let robots = options.robots.of(&sources, options.seed)?;
    let (robots, unskilled): (Vec<Chosen>, Vec<Chosen>) =
        robots.into_iter().partition(|chosen| task_of(&grouping, chosen.robot).is_some());
    if let Some(chosen) = unskilled.first() {
        let (count, id) = (unskilled.len(), &chosen.robot.id);
        observer.warning(&format!("{count} robots ({id} …) walk the same way for every class; left out"));
    }
    let test = test_images(config, &dataset, options)?;
    let test_sha256 = dataset.fingerprint(Split::Test).unwrap_or_default();
    let steps = control_steps(config, options.cycles);
    let mut report = EvalFile::new(&sources, options, steps, &test.images, test_sha256);
    report.baselines = baselines(&sources, &grouping, &dataset, &test, &robots, options.seed)?;
    let pool = pool(options.threads)?;
    let walker =
        || Walker { config, control_steps: steps, pool: &pool, stop, observer, done: AtomicU64::new(0) };
    let (robots, scores): (Vec<Chosen>, Vec<Validated>) = match options.robots.validated() {
        None => (robots, Vec::new()),
        Some(count) => {
            let wanted = validation::Wanted { count, images: validated, threshold: options.threshold };
            let Some(best) = validation::chosen(
                &sources,
                &robots,
                &options.robots,
                &dataset,
                &grouping,
                &wanted,
                &walker,
            )?
            else {
                report.stopped = true;
                return Ok(report);
            };
            best.into_iter().unzip()
        }
    };
    observer.started(robots.len(), test.images.len());
    let walker = walker();
    let mut scores = scores.into_iter();
    let mut left = robots.len();
    report.stopped = left > 0;
    for Chosen { source, robot } in robots {
        let Some(split) = task_of(&grouping, robot) else { continue };
        let Some((displacements, simulated)) = walker.lives(robot, &test.stimuli) else { break };
        left -= 1;
        report.stopped = left > 0;
        let run = &sources[source].run;
        let trial = Trial { run, robot, split, images: &test.images, threshold: options.threshold };
        let (validation, of_trial) = (scores.next(), RobotReport::new(&trial, displacements, simulated));
        report.robots.push(RobotReport { run: source, validation, ..of_trial });
        report.conclude();
        write(options, &report)?;
    }
    Ok(report)
}

/// So many threads; `None`: one per core.
pub(super) fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|error| Error::other(format!("no threads: {error}")))
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

/// The recognition task a robot performs; none if it always walks the same way.
pub(super) fn task_of<'a>(grouping: &'a Grouping, robot: &Robot) -> Option<&'a grouping::Split> {
    grouping.tasks().iter().find(|split| split.name() == robot.task && !split.is_same_way())
}

/// Whether the results can be written, and overwrite neither each other nor a file of the run.
pub(super) fn check_out(out: &Path, archive: &Path) -> Result<(), Error> {
    let refuse = |text: &str| Err(Error::usage(format!("--out {}: {text}", out.display())));
    let csv = out.with_extension("csv");
    if csv == *out {
        return refuse("expected another ending: the CSV beside the results has that name");
    }
    let folder_of =
        |path: &Path| path.parent().and_then(|folder| Path::new(".").join(folder).canonicalize().ok());
    let same_folder = folder_of(out) == folder_of(archive);
    for path in [out, csv.as_path()] {
        let name = path.file_name();
        let is_of_run = RunFolder::files().iter().any(|own| name == Some(own.as_ref()));
        if same_folder && (is_of_run || name == archive.file_name()) {
            return refuse("expected another name: this would overwrite a file of the run");
        }
        check_writable(path).map_err(|error| Error::writing(path, &error))?;
    }
    Ok(())
}

fn write(options: &Options, report: &EvalFile) -> Result<(), Error> {
    let csv_path = options.out.with_extension("csv");
    let csv = report.to_csv().map_err(|error| Error::other(error.to_string()))?;
    for (path, content) in [(&options.out, report.to_json().into_bytes()), (&csv_path, csv)] {
        write_atomically(path, &content).map_err(|error| Error::writing(path, &error))?;
    }
    Ok(())
}

/// `count` test images, evenly divided between the classes; the first classes get what is left over.
fn test_images(config: &Config, dataset: &Dataset, options: &Options) -> Result<Test, Error> {
    let classes = config.classes();
    if options.images < classes.len() {
        let (asked, least) = (options.images, classes.len());
        return Err(Error::usage(format!("--images {asked}: expected {least} or more, one of each class")));
    }
    let mut test = Test { images: Vec::new(), stimuli: Vec::new() };
    for (place, &class) in classes.iter().enumerate() {
        let count = options.images / classes.len() + usize::from(place < options.images % classes.len());
        let drawn = dataset.draw(Split::Test, &[class], count, options.seed, 0);
        let drawn = drawn.map_err(|error| {
            let most = classes.iter().map(|&c| dataset.indices_of(Split::Test, c).len()).min().unwrap_or(0);
            let hint = format!("ask for at most --images {}", most * classes.len());
            Error::input(error.to_string()).hint(hint)
        })?;
        for index in drawn {
            test.stimuli.push(see(config, dataset, Split::Test, index)?);
            test.images.push(ImageRef { index, label: class });
        }
    }
    Ok(test)
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
        let lattice = Lattice::new(&robot.body, &config.physics);
        let views: Vec<&Grid<f64>> = stimuli.iter().collect();
        let same_as = same_to_sensors(&robot.body, &views);
        let mut shared = BTreeMap::<usize, u64>::new();
        same_as.iter().for_each(|&first| *shared.entry(first).or_default() += 1);
        let life = |(&image, &count): (&usize, &u64)| {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let displacement = fresh_life(&lattice, &config.physics, &protocol, &stimuli[image]).ok();
            observer.progress(done.fetch_add(count, Ordering::Relaxed) + count);
            Some((image, displacement))
        };
        let lives: Option<BTreeMap<usize, Option<f64>>> =
            self.pool.install(|| shared.par_iter().map(life).collect());
        let lives = lives?;
        Some((same_as.iter().map(|first| lives.get(first).copied().flatten()).collect(), lives.len()))
    }
}

fn view(list: &[(Grid<f64>, u8)]) -> Vec<Labelled<'_>> {
    list.iter().map(|(stimulus, class)| Labelled { stimulus, class: *class }).collect()
}

/// The baselines of every task that the robots perform.
fn baselines(
    sources: &[Source],
    grouping: &Grouping,
    dataset: &Dataset,
    test: &Test,
    robots: &[Chosen],
    seed: u64,
) -> Result<BTreeMap<String, Baselines>, Error> {
    let Some(config) = sources.first().map(|source| &source.run.config) else { return Ok(BTreeMap::new()) };
    let classes = config.classes();
    let labelled = |images: &[ImageRef]| -> Result<Vec<(Grid<f64>, u8)>, Error> {
        images
            .iter()
            .map(|image| Ok((see(config, dataset, Split::Train, image.index)?, image.label)))
            .collect()
    };
    let mut choice = Vec::new();
    for &class in &classes {
        let count = dataset.indices_of(Split::Train, class).len().min(PIXEL_IMAGES_PER_CLASS);
        let drawn = dataset.draw(Split::Train, &[class], count, seed, 0);
        let drawn = drawn.map_err(|error| Error::input(error.to_string()))?;
        choice.extend(drawn.into_iter().map(|index| ImageRef { index, label: class }));
    }
    let choice = labelled(&choice)?;
    let templates: Result<Vec<_>, Error> =
        sources.iter().map(|source| labelled(&source.run.training_images)).collect();
    let templates = templates?;
    let tested = test.stimuli.iter().zip(&test.images);
    let tested: Vec<Labelled> =
        tested.map(|(stimulus, image)| Labelled { stimulus, class: image.label }).collect();
    let mut all = BTreeMap::new();
    for split in robots.iter().filter_map(|chosen| task_of(grouping, chosen.robot)) {
        if all.contains_key(&split.name()) {
            continue;
        }
        let rule = best_pixel(split, &view(&choice));
        let nearest = |of_run: &Vec<_>| nearest_training_image(split, &view(of_run), &tested);
        let baselines = Baselines {
            larger_group: larger_group(split, &tested),
            best_single_pixel: rule.map_or(0.0, |rule| rule.accuracy(split, &tested)),
            pixel: rule.map_or([0, 0], |rule| [rule.row, rule.column]),
            nearest_training_image: templates.iter().map(nearest).sum::<f64>() / templates.len() as f64,
        };
        all.insert(split.name(), baselines);
    }
    Ok(all)
}
