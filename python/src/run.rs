//! Runs and their robots.

use crate::arrays::array;
use crate::config::ConfigData;
use crate::errors::{entered, parsed, raised, refused};
use crate::genome::GenomeData;
use crate::pictures::{FigureData, RecordingData};
use crate::watch::{Listener, heard, watched};
use morphcog::base::error::Error;
use morphcog::base::hash::sha256_hex;
use morphcog::base::session::Session;
use morphcog::base::threads::pool;
use morphcog::commands::plot::{self, FigureKind, PlotOptions};
use morphcog::commands::response::{self, ResponseOptions};
use morphcog::commands::{audit, eval, replay};
use morphcog::config::audit::Criteria;
use morphcog::draw::plot::{Background, Style};
use morphcog::robots;
use morphcog::robots::selection::Selection;
use morphcog::search::held_out_run;
use morphcog::search::one_by_one::{self, Named};
use morphcog::shipped;
use morphcog::store::folder;
use morphcog::store::images::HeldOut;
use morphcog::store::names::{AUDIT_JSON, RESPONSE_JSON};
use morphcog::store::run::{Robot, RunFile};
use morphcog::task::answer::{self, Readout};
use numpy::PyArray2;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// A run.json.
#[pyclass(frozen, module = "morphcog._morphcog")]
pub(crate) struct RunData {
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
            let text = format!(
                "{of_name}: expected one run (load_runs loads several), these are {}",
                names.len()
            );
            return Err(refused(format!("{text}: {}", names.join(", "))));
        };
        let run = robots::read(path).map_err(|error| raised(&error))?;
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
    fn robot<'py>(&self, py: Python<'py>, robot: String) -> PyResult<RobotParts<'py>> {
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
        Ok(parts(py, elite))
    }

    /// Returns id, task, objective and body of every robot, in the order of the elites.
    fn robots<'py>(&self, py: Python<'py>) -> Vec<RobotParts<'py>> {
        let robots = self.run.elites.iter();
        robots.map(|robot| parts(py, robot)).collect()
    }

    /// Returns the genome of a robot, by its whole id.
    fn genome(&self, id: &str) -> PyResult<GenomeData> {
        let known = self.run.elites.iter().find(|elite| elite.id == id);
        let robot = known.ok_or_else(|| refused(format!("there is no robot {id}")))?;
        let genome = GenomeData::new(robot.genome.clone(), &self.config())?;
        match genome.describes(&robot.body) {
            true => Ok(genome),
            false => Err(refused(format!(
                "robot {id}: its genome was not published with its body"
            ))),
        }
    }

    /// Returns the classes that a robot, by its whole id, answers by walking left and right, if it
    /// has a task.
    fn answers(&self, id: &str) -> Option<(Vec<u8>, Vec<u8>)> {
        let known = self.run.elites.iter().find(|elite| elite.id == id);
        let Readout { left, right } = self.run.judge(known?)?;
        Some((left, right))
    }

    /// Records a robot under its training images.
    fn recorded(&self, py: Python, robot: String) -> PyResult<RecordingData> {
        let _environment = entered()?;
        let options = replay::ReplayOptions {
            robot,
            archive: Some(self.place.clone()),
            ..replay::ReplayOptions::default()
        };
        let pool = pool(None).map_err(|error| raised(&error))?;
        let replay = watched(py, |stop| pool.install(|| replay::replay(&options, stop)))?;
        let replay = replay.map_err(|error| raised(&error))?;
        let title = format!("morphcog: robot {}", replay.name);
        Ok(RecordingData::new(replay.recording).entitled(title, replay.about))
    }

    /// Draws a figure of the run, or of one of its robots.
    #[pyo3(signature = (kind, robot, every, style, data))]
    fn figure(
        &self,
        py: Python,
        kind: &str,
        robot: Option<String>,
        every: usize,
        style: (Option<u32>, bool, bool),
        data: Option<PathBuf>,
    ) -> PyResult<FigureData> {
        let _environment = entered()?;
        let kind: FigureKind = parsed("kind", kind)?;
        let named = |robot: String| Named {
            archive: self.place.clone(),
            robot,
        };
        let robots = match (kind.is_of_robot(), robot) {
            (true, robot) => vec![named(robot.unwrap_or("best".to_string()))],
            (false, None) => Vec::new(),
            (false, Some(_)) => {
                return Err(refused(format!(
                    "robot: a figure of kind {kind} shows none"
                )));
            }
        };
        let (width, has_title, transparent) = style;
        let style = Style::default().millimetres(width);
        let wanted = PlotOptions {
            kind,
            style: match has_title {
                true => style,
                false => style.without_title(),
            },
            archives: vec![self.place.clone()],
            robots,
            options: replay::ReplayOptions {
                data: data.clone(),
                ..replay::ReplayOptions::default()
            },
            every,
            out: None,
            dpi: None,
            background: match transparent {
                true => Background::Transparent,
                false => Background::Paper,
            },
        };
        let figure = watched(py, |stop| {
            plot::one(&wanted, &Session::new(stop, &()).data(data))
        })?;
        let figure = figure.map_err(|error| raised(&error))?;
        Ok(FigureData { figure })
    }

    /// Measures responses as `morphcog response` does, and returns the path of the table.
    #[allow(clippy::too_many_arguments)] // Python's keywords
    fn response(
        &self,
        py: Python,
        robots: &str,
        task: Option<String>,
        set: Vec<String>,
        images: usize,
        error: f64,
        seed: Option<u64>,
        data: Option<PathBuf>,
        listener: &Bound<PyAny>,
    ) -> PyResult<PathBuf> {
        let _environment = entered()?;
        let choice = one_by_one::RobotChoice {
            robots: parsed("robots", robots)?,
            archives: vec![self.place.clone()],
            physical_only: false,
            seed: seed.unwrap_or(1),
        };
        let out = folder::beside(&self.place, RESPONSE_JSON);
        let listener = Listener {
            function: listener,
            waits: false,
        };
        let unwritten = heard(py, &listener, (None, data), |session| {
            let named = one_by_one::named(&choice, session)?;
            let options = ResponseOptions {
                archive: self.place.clone(),
                robots: named.into_iter().map(|named| named.robot).collect(),
                physical_only: false,
                task,
                set,
                images,
                error,
                seed,
                out: out.clone(),
            };
            let finished = response::measure(&options, session)?;
            if finished.unwritten.is_none() {
                finished.draw(|_| ())?;
            }
            Ok(finished.unwritten)
        })?;
        written(unwritten, &out)
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
        let listener = Listener {
            function: listener,
            waits: false,
        };
        let unwritten = heard(py, &listener, (None, data), |session| {
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
        let listener = Listener {
            function: listener,
            waits: false,
        };
        let unwritten = heard(py, &listener, (None, data), |session| {
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

/// Id, task, objective and body of a robot.
type RobotParts<'py> = (String, String, f64, Bound<'py, PyArray2<u8>>);

fn parts<'py>(py: Python<'py>, robot: &Robot) -> RobotParts<'py> {
    let (id, task) = (robot.id.clone(), robot.task.clone());
    (id, task, robot.objective, array(py, &robot.body))
}

/// Returns the run.json of every run at a path, or of a shipped name.
#[pyfunction]
pub(crate) fn runs(path: PathBuf) -> PyResult<Vec<PathBuf>> {
    folder::run_json(path).map_err(|text| raised(&Error::input(text)))
}

/// Returns the path of the table beside results, or the error of writing them.
pub(crate) fn written(unwritten: Option<Error>, out: &Path) -> PyResult<PathBuf> {
    match unwritten {
        Some(error) => Err(raised(&error)),
        None => Ok(out.with_extension("csv")),
    }
}
