//! The figure of logic gates: bodies, and how they walk at every brightness of two cues.

use crate::draw::colour;
use crate::draw::plot::axes::{Axis, MARGIN, colour_bar, heading};
use crate::draw::plot::canvas::{Canvas, Pen, TextStyle};
use crate::draw::plot::figure::{Figure, PAGE};
use crate::draw::plot::{robot, scales};
use crate::search::gates::{GateWalks, LEVELS};

/// Panels beside each other.
const COLUMNS: usize = 4;

/// Gap between panels, points.
const GAP: f64 = 14.0;

/// Height of the words above a panel's map, points.
const WORDS: f64 = 20.0;

/// Room for the names of cues at the left and below a map, points.
const CUES: f64 = 10.0;

/// Displacement at which colours are strongest, voxel lengths.
const STRONG: f64 = 10.0;

/// Plots each gate's body and a map of its walks; `of` names the run.
pub(crate) fn gates(all: &[GateWalks], of: &str) -> Figure {
    let mut canvas = Canvas::new();
    let top = heading(&mut canvas, "Logic gates without a neuron", of, PAGE) + 2.0;
    let panel = (PAGE - 2.0 * MARGIN - GAP * (COLUMNS - 1) as f64) / COLUMNS as f64;
    let map = (panel - CUES) * 0.62;
    let tall = WORDS + map + CUES + GAP;
    for (number, gate) in all.iter().enumerate() {
        let at = [
            MARGIN + (number % COLUMNS) as f64 * (panel + GAP),
            top + (number / COLUMNS) as f64 * tall,
        ];
        draw(&mut canvas, at, [panel, map], gate);
    }
    let below = top + all.len().div_ceil(COLUMNS) as f64 * tall + 6.0;
    let name = "walk [voxel lengths], right positive; a dot where the gate should be true";
    let axis = Axis::exact(-STRONG, STRONG, 4);
    let shade = |walk: f64| scales::diverging(walk / STRONG);
    let width = PAGE / 2.0;
    colour_bar(
        &mut canvas,
        [MARGIN + 6.0, below],
        width,
        &axis,
        name,
        shade,
    );
    Figure::new(
        &format!("Logic gates: {of}"),
        [PAGE, below + 19.0 + MARGIN],
        canvas,
    )
}

fn draw(canvas: &mut Canvas, [left, top]: [f64; 2], [panel, map]: [f64; 2], gate: &GateWalks) {
    let style = TextStyle::default();
    canvas.fitted([left, top + 7.0], &gate.gate, panel, style.bold());
    let true_side = format!("true: {}", gate.side.name());
    let said = match &gate.audit {
        Some(verdict) => format!("{true_side}; {verdict}"),
        None => true_side,
    };
    canvas.fitted(
        [left, top + 16.0],
        &said,
        panel,
        style.colour(colour::FAINT),
    );
    let at = [left + CUES, top + WORDS];
    let cell = map / LEVELS as f64;
    // Row 0, the dark first cue, is at the bottom.
    let squares = gate.walks.iter().map(|((row, column), walk)| {
        let colour = match walk {
            Some(walk) => scales::diverging(walk / STRONG),
            None => scales::below(0.5),
        };
        ((LEVELS - 1 - row, column), colour)
    });
    robot::squares(canvas, at, cell, 0.0, squares);
    canvas.frame(at, [map; 2], Pen::new(colour::INK, 0.6));
    let last = LEVELS - 1;
    for (row, column) in [(0, 0), (0, last), (last, 0), (last, last)] {
        let [x, y] = [
            at[0] + (column as f64 + 0.5) * cell,
            at[1] + ((last - row) as f64 + 0.5) * cell,
        ];
        if gate.is_true_for(row == last, column == last) {
            canvas.dot([x, y], 0.3 * cell, colour::INK);
        }
    }
    canvas.text(
        [at[0] + map / 2.0, at[1] + map + 8.0],
        "b →",
        TextStyle::middle(),
    );
    canvas.text([left, at[1] + map / 2.0], "a↑", TextStyle::default());
    let body = &gate.body;
    let side = panel - CUES - map - 8.0;
    let voxel = side / body.height().max(body.width()).max(1) as f64;
    let corner = [at[0] + map + 8.0, at[1]];
    let voxels = body
        .voxels()
        .iter()
        .map(|(place, material)| (place, robot::plain(*material)));
    robot::squares(canvas, corner, voxel, 0.05 * voxel, voxels);
    robot::body_outline(canvas, corner, voxel, body, Pen::new(colour::INK, 0.5));
    let words = [corner[0], corner[1] + side + 9.0];
    canvas.fitted(words, &gate.robot, side, style.colour(colour::FAINT));
}
