//! Choosing robots of one or several runs: all, the fittest, some at random, or by id.

use crate::base::error::Error;
use crate::base::random::{Purpose, stream};
use crate::base::remedy::{Invocation, Remedy};
use crate::base::text::counted;
use crate::store::audit::AuditFile;
use crate::store::folder;
use crate::store::run::Robot;
use crate::store::stored_run::StoredRun;
use crate::store::validation::{Validated, ranking};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

pub(crate) const BEST: &str = "best";

#[derive(Clone, Copy, Debug)]
pub(crate) struct Chosen<'a> {
    pub(crate) source: usize,
    pub(crate) robot: &'a Robot,
}

/// A selection of robots from one run, or from several together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selection {
    /// All, fittest first.
    All,
    /// This many of each task, the fittest.
    Top(usize),
    /// This many of each task, drawn at random.
    Random(usize),
    /// This many of each run and task, the best on validation images.
    Validated(usize),
    /// By id, or the unique beginning of one. "best" is the best on validation images if all runs
    /// have rankings (validation.json), else the fittest.
    Ids(Vec<String>),
    /// By run index and id, with a description of the choice.
    Drawn {
        /// Run index and id of each robot.
        robots: Vec<(usize, String)>,
        /// Description for the user.
        about: String,
    },
    /// Like the inner selection, but only from robots that an audit found physical.
    Physical(Box<Selection>),
}

/// Word that selects the best robots on validation images.
pub(crate) const VALIDATED: &str = "best-validation";

const EXPECTED: &str = "expected all, top:N, random:N, best-validation:N, or, separated by commas, ids or their \
 beginnings, best, \
names of published robots or gallery";

impl FromStr for Selection {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let count = |digits: &str| {
            let count = digits.parse().ok().filter(|&count| count > 0);
            count.ok_or_else(|| format!("{text}: expected a number from 1 after the colon"))
        };
        match text.split_once(':') {
            None if text == "all" => Ok(Selection::All),
            Some(("top", digits)) => count(digits).map(Selection::Top),
            Some(("random", digits)) => count(digits).map(Selection::Random),
            Some((VALIDATED, digits)) => count(digits).map(Selection::Validated),
            None if text == VALIDATED => Ok(Selection::Validated(1)),
            Some(_) => Err(EXPECTED.to_string()),
            None => Ok(Selection::Ids(
                text.split(',').map(|id| id.trim().to_string()).collect(),
            )),
        }
    }
}

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Selection::All => f.write_str("all"),
            Selection::Top(count) => write!(f, "top:{count}"),
            Selection::Random(count) => write!(f, "random:{count}"),
            Selection::Validated(count) => write!(f, "{VALIDATED}:{count}"),
            Selection::Ids(ids) => f.write_str(&ids.join(",")),
            Selection::Drawn { about, .. } => f.write_str(about),
            Selection::Physical(inner) => write!(f, "{inner}, physical only"),
        }
    }
}

impl Selection {
    /// Restricts the selection to robots that audits found physical, if `only` is true.
    #[must_use]
    pub(crate) fn physical(self, only: bool) -> Self {
        if only {
            Selection::Physical(Box::new(self))
        } else {
            self
        }
    }

    /// Returns the number of robots to choose by validation; `None` for other selections.
    pub fn validated(&self) -> Option<usize> {
        match self {
            Selection::Validated(count) => Some(*count),
            Selection::Physical(of) => of.validated(),
            _ => None,
        }
    }

    pub(crate) fn describe(&self) -> String {
        match self {
            Selection::All => "all elites".to_string(),
            Selection::Top(1) => "the fittest of each task on the training images".to_string(),
            Selection::Top(count) => {
                format!("the {count} fittest of each task on the training images")
            }
            Selection::Random(count) => {
                format!(
                    "{} of each task, drawn at random",
                    counted(*count, "elite", "elites")
                )
            }
            Selection::Validated(1) => {
                "the best of each run and task on validation images".to_string()
            }
            Selection::Validated(count) => {
                format!("the {count} best of each run and task on validation images")
            }
            Selection::Drawn { about, .. } => about.clone(),
            Selection::Ids(ids) => format!("chosen by id: {}", ids.join(", ")),
            Selection::Physical(of) => format!("{}, of those audited as physical", of.describe()),
        }
    }

    /// Returns the robots, by default task by task and fittest first; for a validation, all
    /// candidates. `seed` draws the random ones. Physical ones need complete audits.
    pub(crate) fn of<'a>(
        &self,
        sources: &'a [StoredRun],
        seed: u64,
    ) -> Result<Vec<Chosen<'a>>, Error> {
        let robots = |(source, from): (usize, &'a StoredRun)| {
            from.run
                .elites
                .iter()
                .map(move |robot| Chosen { source, robot })
        };
        let mut fittest: Vec<Chosen> = sources.iter().enumerate().flat_map(robots).collect();
        // The sort is stable: ties keep the order of their runs and cells.
        fittest.sort_by(|a, b| b.robot.objective.total_cmp(&a.robot.objective));
        if fittest.is_empty() {
            let names: Vec<String> = sources
                .iter()
                .map(|source| source.path.display().to_string())
                .collect();
            return Err(Error::input(format!(
                "{}: the archive is empty",
                names.join(", ")
            )));
        }
        self.among(fittest, sources, seed)
    }

    /// Splits the selection into one by ids for each run; `None` for a run without a selected
    /// robot. A validation selects run by run already.
    pub(crate) fn of_each(
        &self,
        sources: &[StoredRun],
        seed: u64,
    ) -> Result<Vec<Option<Selection>>, Error> {
        if sources.len() < 2 || self.validated().is_some() {
            return Ok(vec![Some(self.clone()); sources.len()]);
        }
        let mut ids = vec![Vec::new(); sources.len()];
        for chosen in self.of(sources, seed)? {
            ids[chosen.source].push(chosen.robot.id.clone());
        }
        Ok(ids
            .into_iter()
            .map(|ids| (!ids.is_empty()).then_some(Selection::Ids(ids)))
            .collect())
    }

    fn among<'a>(
        &self,
        fittest: Vec<Chosen<'a>>,
        sources: &'a [StoredRun],
        seed: u64,
    ) -> Result<Vec<Chosen<'a>>, Error> {
        let by_task = || {
            let mut tasks: Vec<&String> = Vec::new();
            for task in sources
                .iter()
                .flat_map(|source| &source.run.dimensions.tasks)
            {
                if !tasks.contains(&task) {
                    tasks.push(task);
                }
            }
            let of = |task: &String| {
                fittest
                    .iter()
                    .filter(|c| c.robot.task == *task)
                    .copied()
                    .collect()
            };
            tasks.into_iter().map(of).collect::<Vec<Vec<Chosen>>>()
        };
        match self {
            Selection::All | Selection::Validated(_) => Ok(fittest),
            Selection::Top(count) => Ok(by_task()
                .into_iter()
                .flat_map(|of_task| of_task.into_iter().take(*count))
                .collect()),
            Selection::Random(count) => {
                let draw = |(number, of_task): (u64, Vec<Chosen<'a>>)| {
                    let picked =
                        stream(seed, Purpose::Robots, 0, number).sample(of_task.len(), *count);
                    picked
                        .into_iter()
                        .map(|index| of_task[index])
                        .collect::<Vec<_>>()
                };
                Ok((0..).zip(by_task()).flat_map(draw).collect())
            }
            Selection::Ids(ids) => {
                // A robot named twice counts once.
                let named = ids.iter().map(|id| match id == BEST {
                    true => Ok(best(&fittest, sources)?.into_iter().collect()),
                    false => by_id(&fittest, id),
                });
                let named: Result<Vec<_>, Error> = named.collect();
                let mut once: Vec<Chosen> = Vec::new();
                for chosen in named?.into_iter().flatten() {
                    if !once
                        .iter()
                        .any(|other| std::ptr::eq(other.robot, chosen.robot))
                    {
                        once.push(chosen);
                    }
                }
                Ok(once)
            }
            Selection::Drawn { robots, .. } => {
                let of_run =
                    |source: usize| fittest.iter().filter(move |c| c.source == source).copied();
                let find = |(source, id): &(usize, String)| {
                    by_id(&of_run(*source).collect::<Vec<_>>(), id)
                };
                let found: Result<Vec<_>, Error> = robots.iter().map(find).collect();
                Ok(found?.into_iter().flatten().collect())
            }
            // Rankings need audits only down to the last chosen; `first_physical` checks.
            Selection::Physical(of)
                if of.validated().is_some() && !all_audited(&fittest, sources)? =>
            {
                Ok(fittest)
            }
            Selection::Physical(of) => of.among(physical(of, fittest, sources)?, sources, seed),
        }
    }
}

/// Returns the best of robots given fittest first: the best on validation images if all runs have
/// rankings and any of these is in one, else the fittest.
fn best<'a>(fittest: &[Chosen<'a>], sources: &'a [StoredRun]) -> Result<Option<Chosen<'a>>, Error> {
    let rankings: Result<Vec<Option<Vec<Validated>>>, Error> =
        sources.iter().map(ranking).collect();
    let rankings: Option<Vec<Vec<Validated>>> = rankings?.into_iter().collect();
    let mut first: Option<(Chosen, f64)> = None;
    for (source, ranked) in rankings.iter().flatten().enumerate() {
        for Validated {
            id,
            task,
            balanced_accuracy,
            ..
        } in ranked
        {
            let is_it =
                |c: &&Chosen| c.source == source && c.robot.id == *id && c.robot.task == *task;
            // On a tie the earlier one stays, which was fitter.
            if first.is_none_or(|(_, accuracy)| *balanced_accuracy > accuracy)
                && let Some(chosen) = fittest.iter().find(is_it)
            {
                first = Some((*chosen, *balanced_accuracy));
            }
        }
    }
    Ok(first.map(|(chosen, _)| chosen).or(fittest.first().copied()))
}

/// Finds a robot by id or its unique beginning; in every run that has it, as after a common start.
pub(crate) fn by_id<'a>(robots: &[Chosen<'a>], id: &str) -> Result<Vec<Chosen<'a>>, Error> {
    let lower = id.to_ascii_lowercase();
    let found: Vec<Chosen> = robots
        .iter()
        .filter(|chosen| !id.is_empty() && chosen.robot.id.to_ascii_lowercase().starts_with(&lower))
        .copied()
        .collect();
    let list = |some: &[Chosen]| {
        some.iter()
            .take(5)
            .map(|c| c.robot.id.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    match found.as_slice() {
        [first, others @ ..] if others.iter().all(|other| other.robot.id == first.robot.id) => {
            Ok(found)
        }
        [] => {
            let there = counted(
                robots.len(),
                "robot; the fittest is",
                "robots; the fittest are",
            );
            let advice = format!("the archive has {there} {}", list(robots));
            Err(Error::input(format!("there is no robot {id}")).advice(advice))
        }
        several => {
            let text = format!(
                "{} robots have ids that begin with {id}: {}",
                several.len(),
                list(several)
            );
            Err(Error::input(text).advice("give more digits"))
        }
    }
}

fn path(source: &StoredRun) -> PathBuf {
    AuditFile::path(&source.path)
}

fn audits(sources: &[StoredRun]) -> Result<Vec<AuditFile>, Error> {
    sources
        .iter()
        .map(|source| AuditFile::of_run(&source.run, &source.path))
        .collect()
}

/// True if all these robots have verdicts.
pub(crate) fn all_audited(robots: &[Chosen], sources: &[StoredRun]) -> Result<bool, Error> {
    let audits = audits(sources)?;
    Ok(robots
        .iter()
        .all(|chosen| audits[chosen.source].robot(&chosen.robot.id).is_some()))
}

/// Returns the physical ones, fittest first; an error if a named one is not.
pub(crate) fn physical<'a>(
    selection: &Selection,
    fittest: Vec<Chosen<'a>>,
    sources: &'a [StoredRun],
) -> Result<Vec<Chosen<'a>>, Error> {
    let audits = audits(sources)?;
    let name = |chosen: &Chosen| path(&sources[chosen.source]).display().to_string();
    let found = |chosen: &Chosen| audits[chosen.source].robot(&chosen.robot.id);
    let mut named = Vec::new();
    if let Selection::Ids(ids) = selection {
        for id in ids.iter().filter(|id| *id != BEST) {
            named.extend(by_id(&fittest, id)?);
        }
    }
    // Named robots need only their own verdicts; other selections would be unfair without all.
    let is_named = matches!(selection, Selection::Ids(ids) if !ids.iter().any(|id| id == BEST));
    for chosen in if is_named { &named } else { &fittest } {
        if found(chosen).is_none() {
            let audit = &audits[chosen.source];
            let (name, known, all) = (name(chosen), audit.robots.len(), audit.elites);
            let id = &chosen.robot.id;
            let text = format!("{name}: robot {id} has not been audited ({known} of {all} have)");
            let archive = folder::archive(&sources[chosen.source].path);
            let audit = Invocation::new("audit").option("archive", archive);
            let remedy = Remedy::Run(audit, "goes on with the robots that are missing");
            return Err(Error::input(text).remedy(remedy));
        }
    }
    for chosen in &named {
        if let Some(found) = found(chosen).filter(|found| !found.is_physical()) {
            let text = format!(
                "{}: robot {} is not physical: {}",
                name(chosen),
                found.id,
                found.conclusion()
            );
            return Err(Error::input(text).remedy(Remedy::TakeUnphysical));
        }
    }
    let physical: Vec<Chosen> = fittest
        .iter()
        .filter(|chosen| found(chosen).is_some_and(|r| r.is_physical()))
        .copied()
        .collect();
    if physical.is_empty() {
        let names: Vec<String> = sources
            .iter()
            .map(|source| path(source).display().to_string())
            .collect();
        return Err(Error::input(format!(
            "{}: none of {} is physical",
            names.join(", "),
            counted(fittest.len(), "robot", "robots")
        )));
    }
    Ok(physical)
}

/// Returns the first `count` physical robots of each task, given best on validation images first.
/// Robots ranked after those need no audit.
pub(crate) fn first_physical<'a>(
    ranked: Vec<(&'a Robot, Validated)>,
    source: &StoredRun,
    count: usize,
) -> Result<Vec<(&'a Robot, Validated)>, Error> {
    let path = path(source);
    let audit = AuditFile::of_run(&source.run, &source.path)?;
    let name = path.display();
    let audit_again = || Invocation::new("audit").option("archive", folder::archive(&source.path));
    let mut chosen = Vec::new();
    for task in &source.run.dimensions.tasks {
        let of_task: Vec<_> = ranked
            .iter()
            .filter(|(robot, _)| robot.task == *task)
            .collect();
        let mut physical = 0;
        for (place, (robot, validated)) in of_task.iter().enumerate() {
            if physical == count {
                break;
            }
            let Some(found) = audit.robot(&robot.id) else {
                let (id, place) = (&robot.id, place + 1);
                let text = format!(
                    "{name}: robot {id}, number {place} of {task} on validation images, has not been audited"
                );
                let audit = audit_again().option("robots", format!("best-validation:{place}"));
                return Err(Error::input(text).remedy(Remedy::Run(audit, "audits them")));
            };
            if found.is_physical() {
                physical += 1;
                chosen.push((*robot, validated.clone()));
            }
        }
        if physical == 0 && !of_task.is_empty() {
            let best = counted(of_task.len(), "robot", "robots");
            let text = format!(
                "{name}: of {best} that validation images chose for {task}, none is physical"
            );
            return Err(Error::input(text)
                .remedy(Remedy::Run(audit_again(), "makes all its robots eligible")));
        }
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::samples;

    fn source(robots: &[(&str, f64)]) -> StoredRun {
        StoredRun {
            path: PathBuf::from("run.json"),
            run: samples::run(robots),
        }
    }

    fn of(text: &str, seed: u64, sources: &[StoredRun]) -> Result<Vec<String>, Error> {
        let robots = Selection::from_str(text).unwrap().of(sources, seed)?;
        Ok(robots
            .into_iter()
            .map(|chosen| chosen.robot.id.clone())
            .collect())
    }

    fn selected(text: &str, seed: u64) -> Result<Vec<String>, Error> {
        let run = source(&[
            ("aa10", 1.0),
            ("ab20", 3.0),
            ("b300", 2.0),
            ("b3ff", 3.0),
            ("c400", -1.0),
        ]);
        of(text, seed, &[run])
    }

    #[test]
    fn a_robot_that_is_named_twice_is_one() {
        assert_eq!(selected("aa,b300,aa10", 1).unwrap(), ["aa10", "b300"]);
    }

    #[test]
    fn a_robot_that_several_runs_have_is_taken_of_each() {
        let runs = [
            source(&[("aa10", 1.0), ("ab20", 3.0)]),
            source(&[("ab20", 2.0), ("b3ff", 4.0)]),
        ];
        assert_eq!(of("ab20,best", 1, &runs).unwrap(), ["ab20", "ab20", "b3ff"]);
        let chosen = Selection::Ids(vec!["ab".to_string()]).of(&runs, 1).unwrap();
        assert_eq!(chosen.iter().map(|c| c.source).collect::<Vec<_>>(), [0, 1]);
        assert!(of("a", 1, &runs).unwrap_err().message.contains("3 robots"));
    }

    #[test]
    fn several_runs_are_one_crowd() {
        let runs = [
            source(&[("aa10", 1.0), ("ab20", 3.0)]),
            source(&[("b300", 2.0), ("b3ff", 4.0)]),
        ];
        assert_eq!(of("top:3", 1, &runs).unwrap(), ["b3ff", "ab20", "b300"]);
        assert_eq!(of("ab,b30", 1, &runs).unwrap(), ["ab20", "b300"]);
        assert_eq!(of("random:9", 1, &runs).unwrap().len(), 4);
        let chosen = Selection::All.of(&runs, 1).unwrap();
        assert_eq!(
            chosen.iter().map(|c| c.source).collect::<Vec<_>>(),
            [1, 0, 1, 0]
        );
    }

    #[test]
    fn robots_of_several_runs_are_named_run_by_run_and_a_wrong_name_is_known_before_the_first() {
        let runs = [
            source(&[("aa10", 1.0), ("ab20", 3.0)]),
            source(&[("b300", 2.0), ("b3ff", 4.0)]),
        ];
        let each =
            |text: &str, runs: &[StoredRun]| Selection::from_str(text).unwrap().of_each(runs, 1);
        let ids = |ids: &[&str]| {
            Some(Selection::Ids(
                ids.iter().map(ToString::to_string).collect(),
            ))
        };
        assert_eq!(
            each("b3f,aa", &runs).unwrap(),
            [ids(&["aa10"]), ids(&["b3ff"])]
        );
        assert_eq!(each("top:1", &runs).unwrap(), [None, ids(&["b3ff"])]);
        assert!(
            each("aa,c", &runs)
                .unwrap_err()
                .message
                .contains("no robot c")
        );
        let validated = Selection::Validated(3);
        assert_eq!(
            validated.of_each(&runs, 1).unwrap(),
            [Some(validated.clone()), Some(validated.clone())]
        );
        assert_eq!(each("aa", &runs[..1]).unwrap(), [ids(&["aa"])]);
    }

    #[test]
    fn so_many_are_so_many_of_each_task() {
        let mut run = source(&[
            ("aa10", 1.0),
            ("ab20", 3.0),
            ("b300", 2.0),
            ("b3ff", 4.0),
            ("c400", 5.0),
        ]);
        run.run.dimensions.tasks = vec!["0|1".to_string(), "1|0".to_string()];
        for place in [1, 3] {
            run.run.elites[place].task = "1|0".to_string();
        }
        let runs = [run];
        assert_eq!(
            of("top:2", 1, &runs).unwrap(),
            ["c400", "b300", "b3ff", "ab20"]
        );
        assert_eq!(of("random:2", 1, &runs).unwrap().len(), 4);
    }

    #[test]
    fn all_and_top_are_the_fittest_first_and_equally_fit_ones_in_the_order_of_their_cells() {
        assert_eq!(
            selected("all", 1).unwrap(),
            ["ab20", "b3ff", "b300", "aa10", "c400"]
        );
        assert_eq!(selected("top:2", 1).unwrap(), ["ab20", "b3ff"]);
        assert_eq!(selected("top:99", 1).unwrap().len(), 5);
    }

    #[test]
    fn random_ones_are_different_robots_fixed_by_the_seed() {
        let drawn = selected("random:3", 7).unwrap();
        assert_eq!(selected("random:3", 7).unwrap(), drawn);
        assert!((0..20).any(|seed| selected("random:3", seed).unwrap() != drawn));
        for seed in 0..20 {
            let mut all = selected("random:9", seed).unwrap();
            all.sort();
            assert_eq!(all, ["aa10", "ab20", "b300", "b3ff", "c400"]);
        }
    }

    #[test]
    fn ids_are_found_by_unique_beginnings_in_the_order_given() {
        assert_eq!(
            selected("c, aa,best,B3F", 1).unwrap(),
            ["c400", "aa10", "ab20", "b3ff"]
        );
        let error = selected("aa,b3", 1).unwrap_err();
        assert!(
            error.message.contains("2 robots") && error.message.contains("b3ff, b300"),
            "{error}"
        );
        assert!(!error.remedies.is_empty());
        for none in ["d", "aa100", "aa,,c", "aa 10"] {
            let error = selected(none, 1).unwrap_err();
            assert!(error.message.contains("no robot"), "{error}");
            assert!(
                matches!(&error.remedies[..], [Remedy::Advice(text)] if text.contains("ab20")),
                "the fittest are offered"
            );
        }
    }

    #[test]
    fn words_that_select_nothing_are_refused() {
        for wrong in [
            "top:0", "top:", "top:-1", "random:x", "random:0", "worst:3", "top:1:2",
        ] {
            assert!(Selection::from_str(wrong).is_err(), "{wrong}");
        }
        let empty = [source(&[])];
        assert!(
            Selection::All
                .of(&empty, 1)
                .unwrap_err()
                .message
                .contains("empty")
        );
    }

    #[test]
    fn an_empty_archive_is_told_with_its_file() {
        let source = StoredRun {
            path: "runs/a/run.json".into(),
            run: samples::run(&[]),
        };
        let error = Selection::All.of(&[source], 1).unwrap_err();
        assert!(error.message.starts_with("runs/a/run.json: "), "{error}");
    }
}
