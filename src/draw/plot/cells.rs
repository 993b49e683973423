//! [`CellMap`]: an archive's cells as every view shows them, with their colours.
//!
//! A task has a panel for each bin of total voxels. In it, muscle voxels increase to the right and
//! sensor voxels upwards; rows and columns in which no body is possible are left out.

use crate::data::gates::Gates;
use crate::draw::colour::Colour;
use crate::draw::plot::scales;
use crate::qd::descriptor::{COUNT_BINS, DescriptorSpace, count_bin, possible_cells};
use crate::store::run::{Robot, RunFile};
use crate::task::gates::gate;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// A task whose highest fitness is more than this many times that of every other task has a scale
/// of its own: on a common one, the other tasks would all be dark.
const DWARFING: f64 = 2.0;
/// The number of colours by which pages draw a scale.
const STOPS: u32 = 8;

/// The cells of an archive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct CellMap {
    /// The maps of the tasks, in the order of their bins; at least one.
    pub(crate) tasks: Vec<TaskMap>,
    /// The voxel counts at which bins begin.
    pub(crate) edges: Vec<usize>,
    /// The number of places for voxels.
    pub(crate) area: usize,
    /// The unit of fitness.
    pub(crate) unit: Option<&'static str>,
    /// True if some elite has a fitness below 0.
    pub(crate) has_below: bool,
    /// The colours from fitness 0 to the highest of a scale.
    pub(crate) colours: Vec<Colour>,
    /// The colour of fitness below 0.
    pub(crate) below: Colour,
}

/// The cells of a task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct TaskMap {
    /// The name: of a logic gate, if the task is one.
    pub(crate) name: String,
    /// The fitness at the upper end of the scale; 0 if no elite has more.
    pub(crate) highest: f64,
    /// True if its scale is not that of the other tasks, which it dwarfs.
    pub(crate) has_own_scale: bool,
    /// The panels that have possible cells, from few voxels to many.
    pub(crate) panels: Vec<Panel>,
}

/// The cells of a task with similarly many voxels in all.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Panel {
    /// The least and the largest number of voxels.
    pub(crate) voxels: [usize; 2],
    /// Rows of equal length, that with most sensor voxels first.
    pub(crate) rows: Vec<Vec<Cell>>,
}

/// A cell of an archive.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Cell {
    /// No body can be in it.
    Impossible,
    Empty,
    Elite {
        /// The id.
        robot: String,
        fitness: f64,
        colour: Colour,
    },
}

impl CellMap {
    pub(crate) fn of(run: &RunFile) -> Self {
        let names = names(run);
        let area = run.config.body.height * run.config.body.width;
        // Tasks have the same possible cells.
        let space = DescriptorSpace::voxel_counts(1);
        let possible = possible_cells(area, run.config.body.min_muscles, 1);
        let possible = possible.into_iter().filter_map(|i| space.coordinates(i));
        let elites = run.elites.iter().map(|robot| (robot.cell.clone(), robot));
        let cells = Cells {
            possible: possible.collect(),
            elites: elites.collect(),
            area,
            has_tasks: names.len() > 1,
        };
        let highest = (0..names.len()).map(|task| cells.highest(task));
        let scales = scales_of(&highest.collect::<Vec<_>>());
        let map = |((task, name), (highest, has_own_scale))| TaskMap {
            name,
            highest,
            has_own_scale,
            panels: (0..COUNT_BINS)
                .filter_map(|total| cells.panel(task, total, highest))
                .collect(),
        };
        CellMap {
            tasks: names.into_iter().enumerate().zip(scales).map(map).collect(),
            edges: (0..COUNT_BINS)
                .filter_map(|bin| first_of(bin, area))
                .collect(),
            area,
            unit: run.fitness().unit(),
            has_below: run.elites.iter().any(|robot| robot.objective < 0.0),
            colours: (0..=STOPS)
                .map(|k| scales::sequential(f64::from(k) / f64::from(STOPS)))
                .collect(),
            below: scales::BELOW,
        }
    }

    /// Describes the counts in a bin, such as "28–55".
    pub(crate) fn counts(&self, bin: usize) -> String {
        let [least, most] = counts(bin, self.area);
        format!("{least}–{most}")
    }

    /// Returns true if some possible cell has no elite.
    pub(crate) fn is_open(&self) -> bool {
        let panels = self.tasks.iter().flat_map(|task| &task.panels);
        panels
            .flat_map(|panel| panel.rows.iter().flatten())
            .any(|cell| *cell == Cell::Empty)
    }
}

impl Panel {
    pub(crate) fn columns(&self) -> usize {
        self.rows.first().map_or(0, Vec::len)
    }

    /// Describes the number of voxels, such as "28–55".
    pub(crate) fn total(&self) -> String {
        let [least, most] = self.voxels;
        format!("{least}–{most}")
    }
}

/// Returns the colour of a fitness on a scale up to `highest`.
pub(crate) fn colour(fitness: f64, highest: f64) -> Colour {
    match fitness < 0.0 {
        true => scales::BELOW,
        false if highest > 0.0 => scales::sequential(fitness / highest),
        false => scales::sequential(0.0),
    }
}

/// Returns the tasks' names; logic gates have their own.
fn names(run: &RunFile) -> Vec<String> {
    let tasks = &run.dimensions.tasks;
    let of_gates = || {
        let cues = Gates::named(&run.config.data.dataset)?.cues;
        let grouping = run.config.grouping().ok()?;
        let name = |(split, name): (_, &String)| {
            gate(split, cues).map_or_else(|| name.clone(), |gate| gate.name)
        };
        Some(grouping.tasks().iter().zip(tasks).map(name).collect())
    };
    of_gates().unwrap_or_else(|| tasks.clone())
}

/// Returns the upper end of each task's scale, and true if it has its own, from the tasks' highest
/// fitness.
fn scales_of(highest: &[f64]) -> Vec<(f64, bool)> {
    let most = |without: Option<usize>| {
        let others = highest.iter().enumerate();
        let others = others.filter(|(task, _)| Some(*task) != without);
        others.map(|(_, highest)| *highest).fold(0.0, f64::max)
    };
    let is_dwarfing = |task: usize| {
        let others = most(Some(task));
        others > 0.0 && highest[task] > DWARFING * others
    };
    let own = (0..highest.len()).find(|task| is_dwarfing(*task));
    let of_task = |task| match own == Some(task) {
        true => (highest[task], true),
        false => (most(own), false),
    };
    (0..highest.len()).map(of_task).collect()
}

/// Returns the least count in a bin, if there is one.
fn first_of(bin: usize, area: usize) -> Option<usize> {
    (0..=area).find(|count| count_bin(*count, area) == bin)
}

/// Returns the least and the largest count in a bin.
fn counts(bin: usize, area: usize) -> [usize; 2] {
    let first = first_of(bin, area).unwrap_or(area);
    let last = (first..=area).rfind(|count| count_bin(*count, area) == bin);
    [first, last.unwrap_or(first)]
}

struct Cells<'a> {
    /// The cells that a body can be in, without the task.
    possible: BTreeSet<Vec<usize>>,
    elites: BTreeMap<Vec<usize>, &'a Robot>,
    area: usize,
    has_tasks: bool,
}

impl Cells<'_> {
    fn place(&self, [muscle, sensor, total]: [usize; 3], task: usize) -> Vec<usize> {
        let task = self.has_tasks.then_some(task);
        [muscle, sensor, total].into_iter().chain(task).collect()
    }

    fn highest(&self, task: usize) -> f64 {
        let is_of_task = |cell: &Vec<usize>| !self.has_tasks || cell.last() == Some(&task);
        let elites = self.elites.iter().filter(|(cell, _)| is_of_task(cell));
        elites.map(|(_, robot)| robot.objective).fold(0.0, f64::max)
    }

    fn panel(&self, task: usize, total: usize, highest: f64) -> Option<Panel> {
        let possible = || self.possible.iter().filter(|cell| cell[2] == total);
        let columns = possible().map(|cell| cell[0]).max()? + 1;
        let rows = possible().map(|cell| cell[1]).max()? + 1;
        let cell = |muscle, sensor| {
            let place = self.place([muscle, sensor, total], task);
            match self.elites.get(&place) {
                Some(robot) => Cell::Elite {
                    robot: robot.id.clone(),
                    fitness: robot.objective,
                    colour: colour(robot.objective, highest),
                },
                None if self.possible.contains(&place[..3]) => Cell::Empty,
                None => Cell::Impossible,
            }
        };
        let row = |sensor| (0..columns).map(|muscle| cell(muscle, sensor)).collect();
        Some(Panel {
            voxels: counts(total, self.area),
            rows: (0..rows).rev().map(row).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shipped::gallery;
    use crate::store::names::RUN_JSON;

    #[test]
    fn a_task_that_dwarfs_all_others_has_a_scale_of_its_own() {
        let own = |highest: &[f64]| scales_of(highest);
        assert_eq!(
            own(&[10.0, 8.0, 41.0]),
            [(10.0, false), (10.0, false), (41.0, true)]
        );
        assert_eq!(own(&[10.0, 19.0]), [(19.0, false); 2]);
        // Beside tasks that nothing is good at, there is nothing to dwarf.
        assert_eq!(own(&[0.0, 19.0]), [(19.0, false); 2]);
        assert_eq!(own(&[0.0]), [(0.0, false)]);
    }

    #[test]
    fn bins_begin_and_end_where_the_descriptor_says() {
        let edges = |area| -> Vec<usize> {
            let first = |bin| first_of(bin, area);
            (0..COUNT_BINS).filter_map(first).collect()
        };
        assert_eq!(edges(196), [0, 28, 56, 84, 112, 140, 168]);
        assert_eq!(edges(25), [0, 3, 6, 9, 12, 15, 18]);
        assert_eq!([counts(0, 196), counts(6, 196)], [[0, 27], [168, 196]]);
    }

    #[test]
    fn a_map_has_the_possible_cells_of_every_task_and_each_elite_once() {
        let text = gallery::text("gallery:gates", RUN_JSON).expect("it ships");
        let run = RunFile::parse(text, "gates").unwrap();
        let map = CellMap::of(&run);
        assert!(map.tasks.iter().any(|task| task.name == "XOR"), "{map:?}");
        let cells = || {
            let panels = map.tasks.iter().flat_map(|task| &task.panels);
            panels.flat_map(|panel| panel.rows.iter().flatten())
        };
        let possible = cells().filter(|cell| **cell != Cell::Impossible).count();
        assert_eq!(possible, run.dimensions.possible_cells);
        let elite = |cell: &Cell| match cell {
            Cell::Elite { robot, .. } => Some(robot.clone()),
            _ => None,
        };
        let mut shown: Vec<String> = cells().filter_map(elite).collect();
        let mut elites: Vec<String> = run.elites.iter().map(|robot| robot.id.clone()).collect();
        shown.sort();
        elites.sort();
        assert_eq!(shown, elites);
        for panel in map.tasks.iter().flat_map(|task| &task.panels) {
            assert!(panel.rows.iter().all(|row| row.len() == panel.columns()));
            // No row and no column without a possible cell.
            let has_possible = |row: &Vec<Cell>| row.iter().any(|cell| *cell != Cell::Impossible);
            assert!(panel.rows.iter().all(has_possible), "{panel:?}");
        }
    }

    #[test]
    fn what_is_wrong_is_gray_and_what_is_right_is_not() {
        assert_eq!(colour(20.0, 20.0), scales::sequential(1.0));
        assert_eq!(colour(-0.1, 20.0), scales::BELOW);
        assert_ne!(colour(-0.1, 20.0), colour(0.1, 20.0));
        assert_eq!(colour(0.0, 0.0), scales::sequential(0.0));
    }
}
