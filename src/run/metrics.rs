//! `metrics.csv`: a line per generation, with pyribs' names.

use super::Error;
use crate::base::files::write_atomically;
use crate::qd::ArchiveStats;
use crate::task::evaluation::Evaluation;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// What a run has done so far. *Showings* are images shown to robots (fresh lives, or phases of sequential ones).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Totals {
    /// Offspring made.
    pub evaluations: u64,
    /// Showings simulated.
    pub simulated: u64,
    /// Showings saved because the body was known.
    pub saved_known_bodies: u64,
    /// Showings saved by stopping early (or because an earlier one was unstable).
    pub saved_early_stop: u64,
    /// Showings saved because another image looks the same to the sensors.
    pub saved_shared_lives: u64,
    /// Offspring found unstable.
    pub unstable: u64,
    /// Wall-clock time, all sessions of the run together \[s\].
    pub seconds: f64,
}

impl Totals {
    /// Showings saved altogether.
    pub fn saved(&self) -> u64 {
        self.saved_known_bodies + self.saved_early_stop + self.saved_shared_lives
    }

    /// Counts one evaluation.
    pub fn count(&mut self, evaluation: &Evaluation) {
        self.simulated += evaluation.simulated;
        self.saved_early_stop += evaluation.stopped;
        self.saved_shared_lives += evaluation.shared;
    }
}

const HEADER: &str = "generation,num_elites,coverage,qd_score,norm_qd_score,obj_max,obj_mean,evaluations,\
simulated,saved,saved_known_bodies,saved_early_stop,saved_shared_lives,unstable,seconds";

/// Writes `metrics.csv`.
pub struct Metrics {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Metrics {
    /// Opens it to go on after `generations` lines; later ones, from before an interruption, are dropped.
    ///
    /// # Errors
    /// If it cannot be read or written.
    pub fn open(folder: &Path, generations: u64) -> Result<Self, Error> {
        let path = folder.join("metrics.csv");
        let old =
            if generations > 0 { std::fs::read_to_string(&path).unwrap_or_default() } else { String::new() };
        let number = |line: &&str| line.split(',').next().and_then(|first| first.parse::<u64>().ok());
        let whole = old.split_inclusive('\n').filter(|line| line.ends_with('\n')).map(str::trim_end);
        let kept = whole.filter(|line| number(line).is_some_and(|generation| generation < generations));
        let mut text: String = std::iter::once(HEADER).chain(kept).collect::<Vec<_>>().join("\n");
        text.push('\n');
        write_atomically(&path, text.as_bytes()).map_err(|error| Error::writing(&path, &error))?;
        let file = File::options().append(true).open(&path).map_err(|error| Error::writing(&path, &error))?;
        Ok(Metrics { path, file: BufWriter::new(file) })
    }

    /// Adds the line of a generation (from 0).
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&mut self, generation: u64, stats: &ArchiveStats, totals: &Totals) -> Result<(), Error> {
        let ArchiveStats { num_elites, coverage, qd_score, norm_qd_score, obj_max, obj_mean } = stats;
        let number = |value: &Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let (obj_max, obj_mean) = (number(obj_max), number(obj_mean));
        let Totals { evaluations, simulated, unstable, seconds, .. } = totals;
        writeln!(
            self.file,
            "{generation},{num_elites},{coverage},{qd_score},{norm_qd_score},{obj_max},{obj_mean},{evaluations},\
             {simulated},{},{},{},{},{unstable},{seconds:.3}",
            totals.saved(),
            totals.saved_known_bodies,
            totals.saved_early_stop,
            totals.saved_shared_lives,
        )
        .map_err(|error| Error::writing(&self.path, &error))
    }

    /// Hands what was written to the system.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn flush(&mut self) -> Result<(), Error> {
        self.file.flush().map_err(|error| Error::writing(&self.path, &error))
    }
}
