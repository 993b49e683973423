//! The atlas: compressed runs in the repository, outside the program. A path with [`PREFIX`] names
//! one run (`atlas:zero_one-1`) or those of all seeds (`atlas:zero_one`).

use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};

pub(crate) const PREFIX: &str = "atlas:";

/// Environment variable with the folder of the atlas.
pub(crate) const VARIABLE: &str = "MORPHCOG_ATLAS";

/// Folder of the atlas in the repository, searched second.
const FOLDER: &str = "data/atlas";

const COMPRESSED: &str = ".gz";

/// Returns the folders to search, in order; `variable` is the value of `MORPHCOG_ATLAS`.
fn folders(variable: Option<&OsStr>) -> Vec<PathBuf> {
    let set = variable
        .filter(|value| !value.is_empty())
        .map(PathBuf::from);
    set.into_iter().chain([PathBuf::from(FOLDER)]).collect()
}

fn variable() -> Option<std::ffi::OsString> {
    std::env::var_os(VARIABLE)
}

pub(crate) fn folder_of(run: &str) -> Option<PathBuf> {
    folders(variable().as_deref())
        .into_iter()
        .find(|folder| holds_run(&folder.join(run)))
}

/// Returns the path of a run's compressed file; the error says where it may be and how to get it.
pub(crate) fn file(run: &str, file: &str) -> io::Result<PathBuf> {
    found(run, file, variable().as_deref())
}

fn found(run: &str, file: &str, variable: Option<&OsStr>) -> io::Result<PathBuf> {
    if let Some(set) = variable
        .filter(|value| !value.is_empty())
        .filter(|value| !Path::new(value).is_dir())
    {
        let text = format!("{VARIABLE}={}: expected a folder", Path::new(set).display());
        return Err(io::Error::new(io::ErrorKind::NotADirectory, text));
    }
    let folders = folders(variable);
    let places = folders
        .iter()
        .map(|folder| folder.join(run).join(format!("{file}{COMPRESSED}")));
    let places: Vec<PathBuf> = places.collect();
    if let Some(place) = places.iter().find(|place| place.is_file()) {
        return Ok(place.clone());
    }
    let looked: Vec<String> = places
        .iter()
        .map(|place| place.display().to_string())
        .collect();
    let unset = if folders.len() == 1 {
        format!(" ({VARIABLE} is not set)")
    } else {
        String::new()
    };
    let what = match folders
        .iter()
        .map(|folder| names(folder))
        .find(|names| !names.is_empty())
    {
        Some(names) => format!("expected one of {}", names.join(", ")),
        None => {
            format!(
                "the atlas is in the repository: call morphcog there, or set {VARIABLE} to its {FOLDER}"
            )
        }
    };
    Err(io::Error::new(
        io::ErrorKind::NotFound,
        format!("there is no {}{unset}; {what}", looked.join(" and no ")),
    ))
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let of_runs = entries.filter(|entry| holds_run(&entry.path()));
    let mut names: Vec<String> = of_runs
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort_by_key(|name| {
        (
            name.trim_end_matches(|c: char| c.is_ascii_digit())
                .to_string(),
            seed(name),
        )
    });
    names
}

fn holds_run(folder: &Path) -> bool {
    folder.join(format!("run.json{COMPRESSED}")).is_file()
}

/// Returns the number at the end of a name.
fn seed(name: &str) -> Option<u64> {
    name.rsplit_once('-')?.1.parse().ok()
}

/// Returns the `run.json` of a run, or of every seed of a set. Without either, returns the path of
/// a run of that name; reading it reports the problem.
pub(crate) fn runs(name: &str) -> Vec<PathBuf> {
    seeds(name, variable().as_deref())
}

fn seeds(name: &str, variable: Option<&OsStr>) -> Vec<PathBuf> {
    let run_json = |name: &str| PathBuf::from(format!("{PREFIX}{name}/run.json"));
    for folder in folders(variable) {
        if holds_run(&folder.join(name)) {
            break;
        }
        let is_of_set = |found: &String| {
            found.rsplit_once('-').is_some_and(|(set, _)| set == name) && seed(found).is_some()
        };
        let of_set: Vec<PathBuf> = names(&folder)
            .into_iter()
            .filter(is_of_set)
            .map(|name| run_json(&name))
            .collect();
        if !of_set.is_empty() {
            return of_set;
        }
    }
    vec![run_json(name)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_compressed_files_of_the_first_atlas_that_has_them() {
        let folder = tempfile::tempdir().unwrap();
        for run in ["zero_one-2", "zero_one-10", "zero_one-more-1", "zero_one"] {
            std::fs::create_dir(folder.path().join(run)).unwrap();
            std::fs::write(folder.path().join(run).join("run.json.gz"), "").unwrap();
        }
        let variable = Some(folder.path().as_os_str());
        let place = found("zero_one-2", "run.json", variable).unwrap();
        assert_eq!(place, folder.path().join("zero_one-2").join("run.json.gz"));
        let error = found("zero_one-30", "run.json", variable)
            .unwrap_err()
            .to_string();
        let said = format!(
            "there is no {} and no data/atlas/zero_one-30/run.json.gz; expected one of zero_one",
            folder.path().join("zero_one-30/run.json.gz").display()
        );
        assert!(error.starts_with(&said), "{error}");
        assert_eq!(
            seeds("zero_one", variable),
            [Path::new("atlas:zero_one/run.json")]
        );
        // A folder of that name may hold results about all seeds.
        std::fs::rename(
            folder.path().join("zero_one/run.json.gz"),
            folder.path().join("zero_one/eval.json.gz"),
        )
        .unwrap();
        let of_set = ["atlas:zero_one-2/run.json", "atlas:zero_one-10/run.json"].map(Path::new);
        assert_eq!(seeds("zero_one", variable), of_set);
    }

    #[test]
    fn without_an_atlas_the_error_says_how_to_get_it() {
        let folder = tempfile::tempdir().unwrap();
        let nowhere = folder.path().join("nowhere");
        let error = |folder: &Path| {
            found("x", "run.json", Some(folder.as_os_str()))
                .unwrap_err()
                .to_string()
        };
        assert!(
            error(&nowhere).starts_with("MORPHCOG_ATLAS=")
                && error(&nowhere).contains("expected a folder")
        );
        std::fs::create_dir(&nowhere).unwrap();
        let error = error(&nowhere);
        assert!(
            error.contains("nowhere/x/run.json.gz and no data/atlas/x/run.json.gz"),
            "{error}"
        );
        let error = found("x-7", "run.json", None).unwrap_err().to_string();
        assert!(error.contains("MORPHCOG_ATLAS is not set"), "{error}");
    }
}
