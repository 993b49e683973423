//! A palette for a whole animation: the most frequent colours of some of its frames.

use std::collections::BTreeMap;

/// Most colours of any palette; one index of 256 is reserved for "unchanged".
pub(crate) const MOST: usize = 255;
/// Colours closer than this (Euclidean, 255 per channel) share an index.
const NEAR: i32 = 18;

/// A number of colours, with the nearest one to any colour.
#[derive(Clone, Debug)]
pub(crate) struct Palette {
    colours: Vec<[u8; 3]>,
    /// The index of the nearest colour, by the upper six bits of red, green and blue.
    nearest: Vec<u8>,
}

impl Palette {
    /// Creates a palette from the `fixed` colours and then the most frequent colours of the samples
    /// (RGBA bytes), except those near a colour already in it; at most `most` colours.
    pub(crate) fn new<'a>(
        fixed: &[[u8; 3]],
        samples: impl IntoIterator<Item = &'a [u8]>,
        most: usize,
    ) -> Self {
        let mut counts: BTreeMap<[u8; 3], u32> = BTreeMap::new();
        for sample in samples {
            for pixel in sample.chunks_exact(4) {
                *counts.entry([pixel[0], pixel[1], pixel[2]]).or_default() += 1;
            }
        }
        let mut frequent: Vec<_> = counts.into_iter().collect();
        frequent.sort_by_key(|(colour, count)| (std::cmp::Reverse(*count), *colour));
        let mut colours: Vec<[u8; 3]> = Vec::new();
        for colour in fixed
            .iter()
            .copied()
            .chain(frequent.into_iter().map(|(colour, _)| colour))
        {
            let is_new = colours.iter().all(|c| distance(*c, colour) >= NEAR * NEAR);
            if is_new && colours.len() < most.min(MOST) {
                colours.push(colour);
            }
        }
        let nearest = (0..1 << 18).map(|bin: i32| {
            let centre = [bin >> 12, bin >> 6, bin].map(|v| (((v & 63) << 2) + 2) as u8);
            (0..colours.len())
                .min_by_key(|&i| distance(colours[i], centre))
                .unwrap_or(0) as u8
        });
        Palette {
            nearest: nearest.collect(),
            colours,
        }
    }

    pub(crate) fn index(&self, [r, g, b]: [u8; 3]) -> u8 {
        let bin = usize::from(r >> 2) << 12 | usize::from(g >> 2) << 6 | usize::from(b >> 2);
        self.nearest[bin]
    }

    /// Returns the colours in the order of their indices.
    pub(crate) fn colours(&self) -> &[[u8; 3]] {
        &self.colours
    }
}

/// Returns the squared distance of two colours.
pub(crate) fn distance(a: [u8; 3], b: [u8; 3]) -> i32 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (i32::from(*a) - i32::from(b)).pow(2))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_colours_are_exact_and_frequent_ones_near() {
        let samples: Vec<u8> = (0..4000u32)
            .flat_map(|i| [(i % 250) as u8, (i / 50) as u8, 9, 255])
            .collect();
        let fixed = [[255, 255, 255], [200, 10, 30]];
        let palette = Palette::new(&fixed, [samples.as_slice()], MOST);
        assert!(palette.colours().len() <= 255);
        for colour in fixed {
            assert_eq!(
                palette.colours()[usize::from(palette.index(colour))],
                colour
            );
        }
        let few: Vec<u8> = (0..40u8)
            .flat_map(|i| [6 * i, 255 - 6 * i, 90, 255])
            .collect();
        let palette = Palette::new(&fixed, [few.as_slice()], MOST);
        for pixel in few.chunks(4) {
            let colour = [pixel[0], pixel[1], pixel[2]];
            let found = palette.colours()[usize::from(palette.index(colour))];
            assert!(
                distance(found, colour) <= (NEAR + 4) * (NEAR + 4),
                "{colour:?} {found:?}"
            );
        }
    }
}
