//! `morphcog plot`: reads what figures are made of.

use super::Error;
use super::archive::RunFile;
use super::folder::METRICS;
use crate::base::files::read_text;
use serde::Deserialize;
use std::collections::BTreeSet;
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
    /// Stage of the curriculum, from 1.
    #[serde(default = "first_stage")]
    pub stage: usize,
}

fn first_stage() -> usize {
    1
}

/// How a run came along.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Name of the run.
    pub run: String,
    /// Its seed.
    pub seed: u64,
    /// The stage that is shown alone, from 1.
    pub stage: Option<usize>,
    /// What its fitness is measured in, if it is the same all the time.
    pub unit: Option<&'static str>,
    /// A moment per generation, at least one.
    pub moments: Vec<Moment>,
}

impl Progress {
    /// Reads the metrics.csv beside a run.json; of one stage alone, if that is wanted, with the evaluations from where it began.
    ///
    /// # Errors
    /// What is missing or wrong, with its line; if there is no such stage.
    pub fn of(run: &RunFile, archive: &Path, stage: Option<usize>) -> Result<Self, Error> {
        let path = archive.with_file_name(METRICS);
        let text = read_text(&path).map_err(|error| Error::reading(&path, &error))?;
        let within = |error: Error| error.within(&path.display().to_string());
        let mut moments = moments(&text).map_err(within)?;
        if let Some(stage) = stage {
            moments = alone(&moments, stage).map_err(within)?;
        }
        let periods = run.config.periods(run.generations);
        let shown = periods.filter(|period| stage.is_none_or(|stage| period.stage + 1 == stage));
        let units: BTreeSet<_> = shown.map(|period| run.config.criterion_in(period).fitness.unit()).collect();
        let unit = units.first().copied().flatten().filter(|_| units.len() == 1);
        Ok(Progress { run: run.name.clone(), seed: run.config.seed, stage, unit, moments })
    }
}

/// The moments of a stage, with the evaluations since the one before it ended.
fn alone(moments: &[Moment], stage: usize) -> Result<Vec<Moment>, Error> {
    let before = moments.iter().filter(|moment| moment.stage < stage).map(|moment| moment.evaluations);
    let before = before.fold(0.0, f64::max);
    let own = moments.iter().filter(|moment| moment.stage == stage);
    let own: Vec<Moment> =
        own.map(|moment| Moment { evaluations: moment.evaluations - before, ..*moment }).collect();
    match (own.is_empty(), moments.last()) {
        (true, Some(last)) => {
            let text = format!(
                "--stage {stage}: there is no generation of it; the last one is of stage {}",
                last.stage
            );
            Err(Error::input(text))
        }
        _ => Ok(own),
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
    fn a_stage_alone_counts_evaluations_from_its_beginning() {
        let head = "evaluations,coverage,qd_score,obj_max,stage\n";
        let all = moments(&format!("{head}20,0,0,1,1\n40,0,0,2,1\n55,0,0,0.5,2\n70,0,0,0.6,2\n")).unwrap();
        let of = |stage: usize| {
            alone(&all, stage).map(|own| own.iter().map(|m| m.evaluations).collect::<Vec<_>>())
        };
        assert_eq!((of(1).unwrap(), of(2).unwrap()), (vec![20.0, 40.0], vec![15.0, 30.0]));
        assert!(
            of(3)
                .unwrap_err()
                .message
                .contains("--stage 3: there is no generation of it; the last one is of stage 2")
        );
    }

    #[test]
    fn broken_metrics_are_refused_with_their_line() {
        let broken = |text: &str| moments(text).unwrap_err().message;
        assert!(broken("generation,coverage\n").contains("found none"));
        assert!(broken("a,b\n1,2\n").contains("evaluations"));
        assert!(broken("coverage,qd_score,obj_max,evaluations\n1,2,3,4\n1,x,3,4\n").contains("line: 3"));
    }
}
