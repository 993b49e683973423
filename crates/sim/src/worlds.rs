//! [`Worlds`]: simulations of one system side by side.

use crate::grid::Grid;
use crate::simd::{BLOCK, Kernel, Lanes, dispatch};
use crate::step::limits::{SharedRigidPass, limit_rigid};
use crate::step::{Ended, before_rigid};
use crate::stop::{NEVER, Stopped, check};
use crate::system::System;
use crate::terrain::{Ground, Terrain};
use crate::unstable::{Unstable, UnstableReason};
use crate::world::{Start, StartError, TargetsError, World};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Simulations of one system from the same start that step side by side, each with its own stimulus
/// and the bits it has alone. Bodies with many rigid voxels are faster so: the rigid pass
/// (physics.md, "One substep", 4b) is serial within a simulation, but runs for all of them at once.
#[derive(Clone, Debug)]
pub struct Worlds {
    worlds: Vec<World>,
    ended: Vec<Option<Unstable>>,
    rigid: SharedRigidPass,
}

impl Worlds {
    /// Most simulations side by side.
    pub const MOST: usize = BLOCK;

    /// Returns true if simulations of this system are faster side by side, from about one rigid
    /// voxel in two. With fewer, eight states at once overflow the processor's cache.
    pub fn gain(system: &System) -> bool {
        let links = system.lattice.rigid_links.len();
        links >= SharedRigidPass::LEAST && links >= 2 * system.lattice.voxels.len()
    }

    /// Makes this many robots at rest, at least one and at most [`Worlds::MOST`], all pixels dark.
    pub fn new(system: impl Into<Arc<System>>, start: Start, count: usize) -> Self {
        Worlds::of(World::new(system, start), count)
    }

    /// Makes this many robots at rest on a terrain (see [`World::on_terrain`]), at least one and at
    /// most [`Worlds::MOST`].
    ///
    /// # Errors
    /// Returns a [`StartError`] if the robot's box overlaps a fixed cell.
    pub fn on_terrain(
        system: impl Into<Arc<System>>,
        start: Start,
        terrain: impl Into<Arc<Terrain>>,
        count: usize,
    ) -> Result<Self, StartError> {
        let first = World::on_terrain(system, start, terrain)?;
        Ok(Worlds::of(first, count))
    }

    fn of(first: World, count: usize) -> Self {
        let count = count.clamp(1, Worlds::MOST);
        let rigid = SharedRigidPass::new(&first.system.lattice);
        Worlds {
            worlds: vec![first; count],
            ended: vec![None; count],
            rigid,
        }
    }

    /// Selects an instruction set instead of the widest.
    #[must_use]
    pub fn with_instructions(mut self, set: crate::InstructionSet) -> Self {
        self.worlds
            .iter_mut()
            .for_each(|world| world.instructions = set);
        self
    }

    /// Returns the simulations.
    pub fn all(&self) -> &[World] {
        &self.worlds
    }

    /// Sets the image of one of them (see [`World::set_stimulus`]).
    pub fn set_stimulus(&mut self, number: usize, stimulus: &Grid<f64>) {
        self.worlds[number].set_stimulus(stimulus);
    }

    /// Sets the actuators' targets of one of them (see [`World::set_targets`]).
    ///
    /// # Errors
    /// Returns a [`TargetsError`], and changes nothing, for a wrong count or NaN.
    pub fn set_targets(&mut self, number: usize, targets: &[f64]) -> Result<(), TargetsError> {
        self.worlds[number].set_targets(targets)
    }

    /// Returns how each became unstable, if it did: it steps no more, and its state is useless.
    pub fn ended(&self) -> &[Option<Unstable>] {
        &self.ended
    }

    /// Simulates one control step of all that have not ended.
    pub fn step(&mut self) {
        self.step_unless(&NEVER).expect("NEVER is never set");
    }

    /// Simulates one control step of all that have not ended; returns within a substep or two once
    /// `stop` is set.
    ///
    /// # Errors
    /// Returns [`Stopped`] if it was stopped; the states are then useless.
    pub fn step_unless(&mut self, stop: &AtomicBool) -> Result<(), Stopped> {
        let Worlds {
            worlds,
            ended,
            rigid,
        } = self;
        let (system, instructions) = (Arc::clone(&worlds[0].system), worlds[0].instructions);
        let mut living: Vec<(&mut World, &mut Option<Unstable>)> = worlds
            .iter_mut()
            .zip(ended)
            .filter(|(_, ended)| ended.is_none())
            .collect();
        living.iter_mut().for_each(|(world, _)| world.begin_step());
        let steps = SideBySide {
            system: &system,
            worlds: &mut living,
            rigid,
            stop,
        };
        match dispatch(instructions, steps) {
            Ok(()) => {}
            Err(Ended::Stopped | Ended::Unstable(_)) => return Err(Stopped),
        }
        for (world, ended) in living.iter_mut().filter(|(_, ended)| ended.is_none()) {
            **ended = world.end_step().err();
        }
        Ok(())
    }
}

/// The substeps of a control step, for several simulations.
struct SideBySide<'a, 'w> {
    system: &'a System,
    worlds: &'a mut [(&'w mut World, &'w mut Option<Unstable>)],
    rigid: &'a mut SharedRigidPass,
    stop: &'a AtomicBool,
}

impl Kernel for SideBySide<'_, '_> {
    type Output = Result<(), Ended>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let SideBySide {
            system,
            worlds,
            rigid,
            stop,
        } = self;
        for _ in 0..system.physics.substeps {
            check(stop).map_err(|Stopped| Ended::Stopped)?;
            for (world, ended) in worlds.iter_mut().filter(|(_, ended)| ended.is_none()) {
                let World {
                    start,
                    terrain,
                    state,
                    scratch,
                    meter,
                    ..
                } = &mut **world;
                let ground = Ground {
                    terrain: terrain.as_deref(),
                    start_column: start.column,
                };
                let done = before_rigid::<L>(system, ground, state, scratch, meter.as_mut());
                **ended = done.err().map(|reason: UnstableReason| Unstable {
                    control_step: state.control_step,
                    reason,
                });
            }
            let living = || worlds.iter().filter(|(_, ended)| ended.is_none()).count();
            if rigid.is_worth_it(living()) {
                let positions = worlds
                    .iter_mut()
                    .map(|(world, _)| &mut world.state.position);
                rigid.limit::<L>(system, positions);
            } else {
                let living = worlds.iter_mut().filter(|(_, ended)| ended.is_none());
                living.for_each(|(world, _)| limit_rigid(system, &mut world.state.position));
            }
            for (world, _) in worlds.iter_mut() {
                let World { state, meter, .. } = &mut **world;
                meter
                    .iter_mut()
                    .for_each(|meter| meter.after_limits(&state.position));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{InstructionSet, Physics};

    /// A mostly rigid body with a muscle on either side and two sensors.
    const RIGID: &str = "1111111/1311141/1161511/3111114/1111111";
    const SOFT: &str = "22322/26251/42231";

    fn stimulus(number: usize) -> Grid<f64> {
        Grid::from_fn(5, 7, |row, column| {
            f64::from(u8::from((row * 3 + column + number).is_multiple_of(3)))
        })
    }

    #[test]
    fn side_by_side_every_simulation_has_the_bits_it_has_by_itself() {
        for body in [RIGID, SOFT] {
            let system = Arc::new(System::new(&body.parse().unwrap(), Physics::default()));
            let start = Start { column: 7, row: 3 };
            let alone = |number: usize| {
                let mut world = World::new(Arc::clone(&system), start);
                world.set_stimulus(&stimulus(number));
                (0..120).for_each(|_| world.step().unwrap());
                world
            };
            let alone: Vec<World> = (0..Worlds::MOST).map(alone).collect();
            assert_ne!(alone[0].state(), alone[1].state(), "what they see differs");
            for set in InstructionSet::ALL
                .into_iter()
                .filter(|set| set.is_available())
            {
                for count in [1, 2, 5, 8] {
                    let mut worlds =
                        Worlds::new(Arc::clone(&system), start, count).with_instructions(set);
                    (0..count).for_each(|number| worlds.set_stimulus(number, &stimulus(number)));
                    (0..120).for_each(|_| worlds.step());
                    for (number, world) in worlds.all().iter().enumerate() {
                        assert_eq!(
                            world.state(),
                            alone[number].state(),
                            "{body}, {set:?}, {count}: {number}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn one_that_becomes_unstable_ends_as_by_itself_and_the_others_go_on() {
        // A voxel as wide as its goal blows up at once: those under a bright pixel.
        let physics = Physics {
            blow_up_extent: 0.115,
            ..Physics::default()
        };
        let system = Arc::new(System::new(&"626/111".parse().unwrap(), physics));
        let start = Start { column: 0, row: 2 };
        let bright = |number: usize| {
            Grid::from_fn(2, 3, move |_, _| if number % 2 == 1 { 1.0 } else { 0.3 })
        };
        let mut worlds = Worlds::new(Arc::clone(&system), start, 6);
        (0..6).for_each(|number| worlds.set_stimulus(number, &bright(number)));
        (0..60).for_each(|_| worlds.step());
        for number in 0..6 {
            let mut world = World::new(Arc::clone(&system), start);
            world.set_stimulus(&bright(number));
            let ended = (0..60).find_map(|_| world.step().err());
            assert_eq!(worlds.ended()[number], ended, "{number}");
            assert_eq!(ended.is_some(), number % 2 == 1, "{number}");
            if ended.is_none() {
                assert_eq!(worlds.all()[number].state(), world.state());
            }
        }
    }

    #[test]
    fn a_stop_ends_all() {
        let system = System::new(&RIGID.parse().unwrap(), Physics::default());
        let mut worlds = Worlds::new(system, Start { column: 0, row: 2 }, 3);
        assert_eq!(worlds.step_unless(&AtomicBool::new(true)), Err(Stopped));
    }
}
