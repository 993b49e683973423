//! Classical fourth-order Runge–Kutta over one substep (physics.md, 3).
//!
//! With accelerations a₁ … a₄ the four stages' positions are x₀, x₀ + (h/2)v₀, x₀ + (h/2)v₀ + (h²/4)a₁ and
//! x₀ + hv₀ + (h²/2)a₂, so those of the first two are known at the start and those of the last two after the second;
//! and the new positions are x₀ + hv₀ + (h²/6)(a₁ + a₂ + a₃). One sweep over the springs a stage: two in one would need more
//! registers than there are, and what is spilled fills the queue of stores.

use super::extra::Extra;
use super::forces::{Gather, squares, vectors};
use super::lattice::Lattice;
use super::params::Physics;
use super::state::{Pair, Scratch, State, X, Y, slices, slices_mut};
use crate::base::lanes::{BLOCK, Lanes, each};

/// Advances positions and velocities by one substep; contact forces are held constant. The positions at its start
/// become the previous ones.
#[inline(always)]
pub(super) fn integrate<L: Lanes>(
    lattice: &Lattice,
    physics: &Physics,
    state: &mut State,
    scratch: &mut Scratch,
) {
    prepare::<L>(lattice, physics, state, scratch);
    if let Some(extra) = &mut scratch.extra {
        let goals = &scratch.goals[lattice.len..];
        let stages = [&state.position, &scratch.near];
        extra.load_first_half::<L>(lattice, goals, physics.servo_gain, &scratch.load, stages);
    }
    first_stage::<L>(lattice, physics, state, scratch);
    second_stage::<L>(lattice, physics, state, scratch);
    if let Some(extra) = &mut scratch.extra {
        extra.load_second_half::<L>(lattice, &scratch.load, [&scratch.near, &scratch.far]);
    }
    third_stage::<L>(lattice, physics, state, scratch);
    fourth_stage::<L>(lattice, physics, state, scratch);
    std::mem::swap(&mut state.position, &mut state.previous);
}

/// The second stage's positions, and what acts on the points besides springs. Contact forces are used up.
#[inline(always)]
fn prepare<L: Lanes>(lattice: &Lattice, physics: &Physics, state: &State, scratch: &mut Scratch) {
    let half = L::splat(physics.time_step / 2.0);
    let (inverse_mass, drag) = (L::splat(1.0 / physics.mass), L::splat(physics.drag / physics.mass));
    let zero = L::splat(0.0);
    let gravity = L::splat(-physics.gravity);
    let Scratch { near, contact, load, .. } = scratch;
    for slot in lattice.runs.iter().flat_map(|run| run.clone().step_by(L::WIDTH)) {
        let falling = [zero, gravity * L::load(&lattice.present, slot)];
        for axis in [X, Y] {
            let velocity = L::load(&state.velocity[axis], slot);
            velocity.mul_add(half, L::load(&state.position[axis], slot)).store(&mut near[axis], slot);
            let pushed = L::load(&contact[axis], slot).mul_add(inverse_mass, falling[axis]);
            velocity.mul_sub_from(drag, pushed).store(&mut load[axis], slot);
            zero.store(&mut contact[axis], slot);
        }
    }
}

/// The first stage: the springs' rest lengths, and accelerations into `sum`.
#[inline(always)]
fn first_stage<L: Lanes>(lattice: &Lattice, physics: &Physics, state: &State, scratch: &mut Scratch) {
    let (len, pitch) = (lattice.len, lattice.pitch);
    let Scratch { springs, goals, passing, sum, .. } = scratch;
    let load = stage_load(&scratch.load, scratch.extra.as_ref(), 0, len);
    let (goals, gain) = (&goals[..len], physics.servo_gain);
    let (straight, diagonal) = (L::splat(physics.cell_size), L::splat(lattice.lengths[2]));
    let (position, velocity) = (slices(&state.position, len), slices(&state.velocity, len));
    let ([px, py], sum) = (slices_mut(passing, len), slices_mut(sum, len));
    for run in &lattice.runs {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in run.clone().step_by(L::WIDTH) {
            let goal = [L::load(goals, slot), straight, diagonal, diagonal];
            let vectors = vectors(position, slot, pitch);
            let pull = springs[slot / BLOCK].servo(slot % BLOCK, squares(&vectors), goal, gain);
            let force = gather.next(pull, &vectors, slot);
            let first = each!(axis in [X, Y] => force[axis] + L::load(load[axis], slot));
            let first = floor(physics, L::load(position[Y], slot), first, L::load(velocity[X], slot));
            each!(axis in [X, Y] => first[axis].store(sum[axis], slot));
        }
    }
}

/// The second stage; leaves the positions of the third and of the fourth.
#[inline(always)]
fn second_stage<L: Lanes>(lattice: &Lattice, physics: &Physics, state: &State, scratch: &mut Scratch) {
    let (h, len, pitch) = (physics.time_step, lattice.len, lattice.pitch);
    let Scratch { springs, passing, near, far, latest, sum, .. } = scratch;
    let load = stage_load(&scratch.load, scratch.extra.as_ref(), 1, len);
    let drag = L::splat(physics.drag / physics.mass * h / 2.0);
    let (position, velocity) = (slices(&state.position, len), slices(&state.velocity, len));
    let ([near_x, near_y], far) = (slices_mut(near, len), slices_mut(far, len));
    let ([px, py], latest, sum) = (slices_mut(passing, len), slices_mut(latest, len), slices_mut(sum, len));
    for run in &lattice.runs {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in run.clone().step_by(L::WIDTH) {
            let vectors = vectors([near_x, near_y], slot, pitch);
            let pull = springs[slot / BLOCK].pull(slot % BLOCK, squares(&vectors));
            let force = gather.next(pull, &vectors, slot);
            let first = each!(axis in [X, Y] => L::load(sum[axis], slot));
            let velocity = each!(axis in [X, Y] => L::load(velocity[axis], slot));
            let second = each!(axis in [X, Y] => {
                first[axis].mul_sub_from(drag, force[axis] + L::load(load[axis], slot))
            });
            let here = [L::load(near_x, slot), L::load(near_y, slot)];
            let vx = first[X].mul_add(L::splat(h / 2.0), velocity[X]);
            let second = floor(physics, here[Y], second, vx);
            first[X].mul_add(L::splat(h * h / 4.0), here[X]).store(near_x, slot);
            first[Y].mul_add(L::splat(h * h / 4.0), here[Y]).store(near_y, slot);
            each!(axis in [X, Y] => {
                let coasted = velocity[axis].mul_add(L::splat(h), L::load(position[axis], slot));
                second[axis].mul_add(L::splat(h * h / 2.0), coasted).store(far[axis], slot);
                second[axis].store(latest[axis], slot);
                second[axis].mul_add(L::splat(2.0), first[axis]).store(sum[axis], slot);
            });
        }
    }
}

/// The third stage, after which the new positions are known: they go over the previous ones.
#[inline(always)]
fn third_stage<L: Lanes>(lattice: &Lattice, physics: &Physics, state: &mut State, scratch: &mut Scratch) {
    let (h, len, pitch) = (physics.time_step, lattice.len, lattice.pitch);
    let Scratch { springs, passing, near, latest, sum, .. } = scratch;
    let load = stage_load(&scratch.load, scratch.extra.as_ref(), 0, len);
    let drag = L::splat(physics.drag / physics.mass * h / 2.0);
    let (position, velocity) = (slices(&state.position, len), slices(&state.velocity, len));
    let (near, result) = (slices(near, len), slices_mut(&mut state.previous, len));
    let ([px, py], latest, sum) = (slices_mut(passing, len), slices_mut(latest, len), slices_mut(sum, len));
    for run in &lattice.runs {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in run.clone().step_by(L::WIDTH) {
            let vectors = vectors(near, slot, pitch);
            let pull = springs[slot / BLOCK].pull(slot % BLOCK, squares(&vectors));
            let force = gather.next(pull, &vectors, slot);
            let second = each!(axis in [X, Y] => L::load(latest[axis], slot));
            let velocity = each!(axis in [X, Y] => L::load(velocity[axis], slot));
            let third = each!(axis in [X, Y] => {
                second[axis].mul_sub_from(drag, force[axis] + L::load(load[axis], slot))
            });
            let vx = second[X].mul_add(L::splat(h / 2.0), velocity[X]);
            let third = floor(physics, L::load(near[Y], slot), third, vx);
            each!(axis in [X, Y] => {
                let sums = L::load(sum[axis], slot);
                let coasted = velocity[axis].mul_add(L::splat(h), L::load(position[axis], slot));
                let three = (sums - second[axis]) + third[axis];
                three.mul_add(L::splat(h * h / 6.0), coasted).store(result[axis], slot);
                third[axis].mul_add(L::splat(2.0), sums).store(sum[axis], slot);
                third[axis].store(latest[axis], slot);
            });
        }
    }
}

/// The fourth stage, after which the new velocities are known.
#[inline(always)]
fn fourth_stage<L: Lanes>(lattice: &Lattice, physics: &Physics, state: &mut State, scratch: &mut Scratch) {
    let (h, len, pitch) = (physics.time_step, lattice.len, lattice.pitch);
    let Scratch { springs, passing, far, latest, sum, .. } = scratch;
    let load = stage_load(&scratch.load, scratch.extra.as_ref(), 1, len);
    let drag = L::splat(physics.drag / physics.mass * h);
    let (far, latest, sum) = (slices(far, len), slices(latest, len), slices(sum, len));
    let ([px, py], velocity) = (slices_mut(passing, len), slices_mut(&mut state.velocity, len));
    for run in &lattice.runs {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in run.clone().step_by(L::WIDTH) {
            let vectors = vectors(far, slot, pitch);
            let pull = springs[slot / BLOCK].pull(slot % BLOCK, squares(&vectors));
            let force = gather.next(pull, &vectors, slot);
            let third = each!(axis in [X, Y] => L::load(latest[axis], slot));
            let before = each!(axis in [X, Y] => L::load(velocity[axis], slot));
            let fourth = each!(axis in [X, Y] => {
                third[axis].mul_sub_from(drag, force[axis] + L::load(load[axis], slot))
            });
            let vx = third[X].mul_add(L::splat(h), before[X]);
            let fourth = floor(physics, L::load(far[Y], slot), fourth, vx);
            each!(axis in [X, Y] => {
                let six = L::load(sum[axis], slot) + fourth[axis];
                six.mul_add(L::splat(h / 6.0), before[axis]).store(velocity[axis], slot);
            });
        }
    }
}

/// What acts besides the lattice's springs in the first or second stage of a pair.
#[inline(always)]
fn stage_load<'a>(load: &'a Pair, extra: Option<&'a Extra>, stage: usize, len: usize) -> [&'a [f64]; 2] {
    slices(extra.map_or(load, |extra| &extra.load[stage]), len)
}

/// Lanes in memory. Their alignment matters beyond them: a compiler that need not align the stack for anything else
/// does not do so for what it spills of the sweeps' registers either, and each of those then straddles cache lines.
#[repr(align(64))]
struct Aligned([[f64; BLOCK]; 4]);

/// Adds the floor plane's push at y < 0, below the ground; only reached by tunnelling (physics.md, "World").
#[inline(always)]
fn floor<L: Lanes>(physics: &Physics, y: L, acceleration: [L; 2], velocity: L) -> [L; 2] {
    if !L::any(L::splat(0.0).above(y)) {
        return acceleration;
    }
    let mut lanes = Aligned([[0.0; BLOCK]; 4]);
    let values = [acceleration[X], acceleration[Y], y, velocity];
    for (value, lanes) in values.into_iter().zip(&mut lanes.0) {
        value.store(lanes, 0);
    }
    add_floor(physics, L::WIDTH, &mut lanes.0);
    [L::load(&lanes.0[0], 0), L::load(&lanes.0[1], 0)]
}

#[cold]
#[inline(never)]
fn add_floor(physics: &Physics, width: usize, [ax, ay, y, vx]: &mut [[f64; BLOCK]; 4]) {
    for i in (0..width).filter(|&i| y[i] < 0.0) {
        let normal = -physics.floor_stiffness * y[i];
        let friction = physics.floor_friction * normal * libm::tanh(physics.floor_slip * normal * vx[i]);
        ay[i] += normal / physics.mass;
        ax[i] -= friction / physics.mass;
    }
}
