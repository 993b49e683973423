//! Options that choose archives or robots: commands share their rules and their help.

use crate::base::error::Error;
use crate::base::session::Session;
use crate::base::stop::NEVER;
use crate::base::text::counted;
use crate::cli::output::console::Console;
use crate::cli::output::reporters::Reporter;
use crate::cli::{Resources, in_session};
use crate::robots;
use crate::robots::selection::Selection;
use crate::search::one_by_one;
use crate::search::one_by_one::Named;
use crate::shipped;
use crate::store::folder;
use crate::store::run::RunFile;
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Archives, for a command that takes several.
#[derive(Debug, Args)]
pub(super) struct Archives {
    /// A run.json, or its folder, or runs of the gallery or atlas (gallery:zero_one,
    /// atlas:zero_one); several may follow, and the option may be repeated (default: the newest
    /// under runs/).
    #[arg(short, long, value_name = "FILE", value_parser = run_jsons(), num_args = 1..)]
    archive: Vec<Runs>,
}

impl Archives {
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        self.archive
            .iter()
            .flat_map(|Runs(paths)| paths)
            .cloned()
            .collect()
    }
}

/// Value of an option: a run.json, or those of a set of shipped runs.
#[derive(Clone, Debug)]
pub(super) struct Runs(pub(super) Vec<PathBuf>);

/// Help for options that choose robots.
pub(super) const ROBOTS: &str = "Which robots: all, top:N or random:N (of each task; of several archives together), \
best-validation:N (the best of each run and task on validation images), or, separated by commas, ids or \
beginnings of ids and best (first on validation images if the run ranked robots by them, else the fittest); \
without --archive also gallery, or names of published robots";

/// Merges the given selections into one; only ids and names may be given several times.
pub(super) fn selected(mut given: Vec<Selection>) -> Result<Option<Selection>, Error> {
    if given.len() < 2 {
        return Ok(given.pop());
    }
    let mut ids = Vec::new();
    for selection in given {
        match selection {
            Selection::Ids(some) => ids.extend(some),
            _ => {
                let text = "--robots: expected one selection; only ids and names can be given several times";
                return Err(Error::usage(text.to_string()));
            }
        }
    }
    Ok(Some(Selection::Ids(ids)))
}

/// Returns the robots of a selection, for a command that handles them one by one.
pub(super) fn one_by_one(
    search: &one_by_one::RobotChoice,
    data: Option<PathBuf>,
    console: &Console,
) -> Result<Vec<Named>, Error> {
    // Resolved once: what is warned of is what is searched.
    let (archives, robots) = robots::archives(search.archives.clone(), search.robots.clone())?;
    say_simulated(&archives, console);
    let search = &one_by_one::RobotChoice {
        archives,
        robots,
        ..search.clone()
    };
    // Only a search on validation images stops in an orderly way; signals end all else at once.
    match search.robots.validated() {
        Some(_) => in_session(console, Resources::of(None, data), |session| {
            one_by_one::named(search, session)
        }),
        None => one_by_one::named(
            search,
            &Session::new(&NEVER, &Reporter::new(console)).data(data),
        ),
    }
}

/// Prints the messages of [`say_unfinished`] and [`warn_of_versions`], for commands that simulate
/// robots of these archives again.
pub(super) fn say_simulated<'a>(
    archives: impl IntoIterator<Item = &'a PathBuf> + Clone,
    console: &Console,
) {
    say_unfinished(archives.clone(), console);
    warn_of_versions(archives, console);
}

/// Warns of archives that another version of the program made: their robots may walk differently
/// here. Named runs came with this version, whose tests simulate them.
pub(super) fn warn_of_versions<'a>(
    archives: impl IntoIterator<Item = &'a PathBuf>,
    console: &Console,
) {
    let of_others: Vec<(PathBuf, String)> = unnamed_or_newest(archives)
        .filter_map(|path| RunFile::other_version(&path).map(|version| (path, version)))
        .collect();
    let Some(((path, _), others)) = of_others.split_first() else {
        return;
    };
    let more = match others.len() {
        0 => String::new(),
        more => format!(" and {}", counted(more, "other run", "other runs")),
    };
    let versions: BTreeSet<&str> = of_others
        .iter()
        .map(|(_, version)| version.as_str())
        .collect();
    console.warning(&format!(
        "{}{more}: made by morphcog {}; this is {}, whose numbers may be others",
        path.display(),
        versions.into_iter().collect::<Vec<_>>().join(" and "),
        env!("CARGO_PKG_VERSION")
    ));
}

/// Returns the paths of these archives, or of the newest run if there are none; omits named ones.
fn unnamed_or_newest<'a>(
    archives: impl IntoIterator<Item = &'a PathBuf>,
) -> impl Iterator<Item = PathBuf> {
    let mut archives: Vec<PathBuf> = archives.into_iter().cloned().collect();
    if archives.is_empty() {
        archives.extend(folder::newest_run());
    }
    archives.into_iter().filter(|path| !shipped::is_named(path))
}

/// Reports archives whose runs have not ended, since a command reads the robots they have so far.
/// Without archives, it checks the newest run.
pub(super) fn say_unfinished<'a>(
    archives: impl IntoIterator<Item = &'a PathBuf>,
    console: &Console,
) {
    // Named runs do not go on.
    for path in unnamed_or_newest(archives) {
        if let Some((done, asked)) = RunFile::progress(&path).filter(|(done, asked)| done < asked) {
            console.info(&format!(
                "{}: generation {done} of {asked}: the run is not at its end",
                path.display()
            ));
        }
    }
}

/// Parses the path of a run.json, or of its folder, or the name of one shipped run.
pub(super) fn run_json() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(folder::one_run)
}

/// Parses the path of a run.json, or of its folder, or the name of shipped runs.
pub(super) fn run_jsons() -> impl TypedValueParser<Value = Runs> {
    PathBufValueParser::new().try_map(|path| folder::run_json(path).map(Runs))
}
