//! The figure of an archive: fitness over muscle, sensor and total voxels.
//!
//! A map has a square for every pair of muscle and sensor bins, divided into strips by the bin of
//! the total. Cells that could hold an elite are framed; impossible ones stay blank.

use crate::body::Material;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::plot::axes::{Axis, MARGIN, colour_bar, heading};
use crate::draw::plot::canvas::{Canvas, Pen, Piece, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::style::Style;
use crate::draw::plot::svg::number;
use crate::draw::plot::{robot, scales};
use crate::qd::descriptor::{COUNT_BINS, DescriptorSpace, count_bin, possible_cells};
use crate::store::run::RunFile;
use std::collections::{BTreeMap, BTreeSet};

/// Space to the left of and below a map, points.
const LEFT: f64 = 30.0;
const BELOW: f64 = 24.0;
/// Caption of the strips.
const STRIPS: [&str; 2] = ["strips in a square:", "total voxels, few to many"];

/// Plots the fitness of the elites of a run, one map per task.
pub fn archive(run: &RunFile, style: &Style) -> Figure {
    let tasks = run.dimensions.tasks.len().max(1);
    let scale = Scale::of(run);
    let mut canvas = Canvas::new(style);
    let (columns, width) = match tasks {
        1 => (1, style.column()),
        _ => (style.panels(4), style.page()),
    };
    let of = format!(
        "{}, seed {}, generation {}; {} of {} cells",
        run.name,
        run.config.seed,
        run.generations,
        run.stats.num_elites,
        run.dimensions.possible_cells
    );
    let top = heading(&mut canvas, "Fitness of the elites", &of, width);
    let side = (width - 2.0 * MARGIN) / columns as f64 - LEFT - 4.0;
    let title = if tasks == 1 { 2.0 } else { 14.0 };
    let map_height = title + side + BELOW;
    let space = DescriptorSpace::voxel_counts(tasks);
    let possible: BTreeSet<Vec<usize>> = possible_cells(
        run.config.body.height * run.config.body.width,
        run.config.body.min_muscles,
        tasks,
    )
    .into_iter()
    .filter_map(|index| space.coordinates(index))
    .collect();
    let elites: BTreeMap<Vec<usize>, f64> = run
        .elites
        .iter()
        .map(|robot| (robot.cell.clone(), robot.objective))
        .collect();
    for task in 0..tasks {
        let (row, column) = (task / columns, task % columns);
        let x = MARGIN + LEFT + column as f64 * (side + LEFT + 4.0);
        let y = top + title + row as f64 * (map_height + 4.0);
        if tasks > 1 {
            canvas.fitted(
                [x, y - 4.0],
                &run.dimensions.tasks[task],
                side,
                TextStyle::default().bold(),
            );
        }
        let cell = |bins: [usize; 3]| {
            let mut cell = bins.to_vec();
            cell.extend((tasks > 1).then_some(task));
            possible.contains(&cell).then(|| elites.get(&cell).copied())
        };
        let is_first = column == 0;
        map(&mut canvas, [x, y], side, &cell, &scale);
        axes(&mut canvas, [x, y], side, run, is_first);
    }
    let rows = tasks.div_ceil(columns);
    let maps = top + rows as f64 * (map_height + 4.0);
    let height = if tasks == 1 {
        // A map's upper right half is empty: more muscles and sensors than voxels.
        legend(
            &mut canvas,
            [MARGIN + LEFT + 0.53 * side, top + 0.01 * side],
            0.44 * side,
            &scale,
            true,
        );
        canvas.text(
            [width / 2.0, maps + 3.0],
            &STRIPS.join(" "),
            TextStyle::middle().colour(colour::FAINT),
        );
        maps + 4.0
    } else if !tasks.is_multiple_of(columns) {
        let free = MARGIN + LEFT + (tasks % columns) as f64 * (side + LEFT + 4.0);
        legend(
            &mut canvas,
            [free, maps - map_height + 20.0],
            side,
            &scale,
            false,
        );
        maps
    } else {
        legend(
            &mut canvas,
            [MARGIN + LEFT, maps + 12.0],
            side,
            &scale,
            false,
        );
        maps + 78.0
    };
    Figure::new(&format!("Archive: {of}"), [width, height + MARGIN], canvas)
}

/// Maps fitness to colour: walkers that are right on the training images are coloured, others gray.
struct Scale {
    right: Axis,
    /// Lowest fitness, if some elite is below zero.
    lowest: Option<f64>,
    /// True if a possible cell has no elite.
    is_open: bool,
    /// The unit of fitness.
    unit: Option<&'static str>,
}

impl Scale {
    fn of(run: &RunFile) -> Self {
        let objectives = || run.elites.iter().map(|robot| robot.objective);
        let highest = objectives().fold(0.0, f64::max);
        let lowest = objectives().fold(0.0, f64::min);
        let highest = if highest > 0.0 { highest } else { 1.0 };
        Scale {
            right: Axis::nice(0.0, highest, 4),
            lowest: (lowest < 0.0).then_some(lowest),
            is_open: run.elites.len() < run.dimensions.possible_cells,
            unit: run.fitness().unit(),
        }
    }

    fn colour(&self, fitness: f64) -> Colour {
        match self.lowest {
            Some(lowest) if fitness < 0.0 => scales::below(1.0 - fitness / lowest),
            _ => scales::sequential(self.right.share(fitness)),
        }
    }
}

/// Draws one map. `cell` returns `None` where no elite is possible, `Some(None)` where one is
/// missing, or the elite's fitness.
fn map(
    canvas: &mut Canvas,
    [x, y]: [f64; 2],
    side: f64,
    cell: &impl Fn([usize; 3]) -> Option<Option<f64>>,
    scale: &Scale,
) {
    let step = side / COUNT_BINS as f64;
    let gap = 0.08 * step;
    let strip = (step - gap) / COUNT_BINS as f64;
    let (mut frames, mut strokes, mut paths) = (
        Vec::new(),
        Vec::new(),
        BTreeMap::<[u8; 3], Vec<Piece>>::new(),
    );
    for muscle in 0..COUNT_BINS {
        for sensor in 0..COUNT_BINS {
            let left = x + muscle as f64 * step + gap / 2.0;
            let top = y + side - (sensor + 1) as f64 * step + gap / 2.0;
            for total in 0..COUNT_BINS {
                let Some(elite) = cell([muscle, sensor, total]) else {
                    continue;
                };
                let (at, size) = ([left + total as f64 * strip, top], [strip, step - gap]);
                frames.push(Piece::Rectangle { at, size });
                if let Some(fitness) = elite {
                    paths
                        .entry(scale.colour(fitness).rgb)
                        .or_default()
                        .push(Piece::Rectangle { at, size });
                    if fitness < 0.0 {
                        strokes.push(stroke(at, size));
                    }
                }
            }
        }
    }
    canvas.area(frames.clone(), colour::PAPER);
    for (rgb, squares) in paths {
        canvas.area(squares, Colour { rgb, opacity: 255 });
    }
    canvas.path(frames, Pen::new(scales::CELL, 0.3));
    if !strokes.is_empty() {
        canvas.path(strokes, STROKE);
    }
}

/// The line through cells with fitness below 0: colour-blind viewers could take gray for a colour.
const STROKE: Pen = Pen {
    colour: colour::INK,
    width: 0.5,
    dashes: None,
};

fn stroke([x, y]: [f64; 2], [width, height]: [f64; 2]) -> Piece {
    Piece::Line(vec![[x, y + height], [x + width, y]])
}

/// Returns the voxel counts at which bins begin.
fn edges(area: usize) -> Vec<usize> {
    (0..COUNT_BINS)
        .filter_map(|bin| (0..=area).find(|&count| count_bin(count, area) == bin))
        .collect()
}

fn axes(canvas: &mut Canvas, [x, y]: [f64; 2], side: f64, run: &RunFile, is_first: bool) {
    let area = run.config.body.height * run.config.body.width;
    let step = side / COUNT_BINS as f64;
    let pen = Pen::new(colour::INK, 0.6);
    canvas.line([x, y + side], [x + side, y + side], pen);
    canvas.line([x, y], [x, y + side], pen);
    let every = if step < 18.0 { 2 } else { 1 };
    for (bin, edge) in edges(area).into_iter().enumerate() {
        let at = bin as f64 * step;
        canvas.line([x + at, y + side], [x + at, y + side + 2.5], pen);
        canvas.line([x - 2.5, y + side - at], [x, y + side - at], pen);
        if bin % every == 0 {
            canvas.text(
                [x + at, y + side + 10.0],
                &edge.to_string(),
                TextStyle::middle(),
            );
            canvas.text(
                [x - 4.5, y + side - at + 0.36 * TEXT],
                &edge.to_string(),
                TextStyle::end(),
            );
        }
    }
    canvas.text(
        [x + side / 2.0, y + side + 20.0],
        "muscle voxels",
        TextStyle::middle(),
    );
    if is_first {
        let words = TextStyle {
            upwards: true,
            ..TextStyle::middle()
        };
        canvas.text([x - LEFT + 8.0, y + side / 2.0], "sensor voxels", words);
    }
}

/// Draws the legend; `is_above` if it lies over a map, which leaves little room.
fn legend(canvas: &mut Canvas, [x, y]: [f64; 2], width: f64, scale: &Scale, is_above: bool) {
    let name = scale
        .unit
        .map_or("fitness".to_string(), |unit| format!("fitness [{unit}]"));
    let y = y + colour_bar(
        canvas,
        [x, y + 4.0],
        [width - 6.0, width],
        &scale.right,
        &name,
        |value| scale.colour(value),
    );
    let mut lines = Vec::new();
    if let Some(lowest) = scale.lowest {
        lines.push((
            scales::below(0.5),
            format!("below 0 (to {})", number(lowest).replace('-', "−")),
        ));
    }
    if scale.is_open {
        lines.push((colour::PAPER, "no elite".to_string()));
    }
    let lines = lines
        .iter()
        .map(|(fill, text)| (Material::Empty, *fill, text.as_str()));
    let below = robot::legend(canvas, [x, y + 26.0], lines, width);
    if scale.lowest.is_some() {
        canvas.path(vec![stroke([x, y + 26.0], [7.0, 7.0])], STROKE);
    }
    if !is_above {
        for (k, text) in STRIPS.into_iter().enumerate() {
            canvas.fitted(
                [x, below + 6.0 + 9.5 * k as f64],
                text,
                width + 10.0,
                TextStyle::default(),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_begin_where_the_descriptor_says() {
        assert_eq!(edges(196), [0, 28, 56, 84, 112, 140, 168]);
        assert_eq!(edges(25), [0, 3, 6, 9, 12, 15, 18]);
    }

    #[test]
    fn what_is_wrong_is_gray_and_what_is_right_is_not() {
        let scale = Scale {
            right: Axis::nice(0.0, 20.0, 4),
            lowest: Some(-10.0),
            is_open: true,
            unit: None,
        };
        assert_eq!(scale.colour(20.0), scales::sequential(1.0));
        assert_eq!(scale.colour(-10.0), scales::below(0.0));
        assert_ne!(scale.colour(-0.1), scale.colour(0.1));
    }
}
