//! Commands that make a run or test several.

use crate::config::ConfigData;
use crate::errors::{entered, parsed, raised, refused};
use crate::pictures::FigureData;
use crate::run::written;
use crate::watch::{Listener, heard};
use morphcog::commands::pairs::{Gaits, PairsOptions, best_gait, pairs};
use morphcog::commands::team::{self, TeamOptions};
use morphcog::commands::train::{self, TrainOptions};
use morphcog::commands::{audit, evolve};
use morphcog::config::audit::Criteria;
use morphcog::draw::plot::{Style, confusion, poster};
use morphcog::robots::selection::Selection;
use morphcog::store::folder::{self, IfExists};
use morphcog::store::images::HeldOut;
use morphcog::store::names::{AUDIT_JSON, RUN_JSON};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

fn if_exists(resume: bool, force: bool) -> IfExists {
    match (resume, force) {
        (true, _) => IfExists::Resume,
        (_, true) => IfExists::Overwrite,
        _ => IfExists::Refuse,
    }
}

/// Evolves, and returns the run's folder; see `morphcog.evolve`.
#[pyfunction]
#[pyo3(signature = (config, out, resume, force, data, threads, listener, waits))]
#[allow(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn evolve_run(
    py: Python,
    config: &ConfigData,
    out: Option<PathBuf>,
    resume: bool,
    force: bool,
    data: Option<PathBuf>,
    threads: Option<usize>,
    listener: &Bound<PyAny>,
    waits: bool,
) -> PyResult<PathBuf> {
    let _environment = entered()?;
    let (config, name) = (config.inner.clone(), config.name.clone());
    let out =
        out.unwrap_or_else(|| Path::new(folder::RUNS).join(format!("{name}-seed{}", config.seed)));
    let options = evolve::EvolveOptions {
        config,
        name,
        out: out.clone(),
        if_exists: if_exists(resume, force),
    };
    let listener = Listener {
        function: listener,
        waits,
    };
    let unwritten = heard(py, &listener, (threads, data), |session| {
        evolve::evolve(&options, session).map(|finished| finished.unwritten)
    })?;
    match unwritten {
        Some(error) => Err(raised(&error)),
        None => Ok(out),
    }
}

/// Trains, validates and audits as `morphcog train` does, and returns the run's folder.
#[pyfunction]
#[pyo3(signature = (archives, task, robots, seed, set, out, resume, force, audits, data, threads, listener, waits))]
#[allow(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn train_run(
    py: Python,
    archives: Vec<PathBuf>,
    task: &str,
    robots: Option<&str>,
    seed: Option<u64>,
    set: Vec<String>,
    out: Option<PathBuf>,
    resume: bool,
    force: bool,
    audits: bool,
    data: Option<PathBuf>,
    threads: Option<usize>,
    listener: &Bound<PyAny>,
    waits: bool,
) -> PyResult<PathBuf> {
    let _environment = entered()?;
    let robots = robots.map(|robots| parsed("robots", robots)).transpose()?;
    let of_one = Selection::Top(train::GAITS_OF_ONE);
    let of_each = Selection::Top(train::GAITS_OF_EACH);
    let first = archives
        .first()
        .ok_or_else(|| refused("run: expected one run or more"))?;
    let groups = train::groups(first, task, &set, data.as_deref());
    let groups = groups.map_err(|error| raised(&error))?;
    let listener = Listener {
        function: listener,
        waits,
    };
    heard(py, &listener, (threads, data), |session| {
        let (archive, robots) = match &archives[..] {
            [archive] => (archive.clone(), robots.unwrap_or(of_one)),
            _ => {
                let gaits = Gaits {
                    archives,
                    robots: robots.unwrap_or(of_each),
                    groups: groups.clone(),
                    seed,
                    set: set.clone(),
                };
                best_gait(&gaits, session)?
            }
        };
        let name = train::name(&archive, &groups, seed);
        let out = out.unwrap_or_else(|| train::default_out(&archive, &name));
        let options = TrainOptions {
            archive,
            robots,
            groups,
            seed,
            set,
            name,
            out: out.clone(),
            if_exists: if_exists(resume, force),
        };
        let trained = train::train(&options, session)?;
        if !audits || !trained.is_validated() {
            return Ok(out);
        }
        let archive = out.join(RUN_JSON);
        let options = audit::AuditOptions {
            robots: Selection::All,
            seed: 1,
            criteria: Criteria::default(),
            fresh: false,
            out: archive.with_file_name(AUDIT_JSON),
            archive,
        };
        let audited = audit::audit(&options, session)?;
        audited.unwritten.map_or(Ok(out), Err)
    })
}

/// Trains a robot for each pair of classes as `morphcog train --pairs` does; returns their run.json
/// files.
#[pyfunction]
#[pyo3(signature = (archives, robots, classes, dataset, seed, set, out, data, threads, listener))]
#[allow(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn train_pairs(
    py: Python,
    archives: Vec<PathBuf>,
    robots: Option<&str>,
    classes: Option<Vec<String>>,
    dataset: Option<String>,
    seed: Option<u64>,
    set: Vec<String>,
    out: Option<PathBuf>,
    data: Option<PathBuf>,
    threads: Option<usize>,
    listener: &Bound<PyAny>,
) -> PyResult<Vec<PathBuf>> {
    let _environment = entered()?;
    let robots = robots.map(|robots| parsed("robots", robots)).transpose()?;
    let options = PairsOptions {
        archives,
        robots: robots.unwrap_or(Selection::Top(train::GAITS_OF_EACH)),
        dataset,
        classes,
        seed,
        set,
    };
    let listener = Listener {
        function: listener,
        waits: false,
    };
    heard(py, &listener, (threads, data), |session| {
        pairs(&options, out, session)
    })
}

/// The path of a team's table, and the figures of its answers and its bodies.
type Tested = (PathBuf, Option<FigureData>, Option<FigureData>);

/// Tests a team as `morphcog team` does; see `morphcog.team`.
#[pyfunction]
#[pyo3(signature = (archives, robots, classes, images, split, seed, out, data, threads, listener))]
#[allow(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn team_test(
    py: Python,
    archives: Vec<PathBuf>,
    robots: &str,
    classes: Option<Vec<String>>,
    images: Option<&str>,
    split: &str,
    seed: u64,
    out: Option<PathBuf>,
    data: Option<PathBuf>,
    threads: Option<usize>,
    listener: &Bound<PyAny>,
) -> PyResult<Tested> {
    let _environment = entered()?;
    let split: HeldOut = parsed("split", split)?;
    let options = TeamOptions {
        robots: parsed("robots", robots)?,
        classes,
        images: images.map(|images| parsed("images", images)).transpose()?,
        split,
        seed,
        out: out.unwrap_or_else(|| folder::beside_all(&archives, team::own_name(split))),
        archives,
    };
    let listener = Listener {
        function: listener,
        waits: false,
    };
    let tested = heard(py, &listener, (threads, data), |session| {
        team::team(&options, session)
    })?;
    let (figure, style) = (|figure| FigureData { figure }, Style::default());
    let figures = [
        confusion(&tested.file, &style),
        poster(&tested.file, &style),
    ];
    let [confusion, bodies] = figures.map(|drawn| drawn.map(figure));
    let path = written(tested.unwritten, &options.out)?;
    Ok((path, confusion, bodies))
}
