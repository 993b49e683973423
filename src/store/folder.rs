//! A run's folder: created, locked, and never overwritten by accident.

use crate::base::error::Error;
use crate::base::files::{check_file, check_writable, remove_half_written, write_atomically};
use crate::base::remedy::Value;
use crate::base::remedy::{Invocation, Remedy};
use crate::base::session::Session;
use crate::config::Config;
use crate::shipped;
use crate::shipped::read_text;
use crate::store::lock;
use crate::store::lock::Lock;
use crate::store::names::{
    AUDIT_JSON, CAPACITY_JSON, CHECKPOINTS, CONFIG, DATA_FOLDER, ELITES, EVAL_JSON,
    EVAL_VALIDATION_JSON, LOCK, METRICS, RESPONSE_JSON, RUN_JSON, TASK_JSON, TASK_LOCK, TEAM_JSON,
    TEAM_VALIDATION_JSON, TRAINING_JSON, VALIDATION_JSON,
};
use crate::store::run::RunFile;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

/// The default folder of runs, in the current folder.
pub const RUNS: &str = "runs";

const OF_RUN: &str = "expected another name: this would overwrite a file of a run";

/// The files that commands write beside a run.
const RESULTS: [&str; 8] = [
    AUDIT_JSON,
    CAPACITY_JSON,
    EVAL_JSON,
    EVAL_VALIDATION_JSON,
    RESPONSE_JSON,
    TEAM_JSON,
    TEAM_VALIDATION_JSON,
    VALIDATION_JSON,
];

/// The treatment of a folder that already holds a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IfExists {
    /// Refuse to use it.
    Refuse,
    /// Continue the run in it.
    Resume,
    /// Delete the run in it.
    Overwrite,
}

/// A run's folder, in use by this process as long as the value exists.
#[derive(Debug)]
pub(crate) struct RunFolder {
    path: PathBuf,
    /// True if it replaces the run in it.
    replaces: bool,
    _lock: Lock,
}

pub(crate) fn is_in_use(folder: &Path) -> bool {
    matches!(
        lock::state(&folder.join(LOCK)),
        Ok(lock::LockState::Held(_))
    )
}

impl RunFolder {
    /// Creates the folder if necessary, and takes its lock.
    pub(crate) fn open(path: &Path, if_exists: IfExists, session: &Session) -> Result<Self, Error> {
        if shipped::is_named(path) {
            let text = "expected another name: so are runs called that lie elsewhere";
            return Err(Error::argument("out", path.display(), text));
        }
        std::fs::create_dir_all(path).map_err(|error| Error::writing(path, &error))?;
        for name in RunFolder::files().into_iter().chain([LOCK]) {
            let file = path.join(name);
            check_file(&file).map_err(|error| Error::reading(&file, &error))?;
        }
        let refuse_run = || match if_exists {
            IfExists::Refuse => vacant(path),
            _ => Ok(()),
        };
        refuse_run()?;
        let lock = path.join(LOCK);
        let lock = Lock::take(&lock, session).map_err(|refusal| {
            let held = format!(
                "{}: another morphcog is using this run folder",
                path.display()
            );
            refusal
                .into_error(&lock, &held, "wait for it to end")
                .remedy(Remedy::ChooseOut)
        })?;
        // Another process may have left its run while this one waited for the lock.
        refuse_run()?;
        remove_half_written(path, &RunFolder::files())
            .map_err(|error| Error::writing(path, &error))?;
        if if_exists == IfExists::Overwrite {
            // An unchanged config stays, with its author's comments. Checkpoints, which are last,
            // go first: left behind alone, they would revive the run.
            let files = RunFolder::files().into_iter().rev();
            for name in files.filter(|name| *name != CONFIG) {
                let file = path.join(name);
                match std::fs::remove_file(&file) {
                    Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                        return Err(Error::writing(&file, &error));
                    }
                    _ => {}
                }
            }
        }
        Ok(RunFolder {
            path: path.to_path_buf(),
            replaces: if_exists == IfExists::Overwrite,
            _lock: lock,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a run: `elites.csv` and `run.json`.
    pub(crate) fn write_run(&self, run: &RunFile) -> Result<(), Error> {
        for (name, content) in [
            (RUN_JSON, run.to_json().into_bytes()),
            (ELITES, run.to_csv()),
        ] {
            let path = self.path.join(name);
            write_atomically(&path, &content).map_err(|error| Error::writing(&path, &error))?;
        }
        Ok(())
    }

    /// Writes the run's config. An equal one stays as it is, with its comments: it may be the file
    /// that this run was started with. A different one without a run beside it is an error.
    pub(crate) fn write_config(&self, config: &Config) -> Result<(), Error> {
        let path = self.path.join(CONFIG);
        let text = read_text(&path).ok();
        let parsed = |text: &String| Config::parse(text, &path.to_string_lossy(), &[]).ok();
        let there = text.as_ref().and_then(parsed);
        if there.as_ref() == Some(config) {
            return Ok(());
        }
        // A run that was killed before its first checkpoint leaves a config that morphcog wrote.
        let is_written = || there.is_some_and(|there| text == Some(there.to_toml()));
        if !self.replaces && path.exists() && vacant(&self.path).is_ok() && !is_written() {
            let text = format!(
                "{}: there is a file of that name that says something else",
                path.display()
            );
            let error = Error::occupied(text).remedy(Remedy::MoveAway);
            return Err(error.remedy(Remedy::ChooseOut).remedy(Remedy::Replace));
        }
        write_atomically(&path, config.to_toml().as_bytes())
            .map_err(|error| Error::writing(&path, &error))
    }

    pub(crate) fn files() -> [&'static str; 8] {
        let [newest, previous] = CHECKPOINTS;
        [
            RUN_JSON,
            CONFIG,
            ELITES,
            METRICS,
            DATA_FOLDER,
            TRAINING_JSON,
            newest,
            previous,
        ]
    }
}

/// Checks that a folder is free for a new run.
pub(crate) fn vacant(folder: &Path) -> Result<(), Error> {
    let of_run = RunFolder::files()
        .into_iter()
        .filter(|name| ![CONFIG, DATA_FOLDER].contains(name));
    if !of_run.into_iter().any(|name| folder.join(name).exists()) {
        return Ok(());
    }
    let text = format!(
        "{}: there is a run in this folder already",
        folder.display()
    );
    let error = Error::occupied(text).remedy(Remedy::Resume);
    Err(error.remedy(Remedy::ChooseOut).remedy(Remedy::Replace))
}

/// Returns the name of a config's run: the config's name without folder and extension.
pub fn name_of(config: &str) -> String {
    let path = Path::new(config);
    // The config of a run reproduces that run.
    let beside = path.with_file_name(RUN_JSON);
    if path.file_name().is_some_and(|name| name == CONFIG)
        && beside.exists()
        && let Ok(run) = RunFile::read(&beside)
    {
        // Uses only the file name, so that the text of a file cannot lead elsewhere.
        let name = Path::new(&run.name).file_name();
        return name.map_or("run".to_string(), |name| {
            name.to_string_lossy().into_owned()
        });
    }
    path.file_stem().map_or("run".to_string(), |stem| {
        stem.to_string_lossy().into_owned()
    })
}

/// Checks that results can be written to a file, with a CSV beside it, without overwriting each
/// other or files of `of`, their run or result file: files of the run, or results of other commands
/// under their usual names. `own` is the default name of these results.
pub(crate) fn check_out(out: &Path, of: &Path, own: &str) -> Result<(), Error> {
    check_is_file_path(out)?;
    let refuse = |text: &str| Err(Error::argument("out", out.display(), text));
    let csv = out.with_extension("csv");
    if csv == *out {
        return refuse("expected another ending: the CSV beside the results has that name");
    }
    let folder_of = |path: &Path| {
        path.parent()
            .and_then(|folder| Path::new(".").join(folder).canonicalize().ok())
    };
    let same_folder = folder_of(out) == folder_of(of);
    for path in [out, csv.as_path()] {
        let name = path.file_name();
        if is_of_run(path) || same_folder && name == of.file_name() {
            return refuse(OF_RUN);
        }
        let is_others = |other: &&&str| {
            **other != own
                && name.is_some_and(|name| before_dot(name) == before_dot(other.as_ref()))
        };
        if let Some(other) = RESULTS
            .iter()
            .find(is_others)
            .filter(|_| same_folder || holds_run(path))
        {
            return refuse(&format!(
                "expected another name: this is what {other} and what goes with it are called"
            ));
        }
        not_of_run(path)?;
    }
    Ok(())
}

/// Returns true if there is a run beside a file.
fn holds_run(path: &Path) -> bool {
    path.with_file_name(RUN_JSON).exists()
}

/// Yields a path and the target of its link.
fn meant(path: &Path) -> impl Iterator<Item = PathBuf> {
    [Some(path.to_path_buf()), path.canonicalize().ok()]
        .into_iter()
        .flatten()
}

/// Returns true if a file is, or would be, one of those of a run or a task.
fn is_of_run(path: &Path) -> bool {
    let is_one_of = |path: &Path, names: &[&str]| {
        names
            .iter()
            .any(|name| path.file_name() == Some(name.as_ref()))
    };
    meant(path).any(|path| {
        let is_beside_task = path.with_file_name(TASK_JSON).exists();
        holds_run(&path) && is_one_of(&path, &RunFolder::files())
            || (holds_run(&path) || is_beside_task)
                && is_one_of(&path, &[TASK_JSON, LOCK, TASK_LOCK])
    })
}

/// Returns true if a file is a command's result about a run.
fn is_result(path: &Path) -> bool {
    let is_it = |path: &Path, result: &&str| {
        let endings = ["json", "csv", "trainings.json"]
            .map(|ending| Path::new(result).with_extension(ending));
        endings
            .iter()
            .any(|name| path.file_name() == Some(name.as_ref()))
    };
    meant(path).any(|path| holds_run(&path) && RESULTS.iter().any(|result| is_it(&path, result)))
}

/// Checks, before expensive work, that a file can be written and belongs to no run and no results
/// of one.
pub(crate) fn writable(path: &Path) -> Result<(), Error> {
    if is_result(path) {
        return Err(Error::usage(format!("{}: {OF_RUN}", path.display())));
    }
    not_of_run(path)
}

fn not_of_run(path: &Path) -> Result<(), Error> {
    if is_of_run(path) {
        return Err(Error::usage(format!("{}: {OF_RUN}", path.display())));
    }
    check_writable(path).map_err(|error| Error::writing(path, &error))
}

/// Checks that a path can be a file's: it ends with a name.
pub(crate) fn check_is_file_path(path: &Path) -> Result<(), Error> {
    let last = path.as_os_str().as_encoded_bytes().last();
    let ends_open = last.is_some_and(|&byte| std::path::is_separator(byte.into()));
    match ends_open || path.file_name().is_none() {
        true => Err(Error::argument(
            "out",
            path.display(),
            "expected a file, this is a folder",
        )),
        false => Ok(()),
    }
}

/// Returns the owner in a file's name: capacity.trainings.json belongs to capacity, too.
fn before_dot(name: &OsStr) -> Option<&[u8]> {
    name.as_encoded_bytes().split(|&byte| byte == b'.').next()
}

/// Returns the run.json at a path or in a folder, or those in the folders of a folder without one,
/// or all runs of a shipped name.
///
/// # Errors
/// Returns an error if nothing shipped has that name, or the path is another kind of file.
pub fn run_json(path: PathBuf) -> Result<Vec<PathBuf>, String> {
    if shipped::is_named(&path) {
        shipped::runs(&path)
    } else if path.is_dir() {
        let within = || runs_within(&path);
        let own = path.join(RUN_JSON);
        Ok(if own.exists() { vec![own] } else { within() })
    } else if path.is_file() && path.extension().is_none_or(|ending| ending != "json") {
        let text = "expected a run.json, or its folder (runs/pairs/*/, with a slash at the end, means folders only)";
        Err(text.to_string())
    } else {
        Ok(vec![path])
    }
}

/// Returns the run.json of every folder in a folder, by name, or, if there is none, its own, which
/// is missing.
fn runs_within(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let runs = entries.map(|entry| entry.path().join(RUN_JSON));
    let mut runs: Vec<PathBuf> = runs.filter(|run| run.is_file()).collect();
    runs.sort();
    if runs.is_empty() {
        runs.push(folder.join(RUN_JSON));
    }
    runs
}

/// Returns the only run at a path; several are an error.
pub(crate) fn one_run(path: PathBuf) -> Result<PathBuf, String> {
    let mut runs = run_json(path)?;
    match runs.as_slice() {
        [] | [_] => Ok(runs.pop().expect("a path means at least one run")),
        several => {
            let (count, first) = (several.len(), name(&several[0]));
            Err(format!(
                "expected one run, these are {count}; name one, such as {first}"
            ))
        }
    }
}

pub(crate) fn first_run(path: PathBuf) -> Result<PathBuf, String> {
    Ok(run_json(path)?
        .into_iter()
        .next()
        .expect("a path means at least one run"))
}

/// Returns a run as a value for `--archive`: its name if it ships, else its run.json.
pub(crate) fn archive(run_json: &Path) -> Value {
    match full_name(run_json) {
        Some(name) => Value::Word(name),
        None => Value::Path(run_json.to_path_buf()),
    }
}

/// Returns the full name of a shipped run, such as "gallery:zero_one-1".
pub(crate) fn full_name(run_json: &Path) -> Option<String> {
    shipped::name(run_json).map(|(of, run)| format!("{of}:{run}"))
}

/// Returns a run's name for messages: its full name if it ships, else its run.json.
pub fn name(run_json: &Path) -> String {
    full_name(run_json).unwrap_or_else(|| run_json.display().to_string())
}

/// Returns a short name of each run for tables: its folder's name, with as many of the folders above
/// as tell it from the others, or its full name if it ships.
pub(crate) fn short_names(archives: &[&Path]) -> Vec<String> {
    let parts: Vec<Vec<String>> = archives.iter().map(|path| name_parts(path)).collect();
    let mut depths = vec![1; parts.len()];
    loop {
        let named = |(parts, depth): (&Vec<String>, &usize)| {
            parts[parts.len().saturating_sub(*depth)..].join("/")
        };
        let names: Vec<String> = parts.iter().zip(&depths).map(named).collect();
        let is_taken = |name: &String| names.iter().filter(|other| *other == name).count() > 1;
        let longer = (0..names.len())
            .filter(|&place| is_taken(&names[place]) && depths[place] < parts[place].len());
        let longer: Vec<usize> = longer.collect();
        if longer.is_empty() {
            return names;
        }
        longer.into_iter().for_each(|place| depths[place] += 1);
    }
}

/// Returns the folders of a run from the root, and its file's name if that is not the usual one.
fn name_parts(run_json: &Path) -> Vec<String> {
    if let Some(name) = full_name(run_json) {
        return vec![name];
    }
    let is_above = |part: Component| part == Component::ParentDir;
    let absolute = match run_json.components().any(is_above) {
        true => run_json.canonicalize(),
        false => std::path::absolute(run_json),
    };
    let absolute = absolute.unwrap_or_else(|_| run_json.to_path_buf());
    let name = |part: Component| match part {
        Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
        _ => None,
    };
    let mut parts: Vec<String> = absolute.components().filter_map(name).collect();
    if parts.len() > 1 && parts.last().is_some_and(|file| file == RUN_JSON) {
        parts.pop();
    }
    parts
}

/// Returns the default path of a run's results: beside its run.json, or here for a shipped run.
pub fn beside(archive: &Path, name: &str) -> PathBuf {
    match shipped::name(archive) {
        // The published robots have no name besides.
        Some((of, "")) => PathBuf::from(format!("{of}-{name}")),
        Some((of, run)) => PathBuf::from(format!("{of}-{run}-{name}")),
        None => archive.with_file_name(name),
    }
}

/// Returns the default path of joint results of several runs: in their common folder. With shipped
/// runs it is in the current folder, with the name of their set if they share one.
pub fn beside_all(archives: &[PathBuf], name: &str) -> PathBuf {
    let [first, others @ ..] = archives else {
        return PathBuf::from(name);
    };
    if others.is_empty() {
        return beside(first, name);
    }
    let Some((of, _)) = archives.iter().find_map(|path| shipped::name(path)) else {
        return above(archives).join(name);
    };
    match shipped::set(first)
        .filter(|set| others.iter().all(|other| shipped::set(other) == Some(*set)))
    {
        // `team.json` of `gallery:team` already has it.
        Some((of, set)) if !name.starts_with(set) => PathBuf::from(format!("{of}-{set}-{name}")),
        _ => PathBuf::from(format!("{of}-{name}")),
    }
}

/// Returns the folder of a run.json, or the nearest folder that contains several.
fn above(archives: &[PathBuf]) -> PathBuf {
    let folders: Vec<&Path> = archives
        .iter()
        .map(|path| path.parent().unwrap_or(Path::new("")))
        .collect();
    let Some(first) = folders.first() else {
        return PathBuf::new();
    };
    let holds = |folder: &&Path| folders.iter().all(|other| other.starts_with(folder));
    first
        .ancestors()
        .find(holds)
        .unwrap_or(Path::new(""))
        .to_path_buf()
}

/// Returns the most recent run.json under `runs/`, which commands use by default.
pub(crate) fn newest_run() -> Result<PathBuf, Error> {
    let runs = std::fs::read_dir(RUNS).into_iter().flatten().flatten();
    let files = runs.map(|entry| entry.path().join(RUN_JSON));
    let found = files.filter_map(|file| Some((file.metadata().ok()?, file)));
    let found = found.filter(|(about, _)| about.is_file());
    let dated = found.filter_map(|(about, file)| Some((about.modified().ok()?, file)));
    dated.max().map(|(_, file)| file).ok_or_else(|| {
        let make = Invocation::new("evolve").option("config", "quickstart.toml");
        let error = Error::input("there is no run under runs/".to_string()).remedy(Remedy::NameRun);
        error.remedy(Remedy::Run(make, "makes one"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_name_tells_a_run_from_the_others() {
        let names = |paths: &[&str]| {
            let paths: Vec<&Path> = paths.iter().map(Path::new).collect();
            short_names(&paths)
        };
        assert_eq!(
            names(&[
                "runs/a/run.json",
                "runs/b/run.json",
                "gallery:zero_one-1/run.json"
            ]),
            ["a", "b", "gallery:zero_one-1"]
        );
        assert_eq!(
            names(&["x/one/a/run.json", "x/two/a/run.json", "x/b/run.json"]),
            ["one/a", "two/a", "b"]
        );
        // Files of one folder; a folder that is the beginning of another.
        assert_eq!(
            names(&["x/old.json", "x/run.json", "/a/run.json", "/b/a/run.json"]),
            ["old.json", "x", "a", "b/a"]
        );
        let here = std::env::current_dir().unwrap();
        let here = here.file_name().unwrap().to_string_lossy();
        assert_eq!(names(&["run.json"]), [here.as_ref()]);
    }
}
