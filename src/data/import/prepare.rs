//! Images as sensors want them: bright things on a dark ground, of one size.

use crate::data::import::item::Grey;
use serde::Serialize;

/// Sides of images that are small enough to be seen as they are.
const KEPT: std::ops::RangeInclusive<usize> = 4..=64;
/// Largest difference of a border pixel from the ground.
const EVEN: u8 = 32;
/// MNIST's digits have 20 of 28 pixels.
const DRAWN: (usize, usize) = (20, 28);

/// The way in which pictures are fitted into the dataset's images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// As the pictures themselves suggest.
    #[default]
    Auto,
    /// The whole picture.
    Whole,
    /// What stands out from an even ground, centred and of one size, as MNIST's digits.
    Content,
    /// The pixels as they are; all pictures must have one size.
    Keep,
}

/// The way in which pictures were fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fitted {
    /// The whole picture was scaled into a square.
    Whole,
    /// What stands out was cut out, scaled and centred.
    Content,
    /// Nothing was scaled.
    Kept,
}

/// Height and width of a picture.
pub(crate) type Size = [usize; 2];

/// What a picture says about how to prepare all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Facts {
    pub(crate) size: Size,
    /// Median of the pixels at its border.
    pub(crate) ground: u8,
    /// True if at least 90 % of these are near that.
    pub(crate) is_even: bool,
    pub(crate) is_cut_out: bool,
}

impl Facts {
    /// Looks at a picture; the error is the reason why it is left out.
    pub(crate) fn of(grey: &Grey) -> Result<Self, String> {
        if grey.pixels.iter().all(|pixel| *pixel == grey.pixels[0]) {
            return Err("is of one colour".to_string());
        }
        let mut border = border(grey);
        border.sort_unstable();
        let ground = border[border.len() / 2];
        let near = border
            .iter()
            .filter(|pixel| pixel.abs_diff(ground) <= EVEN)
            .count();
        Ok(Facts {
            size: [grey.height, grey.width],
            ground,
            is_even: 10 * near >= 9 * border.len(),
            is_cut_out: grey.is_cut_out,
        })
    }
}

fn border(grey: &Grey) -> Vec<u8> {
    let (height, width) = (grey.height, grey.width);
    let is_outer = |row: &usize| *row == 0 || row + 1 == height;
    let whole = (0..height)
        .filter(is_outer)
        .flat_map(|row| row * width..(row + 1) * width);
    let sides = (1..height.saturating_sub(1)).flat_map(|row| {
        let ends = [row * width, (row + 1) * width - 1];
        ends.into_iter().take(if width > 1 { 2 } else { 1 })
    });
    whole.chain(sides).map(|place| grey.pixels[place]).collect()
}

/// The preparation that all pictures of a dataset get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Plan {
    pub(crate) fit: Fitted,
    pub(crate) is_inverted: bool,
    /// True if those are inverted, too, whose ground transparency has made dark.
    pub(crate) inverts_cut_outs: bool,
    /// Side of the images, unless they are kept.
    pub(crate) side: usize,
}

/// Returns true if most pictures have a bright ground.
pub(crate) fn is_bright(all: &[Facts]) -> bool {
    let opaque = || all.iter().filter(|facts| !facts.is_cut_out);
    2 * opaque().filter(|facts| facts.ground > 127).count() > opaque().count()
}

/// Returns the size of all pictures, if they have only one.
pub(crate) fn one_size<'a>(mut all: impl Iterator<Item = &'a Facts>) -> Option<Size> {
    let first = all.next()?.size;
    all.all(|facts| facts.size == first).then_some(first)
}

/// Chooses how to fit the pictures in.
pub(crate) fn fitting(all: &[Facts]) -> Fitted {
    let is_small = |size: Size| size.iter().all(|side| KEPT.contains(side));
    let even = all.iter().filter(|facts| facts.is_even).count();
    match one_size(all.iter()) {
        Some(size) if is_small(size) => Fitted::Kept,
        _ if 10 * even >= 9 * all.len() => Fitted::Content,
        _ => Fitted::Whole,
    }
}

impl Plan {
    /// Prepares a picture; the error is the reason why it is left out.
    pub(crate) fn apply(&self, grey: &Grey, facts: &Facts) -> Result<Vec<u8>, String> {
        let is_inverted = self.is_inverted && (!facts.is_cut_out || self.inverts_cut_outs);
        let pixel = |pixel: u8| if is_inverted { 255 - pixel } else { pixel };
        let pixels = grey.pixels.iter().copied().map(pixel).collect();
        let image = Grey::new(grey.height, grey.width, pixels);
        let made = match self.fit {
            Fitted::Kept => image.pixels,
            Fitted::Whole => {
                let size = scaled_size([image.height, image.width], self.side);
                centred(&resized(&image, size), self.side)
            }
            Fitted::Content => {
                let content = content(&image, pixel(facts.ground))?;
                let longest = (self.side * DRAWN.0 + DRAWN.1 / 2) / DRAWN.1;
                let size = scaled_size([content.height, content.width], longest.max(1));
                centred(&resized(&content, size), self.side)
            }
        };
        match made.iter().all(|pixel| *pixel == made[0]) {
            true => Err("is of one colour when it is made small".to_string()),
            false => Ok(made),
        }
    }
}

/// Cuts out what is brighter than the ground, which becomes black.
fn content(grey: &Grey, ground: u8) -> Result<Grey, String> {
    let most = grey.pixels.iter().copied().max().unwrap_or(0);
    if most <= ground {
        return Err("has nothing that is brighter than its border".to_string());
    }
    let least = u32::from(ground) + u32::from(most - ground) / 4;
    let is_content =
        |row: usize, column: usize| u32::from(grey.pixels[row * grey.width + column]) > least;
    let rows = |row: &usize| (0..grey.width).any(|column| is_content(*row, column));
    let columns = |column: &usize| (0..grey.height).any(|row| is_content(row, *column));
    const WHY: &str = "its brightest pixel is content";
    let [top, bottom] =
        [(0..grey.height).find(rows), (0..grey.height).rfind(rows)].map(|row| row.expect(WHY));
    let [left, right] = [
        (0..grey.width).find(columns),
        (0..grey.width).rfind(columns),
    ]
    .map(|column| column.expect(WHY));
    let cut = grey.rearranged(bottom + 1 - top, right + 1 - left, |row, column| {
        (top + row, left + column)
    });
    let (ground, range) = (u32::from(ground), 255 - u32::from(ground));
    let over =
        |pixel: u8| ((u32::from(pixel).saturating_sub(ground) * 255 + range / 2) / range) as u8;
    Ok(Grey {
        pixels: cut.pixels.iter().copied().map(over).collect(),
        ..cut
    })
}

/// Returns the size with this longer side and nearly the same proportions.
fn scaled_size([height, width]: Size, longest: usize) -> Size {
    let longer = height.max(width);
    [height, width].map(|side| ((side * longest + longer / 2) / longer).max(1))
}

/// Scales a picture: each pixel is the mean of the area that it covers, also of parts of pixels.
pub(crate) fn resized(grey: &Grey, [height, width]: Size) -> Grey {
    // Whole numbers: in units of 1/width of a pixel, a new one covers as many as there were.
    let shares = |before: usize, after: usize| -> Vec<Vec<(usize, u64)>> {
        let share = |new: usize| {
            let (begin, end) = (new * before, (new + 1) * before);
            let covered = begin / after..end.div_ceil(after);
            let part = |old: usize| {
                let common = end.min((old + 1) * after) - begin.max(old * after);
                (old, common as u64)
            };
            covered.map(part).collect()
        };
        (0..after).map(share).collect()
    };
    let (across, down) = (shares(grey.width, width), shares(grey.height, height));
    let narrow: Vec<u64> = grey
        .pixels
        .chunks_exact(grey.width)
        .flat_map(|row| {
            across.iter().map(|shares| {
                shares
                    .iter()
                    .map(|(old, part)| part * u64::from(row[*old]))
                    .sum()
            })
        })
        .collect();
    let area = (grey.width * grey.height) as u64;
    let mean = |shares: &[(usize, u64)], column: usize| {
        let sum: u64 = shares
            .iter()
            .map(|(old, part)| part * narrow[old * width + column])
            .sum();
        ((sum + area / 2) / area) as u8
    };
    let pixels = down
        .iter()
        .flat_map(|shares| (0..width).map(|column| mean(shares, column)));
    Grey::new(height, width, pixels.collect())
}

/// Puts a picture into the middle of a black square.
fn centred(grey: &Grey, side: usize) -> Vec<u8> {
    let (top, left) = ((side - grey.height) / 2, (side - grey.width) / 2);
    let mut square = vec![0; side * side];
    for (row, line) in grey.pixels.chunks_exact(grey.width).enumerate() {
        let from = (top + row) * side + left;
        square[from..from + grey.width].copy_from_slice(line);
    }
    square
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(height: usize, width: usize, pixel: impl Fn(usize, usize) -> u8) -> Grey {
        let row = |row| (0..width).map(move |column| (row, column));
        let pixels = (0..height)
            .flat_map(row)
            .map(|(row, column)| pixel(row, column));
        Grey::new(height, width, pixels.collect())
    }

    fn plan(fit: Fitted, is_inverted: bool) -> Plan {
        Plan {
            fit,
            is_inverted,
            inverts_cut_outs: false,
            side: 28,
        }
    }

    #[test]
    fn scaling_keeps_the_mean_and_what_is_even() {
        let grey = drawn(5, 7, |row, column| (row * 30 + column * 9) as u8);
        let mean = |grey: &Grey| {
            grey.pixels
                .iter()
                .map(|pixel| f64::from(*pixel))
                .sum::<f64>()
                / grey.pixels.len() as f64
        };
        for size in [[5, 7], [1, 1], [3, 2], [10, 14], [13, 5], [64, 64]] {
            let made = resized(&grey, size);
            assert_eq!([made.height, made.width], size);
            assert!((mean(&made) - mean(&grey)).abs() < 0.5, "{size:?}");
            let even = resized(&drawn(5, 7, |_, _| 255), size);
            assert!(even.pixels.iter().all(|pixel| *pixel == 255), "{size:?}");
        }
        assert_eq!(resized(&grey, [5, 7]), grey);
        assert_eq!(
            resized(&drawn(2, 2, |_, column| 200 * column as u8), [1, 2]).pixels,
            [0, 200]
        );
    }

    #[test]
    fn content_is_cut_out_and_centred_as_mnist_was_made() {
        // A dark block of 10 × 20 pixels on grey paper.
        let is_ink =
            |row: usize, column: usize| (60..70).contains(&row) && (5..25).contains(&column);
        let grey = drawn(
            100,
            80,
            |row, column| if is_ink(row, column) { 20 } else { 220 },
        );
        let facts = Facts::of(&grey).unwrap();
        assert_eq!(
            (facts.ground, facts.is_even, is_bright(&[facts])),
            (220, true, true)
        );
        assert_eq!(fitting(&[facts]), Fitted::Content);
        let made = plan(Fitted::Content, true).apply(&grey, &facts).unwrap();
        let bright: Vec<usize> = (0..784).filter(|place| made[*place] > 0).collect();
        assert_eq!((bright[0] / 28, bright[0] % 28), (9, 4));
        let last = *bright.last().unwrap();
        assert_eq!((last / 28, last % 28, bright.len()), (18, 23, 200));
        // On its own ground nothing stands out.
        let error = plan(Fitted::Content, false)
            .apply(&grey, &facts)
            .unwrap_err();
        assert!(error.contains("brighter than its border"), "{error}");
    }

    #[test]
    fn a_whole_picture_keeps_its_proportions_and_a_small_one_its_pixels() {
        let grey = drawn(100, 200, |row, column| (row + column % 3) as u8);
        let facts = Facts::of(&grey).unwrap();
        assert_eq!(fitting(&[facts]), Fitted::Whole);
        let made = plan(Fitted::Whole, false).apply(&grey, &facts).unwrap();
        let filled = (0..28).filter(|row| {
            made[row * 28..(row + 1) * 28]
                .iter()
                .any(|pixel| *pixel > 0)
        });
        assert_eq!(filled.count(), 14);
        let small = drawn(9, 12, |row, column| (row * column) as u8);
        let facts = Facts::of(&small).unwrap();
        assert_eq!(fitting(&[facts, facts]), Fitted::Kept);
        assert_eq!(
            plan(Fitted::Kept, false).apply(&small, &facts).unwrap(),
            small.pixels
        );
    }

    #[test]
    fn thin_pictures_have_a_border_and_fit_in() {
        for (height, width) in [(1, 2), (2, 1), (1, 300), (300, 1), (2, 2)] {
            let grey = drawn(
                height,
                width,
                |row, column| if row + column == 0 { 255 } else { 0 },
            );
            let facts = Facts::of(&grey).unwrap();
            for fit in [Fitted::Whole, Fitted::Content, Fitted::Kept] {
                let _ = plan(fit, true).apply(&grey, &facts);
                let _ = plan(fit, false).apply(&grey, &facts);
            }
        }
        assert!(Facts::of(&drawn(3, 3, |_, _| 7)).is_err());
    }
}
