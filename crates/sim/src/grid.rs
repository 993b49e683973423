//! [`Grid`]: the only place that converts between rows, columns and indices.

use std::ops::{Index, IndexMut};

/// A dense matrix in row-major order; row 0 is the top row, column 0 the leftmost.
///
/// In files it is a list of rows of equal length.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(
    feature = "serde",
    serde(into = "Vec<Vec<T>>", bound(serialize = "T: Clone + serde::Serialize"))
)]
pub struct Grid<T> {
    height: usize,
    width: usize,
    cells: Vec<T>,
}

/// Most cells of a grid in a file; bodies, stimuli and drawings have far fewer.
const MOST_CELLS: usize = 1 << 20;

/// The reason why rows do not make a [`Grid`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GridError {
    /// There is no cell at all.
    #[error("expected at least one row with at least one cell, found none")]
    Empty,
    /// There are more cells than any grid in a file needs.
    #[error("expected at most {MOST_CELLS} cells")]
    TooLarge,
    /// A row is longer or shorter than the first.
    #[error("row {row} has {found} cells, expected {expected} as in row 0")]
    Ragged {
        /// Index of the offending row, from 0 at the top.
        row: usize,
        /// Number of its cells.
        found: usize,
        /// Length of row 0.
        expected: usize,
    },
}

impl<T> Grid<T> {
    /// Makes a grid of rows, top row first; all rows must have the same length, which is not 0.
    ///
    /// # Errors
    /// Returns a [`GridError`] if there is no cell, or if a row's length differs from the first's.
    pub fn from_rows(rows: Vec<Vec<T>>) -> Result<Self, GridError> {
        let (height, width) = (rows.len(), rows.first().map_or(0, Vec::len));
        if height == 0 || width == 0 {
            return Err(GridError::Empty);
        }
        if let Some((row, cells)) = rows.iter().enumerate().find(|(_, r)| r.len() != width) {
            let found = cells.len();
            return Err(GridError::Ragged {
                row,
                found,
                expected: width,
            });
        }
        Ok(Grid {
            height,
            width,
            cells: rows.into_iter().flatten().collect(),
        })
    }

    /// Makes a grid whose cell (row, column) is `cell(row, column)`.
    pub fn from_fn(height: usize, width: usize, mut cell: impl FnMut(usize, usize) -> T) -> Self {
        let cells = (0..height * width)
            .map(|i| cell(i / width, i % width))
            .collect();
        Grid {
            height,
            width,
            cells,
        }
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of cells, height × width.
    pub fn area(&self) -> usize {
        self.cells.len()
    }

    /// Returns the cell, or `None` outside; signed indices reach neighbours without checks.
    pub fn get(&self, row: isize, column: isize) -> Option<&T> {
        let (r, c) = (usize::try_from(row).ok()?, usize::try_from(column).ok()?);
        (r < self.height && c < self.width).then(|| &self.cells[r * self.width + c])
    }

    /// Returns all cells in row-major order.
    pub fn cells(&self) -> &[T] {
        &self.cells
    }

    /// Iterates over all cells with their row and column, in row-major order.
    pub fn iter(&self) -> impl Iterator<Item = ((usize, usize), &T)> {
        self.cells
            .iter()
            .enumerate()
            .map(|(i, t)| ((i / self.width, i % self.width), t))
    }

    /// Iterates over the rows, top row first.
    pub fn rows(&self) -> impl Iterator<Item = &[T]> {
        self.cells.chunks(self.width)
    }

    /// Applies `f` to every cell.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Grid<U> {
        Grid {
            height: self.height,
            width: self.width,
            cells: self.cells.iter().map(f).collect(),
        }
    }
}

impl<T: Copy + Default> Grid<T> {
    /// Returns the cell at (row, column), or the default (a dark pixel) outside the grid.
    pub fn or_default(&self, (row, column): (usize, usize)) -> T {
        self.get(row as isize, column as isize)
            .copied()
            .unwrap_or_default()
    }
}

impl<T: Clone> Grid<T> {
    /// Makes a grid with the same value in every cell.
    pub fn filled(height: usize, width: usize, value: T) -> Self {
        Grid {
            height,
            width,
            cells: vec![value; height * width],
        }
    }

    /// Returns the grid mirrored left to right.
    pub fn mirrored(&self) -> Self {
        Grid::from_fn(self.height, self.width, |r, c| {
            self[(r, self.width - 1 - c)].clone()
        })
    }
}

impl<T> Index<(usize, usize)> for Grid<T> {
    type Output = T;
    fn index(&self, (row, column): (usize, usize)) -> &T {
        debug_assert!(row < self.height && column < self.width);
        &self.cells[row * self.width + column]
    }
}

impl<T> IndexMut<(usize, usize)> for Grid<T> {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut T {
        debug_assert!(row < self.height && column < self.width);
        &mut self.cells[row * self.width + column]
    }
}

impl<T: Clone> From<Grid<T>> for Vec<Vec<T>> {
    fn from(grid: Grid<T>) -> Self {
        grid.rows().map(<[T]>::to_vec).collect()
    }
}

#[cfg(feature = "serde")]
mod reading {
    use super::{Grid, GridError, MOST_CELLS};
    use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};
    use std::fmt;
    use std::marker::PhantomData;

    impl<'de, T: Deserialize<'de>> Deserialize<'de> for Grid<T> {
        /// Reads cell by cell, so that endless rows are refused before they fill the memory.
        fn deserialize<D: Deserializer<'de>>(reader: D) -> Result<Self, D::Error> {
            reader.deserialize_seq(Rows(PhantomData))
        }
    }

    struct Rows<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Rows<T> {
        type Value = Grid<T>;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a list of rows of equal length")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut rows: A) -> Result<Grid<T>, A::Error> {
            let (mut cells, mut height, mut width) = (Vec::new(), 0, 0);
            while let Some(found) = rows.next_element_seed(Row(&mut cells))? {
                if height == 0 {
                    width = found;
                }
                if found != width {
                    return Err(A::Error::custom(GridError::Ragged {
                        row: height,
                        found,
                        expected: width,
                    }));
                }
                if found == 0 {
                    return Err(A::Error::custom(GridError::Empty));
                }
                height += 1;
            }
            if height == 0 {
                return Err(A::Error::custom(GridError::Empty));
            }
            Ok(Grid {
                height,
                width,
                cells,
            })
        }
    }

    /// Appends a row to the cells read so far and returns its length.
    struct Row<'c, T>(&'c mut Vec<T>);

    impl<'de, T: Deserialize<'de>> DeserializeSeed<'de> for Row<'_, T> {
        type Value = usize;
        fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<usize, D::Error> {
            reader.deserialize_seq(self)
        }
    }

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Row<'_, T> {
        type Value = usize;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a row, a list of cells")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut row: A) -> Result<usize, A::Error> {
            let before = self.0.len();
            while let Some(cell) = row.next_element()? {
                if self.0.len() == MOST_CELLS {
                    return Err(A::Error::custom(GridError::TooLarge));
                }
                self.0.push(cell);
            }
            Ok(self.0.len() - before)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_different_length_are_refused_with_their_place() {
        let error = Grid::from_rows(vec![vec![1, 2], vec![3]]).unwrap_err();
        assert_eq!(
            error,
            GridError::Ragged {
                row: 1,
                found: 1,
                expected: 2
            }
        );
        assert_eq!(Grid::<u8>::from_rows(vec![]).unwrap_err(), GridError::Empty);
        assert_eq!(
            Grid::<u8>::from_rows(vec![vec![]]).unwrap_err(),
            GridError::Empty
        );
    }

    #[test]
    fn indices_are_row_major_from_the_top_left() {
        let grid = Grid::from_fn(2, 3, |r, c| 10 * r + c);
        assert_eq!(grid.cells(), [0, 1, 2, 10, 11, 12]);
        assert_eq!(grid[(1, 2)], 12);
        assert_eq!(grid.get(1, 2), Some(&12));
        assert_eq!((grid.get(-1, 0), grid.get(0, 3)), (None, None));
        assert_eq!(grid.mirrored().cells(), [2, 1, 0, 12, 11, 10]);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn json_is_a_list_of_rows() {
        let grid = Grid::from_fn(2, 2, |r, c| (r, c));
        let text = serde_json::to_string(&grid).unwrap();
        assert_eq!(text, "[[[0,0],[0,1]],[[1,0],[1,1]]]");
        assert_eq!(
            serde_json::from_str::<Grid<(usize, usize)>>(&text).unwrap(),
            grid
        );
    }

    #[cfg(feature = "serde")]
    #[test]
    fn rows_in_files_are_checked_as_others_and_rows_without_end_are_refused() {
        let error = |text: &str| {
            serde_json::from_str::<Grid<u8>>(text)
                .unwrap_err()
                .to_string()
        };
        assert!(error("[[1,2],[3]]").contains("row 1 has 1 cells, expected 2"));
        assert!(error("[[1],[3,4]]").contains("row 1 has 2 cells, expected 1"));
        for empty in ["[]", "[[]]", "[[],[]]"] {
            assert!(error(empty).contains("found none"), "{empty}");
        }
        assert!(error("[[1],[300]]").contains("300") && error("7").contains("a list of rows"));
        for endless in [
            format!("[{}", "[0],".repeat(MOST_CELLS + 1)),
            format!("[[{}", "0,".repeat(MOST_CELLS + 1)),
        ] {
            assert!(
                error(&endless).contains("at most 1048576 cells"),
                "before its end"
            );
        }
    }
}
