//! The figure of a comparison: accuracies and their differences, curves of the archives, bodies.

use crate::analysis::comparison::{ComparedAccuracy, ComparedRun, Comparison};
use crate::base::number;
use crate::body::Body;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::plot::axes::{AXIS, Axis, MARGIN, Plot, heading_in_lines, left_space};
use crate::draw::plot::canvas::{Canvas, Pen, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::progress::pen;
use crate::draw::plot::robot;
use crate::draw::plot::style::Style;
use crate::store::metrics::Moment;
use std::ops::Range;

/// Height of a panel of curves, points.
const PANEL: f64 = 90.0;
/// Distance between the two panels of a row, points.
const GAP: f64 = 24.0;
/// Space for the half of a last number that stands beyond its axis, points.
const LABEL: f64 = 8.0;
/// Height of a line of accuracies, points.
const LINE: f64 = 11.0;
/// Largest width of the names of accuracies, points.
const NAMES: f64 = 150.0;
/// Most bodies beside each other.
const BODIES: usize = 6;
/// Largest side of a body, points.
const BODY: f64 = 74.0;
/// Height of the lines below a body, points.
const CAPTION: f64 = 42.0;
/// Points of a curve: more would be invisible.
const SAMPLES: usize = 400;

/// Plots runs side by side: the accuracies of their robots with 95 % intervals, the differences
/// from the first run's robot on the same images, QD score and coverage over the generations, and
/// the robots' bodies at one scale.
pub(crate) fn comparison(found: &Comparison, style: &Style) -> Figure {
    let (mut canvas, page) = (Canvas::new(style), style.page());
    let names: Vec<&str> = found.runs.iter().map(|run| run.name.as_str()).collect();
    let of = names.join("; ");
    let mut top = heading_in_lines(&mut canvas, "Comparison", &of, page, 2) + 4.0;
    if !found.accuracies.is_empty() {
        top = accuracies(&mut canvas, page, found, top) + 8.0;
    }
    if found.runs.iter().any(|run| run.curve.len() > 1) {
        top = curves(&mut canvas, page, &found.runs, top) + 10.0;
    }
    top = bodies(&mut canvas, page, &found.runs, top);
    if !found.accuracies.is_empty() {
        let at = [page - MARGIN, top];
        let note = "bars: 95 % intervals";
        canvas.text(at, note, TextStyle::end().colour(colour::FAINT));
    }
    Figure::new(&format!("Comparison: {of}"), [page, top + MARGIN], canvas)
}

/// Draws accuracies on the left, and differences from the first run on the right; returns the y
/// below.
fn accuracies(canvas: &mut Canvas, page: f64, found: &Comparison, top: f64) -> f64 {
    let all = &found.accuracies;
    let tasks: Vec<&str> = all.iter().map(|one| one.task.as_str()).collect();
    let is_of_tasks = tasks.iter().any(|task| *task != tasks[0]);
    let label = |one: &ComparedAccuracy| {
        let name = &found.runs[one.run].name;
        match is_of_tasks {
            true => format!("{name}, {}", one.task),
            false => name.clone(),
        }
    };
    let labels: Vec<String> = all.iter().map(label).collect();
    let widest = labels
        .iter()
        .map(|label| canvas.font().width(label, TEXT, false))
        .fold(0.0, f64::max)
        .min(NAMES);
    let left = MARGIN + widest + 14.0;
    let width = (page - MARGIN - LABEL - left - GAP) / 2.0;
    let height = LINE * all.len() as f64 + 4.0;
    let lowest = all.iter().map(|one| one.interval[0]).fold(0.9, f64::min);
    let is_paired = all.iter().any(|one| one.difference.is_some());
    let plot = Plot {
        at: [left, top],
        size: [if is_paired { width } else { 2.0 * width }, height],
        x: Axis::nice((20.0 * lowest).floor() * 5.0, 100.0, 4),
        y: Axis::nice(0.0, 1.0, 1),
    };
    plot.grid(canvas, false, true);
    let y_of = |number: usize| top + 2.0 + LINE * (number as f64 + 0.5);
    for (number, (one, label)) in all.iter().zip(&labels).enumerate() {
        let y = y_of(number);
        let at = [left - 6.0, y + 0.36 * TEXT];
        canvas.fitted(at, label, NAMES, TextStyle::end());
        interval(
            canvas,
            &plot,
            y,
            one.accuracy,
            one.interval,
            pen(one.run).colour,
        );
    }
    plot.lower_axis(canvas, Some("accuracy [%]"));
    if is_paired {
        let plot = differences(found, [left + width + GAP, top], [width, height]);
        plot.grid(canvas, false, true);
        let zero = plot.place([0.0, 0.0])[0];
        let line = Pen::new(colour::FAINT, 0.8);
        canvas.line([zero, top], [zero, top + height], line);
        for (number, one) in all.iter().enumerate() {
            let (y, colour) = (y_of(number), pen(one.run).colour);
            if let Some(found) = &one.difference {
                interval(canvas, &plot, y, found.mean, found.interval, colour);
            }
        }
        let first = format!("accuracy less that of {} [points]", found.runs[0].name);
        let most = width + GAP;
        plot.lower_axis(
            canvas,
            Some(&canvas.font().fitted(&first, TEXT, false, most)),
        );
    }
    top + height + AXIS
}

/// Returns the panel of differences, in percentage points.
fn differences(found: &Comparison, at: [f64; 2], size: [f64; 2]) -> Plot {
    let intervals = || {
        let all = found.accuracies.iter();
        all.filter_map(|one| one.difference.as_ref().map(|found| found.interval))
    };
    let low = intervals().map(|[low, _]| low).fold(-0.01, f64::min);
    let high = intervals().map(|[_, high]| high).fold(0.01, f64::max);
    Plot {
        at,
        size,
        x: Axis::nice(100.0 * low, 100.0 * high, 4),
        y: Axis::nice(0.0, 1.0, 1),
    }
}

/// Draws a share with its interval, in percent.
fn interval(
    canvas: &mut Canvas,
    plot: &Plot,
    y: f64,
    share: f64,
    [low, high]: [f64; 2],
    colour: Colour,
) {
    let at = |share: f64| plot.place([100.0 * share, 0.0])[0];
    canvas.line([at(low), y], [at(high), y], Pen::new(colour, 0.9));
    canvas.dot([at(share), y], 2.0, colour);
}

/// Draws QD score and coverage over the generations; returns the y below.
fn curves(canvas: &mut Canvas, page: f64, runs: &[ComparedRun], top: f64) -> f64 {
    type Quantity = (&'static str, fn(&Moment) -> f64);
    let quantities: [Quantity; 2] = [
        ("QD score", |moment| moment.qd_score),
        ("coverage [%]", |moment| 100.0 * moment.coverage),
    ];
    let last = runs.iter().filter_map(|run| run.curve.last());
    let generations = last.map(|moment| (moment.generation + 1) as f64);
    let x = Axis::exact(0.0, generations.fold(1.0, f64::max), 4);
    let half = (page - 2.0 * MARGIN - GAP) / 2.0;
    for (k, (name, of)) in quantities.into_iter().enumerate() {
        let values = || runs.iter().flat_map(|run| run.curve.iter().map(of));
        let (low, high) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
        let y = Axis::nice(low, high, 4);
        let space = left_space(y.labels_width(canvas.font()));
        let left = MARGIN + k as f64 * (half + GAP) + space;
        let plot = Plot {
            at: [left, top],
            size: [half - space - LABEL, PANEL],
            x: x.clone(),
            y,
        };
        plot.grid(canvas, true, false);
        // The first on top.
        for (number, run) in runs.iter().enumerate().rev() {
            let every = run.curve.len().div_ceil(SAMPLES).max(1);
            let end = run.curve.len().saturating_sub(1);
            let is_drawn = |place: &usize| place.is_multiple_of(every) || *place == end;
            let points = (0..run.curve.len()).filter(is_drawn).map(|place| {
                let moment = &run.curve[place];
                plot.place([(moment.generation + 1) as f64, of(moment)])
            });
            canvas.polyline(&points.collect::<Vec<_>>(), pen(number));
        }
        plot.left_axis(canvas, name);
        plot.lower_axis(canvas, Some("generation"));
    }
    top + PANEL + AXIS
}

/// Draws the runs' robots at one scale, with the lines of the curves; returns the y below.
fn bodies(canvas: &mut Canvas, page: f64, runs: &[ComparedRun], top: f64) -> f64 {
    let all = || runs.iter().filter_map(|run| run.robot.as_ref());
    let sides = all().map(|robot| robot.body.height().max(robot.body.width()));
    let cell = BODY / sides.max().unwrap_or(1).max(1) as f64;
    let heights = all().map(|robot| {
        let rows = filled_rows(&robot.body);
        rows.end - rows.start
    });
    let tallest = heights.max().unwrap_or(0);
    let width = (page - 2.0 * MARGIN) / BODIES as f64;
    let height = cell * tallest as f64 + CAPTION;
    for (number, run) in runs.iter().enumerate() {
        let left = MARGIN + width * (number % BODIES) as f64;
        let top = top + height * (number / BODIES) as f64;
        // They stand on one ground.
        let ground = top + cell * tallest as f64;
        if let Some(found) = &run.robot {
            let body = &found.body;
            let at = [left + 1.0, ground - cell * filled_rows(body).end as f64];
            let cells = || {
                let all = body.voxels().iter();
                all.map(|(place, material)| (place, *material))
                    .filter(|(_, material)| !material.is_empty())
            };
            let squares = cells().map(|(place, material)| (place, robot::plain(material)));
            robot::squares(canvas, at, cell, (0.05 * cell).min(0.5), squares);
            robot::marks(canvas, at, cell, cells(), robot::plain);
            let outline = Pen::new(colour::INK, 0.7);
            robot::body_outline(canvas, at, cell, body, outline);
        }
        let most = width - 6.0;
        let swatch = ground + 8.0;
        canvas.line([left + 1.0, swatch], [left + 13.0, swatch], pen(number));
        let name = [left + 16.0, ground + 10.5];
        canvas.fitted(name, &run.name, most - 16.0, TextStyle::default());
        let faint = TextStyle::default().colour(colour::FAINT);
        if let Some(robot) = &run.robot {
            let fitness = format!("fitness {}", number::fixed(robot.objective, 2));
            let lines = [format!("{} {}", robot.id, robot.task), fitness];
            for (line, y) in lines.iter().zip([20.0, 29.5]) {
                canvas.fitted([left + 1.0, ground + y], line, most, faint);
            }
        }
    }
    top + height * runs.len().div_ceil(BODIES) as f64
}

/// Returns the rows of a body's grid from its first voxel to its last.
fn filled_rows(body: &Body) -> Range<usize> {
    let rows = || {
        let cells = body.voxels().iter();
        cells
            .filter(|(_, material)| !material.is_empty())
            .map(|((row, _), _)| row)
    };
    rows().min().unwrap_or(0)..rows().max().map_or(0, |row| row + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::comparison::{Subject, compare};
    use crate::draw::plot::scales;
    use crate::store::samples;
    use std::path::PathBuf;

    #[test]
    fn any_number_of_runs_is_drawn_each_with_its_body() {
        let run = samples::run(&[("a", 1.5)]);
        for count in [2, 7, 30] {
            let paths: Vec<PathBuf> = (0..count)
                .map(|number| PathBuf::from(format!("run{number}/run.json")))
                .collect();
            let subjects: Vec<Subject> = paths
                .iter()
                .enumerate()
                .map(|(number, path)| Subject {
                    name: format!("run{number}"),
                    path,
                    run: &run,
                    progress: None,
                    robots: run.elites.iter().collect(),
                    tests: Vec::new(),
                })
                .collect();
            let svg = comparison(&compare(&subjects), &Style::default()).svg();
            roxmltree::Document::parse(&svg).unwrap();
            let last = format!(">run{}<", count - 1);
            assert!(svg.contains(&last) && !svg.contains("NaN"), "{count}");
            assert!(svg.contains(&scales::SET[0].hex()));
        }
    }
}
