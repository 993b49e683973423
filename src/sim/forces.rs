//! Spring lengths and forces: plain sweeps over the lattice's families, written for wide lanes.

use super::lattice::{Family, Lattice};
use super::params::Physics;
use super::state::{Axis, Pair, Scratch};

/// The coordinates of the two ends of every spring of a family.
struct Ends<'a> {
    ax: &'a [f64],
    ay: &'a [f64],
    bx: &'a [f64],
    by: &'a [f64],
}

#[inline(always)]
fn ends<'a>(family: &Family, slots: usize, x: &'a [f64], y: &'a [f64]) -> Ends<'a> {
    let (a, b) = (family.from..family.from + slots, family.to..family.to + slots);
    Ends { ax: &x[a.clone()], ay: &y[a], bx: &x[b.clone()], by: &y[b] }
}

/// This substep's rest lengths: from the present length a small part of the way to the goal (physics.md, 2).
#[inline(always)]
pub(super) fn set_rest_lengths(
    lattice: &Lattice,
    physics: &Physics,
    x: &[f64],
    y: &[f64],
    scratch: &mut Scratch,
) {
    let (slots, gain) = (lattice.slots, physics.servo_gain);
    for (index, (family, rest)) in lattice.families.iter().zip(&mut scratch.rest).enumerate() {
        let Ends { ax, ay, bx, by } = ends(family, slots, x, y);
        let rest = &mut rest[..slots];
        // Only horizontal sides are actuated.
        if index == 0 {
            let goals = &scratch.goals[..slots];
            for i in 0..slots {
                let (dx, dy) = (bx[i] - ax[i], by[i] - ay[i]);
                let length = (dx * dx + dy * dy).sqrt();
                rest[i] = length + gain * (goals[i] - length);
            }
        } else {
            for i in 0..slots {
                let (dx, dy) = (bx[i] - ax[i], by[i] - ay[i]);
                let length = (dx * dx + dy * dy).sqrt();
                rest[i] = length + gain * (family.length - length);
            }
        }
    }
    for (index, (spring, rest)) in lattice.extra_springs.iter().zip(&mut scratch.extra_rest).enumerate() {
        let [a, b] = spring.ends;
        let (dx, dy) = (x[b] - x[a], y[b] - y[a]);
        let length = (dx * dx + dy * dy).sqrt();
        *rest = length + gain * (scratch.goals[slots + index] - length);
    }
}

/// The force of every spring on its first point into `pull` (a dense sweep per family).
#[inline(always)]
pub(super) fn set_spring_pulls(
    lattice: &Lattice,
    rest: &[Vec<f64>; 4],
    x: &[f64],
    y: &[f64],
    margin: usize,
    pull: &mut [Pair; 4],
) {
    let slots = lattice.slots;
    for ((family, rest), pull) in lattice.families.iter().zip(rest).zip(pull) {
        let Ends { ax, ay, bx, by } = ends(family, slots, x, y);
        let (rest, stiffness) = (&rest[..slots], &family.stiffness[..slots]);
        let (px, py) = (&mut pull.x[margin..margin + slots], &mut pull.y[margin..margin + slots]);
        for i in 0..slots {
            let (dx, dy) = (bx[i] - ax[i], by[i] - ay[i]);
            let length = (dx * dx + dy * dy).sqrt();
            let force = stiffness[i] * (length - rest[i]) / length;
            px[i] = force * dx;
            py[i] = force * dy;
        }
    }
}

/// Sum of the pulls on every slot's point: plus at a spring's first end, minus at its second.
#[inline(always)]
pub(super) fn gather(
    lattice: &Lattice,
    margin: usize,
    pull: &[Pair; 4],
    axis: Axis,
    mut put: impl FnMut(usize, f64),
) {
    let slots = lattice.slots;
    let from =
        |offset: usize, family: usize| &pull[family].along(axis)[margin - offset..margin - offset + slots];
    let [h, v, f, r] = &lattice.families;
    let (h0, h1) = (from(h.from, 0), from(h.to, 0));
    let (v0, v1) = (from(v.from, 1), from(v.to, 1));
    let (f0, f1) = (from(f.from, 2), from(f.to, 2));
    let (r0, r1) = (from(r.from, 3), from(r.to, 3));
    for i in 0..slots {
        put(i, ((h0[i] - h1[i]) + (v0[i] - v1[i])) + ((f0[i] - f1[i]) + (r0[i] - r1[i])));
    }
}

/// What acts on the points besides springs and drag, and what the springs need; fixed during a substep.
pub(super) struct Load<'a> {
    /// Rest lengths by family, and of the extra springs [wu].
    pub rest: &'a [Vec<f64>; 4],
    pub extra_rest: &'a [f64],
    /// Contact force and weight [mass·wu/s²].
    pub external: &'a Pair,
    /// Zeros in front of every pull.
    pub margin: usize,
}

/// Accelerations of all points at some positions and velocities (physics.md, 3).
#[inline(always)]
pub(super) fn accelerations(
    lattice: &Lattice,
    physics: &Physics,
    load: &Load,
    (x, y): (&[f64], &[f64]),
    velocity: (&[f64], &[f64]),
    pull: &mut [Pair; 4],
    acceleration: &mut Pair,
) {
    let slots = lattice.slots;
    let (drag, inverse_mass) = (physics.drag, 1.0 / physics.mass);
    set_spring_pulls(lattice, load.rest, x, y, load.margin, pull);
    for axis in [Axis::X, Axis::Y] {
        let velocity = if axis == Axis::X { velocity.0 } else { velocity.1 };
        let external = load.external.along(axis);
        let out = acceleration.along_mut(axis);
        let len = out.len();
        let (velocity, external) = (&velocity[..len], &external[..len]);
        for i in slots..len {
            out[i] = (external[i] - drag * velocity[i]) * inverse_mass;
        }
        let out = &mut out[..slots];
        gather(lattice, load.margin, pull, axis, |i, sum| {
            out[i] = (sum + external[i] - drag * velocity[i]) * inverse_mass;
        });
    }
    for (spring, rest) in lattice.extra_springs.iter().zip(load.extra_rest) {
        let [a, b] = spring.ends;
        let (dx, dy) = (x[b] - x[a], y[b] - y[a]);
        let length = (dx * dx + dy * dy).sqrt();
        let pull = spring.stiffness * (length - rest) / length * inverse_mass;
        acceleration.x[a] += pull * dx;
        acceleration.y[a] += pull * dy;
        acceleration.x[b] -= pull * dx;
        acceleration.y[b] -= pull * dy;
    }
    let lowest = y.iter().fold(f64::INFINITY, |least, &v| if v < least { v } else { least });
    if lowest < 0.0 {
        add_floor(physics, y, velocity.0, acceleration);
    }
}

/// The floor plane at y = 0, below the ground; only reached by tunnelling (physics.md, "World").
#[cold]
fn add_floor(physics: &Physics, y: &[f64], vx: &[f64], acceleration: &mut Pair) {
    for i in (0..y.len()).filter(|&i| y[i] < 0.0) {
        let normal = -physics.floor_stiffness * y[i];
        let friction = physics.floor_friction * normal * libm::tanh(physics.floor_slip * normal * vx[i]);
        acceleration.y[i] += normal / physics.mass;
        acceleration.x[i] -= friction / physics.mass;
    }
}
