//! The table of a sweep: what its tasks found.

use crate::analysis::progress::Progress;
use crate::base::table;
use crate::store::images::HeldOut;
use crate::store::task::TaskState;
use serde::Serialize;
use std::path::PathBuf;

/// What a task found on one of the tasks that its robots do, as 0|1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SweepRow {
    /// The task's number in the sweep, from 1.
    pub(crate) number: usize,
    pub(crate) name: String,
    pub(crate) state: TaskState,
    /// Varied keys with its values.
    pub(crate) varied: Vec<(String, String)>,
    /// Its run, as far as there is one.
    pub(crate) run: Option<RunRow>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RunRow {
    /// What is told apart, as "0|1".
    pub(crate) recognises: String,
    pub(crate) generations: u64,
    /// Wall-clock time of the run \[s\].
    pub(crate) seconds: f64,
    /// Elites of this task.
    pub(crate) num_elites: usize,
    /// Largest objective of them.
    pub(crate) obj_max: Option<f64>,
    /// Balanced accuracy of the first robot on validation images, from 0 to 1.
    pub(crate) validation: Option<f64>,
    /// Robots audited, and how many of them are physical.
    pub(crate) audited: Option<[usize; 2]>,
    /// How robots did on held-out images.
    pub(crate) tested: Option<Tested>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tested {
    pub(crate) split: HeldOut,
    pub(crate) images: usize,
    pub(crate) robots: usize,
    /// Their mean accuracy, from 0 to 1.
    pub(crate) accuracy: f64,
    /// Its 95 % interval: of one robot over images, of several over robots.
    pub(crate) interval: Option<[f64; 2]>,
    pub(crate) balanced: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Collected {
    /// A row per task and what its robots tell apart.
    pub(crate) rows: Vec<SweepRow>,
    /// How the runs that evolved came along.
    pub(crate) progress: Vec<Progress>,
    /// The run.json files, for commands that take several.
    pub(crate) archives: Vec<PathBuf>,
}

/// What a row says of its run, as the columns of `sweep.csv`; nothing where there is none.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Columns<'a> {
    recognises: Option<&'a str>,
    generations: Option<u64>,
    seconds: Option<f64>,
    num_elites: Option<usize>,
    obj_max: Option<f64>,
    validation_balanced_accuracy: Option<f64>,
    audited: Option<usize>,
    physical: Option<usize>,
    split: Option<HeldOut>,
    images: Option<usize>,
    robots: Option<usize>,
    accuracy: Option<f64>,
    accuracy_low: Option<f64>,
    accuracy_high: Option<f64>,
    balanced_accuracy: Option<f64>,
}

impl<'a> Columns<'a> {
    const NAMES: [&'static str; 15] = [
        "recognises",
        "generations",
        "seconds",
        "num_elites",
        "obj_max",
        "validation_balanced_accuracy",
        "audited",
        "physical",
        "split",
        "images",
        "robots",
        "accuracy",
        "accuracy_low",
        "accuracy_high",
        "balanced_accuracy",
    ];

    pub(crate) fn of(row: &'a SweepRow) -> Self {
        let Some(run) = &row.run else {
            return Columns::default();
        };
        let tested = run.tested.as_ref();
        let interval = tested.and_then(|tested| tested.interval);
        Columns {
            recognises: Some(&run.recognises),
            generations: Some(run.generations),
            seconds: Some(run.seconds),
            num_elites: Some(run.num_elites),
            obj_max: run.obj_max,
            validation_balanced_accuracy: run.validation,
            audited: run.audited.map(|[all, _]| all),
            physical: run.audited.map(|[_, physical]| physical),
            split: tested.map(|tested| tested.split),
            images: tested.map(|tested| tested.images),
            robots: tested.map(|tested| tested.robots),
            accuracy: tested.map(|tested| tested.accuracy),
            accuracy_low: interval.map(|[low, _]| low),
            accuracy_high: interval.map(|[_, high]| high),
            balanced_accuracy: tested.map(|tested| tested.balanced),
        }
    }
}

/// The table as CSV: a row per task and what its robots tell apart; a column per varied key.
pub(crate) fn csv(rows: &[SweepRow]) -> Vec<u8> {
    let mut keys: Vec<&String> = rows
        .iter()
        .flat_map(|row| row.varied.iter().map(|(key, _)| key))
        .collect();
    keys.sort_unstable();
    keys.dedup();
    let about = ["number", "name", "state"].map(str::to_string);
    let varied = keys.iter().map(|key| format!("varied_{key}"));
    let fields = rows.iter().map(|row| {
        let of = |key: &&String| {
            row.varied
                .iter()
                .find(|(own, _)| own == *key)
                .map(|(_, value)| value.as_str())
        };
        let varied: Vec<Option<&str>> = keys.iter().map(of).collect();
        (
            (row.number, &row.name, row.state.name()),
            varied,
            Columns::of(row),
        )
    });
    let more = Columns::NAMES.map(str::to_string);
    table::csv(about.into_iter().chain(varied).chain(more), fields)
}
