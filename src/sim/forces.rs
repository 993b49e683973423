//! Spring forces on wide lanes.
//!
//! A sweep goes over the lattice's slots block by block. Each slot has four springs (horizontal, vertical, falling,
//! rising), which look only ahead: to the slot's own point, the one to the right, and those two below. So what a
//! spring does to points ahead is handed on ([`Passing`]), each point's forces are added up in the same order on
//! any lanes, and a block's results may overwrite its inputs.
//!
//! A spring of stiffness k and rest length ρ, of length d₀ at the start of the substep, pulls with k(1 − ρ/d)w when
//! its vector w has length d. With t = d²/d₀² − 1 that is
//!
//!   k(1 − ρ/d₀) + k(ρ/d₀)·(1 − 1/√(1 + t)) = `initial` + `change`·(1 − 1/√(1 + t)).
//!
//! Within a substep t is small, and [`shrink`] is a short series: neither root nor division.

use super::lattice::FAMILIES;
use super::state::{X, Y};
use crate::base::lanes::{BLOCK, Lanes, each};

/// Greatest |t| for the series: the terms left out are then below 3.5e-12, and 5e-14 at half of it. Springs beyond it
/// (well below one in 1000) are computed with root and division.
pub(super) const SERIES_RANGE: f64 = 1.0 / 64.0;

/// (1 − 1/√(1 + t))/t up to t⁴: the binomial series.
pub(super) const SERIES: [f64; 5] = [1.0 / 2.0, -3.0 / 8.0, 5.0 / 16.0, -35.0 / 128.0, 63.0 / 256.0];

/// (1 − 1/√(1 + t))/t for |t| in the series' range.
#[inline(always)]
fn series<L: Lanes>(t: L) -> L {
    let [c0, c1, c2, c3, c4] = each!(i in [0, 1, 2, 3, 4] => L::splat(SERIES[i]));
    c4.mul_add(t, c3).mul_add(t, c2).mul_add(t, c1).mul_add(t, c0)
}

/// The greatest of four |t|.
#[inline(always)]
fn greatest<L: Lanes>(t: &[L; 4]) -> L {
    (t[0].abs().max(t[1].abs())).max(t[2].abs().max(t[3].abs()))
}

/// offset + factor·(1 − 1/√(1 + t)) by the series or, beyond its range, exactly: spring by spring.
#[inline(always)]
pub(super) fn shrink<L: Lanes>(t: [L; 4], factor: [L; 4], offset: [L; 4]) -> [L; 4] {
    let mut out = each!(i in [0, 1, 2, 3] => (factor[i] * t[i]).mul_add(series(t[i]), offset[i]));
    let range = L::splat(SERIES_RANGE);
    if L::any(greatest(&t).above(range)) {
        let one = L::splat(1.0);
        for i in 0..4 {
            let exact = factor[i].mul_add(one - one / (one + t[i]).sqrt(), offset[i]);
            out[i] = exact.or_else(t[i].abs().above(range), out[i]);
        }
    }
    out
}

/// A number for each slot of a block.
pub(super) type Wide = [f64; BLOCK];

/// What a substep needs to know of four springs each of a block of slots.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Springs {
    /// 1/d₀², and see the module \[1/s²\].
    inverse_square: [Wide; FAMILIES],
    initial: [Wide; FAMILIES],
    change: [Wide; FAMILIES],
    /// 1/d₀. Within a control step the next substep's is found from it by the same series; the first substep of
    /// each control step starts from 0, which is out of the series' range, and so from root and division: a
    /// life continued from its state is the same bits.
    inverse_length: [Wide; FAMILIES],
    /// Stiffness per mass of a point \[1/s²\]; 0 where there is no spring.
    stiffness: [Wide; FAMILIES],
}

impl Springs {
    /// Of springs of some stiffness, by blocks, in a block by families.
    pub fn blocks(stiffness: &[f64], mass: f64) -> Vec<Self> {
        let zeros = [[0.0; BLOCK]; FAMILIES];
        let block = |of: &[f64]| Springs {
            inverse_square: zeros,
            initial: zeros,
            change: zeros,
            inverse_length: zeros,
            stiffness: std::array::from_fn(|f| std::array::from_fn(|i| of[f * BLOCK + i] / mass)),
        };
        stiffness.chunks_exact(FAMILIES * BLOCK).map(block).collect()
    }

    /// Forgets the lengths of the last substep.
    pub fn forget(&mut self) {
        self.inverse_length = [[0.0; BLOCK]; FAMILIES];
        self.inverse_square = self.inverse_length;
    }

    /// Sets this substep's rest lengths, a small part (`gain`) of the way from the present lengths to the goals
    /// (physics.md, 2); gives the pull of each spring per vector.
    #[inline(always)]
    pub fn servo<L: Lanes>(&mut self, lane: usize, square: [L; 4], goal: [L; 4], gain: f64) -> [L; 4] {
        let (one, gain) = (L::splat(1.0), L::splat(gain));
        let before = each!(i in [0, 1, 2, 3] => L::load(&self.inverse_length[i], lane));
        let t = each!(i in [0, 1, 2, 3] => {
            square[i].mul_add(L::load(&self.inverse_square[i], lane), L::splat(-1.0))
        });
        let mut inverse =
            each!(i in [0, 1, 2, 3] => (before[i] * t[i]).mul_sub_from(series(t[i]), before[i]));
        let range = L::splat(SERIES_RANGE);
        if L::any(greatest(&t).above(range)) {
            for i in 0..4 {
                // The floor is for what is no spring, between points at the same place.
                let exact = one / square[i].max(L::splat(1e-60)).sqrt();
                inverse[i] = exact.or_else(t[i].abs().above(range), inverse[i]);
            }
        }
        each!(i in [0, 1, 2, 3] => {
            // rest/d₀ = 1 − gain·(1 − goal/d₀)
            let stiffness = L::load(&self.stiffness[i], lane);
            let initial = (stiffness * gain) * goal[i].mul_sub_from(inverse[i], one);
            inverse[i].store(&mut self.inverse_length[i], lane);
            (inverse[i] * inverse[i]).store(&mut self.inverse_square[i], lane);
            initial.store(&mut self.initial[i], lane);
            (stiffness - initial).store(&mut self.change[i], lane);
            initial
        })
    }

    /// The pull of each spring per vector at some later squared lengths in the same substep.
    #[inline(always)]
    pub fn pull<L: Lanes>(&self, lane: usize, square: [L; 4]) -> [L; 4] {
        let t = each!(i in [0, 1, 2, 3] => {
            square[i].mul_add(L::load(&self.inverse_square[i], lane), L::splat(-1.0))
        });
        let change = each!(i in [0, 1, 2, 3] => L::load(&self.change[i], lane));
        shrink(t, change, each!(i in [0, 1, 2, 3] => L::load(&self.initial[i], lane)))
    }
}

/// The vectors of a slot's four springs, by axis.
pub(super) type Vectors<L> = [[L; FAMILIES]; 2];

/// The vectors of a slot's springs at some positions.
#[inline(always)]
pub(super) fn vectors<L: Lanes>(position: [&[f64]; 2], slot: usize, pitch: usize) -> Vectors<L> {
    each!(axis in [X, Y] => {
        let of = position[axis];
        let (own, right) = (L::load(of, slot), L::load(of, slot + 1));
        let (below, opposite) = (L::load(of, slot + pitch), L::load(of, slot + pitch + 1));
        [right - own, below - own, opposite - own, below - right]
    })
}

/// Their squared lengths.
#[inline(always)]
pub(super) fn squares<L: Lanes>([x, y]: &Vectors<L>) -> [L; FAMILIES] {
    each!(i in [0, 1, 2, 3] => x[i].mul_add(x[i], y[i] * y[i]))
}

/// Sums on the points of what their own springs and those of slots gone by do to them. What slots gone by do to
/// points below waits in `passing`, by point; zeros in the first row.
pub(super) struct Gather<'a, L> {
    passing: [&'a mut [f64]; 2],
    pitch: usize,
    /// What the springs of the block before do to points at their right: in their own row, and in the row below.
    beside: [L; 2],
    below: [L; 2],
}

impl<'a, L: Lanes> Gather<'a, L> {
    /// For a run of blocks.
    #[inline(always)]
    pub fn new(passing: [&'a mut [f64]; 2], pitch: usize) -> Self {
        let nothing = [L::splat(0.0); 2];
        Gather { passing, pitch, beside: nothing, below: nothing }
    }

    /// The sum of all springs' pulls on the points at the next slot, given how the slot's own pull.
    #[inline(always)]
    pub fn next(&mut self, pull: [L; FAMILIES], vectors: &Vectors<L>, slot: usize) -> [L; 2] {
        each!(axis in [X, Y] => {
            let vector = &vectors[axis];
            let (horizontal, vertical) = (pull[0] * vector[0], pull[1] * vector[1]);
            let (falling, rising) = (pull[2] * vector[2], pull[3] * vector[3]);
            let own = (horizontal + vertical) + falling;
            let beside = rising - horizontal;
            let below = (vertical + rising) + falling.after(self.below[axis]);
            // In this order: of a narrow body the row above is in the same block.
            below.store(self.passing[axis], slot + self.pitch);
            let above = L::load(self.passing[axis], slot);
            let sum = (own - above) + beside.after(self.beside[axis]);
            self.beside[axis] = beside;
            self.below[axis] = falling;
            sum
        })
    }
}
