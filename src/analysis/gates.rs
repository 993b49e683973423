//! Logic gates that robots of a run compute: which of a run's robots compute them, and how those
//! walk at every brightness of two cues, from raised starts, and when a cue changes mid-walk.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::observer::Work;
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::body::Body;
use crate::data::gates::Gates;
use crate::store::audit::{AuditFile, RobotAudit};
use crate::store::run::{Robot, RunFile};
use crate::store::stored_run::StoredRun;
use crate::task::answer::{Assignment, Direction, is_correct};
use crate::task::evaluation::{displacements_in, fresh_rollouts};
use crate::task::fitness::Group;
use crate::task::gates::{Gate, gate};
use crate::task::grouping::ClassSplit;
use crate::task::perturbation::{PerturbedSetting, condition};
use crate::task::protocol::{Protocol, RolloutMode};
use crate::task::stimulus::stimulus;
use rayon::prelude::*;

/// Brightnesses of each cue, from dark to bright.
pub(crate) const LEVELS: usize = 11;

/// Rows by which starts are raised.
const RAISED: [u32; 2] = [1, 2];

/// A robot that computes a gate.
#[derive(Clone, Debug)]
pub(crate) struct FoundGate<'a> {
    pub(crate) gate: Gate,
    pub(crate) robot: &'a Robot,
    /// The direction in which it walks when the gate is true.
    pub(crate) side: Direction,
    split: ClassSplit,
    assignment: Assignment,
}

/// Returns the robot of each gate of a run, in the order of its tasks: of those that `is_wanted`
/// the fittest, else the fittest of all. None if the run is not about gates.
pub(crate) fn found(run: &RunFile, is_wanted: impl Fn(&Robot) -> bool) -> Vec<FoundGate<'_>> {
    let (Some(gates), Ok(grouping)) = (
        Gates::named(&run.config.data.dataset),
        run.config.grouping(),
    ) else {
        return Vec::new();
    };
    let of = |split: &ClassSplit| {
        let of_task = run
            .elites
            .iter()
            .filter(|robot| split.is_called(&robot.task));
        let robot = of_task.max_by(|a, b| {
            let rank = |robot: &Robot| (is_wanted(robot), robot.objective);
            let (a, b) = (rank(a), rank(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })?;
        let gate = gate(split, gates.cues)?;
        let assignment = Assignment::from_training(split, run.fitness(), &run.answers(robot));
        let group = match gate.is_true_for(split.classes(Group::A)[0]) {
            true => Group::A,
            false => Group::B,
        };
        Some(FoundGate {
            gate,
            robot,
            side: assignment.expected(group),
            split: split.clone(),
            assignment,
        })
    };
    let tasks = grouping.tasks().iter().filter(|split| !split.is_same_way());
    tasks.filter_map(of).collect()
}

/// The number of walks in the correct direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CorrectWalks {
    pub(crate) correct: usize,
    pub(crate) all: usize,
}

/// What a measured gate of two cues does at every brightness, from raised starts, and when a cue
/// changes mid-walk.
#[derive(Clone, Debug)]
pub(crate) struct GateWalks {
    pub(crate) gate: Gate,
    pub(crate) robot: String,
    pub(crate) body: Body,
    /// Fitness of the robot \[voxel lengths\].
    pub(crate) fitness: f64,
    /// The direction in which it walks when the gate is true.
    pub(crate) side: Direction,
    /// The verdict of its audit, if there is one.
    pub(crate) audit: Option<String>,
    /// Displacement \[voxel lengths\] by the brightness of the first cue (row) and of the second
    /// (column), both from dark to bright; `None` if unstable.
    pub(crate) walks: Grid<Option<f64>>,
    /// Walks of every input from raised starts.
    pub(crate) starts: CorrectWalks,
    /// Walks of every input after every other, in one simulation.
    pub(crate) changes: CorrectWalks,
}

impl GateWalks {
    /// Returns the brightnesses at which the walk reverses along each edge of the square, in
    /// this order: the first cue rises while the second is dark, while it is bright; the second
    /// rises while the first is dark, while it is bright. Between two levels the displacement is
    /// taken for linear.
    pub(crate) fn switches(&self) -> [Vec<f64>; 4] {
        let last = LEVELS - 1;
        let along = |cell: &dyn Fn(usize) -> (usize, usize)| {
            let turn = |step: usize| {
                let (from, to) = (self.walks[cell(step)]?, self.walks[cell(step + 1)]?);
                (from * to < 0.0).then(|| (step as f64 + from / (from - to)) / last as f64)
            };
            (0..last).filter_map(turn).collect()
        };
        [
            along(&|k| (k, 0)),
            along(&|k| (k, last)),
            along(&|k| (0, k)),
            along(&|k| (last, k)),
        ]
    }

    /// Returns the displacement under an input, that is, with each cue dark or bright.
    pub(crate) fn walk(&self, input: u8) -> Option<f64> {
        let level = |is_bright: bool| usize::from(is_bright) * (LEVELS - 1);
        self.walks[(level(input & 2 != 0), level(input & 1 != 0))]
    }
}

/// Lets a robot of each gate walk at all brightnesses, from raised starts and through all changes
/// of the cues: the fittest that an audit found physical, else the fittest.
///
/// # Errors
/// Returns an error if the run is not about two cues, or if it was stopped.
pub(crate) fn walks(source: &StoredRun, session: &Session) -> Result<Vec<GateWalks>, Error> {
    let run = &source.run;
    if Gates::named(&run.config.data.dataset) != Some(Gates { cues: 2 }) {
        let text = format!(
            "{}: expected a run on the dataset gates, found {}",
            source.path.display(),
            run.config.data.dataset
        );
        return Err(Error::input(text));
    }
    let audit = AuditFile::if_any(run, &source.path)?;
    let verdict = |robot: &Robot| {
        let robots = audit.iter().flat_map(|audit| &audit.robots);
        robots.into_iter().find(|other| other.id == robot.id)
    };
    let chosen = found(run, |robot| {
        verdict(robot).is_some_and(RobotAudit::is_physical)
    });
    let what = format!("{} gates at every brightness:", chosen.len());
    session
        .observer
        .begins(&Work::new(what, chosen.len() as u64, "gates"));
    let mut all = Vec::new();
    for (number, found) in (1..).zip(chosen) {
        let audit = verdict(found.robot).map(RobotAudit::conclusion);
        all.push(of_gate(run, found, audit, session)?);
        session.observer.progress(number);
    }
    Ok(all)
}

fn of_gate(
    run: &RunFile,
    found: FoundGate,
    audit: Option<String>,
    session: &Session,
) -> Result<GateWalks, Error> {
    let FoundGate {
        gate,
        robot,
        side,
        split,
        assignment,
    } = found;
    let config = &run.config;
    let protocol = |rollout| Protocol {
        rollout,
        ..config.protocol.clone()
    };
    let body = &robot.body;
    let seen = |levels: [f64; 2]| {
        stimulus(
            &Gates::at(levels),
            body.height(),
            body.width(),
            &config.stimulus,
        )
        .map_err(|error| Error::input(format!("{}: {error}", error.key())))
    };
    let level = |step: usize| step as f64 / (LEVELS - 1) as f64;
    let every = (0..LEVELS * LEVELS).map(|k| seen([level(k / LEVELS), level(k % LEVELS)]));
    let every: Vec<Grid<f64>> = every.collect::<Result<_, Error>>()?;
    let input = |input: u8| seen([f64::from(input >> 1), f64::from(input & 1)]);
    let inputs: Vec<Grid<f64>> = (0..4).map(input).collect::<Result<_, Error>>()?;
    let is_right = |input: usize, walk: Option<f64>| {
        is_correct(&split, assignment, input as u8, walk, 0.0) == Some(true)
    };
    let right = |walks: Vec<(usize, Option<f64>)>| CorrectWalks {
        all: walks.len(),
        correct: walks
            .into_iter()
            .filter(|(input, walk)| is_right(*input, *walk))
            .count(),
    };
    let pool = session.pool()?;

    let fresh = protocol(RolloutMode::Fresh);
    let walk_all = |images: &[Grid<f64>], conditions: &[_]| {
        let setting = (&config.physics, &fresh);
        pool.install(|| fresh_rollouts(body, images, conditions, setting, &|_| (), session))
            .map(|(walks, _)| walks.into_iter().map(Result::ok).collect::<Vec<_>>())
    };
    let at_levels = walk_all(&every, &[])?;
    let starts: Vec<(usize, u32)> = (0..4)
        .flat_map(|input| RAISED.map(|rows| (input, rows)))
        .collect();
    let images: Vec<Grid<f64>> = starts.iter().map(|at| inputs[at.0].clone()).collect();
    let conditions: Vec<_> = starts.iter().map(|at| condition(at.1, false)).collect();
    let raised = walk_all(&images, &conditions)?;
    let starts = right(starts.iter().map(|at| at.0).zip(raised).collect());

    let pairs: Vec<(usize, usize)> = (0..16)
        .map(|k| (k / 4, k % 4))
        .filter(|(before, after)| before != after)
        .collect();
    let after = |&(before, after): &(usize, usize)| -> Result<(usize, Option<f64>), Stopped> {
        let shown = PerturbedSetting {
            body: body.clone(),
            physics: config.physics.clone(),
            protocol: protocol(RolloutMode::Sequential),
            stimuli: vec![inputs[before].clone(), inputs[after].clone()],
        };
        let walks = displacements_in(&shown, session)?;
        Ok((after, walks.map(|walks| walks[1])))
    };
    let changes: Vec<_> =
        pool.install(|| pairs.par_iter().map(after).collect::<Result<_, Stopped>>())?;

    Ok(GateWalks {
        gate,
        robot: robot.id.clone(),
        body: body.clone(),
        fitness: robot.objective,
        side,
        audit,
        walks: Grid::from_fn(LEVELS, LEVELS, |row, column| {
            at_levels[row * LEVELS + column]
        }),
        starts,
        changes: right(changes),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_switches_where_its_walk_turns_round() {
        let of = |walk: fn(f64, f64) -> f64| {
            let none = CorrectWalks { correct: 0, all: 0 };
            let gate = GateWalks {
                gate: Gate {
                    name: String::new(),
                    true_for: Vec::new(),
                },
                robot: String::new(),
                body: "3".parse().unwrap(),
                fitness: 0.0,
                side: Direction::Right,
                audit: None,
                walks: Grid::from_fn(LEVELS, LEVELS, |row, column| {
                    Some(walk(row as f64 / 10.0, column as f64 / 10.0))
                }),
                starts: none,
                changes: none,
            };
            gate.switches().map(|levels| {
                let rounded = levels.iter().map(|level| (level * 100.0).round());
                rounded.collect::<Vec<_>>()
            })
        };
        let none = Vec::new;
        let and = of(|a, b| a + b - 1.55);
        assert_eq!(and, [none(), vec![55.0], none(), vec![55.0]]);
        let twice = of(|a, _| 0.25 - (a - 0.5).abs());
        assert_eq!(twice, [vec![25.0, 75.0], vec![25.0, 75.0], none(), none()]);
    }
}
