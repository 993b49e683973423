//! References to the images of runs and evaluations: places in a dataset, and held-out choices.

use crate::data::dataset::Split;
use crate::task::answer::Answer;
use crate::task::class_names::ClassNames;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

/// An image by its index in a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ImageRef {
    /// The index in its split.
    pub index: usize,
    /// The class.
    pub label: u8,
}

impl ImageRef {
    /// Returns its class and place for people, such as "0 (train 1)" or "cat (test 7)".
    pub(crate) fn called(self, split: Split, names: &ClassNames) -> String {
        format!("{} ({split} {})", names.name(self.label), self.index)
    }
}

/// The data of a run, identified by content wherever the files were.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct DatasetRef {
    /// The name of the dataset.
    pub name: String,
    /// The SHA-256 of the training split's content.
    pub train_sha256: String,
}

/// The kind of images that robots are not trained on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum HeldOut {
    /// The images of the test split, by which nothing should be chosen.
    #[default]
    Test,
    /// Validation images.
    Validation,
}

impl HeldOut {
    /// Returns true if files may omit it.
    pub(crate) fn is_default(&self) -> bool {
        *self == HeldOut::default()
    }

    pub(crate) fn split(&self) -> Split {
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
        let found = [HeldOut::Test, HeldOut::Validation]
            .into_iter()
            .find(|split| split.to_string() == text);
        found.ok_or_else(|| "expected test or validation".to_string())
    }
}

/// The number of held-out images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum HowMany {
    /// All images of the classes.
    All,
    /// A total that is evenly divided between the classes.
    Evenly(usize),
}

impl HowMany {
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
        /// A number or a word; both are parsed as text.
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

/// Returns the answers to images, in their order; displacements that are missing are yet unknown.
pub(crate) fn answers(
    images: &[ImageRef],
    displacements: impl IntoIterator<Item = Option<f64>>,
) -> Vec<Answer> {
    let all = displacements.into_iter().chain(std::iter::repeat(None));
    images
        .iter()
        .zip(all)
        .map(|(image, displacement)| Answer {
            class: image.label,
            displacement,
        })
        .collect()
}
