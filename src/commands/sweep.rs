//! `morphcog sweep`: a plan has one config, or one archive of gaits, and keys to vary; every
//! combination is a task.

use crate::base::error::Error;
use crate::base::files::{home_expanded, read_given};
use crate::base::hash::sha256_hex;
use crate::base::remedy::{Invocation, Remedy};
use crate::commands::tasks::task::selection;
use crate::commands::tasks::{AuditStep, EvalStep, Run, Steps, Task, TrainRun};
use crate::config::{Config, Settings, flatten, reading};
use crate::images::whereabouts::Whereabouts;
use crate::shipped;
use crate::store::folder::{self, one_run};
use crate::store::stored_run::StoredRun;
use crate::task::class_names::ClassNames;
use crate::task::grouping::Groups;
use crate::training;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Most tasks of a sweep: a slip in a list soon makes millions.
const MOST: usize = 100_000;

/// Most characters of a varied value in a task's name; longer values are hashed.
const LONGEST: usize = 24;

/// Plan of a sweep: every combination of `vary`, `groups` (or `pairs`) and `seeds` is a task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SweepPlan {
    /// A config file, relative to the plan's folder, or the name of a built-in one: tasks evolve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) config: Option<String>,
    /// Or a run.json of gaits, or its folder, relative to the plan's folder: tasks train.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) archive: Option<PathBuf>,
    /// Robots of `archive` to try, as with `--robots` of `morphcog train`. Default "top:4".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) robots: Option<String>,
    /// Seeds. Default: that of the config or of the archive's run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) seeds: Vec<u64>,
    /// Keys set in all tasks, as with `--set`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) set: Vec<String>,
    /// Groups of classes to tell apart, two per entry, as "4|9".
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) groups: Vec<String>,
    /// Classes to tell apart in pairs, each with every other, as 4|9.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) pairs: Vec<u8>,
    /// Keys to vary, each with a list of values.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub(crate) vary: toml::Table,
    /// An audit after each run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) audit: Option<AuditStep>,
    /// A test on held-out images after that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) eval: Option<EvalStep>,
}

#[derive(Clone, Debug)]
struct Setting {
    key: String,
    value: toml::Value,
    /// Its form in a task's name.
    word: String,
}

/// The common origin of all tasks.
enum Base {
    /// The config's name, and the config before the plan's changes.
    Evolve(String, Box<Config>),
    Train(PathBuf, Box<StoredRun>),
}

impl SweepPlan {
    /// Reads a plan (TOML, or JSON if its name ends in `.json`), with `overrides` applied.
    pub(crate) fn load(path: &Path, overrides: &[String]) -> Result<Self, Error> {
        let text = read_given(path).map_err(|error| {
            let schema = Remedy::Run(
                Invocation::new("schema").value("sweep"),
                "says what a plan holds",
            );
            let help = Remedy::Run(Invocation::new("help").value("sweep"), "shows one");
            Error::reading(path, &error).remedy(schema).remedy(help)
        })?;
        let name = path.display().to_string();
        let format = reading::Format::of(path);
        let plan: SweepPlan = reading::read(&text, format, &name)?;
        let check = |plan: &SweepPlan| plan.validate();
        reading::changed(plan, overrides, check, |error| {
            reading::placed(error, &text, format, &name)
        })
    }

    /// Checks what the types cannot, but no task.
    fn validate(&self) -> Result<(), Error> {
        match (&self.config, &self.archive) {
            (Some(_), Some(_)) => {
                return Err(Error::at_key(
                    "archive",
                    "expected config or archive, not both",
                ));
            }
            (None, None) => {
                return Err(Error::at_key(
                    "config",
                    "expected config (to evolve) or archive (to train)",
                ));
            }
            (Some(_), None) if self.robots.is_some() => {
                return Err(Error::at_key(
                    "robots",
                    "expected with archive only: these robots are trained",
                ));
            }
            _ => {}
        }
        if let Some(robots) = &self.robots {
            selection("robots", robots)?;
        }
        let distinct = |key: &str, all: usize, different: usize| match all == different {
            true => Ok(()),
            false => Err(Error::at_key(key, "expected different ones")),
        };
        distinct(
            "seeds",
            self.seeds.len(),
            self.seeds.iter().collect::<BTreeSet<_>>().len(),
        )?;
        distinct(
            "pairs",
            self.pairs.len(),
            self.pairs.iter().collect::<BTreeSet<_>>().len(),
        )?;
        if self.pairs.len() == 1 {
            return Err(Error::at_key("pairs", "expected two or more classes"));
        }
        self.groups(None)?;
        self.varied()?;
        self.steps().validate(self.archive.is_some())
    }

    fn steps(&self) -> Steps {
        Steps {
            audit: self.audit.clone(),
            eval: self.eval.clone(),
        }
    }

    /// Returns the two groups of each task, if the plan names any; `None`: the names of the classes
    /// are not known yet, and groups named by them are left out.
    fn groups(&self, names: Option<&ClassNames>) -> Result<Vec<Groups>, Error> {
        let mut all: Vec<Groups> = Vec::new();
        for (number, text) in (1..).zip(&self.groups) {
            let may_have_names = names.is_none() && text.contains('|');
            match names.unwrap_or(&ClassNames::default()).read(text) {
                Ok(groups) => all.push(groups),
                Err(_) if may_have_names && text.contains(char::is_alphabetic) => {}
                Err(error) => return Err(Error::at_key(&format!("groups.{number}"), error)),
            }
        }
        for (k, &a) in self.pairs.iter().enumerate() {
            all.extend(
                self.pairs[k + 1..]
                    .iter()
                    .map(|&b| Groups::from([vec![a.min(b)], vec![a.max(b)]]))
                    .map(|pair| pair.named(names.unwrap_or(&ClassNames::default()))),
            );
        }
        // Robots choose which group walks which way, so 1|0 is 0|1.
        let same = |groups: &Groups| -> BTreeSet<BTreeSet<u8>> {
            groups
                .classes()
                .iter()
                .map(|group| group.iter().copied().collect())
                .collect()
        };
        if all.iter().map(same).collect::<BTreeSet<_>>().len() < all.len() {
            return Err(Error::at_key(
                "groups",
                "expected different ones, also of pairs",
            ));
        }
        if self.archive.is_some() && self.groups.is_empty() && all.is_empty() {
            return Err(Error::at_key(
                "groups",
                "expected groups or pairs, which are trained",
            ));
        }
        Ok(all)
    }

    /// Returns the varied keys, each with its values.
    fn varied(&self) -> Result<Vec<Vec<Setting>>, Error> {
        // TOML reads `a.b = […]` as a table.
        let mut flat = Settings::new();
        flatten("", toml::Value::Table(self.vary.clone()), &mut flat);
        let short = |key: &str| key.rsplit('.').next().unwrap_or(key).to_string();
        let mut all = Vec::new();
        for (key, values) in &flat {
            let place = format!("vary.{key}");
            let has_own =
                matches!(key.as_str(), "seed" | "task.groups") || key.starts_with("task.groups.");
            if has_own {
                return Err(Error::at_key(
                    &place,
                    "expected in seeds, or in groups and pairs",
                ));
            }
            let Some(values) = values.as_array().filter(|values| !values.is_empty()) else {
                return Err(Error::at_key(
                    &place,
                    "expected a list of one value or more",
                ));
            };
            // Two keys may end in the same word.
            let is_short = flat
                .keys()
                .filter(|other| short(other) == short(key))
                .count()
                == 1;
            let name = if is_short { short(key) } else { key.clone() };
            let setting = |value: &toml::Value| Setting {
                key: key.clone(),
                value: value.clone(),
                word: format!("{name}={}", word(value)),
            };
            let settings: Vec<Setting> = values.iter().map(setting).collect();
            if settings
                .iter()
                .map(|s| &s.word)
                .collect::<BTreeSet<_>>()
                .len()
                < settings.len()
            {
                return Err(Error::at_key(&place, "expected different values"));
            }
            all.push(settings);
        }
        Ok(all)
    }

    /// Returns the tasks, numbered from 1 in this order: varied keys by their names, the last one
    /// changing fastest; then groups; then seeds.
    pub(crate) fn tasks(&self, path: &Path, data: Option<&Path>) -> Result<Vec<Task>, Vec<Error>> {
        let one = |error: Error| vec![error.in_place(&path.display().to_string())];
        let sets = |wanted: &dyn Fn(&str) -> bool| {
            self.set
                .iter()
                .any(|set| set.split('=').next().is_some_and(|key| wanted(key.trim())))
        };
        if sets(&|key| key == "seed") {
            return Err(one(Error::at_key("set", "seed: expected in seeds")));
        }
        let has_groups = !(self.groups.is_empty() && self.pairs.is_empty());
        if has_groups && sets(&|key| key == "task" || key.starts_with("task.")) {
            return Err(one(Error::at_key(
                "set",
                "task: expected without, since groups or pairs say it",
            )));
        }
        let base = self.base(path).map_err(one)?;
        let names = self.class_names(&base, data).map_err(one)?;
        let groups = self.groups(Some(&names)).map_err(one)?;
        let varied = self.varied().map_err(one)?;
        let seeds = match (&base, self.seeds.as_slice()) {
            (Base::Evolve(_, config), []) => vec![config.seed],
            (Base::Train(_, source), []) => vec![source.run.config.seed],
            (_, seeds) => seeds.to_vec(),
        };
        let sizes = varied
            .iter()
            .map(Vec::len)
            .chain([groups.len().max(1), seeds.len()]);
        if sizes
            .clone()
            .try_fold(1_usize, usize::checked_mul)
            .is_none_or(|count| count > MOST)
        {
            let sizes: Vec<String> = sizes.map(|size| size.to_string()).collect();
            let text = format!("{} tasks: expected at most {MOST}", sizes.join(" × "));
            return Err(one(Error::at_key("vary", text)));
        }
        let groups: Vec<Option<&Groups>> = if groups.is_empty() {
            vec![None]
        } else {
            groups.iter().map(Some).collect()
        };
        let mut combinations: Vec<Vec<&Setting>> = vec![Vec::new()];
        for settings in &varied {
            let mut longer = Vec::new();
            for before in &combinations {
                longer.extend(
                    settings
                        .iter()
                        .map(|setting| [&before[..], &[setting]].concat()),
                );
            }
            combinations = longer;
        }
        let (mut tasks, mut refused) = (Vec::new(), Refused::default());
        for combination in &combinations {
            for groups in &groups {
                for &seed in &seeds {
                    let name = base.name(combination, *groups, seed);
                    match self.task(&base, &name, combination, *groups, seed) {
                        Ok(task) => tasks.push(task),
                        Err(error) => refused.add(tasks.len() + refused.count + 1, &name, error),
                    }
                }
            }
        }
        if refused.count > 0 {
            return Err(refused.errors().into_iter().flat_map(one).collect());
        }
        let mut names = BTreeSet::new();
        if let Some(task) = tasks
            .iter()
            .find(|task| !names.insert(task.name.to_lowercase()))
        {
            return Err(one(Error::at_key(
                "vary",
                format!("two tasks would be called {}", task.name),
            )));
        }
        // Two values may be equal, such as 1 and 1.0.
        let mut experiments: BTreeMap<String, &str> = BTreeMap::new();
        for task in &tasks {
            let config = sha256_hex(format!("{:?}", task.run.config()).as_bytes());
            if let Some(other) = experiments.insert(config, &task.name) {
                let text = format!(
                    "{other} and {} are the same: expected different values",
                    task.name
                );
                return Err(one(Error::at_key("vary", text)));
            }
        }
        Ok(tasks)
    }

    /// Returns the names of the classes of the dataset that all tasks share.
    fn class_names(&self, base: &Base, data: Option<&Path>) -> Result<ClassNames, Error> {
        let (config, whereabouts) = match base {
            Base::Evolve(_, config) => (config.as_ref(), Whereabouts::given(data)),
            Base::Train(archive, source) => {
                (&source.run.config, Whereabouts::given(data).and_of(archive))
            }
        };
        if self.groups.is_empty() && self.pairs.is_empty() {
            return Ok(ClassNames::default());
        }
        training::class_names(config, &self.set, &whereabouts)
    }

    fn base(&self, path: &Path) -> Result<Base, Error> {
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(archive) = &self.archive {
            let is_named = shipped::is_named(archive);
            let archive = if is_named {
                archive.clone()
            } else {
                folder.join(home_expanded(archive))
            };
            let archive = one_run(archive).map_err(|text| Error::at_key("archive", text))?;
            let source = StoredRun::read(&archive)
                .map_err(|error| error.in_place("archive").with_key("archive"))?;
            let archive = match is_named {
                true => archive,
                false => std::path::absolute(&archive)
                    .map_err(|error| Error::reading(&archive, &error))?,
            };
            return Ok(Base::Train(archive, Box::new(source)));
        }
        let config = self
            .config
            .as_deref()
            .expect("a plan without an archive has a config, which is checked");
        let loaded = Config::load_from(folder, config, &[]);
        let loaded = loaded.map_err(|error| error.in_place("config").with_key("config"))?;
        Ok(Base::Evolve(
            folder::name_of(&folder.join(config).to_string_lossy()),
            Box::new(loaded),
        ))
    }

    fn task(
        &self,
        base: &Base,
        name: &str,
        combination: &[&Setting],
        groups: Option<&Groups>,
        seed: u64,
    ) -> Result<Task, Error> {
        let settings = combination
            .iter()
            .map(|setting| format!("{}={}", setting.key, setting.value));
        let mut set: Vec<String> = self.set.iter().cloned().chain(settings).collect();
        let run = match base {
            Base::Evolve(config_name, config) => {
                set.extend(groups.map(|groups| format!("task.groups={:?}", groups.classes())));
                set.push(format!("seed={seed}"));
                // Groups replace the splits of a config.
                let mut config = (**config).clone();
                if groups.is_some() {
                    let classes = config.classes();
                    (config.task.splits, config.task.same_way_bin) = (None, false);
                    config.task.groups = groups.map(|groups| groups.classes().clone());
                    // Images that a config names belong to the classes of its own task.
                    if config.classes() != classes {
                        config.data.train_images = None;
                    }
                }
                let config = reading::changed(config, &set, Config::validate, |error| error)?;
                Run::Evolve(Box::new(config), config_name.clone(), groups.cloned())
            }
            Base::Train(archive, source) => {
                let groups = groups.cloned().expect("a plan with an archive has groups");
                let config =
                    training::config_of(&source.run.config, groups.classes(), Some(seed), &set)?;
                Run::Train(Box::new(TrainRun {
                    archive: archive.clone(),
                    sha256: source.run.fingerprint(),
                    robots: self.robots.clone().unwrap_or("top:4".to_string()),
                    groups,
                    seed,
                    set,
                    config,
                }))
            }
        };
        let classes = run.config().classes().len();
        let too_few = |step: &&EvalStep| !step.images.has_each(classes);
        if let Some(EvalStep { images, .. }) = self.eval.as_ref().filter(too_few) {
            return Err(Error::value(
                "eval.images",
                images,
                &format!("{classes} or more, one of each class"),
            ));
        }
        let mut varied: Vec<(String, String)> = combination
            .iter()
            .map(|setting| (setting.key.clone(), text(&setting.value)))
            .collect();
        varied.extend(groups.map(|groups| ("groups".to_string(), groups.to_string())));
        varied.push(("seed".to_string(), seed.to_string()));
        Ok(Task {
            name: name.to_string(),
            run,
            steps: self.steps(),
            varied,
        })
    }
}

impl Base {
    fn name(&self, combination: &[&Setting], groups: Option<&Groups>, seed: u64) -> String {
        let base = match self {
            Base::Evolve(name, _) => name.clone(),
            Base::Train(archive, source) => match shipped::name(archive) {
                Some((_, run)) => run.to_string(),
                None => {
                    let folder = archive.parent().and_then(Path::file_name);
                    folder.map_or(source.run.name.clone(), |name| {
                        name.to_string_lossy().into_owned()
                    })
                }
            },
        };
        let words = combination.iter().map(|setting| setting.word.clone());
        let groups = groups.map(Groups::in_files);
        let parts = std::iter::once(base)
            .chain(words)
            .chain(groups)
            .chain([format!("seed{seed}")]);
        parts.collect::<Vec<_>>().join("-")
    }
}

/// Formats a value; strings lose their quotes.
fn text(value: &toml::Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_string)
}

/// Formats a value for a file name, so that shells and file systems take it unchanged.
fn word(value: &toml::Value) -> String {
    let text = text(value);
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || "._+-".contains(c) {
            c
        } else {
            '_'
        }
    };
    let word: String = text.chars().map(plain).collect();
    let is_same = word == text && !word.is_empty() && word.len() <= LONGEST;
    // Two texts that become the same word are still two values.
    let hash = || {
        sha256_hex(text.as_bytes())
            .chars()
            .take(8)
            .collect::<String>()
    };
    if is_same { word } else { hash() }
}

/// Refused tasks, by their error.
#[derive(Default)]
struct Refused {
    count: usize,
    /// The error, its first task, and the number of further ones.
    by_error: Vec<(Error, usize, String, usize)>,
}

impl Refused {
    fn add(&mut self, number: usize, name: &str, error: Error) {
        self.count += 1;
        match self
            .by_error
            .iter_mut()
            .find(|(known, ..)| known.message == error.message)
        {
            Some((.., more)) => *more += 1,
            None => self.by_error.push((error, number, name.to_string(), 0)),
        }
    }

    fn errors(self) -> Vec<Error> {
        let said = |(error, number, name, more): (Error, usize, String, usize)| {
            let others = if more == 0 {
                String::new()
            } else {
                format!(" and {more} more")
            };
            Error {
                kind: crate::base::error::ErrorKind::Input,
                ..error
            }
            .in_place(&format!("task {number} ({name}){others}"))
        };
        self.by_error.into_iter().map(said).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(text: &str) -> SweepPlan {
        let plan: SweepPlan = toml::from_str(text).unwrap();
        plan.validate().unwrap();
        plan
    }

    fn names(text: &str) -> Vec<String> {
        let tasks = plan(text).tasks(Path::new("plan.toml"), None).unwrap();
        tasks.into_iter().map(|task| task.name).collect()
    }

    #[test]
    fn every_combination_is_a_task_with_a_name_of_its_own() {
        let names = names(
            "config = \"quickstart.toml\"\nseeds = [1, 2]\npairs = [0, 1, 4]\n\
             [vary]\nmap_elites.parents = [10, 20]\nstimulus.encoding = [\"saturated\", \"intensity\"]",
        );
        assert_eq!(names.len(), 2 * 2 * 3 * 2);
        assert_eq!(
            names[0],
            "quickstart-parents=10-encoding=saturated-0v1-seed1"
        );
        assert_eq!(
            names[1],
            "quickstart-parents=10-encoding=saturated-0v1-seed2"
        );
        assert_eq!(
            names[23],
            "quickstart-parents=20-encoding=intensity-1v4-seed2"
        );
    }

    #[test]
    fn a_task_has_the_config_that_its_name_says() {
        let text = "config = \"four_digit.toml\"\nseeds = [7]\ngroups = [\"0|123\"]\nset = [\"generations=9\"]\n\
                    [vary]\narchive.keep = [3]";
        let tasks = plan(text).tasks(Path::new("plan.toml"), None).unwrap();
        let Run::Evolve(config, ..) = &tasks[0].run else {
            panic!("it evolves")
        };
        assert_eq!((config.seed, config.generations), (7, 9));
        assert_eq!(config.task.groups, Some([vec![0], vec![1, 2, 3]]));
    }

    #[test]
    fn all_that_is_wrong_is_said_at_once_with_the_tasks() {
        let text = "config = \"quickstart.toml\"\nseeds = [1, 2]\n[vary]\ngenerations = [0, 5, -1]\nbody.heihgt = [3]";
        let errors = plan(text).tasks(Path::new("plan.toml"), None).unwrap_err();
        let said: Vec<String> = errors.iter().map(ToString::to_string).collect();
        assert_eq!(
            said.len(),
            1,
            "an unknown key is the first thing wrong with every task: {said:?}"
        );
        assert!(
            said[0].contains("heihgt") && said[0].contains("and 5 more"),
            "{said:?}"
        );
        let text = text.replace("body.heihgt = [3]", "");
        let errors = plan(&text).tasks(Path::new("plan.toml"), None).unwrap_err();
        let said: Vec<String> = errors.iter().map(ToString::to_string).collect();
        assert!(
            said.len() == 2
                && said[0].contains("task 1 (quickstart-generations=0-seed1) and 1 more"),
            "{said:?}"
        );
        assert!(said[1].contains("task 5 "), "{said:?}");
    }

    #[test]
    fn plans_that_cannot_be_are_refused_with_the_key() {
        for (text, key) in [
            ("seeds = [1]", "config"),
            ("config = \"a\"\narchive = \"b\"", "archive"),
            ("config = \"a\"\nrobots = \"top:2\"", "robots"),
            (
                "archive = \"a\"\nrobots = \"some\\u003a2\"\npairs = [0, 1]",
                "robots",
            ),
            ("archive = \"a\"", "groups"),
            ("config = \"a\"\nseeds = [1, 1]", "seeds"),
            ("config = \"a\"\npairs = [3]", "pairs"),
            ("config = \"a\"\ngroups = [\"0|0\"]", "groups.1"),
            (
                "config = \"a\"\ngroups = [\"0|1\"]\npairs = [0, 1]",
                "groups",
            ),
            ("config = \"a\"\ngroups = [\"10|2\", \"2|01\"]", "groups"),
            (
                "config = \"a\"\n[audit]\nrobots = \"top:3\"\n[eval]\nphysical_only = true",
                "eval.physical_only",
            ),
            ("config = \"a\"\n[vary]\nseed = [1]", "vary.seed"),
            (
                "config = \"a\"\n[vary]\ngenerations = 5",
                "vary.generations",
            ),
            (
                "config = \"a\"\n[vary]\ngenerations = []",
                "vary.generations",
            ),
            (
                "config = \"a\"\n[vary]\ngenerations = [5, 5]",
                "vary.generations",
            ),
            (
                "config = \"a\"\n[eval]\nphysical_only = true",
                "eval.physical_only",
            ),
        ] {
            let plan: SweepPlan = toml::from_str(text).unwrap();
            assert_eq!(
                plan.validate().unwrap_err().key.as_deref(),
                Some(key),
                "{text}"
            );
        }
    }

    #[test]
    fn values_that_are_one_and_the_same_are_refused() {
        for vary in [
            "archive.qd_offset = [1, 1.0]",
            "stimulus.margin = [0, [0, 0, 0, 0]]",
        ] {
            let text =
                format!("config = \"quickstart.toml\"\n[vary]\n{vary}\ngenerations = [5, 6]");
            let errors = plan(&text).tasks(Path::new("plan.toml"), None).unwrap_err();
            let said = errors[0].to_string();
            assert!(
                said.contains("are the same: expected different values"),
                "{said}"
            );
        }
        let text = "config = \"quickstart.toml\"\n[vary]\narchive.qd_offset = [1, 1.5]";
        assert_eq!(names(text).len(), 2);
    }

    #[test]
    fn a_lone_class_above_nine_has_a_task_of_its_own() {
        let names =
            names("config = \"quickstart.toml\"\ngroups = [\"1|26\", \"1|26,\"]\npairs = [3, 12]");
        assert_eq!(
            names,
            [
                "quickstart-1v26-seed1",
                "quickstart-1v26,-seed1",
                "quickstart-3v12,-seed1"
            ]
        );
    }

    #[test]
    fn what_the_plan_says_is_not_said_by_set_too() {
        for (text, key) in [
            ("set = [\"seed=3\"]", "seed"),
            ("set = [\"task.groups=[[5],[6]]\"]\npairs = [0, 1]", "task"),
            ("[eval]\nimages = 1", "eval.images"),
        ] {
            let errors = plan(&format!("config = \"quickstart.toml\"\n{text}"))
                .tasks(Path::new("plan.toml"), None);
            let said = errors.unwrap_err()[0].to_string();
            assert!(said.contains(key), "{said}");
        }
        assert_eq!(
            names("config = \"quickstart.toml\"\nset = [\"task.groups=[[5],[6]]\"]").len(),
            1
        );
        let names = names("archive = \"gallery:gaits-6\"\npairs = [0, 1]\nseeds = [1]");
        assert_eq!(
            names,
            ["gaits-6-0v1-seed1"],
            "no name that means another run"
        );
    }

    #[test]
    fn values_that_no_file_name_takes_have_a_short_name_of_their_own() {
        let of =
            |text: &str| word(&format!("value = {text}").parse::<toml::Table>().unwrap()["value"]);
        let [a, b] = ["[[1, 2], [3]]", "[[1, 2], [4]]"].map(of);
        assert!(a != b && a.len() == 8);
        assert_eq!(of("1e-3"), "0.001");
        assert_ne!(of("'a/b'"), of("'a_b'"));
    }
}
