//! Terrain in files: objects of fixed cells.

use crate::base::error::Error;
use crate::sim::{Start, System, Terrain, World};
use crate::task::protocol::{MAX_COLUMN, MAX_ROW};
use schemars::JsonSchema;
use serde::de::{DeserializeOwned, Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

/// Most objects of a terrain, and most rows of one.
const MOST: usize = 1000;

/// An object of fixed cells, as scenarios hold it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TerrainObject {
    /// Column of its lower left cell.
    pub column: i64,
    /// Row of its lower left cell; the floor lies below row 0.
    pub row: u32,
    /// Rows from the top, as EvoGym's numbers: 5 a fixed cell, 0 none.
    #[serde(deserialize_with = "at_most_a_thousand")]
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

/// Reads a list, and refuses one that is too long while it is read.
pub(crate) fn at_most_a_thousand<'de, D, T>(reader: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: DeserializeOwned,
{
    struct Items<T>(PhantomData<T>);
    impl<'de, T: DeserializeOwned> Visitor<'de> for Items<T> {
        type Value = Vec<T>;
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a list")
        }
        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<T>, A::Error> {
            let mut items = Vec::new();
            while let Some(item) = list.next_element()? {
                if items.len() == MOST {
                    return Err(A::Error::custom(format!("expected at most {MOST}")));
                }
                items.push(item);
            }
            Ok(items)
        }
    }
    reader.deserialize_seq(Items(PhantomData))
}

/// Builds the terrain of some objects.
///
/// # Errors
/// Returns an error that names the object if a grid is wrong, or the terrain is refused.
pub fn built(objects: &[TerrainObject]) -> Result<Arc<Terrain>, Error> {
    if objects.is_empty() {
        return Err(Error::input(
            "terrain: expected at least one object".to_string(),
        ));
    }
    for (number, object) in objects.iter().enumerate() {
        let refuse = |text: String| Err(Error::input(format!("terrain[{number}].{text}")));
        let columns = -MAX_COLUMN..=MAX_COLUMN;
        if !columns.contains(&object.column) {
            return refuse(format!("column: expected −{MAX_COLUMN} to {MAX_COLUMN}"));
        }
        if object.row > MAX_ROW {
            return refuse(format!("row: {}, expected 0 to {MAX_ROW}", object.row));
        }
        let [width, _] = object.size();
        if width == 0 {
            return refuse("grid: expected at least one cell".to_string());
        }
        for (row, cells) in object.grid.iter().enumerate() {
            if !cells.bytes().all(|cell| matches!(cell, b'0' | b'5')) {
                return refuse(format!("grid[{row}]: expected 0 (none) and 5 (fixed) only"));
            }
            if cells.len() != width {
                let found = cells.len();
                return refuse(format!(
                    "grid[{row}]: {found} cells, expected {width} as in the row above"
                ));
            }
        }
    }
    simulated(objects)
}

/// STUB
fn simulated(_: &[TerrainObject]) -> Result<Arc<Terrain>, Error> {
    Ok(Arc::new(Terrain))
}

/// Places a robot at rest on terrain.
///
/// # Errors
/// Returns an error if it has no room there.
pub fn placed(
    system: impl Into<Arc<System>>,
    start: Start,
    terrain: Arc<Terrain>,
) -> Result<World, Error> {
    World::on_terrain(system, start, terrain)
        .map_err(|error| Error::input(format!("terrain: {error}")))
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
