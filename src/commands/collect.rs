//! Collects the results of a sweep's tasks in one table.

use crate::base::error::Error;
use crate::base::table;
use crate::commands::eval;
use crate::commands::eval::own_name;
use crate::commands::plot::Progress;
use crate::commands::tasks::steps::test_of;
use crate::commands::tasks::task::another;
use crate::commands::tasks::{Place, Status, Task};
use crate::store::audit::AuditFile;
use crate::store::eval::EvalFile;
use crate::store::images::HeldOut;
use crate::store::names::{METRICS, RUN_JSON};
use crate::store::run::RunFile;
use crate::store::run::StoredRun;
use crate::store::task::State;
use crate::store::validation::ranking;
use serde::Serialize;
use std::path::PathBuf;

/// Result of a task of the sweep for one task of its robots, as 0|1.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the task in the sweep, from 1.
    pub number: usize,
    /// Its name.
    pub name: String,
    /// Its state.
    pub state: State,
    /// Varied keys with their values.
    pub varied: Vec<(String, String)>,
    /// Results of its run, if there is one.
    pub run: Option<RunRow>,
}

/// Results of a run for one task of its robots.
#[derive(Clone, Debug, PartialEq)]
pub struct RunRow {
    /// The two groups of classes, as "0|1".
    pub recognises: String,
    /// Generations done.
    pub generations: u64,
    /// Wall-clock time of the run \[s\].
    pub seconds: f64,
    /// Number of elites of this task.
    pub num_elites: usize,
    /// Largest objective among them.
    pub obj_max: Option<f64>,
    /// Best balanced accuracy of its robots on validation images, from 0 to 1.
    pub validation: Option<f64>,
    /// Numbers of audited robots, and of physical ones among them.
    pub audited: Option<[usize; 2]>,
    /// Results on held-out images.
    pub tested: Option<Tested>,
}

/// Results of a test.
#[derive(Clone, Debug, PartialEq)]
pub struct Tested {
    /// Split of the images.
    pub split: HeldOut,
    /// Number of images.
    pub images: usize,
    /// Number of robots.
    pub robots: usize,
    /// Their mean accuracy, from 0 to 1.
    pub accuracy: f64,
    /// Its 95 % interval: over images for one robot, over robots for several.
    pub interval: Option<[f64; 2]>,
    /// Their mean balanced accuracy.
    pub balanced: f64,
}

/// All collected results.
#[derive(Clone, Debug)]
pub struct Collected {
    /// One row per task and pair of groups that its robots tell apart.
    pub rows: Vec<Row>,
    /// Progress of the runs that evolved.
    pub progress: Vec<Progress>,
    /// The run.json files, for commands that take several.
    pub archives: Vec<PathBuf>,
}

/// Collects the results of tasks so far; `status` belongs to the same tasks. Leaves out audits and
/// tests that cannot be read or are of another state of their run, and reports them to `warn`.
///
/// # Errors
/// Returns an error if a run is broken.
pub fn collect(
    tasks: &[Task],
    status: &[Status],
    place: &Place,
    warn: &dyn Fn(&str),
) -> Result<Collected, Error> {
    let mut all = Collected { rows: Vec::new(), progress: Vec::new(), archives: Vec::new() };
    // Settings of the first test that no plan requested.
    let mut without_plan = None;
    for (task, status) in tasks.iter().zip(status) {
        let folder = place.out.join(&task.name);
        let archive = folder.join(RUN_JSON);
        let row = |run: Option<RunRow>| Row {
            number: status.task,
            name: task.name.clone(),
            state: status.state,
            varied: task.varied.clone(),
            run,
        };
        if !archive.exists() {
            all.rows.push(row(None));
            continue;
        }
        let source = StoredRun::read(&archive)?;
        let run = &source.run;
        let differing = task.differing(run);
        if !differing.is_empty() {
            warn(&format!("{}; left out", another(&folder, &differing)));
            all.rows.push(row(None));
            continue;
        }
        let found = Found::of(task, &source, place, warn)?;
        if let (None, Some(test)) = (&task.steps.eval, &found.eval) {
            let settings = eval::settings(test);
            let (first, of_first) = without_plan.get_or_insert_with(|| (task.name.clone(), settings.clone()));
            let differs = |(there, other): &(_, _)| there != other;
            if let Some(((key, there), (_, other))) = settings.iter().zip(of_first.iter()).find(differs) {
                warn(&format!("{}: another test than of {first}: {key} = {there}, not {other}", task.name));
            }
        }
        // Named as in the run's own files.
        let grouping = run.config.grouping()?;
        let tasks = grouping.tasks().iter().zip(&run.dimensions.tasks);
        for (_, recognises) in tasks.filter(|(split, _)| !split.is_same_way()) {
            all.rows.push(row(Some(found.of_task(run, recognises.clone(), status.seconds.unwrap_or(0.0)))));
        }
        if run.generations > 1 && folder.join(METRICS).exists() {
            all.progress.push(Progress::of(run, &archive)?);
        }
        all.archives.push(archive);
    }
    Ok(all)
}

struct Found {
    validated: Vec<crate::store::validation::Validated>,
    audit: Option<AuditFile>,
    eval: Option<EvalFile>,
}

impl Found {
    /// Reads the results that match the plan; without a plan for tests, any test.
    fn of(task: &Task, source: &StoredRun, place: &Place, warn: &dyn Fn(&str)) -> Result<Self, Error> {
        let run = &source.run;
        let left_out = |text: &str| warn(&format!("{text}; left out"));
        let told = |error: Error| left_out(&error.to_string());
        let audit = AuditFile::if_any(run, &source.path).map_err(told).ok().flatten();
        let is_planned = |audit: &AuditFile| match &task.steps.audit {
            Some(step) if step.criteria != audit.criteria => {
                let path = AuditFile::path(&source.path);
                left_out(&format!("{}: an audit by other criteria than the plan's", path.display()));
                false
            }
            _ => true,
        };
        let audit = audit.filter(is_planned);
        let eval = match test_of(task, place)? {
            Some(test) if test.out.exists() => match EvalFile::of_runs(&test.out, &[run]) {
                Ok(found) => is_planned_test(&found, source, &test, &left_out).then_some(found),
                Err(error) => {
                    told(error);
                    None
                }
            },
            Some(_) => None,
            // Tests may exist that the plan does not request.
            None => {
                let splits = [HeldOut::Test, HeldOut::Validation];
                let tests = splits.map(|split| source.path.with_file_name(own_name(split)));
                let read = |path: PathBuf| EvalFile::of_runs(&path, &[run]).map_err(told).ok();
                tests.into_iter().filter(|path| path.exists()).find_map(read)
            }
        };
        let validated = ranking(source).map_err(told).ok().flatten().unwrap_or_default();
        Ok(Found { validated, audit, eval })
    }

    fn of_task(&self, run: &RunFile, recognises: String, seconds: f64) -> RunRow {
        let elites = || run.elites.iter().filter(|robot| robot.task == recognises);
        let audited = self.audit.as_ref().map(|audit| {
            let own = || audit.robots.iter().filter(|robot| robot.task == recognises);
            [own().count(), own().filter(|robot| robot.is_physical()).count()]
        });
        let tested = self.eval.as_ref().and_then(|eval| {
            let mean = eval.means.get(&recognises)?;
            let own: Vec<_> = eval.robots.iter().filter(|robot| robot.task == recognises).collect();
            let interval = if let [one] = own.as_slice() { Some(one.interval) } else { mean.interval };
            Some(Tested {
                split: eval.split,
                images: own.first()?.images,
                robots: mean.robots,
                accuracy: mean.accuracy,
                interval,
                balanced: mean.balanced_accuracy,
            })
        });
        let validated = self.validated.iter().filter(|robot| robot.task == recognises);
        RunRow {
            generations: run.generations,
            seconds,
            num_elites: elites().count(),
            obj_max: elites().map(|robot| robot.objective).reduce(f64::max),
            validation: validated.map(|robot| robot.balanced_accuracy).reduce(f64::max),
            audited,
            tested,
            recognises,
        }
    }
}

/// Returns true if the plan requests this test; if not, `left_out` gets the reason.
fn is_planned_test(
    found: &EvalFile,
    source: &StoredRun,
    test: &eval::Options,
    left_out: &dyn Fn(&str),
) -> bool {
    let path = test.out.display();
    let differing = eval::differing(found, test, source.run.config.physics.cycle_steps);
    if !differing.is_empty() {
        let said = |(key, there, asked): &(&str, String, String)| format!("{key} = {there}, not {asked}");
        let said: Vec<String> = differing.iter().map(said).collect();
        left_out(&format!("{path}: another test than the plan's: {}", said.join("; ")));
        return false;
    }
    match eval::is_of_robots(found, std::slice::from_ref(source), test) {
        Ok(true) => true,
        Ok(false) => {
            left_out(&format!("{path}: a test of other robots than the plan's"));
            false
        }
        Err(error) => {
            left_out(&error.to_string());
            false
        }
    }
}

/// The run of a row as columns of `sweep.csv`, empty where there is no value.
#[derive(Debug, Default, Serialize)]
pub struct Columns<'a> {
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
    /// Their names, in order.
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

    /// Returns the columns of a row.
    pub fn of(row: &'a Row) -> Self {
        let Some(run) = &row.run else { return Columns::default() };
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

/// Returns the table as CSV: one row per task and pair of groups, one column per varied key.
pub fn csv(rows: &[Row]) -> Vec<u8> {
    let mut keys: Vec<&String> = rows.iter().flat_map(|row| row.varied.iter().map(|(key, _)| key)).collect();
    keys.sort_unstable();
    keys.dedup();
    let about = ["number", "name", "state"].map(str::to_string);
    let varied = keys.iter().map(|key| format!("varied_{key}"));
    let fields = rows.iter().map(|row| {
        let of =
            |key: &&String| row.varied.iter().find(|(own, _)| own == *key).map(|(_, value)| value.as_str());
        let varied: Vec<Option<&str>> = keys.iter().map(of).collect();
        ((row.number, &row.name, row.state.name()), varied, Columns::of(row))
    });
    let more = Columns::NAMES.map(str::to_string);
    table::csv(about.into_iter().chain(varied).chain(more), fields)
}
