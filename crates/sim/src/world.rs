//! [`World`]: one simulation of one robot, on flat ground or a terrain.

use crate::energy::{Energy, Meter};
use crate::grid::Grid;
use crate::lattice::ActiveVoxel;
use crate::scratch::Scratch;
use crate::simd::{InstructionSet, dispatch};
use crate::state::{State, X, Y};
use crate::step::{ControlStep, Ended, actuation};
use crate::stop::{NEVER, Stopped};
use crate::system::System;
use crate::terrain::{Ground, Terrain};
use crate::unstable::{StepError, Unstable, UnstableReason};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The start of a simulation: the grid cell of the body's lower left corner (empty rows and columns
/// count).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// Column \[voxels\]. On flat ground it matters only to the positions of the pegs below.
    pub column: i64,
    /// Row \[voxels\]. A body at `Physics::ground_row` (2) stands on flat ground.
    pub row: u32,
}

/// A state that belongs to another system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the state is that of another body")]
pub struct StateMismatch;

/// A robot's box, empty voxels included, that overlaps a fixed cell at its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the robot's box overlaps the terrain at column {column}, row {row}")]
pub struct StartError {
    /// Column of the cell.
    pub column: i64,
    /// Row of the cell, from the floor plane.
    pub row: i64,
}

/// The reason why targets are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TargetsError {
    /// There are more or fewer than actuators.
    #[error("expected {expected} targets, one for each actuator; found {found}")]
    Count {
        /// The number of actuators.
        expected: usize,
        /// The number of targets.
        found: usize,
    },
    /// A target is not a number.
    #[error("target {0} is not a number")]
    NotANumber(usize),
}

/// One simulation: a system, its state and the current stimulus.
#[derive(Clone, Debug)]
pub struct World {
    pub(crate) system: Arc<System>,
    pub(crate) start: Start,
    /// `None` is flat ground.
    pub(crate) terrain: Option<Arc<Terrain>>,
    pub(crate) state: State,
    pub(crate) scratch: Scratch,
    /// The pixel of each active voxel, in [0, 1]; muscles have one too, unused. Of an actuator its
    /// target.
    pixels: Vec<f64>,
    targets: Vec<f64>,
    pub(crate) instructions: InstructionSet,
    pub(crate) meter: Option<Meter>,
}

impl World {
    /// Makes a robot at rest, all pixels dark. Takes a [`System`] or an `Arc` of one.
    /// Actuators have their rest lengths.
    pub fn new(system: impl Into<Arc<System>>, start: Start) -> Self {
        World::standing(system.into(), start, None)
    }

    /// Makes a robot at rest on a terrain, all pixels dark and all actuators at their rest lengths.
    /// Below the terrain, and beside it, is the floor plane.
    ///
    /// # Errors
    /// Returns a [`StartError`] if the robot's box overlaps a fixed cell.
    pub fn on_terrain(
        system: impl Into<Arc<System>>,
        start: Start,
        terrain: impl Into<Arc<Terrain>>,
    ) -> Result<Self, StartError> {
        let (system, terrain) = (system.into(), terrain.into());
        let (rows, columns) = (system.lattice.body_rows, system.lattice.body_columns);
        for row in (0..rows).map(|up| i64::from(start.row) + up as i64) {
            for column in (0..columns).map(|right| start.column.saturating_add(right as i64)) {
                if terrain.is_fixed(column, row) {
                    return Err(StartError { column, row });
                }
            }
        }
        Ok(World::standing(system, start, Some(terrain)))
    }

    fn standing(system: Arc<System>, start: Start, terrain: Option<Arc<Terrain>>) -> Self {
        let state = State::at_rest(&system, start.row, terrain.is_some());
        let active = &system.lattice.active;
        let pixel = |voxel: &ActiveVoxel| f64::from(u8::from(voxel.material.is_actuator()));
        World {
            start,
            terrain,
            scratch: Scratch::new(&system, &state),
            state,
            pixels: active.iter().map(pixel).collect(),
            targets: vec![0.0; active.len()],
            instructions: InstructionSet::in_use(),
            meter: None,
            system,
        }
    }

    /// Returns the system that is simulated.
    pub fn system(&self) -> &Arc<System> {
        &self.system
    }

    /// Selects an instruction set instead of the widest; results are the same bits.
    #[must_use]
    pub fn with_instructions(mut self, set: InstructionSet) -> Self {
        self.instructions = set;
        self
    }

    /// Measures energies: slower, but the same bits.
    #[must_use]
    pub fn with_energy_meter(mut self) -> Self {
        self.meter = Some(Meter::new(&self.system));
        self
    }

    /// Returns the energies put in so far, over all resets; 0 without a meter.
    pub fn energy(&self) -> Energy {
        self.meter
            .as_ref()
            .map_or_else(Energy::default, |meter| meter.energy)
    }

    /// Returns to the start; the stimulus and the actuators' targets stay.
    pub fn reset(&mut self) {
        self.state = State::at_rest(&self.system, self.start.row, self.terrain.is_some());
        self.meter.iter_mut().for_each(Meter::rest);
    }

    /// Sets the image: H × W in [0, 1], pixel (row, column) for voxel (row, column); dark outside.
    pub fn set_stimulus(&mut self, stimulus: &Grid<f64>) {
        for (voxel, pixel) in self.system.lattice.active.iter().zip(&mut self.pixels) {
            let (row, column) = voxel.place;
            if !voxel.material.is_actuator() {
                *pixel = stimulus.or_default((row, column));
            }
        }
    }

    /// Sets the lengths that the actuators are to take from the next control step on: one for each,
    /// row-major from the top left, in multiples of the rest length. They are cut to the physics'
    /// `target_min` and `target_max` (0.6 and 1.6).
    ///
    /// # Errors
    /// Returns a [`TargetsError`], and changes nothing, if there are more or fewer than actuators,
    /// or if one is not a number.
    pub fn set_targets(&mut self, targets: &[f64]) -> Result<(), TargetsError> {
        let (active, physics) = (&self.system.lattice.active, &self.system.physics);
        let actuators = || active.iter().filter(|voxel| voxel.material.is_actuator());
        let (expected, found) = (actuators().count(), targets.len());
        if expected != found {
            return Err(TargetsError::Count { expected, found });
        }
        if let Some(number) = targets.iter().position(|target| target.is_nan()) {
            return Err(TargetsError::NotANumber(number));
        }
        let places = active.iter().zip(&mut self.pixels);
        let places = places.filter(|(voxel, _)| voxel.material.is_actuator());
        for ((_, place), target) in places.zip(targets) {
            *place = target.clamp(physics.target_min, physics.target_max);
        }
        Ok(())
    }

    /// Simulates one control step.
    ///
    /// # Errors
    /// Returns [`Unstable`] if the simulation ends in this step; the state is then useless.
    pub fn step(&mut self) -> Result<(), Unstable> {
        StepError::outcome(self.step_unless(&NEVER)).expect("NEVER is never set")
    }

    /// Simulates one control step; returns within a substep or two once `stop` is set.
    ///
    /// # Errors
    /// Returns a [`StepError`] if it was stopped, or if the simulation became unstable.
    pub fn step_unless(&mut self, stop: &AtomicBool) -> Result<(), StepError> {
        self.begin_step();
        let World {
            system,
            start,
            terrain,
            state,
            scratch,
            meter,
            ..
        } = self;
        let control_step = state.control_step;
        let (system, meter) = (&**system, meter.as_mut());
        let ground = Ground {
            terrain: terrain.as_deref(),
            start_column: start.column,
        };
        let steps = ControlStep {
            system,
            ground,
            state,
            scratch,
            meter,
            stop,
        };
        match dispatch(self.instructions, steps) {
            Ok(()) => Ok(self.end_step()?),
            Err(Ended::Stopped) => Err(Stopped.into()),
            Err(Ended::Unstable(reason)) => Err(Unstable {
                control_step,
                reason,
            }
            .into()),
        }
    }

    /// Prepares the substeps of a control step.
    pub(crate) fn begin_step(&mut self) {
        let World {
            system,
            state,
            scratch,
            pixels,
            targets,
            meter,
            ..
        } = self;
        scratch.begin();
        actuation::set_goals(
            system,
            state.control_step,
            pixels,
            targets,
            [&mut scratch.goals, &mut scratch.vertical_goals],
        );
        let goals = [&*scratch.goals, &*scratch.vertical_goals];
        meter
            .iter_mut()
            .for_each(|meter| meter.drive(goals, &state.position));
    }

    /// Completes a control step. Every substep checks the one before, so the last is checked here.
    pub(crate) fn end_step(&mut self) -> Result<(), Unstable> {
        let control_step = self.state.control_step;
        if !self
            .centre_of_mass()
            .iter()
            .all(|coordinate| coordinate.is_finite())
        {
            return Err(Unstable {
                control_step,
                reason: UnstableReason::BlownUp,
            });
        }
        self.state.control_step += 1;
        Ok(())
    }

    /// Returns the number of control steps completed.
    pub fn control_step(&self) -> u64 {
        self.state.control_step
    }

    /// Returns the centre of mass [x, y], the unweighted mean of the points, in world units: x from
    /// the left edge of the starting box, y from the floor plane.
    pub fn centre_of_mass(&self) -> [f64; 2] {
        let points = &self.system.lattice.points;
        let count = points.len().max(1) as f64;
        let mean = |of: &[f64]| points.iter().map(|&(point, _)| of[point]).sum::<f64>() / count;
        [mean(&self.state.position[X]), mean(&self.state.position[Y])]
    }

    /// Returns all points [x, y] (as [`World::centre_of_mass`]), in EvoGym's order of creation.
    pub fn points(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let [x, y] = &self.state.position;
        self.system
            .lattice
            .points
            .iter()
            .map(|&(point, _)| [x[point], y[point]])
    }

    /// Returns the velocities of all points [x, y] \[wu/s\], as integrated, in the order of
    /// [`World::points`]: the length limits move points without changing them.
    pub fn velocities(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let [x, y] = &self.state.velocity;
        let points = self.system.lattice.points.iter();
        points.map(|&(point, _)| [x[point], y[point]])
    }

    /// Returns where the robot started.
    pub fn start(&self) -> Start {
        self.start
    }

    /// Returns the terrain; `None` is flat ground.
    pub fn terrain(&self) -> Option<&Arc<Terrain>> {
        self.terrain.as_ref()
    }

    /// Returns every non-empty voxel's (row, column) and its corners (top left, top right, bottom
    /// right, bottom left) as indices into [`World::points`].
    pub fn voxels(&self) -> impl Iterator<Item = ((usize, usize), [usize; 4])> + '_ {
        let lattice = &self.system.lattice;
        let mut order = vec![0; lattice.len];
        lattice
            .points
            .iter()
            .enumerate()
            .for_each(|(i, &(point, _))| order[point] = i);
        lattice
            .voxels
            .iter()
            .map(move |&(place, corners)| (place, corners.map(|c| order[c])))
    }

    /// Returns the state, from which the simulation can continue later.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Continues from a state of the same system; the stimulus stays.
    ///
    /// # Errors
    /// Returns [`StateMismatch`], and changes nothing, if the state cannot be of this system.
    pub fn restore(&mut self, state: &State) -> Result<(), StateMismatch> {
        if !state.fits(&self.state) {
            return Err(StateMismatch);
        }
        self.state.clone_from(state);
        self.meter.iter_mut().for_each(Meter::rest);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Physics;

    fn world(body: &str) -> World {
        let system = System::new(&body.parse().expect("a body"), Physics::default());
        World::new(system, Start { column: 0, row: 2 })
    }

    #[test]
    fn a_simulation_goes_on_from_a_restored_state_with_the_same_bits() {
        let body = "4663/4005/3350/0333";
        let (mut ours, mut other) = (world(body), world(body));
        (0..30).for_each(|_| ours.step().unwrap());
        let state = ours.state().clone();
        #[cfg(feature = "serde")]
        let state: State = serde_json::from_str(&serde_json::to_string(&state).unwrap()).unwrap();
        // Wherever the other has been in the meantime.
        (0..7).for_each(|_| other.step().unwrap());
        other.restore(&state).unwrap();
        (0..30).for_each(|_| ours.step().unwrap());
        (0..30).for_each(|_| other.step().unwrap());
        assert_eq!(ours.control_step(), 60);
        assert_eq!(ours.state(), other.state());
    }

    #[test]
    fn the_state_of_another_body_is_refused() {
        let (mut ours, other) = (world("343"), world("343/343"));
        let before = ours.state().clone();
        assert_eq!(ours.restore(other.state()), Err(StateMismatch));
        assert_eq!(ours.state(), &before);
    }
}
