//! [`Item`]: a labelled picture of a source, before it is prepared.

use crate::base::files::open_file;
use crate::base::text::shortened;
use crate::data::info::Split;
use std::cmp::Ordering;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Most bytes of one file of a source, stored or unpacked.
pub(crate) const MOST_BYTES: u64 = 1 << 31;

/// A grey picture: 0 is black, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Grey {
    pub(crate) height: usize,
    pub(crate) width: usize,
    pub(crate) pixels: Vec<u8>,
    /// True if transparency has told the things from their ground, which is dark then.
    pub(crate) is_cut_out: bool,
}

impl Grey {
    pub(crate) fn new(height: usize, width: usize, pixels: Vec<u8>) -> Self {
        debug_assert_eq!(height * width, pixels.len());
        Grey {
            height,
            width,
            pixels,
            is_cut_out: false,
        }
    }

    /// Returns a picture of this size whose pixels stand at other places in this one.
    pub(crate) fn rearranged(
        &self,
        height: usize,
        width: usize,
        place: impl Fn(usize, usize) -> (usize, usize),
    ) -> Self {
        let at = |(row, column): (usize, usize)| self.pixels[row * self.width + column];
        let row = |row| (0..width).map(move |column| (row, column));
        let places = (0..height).flat_map(row);
        let pixels = places.map(|(row, column)| at(place(row, column))).collect();
        Grey {
            height,
            width,
            pixels,
            is_cut_out: self.is_cut_out,
        }
    }

    pub(crate) fn transposed(&self) -> Self {
        self.rearranged(self.width, self.height, |row, column| (column, row))
    }
}

/// The class that a source gives an image.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Label {
    Number(i64),
    Name(String),
}

impl std::fmt::Display for Label {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Label::Number(number) => write!(f, "{number}"),
            Label::Name(name) => f.write_str(name),
        }
    }
}

/// The part of a source that an image stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Part {
    Train,
    Validation,
    Test,
}

impl From<Split> for Part {
    fn from(split: Split) -> Self {
        match split {
            Split::Train => Part::Train,
            Split::Test => Part::Test,
        }
    }
}

impl Part {
    /// Returns the part that a file, a folder or an array is named after, such as `mnist_train`.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let lower = name.to_lowercase();
        // The file's own name goes before its folder's.
        let names = lower.rsplit('/');
        let mut words = names.flat_map(|name| name.split(|c: char| !c.is_alphanumeric()));
        words.find_map(|word| match word {
            _ if word.starts_with("train") => Some(Part::Train),
            "t10k" => Some(Part::Test),
            _ if word.starts_with("test") => Some(Part::Test),
            "val" | "valid" | "validation" => Some(Part::Validation),
            // As in `xtrain`.
            _ if word.len() == 6 && word.ends_with("train") => Some(Part::Train),
            _ if word.len() == 5 && word.ends_with("test") => Some(Part::Test),
            _ => None,
        })
    }
}

/// The picture of an item, read as late as possible: photographs would not fit into memory.
#[derive(Clone, Debug)]
pub(crate) enum Picture {
    File(PathBuf),
    Encoded(Vec<u8>),
    Grey(Grey),
}

/// A labelled picture.
#[derive(Clone, Debug)]
pub(crate) struct Item {
    pub(crate) picture: Picture,
    pub(crate) label: Label,
    pub(crate) part: Option<Part>,
    /// The file below the source, with the row if it is a table or an array.
    pub(crate) source: String,
    /// True for EMNIST's files, in which images are mirrored and turned.
    pub(crate) is_emnist: bool,
}

/// An image that is left out.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Refused {
    /// The file, with the row if it is a table or an array.
    pub source: String,
    /// The reason.
    pub reason: String,
    /// The class that the source gives it, if that is known.
    #[serde(skip)]
    pub(crate) label: Option<Label>,
}

impl Refused {
    pub(crate) fn new(source: impl Into<String>, reason: impl AsRef<str>) -> Self {
        Refused {
            source: shortened(&source.into(), 200),
            reason: shortened(reason.as_ref(), 200),
            label: None,
        }
    }

    pub(crate) fn of(self, label: &Label) -> Self {
        Refused {
            label: Some(label.clone()),
            ..self
        }
    }
}

/// All that was found in the sources.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    pub(crate) items: Vec<Item>,
    pub(crate) refused: Vec<Refused>,
    /// Number of files that are no pictures and do not claim to be.
    pub(crate) passed_over: usize,
    pub(crate) notes: Vec<String>,
    /// Names that the source gives to its numbers of classes, from 0.
    pub(crate) class_names: Option<Vec<String>>,
}

impl Found {
    /// Adds what another source has. Classes named by only one of them go by their names in both.
    pub(crate) fn add(&mut self, mut other: Found) {
        if !self.items.is_empty() && self.class_names != other.class_names {
            self.name_classes();
            other.name_classes();
        }
        self.class_names = other.class_names;
        self.items.append(&mut other.items);
        self.refused.append(&mut other.refused);
        self.notes.append(&mut other.notes);
        self.passed_over += other.passed_over;
    }

    fn name_classes(&mut self) {
        let Some(names) = self.class_names.take() else {
            return;
        };
        for item in &mut self.items {
            if let Label::Number(number) = item.label
                && let Some(name) = usize::try_from(number).ok().and_then(|n| names.get(n))
            {
                item.label = Label::Name(name.clone());
            }
        }
    }
}

/// Reads a file of a source; the error is a reason without the path.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let read = open_file(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| format!("cannot be read: {error}"))?;
    match read as u64 > MOST_BYTES {
        true => Err("has more than 2 GB".to_string()),
        false => Ok(bytes),
    }
}

/// Reads the beginning of a file.
pub(crate) fn beginning(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_file(path)?.take(64).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Compares names as people sort them: without case, and numbers in them by value.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    let [mut left, mut right] = [a, b].map(|text| pieces(&text.to_lowercase()));
    left.reverse();
    right.reverse();
    while let (Some(one), Some(other)) = (left.pop(), right.pop()) {
        let order = match (number(&one), number(&other)) {
            (Some(one), Some(other)) => one.len().cmp(&other.len()).then_with(|| one.cmp(&other)),
            _ => one.cmp(&other),
        };
        if order.is_ne() {
            return order;
        }
        if left.is_empty() || right.is_empty() {
            break;
        }
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// Cuts a text into runs of digits and single other characters.
fn pieces(text: &str) -> Vec<String> {
    let mut pieces: Vec<String> = Vec::new();
    for c in text.chars() {
        match pieces.last_mut() {
            Some(last) if c.is_ascii_digit() && last.ends_with(|c: char| c.is_ascii_digit()) => {
                last.push(c);
            }
            _ => pieces.push(c.to_string()),
        }
    }
    pieces
}

fn number(piece: &str) -> Option<String> {
    let is_number = piece.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| piece.trim_start_matches('0').to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_sorted_as_people_do() {
        let mut names = ["img10", "Img9", "b", "a", "B2", "", "img1", "img01", "-1"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["", "-1", "a", "b", "B2", "img01", "img1", "Img9", "img10"]
        );
    }

    #[test]
    fn names_tell_the_part_of_a_dataset() {
        let parts = [
            ("x_train", Some(Part::Train)),
            ("xtest", Some(Part::Test)),
            ("Training", Some(Part::Train)),
            ("t10k-images-idx3-ubyte", Some(Part::Test)),
            ("train-00000-of-00002.parquet", Some(Part::Train)),
            ("validation-0.parquet", Some(Part::Validation)),
            ("sign_mnist_test.csv", Some(Part::Test)),
            ("testing/x_train.npy", Some(Part::Train)),
            ("test/0.npy", Some(Part::Test)),
            ("contests.csv", None),
            ("images", None),
        ];
        for (name, part) in parts {
            assert_eq!(Part::named(name), part, "{name}");
        }
    }
}
