//! Runs that ship with the program if it has the feature `gallery`. A path with [`PREFIX`] names
//! one run (`gallery:zero_one-1`) or a set (`gallery:zero_one`), and is read like a folder.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

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

/// The files of a run: their names and texts.
type Files = Vec<(&'static str, &'static str)>;

/// A run: its name, and its files with their names.
type Run = (&'static str, &'static [(&'static str, &'static str)]);

/// Runs that belong together: the name of the set, and at least one run.
type Set = (&'static str, &'static [Run]);

/// All shipped runs, unpacked when they are first needed: those that `build.rs` packed, or, without
/// the feature `gallery`, those that [`provide`] was given.
static SETS: OnceLock<Vec<Set>> = OnceLock::new();

/// Returns all runs that there are by name.
fn sets() -> &'static [Set] {
    #[cfg(feature = "gallery")]
    return SETS.get_or_init(|| unpacked(&packed()).expect("build.rs packed it"));
    #[cfg(not(feature = "gallery"))]
    SETS.get().map_or(&[], Vec::as_slice)
}

/// Returns the shipped runs as text: all files behind lines that name them, as `build.rs` writes it.
#[cfg(feature = "gallery")]
fn packed() -> String {
    use std::io::Read;
    let packed: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/gallery.gz"));
    let mut text = String::new();
    flate2::read::GzDecoder::new(packed)
        .read_to_string(&mut text)
        .expect("build.rs packed text");
    text
}

/// Reads the runs of a text that [`packed`] or [`exported`] made; `None` if it is something else.
/// They are kept for as long as the program runs.
fn unpacked(text: &str) -> Option<Vec<Set>> {
    let leak = |text: &str| -> &'static str { text.to_string().leak() };
    let mut sets: Vec<(&str, Vec<(&str, Files)>)> = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let (line, after) = rest.split_once('\n')?;
        rest = after;
        let (kind, name) = line.split_once(' ')?;
        match kind {
            "set" => sets.push((leak(name), Vec::new())),
            "run" => sets.last_mut()?.1.push((leak(name), Vec::new())),
            "file" => {
                let (name, bytes) = name.split_once(' ')?;
                let (text, after) = rest.split_at_checked(bytes.parse().ok()?)?;
                let files = &mut sets.last_mut()?.1.last_mut()?.1;
                files.push((leak(name), leak(text)));
                rest = after.strip_prefix('\n')?;
            }
            _ => return None,
        }
    }
    let run = |(name, files): (&'static str, Vec<_>)| -> Run { (name, files.leak()) };
    let set = |(name, runs): (&'static str, Vec<_>)| -> Set {
        (name, runs.into_iter().map(run).collect::<Vec<Run>>().leak())
    };
    Some(sets.into_iter().map(set).collect())
}

/// Encodes what the static page needs of the shipped runs: robots, and their audits.
#[cfg(feature = "gallery")]
pub(crate) fn exported() -> String {
    let is_needed = |file: &str| ["run.json", "audit.json"].contains(&file);
    let mut text = String::new();
    // Gaits have no task, so the page does not offer them.
    for (set, runs) in sets().iter().filter(|(set, _)| *set != GAITS) {
        text += &format!("set {set}\n");
        for (run, files) in *runs {
            text += &format!("run {run}\n");
            for (file, content) in files.iter().filter(|(file, _)| is_needed(file)) {
                text += &format!("file {file} {}\n{content}\n", content.len());
            }
        }
    }
    text
}

/// Provides the runs that [`exported`] encoded, for as long as the program runs, where none ship.
/// Later calls change nothing.
///
/// # Errors
/// Returns the reason if the text is something else.
#[cfg(feature = "serve")]
pub(crate) fn provide(text: &str) -> Result<(), String> {
    let sets = unpacked(text).ok_or("expected the runs of a gallery")?;
    // A build with runs of its own keeps those.
    if cfg!(not(feature = "gallery")) {
        SETS.get_or_init(|| sets);
    }
    Ok(())
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
    fn what_is_exported_is_read_as_it_was_and_something_else_is_refused() {
        let read = unpacked(&exported()).unwrap();
        let names = |sets: &[Set]| -> Vec<&str> { sets.iter().map(|(set, _)| *set).collect() };
        assert_eq!(
            names(&read),
            [ZERO_ONE, "gallery:four_digit", TEAM, GATES],
            "all but the gaits"
        );
        let (_, runs) = read[2];
        let (name, files) = runs[44];
        assert_eq!((runs.len(), name), (45, "gallery:team-8v9"));
        for (file, content) in files {
            assert_eq!(text(name, file), Some(*content), "{file}");
        }
        let long = "set a\nrun b\nfile c 99\nshort\n";
        for other in ["{}", "set", "run a\n", "set a\nfile b 1\nc\n", long] {
            assert!(unpacked(other).is_none(), "{other}");
        }
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
