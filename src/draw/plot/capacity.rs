//! The figure of the morphological cognition capacity: the accuracy of networks over their size,
//! and the robots' accuracy.

use crate::baseline::curve::Crossing;
use crate::draw::colour;
use crate::draw::plot::axes::{AXIS, Axis, MARGIN, Plot, heading, left_space};
use crate::draw::plot::canvas::{Anchor, Canvas, Pen, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::scales;
use crate::draw::plot::style::Style;
use crate::store::capacity::{CapacityFile, Curve, Point, TaskCapacity};

/// Height of a panel, points.
const PANEL: f64 = 104.0;
/// Segments of the fitted curve.
const SEGMENTS: u32 = 60;
const ROBOTS: Pen = Pen {
    colour: scales::VERMILLION,
    width: 1.1,
    dashes: None,
};
const FIT: Pen = Pen {
    colour: colour::INK,
    width: 0.9,
    dashes: None,
};
const CROSSING: Pen = Pen {
    colour: scales::VERMILLION,
    width: 0.9,
    dashes: Some([2.5, 1.8]),
};

/// Plots the mean accuracy of networks over their size with its standard deviation, the quadratic
/// fit, the robots' accuracy and where the two meet; a panel per task and kind of network.
pub(crate) fn capacity(file: &CapacityFile, style: &Style) -> Figure {
    let panels: Vec<(&TaskCapacity, &Curve)> = file
        .tasks
        .iter()
        .flat_map(|task| task.curves.iter().map(move |curve| (task, curve)))
        .collect();
    let (columns, width) = if panels.len() <= 1 {
        (1, style.column())
    } else {
        (style.panels(2), style.page())
    };
    let mut canvas = Canvas::new(style);
    let stopped = if file.stopped {
        "; stopped before the end"
    } else {
        ""
    };
    let of = format!("{}; {}; {}{stopped}", file.run, file.selected, file.dataset);
    let top = heading(&mut canvas, "Morphological cognition capacity", &of, width);
    let y = accuracies(&panels);
    let space = left_space(y.labels_width(style.font()));
    let wide = (width - 2.0 * MARGIN) / columns as f64;
    let high = 14.0 + PANEL + AXIS + 6.0;
    for (k, (task, curve)) in panels.iter().enumerate() {
        let (row, column) = (k / columns, k % columns);
        let at = [
            MARGIN + column as f64 * wide + space,
            top + 14.0 + row as f64 * high,
        ];
        panel(
            &mut canvas,
            at,
            [wide - space - 12.0, PANEL],
            &y,
            task,
            curve,
        );
    }
    let below = top + panels.len().div_ceil(columns) as f64 * high;
    let height = legend(&mut canvas, file.trainings, [MARGIN + 4.0, below], width) + MARGIN;
    Figure::new(
        &format!("Morphological cognition capacity: {of}"),
        [width, height],
        canvas,
    )
}

/// Returns one axis for all panels, so that they are comparable.
fn accuracies(panels: &[(&TaskCapacity, &Curve)]) -> Axis {
    let values = panels.iter().flat_map(|(task, curve)| {
        let points = curve.points.iter();
        points.flat_map(bar).chain([task.accuracy])
    });
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((0.5f64, 0.6f64), |(l, h), v| (l.min(v), h.max(v)));
    Axis::nice(100.0 * low.max(0.0), 100.0 * high.min(1.0), 5)
}

/// Returns a point's mean minus and plus its standard deviation, which is 0 if it is unknown.
fn bar(point: &Point) -> [f64; 2] {
    let deviation = point.standard_deviation.unwrap_or(0.0);
    [point.mean - deviation, point.mean + deviation]
}

fn network(curve: &Curve) -> (&str, &str) {
    match curve.network.as_str() {
        "mlp" => ("MLP", "hidden neurons"),
        "cnn" => ("CNN", "kernels"),
        other => (other, "size"),
    }
}

fn panel(
    canvas: &mut Canvas,
    at: [f64; 2],
    size: [f64; 2],
    y: &Axis,
    task: &TaskCapacity,
    curve: &Curve,
) {
    let sizes = || curve.points.iter().map(|point| point.size as f64);
    let largest = sizes().fold(1.0, f64::max);
    let plot = Plot {
        at,
        size,
        x: Axis::exact(0.0, largest + 1.0, 5).whole(),
        y: y.clone(),
    };
    let (kind, unit) = network(curve);
    // If the smallest size already exceeds the robots, nothing crosses.
    let (found, crossing) = match curve.capacity {
        Some(below @ Crossing::Below { .. }) => (
            format!("capacity {below}: the curve begins above the robots"),
            None,
        ),
        Some(Crossing::At(size)) => (format!("capacity {} {unit}", curve.spoken()), Some(size)),
        None => (
            "no capacity: the curve never reaches the robots".to_string(),
            None,
        ),
    };
    // Half of the room is for the words beside the title.
    let bold = TextStyle::default().bold();
    let title = canvas
        .font()
        .fitted(&task.task, bold.size, true, 0.4 * size[0]);
    let title = format!("{title}, {kind}");
    canvas.text([at[0], at[1] - 5.0], &title, bold);
    let left = canvas.font().width(&title, bold.size, true) + 6.0;
    canvas.fitted(
        [at[0] + left, at[1] - 5.0],
        &found,
        size[0] - left,
        TextStyle::default(),
    );
    plot.grid(canvas, true, false);
    canvas.clipped(at, size, |canvas| {
        for point in &curve.points {
            let place = |accuracy: f64| plot.place([point.size as f64, 100.0 * accuracy]);
            let [low, high] = bar(point);
            canvas.line(
                place(low),
                place(high),
                Pen::new(scales::BLUE.with_opacity(120), 0.8),
            );
            canvas.dot(place(point.mean), 1.4, scales::BLUE);
        }
        if let (Some([c0, c1, c2]), Some(first)) = (curve.fit, curve.points.first()) {
            let first = first.size as f64;
            let at = |k: u32| first + (largest - first) * f64::from(k) / f64::from(SEGMENTS);
            let fit = |size: f64| plot.place([size, 100.0 * (c0 + c1 * size + c2 * size * size)]);
            canvas.polyline(&(0..=SEGMENTS).map(|k| fit(at(k))).collect::<Vec<_>>(), FIT);
        }
        let robots = 100.0 * task.accuracy;
        canvas.line(
            plot.place([plot.x.from, robots]),
            plot.place([plot.x.to, robots]),
            ROBOTS,
        );
        if let Some(capacity) = crossing {
            canvas.line(
                plot.place([capacity, robots]),
                plot.place([capacity, plot.y.from]),
                CROSSING,
            );
            canvas.dot(plot.place([capacity, robots]), 2.2, scales::VERMILLION);
        }
    });
    plot.left_axis(canvas, "test accuracy [%]");
    plot.lower_axis(canvas, Some(unit));
}

/// Draws the legend; returns the y below.
fn legend(canvas: &mut Canvas, trainings: usize, [x, top]: [f64; 2], width: f64) -> f64 {
    let lines = [
        (
            Pen::new(scales::BLUE.with_opacity(120), 0.8),
            format!("mean ± sd of {trainings} trainings"),
        ),
        (FIT, "fit of degree two".to_string()),
        (ROBOTS, "robots' mean".to_string()),
        (CROSSING, "capacity".to_string()),
    ];
    let [mut at, mut y] = [x, top + 6.0];
    for (k, (pen, text)) in lines.iter().enumerate() {
        let words = TextStyle {
            anchor: Anchor::Start,
            ..TextStyle::default()
        };
        let wide = 17.0 + canvas.font().width(text, words.size, false) + 12.0;
        if at > x && at + wide > width - MARGIN {
            (at, y) = (x, y + 11.0);
        }
        canvas.line([at, y - 2.6], [at + 13.0, y - 2.6], *pen);
        if k == 0 {
            canvas.dot([at + 6.5, y - 2.6], 1.4, scales::BLUE);
        }
        canvas.text([at + 17.0, y], text, words);
        at += wide;
    }
    y + 5.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::capacity::Point;

    fn file(capacity: Option<Crossing>) -> CapacityFile {
        let point = |size: usize| Point {
            size,
            mean: 0.55 + 0.005 * size as f64,
            standard_deviation: Some(0.05),
            parameters: 3 * size,
        };
        let curve = |network: &str| Curve {
            network: network.into(),
            points: (1..=45).map(point).collect(),
            fit: Some([0.55, 0.005, 0.0]),
            capacity,
            interval: capacity.map(|_| [Some(14.2), Some(20.9)]),
        };
        let task = |name: &str| TaskCapacity {
            task: name.into(),
            robots: 10,
            accuracy: 0.634,
            curves: vec![curve("mlp"), curve("cnn")],
        };
        CapacityFile {
            format: "morphcog-capacity".into(),
            format_version: 1,
            program_version: "0".into(),
            run: "toy".into(),
            eval_sha256: None,
            selected: "all".into(),
            dataset: "mnist".into(),
            patience_on: "test".into(),
            trainings: 50,
            physical_only: false,
            stopped: false,
            tasks: vec![task("0|1"), task("01|23")],
        }
    }

    #[test]
    fn every_task_and_network_has_a_panel_with_its_capacity() {
        let svg = capacity(&file(Some(Crossing::At(16.8))), &Style::default()).svg();
        assert_eq!(svg.matches("capacity 17 (14–21)").count(), 4);
        assert!(
            svg.contains("01|23, CNN") && svg.contains("hidden neurons") && svg.contains("kernels")
        );
        assert!(
            capacity(&file(None), &Style::default())
                .svg()
                .contains("never reaches")
        );
        // The robots are worse than any network: nothing crosses, so nothing is marked.
        let mut below = file(Some(Crossing::Below { below: 1.0 }));
        below.tasks.iter_mut().for_each(|task| task.accuracy = 0.3);
        let below = capacity(&below, &Style::default()).svg();
        assert!(
            below.contains("capacity &lt; 1: the curve begins above")
                && !below.contains("capacity 1")
        );
        assert_eq!(
            below.matches("<circle").count(),
            svg.matches("<circle").count() - 4
        );
    }

    #[test]
    fn files_without_tasks_points_or_fits_are_drawn() {
        let mut empty = file(None);
        empty.tasks[0].curves[0].points.clear();
        empty.tasks[0].curves[1].fit = None;
        empty.tasks.truncate(1);
        assert!(
            capacity(&empty, &Style::default())
                .svg()
                .contains("0|1, CNN")
        );
        empty.tasks.clear();
        assert!(capacity(&empty, &Style::default()).png(72).is_ok());
    }
}
