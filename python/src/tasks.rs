//! EvoGym's tasks; see `morphcog.gym`.

use crate::errors::{entered, raised, refused, room};
use crate::watch::watched;
use morphcog::base::Grid;
use morphcog::base::threads::pool;
use morphcog::body::Body;
use morphcog::draw::course::{View, picture};
use morphcog::evogym::course::Course;
use morphcog::evogym::environment::{Environment, Environments, Episode, episode};
use morphcog::evogym::robot;
use morphcog::evogym::tasks::{BOUND, REFUSED, TASKS, find};
use morphcog::sim::FloatEnvironment;
use numpy::ndarray::{Array2, Array3};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Where a robot stands: column and row of the lower left cell of its box.
type Start = Option<(i64, u32)>;

fn body(voxels: &PyReadonlyArray2<u8>) -> PyResult<Body> {
    let view = voxels.as_array();
    let (height, width) = view.dim();
    let grid = Grid::from_fn(height, width, |row, column| view[(row, column)]);
    robot::body(&grid).map_err(|error| raised(&error))
}

fn course(task: &str) -> PyResult<Arc<Course>> {
    let task = find(task).map_err(|error| raised(&error))?;
    Course::new(task)
        .map(Arc::new)
        .map_err(|error| raised(&error))
}

/// Returns the names of the tasks with their steps, and of those that are refused.
#[pyfunction]
pub(crate) fn tasks() -> (Vec<(&'static str, u32)>, Vec<&'static str>) {
    let known = TASKS.iter().map(|task| (task.name, task.max_episode_steps));
    (
        known.collect(),
        REFUSED.iter().map(|(name, _)| *name).collect(),
    )
}

/// Returns the steps of a task; fails with the reason why it is refused.
#[pyfunction]
pub(crate) fn task_steps(task: &str) -> PyResult<u32> {
    find(task)
        .map(|task| task.max_episode_steps)
        .map_err(|error| raised(&error))
}

/// Robots at one task. Threads that share it take turns.
#[pyclass(frozen, module = "morphcog._morphcog")]
pub(crate) struct TasksData {
    environments: Mutex<Environments>,
    course: Arc<Course>,
    count: usize,
    observed: usize,
    actuators: Vec<usize>,
}

/// Observations, rewards and ends of steps.
type Steps<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
);

#[pymethods]
impl TasksData {
    /// Places one body in each of `count` environments, or one body each.
    #[new]
    #[pyo3(signature = (task, bodies, count, start, threads))]
    fn new(
        task: &str,
        bodies: Vec<PyReadonlyArray2<u8>>,
        count: usize,
        start: Start,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let _environment = entered()?;
        let course = course(task)?;
        let mut robots = bodies.iter().map(body).collect::<PyResult<Vec<Body>>>()?;
        if robots.len() == 1 {
            // Tried first, since a lack of memory for single ones could not be reported.
            drop(room::<Environment>(Some(count), "the environments")?);
            robots.resize(count, robots[0].clone());
        }
        if robots.len() != count {
            let found = robots.len();
            return Err(refused(format!(
                "body: expected one body or {count}, found {found}"
            )));
        }
        let environments =
            Environments::new(&course, &robots, start, threads).map_err(|error| raised(&error))?;
        Ok(TasksData {
            observed: environments.all()[0].observation().len(),
            actuators: robot::actuators(&robots[0]).collect(),
            environments: Mutex::new(environments),
            course,
            count,
        })
    }

    /// Returns the numbers of environments, of an observation and of actuators.
    #[getter]
    fn sizes(&self) -> (usize, usize, usize) {
        (self.count, self.observed, self.actuators.len())
    }

    #[getter]
    fn bound(&self) -> f64 {
        BOUND
    }

    /// Returns the places of the actuators in the flattened body.
    #[getter]
    fn actuators(&self) -> Vec<usize> {
        self.actuators.clone()
    }

    #[getter]
    fn has_goals(&self) -> bool {
        self.course.task().has_goals()
    }

    /// Resets some environments, with goals each if the task has any; returns all observations.
    fn reset<'py>(
        &self,
        py: Python<'py>,
        mask: PyReadonlyArray1<bool>,
        goals: Vec<Vec<i64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let _environment = entered()?;
        let mut environments = self.locked(py);
        let mut goals = goals.iter();
        for (number, reset) in mask.as_array().iter().enumerate() {
            let own = goals.next().map_or(&[][..], Vec::as_slice);
            if let Some(one) = environments.one(number)
                && *reset
            {
                one.reset(own);
            }
        }
        self.observations(py, &environments)
    }

    /// Takes a step of the environments that are `active`; the others stay.
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: PyReadonlyArray2<f64>,
        active: Option<PyReadonlyArray1<bool>>,
    ) -> PyResult<Steps<'py>> {
        let _environment = entered()?;
        let expected = [self.count, self.actuators.len()];
        if actions.shape() != expected {
            let (count, actuators) = (self.count, self.actuators.len());
            let found = actions.shape();
            return Err(refused(match count {
                1 => format!("action: expected {actuators} numbers, found {}", found[1]),
                _ => format!(
                    "actions: expected {count} × {actuators} numbers, found {} × {}",
                    found[0], found[1]
                ),
            }));
        }
        // Copied, since Python may change them meanwhile.
        let actions: Vec<f64> = actions.as_array().iter().copied().collect();
        let active: Vec<bool> = match active {
            None => vec![true; self.count],
            Some(active) => active.as_array().iter().copied().collect(),
        };
        let mut observations = vec![0.0; self.count * self.observed];
        let outcomes = py.detach(|| {
            let mut environments = self
                .environments
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            environments.step(&actions, &active, &mut observations)
        });
        let outcomes = outcomes.map_err(|error| raised(&error))?;
        let rewards = outcomes.iter().map(|outcome| outcome.reward);
        let terminated = outcomes.iter().map(|outcome| outcome.terminated);
        Ok((
            self.rows(py, observations),
            PyArray1::from_iter(py, rewards),
            PyArray1::from_iter(py, terminated),
        ))
    }

    /// Simulates a control step of one environment, without reward; returns true if it is unstable.
    fn simulate(
        &self,
        py: Python,
        number: usize,
        action: Option<PyReadonlyArray1<f64>>,
    ) -> PyResult<bool> {
        let _environment = entered()?;
        let action: Option<Vec<f64>> = action.map(|action| action.as_array().to_vec());
        let mut environments = self.locked(py);
        let one = environments.one(number).ok_or_else(|| none(number))?;
        one.simulate(action.as_deref())
            .map_err(|error| raised(&error))
    }

    fn steps(&self, py: Python, number: usize) -> PyResult<u64> {
        self.of(py, number, |one| one.steps())
    }

    /// Returns the robot's points (2, points) in world units.
    fn points<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = self.of(py, number, |one| one.points().to_vec())?;
        Ok(across(py, &points))
    }

    /// Returns the velocities of the robot's points (2, points) in world units per second.
    fn velocities<'py>(
        &self,
        py: Python<'py>,
        number: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let velocities = self.of(py, number, |one| one.velocities().to_vec())?;
        Ok(across(py, &velocities))
    }

    fn orientation(&self, py: Python, number: usize) -> PyResult<f64> {
        self.of(py, number, Environment::orientation)
    }

    /// Returns the names of the ground's objects.
    #[getter]
    fn objects(&self) -> Vec<&'static str> {
        self.course
            .objects()
            .iter()
            .map(|object| object.name)
            .collect()
    }

    /// Returns the corners of an object of the ground (2, points) in world units.
    fn object_points<'py>(
        &self,
        py: Python<'py>,
        name: &str,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut objects = self.course.objects().iter();
        let object = objects.find(|object| object.name == name);
        let object = object.ok_or_else(|| refused(format!("{name}: there is no such object")))?;
        Ok(across(py, &object.points()))
    }

    /// Returns free heights below or above the centre in world units.
    fn heights<'py>(
        &self,
        py: Python<'py>,
        number: usize,
        names: Vec<String>,
        distance: u32,
        range: f64,
        above: bool,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let known = self.objects();
        if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
            let known = known.join(", ");
            return Err(refused(format!("{name}: expected objects of {known}")));
        }
        if distance > 1000 || range.is_nan() || range < 0.0 {
            let text = "sight_dist, sight_range: expected at most 1000 voxels, and a range from 0";
            return Err(refused(text));
        }
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let heights = self.of(py, number, |one| {
            one.heights(&names, distance, range, above)
        })?;
        Ok(PyArray1::from_vec(py, heights))
    }

    /// Draws one environment: (height, width, 3). `shown`: background, grid, robot, edges.
    fn picture<'py>(
        &self,
        py: Python<'py>,
        number: usize,
        place: ([f64; 2], f64),
        size: [u32; 2],
        shown: [bool; 4],
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let _environment = entered()?;
        let one = self.of(py, number, Environment::clone)?;
        let ((centre, width), [background, grid, robot, edges]) = (place, shown);
        let view = View {
            centre,
            width,
            size,
            background,
            grid,
            robot,
            edges,
        };
        let drawn = py.detach(|| picture(&one, &view));
        let pixels = drawn.map_err(|error| raised(&error.into()))?;
        let shape = (size[1] as usize, size[0] as usize, 3);
        let array = Array3::from_shape_vec(shape, pixels).expect("three numbers a pixel");
        Ok(PyArray3::from_owned_array(py, array))
    }
}

fn none(number: usize) -> PyErr {
    refused(format!("environment {number}: there is no such one"))
}

/// Returns points as numpy's (2, points).
fn across<'py>(py: Python<'py>, points: &[[f64; 2]]) -> Bound<'py, PyArray2<f64>> {
    let array = Array2::from_shape_fn((2, points.len()), |(axis, point)| points[point][axis]);
    PyArray2::from_owned_array(py, array)
}

impl TasksData {
    fn locked(&self, py: Python) -> MutexGuard<'_, Environments> {
        self.environments
            .lock_py_attached(py)
            .unwrap_or_else(PoisonError::into_inner)
    }

    fn of<T>(
        &self,
        py: Python,
        number: usize,
        look: impl FnOnce(&Environment) -> T,
    ) -> PyResult<T> {
        let _environment = FloatEnvironment::standard();
        let environments = self.locked(py);
        let one = environments.all().get(number).ok_or_else(|| none(number))?;
        Ok(look(one))
    }

    fn observations<'py>(
        &self,
        py: Python<'py>,
        environments: &Environments,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let all = environments.all().iter();
        let numbers = all.flat_map(|one| one.observation().iter().copied());
        Ok(self.rows(py, numbers.collect()))
    }

    fn rows<'py>(&self, py: Python<'py>, numbers: Vec<f64>) -> Bound<'py, PyArray2<f64>> {
        let array = Array2::from_shape_vec((self.count, self.observed), numbers);
        PyArray2::from_owned_array(py, array.expect("an observation each"))
    }
}

/// Rewards, steps and ends of episodes.
type Episodes<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<bool>>,
);

/// Simulates an episode of each body with its actions (steps, actuators); see
/// `morphcog.gym.returns`.
#[pyfunction]
#[pyo3(signature = (task, bodies, actions, goals, start, threads))]
pub(crate) fn returns<'py>(
    py: Python<'py>,
    task: &str,
    bodies: Vec<PyReadonlyArray2<u8>>,
    actions: Vec<PyReadonlyArray2<f64>>,
    goals: Vec<i64>,
    start: Start,
    threads: Option<usize>,
) -> PyResult<Episodes<'py>> {
    let _environment = entered()?;
    let course = course(task)?;
    if course.task().has_goals() && goals.is_empty() {
        return Err(refused(format!(
            "goals: expected columns, which {task} is about"
        )));
    }
    let named =
        |error: PyErr, number: usize| refused(format!("body {number}: {}", error.value(py)));
    let mut work = Vec::with_capacity(bodies.len());
    for (number, (voxels, actions)) in bodies.iter().zip(&actions).enumerate() {
        let body = body(voxels).map_err(|error| named(error, number))?;
        let actuators = robot::actuators(&body).count();
        if actions.shape()[1] != actuators {
            return Err(refused(format!(
                "actions {number}: expected a number for each of {actuators} actuators at every step, found {}",
                actions.shape()[1]
            )));
        }
        let actions: Vec<f64> = actions.as_array().iter().copied().collect();
        if actions.iter().any(|length| length.is_nan()) {
            return Err(refused(format!("actions {number}: one is no number")));
        }
        work.push((body, actions));
    }
    let pool = pool(threads).map_err(|error| raised(&error))?;
    let done = watched(py, |stop| {
        let run = |(number, (body, actions)): (usize, &(Body, Vec<f64>))| {
            let done = episode(&course, body, start, actions, &goals, stop);
            done.map_err(|error| format!("body {number}: {}", error.message))
        };
        pool.install(|| {
            work.par_iter()
                .enumerate()
                .with_max_len(1)
                .map(run)
                .collect::<Result<Vec<Episode>, _>>()
        })
    })?;
    let done = done.map_err(refused)?;
    let array = |of: fn(&Episode) -> f64| PyArray1::from_iter(py, done.iter().map(of));
    Ok((
        array(|episode| episode.reward),
        PyArray1::from_iter(py, done.iter().map(|episode| episode.steps as i64)),
        PyArray1::from_iter(py, done.iter().map(|episode| episode.terminated)),
    ))
}
