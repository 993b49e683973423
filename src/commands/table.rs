//! The paper's table, with our results beside the paper's.

use crate::analysis::published;
use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::base::table;
use crate::baseline::curve::Crossing;
use crate::store::capacity::CapacityFile;
use crate::store::eval::EvalFile;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A row of the table: one task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TableRow {
    /// The task, as "0|1".
    pub(crate) task: String,
    pub(crate) robots: usize,
    /// Number of physical ones among them.
    pub(crate) physical: usize,
    /// Number of robots audited to find them.
    pub(crate) audited: usize,
    /// Their mean accuracy \[%\]; `None` without robots.
    pub(crate) accuracy: Option<f64>,
    /// Its standard deviation over the robots \[%\].
    pub(crate) deviation: Option<f64>,
    /// Its 95 % bootstrap interval \[%\].
    pub(crate) interval: Option<[f64; 2]>,
    /// Mean balanced accuracy \[%\].
    pub(crate) balanced_accuracy: Option<f64>,
    /// Accuracy of always answering the larger group \[%\].
    pub(crate) larger_group: Option<f64>,
    /// Capacity in neurons; `None` without a match.
    pub(crate) mlp: Option<Crossing>,
    /// Capacity in kernels; `None` without a match.
    pub(crate) cnn: Option<Crossing>,
    /// The 95 % intervals of both, as in `capacity.json`.
    #[serde(default)]
    pub(crate) mlp_interval: Option<[Option<f64>; 2]>,
    #[serde(default)]
    pub(crate) cnn_interval: Option<[Option<f64>; 2]>,
    /// The paper's accuracy \[%\].
    pub(crate) paper_accuracy: Option<f64>,
    /// The paper's capacity in neurons; `None` without a match.
    pub(crate) paper_mlp: Option<f64>,
    pub(crate) paper_cnn: Option<f64>,
}

impl TableRow {
    /// Returns a row with the paper's values only.
    pub(crate) fn new(dataset: &str, task: &str) -> Self {
        let paper = published::row(dataset, task);
        TableRow {
            task: task.to_string(),
            robots: 0,
            physical: 0,
            audited: 0,
            accuracy: None,
            deviation: None,
            interval: None,
            balanced_accuracy: None,
            larger_group: None,
            mlp: None,
            cnn: None,
            mlp_interval: None,
            cnn_interval: None,
            paper_accuracy: paper.map(|row| row.accuracy),
            paper_mlp: paper.and_then(|row| row.mlp),
            paper_cnn: paper.and_then(|row| row.cnn),
        }
    }

    pub(crate) fn fill(&mut self, report: &EvalFile, capacity: &CapacityFile) {
        if let Some(mean) = report.means.get(&self.task) {
            self.robots = mean.robots;
            self.accuracy = Some(100.0 * mean.accuracy);
            self.deviation = mean.standard_deviation.map(|share| 100.0 * share);
            self.interval = mean
                .interval
                .map(|shares| shares.map(|share| 100.0 * share));
            self.balanced_accuracy = Some(100.0 * mean.balanced_accuracy);
        }
        self.larger_group = report
            .baselines
            .get(&self.task)
            .map(|known| 100.0 * known.larger_group);
        let task = capacity.tasks.iter().find(|task| task.task == self.task);
        let curve = |network: &str| task?.curve(network);
        let (mlp, cnn) = (curve("mlp"), curve("cnn"));
        [self.mlp, self.cnn] = [mlp, cnn].map(|curve| curve?.capacity);
        [self.mlp_interval, self.cnn_interval] = [mlp, cnn].map(|curve| curve?.interval);
    }
}

/// Writes `reproduction.json` and `reproduction.csv` into a folder, and returns their paths.
pub(crate) fn write(folder: &Path, scale: f64, rows: &[TableRow]) -> Result<Vec<PathBuf>, Error> {
    let about = serde_json::json!({
        "format": "morphcog-reproduction", "format_version": 1, "program_version": env!("CARGO_PKG_VERSION"),
        "scale": scale, "rows": rows,
    });
    let json = folder.join("reproduction.json");
    write_file(&json, format!("{about:#}\n").as_bytes())?;
    let csv = folder.join("reproduction.csv");
    let about = [
        "task",
        "robots",
        "physical",
        "audited",
        "accuracy",
        "deviation",
    ];
    let shares = [
        "accuracy_low",
        "accuracy_high",
        "balanced_accuracy",
        "larger_group",
        "mlp",
        "cnn",
    ];
    let papers = ["paper_accuracy", "paper_mlp", "paper_cnn"];
    let ends = ["mlp_low", "mlp_high", "cnn_low", "cnn_high"];
    let fields = rows.iter().map(|row| {
        let [low, high] = row
            .interval
            .map_or([None, None], |interval| interval.map(Some));
        let size = |size: Option<Crossing>| match size {
            Some(Crossing::At(size)) => size.to_string(),
            Some(below) => below.to_string(),
            None => String::new(),
        };
        let about = (&row.task, row.robots, row.physical, row.audited);
        let shares = (
            row.accuracy,
            row.deviation,
            low,
            high,
            row.balanced_accuracy,
            row.larger_group,
        );
        let papers = (row.paper_accuracy, row.paper_mlp, row.paper_cnn);
        let ends = [row.mlp_interval, row.cnn_interval].map(Option::unwrap_or_default);
        (about, shares, [row.mlp, row.cnn].map(size), papers, ends)
    });
    write_file(
        &csv,
        &table::csv(
            about.into_iter().chain(shares).chain(papers).chain(ends),
            fields,
        ),
    )?;
    Ok(vec![json, csv])
}

fn write_file(path: &Path, content: &[u8]) -> Result<(), Error> {
    write_atomically(path, content).map_err(|error| Error::writing(path, &error))
}
