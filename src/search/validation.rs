//! Choosing robots by their answers to images that are neither training nor test images.
//!
//! [`held_out`](crate::images::held_out) draws the images. Robots are screened in rounds: all on a
//! tenth of them, the better third of each task on three tenths, the better tenth on all. The
//! results are kept beside the run.

use crate::base::error::{Error, ErrorKind};
use crate::base::files::write_atomically;
use crate::base::hash::sha256_hex;
use crate::base::session::Session;
use crate::config::Config;
use crate::config::validation::ValidationConfig;
use crate::data::dataset::{Dataset, Split};
use crate::images::held_out::images;
use crate::images::whereabouts::{Whereabouts, load_dataset_of, stimuli_of};
use crate::robots;
use crate::robots::selection::{Chosen, Selection, first_physical};
use crate::search::held_out_run;
use crate::search::held_out_run::HeldOutRun;
use crate::search::held_out_run::Trial;
use crate::store::eval::RobotReport;
use crate::store::images::ImageRef;
use crate::store::names::VALIDATION_JSON;
use crate::store::run::{Robot, RunFile};
use crate::store::stored_run::StoredRun;
use crate::store::validation::{FORMAT, Ranking, Validated, ValidationFile};
use crate::task::answer;
use crate::task::grouping;
use crate::task::grouping::Grouping;
use std::collections::BTreeMap;
use std::mem::replace;
use std::path::{Path, PathBuf};

/// A screening round: fewer robots of a task than before, on more images.
struct Round {
    /// Fraction of the images used.
    image_share: f64,
    /// Fraction of the robots of each task that take part.
    robot_share: f64,
}

/// With fewer images in round one, good robots are lost by chance; with more, it takes longer.
const ROUNDS: [Round; 3] = [
    Round {
        image_share: 0.1,
        robot_share: 1.0,
    },
    Round {
        image_share: 0.3,
        robot_share: 1.0 / 3.0,
    },
    Round {
        image_share: 1.0,
        robot_share: 0.1,
    },
];

#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted {
    pub(crate) count: usize,
    pub(crate) images: usize,
    /// Command-line argument that set `images`; `None` if the config did.
    pub(crate) argument: Option<&'static str>,
    /// Threshold up to which displacements count as wrong \[voxel lengths\].
    pub(crate) threshold: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct ValidationOptions {
    pub(crate) archive: PathBuf,
    /// Number of robots of each task; `None`: that of the config.
    pub(crate) best: Option<usize>,
}

/// Chooses the best robots of a run on its `[validation]` images, evaluated as by `eval`, and keeps
/// them beside the run; `None` if stopped.
pub(crate) fn validate(
    options: &ValidationOptions,
    session: &Session,
) -> Result<Option<Vec<Validated>>, Error> {
    let source = robots::open(&options.archive)?;
    let config = &source.run.config;
    let count = options.best.unwrap_or(config.validation.best);
    let whereabouts = Whereabouts::given(session.data_folder()).and_of(&source.path);
    let dataset = load_dataset_of(
        Some(&source.run.dataset),
        config,
        &whereabouts,
        &[Split::Train],
    )?;
    rank(&source, count, &dataset, session)
}

/// Chooses as many robots as the config of a finished run wants, with data already loaded.
pub(crate) fn at_end(
    archive: &Path,
    dataset: &Dataset,
    session: &Session,
) -> Result<Option<Vec<Validated>>, Error> {
    let source = StoredRun::read(archive)?;
    rank(&source, source.run.config.validation.best, dataset, session)
}

fn rank(
    source: &StoredRun,
    count: usize,
    dataset: &Dataset,
    session: &Session,
) -> Result<Option<Vec<Validated>>, Error> {
    let config = &source.run.config;
    let grouping = config.grouping()?;
    let control_steps = held_out_run::control_steps(config, held_out_run::CYCLES);
    let walker = HeldOutRun::new(config, control_steps, 0, session)?;
    let chosen = Selection::Validated(count).of(std::slice::from_ref(source), 0)?;
    let skilled = |robot: &&Robot| held_out_run::task_of(&grouping, robot).is_some();
    let robots = chosen
        .iter()
        .map(|chosen| chosen.robot)
        .filter(skilled)
        .collect();
    let images = config.validation.images;
    let wanted = Wanted {
        count,
        images,
        argument: None,
        threshold: answer::THRESHOLD,
    };
    let best = best_of_run(source, dataset, &grouping, robots, &wanted, &walker)?;
    Ok(best.map(|best| best.into_iter().map(|(_, validated)| validated).collect()))
}

/// Returns the best (physical) robots of each run and task with results; `None` if stopped.
pub(crate) fn best_of_runs<'a>(
    sources: &'a [StoredRun],
    robots: &[Chosen<'a>],
    selection: &Selection,
    dataset: &Dataset,
    grouping: &Grouping,
    wanted: &Wanted,
    walker: &impl Fn() -> Result<HeldOutRun<'a>, Error>,
) -> Result<Option<Vec<(Chosen<'a>, Validated)>>, Error> {
    let mut all = Vec::new();
    for (number, source) in sources.iter().enumerate() {
        let own = robots
            .iter()
            .filter(|chosen| chosen.source == number)
            .map(|chosen| chosen.robot)
            .collect();
        let is_physical = matches!(selection, Selection::Physical(_));
        // Some may not be physical: validate as many as the run does at its end.
        let count = if is_physical {
            wanted.count.max(source.run.config.validation.best)
        } else {
            wanted.count
        };
        let searched = Wanted { count, ..*wanted };
        let Some(ranked) = best_of_run(source, dataset, grouping, own, &searched, &walker()?)?
        else {
            return Ok(None);
        };
        let ranked = if is_physical {
            first_physical(ranked, source, wanted.count)?
        } else {
            ranked
        };
        all.extend(ranked.into_iter().map(|(robot, score)| {
            (
                Chosen {
                    source: number,
                    robot,
                },
                score,
            )
        }));
    }
    Ok(Some(all))
}

/// Returns the best robots of each task of a run, best first, with results; `None` if stopped.
pub(crate) fn best_of_run<'a>(
    source: &'a StoredRun,
    dataset: &Dataset,
    grouping: &Grouping,
    robots: Vec<&'a Robot>,
    wanted: &Wanted,
    walker: &HeldOutRun,
) -> Result<Option<Vec<(&'a Robot, Validated)>>, Error> {
    let run = &source.run;
    let images = images(&[run], dataset, wanted.argument, wanted.images)?;
    // If fewer are wanted than the run chooses at its end, return the first of those.
    let searched = &Wanted {
        count: wanted.count.max(run.config.validation.best),
        ..*wanted
    };
    let shown = (
        dataset
            .fingerprint(Split::Train)
            .expect("its images were drawn just now"),
        &images[..],
    );
    let key = key(run, &robots, searched, shown, walker.control_steps);
    let path = source.path.with_file_name(VALIDATION_JSON);
    let known = ValidationFile::read(&path)?;
    let by_id = |validated: &Validated| {
        let robot = robots
            .iter()
            .find(|robot| robot.id == validated.id && robot.task == validated.task)?;
        Some((*robot, validated.clone()))
    };
    let first = |all: &[Validated]| {
        let before = |place: usize, task: &str| {
            all[..place]
                .iter()
                .filter(|other| other.task == task)
                .count()
        };
        let is_first =
            |(place, robot): &(usize, &Validated)| before(*place, &robot.task) < wanted.count;
        all.iter()
            .enumerate()
            .filter(is_first)
            .filter_map(|(_, robot)| by_id(robot))
            .collect()
    };
    if let Some(robots) = known.as_ref().and_then(|file| file.of(&key)) {
        return Ok(Some(first(robots)));
    }
    let Some(chosen) = screened(run, dataset, grouping, &robots, searched, &images, walker)? else {
        return Ok(None);
    };
    let found = first(&chosen);
    let run_sha256 = run.fingerprint();
    let mut file = known
        .filter(|file| file.run_sha256 == run_sha256)
        .unwrap_or_else(|| ValidationFile {
            format: FORMAT.0.to_string(),
            format_version: FORMAT.1,
            run_sha256,
            key: String::new(),
            robots: Vec::new(),
            others: Vec::new(),
        });
    match is_own(run, &robots, searched, walker.control_steps) {
        true => (file.key, file.robots) = (key, chosen),
        false => file.others.push(Ranking {
            key,
            robots: chosen,
        }),
    }
    let text =
        serde_json::to_string(&file).map_err(|error| Error::other(error.to_string()))? + "\n";
    if let Err(error) = write_atomically(&path, text.as_bytes()) {
        let error = Error::writing(&path, &error);
        if error.kind == ErrorKind::Lost {
            return Err(error);
        }
        walker
            .session
            .observer
            .warning(&format!("{error}; the next time robots are chosen anew"));
    }
    Ok(Some(found))
}

/// Returns true if all robots of a run are validated with the settings of its config.
fn is_own(run: &RunFile, robots: &[&Robot], wanted: &Wanted, control_steps: u32) -> bool {
    let ValidationConfig { images, best } = run.config.validation;
    let Ok(grouping) = run.config.grouping() else {
        return false;
    };
    let all = run
        .elites
        .iter()
        .filter(|robot| held_out_run::task_of(&grouping, robot).is_some())
        .count();
    let usual = (
        images,
        answer::THRESHOLD,
        held_out_run::control_steps(&run.config, held_out_run::CYCLES),
    );
    (wanted.images, wanted.threshold, control_steps) == usual
        && (best == 0 || wanted.count == best)
        && robots.len() == all
}

fn key(
    run: &RunFile,
    robots: &[&Robot],
    wanted: &Wanted,
    (data, images): (String, &[ImageRef]),
    control_steps: u32,
) -> String {
    let ids: Vec<&str> = robots.iter().map(|robot| robot.id.as_str()).collect();
    let images: Vec<usize> = images.iter().map(|image| image.index).collect();
    let Wanted {
        count, threshold, ..
    } = wanted;
    sha256_hex(
        format!(
            "{} {} {data} {ids:?} {count} {images:?} {threshold} {control_steps}",
            env!("CARGO_PKG_VERSION"),
            run.fingerprint()
        )
        .as_bytes(),
    )
}

/// Returns the numbers of robots and images in each round; classes alternate, so each has an image.
fn rounds(robots: usize, count: usize, (images, classes): (usize, usize)) -> [(usize, usize); 3] {
    ROUNDS.map(
        |Round {
             image_share,
             robot_share,
         }| {
            let kept = ((robots as f64 * robot_share).ceil() as usize)
                .max(count)
                .min(robots);
            (
                kept,
                ((images as f64 * image_share).ceil() as usize)
                    .max(classes)
                    .min(images),
            )
        },
    )
}

fn screened(
    run: &RunFile,
    dataset: &Dataset,
    grouping: &Grouping,
    robots: &[&Robot],
    &Wanted {
        count, threshold, ..
    }: &Wanted,
    images: &[ImageRef],
    walker: &HeldOutRun,
) -> Result<Option<Vec<Validated>>, Error> {
    let config: &Config = &run.config;
    let stimuli = stimuli_of(config, dataset, Split::Train, images)?;
    let split_of = |robot: &Robot| -> Option<&grouping::ClassSplit> {
        grouping
            .tasks()
            .iter()
            .find(|split| split.is_called(&robot.task))
    };
    let mut tasks = BTreeMap::<&str, Vec<&Robot>>::new();
    robots
        .iter()
        .for_each(|robot| tasks.entry(&robot.task).or_default().push(robot));
    let of = (images.len(), config.classes().len());
    let showings = |all: &Vec<&Robot>| {
        let mut before = 0;
        rounds(all.len(), count, of)
            .map(|(robots, shown)| robots * (shown - replace(&mut before, shown)))
    };
    let showings = tasks.values().flat_map(showings);
    walker.validating(robots.len(), images.len(), showings.sum::<usize>() as u64);
    let mut chosen = Vec::new();
    for (_, all) in tasks {
        // Pairs each robot with its displacements so far.
        let mut left: Vec<_> = all.iter().map(|robot| (*robot, Vec::new())).collect();
        let mut scores = Vec::new();
        for (keep, shown) in rounds(all.len(), count, of) {
            left.truncate(keep);
            scores = Vec::with_capacity(left.len());
            for (robot, mut displacements) in left {
                let Some(split) = split_of(robot) else {
                    continue;
                };
                let Some((others, _)) =
                    walker.rollouts(robot, &stimuli[displacements.len()..shown])
                else {
                    return Ok(None);
                };
                displacements.extend(others);
                let trial = Trial {
                    run,
                    robot,
                    split,
                    images: &images[..shown],
                    threshold,
                };
                scores.push((robot, RobotReport::new(&trial, displacements, 0)));
            }
            // The sort is stable: ties keep the order of the round before, at first by fitness.
            scores.sort_by(|(_, a), (_, b)| b.balanced_accuracy.total_cmp(&a.balanced_accuracy));
            left = scores
                .iter()
                .map(|(robot, report)| (*robot, report.displacements.clone()))
                .collect();
        }
        chosen.extend(
            scores
                .into_iter()
                .take(count)
                .map(|(robot, report)| Validated {
                    id: robot.id.clone(),
                    task: robot.task.clone(),
                    images: report.images,
                    right: report.right,
                    balanced_accuracy: report.balanced_accuracy,
                }),
        );
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
