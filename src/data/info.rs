//! Record of a dataset, by which a result can be traced to the exact images behind it.

use crate::data::class_names::ClassNames;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// A run's record of its dataset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DatasetInfo {
    /// Name: "mnist", "fashion-mnist", "builtin" or the user's own.
    pub(crate) name: String,
    /// The folder it was read from, or "builtin".
    pub(crate) source: String,
    /// Origin of that folder ("as given", "MORPHCOG_DATA", `[data] dir`, "default"), or "builtin".
    pub(crate) origin: String,
    /// Names of its classes, from class 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) class_names: Vec<String>,
    pub(crate) splits: BTreeMap<Split, SplitInfo>,
}

impl DatasetInfo {
    pub(crate) fn names(&self) -> ClassNames {
        ClassNames::of(&self.class_names)
    }

    /// Lists unintended differences of training and test images: sizes, classes in one only.
    pub(crate) fn differences(&self) -> Vec<String> {
        let [Some(train), Some(test)] = Split::ALL.map(|split| self.splits.get(&split)) else {
            return Vec::new();
        };
        let size = |split: &SplitInfo| format!("{} × {}", split.height, split.width);
        let mut all = Vec::new();
        if size(train) != size(test) {
            all.push(format!(
                "train images have {} pixels, test images {}",
                size(train),
                size(test)
            ));
        }
        for (split, has, lacks) in [("test", train, test), ("train", test, train)] {
            let missing: Vec<&u8> = (has.per_class.keys())
                .filter(|class| !lacks.per_class.contains_key(class))
                .collect();
            if !missing.is_empty() {
                all.push(format!(
                    "there are no {split} images of class {}",
                    self.names().list(missing)
                ));
            }
        }
        all
    }
}

/// A run's record of one split.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SplitInfo {
    pub(crate) images: usize,
    pub(crate) height: usize,
    pub(crate) width: usize,
    /// SHA-256 of the content. For files: of the unpacked image file, then the unpacked label file,
    /// with the images transposed if they are. For built-in digits: of their parameters.
    pub(crate) fingerprint: String,
    /// True if rows and columns of the images are exchanged in the files.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) transposed: bool,
    /// Number of images of every class that occurs.
    pub(crate) per_class: BTreeMap<u8, usize>,
    /// The files as found, images first; none for built-in digits.
    pub(crate) files: Vec<FileInfo>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FileInfo {
    /// Name within [`DatasetInfo::source`].
    pub(crate) name: String,
    pub(crate) bytes: u64,
    /// SHA-256 of the file as found (compressed, if it is).
    pub(crate) sha256: String,
}

/// One of the two parts of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Images for evolution and training.
    Train,
    /// Held-out images for tests.
    Test,
}

impl Split {
    /// Both, training first.
    pub const ALL: [Split; 2] = [Split::Train, Split::Test];

    /// Returns the split's number in names of random streams, which is part of every result.
    pub(crate) fn code(self) -> u64 {
        match self {
            Split::Train => 0,
            Split::Test => 1,
        }
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Split::Train => "train",
            Split::Test => "test",
        })
    }
}
