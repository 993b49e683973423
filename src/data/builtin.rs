//! Built-in digits: handwriting-like images drawn by the program, so that all works without a
//! download. There are any number, each a pure function of (seed, split, class, number).

use crate::base::Grid;
use crate::base::hash::sha256_hex;
use crate::base::random::{Purpose, stream};
use crate::data::info::Split;
use crate::data::pen;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Name of the built-in digits as a dataset.
pub const BUILTIN: &str = "builtin";

/// The choice of built-in digits. In each split the classes take turns: index i has the class
/// `classes[i % k]`, so that indices 0, 1, …, k − 1 are one image of each class.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct BuiltinDigits {
    /// Seed of the images. Default 1.
    pub(crate) seed: u64,
    /// Digits, which take turns. Default 0 to 9.
    ///
    /// They are different, and image `i` shows `classes[i % k]`.
    pub(crate) classes: Vec<u8>,
    /// Training images of each class. Default 1000.
    #[schemars(range(max = MAX_PER_CLASS))]
    pub(crate) train_per_class: usize,
    /// Test images of each class. Default 500.
    #[schemars(range(max = MAX_PER_CLASS))]
    pub(crate) test_per_class: usize,
}

impl Default for BuiltinDigits {
    /// Seed 1, all ten digits, 1000 training and 500 test images of each.
    fn default() -> Self {
        BuiltinDigits {
            seed: 1,
            classes: (0..10).collect(),
            train_per_class: 1000,
            test_per_class: 500,
        }
    }
}

const MAX_PER_CLASS: usize = 1_000_000;

/// The reason why such built-in digits do not exist.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BuiltinError {
    /// There is no class.
    #[error("built-in digits: no classes given; expected at least one of 0 to 9")]
    NoClasses,
    /// A class is not a digit.
    #[error("built-in digits: there is no class {0}; expected 0 to 9")]
    NotADigit(u8),
    /// There are more images than indices can tell apart.
    #[error("built-in digits: {0} images of each class; expected at most {MAX_PER_CLASS}")]
    TooMany(usize),
    /// A class is given twice.
    #[error("built-in digits: class {0} is given more than once")]
    Repeated(u8),
}

impl BuiltinDigits {
    pub(crate) const SIDE: usize = pen::SIDE;

    /// Checks for at least one class, different digits, and not too many images of each.
    ///
    /// # Errors
    /// Returns a [`BuiltinError`] otherwise.
    pub(crate) fn validate(&self) -> Result<(), BuiltinError> {
        if self.classes.is_empty() {
            return Err(BuiltinError::NoClasses);
        }
        let most = self.train_per_class.max(self.test_per_class);
        if most > MAX_PER_CLASS {
            return Err(BuiltinError::TooMany(most));
        }
        for (i, &class) in self.classes.iter().enumerate() {
            if class > 9 {
                return Err(BuiltinError::NotADigit(class));
            }
            if self.classes[..i].contains(&class) {
                return Err(BuiltinError::Repeated(class));
            }
        }
        Ok(())
    }

    pub(crate) fn len(&self, split: Split) -> usize {
        self.classes.len() * self.per_class(split)
    }

    /// Returns the digit at an index of a split; `None` beyond its end.
    pub(crate) fn label(&self, split: Split, index: usize) -> Option<u8> {
        (index < self.len(split)).then(|| self.classes[index % self.classes.len()])
    }

    /// Draws the image at an index of a split, 28 × 28, 0 paper, 255 ink; `None` beyond its end.
    pub(crate) fn image(&self, split: Split, index: usize) -> Option<Grid<u8>> {
        let class = self.label(split, index)?;
        let number = (index / self.classes.len()) as u64;
        let page = 16 * split.code() + u64::from(class);
        Some(pen::write(
            class,
            &mut stream(self.seed, Purpose::BuiltinDigits, page, number),
        ))
    }

    /// Returns the SHA-256 of a split's parameters: drawing version, seed, classes and number.
    pub(crate) fn fingerprint(&self, split: Split) -> String {
        let (seed, classes, number) = (self.seed, &self.classes, self.per_class(split));
        let drawing = pen::DRAWING;
        let text = format!(
            "builtin digits {drawing}; seed {seed}; {split}; classes {classes:?}; {number} each"
        );
        sha256_hex(text.as_bytes())
    }

    fn per_class(&self, split: Split) -> usize {
        match split {
            Split::Train => self.train_per_class,
            Split::Test => self.test_per_class,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawings_are_stable_across_versions() {
        // Pinned: if this changes, so do all results. Then raise pen::DRAWING; see CHANGELOG.
        let digits = BuiltinDigits::default();
        let mut bytes = Vec::new();
        for index in 0..200 {
            bytes.extend(digits.image(Split::Train, index).unwrap().cells());
            bytes.extend(digits.image(Split::Test, index).unwrap().cells());
        }
        assert_eq!((pen::DRAWING, sha256_hex(&bytes).as_str()), PINNED);
    }
    const PINNED: (u32, &str) = (
        1,
        "9e204edcd4dee8a6e32ae34660207b1e7358d1ec1283a3cd5ccd3320089d76e1",
    );

    #[test]
    fn an_image_depends_on_seed_split_class_and_number_only() {
        let ten = BuiltinDigits::default();
        let two = BuiltinDigits {
            classes: vec![7, 3],
            test_per_class: 9,
            ..ten.clone()
        };
        // The fifth three: number 4.
        assert_eq!(ten.image(Split::Train, 43), two.image(Split::Train, 9));
        assert_eq!(two.label(Split::Test, 9), Some(3));
        assert_ne!(ten.image(Split::Train, 43), ten.image(Split::Test, 43));
        assert_ne!(ten.image(Split::Train, 43), ten.image(Split::Train, 53));
        let other = BuiltinDigits {
            seed: 2,
            ..ten.clone()
        };
        assert_ne!(ten.image(Split::Train, 43), other.image(Split::Train, 43));
        assert_eq!(two.image(Split::Test, 18), None);
    }

    #[test]
    fn classes_take_turns() {
        let digits = BuiltinDigits::default();
        let first: Vec<u8> = (0..12)
            .filter_map(|i| digits.label(Split::Test, i))
            .collect();
        assert_eq!(first, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 1]);
        assert_eq!(
            (digits.len(Split::Train), digits.len(Split::Test)),
            (10_000, 5000)
        );
    }

    #[test]
    fn ink_is_dark_in_the_middle_light_at_its_edge_and_off_the_border() {
        let digits = BuiltinDigits::default();
        for index in 0..500 {
            let image = digits.image(Split::Train, index).unwrap();
            let on_border = |r, c| r == 0 || c == 0 || r == 27 || c == 27;
            assert!(
                image.iter().all(|((r, c), &v)| !on_border(r, c) || v == 0),
                "{index}: ink on the border"
            );
            let inked = image.cells().iter().filter(|&&v| v > 0).count();
            assert!((30..330).contains(&inked), "{index}: {inked} pixels of ink");
            assert!(
                image.cells().iter().any(|&v| v > 250),
                "{index}: no full ink"
            );
            assert!(
                image.cells().iter().any(|&v| v > 0 && v < 200),
                "{index}: no soft edge"
            );
        }
    }

    #[test]
    fn impossible_classes_are_refused() {
        let with = |classes: &[u8]| BuiltinDigits {
            classes: classes.to_vec(),
            ..BuiltinDigits::default()
        };
        assert_eq!(with(&[]).validate(), Err(BuiltinError::NoClasses));
        assert_eq!(with(&[3, 10]).validate(), Err(BuiltinError::NotADigit(10)));
        let many = BuiltinDigits {
            test_per_class: usize::MAX,
            ..BuiltinDigits::default()
        };
        assert_eq!(many.validate(), Err(BuiltinError::TooMany(usize::MAX)));
        assert_eq!(with(&[3, 1, 3]).validate(), Err(BuiltinError::Repeated(3)));
        assert_eq!(with(&[9, 0]).validate(), Ok(()));
    }

    #[test]
    fn fingerprints_tell_parameters_apart() {
        let digits = BuiltinDigits::default();
        let more = BuiltinDigits {
            train_per_class: 1001,
            ..digits.clone()
        };
        assert_ne!(
            digits.fingerprint(Split::Train),
            more.fingerprint(Split::Train)
        );
        assert_eq!(
            digits.fingerprint(Split::Test),
            more.fingerprint(Split::Test)
        );
        assert_ne!(
            digits.fingerprint(Split::Train),
            digits.fingerprint(Split::Test)
        );
    }
}
