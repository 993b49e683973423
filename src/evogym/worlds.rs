//! The fixed objects of EvoGym's worlds.

use crate::base::Grid;
use crate::sim::TerrainObject;

/// All worlds: `world` and its name, then for each object `object`, its name, its lowest left column
/// and row, and its rows from the top, `#` a fixed cell.
const TEXT: &str = include_str!("worlds.txt");

/// An object of fixed cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its name, as of EvoGym's files.
    pub name: &'static str,
    /// Column of its lower left cell.
    pub column: u32,
    /// Row of its lower left cell, 0 at the bottom.
    pub row: u32,
    /// Its cells, rows from the top; true where one is fixed.
    pub cells: Vec<Vec<bool>>,
}

impl Object {
    /// Returns the columns and rows (0 at the bottom) of its cells, row-major from the top.
    pub fn filled(&self) -> impl Iterator<Item = (i64, i64)> + '_ {
        let top = i64::from(self.row) + self.cells.len() as i64 - 1;
        let rows = (0_i64..).zip(&self.cells);
        rows.flat_map(move |(down, row)| {
            let filled = (0_i64..).zip(row).filter(|(_, cell)| **cell);
            filled.map(move |(right, _)| (i64::from(self.column) + right, top - down))
        })
    }

    /// Returns it as the simulator has it.
    pub(crate) fn solid(&self) -> TerrainObject {
        let width = self.cells.first().map_or(0, Vec::len);
        TerrainObject {
            column: self.column,
            row: self.row,
            cells: Grid::from_fn(self.cells.len(), width, |row, column| {
                self.cells[row].get(column) == Some(&true)
            }),
        }
    }

    /// Returns its corners (right, down) from the top left of its box, each once, in EvoGym's order
    /// of creation. No two of its cells touch only at a corner.
    pub(crate) fn corners(&self) -> Vec<(usize, usize)> {
        let width = self.cells.first().map_or(0, Vec::len);
        let mut known = vec![false; (width + 1) * (self.cells.len() + 1)];
        let mut corners = Vec::new();
        for (down, row) in self.cells.iter().enumerate() {
            for right in (0..row.len()).filter(|right| row[*right]) {
                for (right, down) in [
                    (right, down),
                    (right + 1, down),
                    (right, down + 1),
                    (right + 1, down + 1),
                ] {
                    if !std::mem::replace(&mut known[down * (width + 1) + right], true) {
                        corners.push((right, down));
                    }
                }
            }
        }
        corners
    }

    /// Returns its corners in world units, in EvoGym's order of creation.
    pub fn points(&self) -> Vec<[f64; 2]> {
        let corners = self.corners();
        corners
            .into_iter()
            .map(|corner| self.place(corner))
            .collect()
    }

    /// Returns the place of a corner in world units, rounded as EvoGym rounds it: ties of sight
    /// depend on it.
    pub(crate) fn place(&self, (right, down): (usize, usize)) -> [f64; 2] {
        let height = self.cells.len() as f64;
        [
            f64::from(self.column) * 0.1 + right as f64 * 0.1,
            (f64::from(self.row) * 0.1 + height * 0.1) - down as f64 * 0.1,
        ]
    }
}

/// Returns the objects of a world in the order of their names; none if there is no such world.
pub(crate) fn objects(world: &str) -> Vec<Object> {
    let mut objects: Vec<Object> = Vec::new();
    let lines = TEXT
        .lines()
        .skip_while(|line| line.strip_prefix("world ") != Some(world));
    for line in lines.skip(1).take_while(|line| !line.starts_with("world ")) {
        match line.strip_prefix("object ") {
            Some(about) => {
                let mut words = about.split(' ');
                let mut word = || words.next().expect("a test reads every line of the text");
                let name = word();
                let mut number = || word().parse().expect("a test reads every line of the text");
                objects.push(Object {
                    name,
                    column: number(),
                    row: number(),
                    cells: Vec::new(),
                });
            }
            None => {
                let row = line.bytes().map(|cell| cell == b'#').collect();
                let last = objects.last_mut();
                last.expect("rows follow their object").cells.push(row);
            }
        }
    }
    objects
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evogym::tasks::TASKS;

    #[test]
    fn every_line_of_the_worlds_is_understood() {
        for line in TEXT.lines() {
            let words: Vec<_> = line.split(' ').collect();
            let is_known = match words[0] {
                "world" => words.len() == 2,
                "object" => words[2].parse::<u32>().is_ok() && words[3].parse::<u32>().is_ok(),
                row => row.bytes().all(|cell| b"#.".contains(&cell)),
            };
            assert!(is_known, "{line}");
        }
        for task in TASKS {
            let objects = objects(task.world);
            assert!(!objects.is_empty(), "{}", task.name);
            assert!(objects.windows(2).all(|pair| pair[0].name < pair[1].name));
            for object in objects {
                let width = object.cells[0].len();
                assert!(object.cells.iter().all(|row| row.len() == width));
            }
        }
    }

    #[test]
    fn corners_are_those_of_the_cells() {
        let pipe = &objects("Climber-v0")[0];
        assert_eq!((pipe.cells.len(), pipe.cells[0].len()), (90, 7));
        assert_eq!(pipe.filled().count(), 2 * 7 + 2 * 88);
        assert_eq!(pipe.filled().next(), Some((0, 89)));
        assert_eq!(pipe.corners().len(), 2 * (8 + 8) + 4 * 87);
        assert_eq!(pipe.place((7, 90)), [7.0 * 0.1, 0.0]);
    }
}
