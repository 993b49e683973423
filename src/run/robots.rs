//! Choosing robots of a run: all, the fittest, some at random, or by id.

use super::Error;
use super::archive::{Robot, RunFile};
use super::audit_file::{AUDIT_JSON, AuditFile};
use crate::base::random::{Purpose, stream};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Which robots of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selection {
    /// All of them, fittest first.
    All,
    /// The so many fittest.
    Top(usize),
    /// So many, drawn at random.
    Random(usize),
    /// The so many best of each task on validation images; only `eval` shows those.
    Validated(usize),
    /// Those with these ids, or unique beginnings of ids; "best" is the fittest.
    Ids(Vec<String>),
    /// So selected, but from those robots only that an audit found physical.
    Physical {
        /// The selection among them.
        of: Box<Selection>,
        /// The audit's file.
        audit: PathBuf,
    },
}

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
            Some(("best-validation", digits)) => count(digits).map(Selection::Validated),
            None if text == "best-validation" => Ok(Selection::Validated(1)),
            Some(_) => {
                Err("expected all, top:N, random:N, best-validation:N, or ids separated by commas"
                    .to_string())
            }
            None => Ok(Selection::Ids(text.split(',').map(|id| id.trim().to_string()).collect())),
        }
    }
}

impl Selection {
    /// The same among the robots only that the audit beside an archive found physical, if `only` says so.
    #[must_use]
    pub fn physical(self, only: bool, archive: &Path) -> Self {
        match only {
            true => Selection::Physical { of: Box::new(self), audit: archive.with_file_name(AUDIT_JSON) },
            false => self,
        }
    }

    /// How many of the selected are to be chosen by validation, if that is asked for.
    pub fn validated(&self) -> Option<usize> {
        match self {
            Selection::Validated(count) => Some(*count),
            Selection::Physical { of, .. } => of.validated(),
            _ => None,
        }
    }

    /// What it says, for people.
    pub fn describe(&self) -> String {
        match self {
            Selection::All => "all elites".to_string(),
            Selection::Top(count) => format!("the {count} fittest on the training images"),
            Selection::Random(count) => format!("{count} elites drawn at random"),
            Selection::Validated(count) => format!("the {count} best of each task on validation images"),
            Selection::Ids(ids) => format!("chosen by id: {}", ids.join(", ")),
            Selection::Physical { of, .. } => format!("{}, of those audited as physical", of.describe()),
        }
    }

    /// The robots, fittest first where no order is given; `seed` is for the random ones. For a validation: all that
    /// are to be looked at.
    ///
    /// # Errors
    /// If there is no robot, or no single one, of an id; if only physical ones are asked for, and they are not known.
    pub fn of<'a>(&self, run: &'a RunFile, seed: u64) -> Result<Vec<&'a Robot>, Error> {
        let mut fittest: Vec<&Robot> = run.elites.iter().collect();
        // Stable: equally fit ones stay in the order of their cells.
        fittest.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        if fittest.is_empty() {
            return Err(Error::input(format!("{}: the archive is empty", run.name)));
        }
        self.among(fittest, run, seed)
    }

    fn among<'a>(
        &self,
        fittest: Vec<&'a Robot>,
        run: &'a RunFile,
        seed: u64,
    ) -> Result<Vec<&'a Robot>, Error> {
        match self {
            Selection::All | Selection::Validated(_) => Ok(fittest),
            Selection::Top(count) => Ok(fittest.into_iter().take(*count).collect()),
            Selection::Random(count) => {
                let picked = stream(seed, Purpose::Robots, 0, 0).sample(fittest.len(), *count);
                Ok(picked.into_iter().map(|index| fittest[index]).collect())
            }
            Selection::Ids(ids) => ids.iter().map(|id| by_id(&fittest, id)).collect(),
            Selection::Physical { of, audit } => of.among(physical(of, audit, fittest, run)?, run, seed),
        }
    }
}

/// The physical ones, fittest first; those that are named must be among them.
fn physical<'a>(
    selection: &Selection,
    path: &Path,
    fittest: Vec<&'a Robot>,
    run: &RunFile,
) -> Result<Vec<&'a Robot>, Error> {
    let audit = AuditFile::of_run(run, path)?;
    let name = path.display();
    let hint = "morphcog audit goes on with the robots that are missing; give it the same --archive";
    let mut named = Vec::new();
    if let Selection::Ids(ids) = selection {
        for id in ids.iter().filter(|id| *id != "best") {
            named.push(by_id(&fittest, id)?);
        }
    }
    // Who names robots needs to know of those only; of a part of an archive nothing can be drawn fairly.
    let is_named = matches!(selection, Selection::Ids(ids) if ids.len() == named.len());
    for robot in if is_named { &named } else { &fittest } {
        if audit.robot(&robot.id).is_none() {
            let (known, all) = (audit.robots.len(), audit.elites);
            let text = format!("{name}: robot {} has not been audited ({known} of {all} have)", robot.id);
            return Err(Error::input(text).hint(hint.to_string()));
        }
    }
    if let Some(found) = named.iter().filter_map(|robot| audit.robot(&robot.id)).find(|r| !r.is_physical()) {
        let text = format!("{name}: robot {} is not physical: {}", found.id, found.conclusion());
        return Err(Error::input(text).hint("leave --physical-only away to take it all the same".to_string()));
    }
    let physical: Vec<&Robot> =
        fittest.into_iter().filter(|robot| audit.robot(&robot.id).is_some_and(|r| r.is_physical())).collect();
    if physical.is_empty() {
        return Err(Error::input(format!("{name}: none of {} robots is physical", audit.robots.len())));
    }
    Ok(physical)
}

/// The robot of an id, or of the unique beginning of one; "best" is the first.
fn by_id<'a>(robots: &[&'a Robot], id: &str) -> Result<&'a Robot, Error> {
    if id == "best" {
        return Ok(robots[0]);
    }
    let lower = id.to_ascii_lowercase();
    let found: Vec<&&Robot> =
        robots.iter().filter(|robot| !id.is_empty() && robot.id.starts_with(&lower)).collect();
    let list =
        |robots: &[&&Robot]| robots.iter().take(5).map(|r| r.id.as_str()).collect::<Vec<_>>().join(", ");
    match found.as_slice() {
        [robot] => Ok(robot),
        [] => {
            let some: Vec<&&Robot> = robots.iter().collect();
            let hint = format!("there are {} robots, the fittest are {}", robots.len(), list(&some));
            Err(Error::input(format!("there is no robot {id}")).hint(hint))
        }
        several => {
            let text = format!("{} robots have ids that begin with {id}: {}", several.len(), list(several));
            Err(Error::input(text).hint("give more digits".to_string()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::samples;

    fn run() -> RunFile {
        samples::run(&[("aa10", 1.0), ("ab20", 3.0), ("b300", 2.0), ("b3ff", 3.0), ("c400", -1.0)])
    }

    fn selected(text: &str, seed: u64) -> Result<Vec<String>, Error> {
        let run = run();
        let robots = Selection::from_str(text).unwrap().of(&run, seed)?;
        Ok(robots.into_iter().map(|robot| robot.id.clone()).collect())
    }

    #[test]
    fn all_and_top_are_the_fittest_first_and_equally_fit_ones_in_the_order_of_their_cells() {
        assert_eq!(selected("all", 1).unwrap(), ["ab20", "b3ff", "b300", "aa10", "c400"]);
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
        assert_eq!(selected("c, aa,best,B3F", 1).unwrap(), ["c400", "aa10", "ab20", "b3ff"]);
        let error = selected("aa,b3", 1).unwrap_err();
        assert!(error.message.contains("2 robots") && error.message.contains("b3ff, b300"), "{error}");
        assert!(error.hint.is_some());
        for none in ["d", "aa100", "aa,,c", "aa 10"] {
            let error = selected(none, 1).unwrap_err();
            assert!(error.message.contains("no robot"), "{error}");
            assert!(error.hint.is_some_and(|hint| hint.contains("ab20")), "the fittest are offered");
        }
    }

    #[test]
    fn words_that_select_nothing_are_refused() {
        for wrong in ["top:0", "top:", "top:-1", "random:x", "random:0", "worst:3", "top:1:2"] {
            assert!(Selection::from_str(wrong).is_err(), "{wrong}");
        }
        let empty = samples::run(&[]);
        assert!(Selection::All.of(&empty, 1).unwrap_err().message.contains("empty"));
    }
}
