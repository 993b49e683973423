//! `morphcog bench`: how fast this machine simulates, in processor time.

use crate::base::Grid;
use crate::base::clock::{CLOCK, thread_time};
use crate::body::{Body, Material};
use crate::sim::{InstructionSet, Physics, Start, System, World};
use serde::Serialize;
use std::time::Duration;

/// A body to measure.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// Name of the kind of body.
    pub name: &'static str,
    /// The body.
    pub body: Body,
}

/// Simulation speed of one body, on one core.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Speed {
    pub(crate) body: &'static str,
    pub(crate) voxels: usize,
    pub(crate) instruction_set: &'static str,
    /// Clock: "processor" is the processor time of the thread, which other load does not change;
    /// "wall" where the system has no such clock.
    pub(crate) clock: &'static str,
    /// Microseconds per substep, the median of the repetitions.
    pub(crate) microseconds: f64,
    /// Control steps per second.
    pub(crate) control_steps: f64,
}

/// Material by row and column.
type Pattern = dyn Fn(usize, usize) -> Material;

/// Returns bodies of every kind that differs in cost. Their voxels form a fixed pattern, so that
/// figures compare across machines and versions.
pub fn specimens() -> Vec<Specimen> {
    use Material::{
        Empty, MuscleAntiphase, MuscleInPhase, Rigid, SensorExpand, SensorShrink, Soft,
    };
    let active = |r: usize, c: usize| match (r / 2 + c / 3) % 4 {
        0 => MuscleInPhase,
        1 => SensorExpand,
        2 => MuscleAntiphase,
        _ => SensorShrink,
    };
    let soft = move |r: usize, c: usize| {
        if (r / 3 + c / 3).is_multiple_of(2) {
            Soft
        } else {
            active(r, c)
        }
    };
    let kinds: [(&'static str, Box<Pattern>); 5] = [
        ("full, soft and active", Box::new(soft)),
        (
            "half, soft and active",
            Box::new(move |r, c| {
                if c < 7 || (r < 1 && c < 14) {
                    soft(r, c)
                } else {
                    Empty
                }
            }),
        ),
        (
            "small, soft and active",
            Box::new(move |r, c| if r >= 9 && c < 8 { soft(r, c) } else { Empty }),
        ),
        (
            "full, mostly rigid",
            Box::new(move |r, c| {
                if (r + 2 * c) % 3 < 2 {
                    Rigid
                } else {
                    soft(r, c)
                }
            }),
        ),
        // Gaps in diagonal pairs: at each, the other two voxels touch at a corner only.
        (
            "corner contacts",
            Box::new(move |r, c| {
                if matches!((r % 4, c % 4), (1, 2) | (2, 1)) {
                    Empty
                } else {
                    soft(r, c)
                }
            }),
        ),
    ];
    let specimen = |(name, material): (&'static str, Box<Pattern>)| {
        Body::new(Grid::from_fn(14, 14, material))
            .ok()
            .map(|body| Specimen { name, body })
    };
    kinds.into_iter().filter_map(specimen).collect()
}

/// Control steps per repetition: one actuation cycle.
const STEPS: u32 = 50;
/// Control steps before measuring, after which the robot has landed and walks.
const WARM_UP: u32 = 50;

/// Measures a body on an instruction set. Repeats fifty control steps of one rollout up to
/// `repetitions` times, for about two seconds at most, and takes the median.
pub(crate) fn measure(specimen: &Specimen, set: InstructionSet, repetitions: usize) -> Speed {
    let physics = Physics::default();
    let start = Start {
        column: 493,
        row: physics.ground_row,
    };
    let system = System::new(&specimen.body, physics.clone());
    let mut world = World::new(system, start).with_instructions(set);
    let stimulus = |r: usize, c: usize| if (r + c).is_multiple_of(3) { 1.0 } else { 0.0 };
    world.set_stimulus(&Grid::from_fn(
        specimen.body.height(),
        specimen.body.width(),
        stimulus,
    ));
    let mut live = |steps: u32| {
        let begin = thread_time();
        for _ in 0..steps {
            // An unstable rollout starts again; that costs no more than a step.
            if world.step().is_err() {
                world.reset();
            }
        }
        (thread_time() - begin).as_secs_f64() / f64::from(steps)
    };
    live(WARM_UP);
    let begin = thread_time();
    let mut seconds = vec![live(STEPS)];
    while seconds.len() < repetitions && thread_time() - begin < PATIENCE {
        seconds.push(live(STEPS));
    }
    seconds.sort_by(f64::total_cmp);
    let median = seconds[seconds.len() / 2];
    Speed {
        body: specimen.name,
        voxels: specimen.body.counts().total,
        instruction_set: set.name(),
        clock: CLOCK,
        microseconds: 1e6 * median / f64::from(physics.substeps),
        control_steps: 1.0 / median,
    }
}

/// Repetitions per body in a table, about half a second on a fast machine.
const REPETITIONS: usize = 101;
/// Time limit per body: a slow machine or instruction set does fewer repetitions.
const PATIENCE: Duration = Duration::from_secs(2);

pub(crate) fn table(sets: &[InstructionSet]) -> Vec<Speed> {
    let measured = |set: &InstructionSet| {
        specimens()
            .iter()
            .map(|s| measure(s, *set, REPETITIONS))
            .collect::<Vec<_>>()
    };
    sets.iter().flat_map(measured).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specimens_are_the_bodies_that_figures_are_quoted_for() {
        let list = specimens();
        let voxels: Vec<usize> = list
            .iter()
            .map(|specimen| specimen.body.counts().total)
            .collect();
        assert_eq!(voxels, [196, 105, 40, 196, 172]);
        assert!(list.iter().all(|specimen| specimen.body.is_valid(3)));
        let rigid = list[3]
            .body
            .voxels()
            .cells()
            .iter()
            .filter(|m| **m == Material::Rigid)
            .count();
        assert_eq!(rigid, 131);
        let points = |i: usize| System::new(&list[i].body, Physics::default()).point_count();
        // 24 gaps, none of which removes a whole vertex; each of 12 corner contacts adds a point.
        assert!(points(4) > points(0), "{} {}", points(4), points(0));
    }

    #[test]
    fn every_specimen_rollouts_and_is_measured() {
        for specimen in specimens() {
            let speed = measure(&specimen, InstructionSet::in_use(), 1);
            assert!(speed.microseconds > 0.0 && speed.control_steps > 0.0);
        }
    }
}
