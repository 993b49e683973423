//! Runs that ship with the program if it has the feature `gallery`. A path with [`PREFIX`] names
//! one run (`gallery:zero_one-1`) or a set (`gallery:zero_one`), and is read like a folder.

use std::path::{Path, PathBuf};

pub(crate) const PREFIX: &str = "gallery:";

/// The run of the published robots. It has no files: `robots::published` builds it from a list.
pub(crate) const PUBLISHED: &str = "gallery:";

/// Robots that tell zeros from ones, best run first; the default where there are no other runs.
pub const ZERO_ONE: &str = "gallery:zero_one";

/// A robot for each pair of digits; together they answer as a team.
pub const TEAM: &str = "gallery:team";

/// Gaits to train, those of `demo` first; they have no task, so they are not in `gallery:all`.
pub(crate) const GAITS: &str = "gallery:gaits";

/// A run whose robots compute logic gates of two cues.
pub const GATES: &str = "gallery:gates";

/// All runs whose robots read digits.
const ALL: &str = "gallery:all";

/// A run: its name, and its files with their names.
type Run = (&'static str, &'static [(&'static str, &'static str)]);

/// Runs that belong together: the name of the set, and at least one run.
type Set = (&'static str, &'static [Run]);

/// Makes a run of the files of a folder of `data/`.
#[cfg(feature = "gallery")]
macro_rules! files {
    ($name:expr, $folder:expr, $($file:literal)*) => {
        (
            $name,
            &[$(($file, include_str!(concat!("../../data/", $folder, "/", $file)))),*],
        )
    };
}

#[cfg(feature = "gallery")]
macro_rules! run {
    ($name:expr, $folder:expr) => {
        files!($name, $folder, "run.json" "audit.json" "validation.json")
    };
}

/// Makes runs named after their digits, from a folder of `data/`.
#[cfg(feature = "gallery")]
macro_rules! tasks {
    ($folder:literal: $($task:literal)*) => {
        &[$(run!(concat!("gallery:", $folder, "-", $task), concat!($folder, "/", $task))),*]
    };
}

/// Runs provided at run time, where none ship.
#[cfg(not(feature = "gallery"))]
static PROVIDED: std::sync::OnceLock<Vec<Set>> = std::sync::OnceLock::new();

/// All shipped runs. Those of a set are numbered by their seeds, or named after their digits.
#[cfg(feature = "gallery")]
const SETS: &[Set] = &[
    (
        ZERO_ONE,
        &[
            run!("gallery:zero_one-1", "trained/zero-one-1"),
            run!("gallery:zero_one-2", "trained/zero-one-2"),
            run!("gallery:zero_one-3", "trained/zero-one-3"),
        ],
    ),
    (
        // A robot for each of the paper's tasks of four digits.
        "gallery:four_digit",
        tasks!("four_digit": "0v123" "1v023" "2v013" "3v012" "01v23" "02v13" "03v12"),
    ),
    (
        TEAM,
        tasks!("team":
            "0v1" "0v2" "0v3" "0v4" "0v5" "0v6" "0v7" "0v8" "0v9" "1v2" "1v3" "1v4" "1v5" "1v6" "1v7"
            "1v8" "1v9" "2v3" "2v4" "2v5" "2v6" "2v7" "2v8" "2v9" "3v4" "3v5" "3v6" "3v7" "3v8" "3v9"
            "4v5" "4v6" "4v7" "4v8" "4v9" "5v6" "5v7" "5v8" "5v9" "6v7" "6v8" "6v9" "7v8" "7v9" "8v9"
        ),
    ),
    (
        GAITS,
        &[
            files!("gallery:gaits-6", "gaits/seed-6", "run.json" "response.json"),
            files!("gallery:gaits-1", "gaits/seed-1", "run.json" "response.json"),
        ],
    ),
    (GATES, &[files!(GATES, "gates", "run.json" "audit.json")]),
];

/// Returns all runs that there are by name.
fn sets() -> &'static [Set] {
    #[cfg(feature = "gallery")]
    return SETS;
    #[cfg(not(feature = "gallery"))]
    PROVIDED.get().map_or(&[], Vec::as_slice)
}

/// A set of runs with the texts of their files, as [`exported`] passes it to [`provide`].
type Exported = (String, Vec<(String, Vec<(String, String)>)>);

/// Encodes what the static page needs of the shipped runs: robots, and their audits.
#[cfg(feature = "gallery")]
pub(crate) fn exported() -> String {
    let is_needed = |file: &str| ["run.json", "audit.json"].contains(&file);
    let run = |(name, files): &Run| {
        let files = files.iter().filter(|(file, _)| is_needed(file));
        let files = files.map(|(file, text)| (file.to_string(), text.to_string()));
        (name.to_string(), files.collect())
    };
    // Gaits have no task, so the page does not offer them.
    let sets = SETS.iter().filter(|(set, _)| *set != GAITS);
    let sets = sets.map(|(set, runs)| (set.to_string(), runs.iter().map(run).collect()));
    let sets: Vec<Exported> = sets.collect();
    serde_json::to_string(&sets).expect("JSON has all of it")
}

/// Provides the runs that [`exported`] encoded, for as long as the program runs, where none ship.
/// Later calls change nothing.
///
/// # Errors
/// Returns the reason if the text is something else.
#[cfg(feature = "serve")]
pub(crate) fn provide(text: &str) -> Result<(), String> {
    let sets: Vec<Exported> = serde_json::from_str(text).map_err(|error| error.to_string())?;
    #[cfg(not(feature = "gallery"))]
    PROVIDED.get_or_init(|| sets.into_iter().map(kept).collect());
    #[cfg(feature = "gallery")]
    drop(sets);
    Ok(())
}

/// Keeps a set for as long as the program runs.
#[cfg(not(feature = "gallery"))]
fn kept((name, runs): Exported) -> Set {
    let leak = |text: String| -> &'static str { text.leak() };
    let run = |(name, files): (String, Vec<(String, String)>)| {
        let files: Vec<_> = files
            .into_iter()
            .map(|(name, text)| (leak(name), leak(text)))
            .collect();
        (leak(name), &*files.leak())
    };
    let runs: Vec<Run> = runs.into_iter().map(run).collect();
    (leak(name), &*runs.leak())
}

pub(crate) fn text(name: &str, file: &str) -> Option<&'static str> {
    let (_, files) = sets()
        .iter()
        .flat_map(|(_, runs)| *runs)
        .find(|(run, _)| *run == name)?;
    files
        .iter()
        .find(|(own, _)| *own == file)
        .map(|(_, text)| *text)
}

/// Returns the `run.json` of every run of a set, or of one run; the error lists the runs there are.
pub(crate) fn runs(name: &str) -> Result<Vec<PathBuf>, String> {
    if name == PUBLISHED {
        return Ok(vec![Path::new(PUBLISHED).join("run.json")]);
    }
    runs_of(sets(), name)
}

fn runs_of(sets: &[Set], name: &str) -> Result<Vec<PathBuf>, String> {
    if sets.is_empty() {
        return Err(format!(
            "{name} is not in this build of morphcog: build it with the feature `gallery`, \
             or name a run.json by its path"
        ));
    }
    let of_set = |(set, runs): &Set| {
        let is_whole = *set == name || name == ALL && ![GAITS, GATES].contains(set);
        runs.iter()
            .map(|(run, _)| *run)
            .filter(|run| is_whole || *run == name)
            .collect::<Vec<&str>>()
    };
    let found: Vec<PathBuf> = sets
        .iter()
        .flat_map(of_set)
        .map(|run| PathBuf::from(format!("{run}/run.json")))
        .collect();
    match found.is_empty() {
        true => {
            // Each set is listed with one of its runs as an example.
            let examples = sets.iter().flat_map(|(set, runs)| [*set, runs[0].0]);
            let mut names: Vec<&str> = examples.collect();
            names.dedup();
            Err(format!(
                "there is no {name}: expected {ALL}, {}",
                names.join(", ")
            ))
        }
        false => Ok(found),
    }
}

#[cfg(all(test, feature = "gallery"))]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_runs_and_their_files() {
        let all = runs("gallery:all").unwrap();
        let set = runs("gallery:zero_one").unwrap();
        let [one] = &runs("gallery:zero_one-1").unwrap()[..] else {
            panic!("one run")
        };
        assert!(all.len() >= set.len() && set.len() > 1 && set[0] == *one);
        for path in &all {
            let (name, file) = path.to_str().unwrap().split_once('/').unwrap();
            assert!(
                text(name, file).unwrap().contains("morphcog-run"),
                "{}",
                path.display()
            );
            assert!(text(name, "audit.json").unwrap().contains("morphcog-audit"));
            assert_eq!(text(name, "nothing.json"), None);
        }
        let error = runs("gallery:zero").unwrap_err();
        assert!(
            error.contains(
                "gallery:zero_one-1, gallery:four_digit, gallery:four_digit-0v123, gallery:team"
            ),
            "{error}"
        );
        assert_eq!(runs(TEAM).unwrap().len(), 45);
    }

    #[test]
    fn a_build_without_runs_says_so() {
        let error = runs_of(&[], "gallery:zero_one").unwrap_err();
        assert!(
            error.starts_with("gallery:zero_one") && error.contains("feature `gallery`"),
            "{error}"
        );
    }
}
