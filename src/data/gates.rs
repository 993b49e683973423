//! The dataset `gates`: an image for each combination of cues, every one of them bright or dark.
//! Bodies that tell these apart compute truth tables.

use crate::base::Grid;
use crate::base::hash::sha256_hex;

/// Names of the datasets of two, three and four cues.
pub(crate) const NAMES: [&str; 3] = ["gates", "gates-3", "gates-4"];

/// The cues of a dataset: strips of the image from left to right. The class of an image is the
/// number that its cues make, the first being the most significant bit; training and test images
/// are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Gates {
    /// Number of cues, 2 to 4.
    pub(crate) cues: usize,
}

impl Gates {
    /// Side of the images; divisible by 2, 3 and 4, so that strips are equally wide.
    pub(crate) const SIDE: usize = 24;

    /// Returns the cues of the dataset of a name; `None` if that is no dataset of gates.
    pub(crate) fn named(name: &str) -> Option<Gates> {
        let place = NAMES.iter().position(|known| *known == name)?;
        Some(Gates { cues: 2 + place })
    }

    pub(crate) fn name(self) -> &'static str {
        NAMES[self.cues - 2]
    }

    /// Returns the number of images in each split.
    pub(crate) fn len(self) -> usize {
        1 << self.cues
    }

    /// Returns true if a cue is bright in images of a class.
    fn is_bright(self, class: usize, cue: usize) -> bool {
        class >> (self.cues - 1 - cue) & 1 == 1
    }

    /// Draws the image at an index, 24 × 24, 0 dark, 255 bright; `None` beyond the end.
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

    /// Returns the SHA-256 of what the images show.
    pub(crate) fn fingerprint(self) -> String {
        sha256_hex(format!("gates; {} cues in strips", self.cues).as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_of_cues_has_an_image_in_strips_and_a_name() {
        let gates = Gates::named("gates-3").unwrap();
        assert_eq!(gates.class_names()[6], "110");
        let image = gates.image(6).unwrap();
        let row = image.rows().nth(13).unwrap();
        assert_eq!((row[0], row[15], row[16]), (255, 255, 0));
        assert!(gates.image(8).is_none());
        for name in ["gates-2", "gates-5", "Gates", "gates-"] {
            assert_eq!(Gates::named(name), None, "{name}");
        }
    }
}
