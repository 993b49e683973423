//! Single simulations.

use crate::arrays::{body, seen};
use crate::config::{ConfigData, setting};
use crate::errors::{Unstable, entered, raised, refused};
use crate::pictures::RecordingData;
use crate::watch::check_interrupt;
use morphcog::body::Body;
use morphcog::sim::{FloatEnvironment, Start, System};
use morphcog::task::protocol::MAX_ROW;
use morphcog::task::rollout::{moment, place_in};
use morphcog::task::terrain::{FixedObject, built, placed};
use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Control steps of a world between checks for Ctrl-C.
const STEPS: u64 = 20;

/// One simulation; see `morphcog.World`. Between checks for Ctrl-C others may read or change it.
#[pyclass(frozen, module = "morphcog._morphcog")]
pub(crate) struct WorldData {
    simulation: Mutex<Simulation>,
    body: Body,
}

#[derive(Clone)]
struct Simulation {
    world: morphcog::sim::World,
    unstable: Option<String>,
}

#[pymethods]
impl WorldData {
    #[new]
    #[pyo3(signature = (voxels, start_column, start_row, config, terrain))]
    fn new(
        voxels: PyReadonlyArray2<u8>,
        start_column: Option<i64>,
        start_row: Option<u32>,
        config: Option<&ConfigData>,
        terrain: Option<Vec<(u32, u32, Vec<String>)>>,
    ) -> PyResult<Self> {
        let _environment = entered()?;
        let body = body(&voxels, "body")?;
        let (physics, protocol) = setting(config);
        let start = Start {
            column: start_column.unwrap_or(protocol.start_column),
            row: start_row.unwrap_or(protocol.start_row),
        };
        let lowest = match terrain {
            None => physics.ground_row,
            Some(_) => 0,
        };
        if !(lowest..=MAX_ROW).contains(&start.row) {
            let on_ground = if terrain.is_none() {
                " (on the ground)"
            } else {
                ""
            };
            return Err(refused(format!(
                "start_row={}: expected {lowest}{on_ground} to {MAX_ROW}",
                start.row
            )));
        }
        let system = System::new(&body, physics);
        let world = match terrain {
            None => morphcog::sim::World::new(system, start),
            Some(objects) => {
                let objects = objects.into_iter();
                let objects: Vec<FixedObject> = objects
                    .map(|(column, row, grid)| FixedObject { column, row, grid })
                    .collect();
                built(&objects, system.physics().cell_size)
                    .and_then(|terrain| placed(system, start, terrain))
                    .map_err(|error| raised(&error))?
            }
        };
        Ok(WorldData {
            simulation: Mutex::new(Simulation {
                world,
                unstable: None,
            }),
            body,
        })
    }

    /// Returns a copy in its present state.
    fn copied(&self, py: Python) -> Self {
        WorldData {
            simulation: Mutex::new(self.simulation(py).clone()),
            body: self.body.clone(),
        }
    }

    /// Returns its present state as a recording of one moment.
    fn recorded(&self, py: Python, pixels: PyReadonlyArray2<f64>) -> PyResult<RecordingData> {
        let _environment = entered()?;
        let stimulus = seen(pixels.as_array(), &self.body)?;
        let simulation = self.simulation(py);
        let world = &simulation.world;
        let recording = moment(world, &self.body, stimulus);
        Ok(RecordingData::new(recording))
    }

    fn set_stimulus(&self, py: Python, pixels: PyReadonlyArray2<f64>) -> PyResult<()> {
        let _environment = entered()?;
        let pixels = seen(pixels.as_array(), &self.body)?;
        self.simulation(py).world.set_stimulus(&pixels);
        Ok(())
    }

    /// Sets the length of every actuator \[voxel lengths\], instead of a stimulus.
    fn set_targets(&self, py: Python, targets: PyReadonlyArray1<f64>) -> PyResult<()> {
        let _environment = entered()?;
        let targets: Vec<f64> = targets.as_array().iter().copied().collect();
        let set = self.simulation(py).world.set_targets(&targets);
        set.map_err(|error| refused(format!("targets: {error}")))
    }

    fn step(&self, py: Python, count: u64) -> PyResult<()> {
        let _environment = entered()?;
        // In parts, to check for Ctrl-C; a control step takes milliseconds at most.
        let mut left = count;
        loop {
            let steps = left.min(STEPS);
            py.detach(|| self.locked().step(steps))
                .map_err(Unstable::new_err)?;
            left -= steps;
            if left == 0 {
                return Ok(());
            }
            check_interrupt(py)?;
        }
    }

    fn reset(&self, py: Python) {
        let mut simulation = self.simulation(py);
        simulation.world.reset();
        simulation.unstable = None;
    }

    #[getter]
    fn control_step(&self, py: Python) -> u64 {
        self.simulation(py).world.control_step()
    }

    /// Returns the centre of mass \[voxel lengths\].
    #[getter]
    fn centre(&self, py: Python) -> [f64; 2] {
        let _environment = FloatEnvironment::standard();
        let simulation = self.simulation(py);
        simulation.lengths(simulation.world.centre_of_mass())
    }

    /// Returns the points \[voxel lengths\].
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let _environment = FloatEnvironment::standard();
        let simulation = self.simulation(py);
        let places = simulation.world.points();
        pairs(py, places.flat_map(|place| simulation.lengths(place)))
    }

    /// Returns the velocities of the points \[voxel lengths / s\].
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let _environment = FloatEnvironment::standard();
        let simulation = self.simulation(py);
        let cell = simulation.world.system().physics().cell_size;
        let velocities = simulation.world.velocities();
        pairs(
            py,
            velocities.flat_map(|velocity| velocity.map(|v| v / cell)),
        )
    }

    /// Returns the corners of each voxel as indices of points, clockwise from the top left.
    #[getter]
    fn voxels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<usize>> {
        let corners: Vec<usize> = self
            .simulation(py)
            .world
            .voxels()
            .flat_map(|(_, corners)| corners)
            .collect();
        let array = numpy::ndarray::Array2::from_shape_vec((corners.len() / 4, 4), corners);
        PyArray2::from_owned_array(py, array.expect("four corners a voxel"))
    }
}

/// Returns an array with two coordinates a row.
fn pairs<'py>(py: Python<'py>, numbers: impl Iterator<Item = f64>) -> Bound<'py, PyArray2<f64>> {
    let numbers: Vec<f64> = numbers.collect();
    let array = numpy::ndarray::Array2::from_shape_vec((numbers.len() / 2, 2), numbers);
    PyArray2::from_owned_array(py, array.expect("two coordinates a point"))
}

impl WorldData {
    /// Locks the simulation, without waiting for a thread that needs Python's lock.
    fn simulation(&self, py: Python) -> MutexGuard<'_, Simulation> {
        self.simulation
            .lock_py_attached(py)
            .unwrap_or_else(PoisonError::into_inner)
    }

    fn locked(&self) -> MutexGuard<'_, Simulation> {
        self.simulation
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

impl Simulation {
    /// Takes control steps; fails with the reason if it is unstable.
    fn step(&mut self, count: u64) -> Result<(), String> {
        if let Some(text) = &self.unstable {
            return Err(format!("{text}; begin anew with reset()"));
        }
        let stepped = (0..count)
            .try_for_each(|_| self.world.step())
            .map_err(|error| error.to_string());
        self.unstable = stepped.clone().err();
        stepped
    }

    /// Converts a position to voxel lengths.
    fn lengths(&self, at: [f64; 2]) -> [f64; 2] {
        place_in(&self.world, at)
    }
}
