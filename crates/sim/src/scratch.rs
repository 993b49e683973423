//! [`Scratch`]: the memory of a substep, which is never saved.

use crate::lattice::GROUP;
use crate::simd::{BLOCK, Buffer};
use crate::state::{Pair, State, pair};
use crate::step::broad_phase::BroadPhase;
use crate::step::limits::Reach;
use crate::step::off_lattice::OffLattice;
use crate::step::springs::{Pulls, Springs, Wide};
use crate::system::System;

/// Data that the stages of a substep pass on about a block of slots.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Work {
    pub pulls: Pulls,
    /// Acceleration without springs and without the stages' differences in drag.
    pub load: [Wide; 2],
    /// Accelerations of the first three stages.
    pub first: [Wide; 2],
    pub second: [Wide; 2],
    pub third: [Wide; 2],
}

/// Memory of a substep, allocated once.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// Goal lengths \[wu\]: horizontal springs by slot, then off-lattice springs.
    pub goals: Buffer,
    /// Goal lengths of vertical springs by slot \[wu\]; empty without vertical actuators.
    pub vertical_goals: Buffer,
    /// Springs by blocks.
    pub springs: Vec<Springs>,
    pub work: Vec<Work>,
    /// See [`Gather`](crate::step::springs::Gather).
    pub carry: Pair,
    /// Contact force per point [mass·wu/s²].
    pub contact: Pair,
    /// Positions of the second, third and fourth stage.
    pub stages: [Pair; 3],
    /// New positions and velocities.
    pub position: Pair,
    pub velocity: Pair,
    pub off_lattice: Option<OffLattice>,
    /// True if the springs' lengths are forgotten.
    pub anew: bool,
    /// Greatest reach of the latest length limits.
    pub reach: Reach,
    /// Lists of possible contacts.
    pub broad_phase: BroadPhase,
}

impl Scratch {
    pub fn new(System { lattice, physics }: &System, state: &State) -> Self {
        let horizontal = (0..lattice.len).map(|_| physics.cell_size);
        let off_lattice = lattice
            .off_lattice_springs
            .iter()
            .map(|spring| spring.length);
        let padding = [physics.cell_size; GROUP];
        let zeros = [[0.0; BLOCK]; 2];
        let work = Work {
            pulls: Pulls::ZERO,
            load: zeros,
            first: zeros,
            second: zeros,
            third: zeros,
        };
        // Slots without a point stay parked.
        let parked = || state.position.clone();
        Scratch {
            goals: horizontal.chain(off_lattice).chain(padding).collect(),
            vertical_goals: match lattice.actuated_vertical.is_empty() {
                true => Buffer::zeros(0),
                false => Buffer::filled(lattice.len, physics.cell_size),
            },
            springs: Springs::blocks(&lattice.stiffness, physics.mass, physics.servo_gain),
            work: vec![work; lattice.slots / BLOCK],
            carry: pair(lattice.len),
            contact: pair(lattice.len),
            stages: [parked(), parked(), parked()],
            position: parked(),
            velocity: pair(lattice.len),
            off_lattice: OffLattice::new(lattice, physics.mass, physics.servo_gain),
            anew: true,
            reach: Reach::default(),
            broad_phase: BroadPhase::default(),
        }
    }

    /// Forgets, at the start of a control step, all that substeps pass on outside the state.
    pub fn begin(&mut self) {
        self.anew = true;
        self.springs.iter_mut().for_each(Springs::forget);
        self.off_lattice.iter_mut().for_each(OffLattice::forget);
    }
}
