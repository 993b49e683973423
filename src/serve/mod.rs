//! `morphcog serve`: what the page asks for, answered with the real engine. Knows nothing of HTTP:
//! that is [`server`]'s.

pub mod assets;
pub mod catalogue;
pub mod course;
pub mod hosts;
pub mod http;
pub mod images;
pub mod refusal;
pub mod request;
pub mod routes;
pub mod server;
pub mod simulation;
pub mod simulations;
pub mod stream;
pub mod team;

use crate::base::error::Error;
use crate::base::threads;
use crate::body::Body;
use crate::commands::simulate::Scenario;
use crate::sim::{Physics, Start};
use crate::task::protocol::Protocol;
use catalogue::Catalogue;
use hosts::Hosts;
use images::ImageSets;
use refusal::Refusal;
use request::Plan;
use serde::Serialize;
use simulations::Simulations;
use std::path::PathBuf;

/// What to serve.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The run.json files to browse.
    pub archives: Vec<PathBuf>,
    /// One more that was not asked for by name: it is left out, with a note, if it cannot be read.
    pub newest: Option<PathBuf>,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// The folder whose runs appear on the page when they change.
    pub runs: PathBuf,
    /// By which names the page may be reached.
    pub hosts: Hosts,
}

/// Everything a page can ask for.
pub struct Service {
    /// Robots to choose from.
    pub catalogue: Catalogue,
    /// Test images to choose from.
    pub images: ImageSets,
    /// What runs at the moment.
    pub simulations: Simulations,
    /// The threads that the robots of teams walk in.
    pub pool: rayon::ThreadPool,
    /// By which names it may be reached.
    pub hosts: Hosts,
}

/// What `/api/status` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Status {
    /// Version of the program.
    pub version: &'static str,
    /// Simulations running now.
    pub simulations: usize,
    /// Most simulations at once.
    pub max_simulations: usize,
    /// Simulations begun so far.
    pub begun: u64,
}

/// What a body is found to be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Whether all its voxels hang together, and there is one.
    pub connected: bool,
    /// Muscle voxels.
    pub muscle: usize,
    /// Sensor voxels.
    pub sensor: usize,
    /// All voxels.
    pub total: usize,
    /// Why it cannot live; none if it can.
    pub problem: Option<&'static str>,
    /// What is worth knowing of one that can.
    pub note: Option<&'static str>,
}

/// A scenario of `morphcog simulate`, as far as the page can show it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Loaded {
    /// The body.
    pub body: Body,
    /// What it sees; none: all dark.
    pub stimulus: Option<crate::base::Grid<f64>>,
    /// Length of the simulation, cut to what the page allows.
    pub control_steps: u64,
    /// What of it is not shown.
    pub note: Option<String>,
}

impl Service {
    /// Reads the archives and finds the images; what could not be read or found without being asked
    /// for by name is told in the notes.
    ///
    /// # Errors
    /// What is wrong with an archive; if the system has no threads left.
    pub fn open(options: &Options) -> Result<(Self, Vec<String>), Error> {
        let Options { archives, newest, data, runs, hosts } = options;
        let (catalogue, mut notes) = Catalogue::open(archives, newest.as_deref(), runs)?;
        let (images, missing) = ImageSets::open(&catalogue, data.as_deref())?;
        notes.extend(missing);
        let (simulations, pool) = (Simulations::default(), threads::pool(None)?);
        Ok((Service { catalogue, images, simulations, pool, hosts: hosts.clone() }, notes))
    }

    /// How it is doing.
    pub fn status(&self) -> Status {
        Status {
            version: env!("CARGO_PKG_VERSION"),
            simulations: self.simulations.running(),
            max_simulations: simulations::MAX_SIMULATIONS,
            begun: self.simulations.begun(),
        }
    }

    /// Whether a body can live.
    pub fn check(&self, body: &Body) -> Checked {
        let counts = body.counts();
        let connected = body.is_connected();
        let problem = match (counts.total, connected) {
            (0, _) => Some("there is no voxel yet"),
            (_, false) => Some("its voxels do not all hang together through their sides"),
            _ => None,
        };
        let note = match (problem, counts.muscle, counts.sensor) {
            (None, 0, _) => Some("without a muscle it does not walk"),
            (None, _, 0) => Some("without a sensor it is blind"),
            _ => None,
        };
        let crate::body::VoxelCounts { muscle, sensor, total } = counts;
        Checked { connected, muscle, sensor, total, problem, note }
    }

    /// Reads a scenario of `morphcog simulate`.
    ///
    /// # Errors
    /// What is wrong with it, or that the page cannot show it.
    pub fn load(&self, text: &str) -> Result<Loaded, Refusal> {
        let scenario = Scenario::parse(text, "scenario")?;
        if *scenario.physics() != Physics::default() {
            let text =
                "scenario: physics: the page has EvoGym's constants only; morphcog simulate takes others";
            return Err(Refusal::Wrong(text.to_string()));
        }
        let Protocol { start_row: row, start_column: column, .. } = Protocol::default();
        let starts_here = scenario.start() == Start { row, column };
        let most = u64::from(request::MAX_STEPS);
        let notes: Vec<String> = [
            (scenario.stimuli().len() > 1).then(|| "of its stimuli the first is shown".to_string()),
            (!starts_here).then(|| format!("it starts in row {row}, column {column}, as all bodies do here")),
            (scenario.control_steps() > most).then(|| format!("it ends after {most} control steps")),
        ]
        .into_iter()
        .flatten()
        .collect();
        Ok(Loaded {
            stimulus: scenario.stimuli().first().cloned(),
            control_steps: scenario.control_steps().clamp(1, most),
            body: scenario.body,
            note: (!notes.is_empty()).then(|| notes.join("; ")),
        })
    }

    /// What a request for a simulation means.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn plan(&self, request: request::SimulationRequest) -> Result<Plan, Refusal> {
        request.plan(&self.catalogue, &self.images)
    }
}
