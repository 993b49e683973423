//! The results of `morphcog capacity`: the paper's table.

use crate::analysis::published;
use crate::base::number;
use crate::base::number::percent;
use crate::baseline::curve::Crossing;
use crate::cli::output::console::{Console, Mode};
use crate::commands::reproduce::ReproduceOutcome;
use crate::draw::error::PictureError;
use crate::draw::plot;
use crate::draw::plot::Style;
use crate::draw::report::tables::published_size;
use crate::store::capacity::{CapacityFile, Curve, TaskCapacity, spoken};
use crate::store::names::FigureFormat;
use std::path::{Path, PathBuf};

/// Writes the table: task, accuracy and capacity, with the paper's values beside ours. `out` is the
/// file, if it was written.
pub(crate) fn capacity(console: &Console, file: &CapacityFile, out: Option<&Path>) {
    if console.mode() == Mode::Json {
        let written = out
            .filter(|_| !file.tasks.is_empty())
            .map(|out| out.display().to_string());
        let done =
            serde_json::json!({ "file": written, "stopped": file.stopped, "tasks": file.tasks });
        return console.event("capacity", &done);
    }
    // Stopped before the first result: nothing was written.
    if file.tasks.is_empty() {
        return;
    }
    let rows = file
        .tasks
        .iter()
        .map(|task| (task.task.as_str(), task.robots, task.accuracy, Some(task)));
    papers_table(console, &file.dataset, rows);
    console.line("");
    for task in &file.tasks {
        for curve in &task.curves {
            if let (Some(first), Some(last)) = (curve.points.first(), curve.points.last()) {
                console.line(&format!(
                    "{}: {}s of size {} reach {} %, of size {} {} % on average over {} trainings",
                    task.task,
                    curve.network.to_uppercase(),
                    first.size,
                    percent(first.mean),
                    last.size,
                    percent(last.mean),
                    file.trainings
                ));
            }
        }
    }
    let waits = if file.patience_on == "test" {
        "the test images, as in the paper"
    } else {
        "images of the training split"
    };
    let physical = if file.physical_only {
        ", those found physical"
    } else {
        ""
    };
    console.line(&format!(
        "{}{physical}; early stopping waits on {waits}",
        file.selected
    ));
    if let Some(out) = out {
        console.line(&format!(
            "wrote {} and {}",
            out.display(),
            out.with_extension("csv").display()
        ));
    }
}

/// Writes the paper's table: each task with its robots, their accuracy (0 to 1) and their capacity
/// if known, with the paper's values beside them.
pub(super) fn papers_table<'a>(
    console: &Console,
    dataset: &str,
    tasks: impl Iterator<Item = (&'a str, usize, f64, Option<&'a TaskCapacity>)>,
) {
    let rows = tasks.map(|(task, robots, accuracy, capacity)| {
        let paper = published::row(dataset, task);
        let own = |network: &str| {
            capacity
                .and_then(|known| known.curve(network))
                .map_or_else(unknown, Curve::spoken)
        };
        let theirs = |of: fn(&published::PaperRow) -> Option<f64>| {
            paper.map_or_else(unknown, |row| published_size(of(row)))
        };
        vec![
            task.to_string(),
            robots.to_string(),
            percent(accuracy),
            paper.map_or_else(unknown, |row| number::fixed(row.accuracy, 1)),
            own("mlp"),
            theirs(|row| row.mlp),
            own("cnn"),
            theirs(|row| row.cnn),
        ]
    });
    let headers = [
        "task",
        "robots",
        "accuracy %",
        "paper's %",
        "MLP neurons",
        "paper's",
        "CNN kernels",
        "paper's",
    ];
    console.table(&headers, &rows.collect::<Vec<_>>());
}

/// Returns the table cell of a value that was not measured.
fn unknown() -> String {
    "–".to_string()
}

/// Writes the figure beside a `capacity.json`, one for each format; returns them.
pub(crate) fn figure(file: &CapacityFile, out: &Path) -> Result<[PathBuf; 3], PictureError> {
    let files = FigureFormat::beside(out);
    plot::capacity(file, &Style::default()).write(&files)?;
    Ok(files)
}

/// Writes the paper's table after a reproduction, with the paper's values beside ours.
pub(crate) fn table(console: &Console, finished: &ReproduceOutcome) {
    if console.mode() == Mode::Json {
        return console.event("reproduced", &finished.rows);
    }
    let number = |value: Option<f64>| value.map_or_else(unknown, |value| number::fixed(value, 1));
    let rows = finished.rows.iter().map(|row| {
        let own = |size: Option<Crossing>, interval: Option<[Option<f64>; 2]>| {
            if row.robots == 0 {
                unknown()
            } else {
                spoken(size, interval)
            }
        };
        let paper = |value: Option<f64>| match row.paper_accuracy {
            None => unknown(),
            Some(_) => published_size(value),
        };
        vec![
            row.task.clone(),
            row.robots.to_string(),
            format!("{} of {}", row.physical, row.audited),
            number(row.accuracy),
            row.interval.map_or_else(unknown, |[low, high]| {
                format!("{}–{}", number::fixed(low, 1), number::fixed(high, 1))
            }),
            number(row.paper_accuracy),
            number(row.balanced_accuracy),
            number(row.larger_group),
            own(row.mlp, row.mlp_interval),
            paper(row.paper_mlp),
            own(row.cnn, row.cnn_interval),
            paper(row.paper_cnn),
        ]
    });
    let headers = [
        "task",
        "robots",
        "physical of audited",
        "accuracy %",
        "95 % interval",
        "paper's %",
        "balanced %",
        "larger group %",
        "MLP neurons",
        "paper's",
        "CNN kernels",
        "paper's",
    ];
    console.table(&headers, &rows.collect::<Vec<_>>());
    if finished.files.is_empty() {
        return;
    }
    let files: Vec<String> = finished
        .files
        .iter()
        .map(|file| file.display().to_string())
        .collect();
    console.line(&format!("wrote {}", files.join(" and ")));
}
