//! Simulating asks for no memory: what a simulation needs is there from its first control steps on.

mod common;

use common::references;
use morphcog_sim::Physics;

/// In which the lists of possible contacts reach their greatest length.
const WARM_UP: u64 = 200;

#[test]
fn a_control_step_allocates_nothing() {
    let physics = Physics::default();
    for reference in references() {
        let mut world = reference.world(&physics);
        if (0..WARM_UP.min(reference.control_steps))
            .try_for_each(|_| world.step())
            .is_err()
        {
            continue;
        }
        let info =
            allocation_counter::measure(|| (0..100).for_each(|_| world.step().unwrap_or(())));
        assert_eq!(info.count_total, 0, "{}: {info:?}", reference.name);
    }
}
