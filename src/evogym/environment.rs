//! [`Environment`]: a robot at a task; and [`Environments`]: many of them, in parallel.

use crate::base::error::Error;
use crate::base::threads::pool;
use crate::body::Body;
use crate::evogym::course::Course;
use crate::evogym::robot::actuators;
use crate::evogym::sense::{Rest, Sight, centre, extent, hull_area};
use crate::evogym::tasks::{End, Part, RANGE, REACHED, Reward, UNSTABLE};
use crate::sim::{Physics, Start, System, World};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const X: usize = 0;
const Y: usize = 1;

/// The result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOutcome {
    /// The reward of a step.
    pub reward: f64,
    /// True if the task ends here.
    pub terminated: bool,
}

/// One robot at a task.
#[derive(Clone, Debug)]
pub struct Environment {
    course: Arc<Course>,
    body: Body,
    world: World,
    rest: Rest,
    actuators: usize,
    /// Observation of the world. If a step becomes unstable, it stays that of the step before.
    points: Vec<[f64; 2]>,
    velocities: Vec<[f64; 2]>,
    centre: [f64; 2],
    orientation: f64,
    steps: u64,
    is_unstable: bool,
    turns: i32,
    goals: Vec<f64>,
    goal: usize,
    observation: Vec<f64>,
}

impl Environment {
    /// Places a body at the task's start, or at another column and row of its lower left cell.
    ///
    /// # Errors
    /// Returns an error if it has no room there.
    pub fn new(
        course: &Arc<Course>,
        body: &Body,
        start: Option<(i64, u32)>,
    ) -> Result<Self, Error> {
        let (column, row) = start.unwrap_or(course.task.start);
        course.check_room(body, (column, row))?;
        let system = System::new(body, Physics::default());
        let terrain = Arc::clone(&course.terrain);
        let world = World::on_terrain(system, Start { column, row }, terrain)
            .map_err(|error| Error::usage(format!("body: {error}")))?;
        let mut environment = Environment {
            course: Arc::clone(course),
            body: body.clone(),
            world,
            rest: Rest::new(&[]),
            actuators: actuators(body).count(),
            points: Vec::new(),
            velocities: Vec::new(),
            centre: [0.0; 2],
            orientation: 0.0,
            steps: 0,
            is_unstable: false,
            turns: 0,
            goals: Vec::new(),
            goal: 0,
            observation: Vec::new(),
        };
        environment.look();
        environment.rest = Rest::new(&environment.points);
        environment.look();
        environment.observe();
        Ok(environment)
    }

    /// Returns to the start. Of a task with goals, these are their columns from now on.
    pub fn reset(&mut self, goals: &[i64]) {
        self.world.reset();
        (self.steps, self.turns, self.goal, self.is_unstable) = (0, 0, 0, false);
        self.goals = goals.iter().map(|column| *column as f64 * 0.1).collect();
        self.look();
        self.observe();
    }

    /// Simulates a control step with new lengths of the actuators, or the last ones; returns true if
    /// it is unstable, now or before, and so has not moved.
    ///
    /// # Errors
    /// Returns an error if there are more or fewer lengths than actuators, or one is no number.
    pub fn simulate(&mut self, action: Option<&[f64]>) -> Result<bool, Error> {
        if let Some(action) = action {
            self.check(action)?;
            self.world
                .set_targets(action)
                .map_err(|error| Error::usage(format!("action: {error}")))?;
        }
        if !self.is_unstable {
            match self.world.step() {
                Ok(()) => {
                    self.steps += 1;
                    self.look();
                }
                Err(_) => self.is_unstable = true,
            }
        }
        Ok(self.is_unstable)
    }

    /// Takes a step of the task.
    ///
    /// # Errors
    /// As [`Environment::simulate`], and if no goal is left.
    pub fn step(&mut self, action: &[f64]) -> Result<StepOutcome, Error> {
        self.check_goals()?;
        let task = self.course.task;
        let (from, orientation, before) = (self.centre, self.orientation, self.potential());
        let is_unstable = self.simulate(Some(action))?;
        // Goals that are reached now are observed in the next step.
        self.observe();
        let [dx, dy] = [X, Y].map(|axis| self.centre[axis] - from[axis]);
        let mut reward = match task.reward {
            Reward::Way([x, y]) => x * dx + y * dy,
            Reward::Jump => 10.0 * dy - 5.0 * dx.abs(),
            Reward::Goals => self.approach(from[X]),
            Reward::Turn => self.turn(orientation),
            Reward::Place(_) | Reward::Area(_) | Reward::Extent(_) => self.potential() - before,
        };
        let mut terminated = is_unstable;
        if is_unstable {
            reward += UNSTABLE;
        }
        for end in task.ends {
            let (holds, value) = match *end {
                End::Above(axis, limit, value) => (self.centre[axis] > limit, value),
                End::Below(axis, limit, value) => (self.centre[axis] < limit, value),
                End::Tilted([low, high], value) => {
                    (self.orientation > low && self.orientation < high, value)
                }
                End::Goals(value) => (self.goal == self.goals.len(), value),
            };
            if holds {
                (terminated, reward) = (true, reward + value);
            }
        }
        Ok(StepOutcome { reward, terminated })
    }

    /// Takes a step if it is active, and writes the observation.
    fn take(
        &mut self,
        (action, active): (&[f64], &bool),
        seen: &mut [f64],
    ) -> Result<StepOutcome, Error> {
        let nothing = StepOutcome {
            reward: 0.0,
            terminated: false,
        };
        let outcome = match active {
            true => self.step(action),
            false => Ok(nothing),
        };
        seen.copy_from_slice(&self.observation);
        outcome
    }

    fn check(&self, action: &[f64]) -> Result<(), Error> {
        let refused = |found: String| {
            let expected = format!(
                "a length from 0.6 to 1.6 for each of {} actuators",
                self.actuators
            );
            Err(Error::usage(format!(
                "action: expected {expected}, found {found}"
            )))
        };
        if action.len() != self.actuators {
            return refused(format!("{} numbers", action.len()));
        }
        match action.iter().any(|length| length.is_nan()) {
            true => refused("one that is no number".to_string()),
            false => Ok(()),
        }
    }

    fn check_goals(&self) -> Result<(), Error> {
        if !self.course.task.has_goals() || self.goal < self.goals.len() {
            return Ok(());
        }
        let name = self.course.task.name;
        Err(Error::usage(format!(
            "{name}: no goal is left: reset the environment"
        )))
    }

    /// Looks at the world anew.
    fn look(&mut self) {
        // Absolute, in EvoGym's order of operations: at rest its last bits are observed.
        let left = self.world.start().column as f64 * 0.1;
        self.points.clear();
        self.points
            .extend(self.world.points().map(|[x, y]| [left + x, y]));
        self.velocities.clear();
        self.velocities.extend(self.world.velocities());
        self.centre = centre(self.points.iter().copied());
        if self.course.task.observation.contains(&Part::Orientation) {
            self.orientation = self.rest.orientation(&self.points);
        }
    }

    fn observe(&mut self) {
        let mut numbers = std::mem::take(&mut self.observation);
        numbers.clear();
        for part in self.course.task.observation {
            match *part {
                Part::Velocity => numbers.extend(centre(self.velocities.iter().copied())),
                Part::Orientation => numbers.push(self.orientation),
                Part::Shape => {
                    for axis in [X, Y] {
                        let from = self.centre[axis];
                        numbers.extend(self.points.iter().map(|point| point[axis] - from));
                    }
                }
                Part::Goal => {
                    let goal = self.goals.get(self.goal).or(self.goals.last());
                    let goal = goal.copied().unwrap_or(self.centre[X]);
                    numbers.extend([self.goal as f64, goal, goal - self.centre[X]]);
                }
                Part::Floor(distance) => {
                    let at = self.centre_in_voxels();
                    numbers.extend(self.course.sight.heights(at, distance, RANGE, false));
                }
                Part::Ceiling(distance) => {
                    let at = self.centre_in_voxels();
                    numbers.extend(self.course.sight.heights(at, distance, RANGE, true));
                }
            }
        }
        self.observation = numbers;
    }

    /// Returns what rewards of some tasks are differences of.
    fn potential(&self) -> f64 {
        match self.course.task.reward {
            Reward::Place([x, y]) => -((x - self.centre[X]).abs() + (y - self.centre[Y]).abs()),
            Reward::Area(factor) => factor * hull_area(&self.points),
            Reward::Extent(axis) => extent(&self.points, axis),
            Reward::Way(_) | Reward::Goals | Reward::Jump | Reward::Turn => 0.0,
        }
    }

    /// Returns the approach from a place to the goal, or to the next one if it is reached.
    fn approach(&mut self, from: f64) -> f64 {
        let mut reward = 0.0;
        while let Some(goal) = self.goals.get(self.goal) {
            let left = (goal - self.centre[X]).abs();
            reward = (goal - from).abs() - left;
            if left >= REACHED {
                break;
            }
            self.goal += 1;
        }
        reward
    }

    /// Returns the turning since an orientation, whole turns unwrapped.
    fn turn(&mut self, from: f64) -> f64 {
        let (low, high, before) = (PI / 3.0, 5.0 * PI / 3.0, self.turns);
        if from < low && self.orientation > high {
            self.turns -= 1;
        }
        if from > high && self.orientation < low {
            self.turns += 1;
        }
        TAU * f64::from(self.turns - before) + (self.orientation - from)
    }

    /// Returns the centre as EvoGym has it for sight \[voxel lengths\].
    fn centre_in_voxels(&self) -> [f64; 2] {
        centre(self.points.iter().map(|[x, y]| [x / 0.1, y / 0.1]))
    }

    /// Returns the task and its ground.
    pub fn course(&self) -> &Arc<Course> {
        &self.course
    }

    /// Returns the body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Returns the number of actuators.
    pub fn actuators(&self) -> usize {
        self.actuators
    }

    /// Returns the present observation.
    pub fn observation(&self) -> &[f64] {
        &self.observation
    }

    /// Returns the control steps since the start; one that became unstable does not count.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Returns the points \[wu\], in EvoGym's order of creation.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// Returns the velocities of the points \[wu/s\].
    pub fn velocities(&self) -> &[[f64; 2]] {
        &self.velocities
    }

    /// Returns the orientation against the start \[radians\].
    pub fn orientation(&self) -> f64 {
        self.rest.orientation(&self.points)
    }

    /// Returns each voxel's row and column, and its corners clockwise from the top left as indices
    /// of points.
    pub fn voxels(&self) -> impl Iterator<Item = ((usize, usize), [usize; 4])> + '_ {
        self.world.voxels()
    }

    /// Returns free heights \[wu\] below or above the centre to the corners of the objects with these
    /// names, 2·`distance` + 1 of them, at most `range` voxel lengths.
    pub fn heights(&self, names: &[&str], distance: u32, range: f64, above: bool) -> Vec<f64> {
        let objects = self.course.objects.iter();
        let seen = objects.filter(|object| names.contains(&object.name));
        let sight = Sight::new(seen);
        sight
            .heights(self.centre_in_voxels(), distance, range, above)
            .collect()
    }
}

/// Many robots at one task, all with as many points and actuators.
#[derive(Debug)]
pub struct Environments {
    all: Vec<Environment>,
    pool: Option<rayon::ThreadPool>,
}

impl Environments {
    /// Makes an environment for each body, with threads as asked for, or one per core.
    ///
    /// # Errors
    /// Returns an error if there is no body, one has no room, or they differ in size.
    pub fn new(
        course: &Arc<Course>,
        bodies: &[Body],
        start: Option<(i64, u32)>,
        threads: Option<usize>,
    ) -> Result<Self, Error> {
        let made = bodies.iter().enumerate().map(|(number, body)| {
            let found = bodies[..number].iter().position(|other| other == body);
            (found, body)
        });
        let mut all: Vec<Environment> = Vec::new();
        for (same, body) in made {
            let environment = match same {
                Some(number) => all[number].clone(),
                None => Environment::new(course, body, start)?,
            };
            all.push(environment);
        }
        let Some(first) = all.first() else {
            return Err(Error::usage("num_envs: expected at least one".to_string()));
        };
        let sizes = |one: &Environment| (one.points.len(), one.actuators);
        if let Some(number) = all.iter().position(|one| sizes(one) != sizes(first)) {
            let [(p, a), (q, b)] = [sizes(first), sizes(&all[number])];
            return Err(Error::usage(format!(
                "body {number}: expected {p} points and {a} actuators as of body 0, found {q} and {b}; \
                 whole episodes of different bodies are what returns() is for"
            )));
        }
        let is_alone = all.len() == 1 || threads == Some(1);
        let pool = if is_alone { None } else { Some(pool(threads)?) };
        Ok(Environments { all, pool })
    }

    /// Returns all environments.
    pub fn all(&self) -> &[Environment] {
        &self.all
    }

    /// Returns one of them, to change it.
    pub fn one(&mut self, number: usize) -> Option<&mut Environment> {
        self.all.get_mut(number)
    }

    /// Takes a step of every environment that is `active`. Actions, and the observations that are
    /// written, are rows one after another; the others keep their observation, with reward 0.
    ///
    /// # Errors
    /// As [`Environment::step`]; nothing is simulated then.
    pub fn step(
        &mut self,
        actions: &[f64],
        active: &[bool],
        observations: &mut [f64],
    ) -> Result<Vec<StepOutcome>, Error> {
        let width = self.all.first().map_or(0, |one| one.actuators);
        let size = self.all.first().map_or(0, |one| one.observation.len());
        let several = self.all.len() > 1;
        if actions.len() != width * self.all.len() || active.len() != self.all.len() {
            let text = format!("actions: expected {} × {width} numbers", self.all.len());
            return Err(Error::usage(text));
        }
        let work = || {
            self.all
                .iter()
                .zip(actions.chunks_exact(width.max(1)))
                .zip(active)
        };
        for (number, ((one, action), _)) in work().enumerate().filter(|(_, (_, active))| **active) {
            let checked = one.check(action).and_then(|()| one.check_goals());
            checked.map_err(|error| match several {
                true => Error::usage(format!("environment {number}: {}", error.message)),
                false => error,
            })?;
        }
        let (width, size) = (width.max(1), size.max(1));
        match &self.pool {
            None => {
                let actions = actions.chunks_exact(width).zip(active);
                let work = self.all.iter_mut().zip(actions);
                work.zip(observations.chunks_exact_mut(size))
                    .map(|((one, action), seen)| one.take(action, seen))
                    .collect()
            }
            Some(pool) => pool.install(|| {
                let actions = actions.par_chunks_exact(width).zip(active);
                let work = self.all.par_iter_mut().zip(actions);
                work.zip(observations.par_chunks_exact_mut(size))
                    .with_max_len(1)
                    .map(|((one, action), seen)| one.take(action, seen))
                    .collect()
            }),
        }
    }
}

/// The result of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Episode {
    /// The sum of its rewards.
    pub reward: f64,
    /// Its steps.
    pub steps: usize,
    /// True if the task ended; else the actions or the task's steps were used up.
    pub terminated: bool,
}

/// Simulates an episode of a robot whose actions are known, rows one after another, until the task
/// ends or `stop` is set.
///
/// # Errors
/// Returns an error if the robot has no room, or an action is refused.
pub fn episode(
    course: &Arc<Course>,
    body: &Body,
    start: Option<(i64, u32)>,
    actions: &[f64],
    goals: &[i64],
    stop: &AtomicBool,
) -> Result<Episode, Error> {
    let mut environment = Environment::new(course, body, start)?;
    environment.reset(goals);
    let mut episode = Episode {
        reward: 0.0,
        steps: 0,
        terminated: false,
    };
    let most = course.task.max_episode_steps as usize;
    for action in actions.chunks(environment.actuators.max(1)).take(most) {
        let outcome = environment.step(action)?;
        episode.reward += outcome.reward;
        episode.steps += 1;
        episode.terminated = outcome.terminated;
        if outcome.terminated || stop.load(Ordering::Relaxed) {
            break;
        }
    }
    Ok(episode)
}
