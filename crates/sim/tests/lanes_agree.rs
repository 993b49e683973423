//! Same bits: every instruction set of this machine gives the same simulation.

mod common;

use common::references;
use morphcog_sim::{InstructionSet, Physics};

#[test]
fn whole_simulations_are_bitwise_equal_on_every_instruction_set() {
    let physics = Physics::default();
    let sets: Vec<_> = InstructionSet::ALL
        .into_iter()
        .filter(|set| set.is_available())
        .collect();
    println!("instruction sets of this machine: {sets:?}");
    for reference in references() {
        let world = reference.world(&physics);
        let end = |set| {
            let mut world = world.clone().with_instructions(set);
            // A bit that differs spreads to all others within a few steps, and never comes back.
            let outcome = (0..reference.control_steps.min(50)).try_for_each(|_| world.step());
            (
                outcome,
                world
                    .points()
                    .map(|p| p.map(f64::to_bits))
                    .collect::<Vec<_>>(),
            )
        };
        let first = end(sets[0]);
        assert!(
            sets[1..].iter().all(|&set| end(set) == first),
            "{}",
            reference.name
        );
    }
}
