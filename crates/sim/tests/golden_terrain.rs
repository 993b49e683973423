//! Faithful on terrain, too: EvoGym's own trajectories of its own robots come out of our simulator.
#![allow(clippy::disallowed_methods)]

mod common;

use common::{TerrainReference, bits, terrain_references};
use morphcog_sim::{
    Grid, InstructionSet, Physics, Start, System, Terrain, TerrainError, TerrainObject, World,
};

/// Voxel lengths within which a trajectory is EvoGym's.
const TOLERANCE: f64 = 1e-6;

/// EvoGym's own spread (voxel lengths) below which a whole trajectory is to agree.
const STEADY: f64 = 1e-8;

/// Simulates a reference run up to a control step; returns the greatest difference (voxel lengths)
/// and the control step in which it became unstable.
fn compared(reference: &TerrainReference, until: u64) -> (f64, Option<u64>) {
    let mut world = reference.world();
    let mut worst = 0f64;
    for step in 0..=until.min(reference.control_steps) {
        if step > 0
            && let Err(unstable) = reference.step(&mut world)
        {
            return (worst, Some(unstable.control_step));
        }
        let away = |ours: [f64; 2], theirs: [f64; 2]| {
            let x = ours[0] * 10.0 + reference.start_column as f64 - theirs[0];
            let y = ours[1] * 10.0 - theirs[1];
            x.abs().max(y.abs())
        };
        if let Some(&theirs) = reference.com.get(step as usize) {
            worst = worst.max(away(world.centre_of_mass(), theirs));
        }
        if let Some(theirs) = reference.points.get(&step) {
            assert_eq!(world.points().count(), theirs.len());
            for (ours, &theirs) in world.points().zip(theirs) {
                worst = worst.max(away(ours, theirs));
            }
        }
    }
    (worst, None)
}

#[test]
fn every_run_on_terrain_agrees_as_far_as_evogym_agrees_with_itself() {
    let mut whole = 0;
    for (name, reference) in terrain_references() {
        let is_steady = reference.spread_voxels_elsewhere < STEADY;
        // The step itself may already be beyond.
        let until = match is_steady {
            true => reference.control_steps,
            false => reference.first_step_beyond_1e_9 as u64 - 1,
        };
        let (worst, ended) = compared(&reference, until);
        println!(
            "{name:24} EvoGym's spread {:.1e}, {until:3} steps, differs by at most {worst:.1e} voxel lengths",
            reference.spread_voxels_elsewhere
        );
        assert!(worst <= TOLERANCE, "{name}: {worst:e}");
        let expected = u64::try_from(reference.ended_at).ok();
        assert_eq!(
            ended.filter(|_| is_steady),
            expected.filter(|_| is_steady),
            "{name}"
        );
        whole += usize::from(is_steady);
    }
    assert_eq!(whole, 33);
}

#[test]
fn runs_on_terrain_are_the_same_bits_on_every_instruction_set_and_after_a_reset() {
    for (name, reference) in terrain_references().into_iter().step_by(4) {
        let end = |mut world: World| {
            (0..40)
                .try_for_each(|_| reference.step(&mut world))
                .unwrap();
            (world.state().clone(), world)
        };
        let (first, mut world) = end(reference.world());
        for set in InstructionSet::ALL
            .into_iter()
            .filter(|set| set.is_available())
        {
            assert_eq!(
                end(reference.world().with_instructions(set)).0,
                first,
                "{name}"
            );
        }
        world.reset();
        assert_eq!(end(world).0, first, "{name}");
    }
}

fn object(column: u32, row: u32, rows: &[&str]) -> TerrainObject {
    let rows = rows
        .iter()
        .map(|row| row.chars().map(|cell| cell == '5').collect());
    TerrainObject {
        column,
        row,
        cells: Grid::from_rows(rows.collect()).unwrap(),
    }
}

#[test]
fn flat_ground_is_a_terrain_of_one_row() {
    let physics = Physics {
        // Flat ground below the top of which every voxel has a side: no cell is joined to a peg.
        peg_spacing: 1 << 30,
        ..Physics::default()
    };
    let system = System::new(&"3463/4005/3350".parse().unwrap(), physics.clone());
    // Above the ground: on it, the last bits of its height would decide.
    let start = Start {
        column: 500,
        row: 3,
    };
    let ground = object(0, 1, &["5".repeat(1000).as_str()]);
    let terrain = Terrain::new(&[ground], physics.cell_size).unwrap();
    let on_terrain = World::on_terrain(system.clone(), start, terrain).unwrap();
    let flat = World::new(system, start);
    let (mut on_terrain, mut flat) = (on_terrain, flat);
    for _ in 0..60 {
        on_terrain.step().unwrap();
        flat.step().unwrap();
        for (there, here) in on_terrain.points().zip(flat.points()) {
            let away = [0, 1].map(|axis| (there[axis] - here[axis]).abs());
            assert!(away.iter().all(|away| *away < 1e-9), "{there:?}, {here:?}");
        }
    }
}

#[test]
fn a_robot_far_away_on_a_terrain_touches_it_as_at_its_beginning() {
    // Steps under a robot that walks: its lists of contacts must follow.
    let teeth = "50".repeat(200);
    let ground = object(0, 0, &[&teeth, &"5".repeat(400)]);
    let physics = Physics::default();
    let system = System::new(&"7878/8787".parse().unwrap(), physics.clone());
    let terrain = Terrain::new(&[ground], physics.cell_size).unwrap();
    let world = |column| {
        World::on_terrain(system.clone(), Start { column, row: 3 }, terrain.clone()).unwrap()
    };
    let walk = |world: World| {
        let mut world = world;
        for step in 0..100 {
            let target = |k: usize| 1.1 + 0.5 * (step as f64 / 4.0 + 1.7 * k as f64).sin();
            let targets: Vec<f64> = (0..8).map(target).collect();
            world.set_targets(&targets).unwrap();
            world.step().unwrap();
        }
        world.centre_of_mass()
    };
    let (here, there) = (walk(world(20)), walk(world(220)));
    let away = [here[0] - there[0], here[1] - there[1]];
    assert!(
        away.iter().all(|away| away.abs() < 1e-9),
        "{here:?}, {there:?}"
    );
}

#[test]
fn what_is_no_terrain_no_start_and_no_targets_is_refused() {
    let terrain = |objects: &[TerrainObject]| Terrain::new(objects, 0.1);
    assert_eq!(
        terrain(&[object(0, 0, &["00"])]),
        Err(TerrainError::Empty(0))
    );
    assert_eq!(
        terrain(&[object(0, 0, &["505"])]),
        Err(TerrainError::Pieces(0))
    );
    let overlap = terrain(&[object(0, 0, &["555"]), object(2, 0, &["5"])]);
    assert_eq!(
        overlap.unwrap_err().to_string(),
        "objects 0 and 1 of the terrain overlap at column 2, row 0"
    );
    let far = terrain(&[object(0, 0, &["5"]), object(90_000, 90_000, &["5"])]);
    assert!(matches!(far, Err(TerrainError::TooLarge { .. })));
    let ground = terrain(&[object(0, 0, &["0005", "5555"])]).unwrap();
    let system = System::new(&"78/01".parse().unwrap(), Physics::default());
    let at = |column, row| World::on_terrain(system.clone(), Start { column, row }, ground.clone());
    assert_eq!(
        at(2, 1).unwrap_err().to_string(),
        "the robot's box overlaps the terrain at column 3, row 1"
    );
    assert!(at(1, 0).is_err() && at(-40, 0).is_ok());
    let mut world = at(0, 1).unwrap();
    for targets in [&[1.0][..], &[1.0; 3], &[1.0, f64::NAN]] {
        assert!(world.set_targets(targets).is_err());
    }
    // Nothing was changed; and what is too long is cut.
    let still = world.clone();
    assert!(bits(still).take(20).eq(bits(at(0, 1).unwrap()).take(20)));
    let mut cut = world.clone();
    world.set_targets(&[1e300, -5.0]).unwrap();
    cut.set_targets(&[1.6, 0.6]).unwrap();
    assert!(bits(world).take(20).eq(bits(cut).take(20)));
}
