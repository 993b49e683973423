//! [`Course`]: the ground of a task.

use crate::base::error::Error;
use crate::body::Body;
use crate::evogym::sense::Sight;
use crate::evogym::tasks::Task;
use crate::evogym::worlds::{Object, objects};
use crate::sim::{Physics, Terrain, TerrainObject};
use std::sync::Arc;

/// A task with its ground; any number of robots share it.
#[derive(Debug)]
pub struct Course {
    pub(crate) task: &'static Task,
    pub(crate) objects: Vec<Object>,
    pub(crate) terrain: Arc<Terrain>,
    pub(crate) sight: Sight,
}

impl Course {
    /// Builds the ground of a task.
    ///
    /// # Errors
    /// Returns an error if the simulator refuses the ground.
    pub fn new(task: &'static Task) -> Result<Self, Error> {
        let objects = objects(task.world);
        let solid: Vec<TerrainObject> = objects.iter().map(Object::solid).collect();
        let terrain = Terrain::new(&solid, Physics::default().cell_size)
            .map_err(|error| Error::other(format!("{}: {error}", task.world)))?;
        Ok(Course {
            task,
            terrain: Arc::new(terrain),
            sight: Sight::new(&objects),
            objects,
        })
    }

    /// Returns the task.
    pub fn task(&self) -> &'static Task {
        self.task
    }

    /// Returns its objects in the order of their names.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Checks that a body has room at a column and row, its box with it, as EvoGym demands.
    pub(crate) fn check_room(&self, body: &Body, (column, row): (i64, u32)) -> Result<(), Error> {
        let (right, top) = (
            column.saturating_add(body.width() as i64),
            i64::from(row) + body.height() as i64,
        );
        let lies_in =
            |(x, y): &(i64, i64)| (column..right).contains(x) && (i64::from(row)..top).contains(y);
        let hit = self.objects.iter().find_map(|object| {
            let cell = object.filled().find(lies_in)?;
            Some((object.name, cell))
        });
        match hit {
            None => Ok(()),
            Some((name, (x, y))) => Err(Error::usage(format!(
                "body: its box of {} × {} voxels at column {column}, row {row} overlaps {name} of {} \
                 at column {x}, row {y}; expected a smaller body",
                body.height(),
                body.width(),
                self.task.name
            ))),
        }
    }
}
