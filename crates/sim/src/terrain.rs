//! [`Terrain`]: fixed cells on which a robot stands, instead of flat ground (physics.md, "Terrain").

use crate::grid::Grid;
use crate::step::geometry::Bounds;

/// Most columns and rows of a terrain.
const MOST_SIDE: u32 = 100_000;

/// Most cells of the box around a terrain.
const MOST_CELLS: u64 = 1 << 22;

/// An object of fixed cells in the grid of the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TerrainObject {
    /// Column of its box's left edge \[voxels\].
    pub column: u32,
    /// Row of its box's lower edge \[voxels\]; row 0 lies on the floor plane.
    pub row: u32,
    /// Its cells, row 0 on top: true is fixed, false empty.
    pub cells: Grid<bool>,
}

/// The reason why objects are no terrain. Objects are numbered from 0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TerrainError {
    /// An object has no cell.
    #[error("object {0} of the terrain has no cell")]
    Empty(usize),
    /// The cells of an object do not all hang together through their sides.
    #[error("object {0} of the terrain is in several pieces; expected one object for each")]
    Pieces(usize),
    /// Two objects have a cell in common.
    #[error("objects {first} and {second} of the terrain overlap at column {column}, row {row}")]
    Overlap {
        /// The earlier object.
        first: usize,
        /// The later object.
        second: usize,
        /// Column of the cell.
        column: u32,
        /// Row of the cell, from the floor plane.
        row: u32,
    },
    /// The terrain is too large.
    #[error("the terrain reaches over {columns} columns and {rows} rows, which is too much")]
    TooLarge {
        /// Columns of the box around all objects.
        columns: u64,
        /// Rows of the box around all objects.
        rows: u64,
    },
}

/// A surface cell: a cell with a side that no cell of its object covers. Others touch nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    /// True for each side on the surface: top, right, bottom, left.
    pub exposed: [bool; 4],
    /// Places of its left and right side from column 0 \[wu\].
    pub left: f64,
    pub right: f64,
    /// Heights of its top and bottom \[wu\].
    pub top: f64,
    pub bottom: f64,
}

/// A cell of an object, on the surface or within.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Empty,
    Within,
    Surface(Cell),
}

/// Fixed cells of any number of objects. They never move, and touch robots only.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// Column and row of the lower left cell of the box around all objects.
    origin: (i64, i64),
    columns: usize,
    rows: usize,
    /// The cells of the box, row-major from the lower left.
    cells: Vec<Place>,
    objects: Vec<TerrainObject>,
}

/// The ground of a robot, and its start on it.
#[derive(Clone, Copy)]
pub(crate) struct Ground<'a> {
    /// `None` is flat ground.
    pub terrain: Option<&'a Terrain>,
    /// Column of the body's left edge, where local x is 0.
    pub start_column: i64,
}

/// Returns the height of a grid line of an object, as EvoGym rounds it: `j` rows below the top.
pub(crate) fn height(row: f64, rows: usize, j: usize, cell_size: f64) -> f64 {
    (row * cell_size + rows as f64 * cell_size) - j as f64 * cell_size
}

impl Terrain {
    /// Makes a terrain of objects, as EvoGym does: each has its own surface, also where it touches
    /// another. `cell_size` \[wu\] is that of the physics.
    ///
    /// # Errors
    /// Returns a [`TerrainError`] if an object is empty or in pieces, if two overlap, or if the
    /// terrain is too large.
    pub fn new(objects: &[TerrainObject], cell_size: f64) -> Result<Self, TerrainError> {
        let ends = |object: &TerrainObject| {
            let (height, width) = (object.cells.height() as u64, object.cells.width() as u64);
            (
                u64::from(object.column) + width,
                u64::from(object.row) + height,
            )
        };
        let left = objects
            .iter()
            .map(|object| object.column)
            .min()
            .unwrap_or(0);
        let low = objects.iter().map(|object| object.row).min().unwrap_or(0);
        let right = objects
            .iter()
            .map(|object| ends(object).0)
            .max()
            .unwrap_or(0);
        let high = objects
            .iter()
            .map(|object| ends(object).1)
            .max()
            .unwrap_or(0);
        let (columns, rows) = (right - u64::from(left), high - u64::from(low));
        if left.max(low) > MOST_SIDE
            || columns.max(rows) > u64::from(MOST_SIDE)
            || columns * rows > MOST_CELLS
        {
            return Err(TerrainError::TooLarge { columns, rows });
        }
        let mut terrain = Terrain {
            origin: (i64::from(left), i64::from(low)),
            columns: columns as usize,
            rows: rows as usize,
            cells: vec![Place::Empty; (columns * rows) as usize],
            objects: objects.to_vec(),
        };
        let mut owners = vec![None; terrain.cells.len()];
        for (number, object) in objects.iter().enumerate() {
            check_pieces(number, &object.cells)?;
            for ((row, column), _) in object.cells.iter().filter(|(_, is_fixed)| **is_fixed) {
                let place = (
                    object.column + column as u32,
                    object.row + (object.cells.height() - 1 - row) as u32,
                );
                let index = terrain.index(i64::from(place.0), i64::from(place.1));
                let index = index.expect("the box is around all objects");
                if let Some(first) = owners[index].replace(number) {
                    return Err(TerrainError::Overlap {
                        first,
                        second: number,
                        column: place.0,
                        row: place.1,
                    });
                }
                terrain.cells[index] = cell(object, (row, column), cell_size);
            }
        }
        Ok(terrain)
    }

    /// Returns its objects.
    pub fn objects(&self) -> &[TerrainObject] {
        &self.objects
    }

    /// Returns true if a cell is fixed; rows count from the floor plane.
    pub fn is_fixed(&self, column: i64, row: i64) -> bool {
        self.index(column, row)
            .is_some_and(|index| self.cells[index] != Place::Empty)
    }

    fn index(&self, column: i64, row: i64) -> Option<usize> {
        let column = column.checked_sub(self.origin.0)?;
        let row = row.checked_sub(self.origin.1)?;
        let inside =
            (0..self.columns as i64).contains(&column) && (0..self.rows as i64).contains(&row);
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// Calls `visit` with the surface cells whose places come within a box
    /// \[wu\], absolute columns, widened by `slack`; row by row from below.
    #[inline]
    pub(crate) fn near(
        &self,
        bounds: &Bounds,
        start_column: i64,
        (cell_size, slack): (f64, f64),
        mut visit: impl FnMut(&Cell),
    ) {
        // One more on each side, for the rounding of coordinates.
        let range = |low: f64, high: f64, shift: i64, origin: i64, count: usize| {
            let first = (((low - slack) / cell_size).floor() as i64).saturating_sub(1);
            let last = (((high + slack) / cell_size).floor() as i64).saturating_add(1);
            let (first, last) = (first.saturating_add(shift), last.saturating_add(shift));
            first.max(origin)..=last.min(origin + count as i64 - 1)
        };
        let (column, row) = self.origin;
        for y in range(bounds.low.y, bounds.high.y, 0, row, self.rows) {
            let line = (y - row) as usize * self.columns;
            for x in range(
                bounds.low.x,
                bounds.high.x,
                start_column,
                column,
                self.columns,
            ) {
                if let Place::Surface(cell) = &self.cells[line + (x - column) as usize] {
                    visit(cell);
                }
            }
        }
    }
}

/// Refuses an object without a cell, or in several pieces.
fn check_pieces(number: usize, cells: &Grid<bool>) -> Result<(), TerrainError> {
    let is_fixed = |(_, is_fixed): &((usize, usize), &bool)| **is_fixed;
    let Some((first, _)) = cells.iter().find(is_fixed) else {
        return Err(TerrainError::Empty(number));
    };
    let mut reached = Grid::filled(cells.height(), cells.width(), false);
    let (mut open, mut count) = (vec![first], 0);
    reached[first] = true;
    while let Some((row, column)) = open.pop() {
        count += 1;
        for (down, right) in [(0, 1), (1, 0), (0, -1), (-1, 0)] {
            let (row, column) = (row as isize + down, column as isize + right);
            if cells.get(row, column) == Some(&true) {
                let next = (row as usize, column as usize);
                if !std::mem::replace(&mut reached[next], true) {
                    open.push(next);
                }
            }
        }
    }
    match count == cells.iter().filter(is_fixed).count() {
        true => Ok(()),
        false => Err(TerrainError::Pieces(number)),
    }
}

fn cell(object: &TerrainObject, (row, column): (usize, usize), cell_size: f64) -> Place {
    let cells = &object.cells;
    let exposed = [(-1, 0), (0, 1), (1, 0), (0, -1)].map(|(down, right)| {
        cells.get(row as isize + down, column as isize + right) != Some(&true)
    });
    if !exposed.contains(&true) {
        return Place::Within;
    }
    let height = |j: usize| height(f64::from(object.row), cells.height(), j, cell_size);
    // Rounded as EvoGym does: the last bit decides whether a body between two walls touches both.
    let side = |i: usize| f64::from(object.column) * cell_size + i as f64 * cell_size;
    Place::Surface(Cell {
        exposed,
        left: side(column),
        right: side(column + 1),
        top: height(row),
        bottom: height(row + 1),
    })
}
