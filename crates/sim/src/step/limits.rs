//! Length limits: corrected positions keep springs near their rest lengths (physics.md, "One
//! substep", 4).
//!
//! A spring beyond a limit l is corrected by (1 − l/d) of its vector. With t = d²/l² − 1, which is
//! small, that is 1 − 1/√(1 + t) again: usually neither root nor division.

use crate::lattice::{FAMILIES, Lattice};
use crate::simd::{BLOCK, Lanes, each};
use crate::state::{Pair, X, Y, slices, slices_mut};
use crate::step::series::{RANGE, TERMS, rsqrt_exact, rsqrt_series};
use crate::step::springs::{Gather, squares, vectors};
use crate::system::System;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Squares of the least and greatest length.
    squares: [f64; 2],
    /// Middle and half width of the range between them.
    middle: f64,
    half: f64,
}

impl Limits {
    pub fn new(length: f64, low: f64, high: f64) -> Self {
        let [low, high] = [low * length, high * length].map(|limit| limit * limit);
        Limits {
            squares: [low, high],
            middle: (low + high) / 2.0,
            half: (high - low) / 2.0,
        }
    }

    /// Returns t for a squared length beyond the limits: above 0 if too long, below if too short.
    #[inline(always)]
    pub fn excess<L: Lanes>(&self, square: L) -> L {
        let [low, high] = each!(i in [0, 1] => L::splat(1.0 / self.squares[i]));
        let limit = L::select(square.gt(L::splat(self.middle)), high, low);
        square.mul_add(limit, L::splat(-1.0))
    }

    /// Returns a mask of squared lengths beyond the limits; false where `exists` is 0.
    #[inline(always)]
    pub fn beyond<L: Lanes>(&self, square: L, exists: L) -> L::Mask {
        (square - L::splat(self.middle))
            .bits_and(exists)
            .gt(L::splat(self.half))
    }
}

/// The cases that a sweep must handle: the rarer ones cost more time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Reach {
    /// Only horizontal springs, the actuated ones, are beyond their limits.
    #[default]
    Horizontal,
    /// Springs of any family are.
    Any,
    /// Some are too far for the series.
    Far,
}

/// Limits all springs at once, on the same positions. `reach` is a guess that changes no result.
#[inline(always)]
pub(crate) fn limit_all<L: Lanes>(
    system: &System,
    from: &Pair,
    to: &mut Pair,
    carry: &mut Pair,
    reach: &mut Reach,
) {
    loop {
        let found = match *reach {
            Reach::Horizontal => limit_horizontal::<L>(system, from, to),
            Reach::Any => limit_any::<L, false>(system, from, to, carry),
            Reach::Far => limit_any::<L, true>(system, from, to, carry),
        };
        let enough = found <= *reach;
        *reach = found;
        if enough {
            break;
        }
    }
}

#[inline(always)]
fn reach<L: Lanes>(any: L::Mask, far: L::Mask) -> Reach {
    if L::any(far) {
        Reach::Far
    } else if L::any(any) {
        Reach::Any
    } else {
        Reach::Horizontal
    }
}

#[inline(always)]
fn limits(System { lattice, physics }: &System) -> [Limits; FAMILIES] {
    each!(i in [0, 1, 2, 3] => Limits::new(lattice.lengths[i], physics.limit_low, physics.limit_high))
}

#[inline(always)]
fn limit_horizontal<L: Lanes>(system: &System, from: &Pair, to: &mut Pair) -> Reach {
    let System { lattice, physics } = system;
    let limits = limits(system);
    let share = L::splat(physics.limit_share / 2.0);
    let (exists, _) = lattice.exists.as_chunks::<{ FAMILIES * BLOCK }>();
    let (from, to) = (slices(from, lattice.len), slices_mut(to, lattice.len));
    let zero = L::splat(0.0);
    let (mut others, mut far) = (zero.gt(zero), zero.gt(zero));
    for range in &lattice.active_ranges {
        let mut gather = Gather::<L>::new([&mut [], &mut []], lattice.pitch);
        for slot in range.clone().step_by(L::WIDTH) {
            let vectors = vectors(from, slot, lattice.pitch);
            let (exists, lane) = (&exists[slot / BLOCK], slot % BLOCK);
            let squares = squares(&vectors);
            let [beyond, other @ ..] = each!(i in [0, 1, 2, 3] => {
                limits[i].beyond(squares[i], L::load(exists, i * BLOCK + lane))
            });
            others = others | ((other[0] | other[1]) | other[2]);
            let t = L::select(beyond, limits[0].excess(squares[0]), zero);
            far = far | t.abs().gt(L::splat(RANGE));
            let sums = gather.next_horizontal(share * rsqrt_series(t), &vectors);
            (L::load(from[X], slot) + sums[X]).store(to[X], slot);
            (L::load(from[Y], slot) + sums[Y]).store(to[Y], slot);
        }
    }
    reach::<L>(others, far)
}

#[inline(always)]
fn limit_any<L: Lanes, const FAR: bool>(
    system: &System,
    from: &Pair,
    to: &mut Pair,
    carry: &mut Pair,
) -> Reach {
    let System { lattice, physics } = system;
    let limits = limits(system);
    let share = L::splat(physics.limit_share / 2.0);
    let (exists, _) = lattice.exists.as_chunks::<{ FAMILIES * BLOCK }>();
    let (from, to) = (slices(from, lattice.len), slices_mut(to, lattice.len));
    let [carry_x, carry_y] = slices_mut(carry, lattice.len);
    let zero = L::splat(0.0);
    let (mut others, mut far) = (zero.gt(zero), zero.gt(zero));
    for range in &lattice.active_ranges {
        let mut gather = Gather::<L>::new([carry_x, carry_y], lattice.pitch);
        for slot in range.clone().step_by(L::WIDTH) {
            let vectors = vectors(from, slot, lattice.pitch);
            let (exists, lane) = (&exists[slot / BLOCK], slot % BLOCK);
            let squares = squares(&vectors);
            let beyond = each!(i in [0, 1, 2, 3] => {
                limits[i].beyond(squares[i], L::load(exists, i * BLOCK + lane))
            });
            let other = (beyond[1] | beyond[2]) | beyond[3];
            if !L::any(other | beyond[0]) {
                let sums = gather.next_nothing(slot);
                (L::load(from[X], slot) + sums[X]).store(to[X], slot);
                (L::load(from[Y], slot) + sums[Y]).store(to[Y], slot);
                continue;
            }
            others = others | other;
            let t = each!(i in [0, 1, 2, 3] => L::select(beyond[i], limits[i].excess(squares[i]), zero));
            let greatest = t[0].max_abs(t[1]).max_abs(t[2].max_abs(t[3]));
            far = far | greatest.gt(L::splat(RANGE));
            let pull = each!(i in [0, 1, 2, 3] => share * if FAR { rsqrt_exact(t[i]) } else { rsqrt_series(t[i]) });
            let sums = gather.next(pull, &vectors, slot);
            (L::load(from[X], slot) + sums[X]).store(to[X], slot);
            (L::load(from[Y], slot) + sums[Y]).store(to[Y], slot);
        }
    }
    reach::<L>(others, far)
}

/// Limits rigid voxels' sides one by one, on current positions; shared sides are visited twice.
pub(crate) fn limit_rigid(System { lattice, physics }: &System, [x, y]: &mut Pair) {
    let limits = Limits::new(
        physics.cell_size,
        physics.rigid_limit_low,
        physics.rigid_limit_high,
    );
    let [low, high] = limits.squares;
    let share = physics.rigid_limit_share / 2.0;
    let (x, y) = (&mut x[..], &mut y[..]);
    for &[a, b] in &lattice.rigid_links {
        let (dx, dy) = (x[b] - x[a], y[b] - y[a]);
        let square = dx * dx + dy * dy;
        if square > high || square < low {
            let limit = if square > high { high } else { low };
            let factor = share * shrink_scalar((square - limit) * (1.0 / limit));
            x[a] += factor * dx;
            y[a] += factor * dy;
            x[b] -= factor * dx;
            y[b] -= factor * dy;
        }
    }
}

/// The rigid pass for several simulations at once, one per lane, with [`limit_rigid`]'s bits.
#[derive(Clone, Debug)]
pub(crate) struct SharedRigidPass {
    /// Points of rigid sides.
    points: Vec<usize>,
    /// [`Lattice::rigid_links`] with their ends as indices into `points`.
    links: Vec<[usize; 2]>,
    /// Coordinates of the points, those of all simulations side by side.
    at: [Vec<[f64; BLOCK]>; 2],
}

impl SharedRigidPass {
    /// Fewest rigid sides for which it pays off.
    pub const LEAST: usize = 4 * BLOCK;

    pub fn new(lattice: &Lattice) -> Self {
        let mut points: Vec<usize> = lattice.rigid_links.iter().flatten().copied().collect();
        points.sort_unstable();
        points.dedup();
        let place = |point: usize| {
            points
                .binary_search(&point)
                .expect("every end is among the points")
        };
        let links = lattice
            .rigid_links
            .iter()
            .map(|ends| ends.map(place))
            .collect();
        let at = || vec![[0.0; BLOCK]; points.len()];
        SharedRigidPass {
            links,
            at: [at(), at()],
            points,
        }
    }

    /// Returns true if it is faster for this many simulations than one after the other: copying in
    /// and out costs about as much as three of them.
    pub fn is_worth_it(&self, simulations: usize) -> bool {
        simulations > 3 && self.links.len() >= SharedRigidPass::LEAST
    }

    /// Corrects the positions of each simulation; at most [`BLOCK`] of them.
    #[inline(always)]
    pub fn limit<'p, L: Lanes>(
        &mut self,
        System { physics, .. }: &System,
        positions: impl Iterator<Item = &'p mut Pair>,
    ) {
        let SharedRigidPass {
            points,
            links,
            at: [x, y],
        } = self;
        let mut positions: [Option<&mut Pair>; BLOCK] = {
            let mut positions = positions;
            std::array::from_fn(|_| positions.next())
        };
        for (lane, position) in positions.iter().enumerate() {
            let Some([from_x, from_y]) = position else {
                continue;
            };
            for (&point, (x, y)) in points.iter().zip(x.iter_mut().zip(y.iter_mut())) {
                (x[lane], y[lane]) = (from_x[point], from_y[point]);
            }
        }
        let limits = Limits::new(
            physics.cell_size,
            physics.rigid_limit_low,
            physics.rigid_limit_high,
        );
        let [low, high] = each!(i in [0, 1] => L::splat(limits.squares[i]));
        let [of_low, of_high] = each!(i in [0, 1] => L::splat(1.0 / limits.squares[i]));
        let (share, zero) = (L::splat(physics.rigid_limit_share / 2.0), L::splat(0.0));
        for &[a, b] in links.iter() {
            for lane in (0..BLOCK).step_by(L::WIDTH) {
                let [xa, xb, ya, yb] = [
                    L::load(&x[a], lane),
                    L::load(&x[b], lane),
                    L::load(&y[a], lane),
                    L::load(&y[b], lane),
                ];
                let (dx, dy) = (xb - xa, yb - ya);
                let square = dx * dx + dy * dy;
                let (long, short) = (square.gt(high), low.gt(square));
                let beyond = long | short;
                if !L::any(beyond) {
                    continue;
                }
                let t = (square - L::select(long, high, low)) * L::select(long, of_high, of_low);
                let factor = share * shrink(L::select(beyond, t, zero));
                // Where nothing is beyond a limit, not even the sign of a zero may change.
                L::select(beyond, xa + factor * dx, xa).store(&mut x[a], lane);
                L::select(beyond, ya + factor * dy, ya).store(&mut y[a], lane);
                L::select(beyond, xb - factor * dx, xb).store(&mut x[b], lane);
                L::select(beyond, yb - factor * dy, yb).store(&mut y[b], lane);
            }
        }
        for (lane, position) in positions.iter_mut().enumerate() {
            let Some([to_x, to_y]) = position else {
                continue;
            };
            for (&point, (x, y)) in points.iter().zip(x.iter().zip(y.iter())) {
                (to_x[point], to_y[point]) = (x[lane], y[lane]);
            }
        }
    }
}

#[inline(always)]
fn shrink<L: Lanes>(t: L) -> L {
    let [c0, c1, c2, c3, c4, c5] = each!(i in [0, 1, 2, 3, 4, 5] => L::splat(TERMS[i]));
    let square = t * t;
    let near = ((c0 + c1 * t) + square * ((c2 + c3 * t) + square * (c4 + c5 * t))) * t;
    let far = t.abs().gt(L::splat(RANGE));
    if !L::any(far) {
        return near;
    }
    let one = L::splat(1.0);
    L::select(far, one - one / (one + t).sqrt(), near)
}

/// Returns 1 − 1/√(1 + t), in the order with the shortest dependency chain.
#[inline(always)]
fn shrink_scalar(t: f64) -> f64 {
    if t.abs() > RANGE {
        return 1.0 - 1.0 / (1.0 + t).sqrt();
    }
    let [c0, c1, c2, c3, c4, c5] = TERMS;
    let square = t * t;
    ((c0 + c1 * t) + square * ((c2 + c3 * t) + square * (c4 + c5 * t))) * t
}
