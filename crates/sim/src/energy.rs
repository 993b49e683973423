//! [`Energy`]: the energy that actuators and length limits put into a robot (physics.md, "One
//! substep", 4).
//!
//! At the start of every substep the servo makes a spring of stiffness k and gain g pull towards
//! its goal length with k·g·(d − goal). Over many substeps that is a spring of stiffness k·g with
//! the energy ½·k·g·(d − goal)². The length limits move points but leave their velocities alone, so
//! they change that energy without work. They move both ends of a spring equally far, so gravity's
//! part of the change is 0 up to rounding.

use crate::lattice::{FAMILIES, spring_index};
use crate::state::{Pair, State, X, Y};
use crate::system::System;

/// Energies put into a robot \[mass·wu²/s²\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
pub struct Energy {
    /// The actuators' share: they move the goals while the springs keep their lengths.
    pub drive: f64,
    /// The length limits' share: they move the points while the goals stay.
    pub limits: f64,
}

/// The data of a spring that its energy depends on.
#[derive(Clone, Copy, Debug)]
struct Spring {
    ends: [usize; 2],
    /// ½·k·g.
    half: f64,
    /// Index into the goals if the spring may be actuated.
    goal: Option<usize>,
    length: f64,
}

/// Measures a simulation without changing a bit of it.
#[derive(Clone, Debug)]
pub(crate) struct Meter {
    springs: Vec<Spring>,
    points: Vec<usize>,
    weight: f64,
    /// Half of a point's mass.
    half_mass: f64,
    /// Goals of the current control step, horizontal and off the lattice, then vertical; empty before
    /// the first (lengths then).
    goals: Vec<f64>,
    before: f64,
    pub energy: Energy,
}

impl Meter {
    pub fn new(System { lattice, physics }: &System) -> Self {
        let half = physics.servo_gain / 2.0;
        // From a slot to the ends of its springs, by family.
        let ends = [
            [0, 1],
            [0, lattice.pitch],
            [0, lattice.pitch + 1],
            [1, lattice.pitch],
        ];
        let has_vertical = !lattice.actuated_vertical.is_empty();
        let mut springs = Vec::new();
        for (slot, family) in
            (0..lattice.slots).flat_map(|slot| (0..FAMILIES).map(move |f| (slot, f)))
        {
            let index = spring_index(slot, family);
            if lattice.exists[index].to_bits() != 0 {
                springs.push(Spring {
                    ends: ends[family].map(|offset| slot + offset),
                    half: half * lattice.stiffness[index],
                    goal: match family {
                        0 => Some(slot),
                        1 if has_vertical => Some(lattice.goal_count() + slot),
                        _ => None,
                    },
                    length: lattice.lengths[family],
                });
            }
        }
        springs.extend(
            lattice
                .off_lattice_springs
                .iter()
                .enumerate()
                .map(|(i, spring)| Spring {
                    ends: spring.ends,
                    half: half * spring.stiffness,
                    goal: Some(lattice.len + i),
                    length: spring.length,
                }),
        );
        Meter {
            springs,
            points: lattice.points.iter().map(|&(point, _)| point).collect(),
            weight: physics.mass * physics.gravity,
            half_mass: physics.mass / 2.0,
            goals: Vec::new(),
            before: 0.0,
            energy: Energy::default(),
        }
    }

    /// Returns to rest; energies go on adding up.
    pub fn rest(&mut self) {
        self.goals.clear();
    }

    /// Records new goals at the start of a control step.
    pub fn drive(&mut self, goals: [&[f64]; 2], position: &Pair) {
        let before = self.potential(position);
        self.set_goals(goals);
        self.energy.drive += self.potential(position) - before;
    }

    /// Records the goals of the control step just completed.
    pub fn set_goals(&mut self, goals: [&[f64]; 2]) {
        self.goals.clear();
        goals
            .iter()
            .for_each(|goals| self.goals.extend_from_slice(goals));
    }

    /// Measures before the limits are applied.
    pub fn before_limits(&mut self, position: &Pair) {
        self.before = self.potential(position);
    }

    /// Measures after the limits have been applied.
    pub fn after_limits(&mut self, position: &Pair) {
        self.energy.limits += self.potential(position) - self.before;
    }

    fn potential(&self, position: &Pair) -> f64 {
        self.elastic(position) + self.gravitational(position)
    }

    pub fn gravitational(&self, position: &Pair) -> f64 {
        let height: f64 = self.points.iter().map(|&point| position[Y][point]).sum();
        self.weight * height
    }

    /// Returns the energy of the points' motion over the last substep.
    pub fn kinetic(&self, state: &State, time_step: f64) -> f64 {
        let speed = |point: usize, axis: usize| {
            (state.position[axis][point] - state.previous[axis][point]) / time_step
        };
        let squares = self.points.iter().map(|&point| {
            let [x, y] = [X, Y].map(|axis| speed(point, axis));
            x * x + y * y
        });
        self.half_mass * squares.sum::<f64>()
    }

    pub fn elastic(&self, position: &Pair) -> f64 {
        let [x, y] = [&position[X], &position[Y]];
        let elastic = |spring: &Spring| {
            let [a, b] = spring.ends;
            let (dx, dy) = (x[b] - x[a], y[b] - y[a]);
            let goal = spring
                .goal
                .and_then(|index| self.goals.get(index))
                .unwrap_or(&spring.length);
            let excess = (dx * dx + dy * dy).sqrt() - goal;
            spring.half * excess * excess
        };
        self.springs.iter().map(elastic).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Physics, Start, World};

    fn simulated(body: &str, physics: Physics) -> (Energy, [f64; 2]) {
        let system = System::new(&body.parse().unwrap(), physics);
        let mut world = World::new(system, Start { column: 0, row: 20 }).with_energy_meter();
        (0..50).for_each(|_| world.step().unwrap());
        (world.energy(), world.centre_of_mass())
    }

    #[test]
    fn a_passive_body_in_free_fall_is_given_no_energy() {
        let (energy, _) = simulated("111/202", Physics::default());
        assert_eq!(energy.drive, 0.0);
        assert!(energy.limits.abs() < 1e-6, "{energy:?}");
    }

    #[test]
    fn muscles_give_energy_and_limits_only_where_they_are_reached() {
        let (driven, _) = simulated("344/044", Physics::default());
        assert!(driven.drive > 1.0 && driven.limits > 0.0, "{driven:?}");
        let wide = Physics {
            limit_low: 0.0,
            limit_high: 9.0,
            ..Physics::default()
        };
        let (free, _) = simulated("344/044", wide);
        assert!(free.drive > 1.0 && free.limits.abs() < 1e-6, "{free:?}");
    }

    #[test]
    fn the_drive_of_one_step_is_the_energy_of_the_springs_it_stretches() {
        // One in-phase muscle at rest: at step 0 the target of its two sides is 1.1 rest widths.
        let physics = Physics::default();
        let system = System::new(&"3".parse().unwrap(), physics.clone());
        let mut world = World::new(system, Start { column: 0, row: 20 }).with_energy_meter();
        world.step().unwrap();
        let expected = 2.0 * 0.5 * physics.active_stiffness * physics.servo_gain * 0.01 * 0.01;
        let drive = world.energy().drive;
        assert!(
            (drive - expected).abs() < 1e-6 * expected,
            "{drive}, expected {expected}"
        );
    }

    #[test]
    fn a_measured_simulation_is_the_same_bits() {
        let system = System::new(&"3443/1044/3005".parse().unwrap(), Physics::default());
        let mut plain = World::new(system, Start { column: 0, row: 2 });
        let mut measured = plain.clone().with_energy_meter();
        for _ in 0..60 {
            plain.step().unwrap();
            measured.step().unwrap();
        }
        assert_eq!(plain.state(), measured.state());
        assert_eq!(plain.energy(), Energy::default());
    }
}
