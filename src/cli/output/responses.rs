//! The results of `morphcog response`.

use crate::base::number;
use crate::base::number::percent;
use crate::cli::output::console::{Console, Mode};
use crate::commands::response::ResponseOutcome;
use crate::store::response::{EndedBy, RobotResponse};
use std::path::Path;

/// Writes the results of a measurement, a line per robot.
pub(crate) fn response(console: &Console, finished: &ResponseOutcome, out: &Path) {
    let ResponseOutcome {
        file,
        stopped,
        unwritten,
        ..
    } = finished;
    let written = unwritten.is_none() && !file.robots.is_empty();
    if console.mode() == Mode::Json {
        let done = serde_json::json!({
            "file": written.then(|| out.display().to_string()), "stopped": stopped, "run": file.run,
            "setting": file.setting,
            "robots": file.robots,
        });
        return console.event("responses", &done);
    }
    if file.robots.is_empty() {
        return;
    }
    let mut headers = vec![
        "robot",
        "places",
        "certain",
        "explained %",
        "scatter",
        "relative error",
    ];
    headers.extend(["at no width", "rollouts", "unstable", "ended by"]);
    let (fitness, accuracy) = match &file.setting.task {
        Some(task) => (format!("fitness of {task}"), format!("% correct of {task}")),
        None => Default::default(),
    };
    if file.setting.task.is_some() {
        headers.extend([fitness.as_str(), accuracy.as_str()]);
    }
    if file.setting.windows > 0 {
        headers.push("stimulus.margin");
    }
    let is_taught = file.setting.task.is_some();
    let rows = file
        .robots
        .iter()
        .map(|robot| row(robot, is_taught, file.setting.windows > 0));
    console.table(&headers, &rows.collect::<Vec<_>>());
    let count = file.setting.conditions.len();
    console.line(&format!(
        "{count} conditions (start, length limits); voxel lengths, right positive"
    ));
    if written {
        console.line(&format!(
            "wrote {} and {}",
            out.display(),
            out.with_extension("csv").display()
        ));
    }
}

fn row(robot: &RobotResponse, is_taught: bool, has_window: bool) -> Vec<String> {
    let certain = robot
        .places
        .iter()
        .filter(|place| !place.is_uncertain())
        .count();
    let known = robot.intercepts.iter().flatten();
    let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &d| {
        (low.min(d), high.max(d))
    });
    let signed = |displacement: f64| number::signed(displacement, 1);
    let mut row = vec![
        robot.id.clone(),
        robot.places.len().to_string(),
        certain.to_string(),
        percent(robot.r_squared.max(0.0)),
        number::fixed(robot.scatter, 1),
        number::fixed(robot.relative_error, 2),
        format!(
            "{} ({} to {})",
            signed(robot.intercept),
            signed(low),
            signed(high)
        ),
        robot.rollouts.to_string(),
        robot.unstable.to_string(),
        match robot.ended_by {
            EndedBy::Error => "--error".to_string(),
            EndedBy::Images => "--images".to_string(),
        },
    ];
    if is_taught {
        row.extend(match &robot.taught {
            None => ["–".to_string(), "–".to_string()],
            Some(taught) => {
                let [low, high] = taught.fitness_interval.map(|end| number::fixed(end, 2));
                let fitness = format!("{} ({low} to {high})", number::fixed(taught.fitness, 2));
                let [low, high] = taught.accuracy_interval.map(percent);
                [
                    fitness,
                    format!("{} ({low} to {high})", percent(taught.accuracy)),
                ]
            }
        });
    }
    if has_window {
        let margin = robot.taught.and_then(|taught| taught.margin);
        row.push(margin.map_or("–".to_string(), |margin| margin.to_string()));
    }
    row
}
