//! [`TaskConfig`]: a config's section `[task]`.

use crate::base::error::Error;
use crate::config::pair;
use crate::task::grouping::Grouping;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which classes are to be told apart: section `[task]`, either `groups` or `splits`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TaskConfig {
    /// One task: two groups of classes that are to walk opposite ways.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "pair::read_some")]
    pub groups: Option<[Vec<u8>; 2]>,
    /// All ways to split these classes in two groups; the task a robot performs is a dimension of
    /// the archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub splits: Option<Vec<u8>>,
    /// With `splits`: one more bin for robots that walk the same way for all classes, as in the
    /// published code.
    pub same_way_bin: bool,
}

impl TaskConfig {
    /// The tasks.
    ///
    /// # Errors
    /// If the section `[task]` makes none.
    pub fn grouping(&self) -> Result<Grouping, Error> {
        let TaskConfig { groups, splits, same_way_bin } = self;
        let grouping = match (groups, splits) {
            (Some([a, b]), None) if !same_way_bin => Grouping::two_groups(a, b),
            (None, Some(classes)) => Grouping::all_splits(classes, *same_way_bin),
            (Some(_), None) => {
                return Err(Error::at("task.same_way_bin", "expected only with task.splits"));
            }
            _ => {
                let text = "expected either groups, as in groups = [[0], [1]], or splits, as in splits = [0, 1, 2, 3]";
                return Err(Error::at("task", text));
            }
        };
        grouping.map_err(|error| Error::at("task", error))
    }

    /// All classes of the task, in its order.
    pub fn classes(&self) -> Vec<u8> {
        let TaskConfig { groups, splits, .. } = self;
        groups.iter().flatten().chain(splits).flatten().copied().collect()
    }
}
