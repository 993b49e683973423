//! [`Margins`]: the part of an image that a body covers.

use crate::base::Grid;
use schemars::JsonSchema;
use serde::de::{Error, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// Rows and columns of pixels left out at the edges of an image; in files a number for all four, or
/// `[top, right, bottom, left]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, JsonSchema)]
#[schemars(with = "Written")]
pub struct Margins {
    /// Rows left out at the top.
    pub top: usize,
    /// Columns left out on the right.
    pub right: usize,
    /// Rows left out at the bottom.
    pub bottom: usize,
    /// Columns left out on the left.
    pub left: usize,
}

/// The two notations of margins in files.
#[derive(Serialize, JsonSchema)]
#[serde(untagged)]
enum Written {
    /// One number for every edge.
    Same(usize),
    /// Top, right, bottom, left.
    Each([usize; 4]),
}

impl Margins {
    /// Makes equal margins at every edge.
    pub(crate) fn same(margin: usize) -> Self {
        Margins {
            top: margin,
            right: margin,
            bottom: margin,
            left: margin,
        }
    }

    /// Returns true if nothing is left out.
    pub fn is_none(&self) -> bool {
        *self == Margins::default()
    }

    /// Returns the height and width that remain of an image of this size; `None` if nothing does.
    pub(crate) fn left_of(&self, [height, width]: [usize; 2]) -> Option<[usize; 2]> {
        let left = |side: usize, a: usize, b: usize| {
            side.checked_sub(a.checked_add(b)?).filter(|left| *left > 0)
        };
        Some([
            left(height, self.top, self.bottom)?,
            left(width, self.left, self.right)?,
        ])
    }

    /// Returns the part that remains of an image; `None` if nothing does.
    pub(crate) fn cut<T: Clone>(&self, image: &Grid<T>) -> Option<Grid<T>> {
        let [rows, columns] = self.left_of([image.height(), image.width()])?;
        Some(Grid::from_fn(rows, columns, |r, c| {
            image[(r + self.top, c + self.left)].clone()
        }))
    }

    /// Returns the smaller margin at each edge, so that the remaining part contains those of both.
    pub(crate) fn least(&self, other: &Margins) -> Self {
        Margins {
            top: self.top.min(other.top),
            right: self.right.min(other.right),
            bottom: self.bottom.min(other.bottom),
            left: self.left.min(other.left),
        }
    }
}

impl fmt::Display for Margins {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.written() {
            Written::Same(margin) => margin.fmt(f),
            Written::Each([top, right, bottom, left]) => {
                write!(f, "[{top}, {right}, {bottom}, {left}]")
            }
        }
    }
}

impl Margins {
    fn written(&self) -> Written {
        match *self == Margins::same(self.top) {
            true => Written::Same(self.top),
            false => Written::Each([self.top, self.right, self.bottom, self.left]),
        }
    }
}

impl Serialize for Margins {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.written().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Margins {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Reader)
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = Margins;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number of pixels, or [top, right, bottom, left]")
    }

    fn visit_u64<E: Error>(self, margin: u64) -> Result<Margins, E> {
        let pixels = usize::try_from(margin)
            .map_err(|_| E::invalid_value(Unexpected::Unsigned(margin), &self))?;
        Ok(Margins::same(pixels))
    }

    fn visit_i64<E: Error>(self, margin: i64) -> Result<Margins, E> {
        match u64::try_from(margin) {
            Ok(margin) => self.visit_u64(margin),
            Err(_) => Err(E::invalid_value(Unexpected::Signed(margin), &self)),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Margins, A::Error> {
        let mut margins = [0; 4];
        for (place, margin) in margins.iter_mut().enumerate() {
            *margin = list
                .next_element()?
                .ok_or_else(|| A::Error::invalid_length(place, &self))?;
        }
        if list.next_element::<usize>()?.is_some() {
            return Err(A::Error::invalid_length(margins.len() + 1, &self));
        }
        let [top, right, bottom, left] = margins;
        Ok(Margins {
            top,
            right,
            bottom,
            left,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_written_as_one_number_or_as_four() {
        let uneven = Margins {
            top: 1,
            right: 2,
            bottom: 3,
            left: 4,
        };
        for (margins, text) in [
            (Margins::same(5), "5"),
            (Margins::default(), "0"),
            (uneven, "[1,2,3,4]"),
        ] {
            assert_eq!(serde_json::to_string(&margins).unwrap(), text);
            assert_eq!(serde_json::from_str::<Margins>(text).unwrap(), margins);
        }
        assert_eq!(
            serde_json::from_str::<Margins>("[3, 3, 3, 3]").unwrap(),
            Margins::same(3)
        );
        assert_eq!(uneven.to_string(), "[1, 2, 3, 4]");
    }

    #[test]
    fn anything_else_is_refused_by_what_was_expected() {
        for text in [
            "-1",
            "1.5",
            "\"4\"",
            "[1, 2, 3]",
            "[1, 2, 3, 4, 5]",
            "[]",
            "{\"top\": 1}",
        ] {
            let error = serde_json::from_str::<Margins>(text)
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("a number of pixels, or [top, right, bottom, left]"),
                "{text}: {error}"
            );
        }
        assert!(serde_json::from_str::<Margins>("[1, 2, -3, 4]").is_err());
    }

    #[test]
    fn what_is_left_is_what_lies_between_them_or_nothing() {
        let image = Grid::from_fn(5, 7, |r, c| 10 * r + c);
        let left = Margins {
            top: 1,
            right: 3,
            bottom: 2,
            left: 2,
        }
        .cut(&image)
        .unwrap();
        assert_eq!(
            (left.height(), left.width(), left[(0, 0)], left[(1, 1)]),
            (2, 2, 12, 23)
        );
        for margins in [
            [3, 0, 2, 0],
            [0, 4, 0, 3],
            [usize::MAX, 0, 1, 0],
            [0, 9, 0, 0],
        ] {
            let [top, right, bottom, left] = margins;
            assert_eq!(
                Margins {
                    top,
                    right,
                    bottom,
                    left
                }
                .cut(&image),
                None
            );
        }
    }

    #[test]
    fn the_least_of_two_holds_both() {
        let [a, b] = [
            Margins {
                top: 1,
                right: 5,
                bottom: 3,
                left: 0,
            },
            Margins::same(2),
        ];
        assert_eq!(
            a.least(&b),
            Margins {
                top: 1,
                right: 2,
                bottom: 2,
                left: 0
            }
        );
    }
}
