//! The figure of a sweep: accuracy by the varied settings, a dot per seed.

use crate::analysis::sweep::SweepRow;
use crate::draw::colour;
use crate::draw::plot::axes::{AXIS, Axis, MARGIN, Plot, heading};
use crate::draw::plot::canvas::{Canvas, Pen, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::scales;
use crate::draw::plot::style::Style;

/// Height of a line, points.
const LINE: f64 = 10.5;
/// Room for the label of a line, points.
const MOST: f64 = 110.0;

/// Runs that differ only in the seed.
struct Line {
    about: String,
    /// Accuracy of each seed and its interval \[%\].
    dots: Vec<(f64, Option<[f64; 2]>)>,
}

/// Plots accuracy on held-out images by the varied settings: a dot per seed with its 95 % interval,
/// the mean of several seeds, a line per task. Returns `None` if no run was tested.
pub(crate) fn sweep(name: &str, rows: &[SweepRow], style: &Style) -> Option<Figure> {
    let mut lines: Vec<Line> = Vec::new();
    let mut images = None;
    for row in rows {
        let Some((run, tested)) = row
            .run
            .as_ref()
            .and_then(|run| Some((run, run.tested.as_ref()?)))
        else {
            continue;
        };
        images = Some((tested.images, tested.split));
        let about = about(row, &run.recognises);
        let dot = (
            100.0 * tested.accuracy,
            tested
                .interval
                .map(|interval| interval.map(|share| 100.0 * share)),
        );
        match lines.iter_mut().find(|line| line.about == about) {
            Some(line) => line.dots.push(dot),
            None => lines.push(Line {
                about,
                dots: vec![dot],
            }),
        }
    }
    let (images, split) = images?;
    let mut canvas = Canvas::new(style);
    let top = heading(
        &mut canvas,
        &format!("Accuracy on {images} {split} images"),
        name,
        style.column(),
    ) + 2.0;
    let names = lines
        .iter()
        .map(|line| style.font().width(&line.about, TEXT, false))
        .fold(0.0, f64::max)
        .min(MOST);
    let left = MARGIN + names + 5.0;
    let low =
        |(accuracy, interval): &(f64, Option<[f64; 2]>)| interval.map_or(*accuracy, |[low, _]| low);
    let lowest = lines
        .iter()
        .flat_map(|line| line.dots.iter().map(low))
        .fold(90.0, f64::min);
    let size = [
        style.column() - MARGIN - 8.0 - left,
        LINE * lines.len() as f64 + 4.0,
    ];
    let x = Axis::nice((lowest / 5.0).floor() * 5.0, 100.0, 5);
    let plot = Plot {
        at: [left, top],
        size,
        x,
        y: Axis::nice(0.0, 1.0, 1),
    };
    plot.grid(&mut canvas, false, true);
    let at = |value: f64| plot.place([value, 0.0])[0];
    for (number, line) in lines.iter().enumerate() {
        let y = top + 2.0 + LINE * (number as f64 + 0.5);
        canvas.fitted(
            [left - 4.0, y + 0.36 * TEXT],
            &line.about,
            MOST,
            TextStyle::end(),
        );
        for (accuracy, interval) in &line.dots {
            if let Some([low, high]) = interval {
                canvas.line([at(*low), y], [at(*high), y], Pen::new(scales::BLUE, 0.8));
            }
            canvas.dot([at(*accuracy), y], 2.0, scales::BLUE);
        }
        if line.dots.len() > 1 {
            let mean = at(line.dots.iter().map(|(accuracy, _)| accuracy).sum::<f64>()
                / line.dots.len() as f64);
            canvas.line(
                [mean, y - 4.0],
                [mean, y + 4.0],
                Pen::new(scales::VERMILLION, 1.2),
            );
        }
    }
    plot.lower_axis(&mut canvas, Some("accuracy [%]"));
    let mut height = top + size[1] + AXIS + MARGIN;
    if lines.iter().any(|line| line.dots.len() > 1) {
        height += 9.0;
        let words = TextStyle::default().colour(colour::FAINT);
        canvas.text(
            [MARGIN, height - MARGIN - 2.0],
            "dots: seeds, with 95 % intervals; bars: their mean",
            words,
        );
    }
    Some(Figure::new(
        &format!("Accuracy: {name}"),
        [style.column(), height],
        canvas,
    ))
}

/// Describes a run without its seed.
fn about(row: &SweepRow, recognises: &str) -> String {
    let word = |(key, value): &(String, String)| match key.as_str() {
        "seed" | "groups" => None,
        key => Some(format!("{}={value}", key.rsplit('.').next().unwrap_or(key))),
    };
    let words = row.varied.iter().filter_map(word);
    words
        .chain([recognises.to_string()])
        .collect::<Vec<_>>()
        .join(", ")
}
