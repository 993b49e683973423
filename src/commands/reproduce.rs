//! `morphcog reproduce`: the whole paper at a chosen scale, from the first generation to its table.

use crate::base::error::Error;
use crate::base::observer::Observer;
use crate::base::random::{Purpose, stream};
use crate::commands::plan::Plan;
use crate::commands::table::Row;
use crate::commands::{audit, capacity, eval, plan, table};
use crate::config::Config;
use crate::search::{evolve, showing};
use crate::store::audit::{AuditFile, Verdict};
use crate::store::capacity::CapacityFile;
use crate::store::eval::EvalFile;
use crate::store::folder::IfExists;
use crate::store::images::HeldOut;
use crate::store::names::{AUDIT_JSON, RUN_JSON};
use crate::store::robots::{Chosen, Selection, Source};
use crate::store::setting::RunRef;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// What to reproduce, and where to.
#[derive(Clone, Debug)]
pub struct Options {
    /// The plan.
    pub plan: Plan,
    /// Its scale, more than 0, up to 1.
    pub scale: f64,
    /// The folder.
    pub out: PathBuf,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// Number of threads; `None`: one per core.
    pub threads: Option<usize>,
}

/// How a reproduction ended.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The paper's table, so far.
    pub rows: Vec<Row>,
    /// Files written at the end.
    pub files: Vec<PathBuf>,
    /// Every experiment's networks, with their file.
    pub capacities: Vec<(PathBuf, CapacityFile)>,
    /// Whether a signal stopped it.
    pub stopped: bool,
    /// Why the table is not, or not as a whole, in its files, if so.
    pub unwritten: Option<Error>,
}

/// Does what of a plan is not done yet; what was done by an earlier, interrupted call stays.
///
/// # Errors
/// Of what is wrong.
pub fn reproduce(options: &Options, stop: &AtomicBool, observer: &dyn Observer) -> Result<Finished, Error> {
    if !(options.scale > 0.0 && options.scale <= 1.0) {
        return Err(Error::usage(format!("--scale {}: expected more than 0, up to 1", options.scale)));
    }
    let plan = options.plan.at(options.scale);
    let job = Job { options, plan: &plan, stop, observer };
    let experiments = plan.experiments()?;
    let (mut rows, mut capacities) = (Vec::new(), Vec::new());
    for (name, config) in &experiments {
        let Some((found, networks)) = job.experiment(name, config)? else {
            return Ok(Finished { rows, files: Vec::new(), capacities, stopped: true, unwritten: None });
        };
        rows.extend(found);
        capacities.extend(networks);
    }
    let (files, unwritten) = match table::write(&options.out, options.scale, &rows) {
        Ok(files) => (files, None),
        Err(error) => (Vec::new(), Some(error)),
    };
    Ok(Finished { rows, files, capacities, stopped: false, unwritten })
}

/// Chosen robots, and by task how many are physical of how many that were audited.
type Drawn<'s> = (Vec<Chosen<'s>>, BTreeMap<String, (usize, usize)>);

/// Rows of the table, and networks with their file.
type Experienced = (Vec<Row>, Option<(PathBuf, CapacityFile)>);
/// One call.
struct Job<'a> {
    options: &'a Options,
    plan: &'a Plan,
    stop: &'a AtomicBool,
    observer: &'a dyn Observer,
}

impl Job<'_> {
    /// All steps of an experiment; its rows of the table and its networks, or `None` if stopped.
    fn experiment(&self, name: &str, config: &Config) -> Result<Option<Experienced>, Error> {
        let Some(sources) = self.evolved(name, config)? else { return Ok(None) };
        let Some((chosen, audited)) = self.chosen(&sources)? else { return Ok(None) };
        let (tasks, grouping) = (&sources[0].run.dimensions.tasks, config.grouping()?);
        let tasks: Vec<&String> = tasks
            .iter()
            .filter(|task| grouping.tasks().iter().any(|s| s.name() == **task && !s.is_same_way()))
            .collect();
        let mut rows: Vec<Row> = tasks.iter().map(|task| Row::new(&config.data.dataset, task)).collect();
        for row in &mut rows {
            (row.physical, row.audited) = audited.get(&row.task).copied().unwrap_or((0, 0));
        }
        if chosen.is_empty() {
            self.observer.note(&format!("{name}: every robot exploits the simulator: nothing to test"));
            return Ok(Some((rows, None)));
        }
        let path = self.options.out.join(format!("{name}-eval.json"));
        let Some(report) = self.tested(name, &path, &sources, &chosen)? else { return Ok(None) };
        self.observer.note(&format!("{name}: networks"));
        let options = capacity::Options {
            eval: path.clone(),
            config: self.plan.capacity.clone(),
            physical_only: false,
            data: self.options.data.clone(),
            out: self.options.out.join(format!("{name}-capacity.json")),
            threads: self.options.threads,
        };
        let finished = capacity::capacity(&options, self.stop, self.observer)?;
        let file = written(finished.file, finished.unwritten)?;
        if file.stopped {
            return Ok(None);
        }
        rows.iter_mut().for_each(|row| row.fill(&report, &file));
        Ok(Some((rows, Some((options.out, file)))))
    }

    /// The runs of all seeds; `None` if stopped.
    fn evolved(&self, name: &str, config: &Config) -> Result<Option<Vec<Source>>, Error> {
        let mut sources = Vec::new();
        for &seed in &self.plan.seeds {
            let config = plan::scaled(config, self.options.scale);
            let generations = config.generations;
            let out = self.options.out.join(format!("{name}-seed{seed}"));
            self.observer.note(&format!("{name}, seed {seed}: {generations} generations"));
            let options = evolve::Options {
                config: Config { seed, ..config },
                name: name.to_string(),
                out: out.clone(),
                if_exists: IfExists::Resume,
                data: self.options.data.clone(),
                threads: self.options.threads,
            };
            // Only evolve has the options that its hints name.
            let otherwise = |error: Error| match &error.hint {
                Some(hint) if hint.contains("--force") => error
                    .hint("reproduce with the same plan and --scale, or elsewhere with --out".to_string()),
                _ => error,
            };
            let evolved = evolve::evolve(&options, self.stop, self.observer);
            let evolved = evolved.map_err(otherwise)?;
            if written(evolved.stopped, evolved.unwritten)? {
                return Ok(None);
            }
            sources.push(Source::read(&out.join(RUN_JSON))?);
        }
        Ok(Some(sources))
    }

    /// Robots of each task, drawn at random one after the other and audited, until enough are
    /// physical or there are no more. If they are too few, the first of those take part, too, that
    /// are not found to exploit the simulator: the paper, which sorted out by eye, kept such. With
    /// them, counts by task. `None` if stopped.
    fn chosen<'s>(&self, sources: &'s [Source]) -> Result<Option<Drawn<'s>>, Error> {
        let all = Selection::All.of(sources, 0)?;
        let grouping = sources[0].run.config.grouping()?;
        let (mut chosen, mut counts) = (Vec::new(), BTreeMap::new());
        for (number, split) in (0..).zip(grouping.tasks()).filter(|(_, split)| !split.is_same_way()) {
            let task = split.name();
            let of_task: Vec<Chosen> = all.iter().filter(|c| c.robot.task == task).copied().collect();
            let order = stream(1, Purpose::Robots, 1, number).sample(of_task.len(), of_task.len());
            let (mut physical, mut others, mut audited) = (Vec::new(), Vec::new(), 0);
            for turn in order.chunks(self.plan.robots) {
                if physical.len() >= self.plan.robots {
                    break;
                }
                let drawn: Vec<Chosen> = turn.iter().map(|&index| of_task[index]).collect();
                self.observer.note(&format!("{task}: audit of {} robots", drawn.len()));
                let Some(verdicts) = self.audited(sources, &drawn)? else { return Ok(None) };
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

    /// The verdicts on some robots; `None` if stopped.
    fn audited(&self, sources: &[Source], robots: &[Chosen]) -> Result<Option<Vec<Option<Verdict>>>, Error> {
        let mut files: BTreeMap<usize, AuditFile> = BTreeMap::new();
        for (number, source) in sources.iter().enumerate() {
            let own = robots.iter().filter(|chosen| chosen.source == number);
            let ids: Vec<String> = own.map(|chosen| chosen.robot.id.clone()).collect();
            if ids.is_empty() {
                continue;
            }
            let options = audit::Options {
                source: audit::Source::Archive(source.path.clone()),
                robots: Selection::Ids(ids),
                seed: 0,
                criteria: self.plan.audit.clone(),
                data: self.options.data.clone(),
                out: source.path.with_file_name(AUDIT_JSON),
                threads: self.options.threads,
            };
            let finished = audit::audit(&options, self.stop, self.observer)?;
            let file = written(finished.file, finished.unwritten)?;
            if finished.stopped {
                return Ok(None);
            }
            files.insert(number, file);
        }
        let verdict = |chosen: &Chosen| Some(files.get(&chosen.source)?.robot(&chosen.robot.id)?.verdict);
        Ok(Some(robots.iter().map(verdict).collect()))
    }

    /// The test of the chosen robots; `None` if stopped.
    fn tested(
        &self,
        name: &str,
        path: &Path,
        sources: &[Source],
        chosen: &[Chosen],
    ) -> Result<Option<EvalFile>, Error> {
        let ids: Vec<(usize, String)> = chosen.iter().map(|c| (c.source, c.robot.id.clone())).collect();
        let about = format!(
            "{} elites of each task, drawn at random, physical ones first, none that exploits the simulator",
            self.plan.robots
        );
        let options = eval::Options {
            archives: sources.iter().map(|source| source.path.clone()).collect(),
            robots: Selection::Drawn { robots: ids, about },
            images: self.plan.images,
            split: HeldOut::Test,
            validation: None,
            seed: 1,
            threshold: showing::THRESHOLD,
            cycles: showing::CYCLES,
            data: self.options.data.clone(),
            dataset: None,
            out: path.to_path_buf(),
            threads: self.options.threads,
        };
        if let Ok(known) = EvalFile::read(path)
            && is_of(&known, sources, &options)
        {
            return Ok(Some(known));
        }
        self.observer.note(&format!("{name}: {} robots on {} test images", chosen.len(), self.plan.images));
        let finished = eval::eval(&options, self.stop, self.observer)?;
        let report = written(finished.file, finished.unwritten)?;
        let is_whole = !report.stopped && !self.stop.load(Ordering::Relaxed);
        Ok(is_whole.then_some(report))
    }
}

/// What later steps read from its file, which must be there.
fn written<T>(found: T, unwritten: Option<Error>) -> Result<T, Error> {
    match unwritten {
        None => Ok(found),
        Some(error) => {
            let hint = error.hint.clone().map_or(String::new(), |hint| format!("{hint}; "));
            Err(error.hint(format!("{hint}the same command goes on")))
        }
    }
}

/// Whether an evaluation is what these options would make of these runs, and whole.
fn is_of(known: &EvalFile, sources: &[Source], options: &eval::Options) -> bool {
    let runs: Vec<RunRef> = sources.iter().map(|source| RunRef::new(&source.run)).collect();
    let same_robots = match &options.robots {
        Selection::Drawn { robots, .. } => {
            robots.iter().map(|(run, id)| (*run, id)).eq(known.robots.iter().map(|r| (r.run, &r.id)))
        }
        _ => false,
    };
    let same = (known.seed, known.split, known.images.len(), known.threshold)
        == (options.seed, options.split, options.images, options.threshold);
    let is_ours = known.program_version == env!("CARGO_PKG_VERSION");
    is_ours && !known.stopped && known.trained_on.is_none() && known.runs == runs && same && same_robots
}
