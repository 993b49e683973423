//! The Python module `morphcog._morphcog`; what users import stands in `morphcog/__init__.py`.

use exceptions::{Error as MorphcogError, Unstable};
use morphcog::base::Grid;
use morphcog::base::error::{Error, ErrorKind};
use morphcog::base::ranks::Ranks;
use morphcog::base::stop::Stopped;
use morphcog::base::threads::{MOST_THREADS, pool};
use morphcog::body::{Body, Material};
use morphcog::commands::replay;
use morphcog::config;
use morphcog::data::dataset::{Dataset, Split};
use morphcog::data::files::places;
use morphcog::search::evolve;
use morphcog::sim::{Physics, Start, System};
use morphcog::store::folder::{self, IfExists};
use morphcog::store::run::RunFile;
use morphcog::task::evaluation::fresh_rollouts;
use morphcog::task::protocol::{MAX_ROW, MAX_STEPS, Protocol, RolloutMode};
use morphcog::task::stimulus::stimulus;
use morphcog::view::html;
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Exceptions, named as Python shows them.
mod exceptions {
    use pyo3::create_exception;
    use pyo3::exceptions::PyException;

    create_exception!(morphcog, Error, PyException, "What morphcog refuses or fails with, in its own words.");
    create_exception!(morphcog, Unstable, Error, "A simulation became unstable and ended.");
}

/// Images and labels.
type Labelled<'py> = (Bound<'py, PyArray3<u8>>, Bound<'py, PyArray1<u8>>);

/// How often Ctrl-C is looked for.
const WATCH: Duration = Duration::from_millis(50);

/// Control steps of a world from one look for Ctrl-C to the next.
const STEPS: u64 = 20;

/// An error with what to do about it.
fn raised(error: &Error) -> PyErr {
    let hint = error.hint.as_ref().map_or(String::new(), |hint| format!("; {hint}"));
    let text = format!("{error}{hint}");
    match error.kind {
        ErrorKind::Unstable => Unstable::new_err(text),
        _ => MorphcogError::new_err(text),
    }
}

fn refused(text: impl Into<String>) -> PyErr {
    MorphcogError::new_err(text.into())
}

/// Does `work` on a thread of its own, without Python's lock; Ctrl-C sets its flag.
fn watched<T: Send>(py: Python, work: impl FnOnce(&AtomicBool) -> T + Send) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    let stop = &stop;
    std::thread::scope(|scope| {
        let (ended, wait) = channel::<()>();
        let worker = scope.spawn(move || {
            let found = work(stop);
            drop(ended);
            found
        });
        let mut interrupted = None;
        let wait = std::sync::Mutex::new(wait);
        while py.detach(|| {
            let wait = wait.lock().expect("only this thread waits");
            matches!(wait.recv_timeout(WATCH), Err(RecvTimeoutError::Timeout))
        }) {
            if interrupted.is_none()
                && let Err(error) = py.check_signals()
            {
                stop.store(true, Ordering::Relaxed);
                interrupted = Some(error);
            }
        }
        let found = py.detach(|| worker.join());
        match (interrupted, found) {
            (_, Err(_)) => Err(PyRuntimeError::new_err("a bug of morphcog; what it said stands above")),
            (Some(error), _) => Err(error),
            (None, Ok(found)) => Ok(found),
        }
    })
}

/// A body from an array of materials.
fn body(voxels: &PyReadonlyArray2<u8>) -> PyResult<Body> {
    let view = voxels.as_array();
    let (height, width) = view.dim();
    let mut cells = Vec::with_capacity(height * width);
    for &code in view {
        cells.push(Material::try_from(code).map_err(|error| refused(format!("body: {error}")))?);
    }
    let grid = Grid::from_fn(height, width, |row, column| cells[row * width + column]);
    let body = Body::new(grid).map_err(|error| refused(format!("body: {error}")))?;
    match body.is_connected() {
        true => Ok(body),
        false => Err(refused(
            "body: expected at least one voxel, and voxels that all hang together through their sides",
        )),
    }
}

fn array<'py>(py: Python<'py>, body: &Body) -> Bound<'py, PyArray2<u8>> {
    let (height, width) = (body.height(), body.width());
    let codes: Vec<u8> = body.voxels().cells().iter().map(|material| material.code()).collect();
    PyArray2::from_owned_array(
        py,
        numpy::ndarray::Array2::from_shape_vec((height, width), codes).expect("as many"),
    )
}

/// A stimulus from an array in [0, 1] of a body's size.
fn seen(pixels: numpy::ndarray::ArrayView2<f64>, body: &Body) -> PyResult<Grid<f64>> {
    let (height, width) = pixels.dim();
    if (height, width) != (body.height(), body.width()) {
        return Err(refused(format!(
            "stimulus: expected {} × {} pixels, as the body has places, found {height} × {width}",
            body.height(),
            body.width()
        )));
    }
    if let Some(pixel) = pixels.iter().find(|pixel| !(0.0..=1.0).contains(*pixel)) {
        return Err(refused(format!("stimulus: expected pixels from 0 to 1, found {pixel}")));
    }
    Ok(Grid::from_fn(height, width, |row, column| pixels[(row, column)]))
}

/// A config of a run.
#[pyclass(frozen, module = "morphcog")]
struct Config {
    inner: config::Config,
}

#[pymethods]
impl Config {
    /// Reads a config file, or a built-in one by its name; `set` changes keys.
    #[new]
    #[pyo3(signature = (config, set = Vec::new()))]
    fn new(config: PathBuf, set: Vec<String>) -> PyResult<Self> {
        let name = config.to_string_lossy();
        config::Config::load(&name, &set).map(|inner| Config { inner }).map_err(|error| raised(&error))
    }

    /// The config as TOML, every key with its value.
    fn to_toml(&self) -> String {
        self.inner.to_toml()
    }

    /// The config as JSON.
    fn to_json(&self) -> String {
        serde_json::to_string(&self.inner).expect("every field is a number, text, list or table")
    }
}

/// A run.json.
#[pyclass(frozen, module = "morphcog._morphcog")]
struct RunData {
    run: RunFile,
    path: PathBuf,
}

#[pymethods]
impl RunData {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        let path = folder::first_run(path).map_err(|text| raised(&Error::input(text)))?;
        let run = RunFile::read(&path).map_err(|error| raised(&error))?;
        Ok(RunData { run, path })
    }

    /// Where results of a name go if nothing is said.
    fn beside(&self, name: &str) -> PathBuf {
        folder::beside(&self.path, name)
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    #[getter]
    fn config(&self) -> Config {
        Config { inner: self.run.config.clone() }
    }

    #[getter]
    fn generations(&self) -> u64 {
        self.run.generations
    }

    /// The elites as CSV.
    fn elites_csv(&self) -> String {
        String::from_utf8_lossy(&self.run.to_csv()).into_owned()
    }

    /// Id, task, objective and body of a robot.
    fn robot<'py>(
        &self,
        py: Python<'py>,
        robot: String,
    ) -> PyResult<(String, String, f64, Bound<'py, PyArray2<u8>>)> {
        let options =
            replay::Options { robot, archive: Some(self.path.clone()), ..replay::Options::default() };
        let found = replay::find(&options).map_err(|error| raised(&error))?;
        let known = self.run.elites.iter().find(|elite| elite.id == found.name);
        let elite = known
            .ok_or_else(|| refused(format!("{}: the run has changed; load it anew", self.path.display())))?;
        Ok((elite.id.clone(), elite.task.clone(), elite.objective, array(py, &elite.body)))
    }

    /// A page on which the robot walks under its training images.
    fn player(&self, py: Python, robot: String) -> PyResult<String> {
        let options =
            replay::Options { robot, archive: Some(self.path.clone()), ..replay::Options::default() };
        let page = watched(py, |_| -> Result<String, Error> {
            let replay = replay::replay(&options)?;
            let title = format!("morphcog: robot {}", replay.name);
            Ok(html::page(&replay.recording, &title, &replay.about)?)
        })?;
        page.map_err(|error| raised(&error))
    }
}

fn setting(config: Option<&Config>) -> (Physics, Protocol) {
    match config {
        Some(config) => (config.inner.physics.clone(), config.inner.protocol.clone()),
        None => (Physics::default(), Protocol::default()),
    }
}

/// Evolves; see `morphcog.evolve`.
#[pyfunction]
#[pyo3(signature = (config, set, out, resume, force, data, threads))]
#[allow(clippy::too_many_arguments)] // Python's keywords
fn evolve_run(
    py: Python,
    config: PathBuf,
    set: Vec<String>,
    out: Option<PathBuf>,
    resume: bool,
    force: bool,
    data: Option<PathBuf>,
    threads: Option<usize>,
) -> PyResult<PathBuf> {
    let source = config.to_string_lossy().into_owned();
    let config = config::Config::load(&source, &set).map_err(|error| raised(&error))?;
    let name = folder::name_of(&source);
    let out = out.unwrap_or_else(|| PathBuf::from("runs").join(format!("{name}-seed{}", config.seed)));
    let if_exists = match (resume, force) {
        (true, _) => IfExists::Resume,
        (_, true) => IfExists::Overwrite,
        _ => IfExists::Refuse,
    };
    let ranks = Ranks::ALONE;
    let options = evolve::Options { config, name, out: out.clone(), if_exists, data, threads, ranks };
    let finished = watched(py, |stop| evolve::evolve(&options, stop, &()))?;
    let finished = finished.map_err(|error| match error.hint.as_deref() {
        Some(hint) if hint.contains("--") => raised(&Error { hint: Some(as_keywords(hint)), ..error }),
        _ => raised(&error),
    })?;
    match finished.unwritten {
        Some(error) => Err(raised(&error)),
        None => Ok(out),
    }
}

/// Options in a hint as this module calls them.
fn as_keywords(hint: &str) -> String {
    [("--force", "force=True"), ("--resume", "resume=True"), ("--out", "out="), ("--data", "data=")]
        .into_iter()
        .fold(hint.to_string(), |hint, (option, keyword)| hint.replace(option, keyword))
}

/// Images as sensors see them; see `morphcog.stimuli`.
#[pyfunction]
fn stimuli<'py>(
    py: Python<'py>,
    images: PyReadonlyArray3<u8>,
    config: &Config,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let config::BodyConfig { height, width, .. } = config.inner.body;
    let view = images.as_array();
    let (count, tall, wide) = view.dim();
    let mut all = Vec::with_capacity(count * height * width);
    for image in view.outer_iter() {
        let image = Grid::from_fn(tall, wide, |row, column| image[(row, column)]);
        let seen = stimulus(&image, height, width, &config.inner.stimulus)
            .map_err(|error| refused(format!("{}: {error}", error.key())))?;
        all.extend_from_slice(seen.cells());
    }
    let array = numpy::ndarray::Array3::from_shape_vec((count, height, width), all).expect("as many as said");
    Ok(PyArray3::from_owned_array(py, array))
}

/// Images and labels of a dataset; see `morphcog.images`.
#[pyfunction]
fn images<'py>(
    py: Python<'py>,
    dataset: &str,
    split: &str,
    data: Option<PathBuf>,
) -> PyResult<Labelled<'py>> {
    let split = match split {
        "train" => Split::Train,
        "test" => Split::Test,
        other => return Err(refused(format!("split={other:?}: expected \"train\" or \"test\""))),
    };
    let places = places(data.as_deref(), std::env::var_os("MORPHCOG_DATA"), None);
    let loaded = Dataset::load(dataset, &places, &[split]).map_err(|error| refused(error.to_string()))?;
    let (mut pixels, mut labels, mut size) = (Vec::new(), Vec::new(), (0, 0));
    for index in 0..loaded.len(split) {
        let image = loaded.image(split, index).map_err(|error| refused(error.to_string()))?;
        size = (image.height(), image.width());
        pixels.extend_from_slice(image.cells());
        labels.push(loaded.label(split, index).map_err(|error| refused(error.to_string()))?);
    }
    let pixels = numpy::ndarray::Array3::from_shape_vec((labels.len(), size.0, size.1), pixels);
    Ok((PyArray3::from_owned_array(py, pixels.expect("images of one size")), PyArray1::from_vec(py, labels)))
}

/// Displacements; see `morphcog.displacements`.
#[pyfunction]
#[pyo3(signature = (bodies, stimuli, control_steps, config, threads))]
fn displacements<'py>(
    py: Python<'py>,
    bodies: Vec<PyReadonlyArray2<u8>>,
    stimuli: PyReadonlyArray3<f64>,
    control_steps: Option<u32>,
    config: Option<&Config>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let bodies = bodies.iter().map(body).collect::<PyResult<Vec<Body>>>()?;
    let (physics, protocol) = setting(config);
    let control_steps = control_steps.unwrap_or(protocol.control_steps);
    let protocol = Protocol { rollout: RolloutMode::Fresh, control_steps, ..protocol };
    let view = stimuli.as_array();
    let seen_by = |number: usize, place: usize| {
        let pixels = view.index_axis(numpy::ndarray::Axis(0), number);
        seen(pixels, &bodies[place])
            .map_err(|error| refused(format!("image {number}, body {place}: {}", error.value(py))))
    };
    let (count, shown) = (bodies.len(), stimuli.shape()[0]);
    // All bodies must be of one size: what the first one sees is what all see.
    let size = |body: &Body| (body.height(), body.width());
    if let Some(place) = bodies.iter().position(|body| size(body) != size(&bodies[0]))
        && shown > 0
    {
        seen_by(0, 0)?;
        seen_by(0, place)?;
    }
    let shown_to_any = if bodies.is_empty() { 0 } else { shown };
    let images = (0..shown_to_any).map(|number| seen_by(number, 0)).collect::<PyResult<Vec<Grid<f64>>>>()?;
    let pool = pool(threads).map_err(|error| raised(&error))?;
    let walked = watched(py, |stop| {
        let walk = |body: &Body| -> Result<Vec<f64>, Stopped> {
            let (found, _) = fresh_rollouts(body, &images, &[], (&physics, &protocol), &|_| (), stop)?;
            Ok(found.into_iter().map(|walk| walk.unwrap_or(f64::NAN)).collect())
        };
        pool.install(|| bodies.par_iter().with_max_len(1).map(walk).collect::<Result<Vec<_>, Stopped>>())
    })?;
    let all: Vec<f64> =
        walked.expect("only Ctrl-C stops it, which is raised above").into_iter().flatten().collect();
    let array = numpy::ndarray::Array2::from_shape_vec((count, shown), all).expect("as many as said");
    Ok(PyArray2::from_owned_array(py, array))
}

/// One simulation; see `morphcog.World`.
#[pyclass(module = "morphcog._morphcog")]
struct WorldData {
    world: morphcog::sim::World,
    body: Body,
    unstable: Option<String>,
}

#[pymethods]
impl WorldData {
    #[new]
    #[pyo3(signature = (voxels, start_row, config))]
    fn new(voxels: PyReadonlyArray2<u8>, start_row: Option<u32>, config: Option<&Config>) -> PyResult<Self> {
        let body = body(&voxels)?;
        let (physics, protocol) = setting(config);
        let (lowest, row) = (physics.ground_row, start_row.unwrap_or(protocol.start_row));
        if !(lowest..=MAX_ROW).contains(&row) {
            return Err(refused(format!("start_row={row}: expected {lowest} (on the ground) to {MAX_ROW}")));
        }
        let start = Start { column: protocol.start_column, row };
        let world = morphcog::sim::World::new(System::new(&body, physics), start);
        Ok(WorldData { world, body, unstable: None })
    }

    fn set_stimulus(&mut self, pixels: PyReadonlyArray2<f64>) -> PyResult<()> {
        self.world.set_stimulus(&seen(pixels.as_array(), &self.body)?);
        Ok(())
    }

    fn step(&mut self, py: Python, count: u64) -> PyResult<()> {
        if let Some(text) = &self.unstable {
            return Err(Unstable::new_err(format!("{text}; begin anew with reset()")));
        }
        // A part at a time, so that Ctrl-C is seen; a control step takes milliseconds at most.
        let mut left = count;
        while left > 0 {
            let steps = left.min(STEPS);
            let world = &mut self.world;
            let stepped = py.detach(|| (0..steps).try_for_each(|_| world.step()));
            if let Err(unstable) = stepped {
                self.unstable = Some(unstable.to_string());
                return Err(Unstable::new_err(unstable.to_string()));
            }
            py.check_signals()?;
            left -= steps;
        }
        Ok(())
    }

    fn reset(&mut self) {
        self.world.reset();
        self.unstable = None;
    }

    #[getter]
    fn control_step(&self) -> u64 {
        self.world.control_step()
    }

    /// Centre of mass, voxel lengths.
    #[getter]
    fn centre(&self) -> [f64; 2] {
        self.lengths(self.world.centre_of_mass())
    }

    /// Points, voxel lengths.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let places: Vec<f64> = self.world.points().flat_map(|place| self.lengths(place)).collect();
        let array = numpy::ndarray::Array2::from_shape_vec((places.len() / 2, 2), places);
        PyArray2::from_owned_array(py, array.expect("two coordinates a point"))
    }

    /// Corners of every voxel as indices into the points, clockwise from the top left.
    #[getter]
    fn voxels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<usize>> {
        let corners: Vec<usize> = self.world.voxels().flat_map(|(_, corners)| corners).collect();
        let array = numpy::ndarray::Array2::from_shape_vec((corners.len() / 4, 4), corners);
        PyArray2::from_owned_array(py, array.expect("four corners a voxel"))
    }
}

impl WorldData {
    /// A place in voxel lengths, y from the ground.
    fn lengths(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let physics = self.world.system().physics();
        [x / physics.cell_size, y / physics.cell_size - f64::from(physics.ground_row)]
    }
}

/// Runs the command line with these arguments, the program's name first; its exit code. `program` is
/// how a shell calls it.
#[pyfunction]
fn command(py: Python, arguments: Vec<std::ffi::OsString>, program: String) -> u8 {
    morphcog::cli::called(program);
    py.detach(|| morphcog::cli::main(arguments))
}

#[pymodule]
fn _morphcog(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("MOST_THREADS", MOST_THREADS)?;
    module.add("MAX_STEPS", MAX_STEPS)?;
    module.add("MAX_ROW", MAX_ROW)?;
    module.add("Error", py.get_type::<MorphcogError>())?;
    module.add("Unstable", py.get_type::<Unstable>())?;
    module.add_class::<Config>()?;
    module.add_class::<RunData>()?;
    module.add_class::<WorldData>()?;
    module.add_function(wrap_pyfunction!(evolve_run, module)?)?;
    module.add_function(wrap_pyfunction!(images, module)?)?;
    module.add_function(wrap_pyfunction!(stimuli, module)?)?;
    module.add_function(wrap_pyfunction!(displacements, module)?)?;
    module.add_function(wrap_pyfunction!(command, module)?)?;
    Ok(())
}
