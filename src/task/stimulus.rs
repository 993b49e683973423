//! From image to stimulus: reduction to the body's grid, then encoding (paper, "Task").

use crate::base::Grid;
use crate::body::MAX_SIDE;
use crate::task::margins::Margins;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// The reduction of an image to the body's grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reduction {
    /// Every s-th row and column, as in the paper; the body's sides must divide the image's.
    ///
    /// These are 0, s, 2s, …; s = 2 takes 28 × 28 to 14 × 14. Rows and columns each have their own
    /// s.
    #[default]
    Stride,
    /// The mean of the raw pixels under each voxel, for bodies of any size.
    ///
    /// Pixels cut by a voxel's edges count by the area inside. The mean is encoded, not the pixels.
    Area,
}

/// The encoding of a pixel value as a stimulus in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Value / 255 (the paper's text).
    #[default]
    Intensity,
    /// 1 for any value above 0 (the paper's published robots).
    Saturated,
    /// 1 if value / 255 is above `level`, else 0.
    Threshold,
}

/// From image to stimulus; keys of a config's section `[stimulus]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StimulusParams {
    /// From an image to the body's grid. Default stride.
    pub reduction: Reduction,
    /// From a pixel (0 to 255) to a stimulus. Default intensity.
    pub encoding: Encoding,
    /// For `threshold`, from 0 to below 1. Default 0.5.
    pub level: f64,
    /// Pixels left out at the edges before the reduction: a number, or `[top, right, bottom, left]`.
    /// What is left is the *window*. Default 0.
    ///
    /// MNIST's digits lie in the middle 20 × 20 of 28 × 28 pixels: with 4, sensors at the sides of a
    /// body also cover a part of them.
    #[serde(skip_serializing_if = "Margins::is_none")]
    pub margin: Margins,
}

impl Default for StimulusParams {
    fn default() -> Self {
        StimulusParams {
            reduction: Reduction::Stride,
            encoding: Encoding::Intensity,
            level: 0.5,
            margin: Margins::default(),
        }
    }
}

impl StimulusParams {
    /// Combines bodies' parameters: the first's, with all margins' least, and by areas if changed.
    pub(crate) fn together(all: impl IntoIterator<Item = StimulusParams>) -> Option<Self> {
        let least = |first: Self, other: Self| match first.margin.least(&other.margin) {
            own if own == first.margin => first,
            margin => StimulusParams {
                margin,
                reduction: Reduction::Area,
                ..first
            },
        };
        all.into_iter().reduce(least)
    }

    /// Describes the part of an image of this height and width that a body covers.
    pub(crate) fn part(&self, [height, width]: [usize; 2]) -> String {
        let whole = format!("{height} × {width} pixels");
        match (self.margin.is_none(), self.margin.left_of([height, width])) {
            (true, _) => format!("all {whole}"),
            (false, Some([rows, columns])) => {
                format!(
                    "{rows} × {columns} of {whole} (stimulus.margin = {})",
                    self.margin
                )
            }
            (false, None) => format!("none of {whole} (stimulus.margin = {})", self.margin),
        }
    }

    /// Checks that the level is in [0, 1).
    pub(crate) fn validate(&self) -> Result<(), StimulusError> {
        (0.0..1.0)
            .contains(&self.level)
            .then_some(())
            .ok_or(StimulusError::Level(self.level))
    }
}

/// The reason why this image, body size and encoding give no stimulus.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StimulusError {
    /// The body has no rows or no columns.
    #[error(
        "a body of {height} x {width} voxels has no place for a stimulus; both sides must be at least 1"
    )]
    Empty {
        /// Rows of the body.
        height: usize,
        /// Columns of the body.
        width: usize,
    },
    /// The body has more rows or columns than allowed.
    #[error("a body of {height} x {width} voxels: expected at most {MAX_SIDE} rows and columns")]
    TooLarge {
        /// Rows of the body.
        height: usize,
        /// Columns of the body.
        width: usize,
    },
    /// The image has no rows or no columns of pixels.
    #[error("an image of {height} x {width} pixels shows nothing; both sides must be at least 1")]
    NoPixels {
        /// Its rows.
        height: usize,
        /// Its columns.
        width: usize,
    },
    /// Keeping every s-th row and column needs sides that divide the image's.
    #[error(
        "the body's {axis} ({body}) do not divide the image's ({image}), so no stride takes one to the other; \
         use the reduction \"area\" or another body size"
    )]
    Stride {
        /// "rows" or "columns".
        axis: &'static str,
        /// The body's number of them.
        body: usize,
        /// The image's number of them.
        image: usize,
    },
    /// Nothing is left between the margins.
    #[error(
        "a margin of {margin} leaves nothing of {height} x {width} pixels; the sum of opposite margins must be \
         less than a side, and with 0 the whole image is seen"
    )]
    Margin {
        /// Pixels at the edges.
        margin: Margins,
        /// Rows of the image.
        height: usize,
        /// Columns of the image.
        width: usize,
    },
    /// A threshold that no pixel or every pixel would pass.
    #[error("the threshold's level is {0}, expected a number from 0 up to but below 1")]
    Level(f64),
}

impl StimulusError {
    /// Returns the key of the config to change.
    pub fn key(&self) -> &'static str {
        match self {
            StimulusError::Empty { .. } | StimulusError::TooLarge { .. } => "body",
            StimulusError::NoPixels { .. } => "data",
            StimulusError::Stride { .. } => "stimulus.reduction",
            StimulusError::Margin { .. } => "stimulus.margin",
            StimulusError::Level(_) => "stimulus.level",
        }
    }
}

/// Returns the stimulus of an image for a body of height × width voxels: one value in [0, 1] per
/// voxel, row 0 on top.
///
/// # Errors
/// Returns a [`StimulusError`] if the sizes do not fit, or if a threshold is out of range.
pub fn stimulus(
    image: &Grid<u8>,
    height: usize,
    width: usize,
    params: &StimulusParams,
) -> Result<Grid<f64>, StimulusError> {
    if height == 0 || width == 0 {
        return Err(StimulusError::Empty { height, width });
    }
    if height.max(width) > MAX_SIDE {
        return Err(StimulusError::TooLarge { height, width });
    }
    if image.height() == 0 || image.width() == 0 {
        return Err(StimulusError::NoPixels {
            height: image.height(),
            width: image.width(),
        });
    }
    params.validate()?;
    let middle = match params.margin {
        margin if margin.is_none() => Cow::Borrowed(image),
        margin => {
            let (height, width) = (image.height(), image.width());
            Cow::Owned(margin.cut(image).ok_or(StimulusError::Margin {
                margin,
                height,
                width,
            })?)
        }
    };
    let reduced = match params.reduction {
        Reduction::Stride => strided(&middle, height, width)?,
        Reduction::Area => averaged(&middle, height, width),
    };
    Ok(reduced.map(|&value| match params.encoding {
        Encoding::Intensity => value / 255.0,
        Encoding::Saturated => f64::from(value > 0.0),
        Encoding::Threshold => f64::from(value / 255.0 > params.level),
    }))
}

fn strided(image: &Grid<u8>, height: usize, width: usize) -> Result<Grid<f64>, StimulusError> {
    let stride = |axis, body, image: usize| {
        image
            .is_multiple_of(body)
            .then_some(image / body)
            .ok_or(StimulusError::Stride { axis, body, image })
    };
    let rows = stride("rows", height, image.height())?;
    let columns = stride("columns", width, image.width())?;
    Ok(Grid::from_fn(height, width, |r, c| {
        f64::from(image[(r * rows, c * columns)])
    }))
}

/// Reduces the image to another size by area-weighted means, 0 … 255. In units of 1/height of a
/// pixel, all overlaps are whole numbers, and the division per voxel is the only rounding.
pub(crate) fn averaged(image: &Grid<u8>, height: usize, width: usize) -> Grid<f64> {
    let overlap = |voxel: usize, voxel_side: usize, pixel: usize, pixel_side: usize| {
        let end = ((voxel + 1) * voxel_side).min((pixel + 1) * pixel_side);
        end - (voxel * voxel_side).max(pixel * pixel_side)
    };
    let (tall, wide) = (image.height(), image.width());
    Grid::from_fn(height, width, |r, c| {
        let mut sum = 0u64;
        for pixel_row in r * tall / height..((r + 1) * tall).div_ceil(height) {
            for pixel_column in c * wide / width..((c + 1) * wide).div_ceil(width) {
                let area =
                    overlap(r, tall, pixel_row, height) * overlap(c, wide, pixel_column, width);
                sum += u64::from(image[(pixel_row, pixel_column)]) * area as u64;
            }
        }
        sum as f64 / (tall * wide) as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use Encoding::{Intensity, Saturated, Threshold};
    use Reduction::{Area, Stride};

    fn params(reduction: Reduction, encoding: Encoding) -> StimulusParams {
        StimulusParams {
            reduction,
            encoding,
            ..StimulusParams::default()
        }
    }

    fn ramp(height: usize, width: usize) -> Grid<u8> {
        Grid::from_fn(height, width, |r, c| (9 * r + c) as u8)
    }

    #[test]
    fn stride_keeps_rows_and_columns_0_2_4() {
        let image = ramp(28, 28);
        let grid = stimulus(&image, 14, 14, &params(Stride, Intensity)).unwrap();
        assert!(
            grid.iter()
                .all(|((r, c), &v)| v == f64::from(image[(2 * r, 2 * c)]) / 255.0)
        );
        let uneven = stimulus(&image, 28, 7, &params(Stride, Intensity)).unwrap();
        assert_eq!(uneven[(27, 6)], f64::from(image[(27, 24)]) / 255.0);
    }

    #[test]
    fn stride_refuses_sides_that_do_not_divide_and_names_the_way_out() {
        let error = stimulus(&ramp(28, 28), 14, 13, &params(Stride, Intensity)).unwrap_err();
        assert_eq!(
            error,
            StimulusError::Stride {
                axis: "columns",
                body: 13,
                image: 28
            }
        );
        assert!(error.to_string().contains("area"), "{error}");
        assert!(stimulus(&ramp(28, 28), 56, 14, &params(Stride, Intensity)).is_err());
        assert!(stimulus(&ramp(28, 28), 0, 14, &params(Area, Intensity)).is_err());
        let error = stimulus(&ramp(28, 28), 1 << 58, 28, &params(Area, Intensity)).unwrap_err();
        assert_eq!(
            error,
            StimulusError::TooLarge {
                height: 1 << 58,
                width: 28
            }
        );
    }

    #[test]
    fn encodings_are_the_papers() {
        let image = Grid::from_rows(vec![vec![0, 1, 128, 255]]).unwrap();
        let cells = |encoding| {
            stimulus(&image, 1, 4, &params(Stride, encoding))
                .unwrap()
                .cells()
                .to_vec()
        };
        let above = |level| StimulusParams {
            level,
            ..params(Stride, Threshold)
        };
        assert_eq!(cells(Intensity), [0.0, 1.0 / 255.0, 128.0 / 255.0, 1.0]);
        assert_eq!(cells(Saturated), [0.0, 1.0, 1.0, 1.0]);
        assert_eq!(cells(Threshold), [0.0, 0.0, 1.0, 1.0]);
        let exact = stimulus(&image, 1, 4, &above(128.0 / 255.0)).unwrap();
        assert_eq!(exact.cells(), [0.0, 0.0, 0.0, 1.0]);
        for level in [1.0, -0.1, f64::NAN] {
            assert!(stimulus(&image, 1, 4, &above(level)).is_err());
        }
    }

    #[test]
    fn area_averaging_is_exact_and_keeps_the_mean() {
        let quarter = Grid::from_rows(vec![vec![0, 255], vec![0, 1]]).unwrap();
        assert_eq!(
            stimulus(&quarter, 1, 1, &params(Area, Intensity))
                .unwrap()
                .cells(),
            [256.0 / 4.0 / 255.0]
        );
        // The mean is encoded, not the pixels: 64/255 exceeds 0.25, as only one pixel does.
        let above = |level| {
            let params = StimulusParams {
                level,
                ..params(Area, Threshold)
            };
            stimulus(&quarter, 1, 1, &params).unwrap()[(0, 0)]
        };
        assert_eq!((above(0.25), above(0.26)), (1.0, 0.0));
        // Three pixels on two voxels: the middle one is shared half and half.
        let thirds = Grid::from_rows(vec![vec![30, 60, 90]]).unwrap();
        assert_eq!(
            stimulus(&thirds, 1, 2, &params(Area, Intensity))
                .unwrap()
                .cells(),
            [40.0 / 255.0, 80.0 / 255.0]
        );
        let image = ramp(28, 28);
        let mean = |grid: &Grid<f64>| grid.cells().iter().sum::<f64>() / grid.area() as f64;
        let whole = mean(&stimulus(&image, 28, 28, &params(Area, Intensity)).unwrap());
        for (height, width) in [(1, 1), (5, 13), (14, 14), (27, 3), (40, 56)] {
            let reduced = stimulus(&image, height, width, &params(Area, Intensity)).unwrap();
            assert!((mean(&reduced) - whole).abs() < 1e-12, "{height} x {width}");
        }
    }

    #[test]
    fn area_averaging_by_a_whole_factor_of_one_is_the_image() {
        let image = ramp(7, 9);
        let same = stimulus(&image, 7, 9, &params(Area, Intensity)).unwrap();
        assert_eq!(
            same,
            stimulus(&image, 7, 9, &params(Stride, Intensity)).unwrap()
        );
    }

    #[test]
    fn a_margin_is_cut_off_before_anything_else() {
        let image = ramp(9, 12);
        let middle = Grid::from_fn(5, 8, |r, c| image[(r + 2, c + 2)]);
        for (reduction, width) in [(Area, 3), (Stride, 4)] {
            let whole = params(reduction, Intensity);
            let cut = StimulusParams {
                margin: Margins::same(2),
                ..whole
            };
            assert_eq!(
                stimulus(&image, 5, width, &cut),
                stimulus(&middle, 5, width, &whole)
            );
        }
        for margin in [5, usize::MAX].map(Margins::same) {
            let cut = StimulusParams {
                margin,
                ..params(Area, Intensity)
            };
            let error = stimulus(&image, 3, 3, &cut).unwrap_err();
            assert_eq!(
                error,
                StimulusError::Margin {
                    margin,
                    height: 9,
                    width: 12
                }
            );
        }
        let edge = StimulusParams {
            margin: Margins::same(4),
            ..params(Area, Intensity)
        };
        assert_eq!(stimulus(&image, 1, 1, &edge).unwrap().area(), 1);
    }

    #[test]
    fn the_part_that_is_seen_is_said_in_pixels() {
        let part = |margin| {
            StimulusParams {
                margin,
                ..params(Area, Intensity)
            }
            .part([17, 28])
        };
        assert_eq!(part(Margins::default()), "all 17 × 28 pixels");
        assert_eq!(
            part(Margins::same(4)),
            "9 × 20 of 17 × 28 pixels (stimulus.margin = 4)"
        );
        let uneven = Margins {
            top: 1,
            right: 2,
            bottom: 3,
            left: 4,
        };
        assert_eq!(
            part(uneven),
            "13 × 22 of 17 × 28 pixels (stimulus.margin = [1, 2, 3, 4])"
        );
        assert_eq!(
            part(Margins::same(9)),
            "none of 17 × 28 pixels (stimulus.margin = 9)"
        );
    }

    #[test]
    fn bodies_see_together_what_any_of_them_sees() {
        let [a, b] =
            [[1, 5, 3, 0], [4, 2, 2, 2]].map(|[top, right, bottom, left]| StimulusParams {
                margin: Margins {
                    top,
                    right,
                    bottom,
                    left,
                },
                ..params(Area, Threshold)
            });
        let together = StimulusParams::together([a, StimulusParams { level: 0.2, ..b }]).unwrap();
        assert_eq!(
            together,
            StimulusParams {
                margin: Margins {
                    top: 1,
                    right: 2,
                    bottom: 2,
                    left: 0
                },
                ..a
            }
        );
        assert_eq!(
            (StimulusParams::together([a]), StimulusParams::together([])),
            (Some(a), None)
        );
        // A stride requires its own margin.
        let [whole, cut] = [0, 4].map(|margin| StimulusParams {
            margin: Margins::same(margin),
            ..params(Stride, Intensity)
        });
        assert_eq!(StimulusParams::together([whole, cut]), Some(whole));
        assert_eq!(
            StimulusParams::together([cut, whole]),
            Some(params(Area, Intensity))
        );
    }

    #[test]
    fn configs_name_them_in_lower_case() {
        let read = |text: &str| serde_json::from_str::<StimulusParams>(text).unwrap();
        assert_eq!(read("{}"), StimulusParams::default());
        let threshold = StimulusParams {
            level: 0.25,
            ..params(Stride, Threshold)
        };
        assert_eq!(
            read("{\"encoding\": \"threshold\", \"level\": 0.25}"),
            threshold
        );
        assert_eq!(serde_json::to_string(&Area).unwrap(), "\"area\"");
        let text = |params: &StimulusParams| serde_json::to_string(params).unwrap();
        assert!(!text(&threshold).contains("margin"));
        let cut = StimulusParams {
            margin: Margins::same(4),
            ..threshold
        };
        assert_eq!(read(&text(&cut)), cut);
    }
}
