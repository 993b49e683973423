//! The dataset `gates`: an image for each combination of cues, every one of them bright or dark.
//! Bodies that tell these apart compute truth tables.

use crate::base::Grid;
use crate::base::hash::sha256_hex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Name of the dataset.
pub(crate) const GATES: &str = "gates";

/// Most cues: the combinations of eight are as many as there are classes.
const MOST: usize = 8;

/// The cues of the dataset `gates`: strips of the image from left to right. The class of an image
/// is the number that its cues make, the first being the most significant bit; training and test
/// images are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Gates {
    /// Number of cues. Default 2.
    #[schemars(range(min = 2, max = MOST))]
    pub(crate) cues: usize,
}

impl Default for Gates {
    fn default() -> Self {
        Gates { cues: 2 }
    }
}

impl Gates {
    pub(crate) const SIDE: usize = 28;

    pub(crate) fn is_default(&self) -> bool {
        *self == Gates::default()
    }

    /// Checks the number of cues.
    ///
    /// # Errors
    /// Returns the text that says what was expected.
    pub(crate) fn validate(self) -> Result<(), String> {
        match (2..=MOST).contains(&self.cues) {
            true => Ok(()),
            false => Err(format!("expected 2 to {MOST} cues, found {}", self.cues)),
        }
    }

    /// Returns the number of images in each split.
    pub(crate) fn len(self) -> usize {
        1 << self.cues
    }

    /// Returns true if a cue is bright in images of a class.
    fn is_bright(self, class: usize, cue: usize) -> bool {
        class >> (self.cues - 1 - cue) & 1 == 1
    }

    /// Draws the image at an index, 28 × 28, 0 dark, 255 bright; `None` beyond the end.
    pub(crate) fn image(self, index: usize) -> Option<Grid<u8>> {
        let pixel = |_, column: usize| {
            let cue = column * self.cues / Self::SIDE;
            255 * u8::from(self.is_bright(index, cue))
        };
        (index < self.len()).then(|| Grid::from_fn(Self::SIDE, Self::SIDE, pixel))
    }

    /// Draws an image with cues of any brightness from 0 to 1.
    pub(crate) fn at<const CUES: usize>(levels: [f64; CUES]) -> Grid<u8> {
        Grid::from_fn(Self::SIDE, Self::SIDE, |_, column| {
            (255.0 * levels[column * CUES / Self::SIDE]).round() as u8
        })
    }

    /// Returns the names of the classes: the cues in their order, 1 for bright.
    pub(crate) fn class_names(self) -> Vec<String> {
        (0..self.len())
            .map(|class| format!("{class:0width$b}", width = self.cues))
            .collect()
    }

    /// Returns the SHA-256 of the parameters.
    pub(crate) fn fingerprint(self) -> String {
        sha256_hex(format!("gates; {} cues in strips", self.cues).as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_of_cues_has_an_image_in_strips_and_a_name() {
        let gates = Gates { cues: 3 };
        assert_eq!(gates.class_names()[6], "110");
        let image = gates.image(6).unwrap();
        let row = image.rows().nth(13).unwrap();
        assert_eq!((row[0], row[14], row[27]), (255, 255, 0));
        assert!(gates.image(8).is_none());
        for cues in [1, 9] {
            assert!(Gates { cues }.validate().is_err());
        }
    }
}
