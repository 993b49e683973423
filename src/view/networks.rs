//! What `morphcog capacity` says at its end: the paper's table.

use super::console::{Console, Mode};
use super::{PictureError, plot, write_whole};
use crate::run::capacity_file::{CapacityFile, TaskCapacity};
use crate::run::published;
use crate::run::reproduce::Finished;
use std::path::{Path, PathBuf};

/// The table: task, accuracy and capacity, the paper's beside ours.
pub fn capacity(console: &Console, file: &CapacityFile, out: &Path) {
    if console.mode() == Mode::Json {
        let done = serde_json::json!({ "file": out.display().to_string(), "stopped": file.stopped, "tasks": file.tasks });
        return console.event("capacity", &done);
    }
    let size = |size: Option<f64>| size.map_or("no match".to_string(), |size| format!("{size:.1}"));
    let rows = file.tasks.iter().map(|task| {
        let paper = published::row(&file.dataset, &task.task);
        let own = |network: &str| own(task, network).map_or("–".to_string(), size);
        let theirs = |of: fn(&published::PaperRow) -> Option<f64>| {
            paper.map_or("–".to_string(), |row| size(of(row)))
        };
        vec![
            task.task.clone(),
            task.robots.to_string(),
            format!("{:.1}", 100.0 * task.accuracy),
            paper.map_or("–".to_string(), |row| format!("{:.1}", row.accuracy)),
            own("mlp"),
            theirs(|row| row.mlp),
            own("cnn"),
            theirs(|row| row.cnn),
        ]
    });
    let headers =
        ["task", "robots", "accuracy %", "paper's %", "MLP neurons", "paper's", "CNN kernels", "paper's"];
    console.table(&headers, &rows.collect::<Vec<_>>());
    console.line("");
    for task in &file.tasks {
        for curve in &task.curves {
            if let (Some(first), Some(last)) = (curve.points.first(), curve.points.last()) {
                console.line(&format!(
                    "{}: {}s of size {} reach {:.1} %, of size {} {:.1} % on average over {} trainings",
                    task.task,
                    curve.network.to_uppercase(),
                    first.size,
                    100.0 * first.mean,
                    last.size,
                    100.0 * last.mean,
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
    console.line(&format!("{}; early stopping waits on {waits}", file.selected));
    console.line(&format!("wrote {} and {}", out.display(), out.with_extension("csv").display()));
}

/// The figure beside a `capacity.json`, as SVG and as PNG; the files.
///
/// # Errors
/// If it cannot be made or written.
pub fn figure(file: &CapacityFile, out: &Path) -> Result<[PathBuf; 2], PictureError> {
    let figure = plot::capacity(file);
    let files = ["svg", "png"].map(|ending| out.with_extension(ending));
    write_whole(&files[0], figure.svg().as_bytes())?;
    write_whole(&files[1], &figure.png(plot::PRINT)?)?;
    Ok(files)
}

/// After a reproduction: the paper's table, the paper's figures beside ours.
pub fn table(console: &Console, finished: &Finished) {
    if console.mode() == Mode::Json {
        return console.event("reproduced", &finished.rows);
    }
    let number = |value: Option<f64>| value.map_or("–".to_string(), |value| format!("{value:.1}"));
    let size = |size: Option<f64>| size.map_or("no match".to_string(), |size| format!("{size:.1}"));
    let rows = finished.rows.iter().map(|row| {
        let own = |value: Option<f64>| if row.robots == 0 { "–".to_string() } else { size(value) };
        let paper =
            |value: Option<f64>| if row.paper_accuracy.is_none() { "–".to_string() } else { size(value) };
        vec![
            row.task.clone(),
            row.robots.to_string(),
            format!("{} of {}", row.physical, row.audited),
            number(row.accuracy),
            row.interval.map_or("–".to_string(), |[low, high]| format!("{low:.1}–{high:.1}")),
            number(row.paper_accuracy),
            number(row.balanced_accuracy),
            number(row.larger_group),
            own(row.mlp),
            paper(row.paper_mlp),
            own(row.cnn),
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
    let files: Vec<String> = finished.files.iter().map(|file| file.display().to_string()).collect();
    console.line(&format!("wrote {}", files.join(" and ")));
}

/// Of a kind of network, if it was trained: the capacity, if there is one.
fn own(task: &TaskCapacity, network: &str) -> Option<Option<f64>> {
    task.curves.iter().find(|curve| curve.network == network).map(|curve| curve.capacity)
}
