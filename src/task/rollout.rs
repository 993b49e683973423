//! Rollouts: a body, a protocol and stimuli → displacements.

use super::protocol::Protocol;
use super::recording::{Frame, Phase, Recording, VoxelCorners};
use crate::base::Grid;
use crate::body::Body;
use crate::sim::{Lattice, Physics, Start, Unstable, World};

/// World units → voxel lengths: distances are reported in voxel lengths, as in the paper.
fn voxel_lengths(world_units: f64, physics: &Physics) -> f64 {
    world_units / physics.cell_size
}

/// A robot on the ground, ready to be shown images.
pub struct Rollout<'a> {
    world: World<'a>,
    physics: &'a Physics,
    protocol: &'a Protocol,
}

impl<'a> Rollout<'a> {
    /// A robot at its start.
    pub fn new(lattice: &'a Lattice, physics: &'a Physics, protocol: &'a Protocol) -> Self {
        let start = Start { column: protocol.start_column, row: protocol.start_row };
        Rollout { world: World::new(lattice, physics, start), physics, protocol }
    }

    /// Shows an image for the protocol's control steps and goes on living from the present state; the displacement
    /// of the centre of mass along x meanwhile, in voxel lengths, right positive. `watch` is called after every
    /// control step.
    ///
    /// # Errors
    /// [`Unstable`] if the life ends.
    pub fn show(&mut self, stimulus: &Grid<f64>, mut watch: impl FnMut(&World)) -> Result<f64, Unstable> {
        self.world.set_stimulus(stimulus);
        let start = self.world.centre_of_mass()[0];
        for _ in 0..self.protocol.control_steps {
            self.world.step()?;
            watch(&self.world);
        }
        Ok(voxel_lengths(self.world.centre_of_mass()[0] - start, self.physics))
    }

    /// Back to the initial state: a fresh life.
    pub fn reset(&mut self) {
        self.world.reset();
    }
}

/// One fresh life under one image: its displacement in voxel lengths.
///
/// # Errors
/// [`Unstable`] if the life ends early.
pub fn fresh_life(
    lattice: &Lattice,
    physics: &Physics,
    protocol: &Protocol,
    stimulus: &Grid<f64>,
) -> Result<f64, Unstable> {
    Rollout::new(lattice, physics, protocol).show(stimulus, |_| ())
}

/// For each stimulus the first one (its index) that shows the body's sensors the same pixels: those are one life.
pub fn same_to_sensors(body: &Body, stimuli: &[&Grid<f64>]) -> Vec<usize> {
    let sensors = || body.voxels().iter().filter(|(_, m)| m.is_sensor()).map(|(place, _)| place);
    let mut first = std::collections::HashMap::new();
    let seen = |stimulus: &Grid<f64>| {
        let pixel = |(r, c)| stimulus.get(r as isize, c as isize).copied().unwrap_or(0.0).to_bits();
        sensors().map(pixel).collect::<Vec<u64>>()
    };
    stimuli.iter().enumerate().map(|(i, stimulus)| *first.entry(seen(stimulus)).or_insert(i)).collect()
}

/// Records a robot's life frame by frame for pictures; images with their labels, one phase each. An unstable life
/// is recorded up to its end.
pub fn record(
    robot: &str,
    body: &Body,
    physics: &Physics,
    protocol: &Protocol,
    fresh: bool,
    images: &[(String, Grid<f64>)],
) -> Recording {
    let lattice = Lattice::new(body, physics);
    let mut rollout = Rollout::new(&lattice, physics, protocol);
    let corner = |((row, column), corners)| VoxelCorners { row, column, corners };
    let mut recording = Recording {
        robot: robot.to_string(),
        body: body.clone(),
        voxels: rollout.world.voxels().map(corner).collect(),
        phases: Vec::new(),
        frames: Vec::new(),
        cycle: physics.cycle_steps as usize,
        unstable: false,
    };
    let ground = f64::from(physics.ground_row) * physics.cell_size;
    let place = |[x, y]: [f64; 2]| [voxel_lengths(x, physics), voxel_lengths(y - ground, physics)];
    let frame = |world: &World| Frame {
        points: world.points().map(place).collect(),
        centre: place(world.centre_of_mass()),
    };
    for (index, (label, stimulus)) in images.iter().enumerate() {
        if fresh || index == 0 {
            rollout.reset();
            recording.frames.push(frame(&rollout.world));
        }
        let first_frame = recording.frames.len() - 1;
        let start = rollout.world.centre_of_mass()[0];
        let end = rollout.show(stimulus, |world| recording.frames.push(frame(world)));
        let so_far = voxel_lengths(rollout.world.centre_of_mass()[0] - start, physics);
        recording.phases.push(Phase {
            first_frame,
            stimulus: stimulus.clone(),
            label: label.clone(),
            displacement: end.unwrap_or(so_far),
        });
        if end.is_err() {
            recording.unstable = true;
            break;
        }
    }
    recording
}
