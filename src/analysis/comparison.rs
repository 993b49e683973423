//! Comparing runs: the config keys in which they differ, and their archives and robots side by
//! side.
//!
//! Accuracies are compared image by image, and only of robots with the same task on the same
//! images. Runs are summarised together only if they are repetitions: nothing but the seed differs.

use crate::analysis::progress::{Progress, spoken};
use crate::base::error::Error;
use crate::base::statistics::{bootstrap, holm, mcnemar, standard_deviation};
use crate::base::text::counted;
use crate::config::{Config, Settings, flatten};
use crate::qd::ArchiveStats;
use crate::robots::selection::Selection;
use crate::search::held_out_run::task_of;
use crate::shipped::exists;
use crate::store::eval::{EvalFile, RobotReport};
use crate::store::folder;
use crate::store::metrics::Moment;
use crate::store::names::METRICS;
use crate::store::run::{Robot, RunFile};
use crate::store::stored_run::StoredRun;
use crate::store::validation::ranking;
use crate::task::answer::{Assignment, Direction, is_correct};
use crate::task::grouping::{ClassSplit, Grouping};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;

/// Adjusted p-values from here on are not significant.
const LEVEL: f64 = 0.05;

/// A run to compare, and what is known of it.
pub(crate) struct Subject<'a> {
    /// The name in tables and figures.
    pub(crate) name: String,
    pub(crate) path: &'a Path,
    pub(crate) run: &'a RunFile,
    /// Its history, if it has one.
    pub(crate) progress: Option<&'a Progress>,
    /// Its chosen robots, at most one of each task; the first is shown.
    pub(crate) robots: Vec<&'a Robot>,
    /// Tests that may hold results of these robots; the first that does counts.
    pub(crate) tests: Vec<&'a EvalFile>,
}

/// Runs side by side.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Comparison {
    /// The runs, in the given order.
    pub(crate) runs: Vec<ComparedRun>,
    /// The config keys in which any of them differ.
    pub(crate) keys: Vec<DifferingKey>,
    /// The results of their robots on held-out images, task by task.
    pub(crate) accuracies: Vec<ComparedAccuracy>,
    /// The groups of two or more runs that differ in nothing but the seed.
    pub(crate) repetitions: Vec<Repetitions>,
    /// What cannot be compared, and why, in words.
    pub(crate) notes: Vec<String>,
}

/// A run of a comparison.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ComparedRun {
    /// The name in tables.
    pub(crate) name: String,
    /// The path of its run.json, or its name if it ships.
    pub(crate) archive: String,
    pub(crate) seed: u64,
    /// The number of generations completed.
    pub(crate) generations: u64,
    pub(crate) possible_cells: usize,
    #[serde(flatten)]
    pub(crate) stats: ArchiveStats,
    /// Its history, generation by generation; empty if it has none.
    #[serde(skip)]
    pub(crate) curve: Vec<Moment>,
    /// The robot to show.
    #[serde(skip)]
    pub(crate) robot: Option<Robot>,
}

/// A config key with its value in each run; none where a run has no such key.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct DifferingKey {
    pub(crate) key: String,
    pub(crate) values: Vec<Option<toml::Value>>,
    /// These values for people.
    #[serde(skip)]
    pub(crate) texts: Vec<String>,
}

/// The result of a run's robot on held-out images.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ComparedAccuracy {
    /// The index of its run.
    pub(crate) run: usize,
    pub(crate) robot: String,
    pub(crate) task: String,
    /// The number of images answered correctly.
    pub(crate) right: usize,
    pub(crate) images: usize,
    pub(crate) accuracy: f64,
    /// The 95 % Wilson interval of the accuracy.
    pub(crate) interval: [f64; 2],
    pub(crate) balanced_accuracy: f64,
    /// The difference from the first run's robot; `None` for that one, and where not paired.
    pub(crate) difference: Option<PairedDifference>,
}

/// The difference of two robots' accuracies on the same images.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct PairedDifference {
    /// The accuracy less that of the first run's robot.
    pub(crate) mean: f64,
    /// Its 95 % interval: a bootstrap over the images, which both robots saw.
    pub(crate) interval: [f64; 2],
    /// The number of images that only this robot answered correctly.
    pub(crate) only_this: usize,
    /// The number of images that only the first run's robot answered correctly.
    pub(crate) only_first: usize,
    /// The p-value of McNemar's exact test.
    pub(crate) p: f64,
    /// That p-value, adjusted for the number of comparisons (Holm 1979).
    pub(crate) p_adjusted: f64,
}

impl PairedDifference {
    pub(crate) fn is_significant(&self) -> bool {
        self.p_adjusted < LEVEL
    }

    /// Returns the conclusion in a word or two.
    pub(crate) fn verdict(&self) -> &'static str {
        match (self.is_significant(), self.mean > 0.0) {
            (false, _) => "not significant",
            (true, true) => "more accurate",
            (true, false) => "less accurate",
        }
    }
}

/// Runs that differ in nothing but the seed.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Repetitions {
    /// The indices of the runs.
    pub(crate) runs: Vec<usize>,
    pub(crate) quantities: Vec<Quantity>,
}

/// The mean and spread of a quantity over repetitions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Quantity {
    /// "QD score", "coverage", or "accuracy" with the task.
    pub(crate) name: String,
    pub(crate) mean: f64,
    /// The standard deviation over the runs.
    pub(crate) standard_deviation: f64,
    pub(crate) least: f64,
    pub(crate) largest: f64,
    /// True if it is a fraction, which people read in percent.
    #[serde(skip)]
    pub(crate) is_share: bool,
}

impl Quantity {
    /// Summarises the values of two or more runs.
    fn of(name: String, values: &[f64], is_share: bool) -> Option<Self> {
        Some(Quantity {
            name,
            mean: values.iter().sum::<f64>() / values.len() as f64,
            standard_deviation: standard_deviation(values)?,
            least: values.iter().copied().fold(f64::INFINITY, f64::min),
            largest: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            is_share,
        })
    }
}

/// A robot's answers to the images of a test.
struct Tested<'a> {
    run: usize,
    file: &'a EvalFile,
    report: &'a RobotReport,
    split: ClassSplit,
    /// Actuation cycles per image.
    cycles: u32,
    /// Whether it answered each image correctly.
    right: Vec<bool>,
}

impl<'a> Tested<'a> {
    /// Finds the results of a run's robot; `None` if no test has them.
    fn find(number: usize, subject: &Subject<'a>, robot: &Robot, sha256: &str) -> Option<Self> {
        let config = &subject.run.config;
        let is_it = |file: &EvalFile, report: &RobotReport| {
            (&report.id, &report.task) == (&robot.id, &robot.task)
                && file
                    .runs
                    .get(report.run)
                    .is_some_and(|run| run.sha256 == sha256)
        };
        let (file, report) = subject.tests.iter().find_map(|file| {
            let report = file.robots.iter().find(|report| is_it(file, report))?;
            Some((*file, report))
        })?;
        let grouping: Grouping = config.grouping().ok()?;
        let split = task_of(&grouping, robot)?.clone();
        let a = Direction::named(&report.first_group_walks)?;
        let is_right = |label: u8, walk: &Option<f64>| {
            is_correct(&split, Assignment { a }, label, *walk, file.threshold).unwrap_or(false)
        };
        let walks = file.images.iter().zip(&report.displacements);
        let right = walks
            .map(|(image, walk)| is_right(image.label, walk))
            .collect();
        Some(Tested {
            run: number,
            file,
            report,
            cycles: file.control_steps / config.physics.cycle_steps.max(1),
            right,
            split,
        })
    }

    /// Returns why the answers cannot be compared image by image; `None` if they can.
    fn unpaired(&self, first: &Tested) -> Option<&'static str> {
        let data = |tested: &Tested| {
            let file = tested.file;
            let train = file
                .setting
                .as_ref()
                .map(|setting| setting.train_sha256.clone());
            (file.dataset.clone(), train, file.test_sha256.clone())
        };
        let of_test = |tested: &Tested| (tested.file.split, tested.cycles);
        if data(self) != data(first) {
            Some("other data")
        } else if self.split != first.split {
            Some("another task")
        } else if self.file.images != first.file.images {
            Some("other images")
        } else if of_test(self) != of_test(first) || self.file.threshold != first.file.threshold {
            Some("other conditions")
        } else {
            None
        }
    }
}

/// Returns the difference between two robots by their answers to the same images, the p-value not
/// yet adjusted; `None` for fewer than two images.
fn difference(this: &[bool], first: &[bool]) -> Option<PairedDifference> {
    let both = || this.iter().zip(first);
    let count = |only: [bool; 2]| both().filter(|(a, b)| [**a, **b] == only).count();
    let [only_this, only_first] = [[true, false], [false, true]].map(count);
    let right = |answer: bool| f64::from(u8::from(answer));
    let differences: Vec<f64> = both()
        .map(|(this, first)| right(*this) - right(*first))
        .collect();
    let mean = (only_this as f64 - only_first as f64) / differences.len().max(1) as f64;
    let p = mcnemar(only_this, only_first);
    Some(PairedDifference {
        mean,
        interval: bootstrap(&[differences])?,
        only_this,
        only_first,
        p,
        p_adjusted: p,
    })
}

/// Compares runs, the first with each of the others.
pub(crate) fn compare(subjects: &[Subject]) -> Comparison {
    let names: Vec<&str> = subjects
        .iter()
        .map(|subject| subject.name.as_str())
        .collect();
    let run = |subject: &Subject| ComparedRun {
        name: subject.name.clone(),
        archive: folder::name(subject.path),
        seed: subject.run.config.seed,
        generations: subject.run.generations,
        possible_cells: subject.run.dimensions.possible_cells,
        stats: subject.run.stats,
        curve: subject
            .progress
            .map_or(Vec::new(), |found| found.moments.clone()),
        robot: subject.robots.first().map(|robot| (*robot).clone()),
    };
    let runs: Vec<ComparedRun> = subjects.iter().map(run).collect();
    let tested: Vec<Tested> = subjects
        .iter()
        .enumerate()
        .flat_map(|(number, subject)| {
            let sha256 = subject.run.fingerprint();
            let find = |robot: &&Robot| Tested::find(number, subject, robot, &sha256);
            subject.robots.iter().filter_map(find).collect::<Vec<_>>()
        })
        .collect();
    let accuracies = accuracies(&tested);
    let mut notes = unpaired(&tested, &names);
    notes.extend(unknown(subjects, &tested, &names));
    Comparison {
        keys: differing_keys(subjects),
        repetitions: repetitions(subjects, &tested),
        runs,
        accuracies,
        notes,
    }
}

/// Returns the first run's result of a robot's task.
fn first_of<'t, 'a>(tested: &Tested, all: &'t [Tested<'a>]) -> Option<&'t Tested<'a>> {
    all.iter()
        .find(|first| first.run == 0 && first.split == tested.split)
        .filter(|_| tested.run > 0)
}

/// Returns the results of all robots, those of one task together, with differences from the first
/// run's.
fn accuracies(tested: &[Tested]) -> Vec<ComparedAccuracy> {
    let of_one = |one: &Tested| {
        let RobotReport {
            id,
            right,
            images,
            accuracy,
            interval,
            balanced_accuracy,
            ..
        } = one.report;
        let first = first_of(one, tested).filter(|first| one.unpaired(first).is_none());
        ComparedAccuracy {
            run: one.run,
            robot: id.clone(),
            task: one.split.name(),
            right: *right,
            images: *images,
            accuracy: *accuracy,
            interval: *interval,
            balanced_accuracy: *balanced_accuracy,
            difference: first.and_then(|first| difference(&one.right, &first.right)),
        }
    };
    let mut all: Vec<ComparedAccuracy> = tested.iter().map(of_one).collect();
    let found = |one: &ComparedAccuracy| one.difference.as_ref().map(|found| found.p);
    let adjusted = holm(&all.iter().filter_map(found).collect::<Vec<f64>>());
    let differences = all.iter_mut().filter_map(|one| one.difference.as_mut());
    differences
        .zip(adjusted)
        .for_each(|(difference, p)| difference.p_adjusted = p);
    let tasks: Vec<String> = all.iter().map(|one| one.task.clone()).collect();
    // The sort is stable: runs keep their order within a task.
    all.sort_by_key(|one| tasks.iter().position(|task| *task == one.task));
    all
}

/// Says of which runs no accuracy is paired with the first run's, and why.
fn unpaired(tested: &[Tested], names: &[&str]) -> Vec<String> {
    let mut reasons: Vec<(&str, BTreeSet<usize>)> = Vec::new();
    let paired: BTreeSet<usize> = tested
        .iter()
        .filter(|one| first_of(one, tested).is_some_and(|first| one.unpaired(first).is_none()))
        .map(|one| one.run)
        .collect();
    let any_of_first = tested.iter().find(|one| one.run == 0);
    let others = tested
        .iter()
        .filter(|one| one.run > 0 && !paired.contains(&one.run));
    for one in others {
        // Of other data, its task is another one, whatever it is called.
        let first = first_of(one, tested).or(any_of_first);
        let Some(reason) = first.and_then(|first| one.unpaired(first)) else {
            continue;
        };
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, runs)) => _ = runs.insert(one.run),
            None => reasons.push((reason, BTreeSet::from([one.run]))),
        }
    }
    let said = |(reason, runs): (&str, BTreeSet<usize>)| {
        format!(
            "{}: accuracy not paired with that of {}: {reason}",
            listed(runs, names),
            names[0]
        )
    };
    reasons.into_iter().map(said).collect()
}

/// Says which runs have no accuracy or no history, and which scores have other meanings.
fn unknown(subjects: &[Subject], tested: &[Tested], names: &[&str]) -> Vec<String> {
    let those = |is_one: &dyn Fn(usize, &Subject) -> bool| -> Option<String> {
        let found = subjects.iter().enumerate();
        let found: BTreeSet<usize> = found
            .filter(|(number, subject)| is_one(*number, subject))
            .map(|(number, _)| number)
            .collect();
        (!found.is_empty()).then(|| listed(found, names))
    };
    let gaits = those(&|_, subject| subject.run.config.measures_response());
    let is_idle = |subject: &Subject| {
        let grouping = subject.run.config.grouping();
        let has_task = |robot: &&Robot| {
            grouping
                .as_ref()
                .is_ok_and(|grouping| task_of(grouping, robot).is_some())
        };
        !subject.run.config.measures_response() && !subject.robots.iter().any(has_task)
    };
    let idle = those(&|_, subject| is_idle(subject));
    let untested = those(&|number, subject| {
        let is_able = !subject.run.config.measures_response() && !is_idle(subject);
        is_able && tested.iter().all(|one| one.run != number)
    });
    let without_curve = those(&|_, subject| subject.progress.is_none());
    let first = subjects.first().map(|subject| subject.run);
    let scores_of = |run: &RunFile| (run.fitness(), run.config.archive.qd_offset);
    let other_scores =
        those(&|_, subject| first.is_some_and(|run| scores_of(run) != scores_of(subject.run)));
    let mut notes = Vec::new();
    notes.extend(gaits.map(|runs| {
        format!("{runs}: no accuracy, since gaits tell no images apart before they are trained")
    }));
    notes.extend(idle.map(|runs| {
        format!("{runs}: no accuracy, since its robot walks the same way for every class")
    }));
    notes.extend(untested.map(|runs| format!("{runs}: no accuracy, not tested")));
    notes.extend(without_curve.map(|runs| format!("{runs}: no curves, without {METRICS}")));
    notes.extend(other_scores.map(|runs| {
        format!(
            "{runs}: another fitness or archive.qd_offset than {}; QD scores and fitnesses are not \
             comparable",
            names[0]
        )
    }));
    notes
}

/// Lists the names of runs, at most a few of them.
pub(crate) fn listed(runs: impl IntoIterator<Item = usize>, names: &[&str]) -> String {
    const MOST: usize = 4;
    let runs: Vec<&str> = runs.into_iter().map(|run| names[run]).collect();
    match runs.len() {
        0..=MOST => runs.join("; "),
        all => {
            let more = counted(all - MOST + 1, "other run", "other runs");
            format!("{} and {more}", runs[..MOST - 1].join("; "))
        }
    }
}

/// Returns the keys in which the configs of any runs differ, in alphabetical order.
fn differing_keys(subjects: &[Subject]) -> Vec<DifferingKey> {
    let all: Vec<Settings> = subjects
        .iter()
        .map(|subject| every_key(&subject.run.config))
        .collect();
    let keys: BTreeSet<&String> = all.iter().flat_map(|settings| settings.keys()).collect();
    let differs = |key: &&String| all.iter().any(|other| other.get(*key) != all[0].get(*key));
    let with_values = |key: &String| {
        let values: Vec<Option<toml::Value>> = all
            .iter()
            .map(|settings| settings.get(key).cloned())
            .collect();
        let text = |(value, subject): (&Option<toml::Value>, &Subject)| {
            let names = subject.run.config.class_names();
            value
                .as_ref()
                .map_or("–".to_string(), |value| spoken(value, &names))
        };
        DifferingKey {
            key: key.clone(),
            texts: values.iter().zip(subjects).map(text).collect(),
            values,
        }
    };
    keys.into_iter().filter(differs).map(with_values).collect()
}

fn every_key(config: &Config) -> Settings {
    let mut settings = Settings::new();
    let root = toml::Value::try_from(config);
    flatten(
        "",
        root.expect("every field is a number, text, list or table, which TOML has"),
        &mut settings,
    );
    settings
}

/// Groups runs that differ in nothing but the seed, and summarises each group.
fn repetitions(subjects: &[Subject], tested: &[Tested]) -> Vec<Repetitions> {
    let about = |run: &RunFile| {
        let mut settings = run.config.settings();
        settings.remove("seed");
        let origin = run
            .origin
            .as_ref()
            .map(|of| (of.name.clone(), of.generations));
        (settings, run.generations, run.dataset.clone(), origin)
    };
    let seed = |number: usize| subjects[number].run.config.seed;
    let mut groups: Vec<(_, Vec<usize>)> = Vec::new();
    for (number, subject) in subjects.iter().enumerate() {
        let about = about(subject.run);
        let is_of = |(known, members): &&mut (_, Vec<usize>)| {
            *known == about && members.iter().all(|&member| seed(member) != seed(number))
        };
        match groups.iter_mut().find(is_of) {
            Some((_, members)) => members.push(number),
            None => groups.push((about, vec![number])),
        }
    }
    groups
        .into_iter()
        .filter(|(_, members)| members.len() > 1)
        .map(|(_, runs)| summarised(runs, subjects, tested))
        .collect()
}

fn summarised(runs: Vec<usize>, subjects: &[Subject], tested: &[Tested]) -> Repetitions {
    let of_archives = |of: fn(&ArchiveStats) -> f64| -> Vec<f64> {
        runs.iter()
            .map(|&run| of(&subjects[run].run.stats))
            .collect()
    };
    let mut quantities = Vec::new();
    let mut splits: Vec<&ClassSplit> = Vec::new();
    for one in tested.iter().filter(|one| one.run == runs[0]) {
        if !splits.contains(&&one.split) {
            splits.push(&one.split);
        }
    }
    for split in splits {
        let of_run = |run: &usize| {
            tested
                .iter()
                .find(|one| one.run == *run && one.split == *split)
        };
        let all: Vec<&Tested> = runs.iter().filter_map(of_run).collect();
        let are_alike = all.iter().all(|one| one.unpaired(all[0]).is_none());
        if all.len() == runs.len() && are_alike {
            let values: Vec<f64> = all.iter().map(|one| one.report.accuracy).collect();
            let name = format!("accuracy {}", split.name());
            quantities.extend(Quantity::of(name, &values, true));
        }
    }
    let scores = of_archives(|stats| stats.qd_score);
    quantities.extend(Quantity::of("QD score".to_string(), &scores, false));
    let coverage = of_archives(|stats| stats.coverage);
    quantities.extend(Quantity::of("coverage".to_string(), &coverage, true));
    Repetitions { runs, quantities }
}

/// Returns the best robot of each task of a run: the first on validation images if the run ranked
/// robots by them, else the fittest. Of a run without tasks it is the fittest robot.
///
/// # Errors
/// Returns an error if the archive is empty, a file beside it is not readable, or an audit of
/// robots that must be physical is missing.
pub(crate) fn best_of_each_task(
    source: &StoredRun,
    physical_only: bool,
) -> Result<Vec<&Robot>, Error> {
    let selection = Selection::All.physical(physical_only);
    let fittest = selection.of(std::slice::from_ref(source), 0)?;
    let ranked = ranking(source)?.unwrap_or_default();
    let grouping = source.run.config.grouping()?;
    let best_of = |split: &ClassSplit| -> Option<&Robot> {
        let able = || {
            let all = fittest.iter().map(|one| one.robot);
            all.filter(|robot| split.is_called(&robot.task))
        };
        let with_rank = ranked.iter().filter(|of| split.is_called(&of.task));
        let with_rank = with_rank
            .filter_map(|of| Some((able().find(|one| one.id == of.id)?, of.balanced_accuracy)));
        // On a tie the earlier one stays, which was fitter.
        let first = with_rank.reduce(|best, one| if one.1 > best.1 { one } else { best });
        first.map(|(robot, _)| robot).or_else(|| able().next())
    };
    let splits = grouping.tasks().iter().filter(|split| !split.is_same_way());
    let mut best: Vec<&Robot> = splits.filter_map(best_of).collect();
    if best.is_empty() {
        best.extend(fittest.first().map(|one| one.robot));
    }
    Ok(best)
}

/// Reads the history of a run; `None` without one.
///
/// # Errors
/// Returns an error if there is a metrics.csv that is not of this run, or not readable.
pub(crate) fn history(run: &RunFile, archive: &Path) -> Result<Option<Progress>, Error> {
    match exists(&archive.with_file_name(METRICS)) {
        true => Progress::of(run, archive).map(Some),
        false => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::samples;
    use std::path::PathBuf;

    /// Returns answers of which so many are correct, of images from a place on.
    fn answers(images: usize, from: usize, right: usize) -> Vec<bool> {
        (0..images)
            .map(|image| (from..from + right).contains(&image))
            .collect()
    }

    #[test]
    fn what_is_not_significant_is_not_called_a_difference() {
        let first = answers(100, 0, 80);
        let of = |this: &[bool]| difference(this, &first).unwrap();
        let same = of(&first);
        assert_eq!((same.mean, same.interval, same.p), (0.0, [0.0, 0.0], 1.0));
        assert_eq!(same.verdict(), "not significant");
        // Five images more, none less: p = 2/2⁵, though the bootstrap interval excludes 0.
        let few = of(&answers(100, 0, 85));
        assert_eq!((few.only_this, few.only_first, few.p), (5, 0, 0.0625));
        assert!(
            few.interval[0] > 0.0 && few.verdict() == "not significant",
            "{few:?}"
        );
        assert_eq!(of(&answers(100, 0, 88)).verdict(), "more accurate");
        assert_eq!(of(&answers(100, 0, 60)).verdict(), "less accurate");
        // As accurate, but on other images.
        let other = of(&answers(100, 20, 80));
        assert_eq!(
            (other.only_this, other.only_first, other.mean),
            (20, 20, 0.0)
        );
        assert!(other.interval[0] < -0.05 && other.interval[1] > 0.05);
        assert_eq!(difference(&[true], &[true]), None);
    }

    #[test]
    fn only_runs_that_differ_in_nothing_but_the_seed_are_repetitions() {
        let run = |seed: u64, parents: u16, generations: u64| {
            let mut run = samples::run(&[("a", 1.0 + seed as f64)]);
            run.config.seed = seed;
            run.config.map_elites.parents = parents;
            run.generations = generations;
            run
        };
        let runs = [
            run(1, 20, 5),
            run(2, 40, 5),
            run(2, 20, 5),
            run(3, 20, 6),
            run(2, 20, 5),
        ];
        let paths: Vec<PathBuf> = (0..runs.len())
            .map(|number| PathBuf::from(format!("{number}/run.json")))
            .collect();
        let subject = |run, path| Subject {
            name: String::new(),
            path,
            run,
            progress: None,
            robots: Vec::new(),
            tests: Vec::new(),
        };
        let subjects: Vec<Subject> = runs
            .iter()
            .zip(&paths)
            .map(|(run, path)| subject(run, path))
            .collect();
        let found = compare(&subjects);
        let groups: Vec<&Vec<usize>> = found.repetitions.iter().map(|group| &group.runs).collect();
        // The last has the seed of one that is in already.
        assert_eq!(groups, [&vec![0, 2]]);
        let keys: Vec<&str> = found.keys.iter().map(|key| key.key.as_str()).collect();
        assert_eq!(keys, ["map_elites.parents", "seed"]);
        assert_eq!(found.keys[0].texts, ["20", "40", "20", "20", "20"]);
        let score = &found.repetitions[0].quantities[0];
        assert_eq!((score.name.as_str(), score.mean), ("QD score", 2.5));
        assert_eq!((score.least, score.largest), (2.0, 3.0));
        assert!((score.standard_deviation - 0.5_f64.sqrt()).abs() < 1e-12);
    }
}
