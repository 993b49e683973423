//! Springs that end in an off-lattice point, where voxels touch only at a corner: few, anywhere.

use crate::lattice::{GROUP, Lattice};
use crate::simd::{BLOCK, Buffer, Lanes, each};
use crate::state::{Pair, X, Y, pair};
use crate::step::limits::Limits;
use crate::step::series::rsqrt_exact;
use crate::step::springs::{Pulls, Springs, Watch};
use crate::system::System;

/// The off-lattice springs' part of a substep; only their ends are read and written one by one.
#[derive(Clone, Debug)]
pub(crate) struct OffLattice {
    /// Springs by groups.
    springs: Vec<Springs>,
    pulls: Vec<Pulls>,
    /// 1/(rest length)².
    inverse_rest_square: Buffer,
    /// Vectors of the springs at the positions last read, and the changes at their first ends.
    vector: Pair,
    change: Pair,
    /// Accelerations of the points in a stage.
    pub load: Pair,
}

impl OffLattice {
    /// Returns `None` for a body without such springs.
    pub fn new(lattice: &Lattice, mass: f64, gain: f64) -> Option<Self> {
        let count = lattice.off_lattice_springs.len().next_multiple_of(GROUP);
        let mut stiffness = Buffer::zeros(count);
        let mut inverse_rest_square = Buffer::filled(count, 1.0);
        for (i, spring) in lattice.off_lattice_springs.iter().enumerate() {
            stiffness[i] = spring.stiffness;
            inverse_rest_square[i] = 1.0 / (spring.length * spring.length);
        }
        let half = std::f64::consts::FRAC_1_SQRT_2;
        (count > 0).then(|| OffLattice {
            springs: Springs::blocks(&stiffness, mass, gain),
            pulls: vec![Pulls::ZERO; count / GROUP],
            inverse_rest_square,
            // Unit vectors beyond the last spring: no springs, but of valid length.
            vector: [Buffer::filled(count, half), Buffer::filled(count, half)],
            change: pair(count),
            load: pair(lattice.len),
        })
    }

    /// Forgets the lengths of the last substep.
    pub fn forget(&mut self) {
        self.springs.iter_mut().for_each(Springs::forget);
    }

    /// Adds the springs' changes to their ends.
    pub fn feed(&self, lattice: &Lattice, to: &mut Pair) {
        feed(lattice, &self.change, to);
    }

    /// Sets the rest lengths at the start of a substep, and the load of its first stage.
    #[inline(always)]
    pub fn first_stage<L: Lanes>(
        &mut self,
        lattice: &Lattice,
        goals: &[f64],
        gain: f64,
        position: &Pair,
    ) {
        self.fetch(lattice, position);
        for at in self.lanes::<L>() {
            let (vector, square) = self.squares::<L>(at);
            let goal = each!(i in [0, 1, 2, 3] => L::load(goals, at + i * BLOCK));
            let pulls = &mut self.pulls[at / GROUP];
            let springs = &mut self.springs[at / GROUP];
            let pull = springs.servo::<L, true>(
                pulls,
                at % GROUP,
                square,
                (goal, gain),
                &mut Watch::new(),
            );
            self.put(at, vector, pull);
        }
        self.load_points(lattice);
    }

    /// Computes the load of a later stage.
    #[inline(always)]
    pub fn later_stage<L: Lanes>(&mut self, lattice: &Lattice, position: &Pair) {
        self.fetch(lattice, position);
        for at in self.lanes::<L>() {
            let (vector, square) = self.squares::<L>(at);
            let pull = self.pulls[at / GROUP].at::<L, true>(at % GROUP, square, None);
            self.put(at, vector, pull);
        }
        self.load_points(lattice);
    }

    /// Computes corrections of springs beyond their limits, to be fed to the same positions.
    #[inline(always)]
    pub fn limit<L: Lanes>(&mut self, System { lattice, physics }: &System, position: &Pair) {
        self.fetch(lattice, position);
        let share = L::splat(physics.limit_share / 2.0);
        let limits = Limits::new(1.0, physics.limit_low, physics.limit_high);
        for at in self.lanes::<L>() {
            let (vector, square) = self.squares::<L>(at);
            let all = L::splat(f64::from_bits(u64::MAX >> 1));
            let pull = each!(i in [0, 1, 2, 3] => {
                let square = square[i] * L::load(&self.inverse_rest_square, at + i * BLOCK);
                let t = L::select(limits.beyond(square, all), limits.excess(square), L::splat(0.0));
                share * rsqrt_exact(t)
            });
            self.put(at, vector, pull);
        }
    }

    /// Iterates over the first springs of lanes that do four springs each.
    #[inline(always)]
    fn lanes<L: Lanes>(&self) -> impl Iterator<Item = usize> + use<L> {
        let groups = self.springs.len();
        (0..groups * BLOCK)
            .step_by(L::WIDTH)
            .map(|lane| lane / BLOCK * GROUP + lane % BLOCK)
    }

    fn fetch(&mut self, lattice: &Lattice, position: &Pair) {
        for axis in [X, Y] {
            for (vector, spring) in self.vector[axis]
                .iter_mut()
                .zip(&lattice.off_lattice_springs)
            {
                *vector = position[axis][spring.ends[1]] - position[axis][spring.ends[0]];
            }
        }
    }

    #[inline(always)]
    fn squares<L: Lanes>(&self, at: usize) -> ([[L; 4]; 2], [L; 4]) {
        let [x, y] = each!(axis in [X, Y] => {
            each!(i in [0, 1, 2, 3] => L::load(&self.vector[axis], at + i * BLOCK))
        });
        (
            [x, y],
            each!(i in [0, 1, 2, 3] => x[i].mul_add(x[i], y[i] * y[i])),
        )
    }

    #[inline(always)]
    fn put<L: Lanes>(&mut self, at: usize, vector: [[L; 4]; 2], pull: [L; 4]) {
        for axis in [X, Y] {
            for i in 0..4 {
                (pull[i] * vector[axis][i]).store(&mut self.change[axis], at + i * BLOCK);
            }
        }
    }

    fn load_points(&mut self, lattice: &Lattice) {
        for spring in &lattice.off_lattice_springs {
            spring
                .ends
                .iter()
                .for_each(|&end| (self.load[X][end], self.load[Y][end]) = (0.0, 0.0));
        }
        // Springs act on masses: their stiffness is already per mass.
        feed(lattice, &self.change, &mut self.load);
    }
}

fn feed(lattice: &Lattice, change: &Pair, to: &mut Pair) {
    for axis in [X, Y] {
        for (change, spring) in change[axis].iter().zip(&lattice.off_lattice_springs) {
            to[axis][spring.ends[0]] += change;
            to[axis][spring.ends[1]] -= change;
        }
    }
}
