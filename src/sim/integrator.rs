//! Classical fourth-order Runge–Kutta over one substep (physics.md, 3).

use super::forces::{Load, accelerations};
use super::lattice::Lattice;
use super::params::Physics;
use super::state::{Pair, Scratch, State};

/// Advances positions and velocities by one substep; contact forces are held constant.
#[inline(always)]
pub(super) fn integrate(lattice: &Lattice, physics: &Physics, state: &mut State, scratch: &mut Scratch) {
    let dt = physics.time_step;
    let Scratch {
        rest,
        extra_rest,
        pull,
        margin,
        external,
        stage,
        stage_velocity,
        acceleration,
        sum_velocity,
        sum_acceleration,
        ..
    } = scratch;
    let load = &Load { rest, extra_rest, external, margin: *margin };
    let (position, velocity) = ((&*state.x, &*state.y), (&*state.vx, &*state.vy));
    accelerations(lattice, physics, load, position, velocity, pull, acceleration);
    copy(&state.vx, &state.vy, sum_velocity);
    copy(&acceleration.x, &acceleration.y, sum_acceleration);
    // Stage positions come from the velocities before they are overwritten.
    along(&state.x, &state.vx, dt / 2.0, &mut stage.x);
    along(&state.y, &state.vy, dt / 2.0, &mut stage.y);
    along(&state.vx, &acceleration.x, dt / 2.0, &mut stage_velocity.x);
    along(&state.vy, &acceleration.y, dt / 2.0, &mut stage_velocity.y);
    for (weight, next) in [(2.0, dt / 2.0), (2.0, dt)] {
        let (position, velocity) = ((&*stage.x, &*stage.y), (&*stage_velocity.x, &*stage_velocity.y));
        accelerations(lattice, physics, load, position, velocity, pull, acceleration);
        add(weight, stage_velocity, sum_velocity);
        add(weight, acceleration, sum_acceleration);
        along(&state.x, &stage_velocity.x, next, &mut stage.x);
        along(&state.y, &stage_velocity.y, next, &mut stage.y);
        along(&state.vx, &acceleration.x, next, &mut stage_velocity.x);
        along(&state.vy, &acceleration.y, next, &mut stage_velocity.y);
    }
    let (position, velocity) = ((&*stage.x, &*stage.y), (&*stage_velocity.x, &*stage_velocity.y));
    accelerations(lattice, physics, load, position, velocity, pull, acceleration);
    finish(&mut state.x, &sum_velocity.x, &stage_velocity.x, dt);
    finish(&mut state.y, &sum_velocity.y, &stage_velocity.y, dt);
    finish(&mut state.vx, &sum_acceleration.x, &acceleration.x, dt);
    finish(&mut state.vy, &sum_acceleration.y, &acceleration.y, dt);
}

#[inline(always)]
fn copy(x: &[f64], y: &[f64], out: &mut Pair) {
    out.x.copy_from_slice(x);
    out.y.copy_from_slice(y);
}

/// out = start + step · slope
#[inline(always)]
fn along(start: &[f64], slope: &[f64], step: f64, out: &mut [f64]) {
    for ((out, start), slope) in out.iter_mut().zip(start).zip(slope) {
        *out = start + step * slope;
    }
}

/// sum += weight · more
#[inline(always)]
fn add(weight: f64, more: &Pair, sum: &mut Pair) {
    for (sum, more) in [(&mut sum.x, &more.x), (&mut sum.y, &more.y)] {
        for (sum, more) in sum.iter_mut().zip(more) {
            *sum += weight * more;
        }
    }
}

/// value += dt/6 · (sum + last)
#[inline(always)]
fn finish(value: &mut [f64], sum: &[f64], last: &[f64], dt: f64) {
    for ((value, sum), last) in value.iter_mut().zip(sum).zip(last) {
        *value += dt / 6.0 * (sum + last);
    }
}
