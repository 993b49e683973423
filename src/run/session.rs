//! What a session of a run is given ([`Options`]), tells ([`Observer`]) and ends with ([`Finished`]).

use super::archive::RunFile;
use super::curriculum::Period;
use super::folder::{IfExists, RunFolder};
use super::metrics::Totals;
use super::start::StartRef;
use super::training::Training;
use super::validation::Validated;
use super::{Config, Error, eval};
use crate::qd::ArchiveStats;
use std::path::PathBuf;

/// What to evolve and where to.
#[derive(Clone, Debug)]
pub struct Options {
    /// Everything the result depends on.
    pub config: Config,
    /// Name of the run.
    pub name: String,
    /// Its folder.
    pub out: PathBuf,
    /// What to do if there is a run in it.
    pub if_exists: IfExists,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// Number of threads; `None`: one per core.
    pub threads: Option<usize>,
}

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Generations done.
    pub done: u64,
    /// Generations to be done in all.
    pub generations: u64,
    /// Figures of the archive.
    pub stats: ArchiveStats,
    /// Counts so far.
    pub totals: Totals,
}

/// Who is told how a run goes.
pub trait Observer {
    /// Before the first generation of this session.
    fn started(&mut self, folder: &RunFolder, training: &Training, progress: &Progress);
    /// Before the elites of another archive are evaluated, if the run starts from one.
    fn starting_from(&mut self, origin: &StartRef, robots: usize);
    /// When other training images, or another fitness, are begun with, and elites of before have been evaluated on them.
    fn period(&mut self, period: Period, training: &Training, progress: &Progress);
    /// After every generation.
    fn generation(&mut self, progress: &Progress);
    /// Who is told how robots are chosen on validation images when the run ends, if it is to choose some; nobody if it is not said.
    fn validation(&mut self) -> Box<dyn eval::Observer + '_> {
        Box::new(())
    }
    /// Something the user should know.
    fn warning(&mut self, text: &str);
}

/// How a session of a run ended.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The run as it stands in `run.json`.
    pub run: RunFile,
    /// Counts of the whole run.
    pub totals: Totals,
    /// The best robots of each task on validation images, best first; none if the config asks for none, or it was stopped.
    pub validated: Vec<Validated>,
    /// Whether a signal stopped it before its end: its last generation, and the choice of robots after that.
    pub stopped: bool,
    /// Why its end is not, or not as a whole, in its files, if so; it goes on from its last checkpoint.
    pub unwritten: Option<Error>,
}

impl Finished {
    /// Id of the best robot: the first on validation images if some were chosen by them, else the fittest.
    pub fn best(&self) -> Option<&str> {
        let better = |a: &Validated, b: &Validated| a.balanced_accuracy > b.balanced_accuracy;
        let first =
            self.validated.iter().reduce(|best, other| if better(other, best) { other } else { best });
        first.map(|robot| robot.id.as_str()).or(self.run.best().map(|robot| robot.id.as_str()))
    }
}
