//! The figure of an evaluation: accuracy per robot with its interval.

use crate::base::number;
use crate::draw::colour;
use crate::draw::plot::axes::{AXIS, Axis, MARGIN, Plot, heading_in_lines};
use crate::draw::plot::canvas::{Canvas, Pen, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::scales;
use crate::draw::plot::style::Style;
use crate::store::eval::{EvalFile, RobotReport};
use std::collections::BTreeSet;

/// Up to so many robots each have a line with a name; with more, lines are thin and nameless.
const NAMED: usize = 40;

/// Control steps per image of the paper's test, which a figure need not name.
const USUAL_STEPS: u32 = 500;

/// Plots the accuracy of every robot on test or validation images with its 95 % interval, a block
/// per task, with the mean and the baselines, which need no body.
pub(crate) fn accuracy(report: &EvalFile, style: &Style) -> Figure {
    let mut canvas = Canvas::new(style);
    let of = format!("{}; {}", runs(report), report.selection());
    let title = format!("Accuracy on {} images", report.split);
    let top = heading_in_lines(&mut canvas, &title, &of, style.column(), 3);
    let named = report.robots.len() <= NAMED;
    let line = if named { 10.5 } else { 3.0 };
    let mut tasks: Vec<&str> = report
        .robots
        .iter()
        .map(|robot| robot.task.as_str())
        .collect();
    tasks.sort_unstable();
    tasks.dedup();
    let block_head = if tasks.len() > 1 { 12.0 } else { 0.0 };
    let font = style.font();
    let name_width = |robot: &RobotReport| font.width(&name(report, robot), TEXT, false);
    let names = report
        .robots
        .iter()
        .map(name_width)
        .fold(0.0, f64::max)
        .min(80.0);
    let left = MARGIN + if named { names + 5.0 } else { 8.0 };
    let lowest = report
        .robots
        .iter()
        .map(|robot| robot.interval[0])
        .fold(0.5, f64::min);
    let axis = Axis::nice((100.0 * lowest / 10.0).floor() * 10.0, 100.0, 5);
    let all = tasks.len() as f64 * (block_head + 6.0) + line * report.robots.len() as f64;
    let size = [style.column() - MARGIN - 8.0 - left, all];
    let plot = Plot {
        at: [left, top],
        size,
        x: axis,
        y: Axis::nice(0.0, 1.0, 1),
    };
    plot.grid(&mut canvas, false, true);
    let mut y = top;
    for task in &tasks {
        if tasks.len() > 1 {
            canvas.fitted(
                [left + 3.0, y + 9.0],
                task,
                size[0] - 3.0,
                TextStyle::default().bold(),
            );
        }
        y += block_head + 3.0;
        let robots: Vec<&RobotReport> = report
            .robots
            .iter()
            .filter(|robot| robot.task == *task)
            .collect();
        let bottom = y + line * robots.len() as f64;
        lines(&mut canvas, &plot, report, task, [y - 2.0, bottom + 2.0]);
        for robot in robots {
            dot(&mut canvas, &plot, robot, y + line / 2.0, named);
            if named {
                let at = [left - 4.0, y + line / 2.0 + 0.36 * TEXT];
                canvas.fitted(at, &name(report, robot), 80.0, TextStyle::end());
            }
            y += line;
        }
        y += 3.0;
    }
    let images = report.robots.first().map_or(0, |robot| robot.images);
    let name = match report.control_steps {
        USUAL_STEPS => format!("accuracy on {images} {} images [%]", report.dataset),
        steps => format!(
            "accuracy on {images} {} images, {steps} steps each [%]",
            report.dataset
        ),
    };
    plot.lower_axis(&mut canvas, Some(&name));
    let below = top + all + AXIS + 4.0;
    let height = legend(&mut canvas, report, below) + MARGIN;
    Figure::new(&format!("Accuracy: {of}"), [style.column(), height], canvas)
}

/// Names the runs: name and seeds, or their number if they have several names.
fn runs(report: &EvalFile) -> String {
    let Some(seeds) = seeds(report) else {
        return format!("{} runs", report.runs.len());
    };
    let word = if seeds.len() > 1 { "seeds" } else { "seed" };
    let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
    format!("{}, {word} {}", report.run, seeds.join(", "))
}

/// Returns the seeds of the runs, or `None` if the runs have several names and seeds are ambiguous.
fn seeds(report: &EvalFile) -> Option<BTreeSet<u64>> {
    match report.runs.as_slice() {
        [] => Some(BTreeSet::from([report.run_seed])),
        runs if runs.iter().all(|run| run.name == report.run) => {
            Some(runs.iter().map(|run| run.seed).collect())
        }
        _ => None,
    }
}

/// Returns a robot's id, with the seed of its run if there are several seeds.
fn name(report: &EvalFile, robot: &RobotReport) -> String {
    let has_several = seeds(report).is_some_and(|seeds| seeds.len() > 1);
    match report.runs.get(robot.run).filter(|_| has_several) {
        Some(run) => format!("{} ({})", robot.id, run.seed),
        None if seeds(report).is_none() => match report.run_of(robot) {
            Some(run) => format!("{} ({run})", robot.id),
            None => robot.id.clone(),
        },
        None => robot.id.clone(),
    }
}

fn percent(share: f64) -> f64 {
    100.0 * share
}

fn dot(canvas: &mut Canvas, plot: &Plot, robot: &RobotReport, y: f64, named: bool) {
    let x = |share: f64| plot.place([percent(share), 0.0])[0];
    let [low, high] = robot.interval;
    let (width, radius) = if named { (1.1, 2.2) } else { (0.6, 1.0) };
    canvas.line([x(low), y], [x(high), y], Pen::new(scales::BLUE, width));
    canvas.dot([x(robot.accuracy), y], radius, scales::BLUE);
}

const MEAN: Pen = Pen {
    colour: scales::VERMILLION,
    width: 1.2,
    dashes: None,
};
/// Opacity of the interval around the mean.
const BAND: u8 = 46;
const LARGER: Pen = Pen {
    colour: colour::INK,
    width: 0.9,
    dashes: Some([3.0, 2.0]),
};
const PIXEL: Pen = Pen {
    colour: colour::INK,
    width: 0.9,
    dashes: Some([0.9, 1.6]),
};
const NEAREST: Pen = Pen {
    colour: colour::INK,
    width: 0.9,
    dashes: Some([7.0, 1.6]),
};

/// Draws the mean of a task's robots with its interval, and the baselines.
fn lines(canvas: &mut Canvas, plot: &Plot, report: &EvalFile, task: &str, [from, to]: [f64; 2]) {
    let x = |share: f64| plot.place([percent(share), 0.0])[0];
    if let Some(mean) = report.means.get(task) {
        if let Some([low, high]) = mean.interval {
            canvas.rectangle(
                [x(low), from],
                [x(high) - x(low), to - from],
                MEAN.colour.with_opacity(BAND),
            );
        }
        canvas.line([x(mean.accuracy), from], [x(mean.accuracy), to], MEAN);
    }
    if let Some(baselines) = report.baselines.get(task) {
        let known = [
            (baselines.larger_group, LARGER),
            (baselines.best_single_pixel, PIXEL),
        ];
        let nearest = baselines
            .nearest_training_image
            .map(|share| (share, NEAREST));
        for (share, pen) in known.into_iter().chain(nearest) {
            canvas.line([x(share), from], [x(share), to], pen);
        }
    }
}

/// Draws the legend in two columns; returns the y below.
fn legend(canvas: &mut Canvas, report: &EvalFile, top: f64) -> f64 {
    let value = |text: &str, share: Option<f64>| match share {
        Some(share) => format!("{text} {} %", number::fixed(percent(share), 1)),
        None => text.to_string(),
    };
    // With several tasks each has its own numbers, which the legend leaves out.
    let mean = report
        .means
        .values()
        .next()
        .filter(|_| report.means.len() == 1);
    let baselines = report
        .baselines
        .values()
        .next()
        .filter(|_| report.baselines.len() == 1);
    let has_interval = report.means.values().any(|mean| mean.interval.is_some());
    let interval = if has_interval { ", 95 % interval" } else { "" };
    let dot = Pen::new(scales::BLUE, 1.1);
    let mut lines = vec![
        (dot, "robot, 95 % interval".to_string()),
        (
            MEAN,
            value("mean", mean.map(|mean| mean.accuracy)) + interval,
        ),
        (
            LARGER,
            value("larger group", baselines.map(|b| b.larger_group)),
        ),
        (
            PIXEL,
            value("best pixel", baselines.map(|b| b.best_single_pixel)),
        ),
    ];
    // Unknown on another dataset than the runs'.
    if report
        .baselines
        .values()
        .any(|b| b.nearest_training_image.is_some())
    {
        lines.push((
            NEAREST,
            value(
                "nearest image",
                baselines.and_then(|b| b.nearest_training_image),
            ),
        ));
    }
    let column = (canvas.style().column() - 2.0 * MARGIN) / 2.0;
    for (k, (pen, text)) in lines.iter().enumerate() {
        let at = [
            MARGIN + 4.0 + (k % 2) as f64 * column,
            top + 6.0 + (k / 2) as f64 * 11.0,
        ];
        if k == 1 && has_interval {
            canvas.rectangle(
                [at[0], at[1] - 6.0],
                [14.0, 6.8],
                MEAN.colour.with_opacity(BAND),
            );
        }
        canvas.line([at[0], at[1] - 2.6], [at[0] + 14.0, at[1] - 2.6], *pen);
        if k == 0 {
            canvas.dot([at[0] + 7.0, at[1] - 2.6], 2.2, scales::BLUE);
        }
        canvas.fitted(
            [at[0] + 18.0, at[1]],
            text,
            column - 22.0,
            TextStyle::default(),
        );
    }
    top - 2.0 + 11.0 * lines.len().div_ceil(2) as f64
}
