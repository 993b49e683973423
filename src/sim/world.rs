//! [`World`]: one life of one robot on flat ground.

use super::actuation;
use super::contact::add_contacts;
use super::energy::{Energy, Meter};
use super::integrator::{integrate, limit};
use super::lattice::Lattice;
use super::limits::limit_rigid;
use super::params::Physics;
use super::state::{Scratch, State, X, Y};
use crate::base::Grid;
use crate::base::lanes::{InstructionSet, Kernel, Lanes, dispatch};
use crate::base::stop::{NEVER, Stopped, check};
use std::sync::atomic::AtomicBool;

/// Where a life begins: the grid cell of the lower left corner of the body's box (empty rows and columns count).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// Column \[voxels\]. Nothing depends on it but the places of the pegs below the ground.
    pub column: i64,
    /// Row \[voxels\]; `Physics::ground_row` (2) stands on the ground.
    pub row: u32,
}

/// How a life became unstable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnstableReason {
    /// Too many distant surface voxels overlap (EvoGym's criterion).
    Overlaps,
    /// A voxel has blown up, or a coordinate is no number any more.
    BlownUp,
}

/// A life ended because it became unstable; it has no displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unstable in control step {control_step}: {}", match reason {
    UnstableReason::Overlaps => "too many surface voxels overlap",
    UnstableReason::BlownUp => "a voxel has blown up",
})]
pub struct Unstable {
    /// The control step in which it happened, from 0.
    pub control_step: u64,
    /// What happened.
    pub reason: UnstableReason,
}

/// One life: constants, lattice, state and the stimulus of the moment.
#[derive(Clone, Debug)]
pub struct World<'a> {
    physics: &'a Physics,
    lattice: &'a Lattice,
    start: Start,
    state: State,
    scratch: Scratch,
    /// The pixel of each active voxel, in [0, 1]; muscles have one too, unused.
    pixels: Vec<f64>,
    targets: Vec<f64>,
    instructions: InstructionSet,
    meter: Option<Meter>,
}

impl<'a> World<'a> {
    /// A robot at rest, all pixels dark.
    pub fn new(lattice: &'a Lattice, physics: &'a Physics, start: Start) -> Self {
        let state = State::at_rest(lattice, physics, start.row);
        World {
            physics,
            lattice,
            start,
            scratch: Scratch::new(lattice, physics, &state),
            state,
            pixels: vec![0.0; lattice.active.len()],
            targets: vec![0.0; lattice.active.len()],
            instructions: InstructionSet::in_use(),
            meter: None,
        }
    }

    /// Runs on a chosen instruction set instead of the widest; results are the same bits.
    #[must_use]
    pub fn with_instructions(mut self, set: InstructionSet) -> Self {
        self.instructions = set;
        self
    }

    /// Measures energies; results are the same bits, but slower.
    #[must_use]
    pub fn with_energy_meter(mut self) -> Self {
        self.meter = Some(Meter::new(self.lattice, self.physics));
        self
    }

    /// Energies put in so far, all lives together; 0 without a meter.
    pub fn energy(&self) -> Energy {
        self.meter.as_ref().map_or_else(Energy::default, |meter| meter.energy)
    }

    /// Begins the life anew; the stimulus stays.
    pub fn reset(&mut self) {
        self.state = State::at_rest(self.lattice, self.physics, self.start.row);
        self.meter.iter_mut().for_each(Meter::rest);
    }

    /// Shows an image: H × W in [0, 1], pixel (row, column) to voxel (row, column); outside it is dark.
    pub fn set_stimulus(&mut self, stimulus: &Grid<f64>) {
        for (voxel, pixel) in self.lattice.active.iter().zip(&mut self.pixels) {
            let (row, column) = voxel.place;
            *pixel = stimulus.or_default((row, column));
        }
    }

    /// One control step.
    ///
    /// # Errors
    /// [`Unstable`] if the life ends in it; the state is then of no use.
    pub fn step(&mut self) -> Result<(), Unstable> {
        self.step_unless(&NEVER).expect("nobody sets NEVER")
    }

    /// One control step, which ends within a substep or two when `stop` is set.
    ///
    /// # Errors
    /// [`Stopped`] then; within, [`Unstable`] if the life ends in it. The state is of no use in either case.
    pub fn step_unless(&mut self, stop: &AtomicBool) -> Result<Result<(), Unstable>, Stopped> {
        let (lattice, physics, control_step) = (self.lattice, self.physics, self.state.control_step);
        self.scratch.begin();
        let goals = &mut self.scratch.goals;
        actuation::set_goals(lattice, physics, control_step, &self.pixels, &mut self.targets, goals);
        self.meter.iter_mut().for_each(|meter| meter.drive(&self.scratch.goals, &self.state.position));
        let (state, scratch, meter) = (&mut self.state, &mut self.scratch, self.meter.as_mut());
        let start_column = self.start.column;
        let steps = ControlStep { lattice, physics, start_column, state, scratch, meter, stop };
        match dispatch(self.instructions, steps) {
            Ok(()) => {}
            Err(Ended::Stopped) => return Err(Stopped),
            Err(Ended::Unstable(reason)) => return Ok(Err(Unstable { control_step, reason })),
        }
        // What a substep leaves behind is looked at by the next; here, at the end, by nobody else.
        if !self.centre_of_mass().iter().all(|coordinate| coordinate.is_finite()) {
            return Ok(Err(Unstable { control_step, reason: UnstableReason::BlownUp }));
        }
        self.state.control_step += 1;
        Ok(Ok(()))
    }

    /// Control steps lived.
    pub fn control_step(&self) -> u64 {
        self.state.control_step
    }

    /// Centre of mass [x, y] in world units: x from the left edge of the starting box, y from the floor plane. The
    /// unweighted mean of the points.
    pub fn centre_of_mass(&self) -> [f64; 2] {
        let count = self.lattice.points.len().max(1) as f64;
        let mean = |of: &[f64]| self.lattice.points.iter().map(|&(point, _)| of[point]).sum::<f64>() / count;
        [mean(&self.state.position[X]), mean(&self.state.position[Y])]
    }

    /// All points [x, y] in world units (as [`World::centre_of_mass`]), in EvoGym's order of creation.
    pub fn points(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let [x, y] = &self.state.position;
        self.lattice.points.iter().map(|&(point, _)| [x[point], y[point]])
    }

    /// Every non-empty voxel's (row, column) and its corners (top left, top right, bottom right, bottom left) as
    /// indices into [`World::points`].
    pub fn voxels(&self) -> impl Iterator<Item = ((usize, usize), [usize; 4])> + '_ {
        let mut order = vec![0; self.lattice.len];
        self.lattice.points.iter().enumerate().for_each(|(i, &(point, _))| order[point] = i);
        self.lattice.voxels.iter().map(move |&(place, corners)| (place, corners.map(|c| order[c])))
    }

    /// What the life must remember, to go on from it later.
    pub fn state(&self) -> &State {
        &self.state
    }
}

/// The substeps of a control step, compiled per instruction set.
struct ControlStep<'a> {
    lattice: &'a Lattice,
    physics: &'a Physics,
    start_column: i64,
    state: &'a mut State,
    scratch: &'a mut Scratch,
    meter: Option<&'a mut Meter>,
    stop: &'a AtomicBool,
}

/// Why a control step ended early.
enum Ended {
    Unstable(UnstableReason),
    Stopped,
}

impl Kernel for ControlStep<'_> {
    type Output = Result<(), Ended>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let ControlStep { lattice, physics, start_column, state, scratch, mut meter, stop } = self;
        for _ in 0..physics.substeps {
            check(stop).map_err(|Stopped| Ended::Stopped)?;
            substep::<L>(lattice, physics, start_column, state, scratch, meter.as_deref_mut())
                .map_err(Ended::Unstable)?;
        }
        Ok(())
    }
}

/// physics.md, "One substep, in this order".
#[inline(always)]
fn substep<L: Lanes>(
    lattice: &Lattice,
    physics: &Physics,
    start_column: i64,
    state: &mut State,
    scratch: &mut Scratch,
    mut meter: Option<&mut Meter>,
) -> Result<(), UnstableReason> {
    scratch.neighbours.refresh::<L>(lattice, physics, state)?;
    let unstable = scratch.neighbours.too_many_overlaps(lattice, physics, state);

    scratch.contact.iter_mut().for_each(|axis| axis.fill(0.0));
    add_contacts(lattice, physics, start_column, state, &scratch.neighbours, &mut scratch.contact);
    // Contacts see true velocities: position now less position then. The integrator knows its own.
    integrate::<L>(lattice, physics, state, scratch);
    meter.iter_mut().for_each(|meter| meter.before_limits(&scratch.position));
    limit::<L>(lattice, physics, state, scratch);
    limit_rigid(lattice, physics, &mut state.position);
    meter.iter_mut().for_each(|meter| meter.after_limits(&state.position));

    if unstable { Err(UnstableReason::Overlaps) } else { Ok(()) }
}
