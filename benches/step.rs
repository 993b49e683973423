//! Cost of one substep by body and instruction set; see `benches/README.md`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use morphcog::base::Grid;
use morphcog::base::lanes::InstructionSet;
use morphcog::body::{Body, Material};
use morphcog::sim::{Lattice, Physics, Start, World};

/// A body as the material of each of its 14 × 14 voxels.
type Kind = fn(usize, usize) -> Material;

/// A full soft body with sensors in the middle and muscles as feet.
fn soft(row: usize, column: usize) -> Material {
    match (row, column) {
        (11.., 0..4) => Material::MuscleInPhase,
        (11.., 10..) => Material::MuscleAntiphase,
        (3..9, 3..7) => Material::SensorShrink,
        (3..9, 7..11) => Material::SensorExpand,
        _ => Material::Soft,
    }
}

/// A ring.
fn ring(row: usize, column: usize) -> Material {
    let from_middle = |at: usize| at as f64 - 6.5;
    let square = from_middle(row).powi(2) + from_middle(column).powi(2);
    match (square, column) {
        (square, _) if !(4.0..36.0).contains(&square) => Material::Empty,
        (_, 0..7) if row > 9 => Material::MuscleInPhase,
        _ if row > 9 => Material::MuscleAntiphase,
        (_, 0..5) => Material::SensorShrink,
        (_, 9..) => Material::SensorExpand,
        _ => Material::Soft,
    }
}

/// A small body on two legs.
fn small(row: usize, column: usize) -> Material {
    match (row, column) {
        (6..11, 4 | 9) => Material::Soft,
        (6..11, 5..9) => Material::SensorShrink,
        (11.., 4 | 5) => Material::MuscleInPhase,
        (11.., 8 | 9) => Material::MuscleAntiphase,
        _ => Material::Empty,
    }
}

/// Mostly rigid.
fn rigid(row: usize, column: usize) -> Material {
    match (row, column) {
        (11.., 0..7) => Material::MuscleInPhase,
        (11.., _) => Material::MuscleAntiphase,
        (4..8, 4..7) => Material::SensorShrink,
        (4..8, 7..9) => Material::SensorExpand,
        (0, 0..3) => Material::Soft,
        _ => Material::Rigid,
    }
}

/// The soft body with voxels taken out, so that others touch only at corners.
fn cornered(row: usize, column: usize) -> Material {
    let gaps =
        [(0, 0), (1, 1), (0, 13), (1, 12), (4, 0), (5, 1), (4, 13), (5, 12), (9, 13), (10, 12), (2, 6)];
    if gaps.contains(&(row, column)) || (row, column) == (3, 7) { Material::Empty } else { soft(row, column) }
}

fn steps(criterion: &mut Criterion) {
    let physics = Physics::default();
    let stimulus = Grid::from_fn(14, 14, |row, column| {
        let square = (row as f64 - 6.5).powi(2) + (column as f64 - 6.5).powi(2);
        if (9.0..30.0).contains(&square) { 1.0 } else { 0.0 }
    });
    let bodies: [(&str, Kind); 5] =
        [("soft", soft), ("ring", ring), ("small", small), ("rigid", rigid), ("cornered", cornered)];
    for (name, material) in bodies {
        let body = Body::new(Grid::from_fn(14, 14, material)).expect("the body is valid");
        let lattice = Lattice::new(&body, &physics);
        let mut group = criterion.benchmark_group(format!("{name}, {} voxels", body.counts().total));
        // So that times are read per substep.
        group.throughput(Throughput::Elements(u64::from(physics.substeps)));
        for set in InstructionSet::ALL.into_iter().filter(|set| set.is_available()) {
            let start = Start { column: 493, row: physics.ground_row };
            let mut world = World::new(&lattice, &physics, start).with_instructions(set);
            world.set_stimulus(&stimulus);
            (0..30).for_each(|_| world.step().expect("the life is stable"));
            group.bench_function(set.name(), |bencher| bencher.iter(|| world.step()));
        }
    }
}

criterion_group!(benches, steps);
criterion_main!(benches);
