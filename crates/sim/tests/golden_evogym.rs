//! Faithful: EvoGym's own trajectories come out of our simulator.
#![allow(clippy::disallowed_methods)]

mod common;

use common::{Reference, golden, references, sensitive};
use morphcog_sim::{Physics, UnstableReason, World};

/// 1e-6 voxel lengths in world units.
const TOLERANCE: f64 = 1e-7;

#[test]
fn every_reference_agrees_at_every_control_step_and_stored_point() {
    let physics = Physics::default();
    for reference in references()
        .iter()
        .filter(|reference| reference.unstable_at < 0)
    {
        let mut world = reference.world(&physics);
        assert_eq!(reference.com.len() as u64, reference.control_steps + 1);
        let mut worst = compare(&world, reference);
        for _ in 0..reference.control_steps {
            world.step().unwrap();
            worst = worst.max(compare(&world, reference));
        }
        println!(
            "{:14} differs by at most {:.1e} voxel lengths",
            reference.name,
            worst * 10.0
        );
        assert!(
            worst <= TOLERANCE,
            "{}: {worst:e} world units",
            reference.name
        );
    }
}

/// Greatest difference of centre of mass and points at the world's control step [wu].
fn compare(world: &World, reference: &Reference) -> f64 {
    let step = world.control_step();
    let offset = reference.start_column as f64 * 0.1;
    let difference = |ours: [f64; 2], theirs: [f64; 2]| {
        (ours[0] + offset - theirs[0])
            .abs()
            .max((ours[1] - theirs[1]).abs())
    };
    let mut worst = difference(world.centre_of_mass(), reference.com[step as usize]);
    if let Some(points) = reference.points.get(&step) {
        assert_eq!(world.points().count(), points.len(), "{}", reference.name);
        for (ours, &theirs) in world.points().zip(points) {
            worst = worst.max(difference(ours, theirs));
        }
    }
    worst
}

#[test]
fn sensitive_simulations_agree_within_three_times_the_spread_of_evogym_itself() {
    let physics = Physics::default();
    for reference in sensitive() {
        let spread = reference.spread();
        let mut world = reference.world(&physics);
        let start = world.centre_of_mass();
        let mut worst = 0f64;
        for theirs in &reference.com[1..] {
            world.step().unwrap();
            let ours = world.centre_of_mass();
            let [x, y] = [0, 1].map(|i| (ours[i] - start[i]) - (theirs[i] - reference.com[0][i]));
            worst = worst.max(x.hypot(y) * 10.0);
        }
        println!(
            "{:20} differs by at most {worst:.1e} voxel lengths, EvoGym by {spread:.1e}",
            reference.name
        );
        assert_eq!(world.control_step(), reference.control_steps);
        assert!(
            worst <= 3.0 * spread,
            "{}: {worst:e} voxel lengths, EvoGym {spread:e}",
            reference.name
        );
    }
}

#[test]
fn the_unstable_simulation_ends_in_the_same_control_step() {
    let physics = Physics::default();
    let reference: Reference = golden("unstable_comb");
    let mut world = reference.world(&physics);
    let mut worst = compare(&world, &reference);
    let end = loop {
        match world.step() {
            Ok(()) => worst = worst.max(compare(&world, &reference)),
            Err(end) => break end,
        }
    };
    assert_eq!(end.control_step, 70);
    assert_eq!(end.reason, UnstableReason::Overlaps);
    assert_eq!(world.control_step() + 1, reference.com.len() as u64);
    assert!(worst <= TOLERANCE, "{worst:e}");
}
