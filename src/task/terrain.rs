//! Terrain in files: objects of fixed cells.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An object of fixed cells, as scenarios hold it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TerrainObject {
    /// Column of its lower left cell.
    pub column: i64,
    /// Row of its lower left cell; the floor lies below row 0.
    pub row: u32,
    /// Rows from the top, as EvoGym's numbers: 5 a fixed cell, 0 none.
    pub grid: Vec<String>,
}

impl TerrainObject {
    /// Returns true for a cell that is fixed, by its column and row in the world.
    pub(crate) fn is_fixed(&self, [column, row]: [i64; 2]) -> bool {
        let down = i64::from(self.row) + self.grid.len() as i64 - 1 - row;
        let cell = usize::try_from(down).ok().and_then(|down| {
            let right = usize::try_from(column.checked_sub(self.column)?).ok()?;
            self.grid.get(down)?.as_bytes().get(right)
        });
        cell == Some(&b'5')
    }

    /// Returns the number of columns and rows.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.grid.first().map_or(0, String::len), self.grid.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_the_grid_go_down_from_the_top_and_rows_of_the_world_up() {
        let stairs = TerrainObject {
            column: 3,
            row: 2,
            grid: vec!["005".to_string(), "055".to_string()],
        };
        let fixed: Vec<[i64; 2]> = (0..6)
            .flat_map(|row| (0..9).map(move |column| [column, row]))
            .filter(|cell| stairs.is_fixed(*cell))
            .collect();
        assert_eq!(fixed, [[4, 2], [5, 2], [5, 3]]);
        assert_eq!(stairs.size(), [3, 2]);
        assert!(!stairs.is_fixed([i64::MIN, i64::MAX]));
    }
}
