//! `morphcog compare`: what differs between runs, and how their archives and robots compare.

use crate::analysis::comparison;
use crate::analysis::comparison::{ComparedAccuracy, Comparison, PairedDifference, Subject};
use crate::analysis::progress::Progress;
use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::base::session::Session;
use crate::base::table;
use crate::commands::eval;
use crate::commands::eval::EvalOptions;
use crate::draw::error::write_whole;
use crate::draw::plot;
use crate::draw::plot::Style;
use crate::robots;
use crate::robots::selection::{BEST, Chosen, Selection};
use crate::search::held_out_run::{CYCLES, task_of};
use crate::store::eval::{EvalFile, RobotReport};
use crate::store::folder;
use crate::store::images::{HeldOut, HowMany};
use crate::store::names::FigureFormat;
use crate::store::run::{Robot, different};
use crate::store::stored_run::StoredRun;
use crate::task::answer::THRESHOLD;
use std::path::{Path, PathBuf};

/// The default name of the table; the figure goes beside it.
pub(crate) const COMPARE_CSV: &str = "compare.csv";

/// Options of a comparison.
#[derive(Clone, Debug)]
pub struct CompareOptions {
    /// The run.json files, two or more; all others are compared with the first.
    pub archives: Vec<PathBuf>,
    /// The robot of each run, one of each task; `None`: the first on validation images if the run
    /// ranked robots by them, else the fittest.
    pub robots: Option<Selection>,
    /// True if only robots count that an audit found physical.
    pub physical_only: bool,
    /// Number of test images; `None`: 1000, or all test images if there are fewer.
    pub images: Option<HowMany>,
    /// Another dataset than the runs' to take test images from.
    pub dataset: Option<String>,
    /// Seed for drawing images, and robots with `random:1`.
    pub seed: u64,
    /// Path of the table (CSV); `None`: compare.csv above the runs. The figure (SVG, PNG and PDF) goes
    /// beside it.
    pub out: Option<PathBuf>,
}

/// Result of a comparison.
#[derive(Clone, Debug)]
pub struct ComparisonOutcome {
    pub(crate) comparison: Comparison,
    /// The files written: the table, and the figure as SVG, PNG and PDF.
    pub files: Vec<PathBuf>,
}

impl ComparisonOutcome {
    /// Returns the comparison and the paths of the files as one JSON object.
    pub fn to_json(&self) -> serde_json::Value {
        let mut all = serde_json::json!(self.comparison);
        let path = |file: &PathBuf| file.display().to_string();
        all["files"] = self.files.iter().map(path).collect();
        all
    }
}

/// Compares runs: config keys, held-out accuracies image by image, archives, curves and bodies.
/// Writes a table and a figure. Results of the same images in an eval.json beside a run are reused.
///
/// # Errors
/// Returns an error if there are fewer than two runs, if two are the same or an archive is empty,
/// or if data or selection are wrong; also if it is stopped.
pub fn compare(options: &CompareOptions, session: &Session) -> Result<ComparisonOutcome, Error> {
    let files = files(options)?;
    let sources = opened(options)?;
    files.iter().try_for_each(|file| folder::writable(file))?;
    let selections = selections(options, &sources)?;
    let mut progress: Vec<Option<Progress>> = Vec::new();
    for source in &sources {
        progress.push(comparison::history(&source.run, &source.path)?);
    }
    let mut tests: Vec<Tested> = Vec::new();
    for (source, selection) in sources.iter().zip(selections) {
        tests.push(tested(options, source, selection, session)?);
    }
    let paths: Vec<&Path> = sources.iter().map(|source| source.path.as_path()).collect();
    let names = folder::short_names(&paths).into_iter();
    let known = names.zip(&sources).zip(progress.iter().zip(&tests));
    let subjects: Vec<Subject> = known
        .map(|((name, source), (progress, tested))| Subject {
            name,
            path: &source.path,
            run: &source.run,
            progress: progress.as_ref(),
            robots: tested.robots.clone(),
            tests: tested.test.iter().collect(),
        })
        .collect();
    let comparison = comparison::compare(&subjects);
    let figure = plot::comparison(&comparison, &Style::default());
    // Makes all files before writing any.
    let drawn = FigureFormat::ALL.map(|format| figure.bytes(format));
    let drawn: Vec<Vec<u8>> = drawn.into_iter().collect::<Result<_, _>>()?;
    let (csv, figures) = files.split_first().expect("the table is the first file");
    write_atomically(csv, &to_csv(&comparison)).map_err(|error| Error::writing(csv, &error))?;
    for (path, bytes) in figures.iter().zip(&drawn) {
        write_whole(path, bytes)?;
    }
    Ok(ComparisonOutcome { comparison, files })
}

/// Returns the paths of the table, then of the figure in all formats.
fn files(options: &CompareOptions) -> Result<Vec<PathBuf>, Error> {
    let csv = match &options.out {
        None => folder::beside_all(&options.archives, COMPARE_CSV),
        Some(out) => {
            folder::check_is_file_path(out)?;
            let is_csv = |ending: &std::ffi::OsStr| ending.eq_ignore_ascii_case("csv");
            if !out.extension().is_some_and(is_csv) {
                let text = "expected a file name that ends in .csv; the figure goes beside it";
                return Err(Error::argument("out", out.display(), text));
            }
            out.clone()
        }
    };
    let figures = FigureFormat::ALL.map(|format| csv.with_extension(format.ending()));
    Ok([csv].into_iter().chain(figures).collect())
}

/// Reads the runs, two or more different ones with robots.
fn opened(options: &CompareOptions) -> Result<Vec<StoredRun>, Error> {
    if options.archives.len() < 2 {
        let only = options.archives.first().map(|path| folder::name(path));
        let found = only.map_or("none".to_string(), |name| format!("only {name}"));
        let text = format!("expected two runs or more to compare, found {found}");
        return Err(Error::usage(text).advice("name another run as well"));
    }
    let sources: Vec<StoredRun> = options
        .archives
        .iter()
        .map(|path| robots::open(path))
        .collect::<Result<_, _>>()?;
    different(
        sources
            .iter()
            .map(|source| (source.path.as_path(), &source.run)),
    )?;
    match sources.iter().find(|source| source.run.elites.is_empty()) {
        None => Ok(sources),
        Some(empty) => {
            let text = format!("{}: the archive is empty", empty.path.display());
            Err(Error::input(text).advice("compare runs that have robots"))
        }
    }
}

/// Returns the selection of each run's robots; ids may name robots of any of the runs.
fn selections(options: &CompareOptions, sources: &[StoredRun]) -> Result<Vec<Selection>, Error> {
    let Some(robots) = &options.robots else {
        return sources
            .iter()
            .map(|source| best_of(options, source))
            .collect();
    };
    let robots = robots.clone().physical(options.physical_only);
    let is_by_name = |ids: &[String]| ids.iter().all(|id| id != BEST);
    let of_all = match &options.robots {
        Some(Selection::Ids(ids)) if is_by_name(ids) => robots.of_each(sources, options.seed)?,
        _ => vec![Some(robots.clone()); sources.len()],
    };
    let named = |(selection, source): (Option<Selection>, &StoredRun)| {
        selection.ok_or_else(|| {
            let text = format!(
                "{}: none of the robots is of this run",
                source.path.display()
            );
            Error::input(text).advice("name a robot of each run")
        })
    };
    let selections = of_all.into_iter().zip(sources).map(named);
    let selections: Vec<Selection> = selections.collect::<Result<_, _>>()?;
    for (selection, source) in selections.iter().zip(sources) {
        let several = match selection.validated() {
            Some(count) => (count > 1).then(|| format!("{count} of each task")),
            None => several(&selection.of(std::slice::from_ref(source), options.seed)?),
        };
        if let Some(several) = several {
            let text = format!(
                "expected one robot of each run and task, these are {several} in {}",
                folder::name(&source.path)
            );
            return Err(Error::argument("robots", &robots, text));
        }
    }
    Ok(selections)
}

/// Returns the selection of the best robot of each task of a run.
fn best_of(options: &CompareOptions, source: &StoredRun) -> Result<Selection, Error> {
    let best = comparison::best_of_each_task(source, options.physical_only)?;
    Ok(Selection::Drawn {
        robots: best
            .into_iter()
            .map(|robot| (0, robot.id.clone()))
            .collect(),
        about: "the best of each task".to_string(),
    })
}

/// Describes robots that share a task, if any do.
fn several(chosen: &[Chosen]) -> Option<String> {
    let count = |task: &str| chosen.iter().filter(|one| one.robot.task == task).count();
    let tasks = chosen.iter().map(|one| one.robot.task.as_str());
    let shared = tasks
        .map(|task| (count(task), task))
        .find(|(count, _)| *count > 1);
    shared.map(|(count, task)| format!("{count} of {task}"))
}

/// A run's robots, and their test; none of gaits, or of robots that always walk the same way.
struct Tested<'a> {
    robots: Vec<&'a Robot>,
    test: Option<EvalFile>,
}

/// Tests a run's robots on held-out images.
fn tested<'a>(
    options: &CompareOptions,
    source: &'a StoredRun,
    robots: Selection,
    session: &Session,
) -> Result<Tested<'a>, Error> {
    let config = &source.run.config;
    let chosen = robots.of(std::slice::from_ref(source), options.seed)?;
    let grouping = config.grouping()?;
    let has_task = |one: &Chosen| task_of(&grouping, one.robot).is_some();
    if config.measures_response() || !chosen.iter().any(has_task) {
        let robots = chosen.iter().take(1).map(|one| one.robot).collect();
        return Ok(Tested { robots, test: None });
    }
    let split = HeldOut::Test;
    let options = EvalOptions {
        archives: vec![source.path.clone()],
        robots,
        images: options.images,
        split,
        validation: None,
        seed: options.seed,
        threshold: THRESHOLD,
        cycles: CYCLES,
        dataset: options.dataset.clone(),
        out: folder::beside(&source.path, eval::own_name(split)),
    };
    let test = eval::measure(&options, session)?;
    if test.stopped {
        return Err(Error::stopped("stopped; nothing is written".to_string()));
    }
    let elite = |report: &RobotReport| {
        let is_it = |robot: &&Robot| (&robot.id, &robot.task) == (&report.id, &report.task);
        source.run.elites.iter().find(is_it)
    };
    let robots = test.robots.iter().filter_map(elite).collect();
    Ok(Tested {
        robots,
        test: Some(test),
    })
}

/// Encodes a comparison as CSV: a line per run and task, with the config keys that differ at the
/// end.
fn to_csv<'a>(comparison: &'a Comparison) -> Vec<u8> {
    const OF_RUN: [&str; 8] = [
        "run",
        "archive",
        "seed",
        "generations",
        "num_elites",
        "coverage",
        "qd_score",
        "obj_max",
    ];
    const OF_TEST: [&str; 8] = [
        "robot",
        "task",
        "right",
        "images",
        "accuracy",
        "accuracy_low",
        "accuracy_high",
        "balanced_accuracy",
    ];
    const OF_DIFFERENCE: [&str; 7] = [
        "difference",
        "difference_low",
        "difference_high",
        "only_this",
        "only_first",
        "p",
        "p_adjusted",
    ];
    // Columns of their own have these already.
    let keys = || {
        let is_own = |key: &str| OF_RUN.contains(&key);
        comparison.keys.iter().filter(move |key| !is_own(&key.key))
    };
    let columns = OF_RUN
        .into_iter()
        .chain(OF_TEST)
        .chain(OF_DIFFERENCE)
        .chain(keys().map(|key| key.key.as_str()));
    let row = |(number, tested): (usize, Option<&'a ComparedAccuracy>)| {
        let run = &comparison.runs[number];
        let of_run = (
            &run.name,
            &run.archive,
            run.seed,
            run.generations,
            run.stats.num_elites,
            run.stats.coverage,
            run.stats.qd_score,
            run.stats.obj_max,
        );
        let of_test = (
            tested.map(|tested| &tested.robot),
            tested.map(|tested| &tested.task),
            tested.map(|tested| tested.right),
            tested.map(|tested| tested.images),
            tested.map(|tested| tested.accuracy),
            tested.map(|tested| tested.interval[0]),
            tested.map(|tested| tested.interval[1]),
            tested.map(|tested| tested.balanced_accuracy),
        );
        let found: Option<&PairedDifference> = tested.and_then(|one| one.difference.as_ref());
        let of_difference = (
            found.map(|found| found.mean),
            found.map(|found| found.interval[0]),
            found.map(|found| found.interval[1]),
            found.map(|found| found.only_this),
            found.map(|found| found.only_first),
            found.map(|found| found.p),
            found.map(|found| found.p_adjusted),
        );
        let keys: Vec<&str> = keys().map(|key| key.texts[number].as_str()).collect();
        (of_run, of_test, of_difference, keys)
    };
    let rows = (0..comparison.runs.len()).flat_map(|number| {
        let tested = comparison.accuracies.iter();
        let mut rows: Vec<_> = tested
            .filter(|tested| tested.run == number)
            .map(|tested| (number, Some(tested)))
            .collect();
        if rows.is_empty() {
            rows.push((number, None));
        }
        rows
    });
    table::csv(columns, rows.map(row))
}
