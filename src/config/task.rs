//! [`TaskConfig`]: a config's section `[task]`.

use crate::base::error::Error;
use crate::config::pair;
use crate::task::grouping::Grouping;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The classes to tell apart: section `[task]`, either `groups` or `splits`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TaskConfig {
    /// One task, as `[[0], [1]]`: groups of classes for which robots walk opposite ways.
    #[serde(
        skip_serializing_if = "Option::is_none",
        deserialize_with = "pair::read_some"
    )]
    pub groups: Option<[Vec<u8>; 2]>,
    /// Tasks are all ways to split these 2 to 10 classes into two groups; they are a dimension of
    /// the archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) splits: Option<Vec<u8>>,
    /// With `splits`: one more bin for robots that always walk one way (the paper's code).
    pub(crate) same_way_bin: bool,
}

impl TaskConfig {
    pub(crate) fn grouping(&self) -> Result<Grouping, Error> {
        let TaskConfig {
            groups,
            splits,
            same_way_bin,
        } = self;
        let grouping = match (groups, splits) {
            (Some([a, b]), None) if !same_way_bin => Grouping::two_groups(a, b),
            (None, Some(classes)) => Grouping::all_splits(classes, *same_way_bin),
            (Some(_), None) => {
                return Err(Error::at_key(
                    "task.same_way_bin",
                    "expected only with task.splits",
                ));
            }
            _ => {
                let text = "expected either groups, as in groups = [[0], [1]], or splits, as in splits = [0, 1, 2, 3]";
                return Err(Error::at_key("task", text));
            }
        };
        grouping.map_err(|error| Error::at_key("task", error))
    }

    /// Returns all classes of the task, in its order.
    pub(crate) fn classes(&self) -> Vec<u8> {
        let TaskConfig { groups, splits, .. } = self;
        groups
            .iter()
            .flatten()
            .chain(splits)
            .flatten()
            .copied()
            .collect()
    }

    /// Returns the common tasks of several runs: their own if equal, else all splits of their
    /// classes if each run has some of these. Returns `None` for different classes, or no runs.
    pub(crate) fn together<'a>(
        all: impl IntoIterator<Item = &'a TaskConfig> + Clone,
    ) -> Option<Self> {
        let first = all.clone().into_iter().next()?;
        if all.clone().into_iter().all(|task| task == first) {
            return Some(first.clone());
        }
        let mut classes = first.classes();
        classes.sort_unstable();
        let same_way_bin = all.clone().into_iter().any(|task| task.same_way_bin);
        let together = TaskConfig {
            groups: None,
            splits: Some(classes),
            same_way_bin,
        };
        let splits = together.grouping().ok()?;
        let has = |task: &TaskConfig| {
            let own = task.grouping().ok();
            own.is_some_and(|own| {
                own.tasks()
                    .iter()
                    .all(|split| splits.tasks().contains(split))
            })
        };
        all.into_iter().all(has).then_some(together)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(a: &[u8], b: &[u8]) -> TaskConfig {
        TaskConfig {
            groups: Some([a.to_vec(), b.to_vec()]),
            ..TaskConfig::default()
        }
    }

    fn splits(classes: &[u8], same_way_bin: bool) -> TaskConfig {
        TaskConfig {
            groups: None,
            splits: Some(classes.to_vec()),
            same_way_bin,
        }
    }

    #[test]
    fn tasks_of_the_same_classes_are_all_splits_of_these_together() {
        let (three, even) = (groups(&[3], &[0, 1, 2]), groups(&[0, 2], &[1, 3]));
        assert_eq!(TaskConfig::together([&three, &three]), Some(three.clone()));
        assert_eq!(
            TaskConfig::together([&three, &even]),
            Some(splits(&[0, 1, 2, 3], false))
        );
        let published = splits(&[0, 1, 2, 3], true);
        assert_eq!(
            TaskConfig::together([&three, &published]),
            Some(published.clone())
        );
        assert_eq!(TaskConfig::together([]), None);
        // Other classes; and reversed groups, whose names are not those of splits.
        assert_eq!(TaskConfig::together([&three, &groups(&[0], &[1])]), None);
        assert_eq!(
            TaskConfig::together([&three, &groups(&[1, 3], &[0, 2])]),
            None
        );
    }
}
