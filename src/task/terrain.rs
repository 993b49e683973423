//! Terrain in files: objects of fixed cells.

use crate::base::Grid;
use crate::base::error::Error;
use crate::sim::{Start, System, Terrain, TerrainObject, World};
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
pub struct FixedObject {
    /// Column of its lower left cell.
    pub column: u32,
    /// Row of its lower left cell; the floor lies below row 0.
    pub row: u32,
    /// Rows from the top, as EvoGym's numbers: 5 a fixed cell, 0 none.
    #[serde(deserialize_with = "at_most_a_thousand")]
    pub grid: Vec<String>,
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

/// Builds the terrain of some objects; `cell_size` \[wu\] is that of the physics.
///
/// # Errors
/// Returns an error that names the object if a grid is wrong, or the terrain is refused.
pub fn built(objects: &[FixedObject], cell_size: f64) -> Result<Arc<Terrain>, Error> {
    if objects.is_empty() {
        return Err(Error::input(
            "terrain: expected at least one object".to_string(),
        ));
    }
    for (number, object) in objects.iter().enumerate() {
        let refuse = |text: String| Err(Error::input(format!("terrain[{number}].{text}")));
        let width = object.grid.first().map_or(0, String::len);
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
    let simulated = |object: &FixedObject| TerrainObject {
        column: object.column,
        row: object.row,
        cells: Grid::from_fn(
            object.grid.len(),
            object.grid.first().map_or(0, String::len),
            |row, column| object.grid[row].as_bytes()[column] == b'5',
        ),
    };
    let objects: Vec<TerrainObject> = objects.iter().map(simulated).collect();
    Terrain::new(&objects, cell_size)
        .map(Arc::new)
        .map_err(|error| Error::input(format!("terrain: {error}")))
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

    fn object(column: u32, row: u32, grid: &[&str]) -> FixedObject {
        let grid = grid.iter().map(|row| row.to_string()).collect();
        FixedObject { column, row, grid }
    }

    #[test]
    fn rows_of_the_grid_go_down_from_the_top_and_rows_of_the_world_up() {
        let stairs = built(&[object(3, 2, &["005", "055"])], 0.1).unwrap();
        let fixed: Vec<[i64; 2]> = (0..6)
            .flat_map(|row| (0..9).map(move |column| [column, row]))
            .filter(|[column, row]| stairs.is_fixed(*column, *row))
            .collect();
        assert_eq!(fixed, [[4, 2], [5, 2], [5, 3]]);
    }

    #[test]
    fn what_is_no_terrain_is_refused_with_its_object_and_row() {
        let floor = object(0, 0, &["555"]);
        let refused = |objects: &[FixedObject]| built(objects, 0.1).unwrap_err().message;
        assert!(refused(&[]).contains("at least one object"));
        for (grid, words) in [
            (&[][..], "terrain[1].grid: expected at least one cell"),
            (&[""], "terrain[1].grid: expected at least one cell"),
            (&["5", "55"], "terrain[1].grid[1]: 2 cells, expected 1"),
            (&["56"], "terrain[1].grid[0]: expected 0"),
            (&["5é"], "terrain[1].grid[0]: expected 0"),
            (&["0"], "no cell"),
            (&["505"], "several pieces"),
        ] {
            let said = refused(&[floor.clone(), object(9, 0, grid)]);
            assert!(said.contains(words), "{grid:?}: {said}");
        }
        assert!(refused(&[floor.clone(), floor.clone()]).contains("overlap"));
        assert!(refused(&[object(u32::MAX, u32::MAX, &["5"])]).contains("too much"));
    }
}
