//! Length limits: positions are corrected so that no spring is far from its rest length (physics.md, 4).

use super::forces::gather;
use super::lattice::Lattice;
use super::params::Physics;
use super::state::{Axis, Pair, Scratch, State};

/// How far a length is beyond its limits \[wu\]: positive when too long, negative when too short.
#[inline(always)]
fn excess(length: f64, low: f64, high: f64) -> f64 {
    if length > high {
        length - high
    } else if length < low {
        length - low
    } else {
        0.0
    }
}

/// All springs at once: corrections from the same positions, then added up.
#[inline(always)]
pub(super) fn limit_all(lattice: &Lattice, physics: &Physics, state: &mut State, scratch: &mut Scratch) {
    let (slots, margin) = (lattice.slots, scratch.margin);
    let share = physics.limit_share / 2.0;
    let mut any = false;
    for (family, pull) in lattice.families.iter().zip(&mut scratch.pull) {
        let (a, b) = (family.from..family.from + slots, family.to..family.to + slots);
        let (ax, ay, bx, by) = (&state.x[a.clone()], &state.y[a], &state.x[b.clone()], &state.y[b]);
        let (low, high) = (&family.limits.0[..slots], &family.limits.1[..slots]);
        let (px, py) = (&mut pull.x[margin..margin + slots], &mut pull.y[margin..margin + slots]);
        let mut beyond = 0.0f64;
        for i in 0..slots {
            let (dx, dy) = (bx[i] - ax[i], by[i] - ay[i]);
            let length = (dx * dx + dy * dy).sqrt();
            let excess = excess(length, low[i], high[i]);
            let factor = share * excess / length;
            px[i] = factor * dx;
            py[i] = factor * dy;
            beyond = if excess.abs() > beyond { excess.abs() } else { beyond };
        }
        any |= beyond > 0.0;
    }
    // The extra springs' corrections too come from the positions before any correction.
    if !lattice.extra_springs.is_empty() {
        any |= limit_extra(lattice, physics, state, &mut scratch.acceleration);
    }
    if !any {
        return;
    }
    let x = &mut state.x[..slots];
    gather(lattice, margin, &scratch.pull, Axis::X, |i, sum| x[i] += sum);
    let y = &mut state.y[..slots];
    gather(lattice, margin, &scratch.pull, Axis::Y, |i, sum| y[i] += sum);
    if !lattice.extra_springs.is_empty() {
        for spring in &lattice.extra_springs {
            for point in spring.ends {
                // Each point's sum is added once, however many of its springs are extra.
                state.x[point] += std::mem::take(&mut scratch.acceleration.x[point]);
                state.y[point] += std::mem::take(&mut scratch.acceleration.y[point]);
            }
        }
    }
}

/// Corrections of the extra springs, summed per point into `sums`; whether there were any.
fn limit_extra(lattice: &Lattice, physics: &Physics, state: &State, sums: &mut Pair) -> bool {
    for point in lattice.extra_springs.iter().flat_map(|spring| spring.ends) {
        sums.x[point] = 0.0;
        sums.y[point] = 0.0;
    }
    let mut any = false;
    for spring in &lattice.extra_springs {
        let [a, b] = spring.ends;
        let (dx, dy) = (state.x[b] - state.x[a], state.y[b] - state.y[a]);
        let length = (dx * dx + dy * dy).sqrt();
        let excess = excess(length, physics.limit_low * spring.length, physics.limit_high * spring.length);
        if excess != 0.0 {
            any = true;
            let factor = physics.limit_share / 2.0 * excess / length;
            sums.x[a] += factor * dx;
            sums.y[a] += factor * dy;
            sums.x[b] -= factor * dx;
            sums.y[b] -= factor * dy;
        }
    }
    any
}

/// The sides of rigid voxels, one after the other on current positions; a side shared by two comes up twice.
pub(super) fn limit_rigid(lattice: &Lattice, physics: &Physics, state: &mut State) {
    let low = physics.rigid_limit_low * physics.cell_size;
    let high = physics.rigid_limit_high * physics.cell_size;
    let (low_square, high_square) = (low * low, high * high);
    for &[a, b] in &lattice.rigid_links {
        let (dx, dy) = (state.x[b] - state.x[a], state.y[b] - state.y[a]);
        let square = dx * dx + dy * dy;
        if square > high_square || square < low_square {
            let length = square.sqrt();
            let factor = physics.rigid_limit_share / 2.0 * excess(length, low, high) / length;
            state.x[a] += factor * dx;
            state.y[a] += factor * dy;
            state.x[b] -= factor * dx;
            state.y[b] -= factor * dy;
        }
    }
}
