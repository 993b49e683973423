//! Classical fourth-order Runge–Kutta over one substep (physics.md, 3).
//!
//! With accelerations a₁ … a₄ the four stages' positions are x₀, x₀ + (h/2)v₀, x₀ + (h/2)v₀ + (h²/4)a₁ and
//! x₀ + hv₀ + (h²/2)a₂. Springs see positions only, and drag is a number: so the first two stages can be had in one
//! sweep over the springs, and the last two in another.

use super::extra::Extra;
use super::forces::{squares, vectors};
use super::lattice::Lattice;
use super::params::Physics;
use super::state::{Pair, Scratch, State, X, Y};
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
        let goals = &scratch.goals[lattice.slots..];
        let stages = [&state.position, &scratch.near];
        extra.load_first_half::<L>(lattice, goals, physics.servo_gain, &scratch.load, stages);
    }
    first_half::<L>(lattice, physics, state, scratch);
    if let Some(extra) = &mut scratch.extra {
        extra.load_second_half::<L>(lattice, &scratch.load, [&scratch.near, &scratch.far]);
    }
    second_half::<L>(lattice, physics, state, scratch);
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

/// The first and the second stage; leaves the positions of the third and the fourth.
#[inline(always)]
fn first_half<L: Lanes>(lattice: &Lattice, physics: &Physics, state: &State, scratch: &mut Scratch) {
    let Scratch { springs, passing: [passing, passing_next], near, far, second, sum, load, .. } = scratch;
    let (goals, extra, diagonal) = (&scratch.goals[..], &scratch.extra, L::splat(lattice.lengths[2]));
    let (h, pitch) = (physics.time_step, lattice.pitch);
    let (straight, drag) = (L::splat(physics.cell_size), L::splat(physics.drag / physics.mass * h / 2.0));
    let loads = stage_loads(load, extra.as_ref());
    let (position, speed) = (slices(&state.position), slices(&state.velocity));
    let ([near, far], [second, sum]) = ([near, far].map(slices_mut), [second, sum].map(slices_mut));
    for run in &lattice.runs {
        let (mut gather, mut gather_next) = (passing.gather::<L>(), passing_next.gather::<L>());
        for slot in run.clone().step_by(L::WIDTH) {
            let (springs, lane) = (&mut springs[slot / BLOCK], slot % BLOCK);
            let goal = [L::load(goals, slot), straight, diagonal, diagonal];
            let start = vectors(position, slot, pitch);
            let pull = springs.servo(lane, squares(&start), goal, physics.servo_gain);
            let force = gather.next(pull, &start, slot);
            let first = each!(axis in [X, Y] => force[axis] + L::load(loads[0][axis], slot));
            let velocity = each!(axis in [X, Y] => L::load(speed[axis], slot));
            let first = floor(physics, L::load(position[Y], slot), first, velocity[X]);

            let then = vectors([&*near[X], &*near[Y]], slot, pitch);
            let force = gather_next.next(springs.pull(lane, squares(&then)), &then, slot);
            let next = each!(axis in [X, Y] => {
                first[axis].mul_sub_from(drag, force[axis] + L::load(loads[1][axis], slot))
            });
            let vx = first[X].mul_add(L::splat(h / 2.0), velocity[X]);
            let next = floor(physics, L::load(near[Y], slot), next, vx);

            each!(axis in [X, Y] => {
                let here = L::load(near[axis], slot);
                first[axis].mul_add(L::splat(h * h / 4.0), here).store(near[axis], slot);
                let coasted = velocity[axis].mul_add(L::splat(h), L::load(position[axis], slot));
                next[axis].mul_add(L::splat(h * h / 2.0), coasted).store(far[axis], slot);
                next[axis].store(second[axis], slot);
                next[axis].mul_add(L::splat(2.0), first[axis]).store(sum[axis], slot);
            });
        }
    }
}

/// The third and the fourth stage, and where the points are then; that goes over the previous positions.
#[inline(always)]
fn second_half<L: Lanes>(lattice: &Lattice, physics: &Physics, state: &mut State, scratch: &mut Scratch) {
    let Scratch { springs, passing: [passing, passing_next], near, far, second, sum, load, .. } = scratch;
    let (h, pitch) = (physics.time_step, lattice.pitch);
    let drag = physics.drag / physics.mass * h;
    let loads = stage_loads(load, scratch.extra.as_ref());
    let [near, far, second, sum] = [near, far, second, sum].map(|pair| slices(pair));
    let (position, result, speed) =
        (slices(&state.position), slices_mut(&mut state.previous), slices_mut(&mut state.velocity));
    for run in &lattice.runs {
        let (mut gather, mut gather_next) = (passing.gather::<L>(), passing_next.gather::<L>());
        for slot in run.clone().step_by(L::WIDTH) {
            let (springs, lane) = (&springs[slot / BLOCK], slot % BLOCK);
            let velocity = each!(axis in [X, Y] => L::load(speed[axis], slot));
            let second = each!(axis in [X, Y] => L::load(second[axis], slot));

            let then = vectors(near, slot, pitch);
            let force = gather.next(springs.pull(lane, squares(&then)), &then, slot);
            let third = each!(axis in [X, Y] => {
                second[axis].mul_sub_from(L::splat(drag / 2.0), force[axis] + L::load(loads[0][axis], slot))
            });
            let vx = second[X].mul_add(L::splat(h / 2.0), velocity[X]);
            let third = floor(physics, L::load(near[Y], slot), third, vx);

            let then = vectors(far, slot, pitch);
            let force = gather_next.next(springs.pull(lane, squares(&then)), &then, slot);
            let last = each!(axis in [X, Y] => {
                third[axis].mul_sub_from(L::splat(drag), force[axis] + L::load(loads[1][axis], slot))
            });
            let vx = third[X].mul_add(L::splat(h), velocity[X]);
            let last = floor(physics, L::load(far[Y], slot), last, vx);

            each!(axis in [X, Y] => {
                let sum = L::load(sum[axis], slot);
                let coasted = velocity[axis].mul_add(L::splat(h), L::load(position[axis], slot));
                let three = (sum - second[axis]) + third[axis];
                three.mul_add(L::splat(h * h / 6.0), coasted).store(result[axis], slot);
                let six = third[axis].mul_add(L::splat(2.0), sum) + last[axis];
                six.mul_add(L::splat(h / 6.0), velocity[axis]).store(speed[axis], slot);
            });
        }
    }
}

fn slices([x, y]: &Pair) -> [&[f64]; 2] {
    [x, y]
}

fn slices_mut([x, y]: &mut Pair) -> [&mut [f64]; 2] {
    [x, y]
}

/// What acts besides the lattice's springs in the two stages of a sweep.
fn stage_loads<'a>(load: &'a Pair, extra: Option<&'a Extra>) -> [[&'a [f64]; 2]; 2] {
    match extra {
        Some(extra) => [slices(&extra.load[0]), slices(&extra.load[1])],
        None => [slices(load); 2],
    }
}

/// Adds the floor plane's push at y < 0, below the ground; only reached by tunnelling (physics.md, "World").
#[inline(always)]
fn floor<L: Lanes>(physics: &Physics, y: L, acceleration: [L; 2], velocity: L) -> [L; 2] {
    if !L::any(L::splat(0.0).above(y)) {
        return acceleration;
    }
    let mut lanes = [[0.0; BLOCK]; 4];
    let values = [acceleration[X], acceleration[Y], y, velocity];
    for i in 0..4 {
        values[i].store(&mut lanes[i], 0);
    }
    add_floor(physics, L::WIDTH, &mut lanes);
    [L::load(&lanes[0], 0), L::load(&lanes[1], 0)]
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
