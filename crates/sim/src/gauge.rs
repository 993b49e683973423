//! [`EnergyGauge`]: the energies of a robot between control steps.

use crate::energy::Meter;
use crate::state::Pair;
use crate::world::World;

/// Energies of a robot at one moment \[mass·wu²/s²\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyNow {
    /// The motion of all points over the last substep.
    pub kinetic: f64,
    /// The springs, relative to their goals of the last control step.
    pub elastic: f64,
    /// The height of all points above the floor plane.
    pub gravitational: f64,
    /// The energy that the actuators have put in since the start, as in
    /// [`Energy::drive`](crate::Energy).
    pub drive: f64,
}

/// Measures the energies of a simulation between control steps: cheaper than
/// [`World::with_energy_meter`], which looks at every substep, and possible side by side.
#[derive(Clone, Debug)]
pub struct EnergyGauge {
    meter: Meter,
    /// Positions after the control step observed last.
    position: Pair,
    now: EnergyNow,
}

impl EnergyGauge {
    /// Begins with a simulation that has not stepped yet.
    pub fn new(world: &World) -> Self {
        let meter = Meter::new(&world.system);
        let position = world.state.position.clone();
        let now = EnergyNow {
            elastic: meter.elastic(&position),
            gravitational: meter.gravitational(&position),
            ..EnergyNow::default()
        };
        EnergyGauge {
            meter,
            position,
            now,
        }
    }

    /// Observes a control step that was just completed; each must be observed once.
    pub fn observe(&mut self, world: &World) -> EnergyNow {
        let EnergyGauge {
            meter,
            position,
            now,
        } = self;
        meter.set_goals([&world.scratch.goals, &world.scratch.vertical_goals]);
        // The goals of a step are set at its start, when the points are where the last left them.
        now.drive += meter.elastic(position) - now.elastic;
        position.clone_from(&world.state.position);
        now.elastic = meter.elastic(position);
        now.gravitational = meter.gravitational(position);
        now.kinetic = meter.kinetic(&world.state, world.system.physics.time_step);
        *now
    }

    /// Returns the energies observed last.
    pub fn now(&self) -> EnergyNow {
        self.now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Physics, Start, System};

    #[test]
    fn a_gauge_finds_the_drive_of_the_meter_and_what_falls_keeps_its_energy() {
        let observed = |body: &str| {
            let system = System::new(&body.parse().unwrap(), Physics::default());
            let mut world = World::new(system, Start { column: 0, row: 20 }).with_energy_meter();
            let mut gauge = EnergyGauge::new(&world);
            let begin = gauge.now();
            for _ in 0..40 {
                world.step().unwrap();
                gauge.observe(&world);
            }
            (world.energy(), begin, gauge.now())
        };
        let (metered, _, driven) = observed("344/044");
        let wrong = (driven.drive - metered.drive).abs();
        assert!(wrong < 1e-9 * metered.drive, "{driven:?}, {metered:?}");
        assert!(driven.kinetic > 0.0 && driven.elastic > 0.0);
        let (_, begin, end) = observed("111/202");
        let total = |at: EnergyNow| at.kinetic + at.elastic + at.gravitational;
        assert!(end.kinetic > 1.0 && end.drive == 0.0);
        let lost = (total(end) - total(begin)).abs();
        assert!(lost < 0.01 * end.kinetic, "{begin:?} {end:?}");
    }
}
