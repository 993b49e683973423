//! Same bits: every instruction set of this machine gives the same life.

mod common;

use common::references;
use morphcog::base::lanes::InstructionSet;
use morphcog::sim::{Physics, World};

#[test]
fn whole_lives_are_bitwise_equal_on_every_instruction_set() {
    let physics = Physics::default();
    let sets: Vec<_> = InstructionSet::ALL.into_iter().filter(|set| set.is_available()).collect();
    println!("instruction sets of this machine: {sets:?}");
    for life in references() {
        let lattice = life.lattice(&physics);
        let end = |set| {
            let mut world = World::new(&lattice, &physics, life.start()).with_instructions(set);
            world.set_stimulus(&life.stimulus);
            let outcome = (0..life.control_steps).try_for_each(|_| world.step());
            (outcome, world.points().map(|p| p.map(f64::to_bits)).collect::<Vec<_>>())
        };
        let first = end(sets[0]);
        assert!(sets[1..].iter().all(|&set| end(set) == first), "{}", life.name);
    }
}
