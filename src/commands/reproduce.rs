//! `morphcog reproduce`: the whole paper at a chosen scale, from the first generation to its table.

use crate::base::error::Error;
use crate::base::random::{Purpose, stream};
use crate::base::session::Session;
use crate::base::text::counted;
use crate::commands::plan::PaperPlan;
use crate::commands::table::TableRow;
use crate::commands::tasks::all::check_test;
use crate::commands::tasks::steps::or_write_error;
use crate::commands::tasks::task::another;
use crate::commands::tasks::{self, Run, Steps, Task, TaskFolders, TasksSummary};
use crate::commands::{audit, capacity, eval, plan, table};
use crate::config::Config;
use crate::data::dataset::Split;
use crate::images::whereabouts::Whereabouts;
use crate::robots::selection::{Chosen, Selection};
use crate::search::held_out_run;
use crate::store::audit::{AuditFile, Verdict};
use crate::store::capacity::CapacityFile;
use crate::store::eval::EvalFile;
use crate::store::images::{HeldOut, HowMany};
use crate::store::names::{AUDIT_JSON, RUN_JSON};
use crate::store::stored_run::StoredRun;
use crate::task::answer;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

#[derive(Clone, Debug)]
pub(crate) struct ReproduceOptions {
    pub(crate) plan: PaperPlan,
    /// Its scale, above 0 and up to 1.
    pub(crate) scale: f64,
    pub(crate) place: TaskFolders,
    /// Runs at once; `None`: one per core.
    pub(crate) jobs: Option<usize>,
}

#[derive(Clone, Debug)]
pub(crate) struct ReproduceOutcome {
    /// Summary of the runs; the table is made when all are done.
    pub(crate) runs: TasksSummary,
    pub(crate) rows: Vec<TableRow>,
    /// Files written at the end.
    pub(crate) files: Vec<PathBuf>,
    /// Networks of every experiment, with their file.
    pub(crate) capacities: Vec<(PathBuf, CapacityFile)>,
    pub(crate) stopped: bool,
    pub(crate) unwritten: Option<Error>,
}

/// Returns the runs of a plan at a scale: every experiment from every seed.
pub(crate) fn tasks(plan: &PaperPlan, scale: f64) -> Result<Vec<Task>, Error> {
    if !(scale > 0.0 && scale <= 1.0) {
        return Err(Error::argument(
            "scale",
            scale,
            "expected more than 0, up to 1",
        ));
    }
    let mut tasks = Vec::new();
    for (name, config) in plan.experiments()? {
        for &seed in &plan.seeds {
            let config = Config {
                seed,
                ..plan::scaled(&config, scale)
            };
            let varied = vec![
                ("experiment".to_string(), name.clone()),
                ("seed".to_string(), seed.to_string()),
            ];
            tasks.push(Task {
                name: format!("{name}-seed{seed}"),
                run: Run::Evolve(Box::new(config), name.clone(), None),
                steps: Steps::default(),
                varied,
            });
        }
    }
    Ok(tasks)
}

/// Completes a plan: first its missing runs, then the steps from their robots to the table. Results
/// of an earlier, interrupted call are kept.
pub(crate) fn reproduce(
    options: &ReproduceOptions,
    session: &Session,
) -> Result<ReproduceOutcome, Error> {
    let tasks = tasks(&options.plan, options.scale)?;
    let place = &options.place;
    tasks::check_folders(&tasks, place).map_err(|mut refused| refused.swap_remove(0))?;
    let plan = options.plan.at(options.scale);
    let experiments = plan.experiments()?;
    for (_, config) in &experiments {
        let dataset = Whereabouts::given(session.data_folder()).load(&config.data, &Split::ALL)?;
        check_test(config, &dataset, HowMany::Evenly(plan.images), "images")?;
    }
    let runs = tasks::run_all(&tasks, place, options.jobs, session)?;
    let (rows, capacities) = (Vec::new(), Vec::new());
    let stopped = runs.done < tasks.len();
    let mut finished = ReproduceOutcome {
        runs,
        rows,
        files: Vec::new(),
        capacities,
        stopped,
        unwritten: None,
    };
    if stopped {
        return Ok(finished);
    }
    for task in &tasks {
        let folder = place.out.join(&task.name);
        let differing = task.differing(&StoredRun::read(&folder.join(RUN_JSON))?.run);
        if !differing.is_empty() {
            return Err(another(&folder, &differing));
        }
    }
    let job = Job {
        place,
        plan: &plan,
        session,
    };
    for (name, config) in &experiments {
        let Some((found, networks)) = job.experiment(name, config)? else {
            return Ok(ReproduceOutcome {
                stopped: true,
                ..finished
            });
        };
        finished.rows.extend(found);
        finished.capacities.extend(networks);
    }
    match table::write(&place.out, options.scale, &finished.rows) {
        Ok(files) => finished.files = files,
        Err(error) => finished.unwritten = Some(error),
    }
    Ok(finished)
}

/// Chosen robots, and the numbers of physical and of audited ones by task.
type Drawn<'s> = (Vec<Chosen<'s>>, BTreeMap<String, (usize, usize)>);

/// Rows of the table, and networks with their file.
type Experienced = (Vec<TableRow>, Option<(PathBuf, CapacityFile)>);

struct Job<'a> {
    place: &'a TaskFolders,
    plan: &'a PaperPlan,
    session: &'a Session<'a>,
}

impl Job<'_> {
    /// Does all steps of an experiment. Returns its rows and networks, or `None` if stopped.
    fn experiment(&self, name: &str, config: &Config) -> Result<Option<Experienced>, Error> {
        let of_seed = |seed: &u64| {
            StoredRun::read(
                &self
                    .place
                    .out
                    .join(format!("{name}-seed{seed}"))
                    .join(RUN_JSON),
            )
        };
        let sources: Vec<StoredRun> = self
            .plan
            .seeds
            .iter()
            .map(of_seed)
            .collect::<Result<_, _>>()?;
        let Some((chosen, audited)) = self.chosen(&sources)? else {
            return Ok(None);
        };
        // The runs know the names of the classes, which their plan need not have.
        let first = &sources[0].run;
        let (tasks, grouping) = (&first.dimensions.tasks, first.config.grouping()?);
        let tasks: Vec<&String> = tasks
            .iter()
            .filter(|task| {
                grouping
                    .tasks()
                    .iter()
                    .any(|s| s.name() == **task && !s.is_same_way())
            })
            .collect();
        let mut rows: Vec<TableRow> = tasks
            .iter()
            .map(|task| TableRow::new(&config.data.dataset, task))
            .collect();
        for row in &mut rows {
            (row.physical, row.audited) = audited.get(&row.task).copied().unwrap_or((0, 0));
        }
        if chosen.is_empty() {
            self.session.observer.note(&format!(
                "{name}: every robot exploits the simulator: nothing to test"
            ));
            return Ok(Some((rows, None)));
        }
        let path = self.place.out.join(format!("{name}-eval.json"));
        let Some(report) = self.tested(name, &path, &sources, &chosen)? else {
            return Ok(None);
        };
        self.session.observer.note(&format!("{name}: networks"));
        let options = capacity::CapacityOptions {
            eval: path.clone(),
            config: self.plan.capacity.clone(),
            physical_only: false,
            out: self.place.out.join(format!("{name}-capacity.json")),
        };
        let finished = capacity::capacity(&options, self.session)?;
        let file = or_write_error(finished.file, finished.unwritten)?;
        if file.stopped {
            return Ok(None);
        }
        rows.iter_mut().for_each(|row| row.fill(&report, &file));
        Ok(Some((rows, Some((options.out, file)))))
    }

    /// Draws robots of each task at random and audits them, until enough are physical or none is
    /// left. If too few are, the first others that do not exploit the simulator take part: the
    /// paper, which sorted by eye, kept such. Returns them with counts by task, or `None` if
    /// stopped.
    fn chosen<'s>(&self, sources: &'s [StoredRun]) -> Result<Option<Drawn<'s>>, Error> {
        let all = Selection::All.of(sources, 0)?;
        let grouping = sources[0].run.config.grouping()?;
        let (mut chosen, mut counts) = (Vec::new(), BTreeMap::new());
        for (number, split) in (0..)
            .zip(grouping.tasks())
            .filter(|(_, split)| !split.is_same_way())
        {
            let task = split.name();
            let of_task: Vec<Chosen> = all
                .iter()
                .filter(|c| c.robot.task == task)
                .copied()
                .collect();
            let order = stream(1, Purpose::Robots, 1, number).sample(of_task.len(), of_task.len());
            let (mut physical, mut others, mut audited) = (Vec::new(), Vec::new(), 0);
            for turn in order.chunks(self.plan.robots) {
                if physical.len() >= self.plan.robots {
                    break;
                }
                let drawn: Vec<Chosen> = turn.iter().map(|&index| of_task[index]).collect();
                self.session.observer.note(&format!(
                    "{task}: audit of {}",
                    counted(drawn.len(), "robot", "robots")
                ));
                let Some(verdicts) = self.audited(sources, &drawn)? else {
                    return Ok(None);
                };
                for (candidate, verdict) in drawn.into_iter().zip(verdicts) {
                    if physical.len() >= self.plan.robots {
                        break;
                    }
                    audited += 1;
                    match verdict {
                        Some(Verdict::Physical) => physical.push(candidate),
                        Some(Verdict::Exploits) | None => {}
                        Some(_) => others.push(candidate),
                    }
                }
            }
            counts.insert(task, (physical.len(), audited));
            let missing = self.plan.robots.saturating_sub(physical.len());
            chosen.extend(physical.into_iter().chain(others.into_iter().take(missing)));
        }
        Ok(Some((chosen, counts)))
    }

    /// Returns the verdicts on some robots, or `None` if stopped.
    fn audited(
        &self,
        sources: &[StoredRun],
        robots: &[Chosen],
    ) -> Result<Option<Vec<Option<Verdict>>>, Error> {
        let mut files: BTreeMap<usize, AuditFile> = BTreeMap::new();
        for (number, source) in sources.iter().enumerate() {
            let own = robots.iter().filter(|chosen| chosen.source == number);
            let ids: Vec<String> = own.map(|chosen| chosen.robot.id.clone()).collect();
            if ids.is_empty() {
                continue;
            }
            let options = audit::AuditOptions {
                archive: source.path.clone(),
                robots: Selection::Ids(ids),
                seed: 0,
                criteria: self.plan.audit.clone(),
                fresh: false,
                out: source.path.with_file_name(AUDIT_JSON),
            };
            let finished = audit::audit(&options, self.session)?;
            let file = or_write_error(finished.file, finished.unwritten)?;
            if finished.stopped {
                return Ok(None);
            }
            files.insert(number, file);
        }
        let verdict =
            |chosen: &Chosen| Some(files.get(&chosen.source)?.robot(&chosen.robot.id)?.verdict);
        Ok(Some(robots.iter().map(verdict).collect()))
    }

    /// Tests the chosen robots; returns `None` if stopped.
    fn tested(
        &self,
        name: &str,
        path: &Path,
        sources: &[StoredRun],
        chosen: &[Chosen],
    ) -> Result<Option<EvalFile>, Error> {
        let ids: Vec<(usize, String)> = chosen
            .iter()
            .map(|c| (c.source, c.robot.id.clone()))
            .collect();
        let about = format!(
            "{} elites of each task, drawn at random, physical ones first, none that exploits the simulator",
            self.plan.robots
        );
        let options = eval::EvalOptions {
            archives: sources.iter().map(|source| source.path.clone()).collect(),
            robots: Selection::Drawn { robots: ids, about },
            images: Some(HowMany::Evenly(self.plan.images)),
            split: HeldOut::Test,
            validation: None,
            seed: 1,
            threshold: answer::THRESHOLD,
            cycles: held_out_run::CYCLES,
            dataset: None,
            out: path.to_path_buf(),
        };
        if let Some(known) = eval::known(&options, self.session)? {
            return Ok(Some(known));
        }
        self.session.observer.note(&format!(
            "{name}: {} on {} test images",
            counted(chosen.len(), "robot", "robots"),
            self.plan.images
        ));
        let finished = eval::eval(&options, self.session)?;
        let report = or_write_error(finished.file, finished.unwritten)?;
        let is_whole = !report.stopped && !self.session.stop.load(Ordering::Relaxed);
        Ok(is_whole.then_some(report))
    }
}
