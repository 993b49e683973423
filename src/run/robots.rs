//! Choosing robots of a run: all, the fittest, some at random, or by id.

use super::Error;
use super::archive::{Robot, RunFile};
use crate::base::random::{Purpose, stream};
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
    /// Those with these ids, or unique beginnings of ids; "best" is the fittest.
    Ids(Vec<String>),
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
            Some(_) => Err("expected all, top:N, random:N, or ids separated by commas".to_string()),
            None => Ok(Selection::Ids(text.split(',').map(|id| id.trim().to_string()).collect())),
        }
    }
}

impl Selection {
    /// What it says, for people.
    pub fn describe(&self) -> String {
        match self {
            Selection::All => "all elites".to_string(),
            Selection::Top(count) => format!("the {count} fittest on the training images"),
            Selection::Random(count) => format!("{count} elites drawn at random"),
            Selection::Ids(ids) => format!("chosen by id: {}", ids.join(", ")),
        }
    }

    /// The robots, fittest first where no order is given; `seed` is for the random ones.
    ///
    /// # Errors
    /// If there is no robot, or no single one, of an id.
    pub fn of<'a>(&self, run: &'a RunFile, seed: u64) -> Result<Vec<&'a Robot>, Error> {
        let mut fittest: Vec<&Robot> = run.elites.iter().collect();
        // Stable: equally fit ones stay in the order of their cells.
        fittest.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        if fittest.is_empty() {
            return Err(Error::input(format!("{}: the archive is empty", run.name)));
        }
        match self {
            Selection::All => Ok(fittest),
            Selection::Top(count) => Ok(fittest.into_iter().take(*count).collect()),
            Selection::Random(count) => {
                let picked = stream(seed, Purpose::Robots, 0, 0).sample(fittest.len(), *count);
                Ok(picked.into_iter().map(|index| fittest[index]).collect())
            }
            Selection::Ids(ids) => ids.iter().map(|id| by_id(&fittest, id)).collect(),
        }
    }
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
