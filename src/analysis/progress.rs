//! `morphcog plot`: reads what figures are made of.

use crate::base::error::Error;
use crate::config::{Settings, differing};
use crate::store::metrics::{Moment, moments_of};
use crate::store::run::RunFile;
use crate::task::class_names::ClassNames;
use std::collections::BTreeSet;
use std::path::Path;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Progress {
    pub(crate) run: String,
    pub(crate) seed: u64,
    /// What its fitness is measured in.
    pub(crate) unit: Option<&'static str>,
    /// A moment per generation, at least one.
    pub(crate) moments: Vec<Moment>,
    /// All that its results depend on but the seed.
    pub(crate) settings: Settings,
    /// The names of its classes, by which settings call them.
    pub(crate) names: ClassNames,
}

/// Runs that differ in nothing but the seed, and so belong together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SettingsGroup<'a> {
    /// What tells it from the others, as "parents=10, 0|1".
    pub(crate) label: String,
    /// Its value of each key in which groups differ; none where it has no such key.
    pub(crate) values: Vec<Option<String>>,
    pub(crate) runs: Vec<&'a Progress>,
}

/// Runs in groups, in the order of their first ones, and the keys in which these differ.
pub(crate) fn group_by_settings(runs: &[Progress]) -> (Vec<String>, Vec<SettingsGroup<'_>>) {
    let mut groups: Vec<Vec<&Progress>> = Vec::new();
    for run in runs {
        match groups
            .iter_mut()
            .find(|group| group[0].settings == run.settings)
        {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    let from_first = |group: &Vec<&Progress>| differing(&groups[0][0].settings, &group[0].settings);
    let keys: BTreeSet<String> = groups
        .iter()
        .flat_map(from_first)
        .map(|(key, ..)| key)
        .collect();
    let value =
        |run: &Progress, key: &String| run.settings.get(key).map(|value| spoken(value, &run.names));
    let group = |runs: &Vec<&'_ Progress>| -> (String, Vec<Option<String>>) {
        let values: Vec<Option<String>> = keys.iter().map(|key| value(runs[0], key)).collect();
        let word = |(key, value): (&String, &Option<String>)| match (key.as_str(), value) {
            ("task.groups", Some(value)) => Some(value.clone()),
            (_, None) => None,
            (key, Some(value)) => {
                Some(format!("{}={value}", key.rsplit('.').next().unwrap_or(key)))
            }
        };
        let words: Vec<String> = keys.iter().zip(&values).filter_map(word).collect();
        // Two configs with the same settings may have two names, and are one group all the same.
        (
            if words.is_empty() {
                runs[0].run.clone()
            } else {
                words.join(", ")
            },
            values,
        )
    };
    let described: Vec<(String, Vec<Option<String>>)> = groups.iter().map(group).collect();
    let keys = keys.into_iter().collect();
    let group = |((label, values), runs)| SettingsGroup {
        label,
        values,
        runs,
    };
    (keys, described.into_iter().zip(groups).map(group).collect())
}

/// A value of a config for people: groups of classes as 0|1 or cat|dog.
pub(super) fn spoken(value: &toml::Value, names: &ClassNames) -> String {
    let classes = |list: &toml::Value| -> Option<Vec<u8>> {
        list.as_array()?
            .iter()
            .map(|class| class.as_integer().and_then(|c| u8::try_from(c).ok()))
            .collect()
    };
    let groups = || -> Option<String> {
        let [a, b] = value.as_array()?.as_slice() else {
            return None;
        };
        Some(names.groups([&classes(a)?, &classes(b)?]))
    };
    groups().unwrap_or_else(|| {
        value
            .as_str()
            .map_or_else(|| value.to_string(), str::to_string)
    })
}

impl Progress {
    /// Reads the metrics.csv beside a run.json; an error names the line.
    pub(crate) fn of(run: &RunFile, archive: &Path) -> Result<Self, Error> {
        let moments = moments_of(run, archive)?;
        let unit = run.fitness().unit();
        let mut settings = run.config.settings();
        settings.remove("seed");
        Ok(Progress {
            run: run.called().to_string(),
            seed: run.config.seed,
            unit,
            moments,
            settings,
            names: run.config.class_names(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(seed: u64, config: &str) -> Progress {
        let set = |config: &str| toml::from_str::<Settings>(config).unwrap();
        Progress {
            run: "toy".into(),
            seed,
            unit: None,
            moments: Vec::new(),
            settings: set(config),
            names: ClassNames::default(),
        }
    }

    #[test]
    fn runs_that_differ_in_the_seed_only_are_one_group() {
        let (a, b) = (
            "\"map.parents\" = 1\n\"task.groups\" = [[0], [1]]",
            "\"map.parents\" = 2",
        );
        let runs = [run(1, a), run(1, b), run(2, a)];
        let (keys, groups) = group_by_settings(&runs);
        assert_eq!(keys, ["map.parents", "task.groups"]);
        let labels: Vec<(&str, usize)> = groups
            .iter()
            .map(|g| (g.label.as_str(), g.runs.len()))
            .collect();
        assert_eq!(labels, [("parents=1, 0|1", 2), ("parents=2", 1)]);
        assert_eq!(groups[1].values, [Some("2".to_string()), None]);
        let (keys, groups) = group_by_settings(&runs[..1]);
        assert_eq!((keys.len(), groups[0].label.as_str()), (0, "toy"));
        let names = ClassNames::of(&["cat", "dog"].map(String::from));
        let named = runs.map(|run| Progress {
            names: names.clone(),
            ..run
        });
        assert_eq!(group_by_settings(&named).1[0].label, "parents=1, cat|dog");
    }
}
