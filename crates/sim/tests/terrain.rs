//! Robots on terrain: side by side, without memory, and at places far out.
#![allow(clippy::disallowed_methods)]

mod common;

use common::bits;
use morphcog_sim::{
    Grid, InstructionSet, Physics, Start, System, Terrain, TerrainObject, World, Worlds,
};
use std::sync::Arc;

/// A body of both kinds of actuators beside a muscle, a sensor and two voxels that touch at a
/// corner only.
const BODY: &str = "78387/80805/71878";

/// Rigid enough for the pass that several simulations share.
const RIGID: &str = "1111111/1711181/1181711/7111118/1111111";

fn steps() -> Arc<Terrain> {
    let rows = ["0000050000", "0005555500", "5555555555"];
    let cells = rows.map(|row| row.chars().map(|cell| cell == '5').collect());
    let object = TerrainObject {
        column: 10,
        row: 1,
        cells: Grid::from_rows(cells.to_vec()).unwrap(),
    };
    Arc::new(Terrain::new(&[object], Physics::default().cell_size).unwrap())
}

fn system(body: &str) -> Arc<System> {
    Arc::new(System::new(&body.parse().unwrap(), Physics::default()))
}

const START: Start = Start { column: 11, row: 4 };

fn targets(body: &str, number: usize, step: usize) -> Vec<f64> {
    let actuators = body.chars().filter(|voxel| "78".contains(*voxel)).count();
    let angle = |k: usize| step as f64 / 4.0 + 1.3 * k as f64 + 0.7 * number as f64;
    (0..actuators).map(|k| 1.1 + 0.5 * angle(k).sin()).collect()
}

fn alone(body: &str, set: InstructionSet, number: usize) -> World {
    let world = World::on_terrain(system(body), START, steps()).unwrap();
    let mut world = world.with_instructions(set);
    for step in 0..60 {
        world.set_targets(&targets(body, number, step)).unwrap();
        world.step().unwrap();
    }
    world
}

#[test]
fn alone_or_side_by_side_on_any_instructions_a_robot_on_terrain_has_the_same_bits() {
    for body in [BODY, RIGID] {
        let first = [0, 1, 2].map(|number| alone(body, InstructionSet::ALL[0], number));
        assert_ne!(first[0].state(), first[1].state());
        let sets = InstructionSet::ALL.into_iter();
        for set in sets.filter(|set| set.is_available()) {
            assert_eq!(alone(body, set, 0).state(), first[0].state(), "{set:?}");
            let worlds = Worlds::on_terrain(system(body), START, steps(), 3).unwrap();
            let mut worlds = worlds.with_instructions(set);
            for step in 0..60 {
                for number in 0..3 {
                    let targets = targets(body, number, step);
                    worlds.set_targets(number, &targets).unwrap();
                }
                worlds.step();
            }
            for (world, alone) in worlds.all().iter().zip(&first) {
                assert_eq!(world.state(), alone.state(), "{body}, {set:?}");
            }
        }
    }
}

#[test]
fn a_control_step_on_terrain_allocates_nothing() {
    let mut world = alone(BODY, InstructionSet::in_use(), 0);
    let inputs: Vec<_> = (60..160).map(|step| targets(BODY, 0, step)).collect();
    let before = world.centre_of_mass();
    let info = allocation_counter::measure(|| {
        for targets in &inputs {
            world.set_targets(targets).unwrap();
            world.step().unwrap();
        }
    });
    assert_eq!(info.count_total, 0, "{info:?}");
    assert_ne!(world.centre_of_mass(), before);
}

#[test]
fn vertical_actuators_change_heights_and_horizontal_ones_widths() {
    for (body, axis) in [("7", 0), ("8", 1)] {
        let start = Start { column: 0, row: 30 };
        let mut world = World::new(system(body), start);
        world.set_targets(&[1.2]).unwrap();
        (0..3).for_each(|_| world.step().unwrap());
        let extent = |axis: usize| {
            let of: Vec<f64> = world.points().map(|point| point[axis]).collect();
            let low = of.iter().copied().fold(f64::INFINITY, f64::min);
            of.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
        };
        assert!(extent(axis) > 0.105, "{body}: {}", extent(axis));
        assert!(extent(axis) > 1.03 * extent(1 - axis), "{body}");
    }
}

#[test]
fn a_start_anywhere_is_an_answer_and_no_panic() {
    for column in [i64::MIN, -5, 40, i64::MAX] {
        for row in [0, 3, u32::MAX] {
            let start = Start { column, row };
            let world = World::on_terrain(system("78"), start, steps()).unwrap();
            assert!(bits(world).take(3).count() >= 1);
        }
    }
}
