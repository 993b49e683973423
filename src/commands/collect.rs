//! Collects the results of a sweep's tasks in one table.

use crate::analysis::progress::Progress;
use crate::analysis::sweep::{Collected, RunRow, SweepRow, Tested};
use crate::base::error::Error;
use crate::commands::eval;
use crate::commands::eval::own_name;
use crate::commands::tasks::steps::test_of;
use crate::commands::tasks::task::another;
use crate::commands::tasks::{Task, TaskFolders, TaskStatus};
use crate::store::audit::AuditFile;
use crate::store::eval::EvalFile;
use crate::store::images::HeldOut;
use crate::store::names::{METRICS, RUN_JSON};
use crate::store::run::RunFile;
use crate::store::stored_run::StoredRun;
use crate::store::validation::ranking;
use std::path::PathBuf;

/// Collects what the tasks found so far; `status` is of the same tasks. `warn` is told of audits and
/// tests that cannot be read, or are of another state of their run: these are left out.
pub(crate) fn collect(
    tasks: &[Task],
    status: &[TaskStatus],
    place: &TaskFolders,
    warn: &dyn Fn(&str),
) -> Result<Collected, Error> {
    let mut all = Collected {
        rows: Vec::new(),
        progress: Vec::new(),
        archives: Vec::new(),
    };
    // Settings of the first test that no plan requested.
    let mut without_plan = None;
    for (task, status) in tasks.iter().zip(status) {
        let folder = place.out.join(&task.name);
        let archive = folder.join(RUN_JSON);
        let row = |run: Option<RunRow>| SweepRow {
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
            let (first, of_first) =
                without_plan.get_or_insert_with(|| (task.name.clone(), settings.clone()));
            let differs = |(there, other): &(_, _)| there != other;
            if let Some(((key, there), (_, other))) =
                settings.iter().zip(of_first.iter()).find(differs)
            {
                warn(&format!(
                    "{}: another test than of {first}: {key} = {there}, not {other}",
                    task.name
                ));
            }
        }
        // Named as in the run's own files.
        let grouping = run.config.grouping()?;
        let tasks = grouping.tasks().iter().zip(&run.dimensions.tasks);
        for (_, recognises) in tasks.filter(|(split, _)| !split.is_same_way()) {
            all.rows.push(row(Some(found.of_task(
                run,
                recognises.clone(),
                status.seconds.unwrap_or(0.0),
            ))));
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
    fn of(
        task: &Task,
        source: &StoredRun,
        place: &TaskFolders,
        warn: &dyn Fn(&str),
    ) -> Result<Self, Error> {
        let run = &source.run;
        let left_out = |text: &str| warn(&format!("{text}; left out"));
        let told = |error: Error| left_out(&error.to_string());
        let audit = AuditFile::if_any(run, &source.path)
            .map_err(told)
            .ok()
            .flatten();
        let is_planned = |audit: &AuditFile| match &task.steps.audit {
            Some(step) if step.criteria != audit.criteria => {
                let path = AuditFile::path(&source.path);
                left_out(&format!(
                    "{}: an audit by other criteria than the plan's",
                    path.display()
                ));
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
                tests
                    .into_iter()
                    .filter(|path| path.exists())
                    .find_map(read)
            }
        };
        let validated = ranking(source)
            .map_err(told)
            .ok()
            .flatten()
            .unwrap_or_default();
        Ok(Found {
            validated,
            audit,
            eval,
        })
    }

    fn of_task(&self, run: &RunFile, recognises: String, seconds: f64) -> RunRow {
        let elites = || run.elites.iter().filter(|robot| robot.task == recognises);
        let audited = self.audit.as_ref().map(|audit| {
            let own = || audit.robots.iter().filter(|robot| robot.task == recognises);
            [
                own().count(),
                own().filter(|robot| robot.is_physical()).count(),
            ]
        });
        let tested = self.eval.as_ref().and_then(|eval| {
            let mean = eval.means.get(&recognises)?;
            let own: Vec<_> = eval
                .robots
                .iter()
                .filter(|robot| robot.task == recognises)
                .collect();
            let interval = if let [one] = own.as_slice() {
                Some(one.interval)
            } else {
                mean.interval
            };
            Some(Tested {
                split: eval.split,
                images: own.first()?.images,
                robots: mean.robots,
                accuracy: mean.accuracy,
                interval,
                balanced: mean.balanced_accuracy,
            })
        });
        let validated = self
            .validated
            .iter()
            .filter(|robot| robot.task == recognises);
        RunRow {
            generations: run.generations,
            seconds,
            num_elites: elites().count(),
            obj_max: elites().map(|robot| robot.objective).reduce(f64::max),
            validation: validated
                .map(|robot| robot.balanced_accuracy)
                .reduce(f64::max),
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
    test: &eval::EvalOptions,
    left_out: &dyn Fn(&str),
) -> bool {
    let path = test.out.display();
    let differing = eval::differing(found, test, source.run.config.physics.cycle_steps);
    if !differing.is_empty() {
        let said =
            |(key, there, asked): &(&str, String, String)| format!("{key} = {there}, not {asked}");
        let said: Vec<String> = differing.iter().map(said).collect();
        left_out(&format!(
            "{path}: another test than the plan's: {}",
            said.join("; ")
        ));
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
