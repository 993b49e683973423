//! What a task is: what makes its run, and what is done with that.

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

/// A task.
#[derive(Clone, Debug)]
pub struct Task {
    /// Its name, which is its run folder's, too.
    pub name: String,
    /// What makes its run.
    pub run: Run,
    /// What is done with that.
    pub steps: Steps,
    /// Keys that are not the same in all tasks, with their values as text; for tables.
    pub varied: Vec<(String, String)>,
}

/// What makes a run.
#[derive(Clone, Debug)]
pub enum Run {
    /// `evolve`, with the name of the run, and the groups of classes if the plan names them.
    Evolve(Box<Config>, String, Option<Groups>),
    /// `train`.
    Train(Box<Training>),
}

impl Run {
    /// The config that the run has.
    pub(crate) fn config(&self) -> &Config {
        match self {
            Run::Evolve(config, ..) => config,
            Run::Train(training) => &training.config,
        }
    }

    /// The groups of classes that the plan names.
    pub(super) fn groups(&self) -> Option<&Groups> {
        match self {
            Run::Evolve(.., groups) => groups.as_ref(),
            Run::Train(training) => Some(&training.groups),
        }
    }
}

/// A training.
#[derive(Clone, Debug)]
pub struct Training {
    /// The run.json whose robots walk.
    pub archive: PathBuf,
    /// SHA-256 of that.
    pub sha256: String,
    /// Which of its robots.
    pub robots: String,
    /// The two groups of classes.
    pub groups: Groups,
    /// Seed of all chance.
    pub seed: u64,
    /// Keys that differ from those of the run.
    pub set: Vec<String>,
    /// The config that results.
    pub config: Config,
}

/// What is done after a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Steps {
    /// An audit, as by `morphcog audit`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub audit: Option<AuditStep>,
    /// A test on held-out images, as by `morphcog eval`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub eval: Option<EvalStep>,
}

/// An audit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AuditStep {
    /// Which robots, as `--robots` of `morphcog audit`. Default "all".
    pub robots: String,
    /// How they are judged.
    pub criteria: Criteria,
}

impl Default for AuditStep {
    fn default() -> Self {
        AuditStep { robots: "all".to_string(), criteria: Criteria::default() }
    }
}

/// A test on held-out images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EvalStep {
    /// Which robots, as `--robots` of `morphcog eval`. Default "best".
    pub robots: String,
    /// Images in all, evenly divided between the classes, or "all" that there are. Default 1000.
    pub images: HowMany,
    /// Which images. Default "test".
    pub split: HeldOut,
    /// Only robots that the audit found physical. Default false.
    pub physical_only: bool,
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
    /// Checks what a type cannot; `trains`: of tasks that train, not evolve.
    ///
    /// # Errors
    /// What is wrong.
    pub(crate) fn check(&self, trains: bool) -> Result<(), Error> {
        if let Some(step) = &self.audit {
            selection("audit.robots", &step.robots)?;
            step.criteria.check().map_err(|error| error.with_key("audit.criteria"))?;
        }
        let Some(step) = &self.eval else { return Ok(()) };
        let tested = selection("eval.robots", &step.robots)?;
        let Some(audit) = self.audit.as_ref().filter(|_| step.physical_only) else {
            return match step.physical_only {
                true => Err(Error::value("eval.physical_only", true, "it with [audit] only")),
                false => Ok(()),
            };
        };
        // A training has one robot, whichever way it is chosen.
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

/// Reads a selection of robots.
pub(crate) fn selection(key: &str, text: &str) -> Result<Selection, Error> {
    text.parse().map_err(|error: String| Error::at_key(key, error))
}

/// Where tasks are done, and with what.
#[derive(Clone, Debug)]
pub struct Place {
    /// The folder that all run folders lie in.
    pub out: PathBuf,
}

impl Place {
    /// The run folder of a task.
    pub(crate) fn folder(&self, task: &Task) -> PathBuf {
        self.out.join(&task.name)
    }
}

impl Task {
    /// Everything that its run depends on.
    pub(super) fn settings(&self) -> Settings {
        let (config, more) = match &self.run {
            Run::Evolve(config, ..) => (config.settings(), Vec::new()),
            Run::Train(training) => (
                training.config.settings(),
                vec![("archive", training.sha256.clone()), ("robots", training.robots.clone())],
            ),
        };
        let config = config.into_iter().filter(|(key, _)| key != "train.challengers");
        config.chain(more.into_iter().map(|(key, value)| (key.to_string(), value.into()))).collect()
    }

    /// Control steps of an actuation cycle.
    pub(crate) fn cycle_steps(&self) -> u32 {
        match &self.run {
            Run::Evolve(config, ..) => config.physics.cycle_steps,
            Run::Train(training) => training.config.physics.cycle_steps,
        }
    }

    /// What is asked for beyond that: it may grow or change, and the task goes on.
    pub(super) fn asked(&self) -> Value {
        let validation = &self.run.config().validation;
        serde_json::json!({ "amount": self.amount(), "validation": validation, "steps": self.steps })
    }

    /// In which keys a run in its folder is another than this task makes: the key, its value there,
    /// and in the plan.
    pub(crate) fn differing(&self, run: &RunFile) -> Vec<(String, String, String)> {
        match &self.run {
            Run::Evolve(config, ..) => differing(&run.config.settings(), &config.settings()),
            // Of a training's config windows and numbers of images are found on the way.
            Run::Train(training) => {
                let of = |config: &Config, archive: String| -> Settings {
                    let all = config.settings().into_iter();
                    let own = all.filter(|(key, _)| key == "seed" || key.starts_with("task."));
                    own.chain([("archive".to_string(), archive.into())]).collect()
                };
                let there = run.origin.as_ref().map_or("none".to_string(), |origin| origin.sha256.clone());
                differing(&of(&run.config, there), &of(&training.config, training.sha256.clone()))
            }
        }
    }

    /// The folder that its images are looked for in if no other is named, if it is there: one that
    /// depends on the present folder.
    pub fn data_here(&self) -> Option<PathBuf> {
        let (data, whereabouts) = match &self.run {
            Run::Evolve(config, ..) => (&config.data, Whereabouts::given(None)),
            Run::Train(training) => {
                (&training.config.data, Whereabouts::given(None).and_of(&training.archive))
            }
        };
        whereabouts.by_default(data)
    }

    /// The folder of the atlas that its gaits are from, if they are.
    pub fn atlas(&self) -> Option<PathBuf> {
        let Run::Train(training) = &self.run else { return None };
        shipped::atlas_of(&training.archive)
    }

    /// How much of it there is to show on a bar: generations, or challengers.
    pub(super) fn amount(&self) -> u64 {
        match &self.run {
            Run::Evolve(config, ..) => config.generations,
            Run::Train(training) => training.config.train.challengers as u64,
        }
    }
}

/// Refuses tasks whose folders hold runs of other settings, all at once.
///
/// # Errors
/// Which, and the keys in which they differ.
pub fn check_folders(tasks: &[Task], place: &Place) -> Result<(), Vec<Error>> {
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
    if refused.is_empty() { Ok(()) } else { Err(refused) }
}

/// That there is another run in a folder than its task makes, with the keys in which it differs.
pub(crate) fn another(folder: &Path, keys: &[(String, String, String)]) -> Error {
    let said =
        |(key, there, now): &(String, String, String)| format!("{key} = {there} there, {now} in the plan");
    let keys: Vec<String> = keys.iter().map(said).collect();
    let text = format!("{}: the run there differs: {}", folder.display(), keys.join("; "));
    Error::input(text).remedy(Remedy::MoveAway).remedy(Remedy::ChooseOut)
}
