//! Classical fourth-order Runge–Kutta over one substep (physics.md, "One substep", 3).
//!
//! With accelerations a₁ … a₄ the four stages' positions are x₀, x₀ + (h/2)v₀, x₀ + (h/2)v₀ +
//! (h²/4)a₁ and x₀ + hv₀ + (h²/2)a₂. So those of the first two are known at the start, and those of
//! the last two after the second. The new positions are x₀ + hv₀ + (h²/6)(a₁ + a₂ + a₃). Each stage
//! is one sweep over the springs: two in one would need more registers than there are, and the
//! spills would fill the store queue.

use crate::lattice::Lattice;
use crate::physics::Physics;
use crate::scratch::{Scratch, Work};
use crate::simd::{BLOCK, Lanes, each};
use crate::state::{State, X, Y, slices, slices_mut};
use crate::step::limits::limit_all;
use crate::step::off_lattice::OffLattice;
use crate::step::springs::{Gather, Watch, squares, vectors};
use crate::system::System;

/// Advances velocities with constant contact forces; leaves the new positions in `scratch`.
#[inline(always)]
pub(crate) fn integrate<L: Lanes>(system: &System, state: &mut State, scratch: &mut Scratch) {
    let System { lattice, physics } = system;
    if let Some(off_lattice) = &mut scratch.off_lattice {
        let goals = &scratch.goals[lattice.len..];
        off_lattice.first_stage::<L>(lattice, goals, physics.servo_gain, &state.position);
    }
    // The first substep of a control step has no lengths yet.
    let anew = std::mem::take(&mut scratch.anew);
    let is_regular = |scratch: &mut Scratch| match lattice.actuated_vertical.is_empty() {
        true => first_stage::<L, false, false>(system, state, scratch),
        false => first_stage::<L, false, true>(system, state, scratch),
    };
    if anew || !is_regular(scratch) {
        match lattice.actuated_vertical.is_empty() {
            true => first_stage::<L, true, false>(system, state, scratch),
            false => first_stage::<L, true, true>(system, state, scratch),
        };
    }
    if !later_stages::<L, false>(system, state, scratch) {
        later_stages::<L, true>(system, state, scratch);
    }
    std::mem::swap(&mut state.velocity, &mut scratch.velocity);
}

/// Limits all springs at the new positions; those at the substep's start become the previous ones.
#[inline(always)]
pub(crate) fn limit<L: Lanes>(system: &System, state: &mut State, scratch: &mut Scratch) {
    let Scratch {
        position: new,
        carry,
        off_lattice,
        reach,
        ..
    } = scratch;
    limit_all::<L>(system, new, &mut state.previous, carry, reach);
    if let Some(off_lattice) = off_lattice {
        off_lattice.limit::<L>(system, new);
        off_lattice.feed(&system.lattice, &mut state.previous);
    }
    std::mem::swap(&mut state.position, &mut state.previous);
}

/// Runs the other three stages. Unless `EXACT`, they assume that all is regular and return false if
/// they must be repeated exactly; the first and the last stage detect that.
#[inline(always)]
fn later_stages<L: Lanes, const EXACT: bool>(
    system: &System,
    state: &State,
    scratch: &mut Scratch,
) -> bool {
    let lattice = &system.lattice;
    off_lattice_stage::<L>(lattice, scratch, 0);
    second_stage::<L, EXACT>(system, state, scratch);
    off_lattice_stage::<L>(lattice, scratch, 1);
    third_stage::<L, EXACT>(system, state, scratch);
    off_lattice_stage::<L>(lattice, scratch, 2);
    fourth_stage::<L, EXACT>(system, state, scratch)
}

/// Computes the off-lattice springs' part of the second stage or a later one.
#[inline(always)]
fn off_lattice_stage<L: Lanes>(lattice: &Lattice, scratch: &mut Scratch, stage: usize) {
    if let Some(off_lattice) = &mut scratch.off_lattice {
        off_lattice.later_stage::<L>(lattice, &scratch.stages[stage]);
    }
}

/// Returns the acceleration of a slot's points by all but the lattice's springs.
#[inline(always)]
fn load_of<L: Lanes>(work: &Work, off_lattice: Option<&OffLattice>, slot: usize) -> [L; 2] {
    let of = each!(axis in [X, Y] => L::load(&work.load[axis], slot % BLOCK));
    let Some(off_lattice) = off_lattice else {
        return of;
    };
    each!(axis in [X, Y] => of[axis] + L::load(&off_lattice.load[axis], slot))
}

/// Runs the first stage, with goals of vertical springs if `VERTICAL`: the load without springs, the springs' rest lengths, and the second
/// stage's positions. Returns true if all was regular.
#[inline(always)]
fn first_stage<L: Lanes, const EXACT: bool, const VERTICAL: bool>(
    System { lattice, physics }: &System,
    state: &State,
    scratch: &mut Scratch,
) -> bool {
    let (len, pitch) = (lattice.len, lattice.pitch);
    let Scratch {
        springs,
        goals,
        vertical_goals,
        carry,
        work,
        off_lattice,
        contact,
        stages: [next, ..],
        ..
    } = scratch;
    let (goals, present, gain) = (&goals[..len], &lattice.present[..len], physics.servo_gain);
    let (straight, diagonal) = (L::splat(physics.cell_size), L::splat(lattice.lengths[2]));
    let half = L::splat(physics.time_step / 2.0);
    let (inverse_mass, drag) = (
        L::splat(1.0 / physics.mass),
        L::splat(physics.drag / physics.mass),
    );
    let gravity = L::splat(-physics.gravity);
    let (position, velocity) = (slices(&state.position, len), slices(&state.velocity, len));
    let (contact, next) = (slices(contact, len), slices_mut(next, len));
    let ([px, py], off_lattice) = (slices_mut(carry, len), off_lattice.as_ref());
    let mut watch = Watch::<L>::new();
    for range in &lattice.active_ranges {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in range.clone().step_by(L::WIDTH) {
            let (work, lane) = (&mut work[slot / BLOCK], slot % BLOCK);
            let upright = match VERTICAL {
                true => L::load(vertical_goals, slot),
                false => straight,
            };
            let goal = [L::load(goals, slot), upright, diagonal, diagonal];
            let vectors = vectors(position, slot, pitch);
            let springs = &mut springs[slot / BLOCK];
            let square = squares(&vectors);
            let pull =
                springs.servo::<L, EXACT>(&mut work.pulls, lane, square, (goal, gain), &mut watch);
            let force = gather.next(pull, &vectors, slot);
            let falling = [L::splat(0.0), gravity * L::load(present, slot)];
            let velocity = each!(axis in [X, Y] => L::load(velocity[axis], slot));
            each!(axis in [X, Y] => {
                velocity[axis].mul_add(half, L::load(position[axis], slot)).store(next[axis], slot);
                let pushed = L::load(contact[axis], slot).mul_add(inverse_mass, falling[axis]);
                velocity[axis].mul_sub_from(drag, pushed).store(&mut work.load[axis], lane);
            });
            let load = load_of::<L>(work, off_lattice, slot);
            let mut first = each!(axis in [X, Y] => force[axis] + load[axis]);
            let y = L::load(position[Y], slot);
            watch.points(y);
            if EXACT {
                first = floor(physics, y, first, velocity[X]);
            }
            each!(axis in [X, Y] => first[axis].store(&mut work.first[axis], lane));
        }
    }
    EXACT || watch.regular()
}

/// Runs the second stage; leaves the positions of the third and of the fourth.
#[inline(always)]
fn second_stage<L: Lanes, const EXACT: bool>(
    System { lattice, physics }: &System,
    state: &State,
    scratch: &mut Scratch,
) {
    let (h, len, pitch) = (physics.time_step, lattice.len, lattice.pitch);
    let Scratch {
        carry,
        work,
        off_lattice,
        stages: [here, next, last],
        ..
    } = scratch;
    let drag = L::splat(physics.drag / physics.mass * h / 2.0);
    let (position, velocity) = (slices(&state.position, len), slices(&state.velocity, len));
    let (here, next, last) = (
        slices(here, len),
        slices_mut(next, len),
        slices_mut(last, len),
    );
    let ([px, py], off_lattice) = (slices_mut(carry, len), off_lattice.as_ref());
    for range in &lattice.active_ranges {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in range.clone().step_by(L::WIDTH) {
            let (work, lane) = (&mut work[slot / BLOCK], slot % BLOCK);
            let vectors = vectors(here, slot, pitch);
            let pull = work.pulls.at::<L, EXACT>(lane, squares(&vectors), None);
            let force = gather.next(pull, &vectors, slot);
            let load = load_of::<L>(work, off_lattice, slot);
            let first = each!(axis in [X, Y] => L::load(&work.first[axis], lane));
            let velocity = each!(axis in [X, Y] => L::load(velocity[axis], slot));
            let mut second = each!(axis in [X, Y] => {
                first[axis].mul_sub_from(drag, force[axis] + load[axis])
            });
            let here = each!(axis in [X, Y] => L::load(here[axis], slot));
            if EXACT {
                second = floor(
                    physics,
                    here[Y],
                    second,
                    first[X].mul_add(L::splat(h / 2.0), velocity[X]),
                );
            }
            each!(axis in [X, Y] => {
                first[axis].mul_add(L::splat(h * h / 4.0), here[axis]).store(next[axis], slot);
                let coasted = velocity[axis].mul_add(L::splat(h), L::load(position[axis], slot));
                second[axis].mul_add(L::splat(h * h / 2.0), coasted).store(last[axis], slot);
                second[axis].store(&mut work.second[axis], lane);
            });
        }
    }
}

/// Runs the third stage, which leaves the new positions.
#[inline(always)]
fn third_stage<L: Lanes, const EXACT: bool>(
    System { lattice, physics }: &System,
    state: &State,
    scratch: &mut Scratch,
) {
    let (h, len, pitch) = (physics.time_step, lattice.len, lattice.pitch);
    let Scratch {
        carry,
        work,
        off_lattice,
        stages: [_, here, _],
        position: new,
        ..
    } = scratch;
    let drag = L::splat(physics.drag / physics.mass * h / 2.0);
    let (position, velocity) = (slices(&state.position, len), slices(&state.velocity, len));
    let (here, new) = (slices(here, len), slices_mut(new, len));
    let ([px, py], off_lattice) = (slices_mut(carry, len), off_lattice.as_ref());
    for range in &lattice.active_ranges {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in range.clone().step_by(L::WIDTH) {
            let (work, lane) = (&mut work[slot / BLOCK], slot % BLOCK);
            let vectors = vectors(here, slot, pitch);
            let pull = work.pulls.at::<L, EXACT>(lane, squares(&vectors), None);
            let force = gather.next(pull, &vectors, slot);
            let load = load_of::<L>(work, off_lattice, slot);
            let second = each!(axis in [X, Y] => L::load(&work.second[axis], lane));
            let velocity = each!(axis in [X, Y] => L::load(velocity[axis], slot));
            let mut third = each!(axis in [X, Y] => {
                second[axis].mul_sub_from(drag, force[axis] + load[axis])
            });
            if EXACT {
                let y = L::load(here[Y], slot);
                third = floor(
                    physics,
                    y,
                    third,
                    second[X].mul_add(L::splat(h / 2.0), velocity[X]),
                );
            }
            each!(axis in [X, Y] => {
                let coasted = velocity[axis].mul_add(L::splat(h), L::load(position[axis], slot));
                let three = (L::load(&work.first[axis], lane) + second[axis]) + third[axis];
                three.mul_add(L::splat(h * h / 6.0), coasted).store(new[axis], slot);
                third[axis].store(&mut work.third[axis], lane);
            });
        }
    }
}

/// Runs the fourth stage, which leaves the new velocities. Returns true if all was regular.
#[inline(always)]
fn fourth_stage<L: Lanes, const EXACT: bool>(
    System { lattice, physics }: &System,
    state: &State,
    scratch: &mut Scratch,
) -> bool {
    let (h, len, pitch) = (physics.time_step, lattice.len, lattice.pitch);
    let Scratch {
        carry,
        work,
        off_lattice,
        stages: [_, _, here],
        velocity: new,
        ..
    } = scratch;
    let drag = L::splat(physics.drag / physics.mass * h);
    let (here, velocity, new) = (
        slices(here, len),
        slices(&state.velocity, len),
        slices_mut(new, len),
    );
    let ([px, py], off_lattice) = (slices_mut(carry, len), off_lattice.as_ref());
    let mut watch = Watch::<L>::new();
    for range in &lattice.active_ranges {
        let mut gather = Gather::<L>::new([&mut *px, &mut *py], pitch);
        for slot in range.clone().step_by(L::WIDTH) {
            let (work, lane) = (&work[slot / BLOCK], slot % BLOCK);
            let vectors = vectors(here, slot, pitch);
            let pull = work
                .pulls
                .at::<L, EXACT>(lane, squares(&vectors), Some(&mut watch));
            let force = gather.next(pull, &vectors, slot);
            let load = load_of::<L>(work, off_lattice, slot);
            let third = each!(axis in [X, Y] => L::load(&work.third[axis], lane));
            let velocity = each!(axis in [X, Y] => L::load(velocity[axis], slot));
            let mut fourth = each!(axis in [X, Y] => {
                third[axis].mul_sub_from(drag, force[axis] + load[axis])
            });
            let y = L::load(here[Y], slot);
            watch.points(y);
            if EXACT {
                fourth = floor(
                    physics,
                    y,
                    fourth,
                    third[X].mul_add(L::splat(h), velocity[X]),
                );
            }
            each!(axis in [X, Y] => {
                let middle = L::load(&work.second[axis], lane) + third[axis];
                let ends = L::load(&work.first[axis], lane) + fourth[axis];
                let six = (middle + middle) + ends;
                six.mul_add(L::splat(h / 6.0), velocity[axis]).store(new[axis], slot);
            });
        }
    }
    EXACT || watch.regular()
}

/// Lanes in memory, aligned so that the registers spilled in sweeps straddle no cache lines.
#[repr(align(64))]
struct Aligned([[f64; BLOCK]; 4]);

/// Adds the floor plane's push at y < 0, below the ground, which points reach only by tunnelling
/// (physics.md, "World").
#[inline(always)]
fn floor<L: Lanes>(physics: &Physics, y: L, acceleration: [L; 2], velocity: L) -> [L; 2] {
    if !L::any(L::splat(0.0).gt(y)) {
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
        let friction =
            physics.floor_friction * normal * libm::tanh(physics.floor_slip * normal * vx[i]);
        ay[i] += normal / physics.mass;
        ax[i] -= friction / physics.mass;
    }
}
