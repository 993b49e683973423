//! The Python module `morphcog._morphcog`; `morphcog/__init__.py` has what users import.

mod remedies;

use exceptions::{Error as MorphcogError, Unstable};
use morphcog::base::Grid;
use morphcog::base::error::{Error, ErrorKind};
use morphcog::base::hash::sha256_hex;
use morphcog::base::observer::{Generation, Observer, Work};
use morphcog::base::session::Session;
use morphcog::base::stop::Stopped;
use morphcog::base::threads::{MOST_THREADS, pool};
use morphcog::body::{Body, Material};
use morphcog::cli::output::progress::{ProgressWords, Recent, count_line, generation_line};
use morphcog::commands::data::{self, ImportOptions, ImportSource};
use morphcog::commands::evolve;
use morphcog::commands::{audit, eval, replay};
use morphcog::config;
use morphcog::config::audit::Criteria;
use morphcog::data::dataset::{Dataset, DatasetError, Split};
use morphcog::data::files::places;
use morphcog::data::import::arrays::{Array, LabelledArrays, Values};
use morphcog::data::import::{ClassLabel, Fit, InMemory};
use morphcog::draw::walk::Walk;
use morphcog::draw::{gif, html};
use morphcog::robots::selection::Selection;
use morphcog::search::held_out_run;
use morphcog::search::one_by_one;
use morphcog::shipped;
use morphcog::sim::{FloatEnvironment, InstructionSet, Physics, Start, System};
use morphcog::store::folder::{self, IfExists};
use morphcog::store::images::HeldOut;
use morphcog::store::names::AUDIT_JSON;
use morphcog::store::run::RunFile;
use morphcog::task::answer;
use morphcog::task::evaluation::fresh_rollouts;
use morphcog::task::protocol::{MAX_ROW, MAX_STEPS, Protocol, RolloutMode};
use morphcog::task::stimulus::stimulus;
use numpy::{
    PyArray1, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyBytes;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Exceptions, named as Python shows them.
mod exceptions {
    use pyo3::create_exception;
    use pyo3::exceptions::PyException;

    create_exception!(
        morphcog,
        Error,
        PyException,
        "What morphcog refuses or fails with, in its own words."
    );
    create_exception!(
        morphcog,
        Unstable,
        Error,
        "A simulation became unstable and ended."
    );
}

/// Width of a robot's picture in a notebook \[pixels\].
const WIDTH: u32 = 480;

/// Images and labels.
type Labelled<'py> = (Bound<'py, PyArray3<u8>>, Bound<'py, PyArray1<u8>>);

/// Interval between checks for Ctrl-C.
const WATCH: Duration = Duration::from_millis(50);

/// Control steps of a world between checks for Ctrl-C.
const STEPS: u64 = 20;

/// Converts an error and its remedies to a Python exception.
fn raised(error: &Error) -> PyErr {
    let text = remedies::explained(error);
    match error.kind {
        ErrorKind::Unstable => Unstable::new_err(text),
        _ => MorphcogError::new_err(text),
    }
}

fn refused(text: impl Into<String>) -> PyErr {
    MorphcogError::new_err(text.into())
}

/// Refuses a `MORPHCOG_ISA` that this machine cannot follow. While the value lives, rounding is
/// standard, whatever the host has chosen.
fn entered() -> PyResult<FloatEnvironment> {
    InstructionSet::asked().map_err(refused)?;
    Ok(FloatEnvironment::standard())
}

fn no_memory(what: &str) -> PyErr {
    PyMemoryError::new_err(format!("there is no memory for {what}"))
}

/// Returns an empty list with room for so many numbers.
fn room<T>(count: Option<usize>, what: &str) -> PyResult<Vec<T>> {
    let mut list = Vec::new();
    count
        .and_then(|count| list.try_reserve_exact(count).ok())
        .ok_or_else(|| no_memory(what))?;
    Ok(list)
}

/// Fails if Ctrl-C ends this work: in the main thread as Python says, in others if it is ending the
/// main thread, which would wait for them.
fn check_interrupt(py: Python) -> PyResult<()> {
    py.check_signals()?;
    match py
        .import("morphcog")?
        .getattr("_main_is_interrupted")?
        .call0()?
        .is_truthy()?
    {
        true => Err(PyKeyboardInterrupt::new_err(())),
        false => Ok(()),
    }
}

/// Runs `work` on its own thread, without Python's lock; Ctrl-C sets its flag.
fn watched<T: Send>(py: Python, work: impl FnOnce(&AtomicBool) -> T + Send) -> PyResult<T> {
    watched_and(py, |_| Ok(()), work)
}

/// Like [`watched`], but calls `look` repeatedly on this thread; its errors end the work, too.
fn watched_and<T: Send>(
    py: Python,
    mut look: impl FnMut(Python) -> PyResult<()>,
    work: impl FnOnce(&AtomicBool) -> T + Send,
) -> PyResult<T> {
    check_interrupt(py)?;
    let stop = AtomicBool::new(false);
    let stop = &stop;
    std::thread::scope(|scope| {
        let (ended, wait) = channel::<()>();
        let worker = std::thread::Builder::new().spawn_scoped(scope, move || {
            let found = work(stop);
            drop(ended);
            found
        });
        let worker = worker.map_err(|error| refused(format!("no threads: {error}")))?;
        let mut interrupted = None;
        let wait = Mutex::new(wait);
        while py.detach(|| {
            let wait = wait.lock().expect("only this thread waits");
            matches!(wait.recv_timeout(WATCH), Err(RecvTimeoutError::Timeout))
        }) {
            if interrupted.is_none()
                && let Err(error) = check_interrupt(py).and_then(|()| look(py))
            {
                stop.store(true, Ordering::Relaxed);
                interrupted = Some(error);
            }
        }
        let found = py.detach(|| worker.join());
        if interrupted.is_none() {
            interrupted = look(py).err();
        }
        match (interrupted, found) {
            (_, Err(_)) => Err(PyRuntimeError::new_err(
                "a bug of morphcog; what it said stands above",
            )),
            (Some(error), _) => Err(error),
            (None, Ok(found)) => Ok(found),
        }
    })
}

/// Collects the messages of a command, for the calling thread to pass on.
struct Heard {
    began: Instant,
    said: Mutex<Said>,
}

#[derive(Default)]
struct Said {
    /// Messages not passed on yet, each with its kind.
    lines: Vec<(&'static str, String)>,
    work: Option<(Work, Recent<u64>)>,
    evolution: Option<Recent<Generation>>,
}

impl Said {
    /// Replaces the last line if it was of progress, else adds one.
    fn moved(&mut self, ProgressWords { label, parts }: ProgressWords) {
        let line = format!("{label} {}", parts.join(" · "));
        match self.lines.last_mut() {
            Some((PROGRESS, last)) => *last = line,
            _ => self.lines.push((PROGRESS, line)),
        }
    }
}

/// Kinds of messages, as in `morphcog/__init__.py`.
const PROGRESS: &str = "progress";
const NOTE: &str = "note";
const WARNING: &str = "warning";

impl Heard {
    fn new() -> Self {
        Heard {
            began: Instant::now(),
            said: Mutex::default(),
        }
    }

    fn said(&self) -> MutexGuard<'_, Said> {
        self.said.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// Passes the messages to a Python function.
    fn pass_on(&self, listener: &Bound<PyAny>) -> PyResult<()> {
        let lines = std::mem::take(&mut self.said().lines);
        lines
            .into_iter()
            .try_for_each(|(kind, text)| listener.call1((kind, text)).map(drop))
    }
}

impl Observer for Heard {
    fn note(&self, text: &str) {
        self.said().lines.push((NOTE, text.to_string()));
    }

    fn begins(&self, work: &Work) {
        let recent = Recent::new(self.seconds(), work.known);
        self.said().work = Some((work.clone(), recent));
    }

    fn progress(&self, done: u64) {
        let mut said = self.said();
        let Some((work, recent)) = &mut said.work else {
            return;
        };
        let (seconds, before) = recent.since(self.seconds(), done, |done| *done);
        let line = count_line(&work.label, [before, done, work.total], work.unit, seconds);
        said.moved(line);
    }

    fn generation(&self, now: &Generation) {
        let mut said = self.said();
        let recent = said
            .evolution
            .get_or_insert(Recent::new(self.seconds(), *now));
        let (seconds, before) = recent.since(self.seconds(), *now, |now| now.done);
        let line = generation_line(now, &before, seconds);
        said.moved(line);
    }

    fn warning(&self, text: &str) {
        self.said().lines.push((WARNING, text.to_string()));
    }
}

/// Parses a value that Python gives as text.
fn parsed<T: FromStr<Err: std::fmt::Display>>(keyword: &str, text: &str) -> PyResult<T> {
    text.parse()
        .map_err(|error| refused(format!("{keyword}={text}: {error}")))
}

/// Makes a body from an array of materials.
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
    let codes: Vec<u8> = body
        .voxels()
        .cells()
        .iter()
        .map(|material| material.code())
        .collect();
    PyArray2::from_owned_array(
        py,
        numpy::ndarray::Array2::from_shape_vec((height, width), codes).expect("as many"),
    )
}

/// Makes a stimulus from an array in [0, 1] of a body's size.
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
        return Err(refused(format!(
            "stimulus: expected pixels from 0 to 1, found {pixel}"
        )));
    }
    Ok(Grid::from_fn(height, width, |row, column| {
        pixels[(row, column)]
    }))
}

/// A config, and the name of its runs; see `morphcog.Config`.
#[pyclass(frozen, module = "morphcog._morphcog")]
struct ConfigData {
    inner: config::Config,
    name: String,
}

#[pymethods]
impl ConfigData {
    /// Reads a config file, or a built-in one by its name; `set` changes keys.
    #[new]
    fn new(config: PathBuf, set: Vec<String>) -> PyResult<Self> {
        let _environment = entered()?;
        let source = config.to_string_lossy();
        let inner = config::Config::load(&source, &set).map_err(|error| raised(&error))?;
        Ok(ConfigData {
            inner,
            name: folder::name_of(&source),
        })
    }

    /// Parses a config from the text of `to_toml`.
    #[staticmethod]
    fn parsed(toml: &str, name: String, set: Vec<String>) -> PyResult<Self> {
        let _environment = entered()?;
        let inner = config::Config::parse(toml, &name, &set).map_err(|error| raised(&error))?;
        Ok(ConfigData { inner, name })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    fn to_toml(&self) -> String {
        self.inner.to_toml()
    }

    fn to_json(&self) -> String {
        serde_json::to_string(&self.inner).expect("every field is a number, text, list or table")
    }

    /// Describes the config in a few words.
    fn about(&self) -> String {
        let config::Config {
            seed,
            generations,
            body,
            data,
            ..
        } = &self.inner;
        let tasks = self
            .inner
            .grouping()
            .expect("a config's groups are checked when it is read");
        let tasks: Vec<String> = tasks.tasks().iter().map(|task| task.name()).collect();
        let task = match &tasks[..] {
            [one] => one.clone(),
            [first, ..] => format!("{first} and {} more", tasks.len() - 1),
            [] => "none".to_string(),
        };
        let (size, data) = (format!("{}×{}", body.height, body.width), &data.dataset);
        format!("task={task}, data={data}, body={size}, generations={generations}, seed={seed}")
    }
}

/// A run.json.
#[pyclass(frozen, module = "morphcog._morphcog")]
struct RunData {
    run: RunFile,
    /// The path as given.
    path: PathBuf,
    /// The absolute path, or a name: the present folder may change.
    place: PathBuf,
}

#[pymethods]
impl RunData {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        let _environment = entered()?;
        let of_name = path.display().to_string();
        let paths = folder::run_json(path).map_err(|text| raised(&Error::input(text)))?;
        let [path] = &paths[..] else {
            let names: Vec<String> = paths.iter().map(|path| folder::name(path)).collect();
            let text = format!("{of_name}: expected one run, these are {}", names.len());
            return Err(refused(format!("{text}: {}", names.join(", "))));
        };
        let run = RunFile::read(path).map_err(|error| raised(&error))?;
        let place = match shipped::is_named(path) {
            true => path.clone(),
            false => std::path::absolute(path)?,
        };
        Ok(RunData {
            run,
            path: path.clone(),
            place,
        })
    }

    #[getter]
    fn place(&self) -> PathBuf {
        self.place.clone()
    }

    /// Returns a hash of all settings that its robots depend on.
    fn settings(&self) -> String {
        sha256_hex(format!("{:?}", self.run.config.settings()).as_bytes())
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    #[getter]
    fn config(&self) -> ConfigData {
        ConfigData {
            inner: self.run.config.clone(),
            name: self.run.name.clone(),
        }
    }

    #[getter]
    fn generations(&self) -> u64 {
        self.run.generations
    }

    /// Returns the elites as CSV.
    fn elites_csv(&self) -> String {
        String::from_utf8_lossy(&self.run.to_csv()).into_owned()
    }

    /// Returns id, task, objective and body of a robot.
    fn robot<'py>(
        &self,
        py: Python<'py>,
        robot: String,
    ) -> PyResult<(String, String, f64, Bound<'py, PyArray2<u8>>)> {
        let _environment = entered()?;
        let options = replay::ReplayOptions {
            robot,
            archive: Some(self.place.clone()),
            ..replay::ReplayOptions::default()
        };
        let found = replay::find(&options).map_err(|error| raised(&error))?;
        let known = self.run.elites.iter().find(|elite| elite.id == found.name);
        let elite = known.ok_or_else(|| {
            refused(format!(
                "{}: the run has changed; load it anew",
                self.path.display()
            ))
        })?;
        Ok((
            elite.id.clone(),
            elite.task.clone(),
            elite.objective,
            array(py, &elite.body),
        ))
    }

    /// Returns a page on which the robot walks under its training images.
    fn page(&self, py: Python, robot: String) -> PyResult<String> {
        let _environment = entered()?;
        self.shown(py, robot, |replay, title| {
            Ok(html::page(&replay.recording, title, &replay.about)?)
        })
    }

    /// Returns a small page, and a GIF of the last moment.
    fn small_page<'py>(
        &self,
        py: Python<'py>,
        robot: String,
    ) -> PyResult<(String, Bound<'py, PyBytes>)> {
        let _environment = entered()?;
        let (page, still) = self.shown(py, robot, |replay, title| {
            let walk = Walk::new(&replay.recording)?;
            let still = gif::still(&walk, walk.frames() - 1, WIDTH)?;
            Ok((
                html::small_page(&replay.recording, title, &replay.about)?,
                still,
            ))
        })?;
        Ok((page, PyBytes::new(py, &still)))
    }

    /// Tests robots as `morphcog eval` does, and returns the path of the table.
    #[allow(clippy::too_many_arguments)] // Python's keywords
    fn evaluate(
        &self,
        py: Python,
        robots: &str,
        images: Option<&str>,
        split: &str,
        data: Option<PathBuf>,
        listener: &Bound<PyAny>,
    ) -> PyResult<PathBuf> {
        let _environment = entered()?;
        let split: HeldOut = parsed("split", split)?;
        let options = eval::EvalOptions {
            archives: vec![self.place.clone()],
            robots: parsed("robots", robots)?,
            images: images.map(|images| parsed("images", images)).transpose()?,
            split,
            validation: None,
            seed: 1,
            threshold: answer::THRESHOLD,
            cycles: held_out_run::CYCLES,
            dataset: None,
            out: folder::beside(&self.place, eval::own_name(split)),
        };
        let unwritten = heard(py, listener, (None, data), |session| {
            eval::eval(&options, session).map(|finished| finished.unwritten)
        })?;
        written(unwritten, &options.out)
    }

    /// Audits robots as `morphcog audit` does, and returns the path of the table.
    fn audit(
        &self,
        py: Python,
        robots: &str,
        data: Option<PathBuf>,
        listener: &Bound<PyAny>,
    ) -> PyResult<PathBuf> {
        let _environment = entered()?;
        let robots: Selection = parsed("robots", robots)?;
        let out = folder::beside(&self.place, AUDIT_JSON);
        let unwritten = heard(py, listener, (None, data), |session| {
            let robots = match robots.validated() {
                None => robots,
                Some(_) => {
                    let search = one_by_one::RobotChoice {
                        robots,
                        archives: vec![self.place.clone()],
                        physical_only: false,
                        seed: 1,
                    };
                    let found = one_by_one::named(&search, session)?;
                    Selection::Ids(found.into_iter().map(|named| named.robot).collect())
                }
            };
            let options = audit::AuditOptions {
                archive: self.place.clone(),
                robots,
                seed: 1,
                criteria: Criteria::default(),
                fresh: false,
                out: out.clone(),
            };
            audit::audit(&options, session).map(|finished| finished.unwritten)
        })?;
        written(unwritten, &out)
    }
}

impl RunData {
    /// Records a robot, and passes the recording and its title to `make`.
    fn shown<T: Send>(
        &self,
        py: Python,
        robot: String,
        make: impl Fn(&replay::Replay, &str) -> Result<T, Error> + Sync,
    ) -> PyResult<T> {
        let options = replay::ReplayOptions {
            robot,
            archive: Some(self.place.clone()),
            ..replay::ReplayOptions::default()
        };
        let pool = pool(None).map_err(|error| raised(&error))?;
        let made = watched(py, |_| {
            pool.install(|| {
                let replay = replay::replay(&options)?;
                make(&replay, &format!("morphcog: robot {}", replay.name))
            })
        })?;
        made.map_err(|error| raised(&error))
    }
}

/// Runs a command, and passes its messages to a Python function.
fn heard<T: Send>(
    py: Python,
    listener: &Bound<PyAny>,
    (threads, data): (Option<usize>, Option<PathBuf>),
    work: impl FnOnce(&Session) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let heard = Heard::new();
    let found = watched_and(
        py,
        |_| heard.pass_on(listener),
        |stop| work(&Session::new(stop, &heard).threads(threads).data(data)),
    )?;
    found.map_err(|error| raised(&error))
}

/// Returns the path of the table beside results, or the error of writing them.
fn written(unwritten: Option<Error>, out: &Path) -> PyResult<PathBuf> {
    match unwritten {
        Some(error) => Err(raised(&error)),
        None => Ok(out.with_extension("csv")),
    }
}

fn setting(config: Option<&ConfigData>) -> (Physics, Protocol) {
    match config {
        Some(config) => (config.inner.physics.clone(), config.inner.protocol.clone()),
        None => (Physics::default(), Protocol::default()),
    }
}

/// Evolves, and returns the run's folder; see `morphcog.evolve`.
#[pyfunction]
#[pyo3(signature = (config, out, resume, force, data, threads, listener))]
#[allow(clippy::too_many_arguments)] // Python's keywords
fn evolve_run(
    py: Python,
    config: &ConfigData,
    out: Option<PathBuf>,
    resume: bool,
    force: bool,
    data: Option<PathBuf>,
    threads: Option<usize>,
    listener: &Bound<PyAny>,
) -> PyResult<PathBuf> {
    let _environment = entered()?;
    let (config, name) = (config.inner.clone(), config.name.clone());
    let out =
        out.unwrap_or_else(|| Path::new(folder::RUNS).join(format!("{name}-seed{}", config.seed)));
    let if_exists = match (resume, force) {
        (true, _) => IfExists::Resume,
        (_, true) => IfExists::Overwrite,
        _ => IfExists::Refuse,
    };
    let options = evolve::EvolveOptions {
        config,
        name,
        out: out.clone(),
        if_exists,
    };
    let unwritten = heard(py, listener, (threads, data), |session| {
        evolve::evolve(&options, session).map(|finished| finished.unwritten)
    })?;
    match unwritten {
        Some(error) => Err(raised(&error)),
        None => Ok(out),
    }
}

/// Numbers or texts of any shape.
#[derive(FromPyObject)]
enum Given<'py> {
    Bools(PyReadonlyArrayDyn<'py, bool>),
    Bytes(PyReadonlyArrayDyn<'py, u8>),
    Whole(PyReadonlyArrayDyn<'py, i64>),
    Real(PyReadonlyArrayDyn<'py, f64>),
    Texts(Vec<String>),
}

impl Given<'_> {
    fn array(&self, name: &str) -> Array {
        let (shape, values) = match self {
            Given::Bools(array) => {
                let values = array
                    .as_array()
                    .iter()
                    .map(|value| u8::from(*value))
                    .collect();
                (array.shape().to_vec(), Values::Bools(values))
            }
            Given::Bytes(array) => {
                let values = array.as_array().iter().copied().collect();
                (array.shape().to_vec(), Values::Bytes(values))
            }
            Given::Whole(array) => {
                let values = array.as_array().iter().copied().collect();
                (array.shape().to_vec(), Values::Whole(values))
            }
            Given::Real(array) => {
                let values = array.as_array().iter().copied().collect();
                (array.shape().to_vec(), Values::Real(values))
            }
            Given::Texts(texts) => (vec![texts.len()], Values::Texts(texts.clone())),
        };
        Array {
            name: name.to_string(),
            shape,
            values,
        }
    }

    /// Returns each value as a class; fractions are none.
    fn classes(&self) -> PyResult<Vec<ClassLabel>> {
        let array = self.array("labels");
        let whole = |value: &f64| match value.fract() == 0.0 {
            true => Ok(ClassLabel::Number(*value as i64)),
            false => Err(refused(format!(
                "labels: expected whole numbers or texts, found {value}"
            ))),
        };
        let byte = |value: &u8| ClassLabel::Number((*value).into());
        match &array.values {
            Values::Bools(all) | Values::Bytes(all) => Ok(all.iter().map(byte).collect()),
            Values::Whole(all) => Ok(all.iter().copied().map(ClassLabel::Number).collect()),
            Values::Real(all) => all.iter().map(whole).collect(),
            Values::Texts(all) => Ok(all.iter().cloned().map(ClassLabel::Name).collect()),
        }
    }
}

/// Images of a dataset to be, and their labels.
#[derive(FromPyObject)]
enum GivenImages<'py> {
    Array(Given<'py>),
    /// Grey pictures of any size.
    Pictures(Vec<PyReadonlyArray2<'py, u8>>),
}

/// Images with labels of one split; the first is for training if there is a second.
type GivenSplit<'py> = (GivenImages<'py>, Given<'py>);

fn import_source(paths: Vec<PathBuf>, splits: &[GivenSplit]) -> PyResult<ImportSource> {
    let mut arrays = Vec::new();
    let mut pictures = Vec::new();
    for ((images, labels), (split, prefix)) in splits
        .iter()
        .zip([(Split::Train, ""), (Split::Test, "test_")])
    {
        let split = (splits.len() > 1).then_some(split);
        match images {
            GivenImages::Array(images) => arrays.push(LabelledArrays {
                images: images.array(&format!("{prefix}pixels")),
                labels: labels.array(&format!("{prefix}labels")),
                split,
            }),
            GivenImages::Pictures(images) => {
                let classes = labels.classes()?;
                if classes.len() != images.len() {
                    return Err(refused(format!(
                        "{prefix}labels: has {} labels, expected {}, one for each picture",
                        classes.len(),
                        images.len()
                    )));
                }
                pictures.extend(images.iter().zip(classes).map(|(image, class)| {
                    let view = image.as_array();
                    let (height, width) = view.dim();
                    let pixels = Grid::from_fn(height, width, |row, column| view[(row, column)]);
                    InMemory {
                        pixels,
                        class,
                        split,
                    }
                }));
            }
        }
    }
    match (arrays.is_empty(), pictures.is_empty()) {
        (true, true) => Ok(ImportSource::Paths(paths)),
        (false, true) => Ok(ImportSource::Arrays(arrays)),
        (true, false) => Ok(ImportSource::Pictures(pictures)),
        (false, false) => Err(refused(
            "test_pixels: expected an array or a list of pictures, as pixels",
        )),
    }
}

/// Makes a dataset, and returns what was made as JSON; see `morphcog.import_dataset`.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // Python's keywords
fn import_dataset(
    py: Python,
    paths: Vec<PathBuf>,
    splits: Vec<GivenSplit>,
    name: String,
    to: Option<PathBuf>,
    test: f64,
    seed: u64,
    size: usize,
    fit: &str,
    choices: [Option<bool>; 2],
    force: bool,
    listener: &Bound<PyAny>,
) -> PyResult<(PathBuf, String)> {
    let _environment = entered()?;
    let source = import_source(paths, &splits)?;
    let fit = match fit {
        "auto" => Fit::Auto,
        "whole" => Fit::Whole,
        "content" => Fit::Content,
        "keep" => Fit::Keep,
        other => {
            return Err(refused(format!(
                "fit={other:?}: expected \"auto\", \"whole\", \"content\" or \"keep\""
            )));
        }
    };
    let [invert, transpose] = choices;
    let options = ImportOptions {
        name,
        to,
        test,
        seed,
        size,
        fit,
        invert,
        transpose,
        force,
    };
    let made = heard(py, listener, (None, None), |session| {
        data::import(source, &options, session)
    })?;
    let json = serde_json::to_string(&made).expect("names and numbers are JSON");
    Ok((made.folder, json))
}

/// Returns images as sensors see them; see `morphcog.stimuli`.
#[pyfunction]
fn stimuli<'py>(
    py: Python<'py>,
    images: PyReadonlyArray3<u8>,
    config: &ConfigData,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let _environment = entered()?;
    let config::BodyConfig { height, width, .. } = config.inner.body;
    let view = images.as_array();
    let (count, tall, wide) = view.dim();
    let seen = |number: usize| {
        let image = view.index_axis(numpy::ndarray::Axis(0), number);
        let image = Grid::from_fn(tall, wide, |row, column| image[(row, column)]);
        stimulus(&image, height, width, &config.inner.stimulus)
            .map_err(|error| refused(format!("{}: {error}", error.key())))
    };
    let all = watched(py, |stop| -> PyResult<Vec<f64>> {
        // Images that cannot be seen must be refused before memory is taken for all.
        if count > 0 {
            seen(0)?;
        }
        let mut all = room(count.checked_mul(height * width), "the stimuli")?;
        for number in (0..count).take_while(|_| !stop.load(Ordering::Relaxed)) {
            all.extend_from_slice(seen(number)?.cells());
        }
        Ok(all)
    })??;
    let array = numpy::ndarray::Array3::from_shape_vec((count, height, width), all)
        .expect("as many as said");
    Ok(PyArray3::from_owned_array(py, array))
}

/// Returns images and labels of a dataset; see `morphcog.images`.
#[pyfunction]
fn images<'py>(
    py: Python<'py>,
    dataset: &str,
    split: &str,
    data: Option<PathBuf>,
) -> PyResult<Labelled<'py>> {
    let _environment = entered()?;
    let split = match split {
        "train" => Split::Train,
        "test" => Split::Test,
        other => {
            return Err(refused(format!(
                "split={other:?}: expected \"train\" or \"test\""
            )));
        }
    };
    let places = places(data.as_deref(), std::env::var_os("MORPHCOG_DATA"), None);
    let failed = |error: DatasetError| raised(&Error::from(error));
    let (pixels, labels, [height, width]) = watched(py, |stop| -> PyResult<_> {
        let loaded = Dataset::load(dataset, &places, &[split]).map_err(failed)?;
        let count = loaded.len(split);
        let (mut pixels, mut labels, mut size) =
            (Vec::new(), room(Some(count), "the labels")?, [0, 0]);
        for index in (0..count).take_while(|_| !stop.load(Ordering::Relaxed)) {
            let image = loaded.image(split, index).map_err(failed)?;
            if index == 0 {
                size = [image.height(), image.width()];
                pixels = room(image.area().checked_mul(count), "the images")?;
            }
            pixels.extend_from_slice(image.cells());
            labels.push(loaded.label(split, index).map_err(failed)?);
        }
        Ok((pixels, labels, size))
    })??;
    let pixels = numpy::ndarray::Array3::from_shape_vec((labels.len(), height, width), pixels);
    Ok((
        PyArray3::from_owned_array(py, pixels.expect("images of one size")),
        PyArray1::from_vec(py, labels),
    ))
}

/// Returns displacements; see `morphcog.displacements`.
#[pyfunction]
#[pyo3(signature = (bodies, stimuli, control_steps, config, threads))]
fn displacements<'py>(
    py: Python<'py>,
    bodies: Vec<PyReadonlyArray2<u8>>,
    stimuli: PyReadonlyArray3<f64>,
    control_steps: Option<u32>,
    config: Option<&ConfigData>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let _environment = entered()?;
    let bodies = bodies.iter().map(body).collect::<PyResult<Vec<Body>>>()?;
    let (physics, protocol) = setting(config);
    let control_steps = control_steps.unwrap_or(protocol.control_steps);
    let protocol = Protocol {
        rollout: RolloutMode::Fresh,
        control_steps,
        ..protocol
    };
    let view = stimuli.as_array();
    let seen_by = |number: usize, place: usize| {
        let pixels = view.index_axis(numpy::ndarray::Axis(0), number);
        seen(pixels, &bodies[place])
            .map_err(|error| refused(format!("image {number}, body {place}: {}", error.value(py))))
    };
    let (count, shown) = (bodies.len(), stimuli.shape()[0]);
    // All bodies must have one size, as the stimuli of the first are used for all.
    let size = |body: &Body| (body.height(), body.width());
    if let Some(place) = bodies
        .iter()
        .position(|body| size(body) != size(&bodies[0]))
        && shown > 0
    {
        seen_by(0, 0)?;
        seen_by(0, place)?;
    }
    let shown_to_any = if bodies.is_empty() { 0 } else { shown };
    if shown_to_any > 0 {
        seen_by(0, 0)?;
    }
    // Tried as a whole, since a lack of memory for single images could not be reported.
    drop(room::<(Grid<f64>, f64)>(Some(shown_to_any), "the stimuli")?);
    drop(room::<f64>(Some(stimuli.len()), "the stimuli")?);
    let images = (0..shown_to_any)
        .map(|number| seen_by(number, 0))
        .collect::<PyResult<Vec<Grid<f64>>>>()?;
    let pool = pool(threads).map_err(|error| raised(&error))?;
    let walked = watched(py, |stop| {
        let walk = |body: &Body| -> Result<Vec<f64>, Stopped> {
            let (found, _) = fresh_rollouts(
                body,
                &images,
                &[],
                (&physics, &protocol),
                &|_| (),
                &Session::new(stop, &()),
            )?;
            Ok(found
                .into_iter()
                .map(|walk| walk.unwrap_or(f64::NAN))
                .collect())
        };
        pool.install(|| {
            bodies
                .par_iter()
                .with_max_len(1)
                .map(walk)
                .collect::<Result<Vec<_>, Stopped>>()
        })
    })?;
    let all: Vec<f64> = walked
        .expect("only Ctrl-C stops it, which is raised above")
        .into_iter()
        .flatten()
        .collect();
    let array =
        numpy::ndarray::Array2::from_shape_vec((count, shown), all).expect("as many as said");
    Ok(PyArray2::from_owned_array(py, array))
}

/// One simulation; see `morphcog.World`. Between checks for Ctrl-C others may read or change it.
#[pyclass(frozen, module = "morphcog._morphcog")]
struct WorldData {
    simulation: Mutex<Simulation>,
    body: Body,
}

#[derive(Clone)]
struct Simulation {
    world: morphcog::sim::World,
    unstable: Option<String>,
}

#[pymethods]
impl WorldData {
    #[new]
    #[pyo3(signature = (voxels, start_row, config))]
    fn new(
        voxels: PyReadonlyArray2<u8>,
        start_row: Option<u32>,
        config: Option<&ConfigData>,
    ) -> PyResult<Self> {
        let _environment = entered()?;
        let body = body(&voxels)?;
        let (physics, protocol) = setting(config);
        let (lowest, row) = (physics.ground_row, start_row.unwrap_or(protocol.start_row));
        if !(lowest..=MAX_ROW).contains(&row) {
            return Err(refused(format!(
                "start_row={row}: expected {lowest} (on the ground) to {MAX_ROW}"
            )));
        }
        let start = Start {
            column: protocol.start_column,
            row,
        };
        let world = morphcog::sim::World::new(System::new(&body, physics), start);
        Ok(WorldData {
            simulation: Mutex::new(Simulation {
                world,
                unstable: None,
            }),
            body,
        })
    }

    /// Returns a copy in its present state.
    fn copied(&self, py: Python) -> Self {
        WorldData {
            simulation: Mutex::new(self.simulation(py).clone()),
            body: self.body.clone(),
        }
    }

    fn set_stimulus(&self, py: Python, pixels: PyReadonlyArray2<f64>) -> PyResult<()> {
        let _environment = entered()?;
        let pixels = seen(pixels.as_array(), &self.body)?;
        self.simulation(py).world.set_stimulus(&pixels);
        Ok(())
    }

    fn step(&self, py: Python, count: u64) -> PyResult<()> {
        let _environment = entered()?;
        // In parts, to check for Ctrl-C; a control step takes milliseconds at most.
        let mut left = count;
        loop {
            let steps = left.min(STEPS);
            py.detach(|| self.locked().step(steps))
                .map_err(Unstable::new_err)?;
            left -= steps;
            if left == 0 {
                return Ok(());
            }
            check_interrupt(py)?;
        }
    }

    fn reset(&self, py: Python) {
        let mut simulation = self.simulation(py);
        simulation.world.reset();
        simulation.unstable = None;
    }

    #[getter]
    fn control_step(&self, py: Python) -> u64 {
        self.simulation(py).world.control_step()
    }

    /// Returns the centre of mass \[voxel lengths\].
    #[getter]
    fn centre(&self, py: Python) -> [f64; 2] {
        let _environment = FloatEnvironment::standard();
        let simulation = self.simulation(py);
        simulation.lengths(simulation.world.centre_of_mass())
    }

    /// Returns the points \[voxel lengths\].
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let _environment = FloatEnvironment::standard();
        let simulation = self.simulation(py);
        let places: Vec<f64> = simulation
            .world
            .points()
            .flat_map(|place| simulation.lengths(place))
            .collect();
        let array = numpy::ndarray::Array2::from_shape_vec((places.len() / 2, 2), places);
        PyArray2::from_owned_array(py, array.expect("two coordinates a point"))
    }

    /// Returns the corners of each voxel as indices of points, clockwise from the top left.
    #[getter]
    fn voxels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<usize>> {
        let corners: Vec<usize> = self
            .simulation(py)
            .world
            .voxels()
            .flat_map(|(_, corners)| corners)
            .collect();
        let array = numpy::ndarray::Array2::from_shape_vec((corners.len() / 4, 4), corners);
        PyArray2::from_owned_array(py, array.expect("four corners a voxel"))
    }
}

impl WorldData {
    /// Locks the simulation, without waiting for a thread that needs Python's lock.
    fn simulation(&self, py: Python) -> MutexGuard<'_, Simulation> {
        self.simulation
            .lock_py_attached(py)
            .unwrap_or_else(PoisonError::into_inner)
    }

    fn locked(&self) -> MutexGuard<'_, Simulation> {
        self.simulation
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

impl Simulation {
    /// Takes control steps; fails with the reason if it is unstable.
    fn step(&mut self, count: u64) -> Result<(), String> {
        if let Some(text) = &self.unstable {
            return Err(format!("{text}; begin anew with reset()"));
        }
        let stepped = (0..count)
            .try_for_each(|_| self.world.step())
            .map_err(|error| error.to_string());
        self.unstable = stepped.clone().err();
        stepped
    }

    /// Converts a position to voxel lengths, with y from the ground.
    fn lengths(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let physics = self.world.system().physics();
        [
            x / physics.cell_size,
            y / physics.cell_size - f64::from(physics.ground_row),
        ]
    }
}

/// Runs the command line with these arguments, the program's name first, and returns its exit code.
/// `program` has the words that call it in a shell.
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
    module.add_class::<ConfigData>()?;
    module.add_class::<RunData>()?;
    module.add_class::<WorldData>()?;
    module.add_function(wrap_pyfunction!(evolve_run, module)?)?;
    module.add_function(wrap_pyfunction!(images, module)?)?;
    module.add_function(wrap_pyfunction!(import_dataset, module)?)?;
    module.add_function(wrap_pyfunction!(stimuli, module)?)?;
    module.add_function(wrap_pyfunction!(displacements, module)?)?;
    module.add_function(wrap_pyfunction!(command, module)?)?;
    Ok(())
}
