//! Logic gates that robots of a run compute: how they walk at every brightness of two cues.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::observer::Work;
use crate::base::session::Session;
use crate::body::Body;
use crate::data::dataset::GATES;
use crate::data::gates::Gates;
use crate::search::held_out_run::{CYCLES, HeldOutRun, control_steps};
use crate::store::audit::{AuditFile, RobotAudit};
use crate::store::run::Robot;
use crate::store::stored_run::StoredRun;
use crate::task::answer::{Assignment, Direction};
use crate::task::fitness::Group;
use crate::task::gates::gate;
use crate::task::stimulus::stimulus;

/// Brightnesses of each cue, from dark to bright.
pub(crate) const LEVELS: usize = 11;

/// A robot that computes a gate of two cues.
#[derive(Clone, Debug)]
pub(crate) struct GateWalks {
    /// Name of the gate.
    pub(crate) gate: String,
    pub(crate) robot: String,
    pub(crate) body: Body,
    /// The direction in which it walks where the gate is true.
    pub(crate) side: Direction,
    /// The classes for which it is true.
    pub(crate) bright: Vec<u8>,
    /// The verdict of its audit, if there is one.
    pub(crate) audit: Option<String>,
    /// Displacement \[voxel lengths\] by the brightness of the first cue (row) and of the second
    /// (column), both from dark to bright; `None` if unstable.
    pub(crate) walks: Grid<Option<f64>>,
}

impl GateWalks {
    /// Returns true if the gate is true for cues that are bright or dark.
    pub(crate) fn is_true_for(&self, a: bool, b: bool) -> bool {
        self.bright.contains(&(2 * u8::from(a) + u8::from(b)))
    }

    /// Returns where the gate switches along each edge of the square of brightnesses, in the order
    /// of `EDGES`; `None` where it does not. Between two levels the displacement is taken for linear.
    pub(crate) fn switches(&self) -> [Option<f64>; 4] {
        let last = LEVELS - 1;
        let edge = |cells: [(usize, usize); LEVELS]| {
            let walks: Vec<f64> = cells
                .iter()
                .map(|&(row, column)| self.walks[(row, column)])
                .collect::<Option<_>>()?;
            let step = walks.windows(2).position(|pair| pair[0] * pair[1] < 0.0)?;
            let (from, to) = (walks[step], walks[step + 1]);
            Some((step as f64 + from / (from - to)) / last as f64)
        };
        let along = |cell: fn(usize) -> (usize, usize)| edge(std::array::from_fn(cell));
        [
            along(|k| (k, 0)),
            along(|k| (k, LEVELS - 1)),
            along(|k| (0, k)),
            along(|k| (LEVELS - 1, k)),
        ]
    }
}

/// The edges of the square of brightnesses: which cue rises, and the other.
pub(crate) const EDGES: [&str; 4] = ["a, b dark", "a, b bright", "b, a dark", "b, a bright"];

/// Lets the fittest robot of each gate walk at all brightnesses; where an audit is known, the
/// fittest physical one, if there is one.
///
/// # Errors
/// Returns an error if the run is not about two cues, or if it was stopped.
pub(crate) fn walks(source: &StoredRun, session: &Session) -> Result<Vec<GateWalks>, Error> {
    let (run, config) = (&source.run, &source.run.config);
    if config.data.dataset != GATES || config.data.gates.cues != 2 {
        let text = format!(
            "{}: expected a run on the dataset {GATES} with two cues",
            source.path.display()
        );
        return Err(Error::input(text));
    }
    let grouping = config.grouping()?;
    let audit = AuditFile::if_any(run, &source.path)?;
    let verdict = |robot: &Robot| {
        let robots = audit.iter().flat_map(|audit| &audit.robots);
        robots.clone().find(|other| other.id == robot.id)
    };
    let is_physical = |robot: &&Robot| verdict(robot).is_some_and(RobotAudit::is_physical);
    let fittest = |robots: &mut dyn Iterator<Item = &'_ Robot>| -> Option<String> {
        robots
            .max_by(|a, b| a.objective.total_cmp(&b.objective))
            .map(|robot| robot.id.clone())
    };
    let mut stimuli = Vec::new();
    for place in 0..LEVELS * LEVELS {
        let level = |step: usize| step as f64 / (LEVELS - 1) as f64;
        let image = Gates::at([level(place / LEVELS), level(place % LEVELS)]);
        let (height, width) = (config.body.height, config.body.width);
        let seen = stimulus(&image, height, width, &config.stimulus)
            .map_err(|error| Error::input(format!("{}: {error}", error.key())))?;
        stimuli.push(seen);
    }
    let tasks = grouping.tasks().iter().filter(|split| !split.is_same_way());
    let chosen: Vec<_> = tasks
        .filter_map(|split| {
            let of_task = || {
                run.elites
                    .iter()
                    .filter(|robot| split.is_called(&robot.task))
            };
            let id =
                fittest(&mut of_task().filter(is_physical)).or_else(|| fittest(&mut of_task()))?;
            Some((split, of_task().find(|robot| robot.id == id)?))
        })
        .collect();
    session.observer.begins(&Work::new(
        format!("{} gates at every brightness:", chosen.len()),
        (chosen.len() * stimuli.len()) as u64,
        "rollouts",
    ));
    let mut all = Vec::new();
    for (number, (split, robot)) in chosen.into_iter().enumerate() {
        let done = (number * stimuli.len()) as u64;
        let walker = HeldOutRun::new(config, control_steps(config, CYCLES), done, session)?;
        let Some((displacements, _)) = walker.rollouts(robot, &stimuli) else {
            return Err(crate::base::stop::Stopped.into());
        };
        let (name, bright) = gate(split, config.data.gates.cues);
        let assignment = Assignment::from_training(split, run.fitness(), &run.answers(robot));
        let group = match bright.first().and_then(|class| split.group(*class)) {
            Some(group) => group,
            None => Group::B,
        };
        all.push(GateWalks {
            gate: name,
            robot: robot.id.clone(),
            body: robot.body.clone(),
            side: assignment.expected(group),
            bright,
            audit: verdict(robot).map(RobotAudit::conclusion),
            walks: Grid::from_fn(LEVELS, LEVELS, |row, column| {
                displacements[row * LEVELS + column]
            }),
        });
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_switches_where_its_walk_turns_round() {
        let of = |walk: fn(f64, f64) -> f64| GateWalks {
            gate: String::new(),
            robot: String::new(),
            body: "3".parse().unwrap(),
            side: Direction::Right,
            bright: Vec::new(),
            audit: None,
            walks: Grid::from_fn(LEVELS, LEVELS, |row, column| {
                Some(walk(row as f64 / 10.0, column as f64 / 10.0))
            }),
        };
        let rounded = |gate: GateWalks| {
            gate.switches()
                .map(|level| level.map(|level| (level * 100.0).round()))
        };
        let and = of(|a, b| a + b - 1.55);
        assert_eq!(rounded(and), [None, Some(55.0), None, Some(55.0)]);
        let a = of(|a, _| a - 0.25);
        assert_eq!(rounded(a), [Some(25.0), Some(25.0), None, None]);
    }
}
