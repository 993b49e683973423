//! The contact sheet (`morphcog data sheet`): images side by side, for inspection by eye.

use crate::base::Grid;
use crate::base::files::write_atomically;
use crate::data::dataset::{Dataset, DatasetError, Split};
use crate::task::stimulus::averaged;
use std::io;
use std::path::{Path, PathBuf};
use tiny_skia::{IntSize, Pixmap};

/// The picture's pixels per pixel of a small image, and the minimum side of a large one.
const SCALE: usize = 3;
/// The longest side of an image in the picture, pixels.
const LONGEST: usize = 256;
/// The gap between images and around them, pixels.
const GAP: usize = 4;
/// The grey of the gaps.
const PAPER: u8 = 96;
/// The longest side of a picture, pixels.
const MAX_SIDE: usize = 16_384;

#[derive(Debug, thiserror::Error)]
pub(crate) enum SheetError {
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The sheet would be empty or too large.
    #[error(
        "a sheet of {classes} classes with {samples} images each has no sensible size: expected 1 to {MAX_SIDE} \
         pixels in each direction, found {height} × {width}"
    )]
    Size {
        /// The number of rows of the sheet, one per class.
        classes: usize,
        /// The number of columns.
        samples: usize,
        height: usize,
        width: usize,
    },
    #[error("the contact sheet cannot be made into a PNG: {0}")]
    Png(String),
    #[error("{}: cannot be written: {source}", file.display())]
    Write {
        file: PathBuf,
        /// The error from the operating system.
        source: io::Error,
    },
}

/// Draws the first `samples` images of every class of a split, one class per row; grey, 0 is black.
/// Small images are enlarged three times, larger ones twice or not at all. Even larger ones shrink
/// until their longest side has 256 pixels.
pub(crate) fn contact_sheet(
    dataset: &Dataset,
    split: Split,
    samples: usize,
) -> Result<Grid<u8>, SheetError> {
    let classes = dataset.classes(split);
    let [rows, columns] = dataset.size(split).map_or([0, 0], shown);
    let [tall, wide] = [rows + GAP, columns + GAP];
    let side = |count: usize, size: usize| count.saturating_mul(size).saturating_add(GAP);
    let (height, width) = (side(classes.len(), tall), side(samples, wide));
    if classes.is_empty() || samples == 0 || height.max(width) > MAX_SIDE {
        return Err(SheetError::Size {
            classes: classes.len(),
            samples,
            height,
            width,
        });
    }
    let mut sheet = Grid::filled(height, width, PAPER);
    for (row, &class) in classes.iter().enumerate() {
        for (column, &index) in dataset
            .indices_of(split, class)
            .iter()
            .take(samples)
            .enumerate()
        {
            let image = dataset.image(split, index)?;
            for ((r, c), &grey) in averaged(&image, rows, columns).iter() {
                sheet[(GAP + row * tall + r, GAP + column * wide + c)] = grey.round() as u8;
            }
        }
    }
    Ok(sheet)
}

/// Returns the height and width in the picture of images of this size.
fn shown([height, width]: [usize; 2]) -> [usize; 2] {
    let longest = height.max(width).max(1);
    [height, width].map(|side| match LONGEST / longest {
        0 => (side * LONGEST / longest).max(SCALE),
        scale => side * scale.min(SCALE),
    })
}

/// Writes a grey picture as PNG, atomically.
pub(crate) fn write_png(file: &Path, picture: &Grid<u8>) -> Result<(), SheetError> {
    let bytes = png(picture)?;
    write_atomically(file, &bytes).map_err(|source| SheetError::Write {
        file: file.to_path_buf(),
        source,
    })
}

pub(crate) fn png(picture: &Grid<u8>) -> Result<Vec<u8>, SheetError> {
    let error = |what: &dyn std::fmt::Display| SheetError::Png(what.to_string());
    let size = u32::try_from(picture.width())
        .ok()
        .zip(u32::try_from(picture.height()).ok());
    let size = size.and_then(|(width, height)| IntSize::from_wh(width, height));
    let rgba = picture
        .cells()
        .iter()
        .flat_map(|&grey| [grey, grey, grey, 255])
        .collect();
    let pixmap = size
        .and_then(|size| Pixmap::from_vec(rgba, size))
        .ok_or_else(|| error(&"too large"))?;
    pixmap.encode_png().map_err(|e| error(&e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::builtin::BuiltinDigits;
    use crate::data::files::places;
    use crate::data::idx;

    #[test]
    fn a_sheet_has_a_row_per_class_and_a_column_per_sample() {
        let digits = BuiltinDigits {
            classes: vec![7, 2],
            ..BuiltinDigits::default()
        };
        let data = Dataset::builtin(digits, &[Split::Test]).unwrap();
        let sheet = contact_sheet(&data, Split::Test, 3).unwrap();
        assert_eq!((sheet.height(), sheet.width()), (2 * 88 + 4, 3 * 88 + 4));
        // Rows are in ascending order of class: the sevens, at even indices, come second.
        let image = data.image(Split::Test, 4).unwrap();
        assert!(
            image
                .iter()
                .all(|((r, c), &v)| sheet[(92 + 3 * r, 180 + 3 * c)] == v)
        );
        assert_eq!(sheet[(0, 0)], PAPER);
    }

    #[test]
    fn images_of_any_size_fit_in() {
        assert_eq!(shown([28, 28]), [84, 84]);
        assert_eq!(shown([100, 20]), [200, 40]);
        assert_eq!(shown([200, 256]), [200, 256]);
        assert_eq!(shown([600, 800]), [192, 256]);
        assert_eq!(shown([1, 784]), [3, 256]);
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, sizes: &[u32], values: Vec<u8>| {
            std::fs::write(
                folder.path().join(name),
                [idx::header(sizes), values].concat(),
            )
            .unwrap();
        };
        // White on the left, black on the right.
        let image: Vec<u8> = (0..600 * 800)
            .map(|i| if i % 800 < 400 { 255 } else { 0 })
            .collect();
        write("train-images-idx3-ubyte", &[2, 600, 800], image.repeat(2));
        write("train-labels-idx1-ubyte", &[2], vec![0, 9]);
        let data = Dataset::load(
            "own",
            &places(Some(folder.path()), None, None),
            &[Split::Train],
        )
        .unwrap();
        let sheet = contact_sheet(&data, Split::Train, 16).unwrap();
        assert_eq!((sheet.height(), sheet.width()), (2 * 196 + 4, 16 * 260 + 4));
        assert_eq!([sheet[(100, 4 + 127)], sheet[(100, 4 + 128)]], [255, 0]);
        let error = contact_sheet(&data, Split::Train, 100)
            .unwrap_err()
            .to_string();
        assert!(error.contains("found 396 × 26004"), "{error}");
    }

    #[test]
    fn sheets_of_no_sensible_size_are_refused() {
        let data = Dataset::load("builtin", &[], &[Split::Train]).unwrap();
        assert!(matches!(
            contact_sheet(&data, Split::Train, 0),
            Err(SheetError::Size { .. })
        ));
        assert!(matches!(
            contact_sheet(&data, Split::Train, usize::MAX),
            Err(SheetError::Size { .. })
        ));
        assert!(matches!(
            contact_sheet(&data, Split::Test, 1),
            Err(SheetError::Size { .. })
        ));
    }

    #[test]
    fn the_png_holds_the_picture() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("sheet.png");
        let picture = Grid::from_fn(5, 7, |r, c| (30 * r + c) as u8);
        write_png(&file, &picture).unwrap();
        let read = Pixmap::load_png(&file).unwrap();
        assert_eq!((read.width(), read.height()), (7, 5));
        assert!(
            read.pixels()
                .iter()
                .zip(picture.cells())
                .all(|(p, &g)| p.red() == g && p.alpha() == 255)
        );
        let error = write_png(&folder.path().join("no/sheet.png"), &picture).unwrap_err();
        assert!(error.to_string().contains("no/sheet.png"), "{error}");
    }
}
