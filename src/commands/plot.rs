//! `morphcog plot`: reads what figures are made of.

use crate::base::error::Error;
use crate::base::files::read_text;
use crate::store::names::METRICS;
use crate::store::run::RunFile;
use serde::Deserialize;
use std::path::Path;

/// A line of `metrics.csv`, as far as figures show it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Moment {
    /// Offspring made so far.
    pub evaluations: f64,
    /// Elites per possible cell.
    pub coverage: f64,
    /// Sum of the objectives, each less the offset.
    pub qd_score: f64,
    /// Largest objective; none without elites.
    pub obj_max: Option<f64>,
    /// Wall-clock time so far \[s\].
    #[serde(default)]
    pub seconds: f64,
}

/// How a run came along.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Name of the run.
    pub run: String,
    /// Its seed.
    pub seed: u64,
    /// What its fitness is measured in.
    pub unit: Option<&'static str>,
    /// A moment per generation, at least one.
    pub moments: Vec<Moment>,
}

impl Progress {
    /// Reads the metrics.csv beside a run.json.
    ///
    /// # Errors
    /// What is missing or wrong, with its line.
    pub fn of(run: &RunFile, archive: &Path) -> Result<Self, Error> {
        let path = archive.with_file_name(METRICS);
        let text = read_text(&path).map_err(|error| Error::reading(&path, &error))?;
        let within = |error: Error| error.within(&path.display().to_string());
        let moments = moments(&text).map_err(within)?;
        let unit = run.fitness().unit();
        Ok(Progress { run: run.name.clone(), seed: run.config.seed, unit, moments })
    }
}

fn moments(text: &str) -> Result<Vec<Moment>, Error> {
    let hint = || "morphcog evolve writes this file beside run.json".to_string();
    let mut moments = Vec::new();
    for line in csv::Reader::from_reader(text.as_bytes()).deserialize() {
        let moment: Moment = line.map_err(|error| Error::input(error.to_string()).hint(hint()))?;
        moments.push(moment);
    }
    match moments.is_empty() {
        true => Err(Error::input("expected a line per generation, found none".to_string()).hint(hint())),
        false => Ok(moments),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_are_read_by_the_names_of_their_columns() {
        let text = "generation,coverage,qd_score,obj_max,evaluations\n0,0.1,2,,20\n1,0.2,3,1.5,40\n";
        let moments = moments(text).unwrap();
        assert_eq!((moments[0].obj_max, moments[1].obj_max), (None, Some(1.5)));
        assert_eq!((moments[1].evaluations, moments[1].coverage, moments[1].qd_score), (40.0, 0.2, 3.0));
    }

    #[test]
    fn broken_metrics_are_refused_with_their_line() {
        let broken = |text: &str| moments(text).unwrap_err().message;
        assert!(broken("generation,coverage\n").contains("found none"));
        assert!(broken("a,b\n1,2\n").contains("evaluations"));
        assert!(broken("coverage,qd_score,obj_max,evaluations\n1,2,3,4\n1,x,3,4\n").contains("line: 3"));
    }
}
