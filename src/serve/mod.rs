//! `morphcog serve`: answers the page's requests with the real engine. Only [`server`] and its
//! helpers know HTTP.

pub(crate) mod assets;
pub(crate) mod catalogue;
pub(crate) mod course;
pub(crate) mod hosts;
pub(crate) mod http;
pub(crate) mod images;
pub mod local;
pub(crate) mod refusal;
pub(crate) mod request;
pub(crate) mod routes;
pub mod server;
pub(crate) mod simulation;
pub mod simulations;
#[cfg(feature = "gallery")]
pub(crate) mod site;
pub(crate) mod stream;
pub(crate) mod team;

use crate::base::error::Error;
use crate::body::Body;
use crate::commands::simulate::Scenario;
use crate::sim::{Physics, Start};
use crate::task::protocol::Protocol;
use catalogue::RobotCatalogue;
use images::ImageSets;
use refusal::HttpRefusal;
use request::RolloutPlan;
use serde::Serialize;
use simulations::Simulations;
use std::path::PathBuf;

/// The options of `morphcog serve`.
#[derive(Clone, Debug, Default)]
pub struct ServeOptions {
    /// The run.json files to browse.
    pub archives: Vec<PathBuf>,
    /// Another run, not named by the user: if it cannot be read, a note says so.
    pub newest: Option<PathBuf>,
    /// The folder of the data, if the command line gives it.
    pub data: Option<PathBuf>,
    /// The folder whose runs appear on the page when they change.
    pub runs: PathBuf,
}

/// Everything that a page can request.
pub struct Service {
    pub(crate) catalogue: RobotCatalogue,
    pub(crate) images: ImageSets,
    pub(crate) simulations: Simulations,
}

/// The response to `/api/status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ServiceStatus {
    pub(crate) version: &'static str,
    pub(crate) simulations: usize,
    pub(crate) max_simulations: usize,
    /// The number of simulations begun so far.
    pub(crate) begun: u64,
}

/// The result of checking a body.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Checked {
    /// True if there is a voxel and all voxels are connected.
    pub(crate) connected: bool,
    pub(crate) muscle: usize,
    pub(crate) sensor: usize,
    pub(crate) total: usize,
    /// The reason why it is not viable; `None` if it is.
    pub(crate) problem: Option<&'static str>,
    /// A remark on a viable body.
    pub(crate) note: Option<&'static str>,
}

/// A scenario of `morphcog simulate`, as far as the page supports it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Loaded {
    pub(crate) body: Body,
    /// The stimulus; `None` is all dark.
    pub(crate) stimulus: Option<crate::base::Grid<f64>>,
    /// The length of the simulation, cut to the page's limit.
    pub(crate) control_steps: u64,
    /// A note on unsupported parts.
    pub(crate) note: Option<String>,
}

impl Service {
    /// Reads the archives and finds the images. Files that the user did not name and that are
    /// missing or unreadable become notes.
    ///
    /// # Errors
    /// Returns an error if an archive is invalid.
    pub fn open(options: &ServeOptions) -> Result<(Self, Vec<String>), Error> {
        let ServeOptions {
            archives,
            newest,
            data,
            runs,
        } = options;
        let (catalogue, mut notes) = RobotCatalogue::open(archives, newest.as_deref(), runs)?;
        let (images, missing) = ImageSets::open(&catalogue, data.as_deref())?;
        notes.extend(missing);
        let service = Service {
            catalogue,
            images,
            simulations: Simulations::default(),
        };
        Ok((service, notes))
    }

    /// Offers the robots that ship, and the images that the program draws.
    ///
    /// # Errors
    /// Returns an error if the robots did not ship with this build.
    pub(crate) fn shipped() -> Result<Self, Error> {
        let catalogue = RobotCatalogue::shipped()?;
        // What is missing are datasets to be downloaded.
        let (images, _) = ImageSets::open(&catalogue, None)?;
        Ok(Service {
            catalogue,
            images,
            simulations: Simulations::default(),
        })
    }

    pub(crate) fn status(&self) -> ServiceStatus {
        ServiceStatus {
            version: env!("CARGO_PKG_VERSION"),
            simulations: self.simulations.running(),
            max_simulations: simulations::MAX_SIMULATIONS,
            begun: self.simulations.begun(),
        }
    }

    pub(crate) fn check(&self, body: &Body) -> Checked {
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
        let crate::body::VoxelCounts {
            muscle,
            sensor,
            total,
        } = counts;
        Checked {
            connected,
            muscle,
            sensor,
            total,
            problem,
            note,
        }
    }

    /// Reads a scenario of `morphcog simulate`.
    pub(crate) fn load(&self, text: &str) -> Result<Loaded, HttpRefusal> {
        let scenario = Scenario::parse(text, "scenario")?;
        if *scenario.physics() != Physics::default() {
            let text = "scenario: physics: the page has EvoGym's constants only; morphcog simulate takes others";
            return Err(HttpRefusal::Wrong(text.to_string()));
        }
        scenario.check_plain().map_err(HttpRefusal::Wrong)?;
        let Protocol {
            start_row: row,
            start_column: column,
            ..
        } = Protocol::default();
        let starts_here = scenario.start() == Start { row, column };
        let most = u64::from(request::MAX_STEPS);
        let notes: Vec<String> = [
            (scenario.stimuli().len() > 1).then(|| "of its stimuli the first is shown".to_string()),
            (!starts_here)
                .then(|| format!("it starts in row {row}, column {column}, as all bodies do here")),
            (scenario.control_steps() > most)
                .then(|| format!("it ends after {most} control steps")),
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

    pub(crate) fn plan(
        &self,
        request: request::SimulationRequest,
    ) -> Result<RolloutPlan, HttpRefusal> {
        request.plan(&self.catalogue, &self.images)
    }
}
