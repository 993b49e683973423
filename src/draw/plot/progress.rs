//! The figure of a run's progress: QD score, coverage and best fitness over evaluations.

use crate::analysis::progress::{Progress, SettingsGroup, group_by_settings};
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::plot::axes::{AXIS, Axis, MARGIN, Plot, heading, left_space};
use crate::draw::plot::canvas::{Canvas, Pen, Piece, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::scales;
use crate::draw::plot::style::Style;
use crate::store::metrics::Moment;

/// Height of a panel, points.
const PANEL: f64 = 62.0;
/// Points of a curve: more would be invisible in a column at 150 pixels per inch.
const SAMPLES: usize = 400;

/// A panel: its name, its value at a moment, and its colour.
type Quantity = (&'static str, fn(&Moment) -> f64, Colour);

const QUANTITIES: [Quantity; 3] = [
    ("QD score", |moment| moment.qd_score, scales::BLUE),
    (
        "coverage [%]",
        |moment| 100.0 * moment.coverage,
        scales::GREEN,
    ),
    (
        "best fitness",
        |moment| moment.obj_max.unwrap_or(f64::NAN),
        scales::VERMILLION,
    ),
];

/// The maximum number of groups with a line in the legend: as many as look different.
const NAMED: usize = scales::SET.len() * DASHES.len();

/// Dashes of lines, and the gaps between them; the first is solid.
const DASHES: [Option<[f64; 2]>; 4] = [None, Some([4.0, 1.6]), Some([1.0, 1.6]), Some([2.5, 4.0])];

/// Plots the QD score, coverage and best fitness of runs over their evaluations. Runs that differ
/// only in the seed become one line, their median, in a band from the least to the largest value,
/// up to the end of the shortest. Other runs have lines and colours of their own.
pub(crate) fn progress(runs: &[Progress], style: &Style) -> Figure {
    let (_, groups) = group_by_settings(runs);
    let mut canvas = Canvas::new(style);
    let of = names(runs);
    let is_band = groups.iter().any(|group| group.runs.len() > 1);
    let title = if is_band {
        "Progress: median, least and largest"
    } else {
        "Progress"
    };
    let mut top = heading(&mut canvas, title, &of, style.column()) + 4.0;
    let ends: Vec<f64> = groups.iter().map(end).collect();
    let x = Axis::exact(0.0, ends.iter().copied().fold(1.0, f64::max), 4);
    let panels: Vec<(Quantity, Vec<Vec<Band>>, Axis)> = QUANTITIES
        .into_iter()
        .map(|quantity| {
            let of = |(group, end): (&SettingsGroup, &f64)| bands(&group.runs, quantity.1, *end);
            let bands: Vec<Vec<Band>> = groups.iter().zip(&ends).map(of).collect();
            let all = || bands.iter().flatten();
            let values = || {
                all()
                    .flat_map(|band| [band.low, band.high])
                    .filter(|v| v.is_finite())
            };
            let (low, high) = (
                values().fold(0.0, f64::min),
                values().fold(f64::NEG_INFINITY, f64::max),
            );
            (quantity, bands, Axis::nice(low, high, 4))
        })
        .collect();
    let labels = panels
        .iter()
        .map(|(_, _, y)| y.labels_width(style.font()))
        .fold(0.0, f64::max);
    let left = MARGIN + left_space(labels);
    let count = panels.len();
    for (k, ((name, _, colour), bands, y)) in panels.into_iter().enumerate() {
        let size = [style.column() - MARGIN - 8.0 - left, PANEL];
        let plot = Plot {
            at: [left, top],
            size,
            x: x.clone(),
            y,
        };
        plot.grid(&mut canvas, true, false);
        // The first on top: no nameless line hides a named one.
        for (number, (group, bands)) in groups.iter().zip(&bands).enumerate().rev() {
            let pen = if groups.len() > 1 {
                pen(number)
            } else {
                Pen::new(colour, 1.2)
            };
            draw(&mut canvas, &plot, bands, pen, group.runs.len() > 1);
        }
        plot.left_axis_beside(&mut canvas, name, labels);
        plot.lower_axis(&mut canvas, (k + 1 == count).then_some("evaluations"));
        top += PANEL + 9.0;
    }
    // Below the axis's name where there is no room beside it.
    let narrow = if style.column() < 220.0 { 10.0 } else { 0.0 };
    let mut height = top - 9.0 + AXIS + narrow + MARGIN;
    let note = TextStyle {
        size: TEXT,
        ..TextStyle::end()
    }
    .colour(colour::FAINT);
    if let Some(unit) = runs
        .first()
        .and_then(|run| run.unit)
        .filter(|unit| runs.iter().all(|run| run.unit == Some(unit)))
    {
        canvas.text(
            [style.column() - MARGIN, height - MARGIN - 2.0],
            &format!("fitness: {unit}"),
            note,
        );
    }
    if groups.len() > 1 {
        height = legend(&mut canvas, &groups, height + 2.0) + MARGIN;
    }
    Figure::new(&format!("Progress: {of}"), [style.column(), height], canvas)
}

/// Returns the evaluations that all runs of a group reach.
fn end(group: &SettingsGroup) -> f64 {
    let of = |run: &&Progress| run.moments.last().map_or(0.0, |moment| moment.evaluations);
    let shortest = group.runs.iter().map(of).fold(f64::INFINITY, f64::min);
    if shortest.is_finite() { shortest } else { 0.0 }
}

/// Returns the line style of a group or run: a colour, other dashes once the colours are used up, and gray
/// for groups without a name.
pub(super) fn pen(number: usize) -> Pen {
    let colour = scales::SET[number % scales::SET.len()];
    match DASHES.get(number / scales::SET.len()) {
        Some(dashes) => Pen {
            dashes: *dashes,
            ..Pen::new(colour, 1.1)
        },
        None => Pen::new(scales::CELL, 0.8),
    }
}

/// Draws the legend; returns the y below.
fn legend(canvas: &mut Canvas, groups: &[SettingsGroup], top: f64) -> f64 {
    let mut y = top;
    for (number, group) in groups.iter().enumerate().take(NAMED) {
        y += 10.0;
        canvas.line(
            [MARGIN + 4.0, y - 2.6],
            [MARGIN + 18.0, y - 2.6],
            pen(number),
        );
        let seeds = match group.runs.len() {
            1 => format!("seed {}", group.runs[0].seed),
            count => format!("{count} seeds"),
        };
        let text = format!("{} ({seeds})", group.label);
        let room = canvas.style().column() - 2.0 * MARGIN - 22.0;
        canvas.fitted([MARGIN + 22.0, y], &text, room, TextStyle::default());
    }
    if groups.len() > NAMED {
        y += 10.0;
        canvas.line(
            [MARGIN + 4.0, y - 2.6],
            [MARGIN + 18.0, y - 2.6],
            pen(NAMED),
        );
        let text = format!("and {} more", groups.len() - NAMED);
        canvas.text(
            [MARGIN + 22.0, y],
            &text,
            TextStyle::default().colour(colour::FAINT),
        );
    }
    y
}

/// Names the runs in a line: their names and seeds, each once.
fn names(runs: &[Progress]) -> String {
    let mut parts = Vec::<(String, Vec<String>)>::new();
    for run in runs {
        match parts.iter_mut().find(|(name, _)| *name == run.run) {
            Some((_, seeds)) if seeds.contains(&run.seed.to_string()) => {}
            Some((_, seeds)) => seeds.push(run.seed.to_string()),
            None => parts.push((run.run.clone(), vec![run.seed.to_string()])),
        }
    }
    let part = |(name, seeds): (String, Vec<String>)| {
        let word = if seeds.len() > 1 { "seeds" } else { "seed" };
        format!("{name}, {word} {}", seeds.join(", "))
    };
    parts.into_iter().map(part).collect::<Vec<_>>().join("; ")
}

/// The least, median and largest value at a number of evaluations.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Band {
    at: f64,
    low: f64,
    middle: f64,
    high: f64,
}

/// Returns the bands from the first moment that all runs have to `end`.
fn bands(runs: &[&Progress], quantity: fn(&Moment) -> f64, end: f64) -> Vec<Band> {
    let first = |run: &&Progress| run.moments.first().map_or(0.0, |moment| moment.evaluations);
    let start = runs.iter().map(first).fold(0.0, f64::max).min(end);
    let at = |k: usize| start + (end - start) * k as f64 / SAMPLES as f64;
    (0..=SAMPLES)
        .filter_map(|k| band(runs, quantity, at(k)))
        .collect()
}

fn band(runs: &[&Progress], quantity: fn(&Moment) -> f64, at: f64) -> Option<Band> {
    let value = |run: &&Progress| {
        let after = run
            .moments
            .partition_point(|moment| moment.evaluations <= at);
        run.moments.get(after.saturating_sub(1)).map(quantity)
    };
    let mut values: Vec<f64> = runs
        .iter()
        .filter_map(value)
        .filter(|v| v.is_finite())
        .collect();
    values.sort_by(f64::total_cmp);
    let (low, high) = (*values.first()?, *values.last()?);
    let half = values.len() / 2;
    let middle = if values.len() % 2 == 1 {
        values[half]
    } else {
        (values[half - 1] + values[half]) / 2.0
    };
    Some(Band {
        at,
        low,
        middle,
        high,
    })
}

fn draw(canvas: &mut Canvas, plot: &Plot, bands: &[Band], pen: Pen, is_band: bool) {
    let line = |of: fn(&Band) -> f64| {
        bands
            .iter()
            .map(|band| plot.place([band.at, of(band)]))
            .collect::<Vec<_>>()
    };
    if is_band && !bands.is_empty() {
        let mut edge = line(|band| band.low);
        edge.extend(line(|band| band.high).into_iter().rev());
        canvas.area(vec![Piece::Polygon(edge)], pen.colour.with_opacity(46));
    }
    canvas.polyline(&line(|band| band.middle), pen);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(seed: u64, best: &[Option<f64>]) -> Progress {
        let moment = |(k, best): (usize, &Option<f64>)| Moment {
            generation: k as u64,
            evaluations: 20.0 * (k + 1) as f64,
            coverage: 0.1,
            qd_score: 3.0,
            obj_max: *best,
            seconds: 0.0,
        };
        Progress {
            run: "toy".into(),
            seed,
            unit: None,
            moments: best.iter().enumerate().map(moment).collect(),
            settings: Default::default(),
            names: Default::default(),
        }
    }

    #[test]
    fn a_band_holds_the_runs_and_its_middle_is_their_median() {
        let runs = [
            run(1, &[None, Some(1.0)]),
            run(2, &[Some(2.0), Some(5.0)]),
            run(3, &[Some(4.0), Some(9.0)]),
        ];
        let best = QUANTITIES[2].1;
        let all: Vec<&Progress> = runs.iter().collect();
        assert_eq!(
            band(&all, best, 40.0),
            Some(Band {
                at: 40.0,
                low: 1.0,
                middle: 5.0,
                high: 9.0
            })
        );
        assert_eq!(band(&all, best, 39.9).unwrap().middle, 3.0);
        assert_eq!(band(&all[..1], best, 20.0), None);
        assert_eq!(names(&runs), "toy, seeds 1, 2, 3");
    }

    #[test]
    fn runs_of_other_settings_have_lines_and_names_of_their_own() {
        let of = |parents: i64| {
            let settings = [("map_elites.parents".to_string(), parents.into())]
                .into_iter()
                .collect();
            Progress {
                settings,
                ..run(1, &[Some(1.0), Some(2.0)])
            }
        };
        let runs: Vec<Progress> = (0..30).map(of).collect();
        let svg = progress(&runs[..2], &Style::default()).svg();
        assert!(svg.contains("parents=0 (seed 1)") && svg.contains("parents=1 (seed 1)"));
        assert!(
            progress(&runs, &Style::default())
                .svg()
                .contains("and 6 more")
        );
        assert!(
            !progress(&runs[..1], &Style::default())
                .svg()
                .contains("parents")
        );
        assert_eq!(names(&runs), "toy, seed 1");
    }

    #[test]
    fn lines_with_a_name_look_different() {
        let mut pens: Vec<String> = (0..=NAMED)
            .map(|number| format!("{:?}", pen(number)))
            .collect();
        pens.sort();
        pens.dedup();
        assert_eq!(pens.len(), 25);
        assert_eq!(pen(NAMED), pen(NAMED + 7));
    }

    #[test]
    fn runs_without_elites_or_of_one_generation_are_drawn() {
        for runs in [
            vec![run(1, &[None])],
            vec![run(1, &[None, None]), run(2, &[Some(1.0)])],
        ] {
            assert!(
                progress(&runs, &Style::default())
                    .svg()
                    .contains("evaluations")
            );
        }
    }
}
