//! Cost of one substep by body and instruction set; see `benches/README.md`.
#![allow(clippy::disallowed_methods)]

mod processor;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use morphcog::base::Grid;
use morphcog::commands::bench::specimens;
use morphcog::sim::{InstructionSet, Physics, Start, System, World};
use processor::Processor;
use std::sync::Arc;

fn steps(criterion: &mut Criterion<Processor>) {
    let physics = Physics::default();
    let stimulus = Grid::from_fn(14, 14, |row, column| {
        let square = (row as f64 - 6.5).powi(2) + (column as f64 - 6.5).powi(2);
        if (9.0..30.0).contains(&square) {
            1.0
        } else {
            0.0
        }
    });
    for specimen in specimens() {
        let system = Arc::new(System::new(&specimen.body, physics.clone()));
        let mut group = criterion.benchmark_group(specimen.name);
        // Criterion then reports times per substep.
        group.throughput(Throughput::Elements(u64::from(physics.substeps)));
        for set in InstructionSet::ALL
            .into_iter()
            .filter(|set| set.is_available())
        {
            let start = Start {
                column: 493,
                row: physics.ground_row,
            };
            let mut world = World::new(Arc::clone(&system), start).with_instructions(set);
            world.set_stimulus(&stimulus);
            (0..30).for_each(|_| world.step().expect("the rollout is stable"));
            group.bench_function(set.name(), |bencher| bencher.iter(|| world.step()));
        }
    }
}

criterion_group!(name = benches; config = Criterion::default().with_measurement(Processor); targets = steps);
criterion_main!(benches);
