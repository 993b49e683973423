//! Choosing robots by their answers to images that are neither training nor test images.
//!
//! [`held_out`](super::held_out) says which images. Robots are screened in rounds: all on a tenth of them, the better third
//! of each task on three tenths, the better tenth on all. Results are kept beside the run.

use super::archive::{Robot, RunFile};
use super::eval::{self, Observer, Walker};
use super::eval_file::{RobotReport, Trial};
use super::held_out::images;
use super::physical::first_physical;
use super::robots::{Chosen, Selection, Source};
use super::training::{ImageRef, load_dataset_of, see};
use super::whereabouts::Whereabouts;
use super::{Config, Error, toml_text};
use crate::base::files::{read_text, write_atomically};
use crate::base::hash::sha256_hex;
use crate::task::dataset::{Dataset, Split};
use crate::task::grouping::{self, Grouping};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::mem::replace;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64};

/// Its name beside `run.json`.
pub const VALIDATION_JSON: &str = "validation.json";

/// What `validation.json` calls itself, and the version of its schema.
const FORMAT: (&str, u32) = ("morphcog-validation", 1);

/// A round: of the images, and of the robots of each task the share that gets so far.
const ROUNDS: [(f64, f64); 3] = [(0.1, 1.0), (0.3, 1.0 / 3.0), (1.0, 0.1)];

/// Least number of validation images.
pub const LEAST: usize = 40;

/// Validation at a run's end: section `[validation]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationConfig {
    /// Images in all, evenly divided between the classes; none of them is trained on. Default 400.
    pub images: usize,
    /// Robots of each task that are chosen by them at the run's end. Default 0: nothing is done then.
    pub best: usize,
}

impl Default for ValidationConfig {
    fn default() -> Self {
        ValidationConfig { images: 400, best: 0 }
    }
}

impl ValidationConfig {
    /// Whether a file needs not say it.
    pub(super) fn is_default(&self) -> bool {
        *self == ValidationConfig::default()
    }
}

/// How robots are to be chosen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// So many of each task.
    pub count: usize,
    /// Images in all.
    pub images: usize,
    /// Displacements up to this count as wrong \[voxel lengths\].
    pub threshold: f64,
}

/// How a robot did on all validation images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Validated {
    /// Its id.
    pub id: String,
    /// Its task.
    pub task: String,
    /// Images.
    pub images: usize,
    /// Images answered right.
    pub right: usize,
    /// Mean over the two groups of the share answered right.
    pub balanced_accuracy: f64,
}

/// The content of `validation.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ValidationFile {
    format: String,
    format_version: u32,
    /// SHA-256 of the run's content: of a run that has gone on since, this says nothing.
    run_sha256: String,
    /// SHA-256 of all that the result depends on.
    key: String,
    /// The best of each task, best first.
    robots: Vec<Validated>,
}

impl ValidationFile {
    /// What is in a file; `None` if that cannot be read: then robots are chosen anew.
    fn read(path: &Path) -> Option<Self> {
        let text = read_text(path).ok()?;
        toml_text::read_versioned(&text, &path.display().to_string(), FORMAT.0, FORMAT.1).ok()
    }
}

/// Which robots of a run are to be chosen.
#[derive(Clone, Debug)]
pub struct Options {
    /// The run.json.
    pub archive: PathBuf,
    /// How many of each task; `None`: as the config says.
    pub best: Option<usize>,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// Number of threads; `None`: one per core.
    pub threads: Option<usize>,
}

/// Chooses the best robots of a run on the images of its section `[validation]`, as `eval` does it, and keeps them beside
/// the run; `None` if stopped.
///
/// # Errors
/// What is wrong with run or data, or that there are not enough images.
pub fn validate(
    options: &Options,
    stop: &AtomicBool,
    observer: &dyn Observer,
) -> Result<Option<Vec<Validated>>, Error> {
    let source = Source::read(&options.archive)?;
    let config = &source.run.config;
    let count = options.best.unwrap_or(config.validation.best);
    let whereabouts = Whereabouts::given(options.data.as_deref()).and_of(&source.path);
    let dataset = load_dataset_of(Some(&source.run.dataset), config, &whereabouts, &[Split::Train])?;
    let pool = eval::pool(options.threads)?;
    ranked(&source, count, &dataset, &pool, stop, observer)
}

/// The same when a run ends, of the so many best that its config asks for, on data that are loaded already.
///
/// # Errors
/// As of [`validate`].
pub(super) fn at_end(
    archive: &Path,
    dataset: &Dataset,
    pool: &rayon::ThreadPool,
    stop: &AtomicBool,
    observer: &dyn Observer,
) -> Result<Option<Vec<Validated>>, Error> {
    let source = Source::read(archive)?;
    ranked(&source, source.run.config.validation.best, dataset, pool, stop, observer)
}

fn ranked(
    source: &Source,
    count: usize,
    dataset: &Dataset,
    pool: &rayon::ThreadPool,
    stop: &AtomicBool,
    observer: &dyn Observer,
) -> Result<Option<Vec<Validated>>, Error> {
    let config = &source.run.config;
    let grouping = config.grouping()?;
    let control_steps = eval::control_steps(config, eval::CYCLES);
    let walker = Walker { config, control_steps, pool, stop, observer, done: AtomicU64::new(0) };
    let chosen = Selection::Validated(count).of(std::slice::from_ref(source), 0)?;
    let skilled = |robot: &&Robot| eval::task_of(&grouping, robot).is_some();
    let robots = chosen.iter().map(|chosen| chosen.robot).filter(skilled).collect();
    let wanted = Wanted { count, images: config.validation.images, threshold: eval::THRESHOLD };
    let best = best(source, dataset, &grouping, robots, &wanted, &walker)?;
    Ok(best.map(|best| best.into_iter().map(|(_, validated)| validated).collect()))
}

/// The best robots of a run on validation images, as far as they are known for the run as it is; `None` if none are.
pub(super) fn ranking(source: &Source) -> Option<Vec<Validated>> {
    let file = ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))?;
    (file.run_sha256 == source.run.fingerprint() && !file.robots.is_empty()).then_some(file.robots)
}

/// How many images the robots in the `validation.json` beside a run were chosen by; `None` without such a file.
pub(super) fn shown(source: &Source) -> Option<usize> {
    ValidationFile::read(&source.path.with_file_name(VALIDATION_JSON))?
        .robots
        .first()
        .map(|robot| robot.images)
}

/// The best of each run and task among some robots, or the best physical ones if the selection says so, with how they did;
/// `None` if stopped.
///
/// # Errors
/// As of [`best`] and [`first_physical`].
pub(super) fn chosen<'a>(
    sources: &'a [Source],
    robots: &[Chosen<'a>],
    selection: &Selection,
    dataset: &Dataset,
    grouping: &Grouping,
    wanted: &Wanted,
    walker: &impl Fn() -> Walker<'a>,
) -> Result<Option<Vec<(Chosen<'a>, Validated)>>, Error> {
    let mut all = Vec::new();
    for (number, source) in sources.iter().enumerate() {
        let own = robots.iter().filter(|chosen| chosen.source == number).map(|chosen| chosen.robot).collect();
        let is_physical = matches!(selection, Selection::Physical(_));
        // Among those that are known at the run's end, in any case, since some will not be physical.
        let count =
            if is_physical { wanted.count.max(source.run.config.validation.best) } else { wanted.count };
        let searched = Wanted { count, ..*wanted };
        let Some(ranked) = best(source, dataset, grouping, own, &searched, &walker())? else {
            return Ok(None);
        };
        let ranked = if is_physical { first_physical(ranked, source, wanted.count)? } else { ranked };
        all.extend(ranked.into_iter().map(|(robot, score)| (Chosen { source: number, robot }, score)));
    }
    Ok(Some(all))
}

/// The best of each task among some robots of a run, best first, with how they did; `None` if stopped.
///
/// # Errors
/// If there are not enough images, or the result cannot be kept.
pub(super) fn best<'a>(
    source: &'a Source,
    dataset: &Dataset,
    grouping: &Grouping,
    robots: Vec<&'a Robot>,
    wanted: &Wanted,
    walker: &Walker,
) -> Result<Option<Vec<(&'a Robot, Validated)>>, Error> {
    let run = &source.run;
    let images = images(&[run], dataset, "--validation", wanted.images)?;
    // Whoever asks for fewer than the run's end has found gets the first of those.
    let searched = &Wanted { count: wanted.count.max(run.config.validation.best), ..*wanted };
    let shown = (dataset.fingerprint(Split::Train).expect("its images were drawn just now"), &images[..]);
    let key = key(run, &robots, searched, shown, walker.control_steps);
    let path = source.path.with_file_name(VALIDATION_JSON);
    let known = ValidationFile::read(&path);
    let by_id = |validated: &Validated| {
        let robot = robots.iter().find(|robot| robot.id == validated.id && robot.task == validated.task)?;
        Some((*robot, validated.clone()))
    };
    let first = |all: &[Validated]| {
        let before =
            |place: usize, task: &str| all[..place].iter().filter(|other| other.task == task).count();
        let is_first = |(place, robot): &(usize, &Validated)| before(*place, &robot.task) < wanted.count;
        all.iter().enumerate().filter(is_first).filter_map(|(_, robot)| by_id(robot)).collect()
    };
    if let Some(file) = known.filter(|file| file.key == key) {
        return Ok(Some(first(&file.robots)));
    }
    let Some(chosen) = screened(run, dataset, grouping, &robots, searched, &images, walker)? else {
        return Ok(None);
    };
    let file = ValidationFile {
        format: FORMAT.0.to_string(),
        format_version: FORMAT.1,
        run_sha256: run.fingerprint(),
        key,
        robots: chosen,
    };
    let text = serde_json::to_string(&file).map_err(|error| Error::other(error.to_string()))? + "\n";
    if let Err(error) = write_atomically(&path, text.as_bytes()) {
        let error = Error::writing(&path, &error);
        walker.observer.warning(&format!("{error}; the next time robots are chosen anew"));
    }
    Ok(Some(first(&file.robots)))
}

/// Of all that the result depends on.
fn key(
    run: &RunFile,
    robots: &[&Robot],
    wanted: &Wanted,
    (data, images): (String, &[ImageRef]),
    control_steps: u32,
) -> String {
    let ids: Vec<&str> = robots.iter().map(|robot| robot.id.as_str()).collect();
    let images: Vec<usize> = images.iter().map(|image| image.index).collect();
    let Wanted { count, threshold, .. } = wanted;
    sha256_hex(
        format!(
            "{} {} {data} {ids:?} {count} {images:?} {threshold} {control_steps}",
            env!("CARGO_PKG_VERSION"),
            run.fingerprint()
        )
        .as_bytes(),
    )
}

/// Robots and images of each round, for some robots of a task of which `count` are wanted; of each class, which take turns, an image
/// or more.
fn rounds(robots: usize, count: usize, (images, classes): (usize, usize)) -> [(usize, usize); 3] {
    ROUNDS.map(|(of_images, of_robots)| {
        let kept = ((robots as f64 * of_robots).ceil() as usize).max(count).min(robots);
        (kept, ((images as f64 * of_images).ceil() as usize).max(classes).min(images))
    })
}

fn screened(
    run: &RunFile,
    dataset: &Dataset,
    grouping: &Grouping,
    robots: &[&Robot],
    &Wanted { count, threshold, .. }: &Wanted,
    images: &[ImageRef],
    walker: &Walker,
) -> Result<Option<Vec<Validated>>, Error> {
    let config: &Config = &run.config;
    let stimuli: Result<Vec<_>, Error> =
        images.iter().map(|image| see(config, dataset, Split::Train, image.index)).collect();
    let stimuli = stimuli?;
    let split_of = |robot: &Robot| -> Option<&grouping::Split> {
        grouping.tasks().iter().find(|split| split.name() == robot.task)
    };
    let mut tasks = BTreeMap::<&str, Vec<&Robot>>::new();
    robots.iter().for_each(|robot| tasks.entry(&robot.task).or_default().push(robot));
    let of = (images.len(), config.classes().len());
    let showings = |all: &Vec<&Robot>| {
        let mut before = 0;
        rounds(all.len(), count, of).map(|(robots, shown)| robots * (shown - replace(&mut before, shown)))
    };
    let showings = tasks.values().flat_map(showings);
    walker.validating(robots.len(), images.len(), showings.sum::<usize>() as u64);
    let mut chosen = Vec::new();
    for (_, all) in tasks {
        // With its displacements so far.
        let mut left: Vec<_> = all.iter().map(|robot| (*robot, Vec::new())).collect();
        let mut scores = Vec::new();
        for (keep, shown) in rounds(all.len(), count, of) {
            left.truncate(keep);
            scores = Vec::with_capacity(left.len());
            for (robot, mut displacements) in left {
                let Some(split) = split_of(robot) else { continue };
                let Some((others, _)) = walker.lives(robot, &stimuli[displacements.len()..shown]) else {
                    return Ok(None);
                };
                displacements.extend(others);
                let trial = Trial { run, robot, split, images: &images[..shown], threshold };
                scores.push((robot, RobotReport::new(&trial, displacements, 0)));
            }
            // Stable: equals stay in the order of the round before, at first of their fitness.
            scores.sort_by(|(_, a), (_, b)| b.balanced_accuracy.total_cmp(&a.balanced_accuracy));
            left = scores.iter().map(|(robot, report)| (*robot, report.displacements.clone())).collect();
        }
        chosen.extend(scores.into_iter().take(count).map(|(robot, report)| Validated {
            id: robot.id.clone(),
            task: robot.task.clone(),
            images: report.images,
            right: report.right,
            balanced_accuracy: report.balanced_accuracy,
        }));
    }
    Ok(Some(chosen))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_round_shows_every_class_and_the_last_one_all_images() {
        for of in [(40, 10), (40, 2), (400, 4)] {
            let rounds = rounds(100, 3, of);
            assert!(rounds.iter().all(|(_, shown)| *shown >= of.1), "{rounds:?}");
            assert_eq!((rounds[0].0, rounds[2]), (100, (10, of.0)));
        }
    }
}
