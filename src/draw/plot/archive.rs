//! The figure of an archive: fitness over muscle, sensor and total voxels.

use crate::base::number;
use crate::body::Material;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::fonts::Font;
use crate::draw::plot::axes::{Axis, MARGIN, colour_bar, heading};
use crate::draw::plot::canvas::{Canvas, Pen, Piece, TEXT, TextStyle};
use crate::draw::plot::cells::{Cell, CellMap, Panel, TaskMap, colour as colour_of};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::style::Style;
use crate::draw::plot::{robot, scales};
use crate::store::run::RunFile;
use std::collections::BTreeMap;

/// Gap between panels, points, and the space for the axes of the last one.
const GAP: f64 = 5.0;
const LEFT: f64 = 27.0;
const BELOW: f64 = 21.0;
/// Space above a panel for the number of voxels, points.
const ABOVE: f64 = 9.5;
/// Space above a map for the name of its task, points.
const NAME: f64 = 11.0;
/// Smallest and largest side of a cell, points.
const SIDES: [f64; 2] = [3.0, 9.5];
/// Width and height of the legend beside the panels, points.
const LEGEND: [f64; 2] = [80.0, 76.0];

/// Plots the fitness of the elites of a run: a map per task, with a panel per bin of total voxels.
pub fn archive(run: &RunFile, style: &Style) -> Figure {
    let map = CellMap::of(run);
    let is_single = map.tasks.len() == 1;
    let (columns, width) = match is_single {
        true => (1, style.column()),
        false => (style.panels(2), style.page()),
    };
    let of = format!(
        "{}, seed {}, generation {}; {} of {} cells",
        run.called(),
        run.config.seed,
        run.generations,
        run.stats.num_elites,
        run.dimensions.possible_cells
    );
    let mut canvas = Canvas::new(style);
    let top = heading(&mut canvas, "Fitness of the elites", &of, width) + 2.0;
    let room = (width - 2.0 * MARGIN + GAP) / columns as f64 - GAP;
    // A single map leaves room for the legend beside its last panels.
    let lines = if is_single { 2 } else { 1 };
    let layout = Layout::new(&map.tasks[0].panels, style.font(), room, lines);
    let above = if is_single { 0.0 } else { NAME };
    let pitch = above + layout.height + 4.0;
    let place = |number: usize| {
        let (row, column) = (number / columns, number % columns);
        [
            MARGIN + column as f64 * (room + GAP),
            top + row as f64 * pitch,
        ]
    };
    for (number, task) in map.tasks.iter().enumerate() {
        let [x, y] = place(number);
        if !is_single {
            let scale = match task.has_own_scale {
                true => format!(
                    ", a scale of its own: 0 to {}",
                    number::fixed(task.highest, 1)
                ),
                false => String::new(),
            };
            let name = format!("{}{scale}", task.name);
            canvas.fitted([x, y + TEXT], &name, room, TextStyle::default().bold());
        }
        layout.draw(&mut canvas, [x, y + above], task, &map);
    }
    let below = top + map.tasks.len().div_ceil(columns) as f64 * pitch;
    let (at, height) = if is_single {
        let [x, y] = layout.free;
        ([MARGIN + x, top + y], below.max(top + y + LEGEND[1]))
    } else if map.tasks.len().is_multiple_of(columns) {
        ([MARGIN + GAP, below + 6.0], below + LEGEND[1])
    } else {
        let [x, y] = place(map.tasks.len());
        ([x + GAP, y + above + 6.0], below.max(y + above + LEGEND[1]))
    };
    legend(&mut canvas, at, &map);
    Figure::new(&format!("Archive: {of}"), [width, height + MARGIN], canvas)
}

/// The places of a task's panels: in lines from left to right, each line on a common ground.
struct Layout {
    /// Side of a cell, points.
    cell: f64,
    /// Left lower corners of the panels, points from the map's left upper corner.
    corners: Vec<[f64; 2]>,
    height: f64,
    /// Left upper corner of the free space behind the last panel.
    free: [f64; 2],
}

impl Layout {
    /// Lays panels out in at most so many lines, with cells as large as possible; in more lines
    /// where the smallest ones do not fit.
    fn new(panels: &[Panel], font: &Font, room: f64, lines: usize) -> Self {
        let [least, most] = SIDES;
        let mut cell = most;
        loop {
            let (layout, count) = Layout::with_cells(panels, font, room, cell);
            let fits = lines == 1 || layout.free[0] + LEGEND[0] <= room;
            if (count <= lines && fits) || cell <= least {
                return layout;
            }
            cell -= 0.1;
        }
    }

    /// Lays panels out with cells of a side. Also returns the number of lines.
    fn with_cells(panels: &[Panel], font: &Font, room: f64, cell: f64) -> (Self, usize) {
        let (mut corners, mut line, mut x, mut y) = (Vec::new(), Vec::new(), 0.0, 0.0);
        let (mut count, mut highest) = (1, 0.0f64);
        for (number, panel) in panels.iter().enumerate() {
            // The last panel has the axes.
            let before = if number + 1 == panels.len() {
                LEFT
            } else {
                0.0
            };
            let wide = cell * panel.columns() as f64;
            let needed = before + wide.max(font.width(&panel.total(), TEXT, false));
            if x > 0.0 && x + needed > room {
                y += ABOVE + highest + GAP;
                corners.extend(line.drain(..).map(|x| [x, y - GAP]));
                (x, highest, count) = (0.0, 0.0, count + 1);
            }
            line.push(x + before);
            x += needed + GAP;
            highest = highest.max(cell * panel.rows.len() as f64);
        }
        let free = [x + GAP, y + 6.0];
        y += ABOVE + highest;
        corners.extend(line.into_iter().map(|x| [x, y]));
        let height = y + BELOW;
        let layout = Layout {
            cell,
            corners,
            height,
            free,
        };
        (layout, count)
    }

    fn draw(&self, canvas: &mut Canvas, [left, top]: [f64; 2], task: &TaskMap, map: &CellMap) {
        for (number, (panel, [x, y])) in task.panels.iter().zip(&self.corners).enumerate() {
            let at = [left + x, top + y];
            self.panel(canvas, at, panel);
            if number + 1 == task.panels.len() {
                self.axes(canvas, at, panel, &map.edges);
            }
        }
    }

    /// Draws a panel whose left lower corner is at `x`, `y`.
    fn panel(&self, canvas: &mut Canvas, [x, y]: [f64; 2], panel: &Panel) {
        let Layout { cell, .. } = *self;
        let gap = 0.08 * cell;
        let top = y - cell * panel.rows.len() as f64;
        let (mut hatches, mut strokes, mut frames) = (Vec::new(), Vec::new(), Vec::new());
        let mut areas = BTreeMap::<[u8; 3], Vec<Piece>>::new();
        for (row, cells) in panel.rows.iter().enumerate() {
            for (column, found) in cells.iter().enumerate() {
                let at = [x + cell * column as f64, top + cell * row as f64].map(|v| v + gap / 2.0);
                let side = cell - gap;
                let size = [side; 2];
                match found {
                    Cell::Impossible => continue,
                    Cell::Empty => hatches.extend(hatch(at, side)),
                    Cell::Elite {
                        fitness, colour, ..
                    } => {
                        let own = areas.entry(colour.rgb).or_default();
                        own.push(Piece::Rectangle { at, size });
                        if *fitness < 0.0 {
                            strokes.push(stroke(at, side));
                        }
                    }
                }
                frames.push(Piece::Rectangle { at, size });
            }
        }
        canvas.path(hatches, HATCH);
        for (rgb, squares) in areas {
            canvas.area(squares, Colour { rgb, opacity: 255 });
        }
        canvas.path(frames, Pen::new(scales::CELL, 0.3));
        canvas.path(strokes, STROKE);
        canvas.text([x, top - 2.5], &panel.total(), TextStyle::default());
    }

    /// Draws the axes of the panel whose left lower corner is at `x`, `y`.
    fn axes(&self, canvas: &mut Canvas, [x, y]: [f64; 2], panel: &Panel, edges: &[usize]) {
        let Layout { cell, .. } = *self;
        let pen = Pen::new(colour::INK, 0.6);
        let [wide, high] = [panel.columns(), panel.rows.len()].map(|count| cell * count as f64);
        canvas.line([x, y], [x + wide, y], pen);
        canvas.line([x, y], [x, y - high], pen);
        let widest = |edge: &usize| canvas.font().width(&edge.to_string(), TEXT, false);
        let widest = edges.iter().map(widest).fold(0.0, f64::max);
        let every = ((widest + 3.0) / cell).ceil().max(1.0) as usize;
        for (bin, edge) in edges.iter().enumerate() {
            let at = cell * bin as f64;
            let text = edge.to_string();
            if at <= wide {
                canvas.line([x + at, y], [x + at, y + 2.0], pen);
            }
            if at <= high {
                canvas.line([x - 2.0, y - at], [x, y - at], pen);
            }
            if bin % every == 0 && at <= wide {
                canvas.text([x + at, y + 9.5], &text, TextStyle::middle());
            }
            if bin % every == 0 && at <= high {
                let at = [x - 3.5, y - at + 0.36 * TEXT];
                canvas.text(at, &text, TextStyle::end());
            }
        }
        // A name that is longer than its axis begins with it.
        let names = [
            x + wide / 2.0,
            x + 0.5 * canvas.font().width(MUSCLES, TEXT, false),
        ];
        let at = [names[0].min(names[1]), y + 18.0];
        canvas.text(at, MUSCLES, TextStyle::middle());
        let upwards = TextStyle {
            upwards: true,
            ..TextStyle::default()
        };
        canvas.text([x - LEFT + 7.0, y], SENSORS, upwards);
    }
}

const MUSCLES: &str = "muscle voxels";
const SENSORS: &str = "sensor voxels";

/// The lines in cells without an elite.
const HATCH: Pen = Pen {
    colour: scales::CELL,
    width: 0.4,
    dashes: None,
};

/// The line through cells with fitness below 0: colour-blind viewers could take gray for a colour.
const STROKE: Pen = Pen {
    colour: colour::INK,
    width: 0.5,
    dashes: None,
};

fn stroke([x, y]: [f64; 2], side: f64) -> Piece {
    Piece::Line(vec![[x, y + side], [x + side, y]])
}

/// Returns diagonal lines in a square.
fn hatch([x, y]: [f64; 2], side: f64) -> impl Iterator<Item = Piece> {
    [0.5, 1.0, 1.5].into_iter().map(move |share| {
        let (near, far) = (
            side * f64::max(share - 1.0, 0.0),
            side * f64::min(share, 1.0),
        );
        Piece::Line(vec![[x + near, y + far], [x + far, y + near]])
    })
}

fn legend(canvas: &mut Canvas, [x, y]: [f64; 2], map: &CellMap) {
    let name = map
        .unit
        .map_or("fitness".to_string(), |unit| format!("fitness [{unit}]"));
    let shared = map.tasks.iter().find(|task| !task.has_own_scale);
    let highest = shared.map_or(0.0, |task| task.highest);
    // Without any fitness above 0, the bar has some length all the same.
    let axis = Axis::exact(0.0, if highest > 0.0 { highest } else { 1.0 }, 5);
    let colour = |value| colour_of(value, axis.to);
    let wide = LEGEND[0] - 6.0;
    let lower = colour_bar(
        canvas,
        [x, y + 7.0],
        [wide, LEGEND[0]],
        &axis,
        &name,
        colour,
    );
    let mut top = y + lower + 30.0;
    let mut line = |canvas: &mut Canvas, fill: Colour, text: &str| {
        let at = [x, top];
        top = robot::legend(canvas, at, [(Material::Empty, fill, text)], LEGEND[0]);
        at
    };
    if map.has_below {
        let at = line(canvas, map.below, "below 0");
        canvas.path(vec![stroke(at, 7.0)], STROKE);
    }
    if map.is_open() {
        let at = line(canvas, colour::PAPER, "no elite");
        canvas.path(hatch(at, 7.0).collect(), HATCH);
    }
    for text in ["above each panel:", "voxels in all"] {
        canvas.text([x, top + 6.0], text, TextStyle::default());
        top += 9.5;
    }
}
