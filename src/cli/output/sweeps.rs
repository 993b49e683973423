//! The results of `sweep` and `reproduce`.

use crate::analysis::progress::group_by_settings;
use crate::analysis::sweep::{Collected, Columns, SweepRow, csv};
use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::base::number;
use crate::base::number::percent;
use crate::base::text::counted;
use crate::base::text::duration;
use crate::cli::output::console::{Console, Mode};
use crate::commands::tasks::TaskStatus;
use crate::draw::plot;
use crate::draw::plot::{Figure, Style};
use crate::store::names::FigureFormat;
use crate::store::task::TaskState;
use serde::Serialize;
use serde_json::{Map, Value};
use std::path::Path;

/// Writes the status of tasks: a line per task, and the number in each state.
pub(crate) fn status(console: &Console, all: &[TaskStatus]) {
    if console.mode() == Mode::Json {
        return all.iter().for_each(|status| console.event("task", status));
    }
    let time = |seconds: Option<f64>| seconds.map_or("–".to_string(), duration);
    let row = |status: &TaskStatus| {
        let generations = status.generations.map(|[done, of]| format!("{done}/{of}"));
        vec![
            status.task.to_string(),
            status.name.clone(),
            status.state.name().to_string(),
            generations.unwrap_or("–".to_string()),
            time(status.seconds),
            if status.state == TaskState::Done {
                "–".to_string()
            } else {
                time(status.seconds_left)
            },
            status.about.clone().unwrap_or_default(),
        ]
    };
    let mut headers = vec!["task", "name", "state", "generations", "time", "left"];
    // Cells without a header are left out.
    headers.extend(
        all.iter()
            .any(|status| status.about.is_some())
            .then_some("about"),
    );
    console.table(&headers, &all.iter().map(row).collect::<Vec<_>>());
    console.line("");
    console.line(&in_short(all));
}

/// Counts the tasks in each state and estimates the remaining computing time.
fn in_short(all: &[TaskStatus]) -> String {
    let count = |state: TaskState| all.iter().filter(|status| status.state == state).count();
    let counts = TaskState::ALL.map(|state| (count(state), state.name()));
    let counts = counts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, name)| format!("{count} {name}"));
    let counts = counts.collect::<Vec<_>>().join(", ");
    let open = || all.iter().filter(|status| status.state != TaskState::Done);
    let left: Option<f64> = open().map(|status| status.seconds_left).sum();
    let left = match left {
        Some(left) if open().count() > 0 => format!("; about {} of task time left", duration(left)),
        _ => String::new(),
    };
    format!("{}: {counts}{left}", counted(all.len(), "task", "tasks"))
}

/// Writes the results of a sweep to files and to the console.
pub(crate) fn collected(
    console: &Console,
    name: &str,
    found: &Collected,
    status: &[TaskStatus],
    out: &Path,
) -> Result<(), Error> {
    let path = out.join("sweep.csv");
    std::fs::create_dir_all(out).map_err(|error| Error::writing(out, &error))?;
    write_atomically(&path, &csv(&found.rows)).map_err(|error| Error::writing(&path, &error))?;
    match console.mode() {
        Mode::Json => found
            .rows
            .iter()
            .for_each(|row| console.event("collected", &Event::of(row))),
        _ => table(console, &found.rows),
    }
    console.line("");
    console.line_about(&path, &format!("wrote {}", path.display()));
    let draw = |stem: &str, figure: Figure| -> Result<(), Error> {
        let paths = FigureFormat::ALL.map(|format| out.join(format!("{stem}.{}", format.ending())));
        figure.write(&paths)?;
        for path in paths {
            console.line_about(&path, &format!("wrote {}", path.display()));
        }
        Ok(())
    };
    if let Some(figure) = plot::sweep(name, &found.rows, &Style::default()) {
        draw("sweep-accuracy", figure)?;
    }
    if !found.progress.is_empty() {
        draw(
            "sweep-progress",
            plot::progress(&found.progress, &Style::default()),
        )?;
        differences(console, &found.progress);
    }
    let open = status
        .iter()
        .filter(|status| status.state != TaskState::Done)
        .count();
    if open > 0 {
        console.warning(&format!("this is not all: {}", in_short(status)));
    }
    Ok(())
}

/// A row for programs: the columns of `sweep.csv`, with the plan's values in one object.
#[derive(Serialize)]
struct Event<'a> {
    number: usize,
    name: &'a str,
    state: TaskState,
    varied: Map<String, Value>,
    #[serde(flatten)]
    run: Columns<'a>,
}

impl<'a> Event<'a> {
    fn of(row: &'a SweepRow) -> Self {
        // Values are stored as text; numbers become numbers here.
        let value = |text: &str| serde_json::from_str(text).unwrap_or_else(|_| Value::from(text));
        let varied = row
            .varied
            .iter()
            .map(|(key, text)| (key.clone(), value(text)))
            .collect();
        Event {
            number: row.number,
            name: &row.name,
            state: row.state,
            varied,
            run: Columns::of(row),
        }
    }
}

fn table(console: &Console, rows: &[SweepRow]) {
    let row = |row: &SweepRow| {
        let run = row.run.as_ref();
        let share = |share: Option<f64>| share.map_or("–".to_string(), percent);
        let tested = run.and_then(|run| run.tested.as_ref());
        let interval = tested.and_then(|tested| tested.interval);
        vec![
            row.number.to_string(),
            row.name.clone(),
            row.state.name().to_string(),
            run.map_or("–".to_string(), |run| run.recognises.clone()),
            run.and_then(|run| run.obj_max)
                .map_or("–".to_string(), |best| number::fixed(best, 2)),
            share(run.and_then(|run| run.validation)),
            run.and_then(|run| run.audited)
                .map_or("–".to_string(), |[all, good]| format!("{good} of {all}")),
            share(tested.map(|tested| tested.accuracy)),
            interval.map_or("–".to_string(), |[low, high]| {
                format!("{}–{}", percent(low), percent(high))
            }),
        ]
    };
    let headers = [
        "task",
        "name",
        "state",
        "classes",
        "fitness",
        "validation %",
        "physical",
        "accuracy %",
        "95 % interval",
    ];
    console.table(&headers, &rows.iter().map(row).collect::<Vec<_>>());
}

/// Writes the keys in which runs differ, a line per group that differs only in the seed.
pub(crate) fn differences(console: &Console, runs: &[crate::analysis::progress::Progress]) {
    let (keys, groups) = group_by_settings(runs);
    if groups.len() < 2 || console.mode() != Mode::Human {
        return;
    }
    console.line("");
    let headers: Vec<&str> = ["line", "runs"]
        .into_iter()
        .chain(keys.iter().map(String::as_str))
        .collect();
    let row = |(number, group): (usize, &crate::analysis::progress::SettingsGroup)| {
        let values = group
            .values
            .iter()
            .map(|value| value.clone().unwrap_or("–".to_string()));
        [number.to_string(), group.runs.len().to_string()]
            .into_iter()
            .chain(values)
            .collect::<Vec<_>>()
    };
    console.table(&headers, &(1..).zip(&groups).map(row).collect::<Vec<_>>());
}
