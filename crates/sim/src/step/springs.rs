//! Spring forces on wide lanes.
//!
//! A sweep goes over the lattice's slots block by block. Each slot has four springs (horizontal,
//! vertical, falling, rising), which only look ahead: to the slot's own point, the one to the
//! right, and the two below. So forces on points ahead are passed on (`carry` of [`Gather`]), each
//! point adds up its forces in one order on any lanes, and blocks may overwrite their inputs.
//!
//! A spring of stiffness k and rest length ρ, of length d₀ at the start of the substep, pulls with
//! k(1 − ρ/d)w when its vector w has length d. With t = d²/d₀² − 1 that is
//!
//! k(1 − ρ/d₀) + k(ρ/d₀)·(1 − 1/√(1 + t)) = `initial` + `change`·(1 − 1/√(1 + t)).
//!
//! Within a substep t is small: a short series ([`super::series`]) avoids root and division.

use crate::lattice::FAMILIES;
use crate::simd::{BLOCK, Lanes, each};
use crate::state::{X, Y};
use crate::step::series::{RANGE, rsqrt_exact, rsqrt_series};

/// Detects irregular springs and points in a sweep that assumes all are regular. A branch in every
/// block would cost more than the rare second sweep that treats each irregular one exactly.
#[derive(Clone, Copy)]
pub(crate) struct Watch<L> {
    stretch: L,
    depth: L,
}

impl<L: Lanes> Watch<L> {
    #[inline(always)]
    pub fn new() -> Self {
        Watch {
            stretch: L::splat(0.0),
            depth: L::splat(0.0),
        }
    }

    /// Watches springs for which the series must hold.
    #[inline(always)]
    pub fn springs(&mut self, t: &[L; 4]) {
        let [first, second] = each!(i in [0, 2] => t[i].max_abs(t[i + 1]));
        self.stretch = first.max_abs(second).max_abs(self.stretch);
    }

    /// Watches points that must be above the floor plane. A point at NaN is caught by its springs.
    #[inline(always)]
    pub fn points(&mut self, y: L) {
        self.depth = (L::splat(0.0) - y).max(self.depth);
    }

    /// Returns true if all was regular; false if a spring's stretch is NaN.
    #[inline(always)]
    pub fn regular(self) -> bool {
        let within = L::splat(RANGE.next_up()).gt(self.stretch);
        L::all(within) && !L::any(self.depth.gt(L::splat(0.0)))
    }
}

pub(crate) type Wide = [f64; BLOCK];

/// Data of four springs per slot of a block, kept from one substep to the next.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Springs {
    /// 1/d₀ of the latest substep, from which the next finds its own by the series. 0 at the start
    /// of a control step, hence root and division: a continued simulation gives the same bits.
    inverse_length: [Wide; FAMILIES],
    /// Stiffness per mass of a point, times the servo's gain \[1/s²\]; 0 where there is no spring.
    driven: [Wide; FAMILIES],
}

/// Data of the springs of a block that the later stages of a substep need.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Pulls {
    /// 1/d₀²; for the others see the module \[1/s²\].
    inverse_square: [Wide; FAMILIES],
    initial: [Wide; FAMILIES],
    change: [Wide; FAMILIES],
}

impl Pulls {
    pub const ZERO: Pulls = {
        let zeros = [[0.0; BLOCK]; FAMILIES];
        Pulls {
            inverse_square: zeros,
            initial: zeros,
            change: zeros,
        }
    };

    /// Returns the pull of each spring per vector at later squared lengths in the same substep.
    #[inline(always)]
    pub fn at<L: Lanes, const EXACT: bool>(
        &self,
        lane: usize,
        square: [L; 4],
        watch: Option<&mut Watch<L>>,
    ) -> [L; 4] {
        let t = each!(i in [0, 1, 2, 3] => {
            square[i].mul_add(L::load(&self.inverse_square[i], lane), L::splat(-1.0))
        });
        if let Some(watch) = watch {
            watch.springs(&t);
        }
        each!(i in [0, 1, 2, 3] => {
            let shrunk = if EXACT { rsqrt_exact(t[i]) } else { rsqrt_series(t[i]) };
            L::load(&self.change[i], lane).mul_add(shrunk, L::load(&self.initial[i], lane))
        })
    }
}

impl Springs {
    /// Makes springs from their stiffness, which is ordered by blocks, then by families.
    pub fn blocks(stiffness: &[f64], mass: f64, gain: f64) -> Vec<Self> {
        let block = |of: &[f64]| Springs {
            inverse_length: [[0.0; BLOCK]; FAMILIES],
            driven: std::array::from_fn(|f| {
                std::array::from_fn(|i| of[f * BLOCK + i] / mass * gain)
            }),
        };
        stiffness
            .chunks_exact(FAMILIES * BLOCK)
            .map(block)
            .collect()
    }

    /// Forgets the lengths of the last substep.
    pub fn forget(&mut self) {
        self.inverse_length = [[0.0; BLOCK]; FAMILIES];
    }

    /// Sets this substep's rest lengths in `pulls`, a small part (`gain`) of the way from the
    /// current lengths to the goals (physics.md, "One substep", 2). Returns the pull of each spring
    /// per vector. With `EXACT`, finds all lengths with root and division.
    #[inline(always)]
    pub fn servo<L: Lanes, const EXACT: bool>(
        &mut self,
        pulls: &mut Pulls,
        lane: usize,
        square: [L; 4],
        (goal, gain): ([L; 4], f64),
        watch: &mut Watch<L>,
    ) -> [L; 4] {
        let (one, inverse_gain) = (L::splat(1.0), L::splat(1.0 / gain));
        let inverse = if EXACT {
            // The lower bound is for missing springs, between points at the same position.
            each!(i in [0, 1, 2, 3] => one / square[i].max(L::splat(1e-60)).sqrt())
        } else {
            let before = each!(i in [0, 1, 2, 3] => L::load(&self.inverse_length[i], lane));
            let t = each!(i in [0, 1, 2, 3] => {
                square[i].mul_add(before[i] * before[i], L::splat(-1.0))
            });
            watch.springs(&t);
            each!(i in [0, 1, 2, 3] => before[i].mul_sub_from(rsqrt_series(t[i]), before[i]))
        };
        each!(i in [0, 1, 2, 3] => {
            // rest/d₀ = 1 − gain·(1 − goal/d₀)
            let driven = L::load(&self.driven[i], lane);
            let initial = driven * goal[i].mul_sub_from(inverse[i], one);
            inverse[i].store(&mut self.inverse_length[i], lane);
            (inverse[i] * inverse[i]).store(&mut pulls.inverse_square[i], lane);
            initial.store(&mut pulls.initial[i], lane);
            driven.mul_sub(inverse_gain, initial).store(&mut pulls.change[i], lane);
            initial
        })
    }
}

/// The vectors of a slot's four springs, by axis.
pub(crate) type Vectors<L> = [[L; FAMILIES]; 2];

/// Returns the vectors of a slot's springs at some positions.
#[inline(always)]
pub(crate) fn vectors<L: Lanes>(position: [&[f64]; 2], slot: usize, pitch: usize) -> Vectors<L> {
    each!(axis in [X, Y] => {
        let of = position[axis];
        let (own, right) = (L::load(of, slot), L::load(of, slot + 1));
        let (below, opposite) = (L::load(of, slot + pitch), L::load(of, slot + pitch + 1));
        [right - own, below - own, opposite - own, below - right]
    })
}

#[inline(always)]
pub(crate) fn squares<L: Lanes>([x, y]: &Vectors<L>) -> [L; FAMILIES] {
    each!(i in [0, 1, 2, 3] => x[i].mul_add(x[i], y[i] * y[i]))
}

/// Sums the forces of springs on points: those of the slot's own springs and of earlier slots'.
/// Forces of earlier slots on points below wait in `carry`, by point; zeros in the first row.
pub(crate) struct Gather<'a, L> {
    carry: [&'a mut [f64]; 2],
    pitch: usize,
    /// The previous block's forces on points at its right: in its own row, and in the row below.
    beside: [L; 2],
    below: [L; 2],
}

impl<'a, L: Lanes> Gather<'a, L> {
    /// Starts an active range of blocks.
    #[inline(always)]
    pub fn new(carry: [&'a mut [f64]; 2], pitch: usize) -> Self {
        let nothing = [L::splat(0.0); 2];
        Gather {
            carry,
            pitch,
            beside: nothing,
            below: nothing,
        }
    }

    /// Returns the sum of all pulls on the points at the next slot, given those of its own springs.
    #[inline(always)]
    pub fn next(&mut self, pull: [L; FAMILIES], vectors: &Vectors<L>, slot: usize) -> [L; 2] {
        each!(axis in [X, Y] => {
            let vector = &vectors[axis];
            let (horizontal, vertical) = (pull[0] * vector[0], pull[1] * vector[1]);
            let (falling, rising) = (pull[2] * vector[2], pull[3] * vector[3]);
            let own = (horizontal + vertical) + falling;
            let beside = rising - horizontal;
            let below = (vertical + rising) + falling.shift_in(self.below[axis]);
            // The order matters: in a narrow body the row above is in the same block.
            below.store(self.carry[axis], slot + self.pitch);
            let above = L::load(self.carry[axis], slot);
            let sum = (own - above) + beside.shift_in(self.beside[axis]);
            self.beside[axis] = beside;
            self.below[axis] = falling;
            sum
        })
    }

    /// Acts as [`Gather::next`] where no spring pulls.
    #[inline(always)]
    pub fn next_nothing(&mut self, slot: usize) -> [L; 2] {
        let zero = L::splat(0.0);
        each!(axis in [X, Y] => {
            zero.shift_in(self.below[axis]).store(self.carry[axis], slot + self.pitch);
            let above = L::load(self.carry[axis], slot);
            let sum = zero.shift_in(self.beside[axis]) - above;
            (self.beside[axis], self.below[axis]) = (zero, zero);
            sum
        })
    }

    /// Acts as [`Gather::next`] in a sweep in which only horizontal springs pull.
    #[inline(always)]
    pub fn next_horizontal(&mut self, pull: L, vectors: &Vectors<L>) -> [L; 2] {
        each!(axis in [X, Y] => {
            let horizontal = pull * vectors[axis][0];
            let sum = horizontal - horizontal.shift_in(self.beside[axis]);
            self.beside[axis] = horizontal;
            sum
        })
    }
}
