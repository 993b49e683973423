//! `morphcog plot`: reads what figures are made of.

use crate::base::error::Error;
use crate::base::files::read_text;
use crate::config::{Settings, differing};
use crate::store::names::METRICS;
use crate::store::run::RunFile;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;

/// A line of `metrics.csv`, as far as figures show it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Moment {
    /// Offspring made so far.
    pub evaluations: f64,
    /// Elites per possible cell.
    pub coverage: f64,
    /// Sum of the objectives, each less the offset.
    pub qd_score: f64,
    /// Largest objective; none without elites.
    pub obj_max: Option<f64>,
    /// Wall-clock time so far \[s\].
    #[serde(default)]
    pub seconds: f64,
}

/// How a run came along.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Name of the run.
    pub run: String,
    /// Its seed.
    pub seed: u64,
    /// What its fitness is measured in.
    pub unit: Option<&'static str>,
    /// A moment per generation, at least one.
    pub moments: Vec<Moment>,
    /// All that its results depend on but the seed.
    pub settings: Settings,
}

/// Runs that differ in nothing but the seed, and so belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Group<'a> {
    /// What tells it from the others, as "parents=10, 0|1".
    pub label: String,
    /// Its value of each key in which groups differ; none where it has no such key.
    pub values: Vec<Option<String>>,
    /// Its runs.
    pub runs: Vec<&'a Progress>,
}

/// Runs in groups, in the order of their first ones, and the keys in which these differ.
pub fn alike(runs: &[Progress]) -> (Vec<String>, Vec<Group<'_>>) {
    let mut groups: Vec<Vec<&Progress>> = Vec::new();
    for run in runs {
        match groups.iter_mut().find(|group| group[0].settings == run.settings) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    let from_first = |group: &Vec<&Progress>| differing(&groups[0][0].settings, &group[0].settings);
    let keys: BTreeSet<String> = groups.iter().flat_map(from_first).map(|(key, ..)| key).collect();
    let value = |run: &Progress, key: &String| run.settings.get(key).map(spoken);
    let group = |runs: &Vec<&'_ Progress>| -> (String, Vec<Option<String>>) {
        let values: Vec<Option<String>> = keys.iter().map(|key| value(runs[0], key)).collect();
        let word = |(key, value): (&String, &Option<String>)| match (key.as_str(), value) {
            ("task.groups", Some(value)) => Some(value.clone()),
            (_, None) => None,
            (key, Some(value)) => Some(format!("{}={value}", key.rsplit('.').next().unwrap_or(key))),
        };
        let words: Vec<String> = keys.iter().zip(&values).filter_map(word).collect();
        // Two configs with the same settings may have two names, and are one group all the same.
        (if words.is_empty() { runs[0].run.clone() } else { words.join(", ") }, values)
    };
    let described: Vec<(String, Vec<Option<String>>)> = groups.iter().map(group).collect();
    let keys = keys.into_iter().collect();
    let group = |((label, values), runs)| Group { label, values, runs };
    (keys, described.into_iter().zip(groups).map(group).collect())
}

/// A value of a config for people: groups of classes as 0|1.
fn spoken(value: &toml::Value) -> String {
    let digits = |list: &toml::Value| -> Option<String> {
        list.as_array()?.iter().map(|item| item.as_integer().map(|digit| digit.to_string())).collect()
    };
    let groups = || -> Option<String> {
        let [a, b] = value.as_array()?.as_slice() else { return None };
        Some(format!("{}|{}", digits(a)?, digits(b)?))
    };
    groups().unwrap_or_else(|| value.as_str().map_or_else(|| value.to_string(), str::to_string))
}

impl Progress {
    /// Reads the metrics.csv beside a run.json.
    ///
    /// # Errors
    /// What is missing or wrong, with its line.
    pub fn of(run: &RunFile, archive: &Path) -> Result<Self, Error> {
        let moments = moments_of(archive)?;
        let unit = run.fitness().unit();
        let mut settings = run.config.settings();
        settings.remove("seed");
        Ok(Progress { run: run.name.clone(), seed: run.config.seed, unit, moments, settings })
    }
}

/// The lines of the metrics.csv beside a run.json.
///
/// # Errors
/// What is missing or wrong, with its line.
pub(crate) fn moments_of(archive: &Path) -> Result<Vec<Moment>, Error> {
    let path = archive.with_file_name(METRICS);
    let text = read_text(&path).map_err(|error| Error::reading(&path, &error))?;
    // A run under way may be writing the last line.
    let whole = text.rfind('\n').map_or(text.as_str(), |end| &text[..=end]);
    moments(whole).map_err(|error| error.within(&path.display().to_string()))
}

fn moments(text: &str) -> Result<Vec<Moment>, Error> {
    let hint = || "morphcog evolve writes this file beside run.json".to_string();
    let mut moments = Vec::new();
    for line in csv::Reader::from_reader(text.as_bytes()).deserialize() {
        let moment: Moment = line.map_err(|error| Error::input(error.to_string()).hint(hint()))?;
        moments.push(moment);
    }
    match moments.is_empty() {
        true => Err(Error::input("expected a line per generation, found none".to_string()).hint(hint())),
        false => Ok(moments),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_are_read_by_the_names_of_their_columns() {
        let text = "generation,coverage,qd_score,obj_max,evaluations\n0,0.1,2,,20\n1,0.2,3,1.5,40\n";
        let moments = moments(text).unwrap();
        assert_eq!((moments[0].obj_max, moments[1].obj_max), (None, Some(1.5)));
        assert_eq!((moments[1].evaluations, moments[1].coverage, moments[1].qd_score), (40.0, 0.2, 3.0));
    }

    fn run(seed: u64, config: &str) -> Progress {
        let set = |config: &str| toml::from_str::<Settings>(config).unwrap();
        Progress { run: "toy".into(), seed, unit: None, moments: Vec::new(), settings: set(config) }
    }

    #[test]
    fn runs_that_differ_in_the_seed_only_are_one_group() {
        let (a, b) = ("\"map.parents\" = 1\n\"task.groups\" = [[0], [1]]", "\"map.parents\" = 2");
        let runs = [run(1, a), run(1, b), run(2, a)];
        let (keys, groups) = alike(&runs);
        assert_eq!(keys, ["map.parents", "task.groups"]);
        let labels: Vec<(&str, usize)> = groups.iter().map(|g| (g.label.as_str(), g.runs.len())).collect();
        assert_eq!(labels, [("parents=1, 0|1", 2), ("parents=2", 1)]);
        assert_eq!(groups[1].values, [Some("2".to_string()), None]);
        let (keys, groups) = alike(&runs[..1]);
        assert_eq!((keys.len(), groups[0].label.as_str()), (0, "toy"));
    }

    #[test]
    fn broken_metrics_are_refused_with_their_line() {
        let broken = |text: &str| moments(text).unwrap_err().message;
        assert!(broken("generation,coverage\n").contains("found none"));
        assert!(broken("a,b\n1,2\n").contains("evaluations"));
        assert!(broken("coverage,qd_score,obj_max,evaluations\n1,2,3,4\n1,x,3,4\n").contains("line: 3"));
    }
}
