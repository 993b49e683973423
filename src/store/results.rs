//! Reads and writes morphcog's JSON files, with tables beside results and long lists line by line.

use crate::base::error::Error;
use crate::base::files::{read_bytes, write_atomically};
use crate::base::hash::{sha256_hex, short};
use crate::base::ownership;
use crate::base::remedy::{Invocation, Remedy};
use crate::base::session::Session;
use crate::config::reading;
use crate::shipped::read_text;
use crate::store::names::{EVAL_JSON, RUN_JSON};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io;
use std::path::{Path, PathBuf};

/// The reason why results are always valid JSON.
const JSON: &str = "numbers are finite and keys are text: JSON has all of it";

/// A JSON file of morphcog. Its fields name the [ranges](crate::base::ranges) of their numbers.
pub(crate) trait Stored: DeserializeOwned {
    /// The `format` of the file, and the newest version of its schema that can be read.
    const FORMAT: (&'static str, u32);

    /// Checks what types cannot, such as counts that must agree.
    ///
    /// # Errors
    /// Returns an error that names the key.
    fn validate(&self) -> Result<(), Error>;
}

/// Reads a file; `maker` is the command that makes one if there is none.
pub(crate) fn read<T: Stored>(path: &Path, maker: Option<&'static str>) -> Result<T, Error> {
    let text = read_text(path).map_err(|error| match maker {
        Some(command) => Error::reading_or(
            path,
            &error,
            Remedy::Run(making(command, path), "makes one"),
        ),
        None => Error::reading(path, &error),
    })?;
    parse(&text, &path.display().to_string())
}

/// Returns the command that makes a file beside a run or, for networks, beside an evaluation.
pub(crate) fn making(command: &'static str, path: &Path) -> Invocation {
    let (archive, make) = (path.with_file_name(RUN_JSON), Invocation::new(command));
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    match folder.filter(|_| archive.exists()) {
        Some(_) if command == "capacity" => {
            make.option("eval", path.with_file_name(EVAL_JSON).as_path())
        }
        Some(folder) => make.option("archive", folder),
        None => make,
    }
}

/// Parses the text of a file; `name` appears in messages.
pub(crate) fn parse<T: Stored>(text: &str, name: &str) -> Result<T, Error> {
    let file: T = reading::read_versioned(text, name, T::FORMAT.0, T::FORMAT.1)?;
    file.validate()
        .map(|()| file)
        .map_err(|error| error.in_place(name))
}

/// Reads the file that results are about to replace, if it exists. If it cannot be read, that is an
/// error, because nobody knows what would be lost.
pub(crate) fn replaced<T: Stored>(path: &Path) -> Result<Option<T>, Error> {
    // A device or a pipe accepts whatever is written to it.
    if !path.is_file() {
        return Ok(None);
    }
    let refuse = |error: Error| error.advice("move it away: it would be written over");
    read(path, None)
        .map(Some)
        .map_err(|error| refuse(error).remedy(Remedy::ChooseOut))
}

/// Encodes an object whose last key is a list: the head on one line, then a line for each item.
pub(crate) fn by_lines(head: &impl Serialize, list: &[impl Serialize]) -> String {
    let head = serde_json::to_string(head).expect(JSON);
    let head = head
        .strip_suffix("]}")
        .expect("the last key of the head is an empty list");
    let lines: Vec<String> = list
        .iter()
        .map(|one| serde_json::to_string(one).expect(JSON))
        .collect();
    format!("{head}\n{}\n]}}\n", lines.join(",\n"))
}

/// Moves an unrelated file, with its table, out of the way of results: under its own name and the
/// beginning of its SHA-256. `is_same` returns true if the file is about the same as the results.
pub(crate) fn make_room(
    path: &Path,
    is_same: impl FnOnce() -> bool,
    session: &Session,
) -> Result<(), Error> {
    if !path.is_file() || is_same() {
        return Ok(());
    }
    let found = read_bytes(path).map_err(|error| Error::reading(path, &error))?;
    let hash = sha256_hex(&found);
    let aside = |path: &Path| {
        let mut name = path.file_stem().unwrap_or_default().to_os_string();
        name.push(format!("-{}.", short(&hash)));
        name.push(path.extension().unwrap_or_default());
        path.with_file_name(name)
    };
    // The table first: after a kill in between, the results are still there for the next attempt.
    for path in [&path.with_extension("csv"), path] {
        match ownership::check(path).and_then(|()| std::fs::rename(path, aside(path))) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(Error::writing(path, &error));
            }
            _ => {}
        }
    }
    let (path, aside) = (path.display(), aside(path));
    session.observer.warning(&format!(
        "{path}: held the results of another test; they are in {} now",
        aside.display()
    ));
    Ok(())
}

/// Writes results, and their table beside them with the extension `csv`. The results are written
/// last: if the process is killed in between, the old ones remain and are replaced later. If
/// results change, it first removes their old `figures`, to be redrawn.
pub(crate) fn write_with_table(
    path: &Path,
    json: &str,
    table: &[u8],
    figures: impl IntoIterator<Item = PathBuf>,
) -> Result<(), Error> {
    let is_known = read_bytes(path).is_ok_and(|before| before == json.as_bytes());
    for figure in figures.into_iter().filter(|_| !is_known) {
        match ownership::check(&figure).and_then(|()| std::fs::remove_file(&figure)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(Error::writing(&figure, &error));
            }
            _ => {}
        }
    }
    [
        (&path.with_extension("csv"), table),
        (&path.to_path_buf(), json.as_bytes()),
    ]
    .into_iter()
    .try_for_each(|(path, content)| {
        write_atomically(path, content).map_err(|error| Error::writing(path, &error))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::audit::AuditFile;
    use crate::store::capacity::CapacityFile;
    use crate::store::eval::EvalFile;
    use crate::store::names::{
        AUDIT_JSON, CAPACITY_JSON, EVAL_JSON, RESPONSE_JSON, RUN_JSON, TEAM_JSON, VALIDATION_JSON,
    };
    use crate::store::response::ResponseFile;
    use crate::store::run::RunFile;
    use crate::store::team::TeamFile;
    use crate::store::training::File;
    use crate::store::validation::ValidationFile;
    use serde_json::Value;

    /// Reads a text as the kind of file that its format says: files may have any name.
    fn refusal(name: &str, text: &str) -> Option<Error> {
        type Refusal = fn(&str, &str) -> Option<Error>;
        fn of<T: Stored>() -> (&'static str, Refusal) {
            (T::FORMAT.0, |text, name| parse::<T>(text, name).err())
        }
        let kinds = [
            of::<AuditFile>(),
            of::<CapacityFile>(),
            of::<EvalFile>(),
            of::<ResponseFile>(),
            of::<RunFile>(),
            of::<TeamFile>(),
            of::<ValidationFile>(),
            of::<File>(),
        ];
        let format = serde_json::from_str::<Value>(text).unwrap()["format"].clone();
        let kind = kinds.iter().find(|(kind, _)| format == *kind);
        let (_, refusal) = kind.unwrap_or_else(|| panic!("{name}: no file of {format} ships"));
        refusal(text, name)
    }

    /// Returns the path of every JSON file that ships with the program or lies in the repository.
    fn shipped() -> Vec<PathBuf> {
        let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("data")];
        let mut found = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                let name = path.file_name().unwrap().to_str().unwrap().to_string();
                match name.strip_suffix(".gz") {
                    _ if path.is_dir() => folders.push(path),
                    Some(name) => {
                        let run = folder.file_name().unwrap().to_str().unwrap();
                        found.push(PathBuf::from(format!("atlas:{run}/{name}")));
                    }
                    None if name.ends_with(".json") && name != "gallery.json" => found.push(path),
                    None => {}
                }
            }
        }
        found.sort();
        found
    }

    #[test]
    fn every_file_that_ships_is_read() {
        let all = shipped();
        assert!(all.len() > 150, "{}", all.len());
        for path in all
            .iter()
            .filter(|path| path.extension().is_some_and(|ending| ending == "json"))
        {
            let name = path.file_name().unwrap().to_str().unwrap();
            let text = read_text(path).unwrap();
            assert_eq!(
                refusal(name, &text).map(|error| error.message),
                None,
                "{}",
                path.display()
            );
        }
    }

    /// Returns the smallest shipped file of each kind, and one of a training.
    fn samples() -> Vec<(String, Value)> {
        let mut smallest = std::collections::BTreeMap::<String, String>::new();
        for path in shipped()
            .iter()
            .filter(|path| path.extension().is_some_and(|ending| ending == "json"))
        {
            let name = path.file_name().unwrap().to_str().unwrap().to_string();
            let text = read_text(path).unwrap();
            let known = smallest.entry(name).or_insert_with(|| text.clone());
            if text.len() < known.len() {
                *known = text;
            }
        }
        let training = File::new(
            "key".to_string(),
            vec![vec![Some(1.5), None], vec![Some(-2.5)]],
        );
        smallest.insert(
            "training.json".to_string(),
            serde_json::to_string(&training).unwrap(),
        );
        smallest
            .into_iter()
            .map(|(name, text)| (name, serde_json::from_str(&text).unwrap()))
            .collect()
    }

    /// Finds a number of every kind in a value; in lists, in the first item.
    fn numbers(value: &Value, at: &str, found: &mut Vec<String>) {
        match value {
            Value::Number(_) => found.push(at.to_string()),
            Value::Array(items) => {
                items
                    .iter()
                    .take(1)
                    .for_each(|item| numbers(item, &format!("{at}/0"), found));
            }
            Value::Object(keys) => {
                keys.iter()
                    .for_each(|(key, value)| numbers(value, &format!("{at}/{key}"), found));
            }
            _ => {}
        }
    }

    #[test]
    fn no_number_of_any_file_may_be_endless_and_errors_name_file_and_key() {
        for (name, sample) in samples() {
            assert_eq!(
                refusal(&name, &sample.to_string()).map(|error| error.message),
                None,
                "{name}"
            );
            let mut places = Vec::new();
            numbers(&sample, "", &mut places);
            // A setting may be infinite, such as the seconds between two checkpoints.
            places.retain(|place| !place.starts_with("/config/"));
            assert!(places.len() >= 2, "{name}: {places:?}");
            for place in places {
                for number in [1e308, -1e308] {
                    let mut changed = sample.clone();
                    *changed.pointer_mut(&place).unwrap() = Value::from(number);
                    let error = refusal(&name, &changed.to_string());
                    let error =
                        error.unwrap_or_else(|| panic!("{name}: {place} = {number} is taken"));
                    assert!(
                        error.message.starts_with(&format!("{name}:")),
                        "{place}: {error}"
                    );
                    // The key, or the section that contains it.
                    let mut keys = place
                        .split('/')
                        .filter(|key| !key.is_empty() && key.parse::<u8>().is_err());
                    assert!(
                        keys.any(|key| error.message.contains(key)),
                        "{place}: {error}"
                    );
                }
            }
        }
    }

    #[test]
    fn counts_that_do_not_go_together_are_refused_with_their_key() {
        let samples: std::collections::BTreeMap<String, Value> = samples().into_iter().collect();
        let number = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        for (name, place, value) in [
            (EVAL_JSON, "/robots/0/accuracy", "7.5"),
            (EVAL_JSON, "/robots/0/accuracy", "0.123"),
            (EVAL_JSON, "/robots/0/interval", "[5, -3]"),
            (EVAL_JSON, "/robots/0/interval", "[0.5, 0.25]"),
            (EVAL_JSON, "/robots/0/right", "1000000"),
            (EVAL_JSON, "/robots/0/unstable", "1000000"),
            (EVAL_JSON, "/robots/0/run", "99"),
            (EVAL_JSON, "/robots/0/displacements", "[1.5]"),
            (EVAL_JSON, "/robots/0/first_group_walks", "\"up\""),
            (EVAL_JSON, "/images", "[]"),
            (AUDIT_JSON, "/elites", "0"),
            (AUDIT_JSON, "/robots/0/persisting", "1.5"),
            (CAPACITY_JSON, "/tasks/0/curves/0/points", "[]"),
            (CAPACITY_JSON, "/tasks/0/curves/0/points/0/mean", "-0.5"),
            (CAPACITY_JSON, "/tasks/0/robots", "0"),
            (RESPONSE_JSON, "/robots/0/rollouts", "1"),
            (RESPONSE_JSON, "/robots/0/unstable", "599"),
            (RESPONSE_JSON, "/robots/0/places", "[]"),
            (TEAM_JSON, "/size", "1"),
            (TEAM_JSON, "/images", "[]"),
            (TEAM_JSON, "/answers/votes/accuracy/right", "1000000"),
            (TEAM_JSON, "/answers/votes/confusion/0/0", "1000000"),
            (VALIDATION_JSON, "/robots/0/right", "1000000"),
            (RUN_JSON, "/stats/num_elites", "0"),
            (RUN_JSON, "/stats/coverage", "0.125"),
            (RUN_JSON, "/stats/obj_max", "null"),
            ("training.json", "/checksum", "null"),
            ("training.json", "/rollouts/0", "[1.5]"),
            ("training.json", "/rollouts", "[[-2.5], [1.5, null]]"),
            (
                "training.json",
                "/rollouts",
                "[[1.5, null], [-2.5], [-2.5]]",
            ),
            ("training.json", "/rollouts/0/0", "1.5000000000000002"),
        ] {
            let mut changed = samples[name].clone();
            *changed
                .pointer_mut(place)
                .unwrap_or_else(|| panic!("{name}: {place}")) = number(value);
            let error = refusal(name, &changed.to_string());
            let error = error.unwrap_or_else(|| panic!("{name}: {place} = {value} is taken"));
            assert!(
                error.message.starts_with(&format!("{name}:")),
                "{place} = {value}: {error}"
            );
        }
        // An earlier version wrote no checksum.
        let mut old = samples["training.json"].clone();
        old["format_version"] = Value::from(1);
        old.as_object_mut().unwrap().remove("checksum");
        assert!(refusal("training.json", &old.to_string()).is_none());
    }

    #[test]
    fn figures_of_other_results_go_before_the_results_are_written_and_those_of_the_same_stay() {
        let folder = tempfile::tempdir().unwrap();
        let [json, csv, figure] =
            ["response.json", "response.csv", "response.svg"].map(|name| folder.path().join(name));
        std::fs::write(&figure, "old").unwrap();
        write_with_table(&json, "{}", b"a", [figure.clone()]).unwrap();
        assert!(!figure.exists() && csv.exists());
        std::fs::write(&figure, "drawn").unwrap();
        write_with_table(&json, "{}", b"a", [figure.clone()]).unwrap();
        assert!(figure.exists());
        // If the table cannot be written the old results remain, so that they are made again.
        std::fs::remove_file(&csv).unwrap();
        std::fs::create_dir(&csv).unwrap();
        assert!(write_with_table(&json, "{ }", b"b", []).is_err());
        assert_eq!(std::fs::read(&json).unwrap(), b"{}");
    }
}
