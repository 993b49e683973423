//! [`Task`]: a run, and the steps after it.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::config::audit::Criteria;
use crate::config::{Config, Settings, differing};
use crate::images::whereabouts::Whereabouts;
use crate::robots::selection::{BEST, Selection};
use crate::shipped;
use crate::store::images::{HeldOut, HowMany};
use crate::store::names::TASK_JSON;
use crate::store::run::RunFile;
use crate::store::task::TaskFile;
use crate::task::grouping::Groups;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A task of a sweep or a reproduction.
#[derive(Clone, Debug)]
pub(crate) struct Task {
    /// Its name, which its run folder shares.
    pub(crate) name: String,
    pub(crate) run: Run,
    pub(crate) steps: Steps,
    /// Keys that differ between tasks, with their values as text, for tables.
    pub(crate) varied: Vec<(String, String)>,
}

#[derive(Clone, Debug)]
pub(crate) enum Run {
    /// `evolve`, with the name of the run, and the groups of classes if the plan names them.
    Evolve(Box<Config>, String, Option<Groups>),
    Train(Box<TrainRun>),
    Pair(Box<PairRun>),
}

impl Run {
    pub(crate) fn config(&self) -> &Config {
        match self {
            Run::Evolve(config, ..) => config,
            Run::Train(training) => &training.config,
            Run::Pair(pair) => &pair.config,
        }
    }

    /// Returns the groups of classes that the plan names.
    pub(super) fn groups(&self) -> Option<&Groups> {
        match self {
            Run::Evolve(.., groups) => groups.as_ref(),
            Run::Train(training) => Some(&training.groups),
            Run::Pair(pair) => Some(&pair.gaits.groups),
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct TrainRun {
    /// The run.json whose robots are trained.
    pub(crate) archive: PathBuf,
    /// SHA-256 of this file.
    pub(crate) sha256: String,
    pub(crate) robots: String,
    pub(crate) groups: Groups,
    pub(crate) seed: u64,
    /// Keys that differ from those of the run.
    pub(crate) set: Vec<String>,
    pub(crate) config: Config,
}

/// A pair of classes, trained with the best of several runs' gaits.
#[derive(Clone, Debug)]
pub(crate) struct PairRun {
    pub(crate) gaits: Gaits,
    /// SHA-256 of each run.json.
    pub(crate) sha256: Vec<String>,
    /// The config with the first run's gaits.
    pub(crate) config: Config,
}

/// Gaits of several runs, of which the best is trained for a task.
#[derive(Clone, Debug)]
pub struct Gaits {
    /// The run.json files.
    pub archives: Vec<PathBuf>,
    /// Robots of each run whose gaits are tried.
    pub robots: Selection,
    /// The two groups of classes.
    pub groups: Groups,
    /// Seed of all random numbers; `None`: that of each run.
    pub seed: Option<u64>,
    /// Keys that differ from those of the runs.
    pub set: Vec<String>,
}

/// Steps of a pair before its rounds: the choice of the gait, and of the window.
pub(super) const BEFORE_ROUNDS: u64 = 4;

/// Steps after a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Steps {
    /// An audit, as by `morphcog audit`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) audit: Option<AuditStep>,
    /// A test on held-out images, as by `morphcog eval`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) eval: Option<EvalStep>,
}

/// An audit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct AuditStep {
    /// Robots to audit, as with `--robots` of `morphcog audit`. Default "all".
    pub(crate) robots: String,
    /// Criteria of the verdicts.
    pub(crate) criteria: Criteria,
}

impl Default for AuditStep {
    fn default() -> Self {
        AuditStep {
            robots: "all".to_string(),
            criteria: Criteria::default(),
        }
    }
}

/// A test on held-out images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct EvalStep {
    /// Robots to test, as with `--robots` of `morphcog eval`. Default "best".
    pub(crate) robots: String,
    /// Total number of images, evenly divided between the classes, or "all". Default 1000.
    pub(crate) images: HowMany,
    /// Split of the images. Default "test".
    pub(crate) split: HeldOut,
    /// True to test only robots that the audit found physical. Default false.
    pub(crate) physical_only: bool,
}

impl Default for EvalStep {
    fn default() -> Self {
        EvalStep {
            robots: "best".to_string(),
            images: HowMany::Evenly(1000),
            split: HeldOut::Test,
            physical_only: false,
        }
    }
}

impl Steps {
    /// Checks what the types cannot; `trains` is true for tasks that train instead of evolve.
    pub(crate) fn validate(&self, trains: bool) -> Result<(), Error> {
        if let Some(step) = &self.audit {
            selection("audit.robots", &step.robots)?;
            step.criteria
                .validate()
                .map_err(|error| error.with_key("audit.criteria"))?;
        }
        let Some(step) = &self.eval else {
            return Ok(());
        };
        let tested = selection("eval.robots", &step.robots)?;
        let Some(audit) = self.audit.as_ref().filter(|_| step.physical_only) else {
            return match step.physical_only {
                true => Err(Error::value(
                    "eval.physical_only",
                    true,
                    "it with [audit] only",
                )),
                false => Ok(()),
            };
        };
        // A training has one robot, however it is chosen.
        let is_whole = trains || selection("audit.robots", &audit.robots)? == Selection::All;
        let is_named = matches!(&tested, Selection::Ids(ids) if !ids.iter().any(|id| id == BEST));
        if !is_whole && tested.validated().is_none() && !is_named {
            let expected =
                "audit.robots = \"all\" with it: from a part of an archive nothing is drawn fairly";
            return Err(Error::value("eval.physical_only", true, expected));
        }
        Ok(())
    }
}

/// Parses a selection of robots; errors mention `key`.
pub(crate) fn selection(key: &str, text: &str) -> Result<Selection, Error> {
    text.parse()
        .map_err(|error: String| Error::at_key(key, error))
}

/// The place where tasks are done.
#[derive(Clone, Debug)]
pub(crate) struct TaskFolders {
    /// Parent of all run folders.
    pub(crate) out: PathBuf,
}

impl TaskFolders {
    pub(crate) fn folder(&self, task: &Task) -> PathBuf {
        self.out.join(&task.name)
    }
}

impl Task {
    /// Returns everything that its run depends on.
    pub(super) fn settings(&self) -> Settings {
        let (config, more) = match &self.run {
            Run::Evolve(config, ..) => (config.settings(), Vec::new()),
            Run::Train(training) => (
                training.config.settings(),
                vec![
                    ("archive", training.sha256.clone()),
                    ("robots", training.robots.clone()),
                ],
            ),
            Run::Pair(pair) => (
                pair.config.settings(),
                vec![
                    ("archives", pair.sha256.join(" ")),
                    ("robots", pair.gaits.robots.to_string()),
                ],
            ),
        };
        let config = config
            .into_iter()
            .filter(|(key, _)| key != "train.challengers");
        config
            .chain(
                more.into_iter()
                    .map(|(key, value)| (key.to_string(), value.into())),
            )
            .collect()
    }

    pub(crate) fn cycle_steps(&self) -> u32 {
        self.run.config().physics.cycle_steps
    }

    /// Returns the remaining requests, which may grow or change while the task goes on.
    pub(super) fn asked(&self) -> Value {
        let validation = &self.run.config().validation;
        serde_json::json!({ "amount": self.amount(), "validation": validation, "steps": self.steps })
    }

    /// Returns the keys in which a run in its folder differs, with the values there and in the
    /// plan.
    pub(crate) fn differing(&self, run: &RunFile) -> Vec<(String, String, String)> {
        match &self.run {
            Run::Evolve(config, ..) => differing(&run.config.settings(), &config.settings()),
            // A training finds its windows and numbers of images on the way.
            Run::Train(training) => {
                let of = |config: &Config, archive: String| -> Settings {
                    let all = config.settings().into_iter();
                    let own = all.filter(|(key, _)| key == "seed" || key.starts_with("task."));
                    own.chain([("archive".to_string(), archive.into())])
                        .collect()
                };
                let there = run
                    .origin
                    .as_ref()
                    .map_or("none".to_string(), |origin| origin.sha256.clone());
                differing(
                    &of(&run.config, there),
                    &of(&training.config, training.sha256.clone()),
                )
            }
            // Its run is that of the gait which was best.
            Run::Pair(_) => Vec::new(),
        }
    }

    /// Returns the default folder of its images if it exists; it depends on the working folder.
    pub(crate) fn data_here(&self) -> Option<PathBuf> {
        let (data, whereabouts) = match &self.run {
            Run::Evolve(config, ..) => (&config.data, Whereabouts::given(None)),
            Run::Train(training) => (
                &training.config.data,
                Whereabouts::given(None).and_of(&training.archive),
            ),
            Run::Pair(pair) => (
                &pair.config.data,
                Whereabouts::given(None).and_of(&pair.gaits.archives[0]),
            ),
        };
        whereabouts.by_default(data)
    }

    /// Returns the folder of the atlas that its gaits are from, if any.
    pub(crate) fn atlas(&self) -> Option<PathBuf> {
        match &self.run {
            Run::Evolve(..) => None,
            Run::Train(training) => shipped::atlas_of(&training.archive),
            Run::Pair(pair) => pair
                .gaits
                .archives
                .iter()
                .find_map(|path| shipped::atlas_of(path)),
        }
    }

    /// Returns its amount of work for a progress bar: generations, challengers, or steps of a pair.
    pub(super) fn amount(&self) -> u64 {
        match &self.run {
            Run::Evolve(config, ..) => config.generations,
            Run::Train(training) => training.config.train.challengers as u64,
            Run::Pair(pair) => {
                let train = &pair.config.train;
                (train.rounds + train.challengers) as u64 + BEFORE_ROUNDS
            }
        }
    }
}

/// Refuses tasks whose folders hold runs of other settings, all at once.
pub(crate) fn check_folders(tasks: &[Task], place: &TaskFolders) -> Result<(), Vec<Error>> {
    let check = |(number, task): (usize, &Task)| {
        let path = place.folder(task).join(TASK_JSON);
        let of = |known: TaskFile| differing(&known.settings, &task.settings());
        let differing = TaskFile::read(&path).map(|known| known.map(of));
        let error = match differing {
            Ok(None) => return None,
            Ok(Some(keys)) if keys.is_empty() => return None,
            Ok(Some(keys)) => another(&place.folder(task), &keys),
            Err(error) => error,
        };
        Some(error.in_place(&format!("task {number} ({})", task.name)))
    };
    let refused: Vec<Error> = (1..).zip(tasks).filter_map(check).collect();
    if refused.is_empty() {
        Ok(())
    } else {
        Err(refused)
    }
}

/// Returns the error for a folder with another run than its task's, with the keys that differ.
pub(crate) fn another(folder: &Path, keys: &[(String, String, String)]) -> Error {
    let said = |(key, there, now): &(String, String, String)| {
        format!("{key} = {there} there, {now} in the plan")
    };
    let keys: Vec<String> = keys.iter().map(said).collect();
    let text = format!(
        "{}: the run there differs: {}",
        folder.display(),
        keys.join("; ")
    );
    Error::input(text)
        .remedy(Remedy::MoveAway)
        .remedy(Remedy::ChooseOut)
}
