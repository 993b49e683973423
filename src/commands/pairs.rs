//! `morphcog train --pairs`: a robot for each pair of classes; these robots answer as a team.
//!
//! Each pair is a task of its own. It is trained with the gait whose response predicts the highest
//! accuracy; if the trained robot is not physical, with the next best gait, too.

use crate::base::error::Error;
use crate::base::files::{read_bytes, write_atomically};
use crate::base::number;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::base::table;
use crate::commands::audit;
use crate::commands::response::{self, ResponseOptions};
pub use crate::commands::tasks::Gaits;
use crate::commands::tasks::{
    AuditStep, PairRun, Run, Steps, Task, TaskFolders, check_folders, run_all,
};
use crate::commands::train::{self, TrainOptions};
use crate::config::Config;
use crate::config::audit::Criteria;
use crate::config::train::TrainConfig;
use crate::data::dataset::Split;
use crate::images::whereabouts::{Whereabouts, size_of};
use crate::response::probing::{Probing, response as response_of};
use crate::robots;
use crate::robots::selection::Selection;
use crate::store::audit::{AuditFile, RobotAudit};
use crate::store::folder::{IfExists, RUNS, RunFolder, beside, name};
use crate::store::names::{AUDIT_JSON, RESPONSE_JSON, RUN_JSON, TRAINING_JSON, VALIDATION_JSON};
use crate::store::run::different;
use crate::store::stored_run::StoredRun;
use crate::store::validation::ranking;
use crate::task::grouping::Groups;
use crate::training;
use crate::training::gaits::{Candidate, candidates, measured};
use crate::training::prediction::Predictor;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Keys that differ from those of the gaits' runs, unless the user sets them: those with which the
/// team that ships was trained.
pub(crate) const SETTINGS: [&str; 10] = [
    "stimulus.reduction=area",
    "stimulus.encoding=threshold",
    "stimulus.level=0.25",
    "train.windows=2000",
    "train.random_images=600",
    "train.rounds=4",
    "train.images=120",
    "train.final_images=400",
    "train.challengers=8",
    "validation.images=400",
];

/// Margin of images of the size that the gaits' run has; of others, gaits see the whole.
pub(crate) const MARGIN: usize = 5;

/// Windows under which each gait's accuracy is predicted.
const WINDOWS: usize = 100;

/// Gaits with which a pair is trained, until its robot is physical.
const GAITS: usize = 2;

/// The ranking of the gaits, in the folder of a pair.
const GAITS_CSV: &str = "gaits.csv";

/// The gaits and the classes of a team.
#[derive(Clone, Debug)]
pub struct PairsOptions {
    /// The runs of the gaits.
    pub archives: Vec<PathBuf>,
    /// Robots of each run whose gaits are tried.
    pub robots: Selection,
    /// The dataset; `None`: that of the gaits.
    pub dataset: Option<String>,
    /// Names or numbers of classes; `None`: all of the dataset.
    pub classes: Option<Vec<String>>,
    /// Seed of all random numbers; `None`: that of the gaits' run.
    pub seed: Option<u64>,
    /// Config keys, as `train.rounds=10`.
    pub set: Vec<String>,
}

/// Trains a robot for each pair of classes, each in a folder of its own in `out`, and returns their
/// run.json files. Pairs that are done are kept: the same call goes on.
///
/// # Errors
/// Returns an error if an option, a run, the data or a folder is unsuitable, a pair failed, or it
/// was stopped.
pub fn pairs(
    options: &PairsOptions,
    out: Option<PathBuf>,
    session: &Session,
) -> Result<Vec<PathBuf>, Error> {
    let out = match out {
        Some(out) => out,
        None => Path::new(RUNS).join(format!("{}-team", options.dataset_name()?)),
    };
    let tasks = options.tasks(session.data_folder())?;
    let place = TaskFolders { out };
    check_folders(&tasks, &place).map_err(|mut errors| errors.swap_remove(0))?;
    train_all(&tasks, &place, None, session)?;
    let run = |task| place.folder(task).join(RUN_JSON);
    Ok(tasks.iter().map(run).collect())
}

/// Trains all pairs, `jobs` at once; `None`: one per core.
pub(crate) fn train_all(
    tasks: &[Task],
    place: &TaskFolders,
    jobs: Option<usize>,
    session: &Session,
) -> Result<(), Error> {
    if let Some(Run::Pair(pair)) = tasks.first().map(|task| &task.run) {
        measure(&pair.gaits, session)?;
    }
    run_all(tasks, place, jobs, session)?.check(tasks.len())
}

impl PairsOptions {
    /// Returns all keys that a training changes, the user's last.
    fn settings(&self, margin: usize) -> Vec<String> {
        let dataset = self
            .dataset
            .iter()
            .map(|name| format!("data.dataset={name}"));
        SETTINGS
            .iter()
            .map(ToString::to_string)
            .chain([format!("stimulus.margin={margin}")])
            .chain(dataset)
            .chain(self.set.iter().cloned())
            .collect()
    }

    /// Returns the name of the dataset that the team will read.
    ///
    /// # Errors
    /// Returns an error if there is no such run, or a key is wrong.
    pub(crate) fn dataset_name(&self) -> Result<String, Error> {
        let first = self.sources()?.swap_remove(0);
        let config = training::changed(&first.run.config, &self.settings(0))?;
        Ok(config.data.dataset)
    }

    fn sources(&self) -> Result<Vec<StoredRun>, Error> {
        let sources = self.archives.iter().map(|path| robots::open(path));
        let sources = sources.collect::<Result<Vec<StoredRun>, Error>>()?;
        different(sources.iter().map(|of| (of.path.as_path(), &of.run)))?;
        Ok(sources)
    }

    /// Returns a task for each pair of classes, in their order.
    ///
    /// # Errors
    /// Returns an error if a run, a key, a class or the dataset is unsuitable.
    pub(crate) fn tasks(&self, data: Option<&Path>) -> Result<Vec<Task>, Error> {
        let sources = self.sources()?;
        let first = &sources[0];
        let whereabouts = self
            .archives
            .iter()
            .fold(Whereabouts::given(data), |all, archive| all.and_of(archive));
        let config = training::changed(&first.run.config, &self.settings(0))?;
        let dataset = whereabouts.load(&config.data, &[Split::Train])?;
        let size = size_of(&first.run.dataset, &first.run.config.data.dataset, &dataset);
        let is_as_before = size.is_some() && size == dataset.size(Split::Train);
        let set = self.settings(if is_as_before { MARGIN } else { 0 });
        let names = config.with_names_of(&dataset).class_names();
        let classes = dataset.chosen(self.classes.as_deref())?;
        let mut tasks = Vec::new();
        for (place, &a) in classes.iter().enumerate() {
            for &b in &classes[place + 1..] {
                let groups = Groups::from([vec![a], vec![b]]).named(&names);
                let config =
                    training::config_of(&first.run.config, groups.classes(), self.seed, &set)?;
                tasks.push(Task {
                    name: groups.in_files(),
                    varied: vec![("groups".to_string(), groups.to_string())],
                    run: Run::Pair(Box::new(PairRun {
                        gaits: Gaits {
                            archives: self.archives.clone(),
                            robots: self.robots.clone(),
                            groups,
                            seed: self.seed,
                            set: set.clone(),
                        },
                        sha256: sources.iter().map(|of| of.run.fingerprint()).collect(),
                        config,
                    })),
                    steps: Steps {
                        audit: Some(AuditStep::default()),
                        eval: None,
                    },
                });
            }
        }
        Ok(tasks)
    }
}

/// Gaits of a run whose responses are still to be measured.
pub(crate) struct Unmeasured {
    pub(crate) archive: PathBuf,
    pub(crate) robots: Vec<String>,
    /// Rollouts that a training asks for.
    pub(crate) rollouts: usize,
}

/// Returns the gaits that a pair would try and whose responses are not known yet.
///
/// # Errors
/// Returns an error if a run has no such robots, or a key is wrong.
pub(crate) fn unmeasured(of: &Gaits, session: &Session) -> Result<Vec<Unmeasured>, Error> {
    let mut all = Vec::new();
    for archive in &of.archives {
        let source = robots::open(archive)?;
        let config = of.config(&source)?;
        let gaits = candidates(&source, &of.robots, &config.train, config.seed)?;
        let known = measured(&source, &config, &probing(&source), &gaits, session);
        let rollouts = config.train.random_images;
        let robots: Vec<String> = gaits
            .iter()
            .zip(&known)
            .filter(|(_, known)| known.len() < rollouts)
            .map(|(gait, _)| gait.robot.id.clone())
            .collect();
        if !robots.is_empty() {
            all.push(Unmeasured {
                archive: archive.clone(),
                robots,
                rollouts: rollouts.max(response::BATCH),
            });
        }
    }
    Ok(all)
}

/// Measures the responses that a pair needs and that are not known yet; they are kept beside the
/// gaits' runs.
///
/// # Errors
/// Returns an error if a run has no such robots, or if it was stopped.
pub(crate) fn measure(of: &Gaits, session: &Session) -> Result<(), Error> {
    for Unmeasured {
        archive,
        robots,
        rollouts,
    } in unmeasured(of, session)?
    {
        let options = ResponseOptions {
            out: beside(&archive, RESPONSE_JSON),
            archive,
            robots,
            physical_only: false,
            task: None,
            set: Vec::new(),
            images: rollouts,
            error: 0.0,
            seed: None,
        };
        let (found, none) = response::measure_any(&options, session)?;
        if let Some(error) = none {
            // Others may be measured already, or be of other runs.
            session.observer.warning(&format!("{error}; left out"));
        }
        if found.stopped {
            return Err(Stopped.into());
        }
        if let Some(error) = found.unwritten {
            return Err(error);
        }
    }
    Ok(())
}

impl Gaits {
    /// Returns the config of a training with the gaits of one of the runs, whose measured walks hold
    /// for it.
    fn config(&self, source: &StoredRun) -> Result<Config, Error> {
        let groups = self.groups.classes();
        let config = training::config_of(&source.run.config, groups, self.seed, &self.set)?;
        response::same_walks(&source.run.config, &config)?;
        Ok(config)
    }
}

fn probing(source: &StoredRun) -> Probing {
    let config = &source.run.config;
    let count = config.train.random_images;
    let conditions: Vec<_> = config
        .train
        .perturbations
        .conditions()
        .take(count)
        .collect();
    Probing::new(&conditions, config.seed)
}

/// A gait, and what training it is predicted to reach.
struct Ranked {
    archive: PathBuf,
    id: String,
    accuracy: f64,
    interval: [f64; 2],
}

/// Returns the gait that a training would begin with: its run, and itself.
///
/// # Errors
/// Returns an error if none can be trained, or if it was stopped.
pub fn best_gait(of: &Gaits, session: &Session) -> Result<(PathBuf, Selection), Error> {
    measure(of, session)?;
    let ranked = session.pool()?.install(|| ranked(of, session))?;
    let best = ranked.into_iter().next().ok_or_else(unstable)?;
    session.observer.note(&format!(
        "{} of {}: predicted accuracy {} %, the highest of all gaits",
        best.id,
        name(&best.archive),
        number::percent(best.accuracy)
    ));
    Ok((best.archive, Selection::Ids(vec![best.id])))
}

fn unstable() -> Error {
    let text = "none of the chosen robots is stable with random images".to_string();
    Error::input(text).remedy(Remedy::ChooseRobots(None))
}

/// Predicts the accuracy of every gait; the best come first, gaits of equal accuracy in their
/// order.
fn ranked(of: &Gaits, session: &Session) -> Result<Vec<Ranked>, Error> {
    let mut all = Vec::new();
    for archive in &of.archives {
        let source = robots::open(archive)?;
        let config = of.config(&source)?;
        let whereabouts = Whereabouts::given(session.data_folder()).and_of(archive);
        let dataset = whereabouts.load(&config.data, &[Split::Train])?;
        let of_run = &source.run;
        let config = training::with_fitting_margin(
            config,
            &of_run.dataset,
            &of_run.config,
            &dataset,
            &of.set,
            session,
        );
        let windows = WINDOWS.min(config.train.windows);
        let config = Config {
            train: TrainConfig {
                windows,
                ..config.train
            },
            ..config
        };
        let seed = config.seed;
        let gaits = candidates(&source, &of.robots, &config.train, seed)?;
        let probing = probing(&source);
        let known = measured(&source, &config, &probing, &gaits, session);
        let predictor = Predictor::new(config, dataset, &of.groups, seed)?;
        for (gait, known) in gaits.iter().zip(known) {
            session.check()?;
            let found = predicted(&predictor, gait, &known, &probing, session)?;
            let Some((accuracy, interval)) = found else {
                continue;
            };
            all.push(Ranked {
                archive: archive.clone(),
                id: gait.robot.id.clone(),
                accuracy,
                interval,
            });
            let fields = serde_json::json!({ "robot": gait.robot.id, "accuracy": accuracy });
            session.observer.finding("prediction", &fields);
        }
    }
    all.sort_by(|a, b| b.accuracy.total_cmp(&a.accuracy));
    Ok(all)
}

fn predicted(
    predictor: &Predictor,
    candidate: &Candidate,
    known: &[Option<f64>],
    probing: &Probing,
    session: &Session,
) -> Result<Option<(f64, [f64; 2])>, Error> {
    let count = known.len();
    let physics = &predictor.config.physics;
    let shown = probing.shown(&candidate.gait, physics, 0..count, |_, _, _| {
        Ok::<_, Error>(known.to_vec())
    })?;
    let Some(response) = response_of(&shown, count) else {
        return Ok(None);
    };
    let taught = predictor.taught(&candidate.gait, &response, &shown, session)?;
    Ok(taught.map(|taught| (taught.accuracy, taught.accuracy_interval)))
}

fn write_ranking(folder: &Path, ranked: &[Ranked]) -> Result<(), Error> {
    let path = folder.join(GAITS_CSV);
    let header = ["archive", "gait", "predicted_accuracy", "low", "high"];
    let row = |gait: &Ranked| {
        let numbers = [gait.accuracy, gait.interval[0], gait.interval[1]];
        let mut row = vec![name(&gait.archive), gait.id.clone()];
        row.extend(numbers.map(|number| number.to_string()));
        row
    };
    let bytes = table::csv(header, ranked.iter().map(row));
    write_atomically(&path, &bytes).map_err(|error| Error::writing(&path, &error))
}

/// A trained robot of a pair, in its folder.
struct Trained {
    folder: PathBuf,
    is_physical: bool,
    /// Balanced accuracy on validation images, or that predicted without any.
    accuracy: f64,
}

/// Trains a pair, or goes on with it, in the folder of its task; the files of the best robot's run
/// are copied into it at the end.
///
/// # Errors
/// Returns an error if data or runs are unsuitable, or if it was stopped.
pub(crate) fn train_pair(of: &Gaits, folder: &Path, session: &Session) -> Result<(), Error> {
    measure(of, session)?;
    let ranked = session.pool()?.install(|| ranked(of, session))?;
    if ranked.is_empty() {
        return Err(unstable());
    }
    write_ranking(folder, &ranked)?;
    let best = serde_json::json!({ "gaits": ranked.len(), "best": ranked[0].id });
    session.observer.finding("ranked", &best);
    let mut best: Option<Trained> = None;
    for (number, gait) in (1..).zip(ranked.iter().take(GAITS)) {
        let trained = trained(of, gait, folder.join(format!("gait-{number}")), session)?;
        let is_better = best.as_ref().is_none_or(|best| {
            (trained.is_physical, trained.accuracy) > (best.is_physical, best.accuracy)
        });
        let is_physical = trained.is_physical;
        if is_better {
            best = Some(trained);
        }
        if is_physical {
            break;
        }
    }
    let best = best.expect("a gait was ranked, so one was trained");
    publish(&best.folder, folder)
}

fn trained(
    of: &Gaits,
    gait: &Ranked,
    folder: PathBuf,
    session: &Session,
) -> Result<Trained, Error> {
    let options = TrainOptions {
        archive: gait.archive.clone(),
        robots: Selection::Ids(vec![gait.id.clone()]),
        groups: of.groups.clone(),
        seed: of.seed,
        set: of.set.clone(),
        name: of.groups.in_files(),
        out: folder.clone(),
        if_exists: IfExists::Resume,
    };
    let found = train::train(&options, session)?;
    let validated = found.validated.ok_or(Stopped)?;
    let audited = audit::audit(
        &audit::AuditOptions {
            archive: folder.join(RUN_JSON),
            robots: Selection::All,
            seed: 1,
            criteria: Criteria::default(),
            fresh: false,
            out: folder.join(AUDIT_JSON),
        },
        session,
    )?;
    if audited.stopped {
        return Err(Stopped.into());
    }
    if let Some(error) = audited.unwritten {
        return Err(error);
    }
    Ok(Trained {
        folder,
        is_physical: audited.file.robots.iter().all(RobotAudit::is_physical),
        accuracy: validated
            .first()
            .map_or(gait.accuracy, |robot| robot.balanced_accuracy),
    })
}

/// A trained pair, for a table.
#[derive(Debug, Serialize)]
pub(crate) struct PairOutcome {
    pub(crate) task: String,
    pub(crate) robot: String,
    /// The gait it was trained from.
    pub(crate) gait: String,
    /// Balanced accuracy on validation images.
    pub(crate) validation: Option<f64>,
    /// The verdict of its audit, with the reason.
    pub(crate) audit: String,
}

/// Returns the outcome of each trained pair.
///
/// # Errors
/// Returns an error if a file is missing or broken.
pub(crate) fn outcomes(tasks: &[Task], place: &TaskFolders) -> Result<Vec<PairOutcome>, Error> {
    let outcome = |task: &Task| {
        let source = StoredRun::read(&place.folder(task).join(RUN_JSON))?;
        let audit = AuditFile::of_run(&source.run, &source.path)?;
        let robot = source
            .run
            .best()
            .ok_or_else(|| Error::input(format!("{}: expected a robot", source.path.display())))?;
        let verdict = audit.robots.iter().find(|other| other.id == robot.id);
        let validated = ranking(&source)?.and_then(|robots| robots.first().cloned());
        Ok(PairOutcome {
            task: robot.task.clone(),
            robot: robot.id.clone(),
            gait: robot.parent.clone().unwrap_or_default(),
            validation: validated.map(|robot| robot.balanced_accuracy),
            audit: verdict.map_or_else(String::new, RobotAudit::conclusion),
        })
    };
    tasks.iter().map(outcome).collect()
}

/// Copies a run and its results into the folder above; `run.json`, which makes it a run, is last.
fn publish(from: &Path, to: &Path) -> Result<(), Error> {
    let results = [AUDIT_JSON, VALIDATION_JSON];
    let tables = results.map(|name| Path::new(name).with_extension("csv"));
    let of_run = RunFolder::files()
        .into_iter()
        .filter(|name| ![RUN_JSON, TRAINING_JSON].contains(name));
    let names = of_run
        .chain(results)
        .map(PathBuf::from)
        .chain(tables)
        .chain([PathBuf::from(RUN_JSON)]);
    for name in names {
        let (source, target) = (from.join(&name), to.join(&name));
        match read_bytes(&source) {
            Ok(bytes) => write_atomically(&target, &bytes)
                .map_err(|error| Error::writing(&target, &error))?,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(Error::reading(&source, &error)),
        }
    }
    Ok(())
}
