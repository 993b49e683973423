//! The constants of physics: each is felt by a golden simulation, whose bits are pinned
//! (`crates/sim/tests/pinned_numbers.rs`; those of runs: `tests/slow/pinned_runs.rs`), or pinned here.

use crate::common::reference::{bits, references};
use morphcog::sim::Physics;
use rayon::prelude::*;
use serde_json::{Map, Value};

/// The constants whose least change no golden simulation feels, with the bits of their defaults.
const UNFELT: [(&str, u64); 8] = [
    ("blow_up_extent", 10f64.to_bits()),
    ("crossing_epsilon", 1e-4f64.to_bits()),
    ("floor_friction", 2f64.to_bits()),
    ("floor_slip", 0.2f64.to_bits()),
    ("floor_stiffness", 1.4e7f64.to_bits()),
    ("peg_spacing", 6f64.to_bits()),
    ("target_max", 1.6f64.to_bits()),
    ("unstable_ratio", 1f64.to_bits()),
];

/// The physics with one of its constants a little greater: by 1 if it counts, or else by 1e-12 of
/// itself.
fn nudged(constants: &Map<String, Value>, name: &str) -> Physics {
    let mut changed = constants.clone();
    let value = &mut changed[name];
    *value = match value.as_u64() {
        Some(count) => (count + 1).into(),
        None => (value.as_f64().expect("every constant is a number") * (1.0 + 1e-12)).into(),
    };
    serde_json::from_value(Value::Object(changed)).unwrap()
}

#[test]
fn the_golden_simulations_feel_the_least_change_of_every_constant_or_its_bits_are_pinned() {
    let physics = Physics::default();
    let Value::Object(constants) = serde_json::to_value(&physics).unwrap() else {
        panic!("not by name")
    };
    let rollouts = references();
    // Within this number of control steps.
    let steps = 100;
    let felt = |name: &str| {
        let changed = nudged(&constants, name);
        assert_ne!(changed, physics, "{name}");
        rollouts.iter().any(|rollout| {
            let ours = bits(rollout.world(&physics)).take(steps);
            !ours.eq(bits(rollout.world(&changed)).take(steps))
        })
    };
    let names: Vec<&String> = constants.keys().collect();
    assert!(names.len() > UNFELT.len());
    for (name, pinned) in UNFELT {
        let default = constants[name].as_f64().unwrap().to_bits();
        assert_eq!(default, pinned, "{name}");
    }
    let of_others = names
        .into_par_iter()
        .filter(|name| UNFELT.iter().all(|(unfelt, _)| unfelt != name));
    let unfelt: Vec<&String> = of_others.filter(|name| !felt(name)).collect();
    assert!(
        unfelt.is_empty(),
        "no golden simulation feels {unfelt:?}: pin the bits of their defaults"
    );
}
