//! `metrics.csv`: a line per generation, with pyribs' names.

use crate::base::error::Error;
use crate::base::files::{read_bytes, write_atomically};
use crate::base::ownership;
use crate::base::ranges;
use crate::base::remedy::{Invocation, Remedy};
use crate::qd::ArchiveStats;
use crate::shipped::read_text;
use crate::store::names::METRICS;
use crate::store::run::RunFile;
use crate::task::evaluation::Evaluation;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// The counts of a run so far. *Showings* are presentations of an image to a robot: fresh rollouts,
/// or phases of sequential ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Totals {
    pub(crate) evaluations: u64,
    pub(crate) simulated: u64,
    pub(crate) saved_known_bodies: u64,
    /// The number of showings saved by stopping early (or because an earlier one was unstable).
    pub(crate) saved_early_stop: u64,
    /// The number of showings saved because another image looks the same to the sensors.
    pub(crate) saved_shared_rollouts: u64,
    pub(crate) unstable: u64,
    /// The wall-clock time of all sessions of the run \[s\].
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) seconds: f64,
}

impl Totals {
    pub(crate) fn saved(&self) -> u64 {
        self.saved_known_bodies + self.saved_early_stop + self.saved_shared_rollouts
    }

    pub(crate) fn count(&mut self, evaluation: &Evaluation) {
        self.simulated += evaluation.simulated;
        self.saved_early_stop += evaluation.stopped;
        self.saved_shared_rollouts += evaluation.shared;
    }
}

const HEADER: &str = "generation,num_elites,coverage,qd_score,norm_qd_score,obj_max,obj_mean,evaluations,\
simulated,saved,saved_known_bodies,saved_early_stop,saved_shared_rollouts,unstable,seconds";

/// The writer of `metrics.csv`.
pub(crate) struct Metrics {
    path: PathBuf,
    file: BufWriter<File>,
    /// The number of earlier generations whose lines are missing.
    pub(crate) missing: u64,
}

impl Metrics {
    /// Opens the file to continue after `generations` lines; later lines, from before an
    /// interruption, are dropped.
    pub(crate) fn open(folder: &Path, generations: u64) -> Result<Self, Error> {
        let path = folder.join(METRICS);
        let old = match read_bytes(&path) {
            _ if generations == 0 => String::new(),
            // Invalid text is no whole line, and is dropped as such.
            Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
            Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
            Err(error) => return Err(Error::reading(&path, &error)),
        };
        let number = |line: &&str| {
            line.split(',')
                .next()
                .and_then(|first| first.parse::<u64>().ok())
        };
        let whole = old
            .split_inclusive('\n')
            .filter(|line| line.ends_with('\n'))
            .map(str::trim_end);
        let kept =
            whole.filter(|line| number(line).is_some_and(|generation| generation < generations));
        let kept: Vec<String> = kept.map(str::to_string).collect();
        let missing = generations.saturating_sub(kept.len() as u64);
        let mut text = std::iter::once(HEADER.to_string())
            .chain(kept)
            .collect::<Vec<_>>()
            .join("\n");
        text.push('\n');
        write_atomically(&path, text.as_bytes()).map_err(|error| Error::writing(&path, &error))?;
        let file = File::options()
            .append(true)
            .open(&path)
            .map_err(|error| Error::writing(&path, &error))?;
        Ok(Metrics {
            path,
            file: BufWriter::new(file),
            missing,
        })
    }

    /// Adds the line of a generation (from 0).
    pub(crate) fn write(
        &mut self,
        generation: u64,
        stats: &ArchiveStats,
        totals: &Totals,
    ) -> Result<(), Error> {
        let ArchiveStats {
            num_elites,
            coverage,
            qd_score,
            norm_qd_score,
            obj_max,
            obj_mean,
        } = stats;
        let number = |value: &Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let (obj_max, obj_mean) = (number(obj_max), number(obj_mean));
        let Totals {
            evaluations,
            simulated,
            unstable,
            seconds,
            ..
        } = totals;
        writeln!(
            self.file,
            "{generation},{num_elites},{coverage},{qd_score},{norm_qd_score},{obj_max},{obj_mean},{evaluations},\
             {simulated},{},{},{},{},{unstable},{seconds:.3}",
            totals.saved(),
            totals.saved_known_bodies,
            totals.saved_early_stop,
            totals.saved_shared_rollouts,
        )
        .map_err(|error| Error::writing(&self.path, &error))
    }

    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        let written = ownership::check(&self.path).and_then(|()| self.file.flush());
        written.map_err(|error| Error::writing(&self.path, &error))
    }

    /// Writes all lines so that they outlast a power failure: a checkpoint that has more of the run
    /// than this file could not restore them.
    pub(crate) fn sync(&mut self) -> Result<(), Error> {
        self.flush()?;
        let written = self.file.get_ref().sync_data();
        written.map_err(|error| Error::writing(&self.path, &error))
    }
}

/// A line of `metrics.csv`, reduced to what figures need.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub(crate) struct Moment {
    /// The generation, from 0.
    pub(crate) generation: u64,
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) evaluations: f64,
    /// The share of possible cells with an elite.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) coverage: f64,
    /// The sum of the objectives, each less the offset.
    #[serde(deserialize_with = "ranges::number")]
    pub(crate) qd_score: f64,
    /// The largest objective; `None` without elites.
    #[serde(default, deserialize_with = "ranges::number")]
    pub(crate) obj_max: Option<f64>,
    /// The wall-clock time so far \[s\].
    #[serde(default, deserialize_with = "ranges::size")]
    pub(crate) seconds: f64,
}

/// Reads the metrics.csv beside a run.json, without checking that they match.
pub(crate) fn moments(archive: &Path) -> Result<Vec<Moment>, Error> {
    let path = archive.with_file_name(METRICS);
    let text = read_text(&path).map_err(|error| Error::reading(&path, &error))?;
    // A run in progress may be writing the last line.
    let whole = text.rfind('\n').map_or(text.as_str(), |end| &text[..=end]);
    parsed(whole).map_err(|error| error.in_place(&path.display().to_string()))
}

/// Reads the metrics.csv of a run and checks that the line of its run.json's generation has the
/// same figures. A run in progress may have more lines.
pub(crate) fn moments_of(run: &RunFile, archive: &Path) -> Result<Vec<Moment>, Error> {
    let moments = moments(archive)?;
    let Some(last) = run.generations.checked_sub(1) else {
        return Ok(moments);
    };
    let ArchiveStats {
        coverage,
        qd_score,
        obj_max,
        ..
    } = run.stats;
    let is_it = |moment: &&Moment| {
        (moment.coverage, moment.qd_score, moment.obj_max) == (coverage, qd_score, obj_max)
    };
    match moments
        .iter()
        .find(|moment| moment.generation == last)
        .filter(is_it)
    {
        Some(_) => Ok(moments),
        None => {
            let (metrics, archive) = (archive.with_file_name(METRICS), archive.display());
            let text = format!(
                "{}: generation {last}: expected the figures of {archive}: it is of another run, or another \
                 state of it",
                metrics.display()
            );
            Err(Error::input(text))
        }
    }
}

fn parsed(text: &str) -> Result<Vec<Moment>, Error> {
    let evolve = || {
        Remedy::Run(
            Invocation::new("evolve"),
            "writes this file beside run.json",
        )
    };
    let mut moments = Vec::new();
    for line in csv::Reader::from_reader(text.as_bytes()).deserialize() {
        let moment: Moment =
            line.map_err(|error| Error::input(error.to_string()).remedy(evolve()))?;
        if let Some(before) = moments
            .last()
            .filter(|before: &&Moment| before.generation >= moment.generation)
        {
            let (before, found) = (before.generation, moment.generation);
            let text = format!(
                "generation {found} after {before}: expected a line per generation, in order"
            );
            return Err(Error::input(text).remedy(evolve()));
        }
        moments.push(moment);
    }
    match moments.is_empty() {
        true => Err(
            Error::input("expected a line per generation, found none".to_string()).remedy(evolve()),
        ),
        false => Ok(moments),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qd::Archive;

    fn lines(folder: &Path) -> Vec<String> {
        let text = std::fs::read_to_string(folder.join("metrics.csv")).unwrap();
        assert!(text.ends_with('\n'));
        text.lines().map(str::to_string).collect()
    }

    fn write(folder: &Path, from: u64, to: u64, evaluations: u64) {
        let mut metrics = Metrics::open(folder, from).unwrap();
        let stats = Archive::<()>::new().stats(90, 0.0);
        let totals = Totals {
            evaluations,
            ..Totals::default()
        };
        (from..to).for_each(|generation| metrics.write(generation, &stats, &totals).unwrap());
        metrics.flush().unwrap();
    }

    #[test]
    fn every_line_has_a_field_per_column_and_none_for_what_there_is_not() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), 0, 2, 7);
        let lines = lines(folder.path());
        let columns = HEADER.split(',').count();
        assert!(
            lines.len() == 3 && lines.iter().all(|line| line.split(',').count() == columns),
            "{lines:?}"
        );
        assert_eq!(lines[1], "0,0,0,0,0,,,7,0,0,0,0,0,0,0.000");
    }

    #[test]
    fn lines_after_the_resumed_generation_are_dropped_and_written_anew() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), 0, 5, 1);
        write(folder.path(), 3, 6, 2);
        let evaluations: Vec<String> = lines(folder.path())[1..]
            .iter()
            .map(|line| line.split(',').nth(7).unwrap().to_string())
            .collect();
        assert_eq!(evaluations, ["1", "1", "1", "2", "2", "2"]);
    }

    #[test]
    fn a_line_that_is_no_text_is_dropped_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), 0, 3, 1);
        let path = folder.path().join("metrics.csv");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend(b"abc\xff\n");
        std::fs::write(&path, bytes).unwrap();
        write(folder.path(), 3, 4, 1);
        assert_eq!(lines(folder.path()).len(), 1 + 4);
    }

    #[test]
    fn a_line_cut_short_is_dropped_even_if_its_number_is_right() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), 0, 3, 1);
        let path = folder.path().join("metrics.csv");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 4]).unwrap();
        assert_eq!(
            {
                write(folder.path(), 3, 3, 1);
                lines(folder.path()).len()
            },
            3
        );
    }

    #[test]
    fn a_new_run_begins_a_new_file() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), 0, 3, 1);
        write(folder.path(), 0, 0, 1);
        assert_eq!(lines(folder.path()), [HEADER]);
        std::fs::remove_file(folder.path().join("metrics.csv")).unwrap();
        write(folder.path(), 4, 5, 1);
        assert_eq!(
            lines(folder.path()).len(),
            2,
            "a lost file is no reason not to go on"
        );
        assert_eq!(
            [5, 4].map(|from| Metrics::open(folder.path(), from).unwrap().missing),
            [4, 4]
        );
    }

    #[test]
    fn metrics_are_read_by_the_names_of_their_columns() {
        let text =
            "generation,coverage,qd_score,obj_max,evaluations\n0,0.1,2,,20\n1,0.2,3,1.5,40\n";
        let moments = parsed(text).unwrap();
        assert_eq!((moments[0].obj_max, moments[1].obj_max), (None, Some(1.5)));
        assert_eq!(
            (
                moments[1].evaluations,
                moments[1].coverage,
                moments[1].qd_score
            ),
            (40.0, 0.2, 3.0)
        );
    }

    #[test]
    fn broken_metrics_are_refused_with_their_line() {
        let broken = |text: &str| parsed(text).unwrap_err().message;
        assert!(broken("generation,coverage\n").contains("found none"));
        assert!(broken("a,b\n1,2\n").contains("generation"));
        let columns = "generation,coverage,qd_score,obj_max,evaluations";
        assert!(broken(&format!("{columns}\n0,1,2,3,4\n1,1,x,3,4\n")).contains("line: 3"));
        assert!(broken(&format!("{columns}\n0,7.5,2,3,4\n")).contains("from 0 to 1, found 7.5"));
        assert!(broken(&format!("{columns}\n0,1,NaN,3,4\n")).contains("found NaN"));
        for reversed_or_doubled in ["1,1,2,3,4\n0,1,2,3,4\n", "0,1,2,3,4\n0,1,2,3,4\n"] {
            assert!(broken(&format!("{columns}\n{reversed_or_doubled}")).contains("in order"));
        }
    }
}
