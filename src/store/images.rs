//! Which images a run was made with and robots are shown: by their places in a dataset, and as
//! robots see them.

use crate::data::dataset::Split;
use crate::task::score::Answer;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

/// An image by its place in a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ImageRef {
    /// Index in its split.
    pub index: usize,
    /// Its class.
    pub label: u8,
}

/// Which data a run was made with, wherever they lay: the same data have the same fingerprint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct DatasetRef {
    /// Name of the dataset.
    pub name: String,
    /// SHA-256 of the training split's content.
    pub train_sha256: String,
}

/// Which images that robots are not trained on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum HeldOut {
    /// Those of the test split, which nothing should be chosen by.
    #[default]
    Test,
    /// Validation images.
    Validation,
}

impl HeldOut {
    /// Whether a file needs not say it.
    pub(crate) fn is_default(&self) -> bool {
        *self == HeldOut::default()
    }

    /// The split of the dataset that these images are of.
    pub fn split(&self) -> Split {
        match self {
            HeldOut::Test => Split::Test,
            HeldOut::Validation => Split::Train,
        }
    }
}

impl fmt::Display for HeldOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            HeldOut::Test => "test",
            HeldOut::Validation => "validation",
        })
    }
}

impl FromStr for HeldOut {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let found = [HeldOut::Test, HeldOut::Validation].into_iter().find(|split| split.to_string() == text);
        found.ok_or_else(|| "expected test or validation".to_string())
    }
}

/// How many held-out images are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum HowMany {
    /// All that there are of the classes.
    All,
    /// So many in all, evenly divided between the classes.
    Evenly(usize),
}

impl HowMany {
    /// Whether that is an image of each of so many classes.
    pub(crate) fn has_each(self, classes: usize) -> bool {
        match self {
            HowMany::All => true,
            HowMany::Evenly(count) => count >= classes,
        }
    }
}

impl fmt::Display for HowMany {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            HowMany::All => f.write_str("all"),
            HowMany::Evenly(count) => count.fmt(f),
        }
    }
}

impl FromStr for HowMany {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        const MOST: usize = 1_000_000;
        match text.parse() {
            _ if text == "all" => Ok(HowMany::All),
            Ok(count) if (1..=MOST).contains(&count) => Ok(HowMany::Evenly(count)),
            _ => Err(format!("expected all, or a number from 1 to {MOST}")),
        }
    }
}

impl Serialize for HowMany {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            HowMany::All => to.serialize_str("all"),
            HowMany::Evenly(count) => count.serialize(to),
        }
    }
}

impl<'de> Deserialize<'de> for HowMany {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        /// A number or a word, either of which is read as text.
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Written {
            Count(u64),
            Word(String),
            Other(serde::de::IgnoredAny),
        }
        let text = match Written::deserialize(from)? {
            Written::Count(count) => count.to_string(),
            Written::Word(word) => word,
            Written::Other(_) => String::new(),
        };
        text.parse().map_err(serde::de::Error::custom)
    }
}

impl JsonSchema for HowMany {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "HowMany".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "anyOf": [{ "const": "all" }, { "type": "integer", "minimum": 1 }] })
    }
}

/// The answers that displacements under images are, in their order; those that are missing are
/// still to come.
pub(crate) fn answers(
    images: &[ImageRef],
    displacements: impl IntoIterator<Item = Option<f64>>,
) -> Vec<Answer> {
    let all = displacements.into_iter().chain(std::iter::repeat(None));
    images.iter().zip(all).map(|(image, displacement)| Answer { class: image.label, displacement }).collect()
}
