//! Runs that ship with the program. A path that begins with [`PREFIX`] names them: `gallery:zero_one-1`
//! one, `gallery:zero_one` all of a set. Their files are read as if they lay in a folder of that name.

use std::path::{Path, PathBuf};

/// How a name of shipped runs begins.
pub const PREFIX: &str = "gallery:";

/// Robots that tell zeros from ones, the best run first: what is shown where there are no others.
pub const ZERO_ONE: &str = "gallery:zero_one";

/// Gaits to be trained, as by `demo`; they have no task, and so are not among all.
const GAITS: &str = "gaits";

/// A run: its name, and its files with their names.
type Run = (&'static str, &'static [(&'static str, &'static str)]);

/// The files of a run in a folder of `data/`.
macro_rules! run {
    ($name:literal, $folder:literal) => {
        (
            $name,
            &[
                ("run.json", include_str!(concat!("../../data/", $folder, "/run.json"))),
                ("audit.json", include_str!(concat!("../../data/", $folder, "/audit.json"))),
                ("validation.json", include_str!(concat!("../../data/", $folder, "/validation.json"))),
            ],
        )
    };
}

/// All of them. The runs of a set are numbered, trained ones by their seeds.
const RUNS: &[Run] = &[
    run!("zero_one-1", "trained/zero-one-1"),
    run!("zero_one-2", "trained/zero-one-2"),
    run!("zero_one-3", "trained/zero-one-3"),
    (
        "gaits-1",
        &[
            ("run.json", include_str!("../../data/gaits/seed-1/run.json")),
            ("response.json", include_str!("../../data/gaits/seed-1/response.json")),
        ],
    ),
];

/// The run and the file that a path names, if it begins as those of shipped runs do.
fn parts(path: &Path) -> Option<(&str, &str)> {
    let name = path.to_str()?.strip_prefix(PREFIX)?;
    Some(name.split_once(['/', '\\']).unwrap_or((name, "")))
}

/// Whether a path is of a shipped run.
pub fn is_shipped(path: &Path) -> bool {
    parts(path).is_some()
}

/// The text of a file of a shipped run; none of other paths, or if there is no such file.
pub fn text(path: &Path) -> Option<&'static str> {
    let (name, file) = parts(path)?;
    let (_, files) = RUNS.iter().find(|(run, _)| *run == name)?;
    files.iter().find(|(own, _)| *own == file).map(|(_, text)| *text)
}

/// The `run.json` of every run of a set, or of one run.
///
/// # Errors
/// What there is, if there is no run of that name.
pub fn runs(path: &Path) -> Result<Vec<PathBuf>, String> {
    let (name, _) = parts(path).expect("callers ask is_shipped before");
    let is_meant =
        |run: &&Run| run.0 == name || set_of(run.0) == name || name == "all" && set_of(run.0) != GAITS;
    let found: Vec<PathBuf> = RUNS
        .iter()
        .filter(is_meant)
        .map(|(run, _)| PathBuf::from(format!("{PREFIX}{run}/run.json")))
        .collect();
    match found.is_empty() {
        true => {
            let mut names: Vec<&str> = RUNS.iter().flat_map(|(run, _)| [set_of(run), run]).collect();
            names.dedup();
            let names: Vec<String> = names.iter().map(|name| format!("{PREFIX}{name}")).collect();
            Err(format!("there is no {PREFIX}{name}: expected {PREFIX}all, {}", names.join(", ")))
        }
        false => Ok(found),
    }
}

/// The set of a run: its name without its number.
fn set_of(run: &str) -> &str {
    run.rsplit_once('-').map_or(run, |(set, _)| set)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_runs_and_their_files() {
        let all = runs(Path::new("gallery:all")).unwrap();
        let set = runs(Path::new("gallery:zero_one")).unwrap();
        let [one] = &runs(Path::new("gallery:zero_one-1")).unwrap()[..] else { panic!("one run") };
        assert!(all.len() >= set.len() && set.len() > 1 && set[0] == *one);
        for path in &all {
            assert!(is_shipped(path) && text(path).unwrap().contains("morphcog-run"), "{}", path.display());
            assert!(text(&path.with_file_name("audit.json")).unwrap().contains("morphcog-audit"));
            assert_eq!(text(&path.with_file_name("nothing.json")), None);
        }
        assert!(!is_shipped(Path::new("runs/gallery:x/run.json")));
        let error = runs(Path::new("gallery:zero")).unwrap_err();
        assert!(error.contains("gallery:zero_one, gallery:zero_one-1"), "{error}");
    }
}
