//! The figure of logic gates: each gate's body, how it walks under every input (its truth table),
//! and how at every brightness of two cues.

use crate::analysis::gates::{GateWalks, LEVELS};
use crate::base::number;
use crate::body::Material;
use crate::draw::colour;
use crate::draw::panel::present;
use crate::draw::plot::axes::{Axis, MARGIN, colour_bar, heading};
use crate::draw::plot::canvas::{Canvas, Pen, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::style::{PAGE, Style};
use crate::draw::plot::{robot, scales};

/// Panels beside each other on a page.
const COLUMNS: usize = 4;

/// Gap between panels, points.
const GAP: f64 = 16.0;

/// Height of the words above a panel's body and map, points.
const WORDS: f64 = 20.0;

/// Room for the names of cues at the left of a map and below it, points.
const CUES: f64 = 9.0;

/// Height of a row of a truth table, points.
const ROW: f64 = 9.0;

/// Displacement at which colours are strongest and bars longest, voxel lengths.
const STRONG: f64 = 10.0;

/// Plots gates; `of` names their run.
pub(crate) fn gates(all: &[GateWalks], of: &str, style: &Style) -> Figure {
    let mut canvas = Canvas::new(style);
    let top = heading(
        &mut canvas,
        "Logic gates without a neuron",
        of,
        style.page(),
    ) + 2.0;
    let columns = style.panels(COLUMNS);
    let panel = (style.page() - 2.0 * MARGIN - GAP * (columns - 1) as f64) / columns as f64;
    let side = (panel - CUES - 6.0) / 2.0;
    let tall = WORDS + side + CUES + 5.0 * ROW + GAP;
    for (number, gate) in all.iter().enumerate() {
        let at = [
            MARGIN + (number % columns) as f64 * (panel + GAP),
            top + (number / columns) as f64 * tall,
        ];
        draw(&mut canvas, at, [panel, side], gate);
    }
    let rows = all.len().div_ceil(columns);
    let below = top + rows as f64 * tall;
    let number = all.len() % columns;
    if number > 0 {
        // The place that is left.
        let at = [MARGIN + number as f64 * (panel + GAP), below - tall + WORDS];
        let used = |material: &Material| {
            all.iter()
                .any(|gate| present(&gate.body).any(|own| own == *material))
        };
        let names = Material::ALL.into_iter().filter(used);
        let lines = names.map(|material| (material, robot::plain(material), material.name()));
        robot::legend(&mut canvas, at, lines, panel);
    }
    let name = "displacement [voxel lengths], positive to the right; full colour from ±10; dots mark \
                inputs for which the gate is true";
    let axis = Axis::exact(-STRONG, STRONG, 4);
    let shade = |walk: f64| scales::diverging(walk / STRONG);
    let bar = [MARGIN + 6.0, below];
    let room = style.page() - 2.0 * MARGIN - 6.0;
    let further = colour_bar(
        &mut canvas,
        bar,
        [room.min(PAGE / 2.0), room],
        &axis,
        name,
        shade,
    );
    let size = [style.page(), below + further + 19.0 + MARGIN];
    Figure::new(&format!("Logic gates: {of}"), size, canvas)
}

fn draw(canvas: &mut Canvas, [left, top]: [f64; 2], [panel, side]: [f64; 2], gate: &GateWalks) {
    let style = TextStyle::default();
    canvas.fitted([left, top + 7.0], &gate.gate.name, panel, style.bold());
    let robot = match &gate.audit {
        Some(verdict) => format!("{}, {verdict}", gate.robot),
        None => gate.robot.clone(),
    };
    let faint = style.colour(colour::FAINT);
    canvas.fitted([left, top + 16.0], &robot, panel, faint);
    let body = &gate.body;
    let voxel = side / body.height().max(body.width()).max(1) as f64;
    let corner = [left, top + WORDS];
    let voxels = body
        .voxels()
        .iter()
        .map(|(place, material)| (place, robot::plain(*material)));
    robot::squares(canvas, corner, voxel, 0.05 * voxel, voxels);
    robot::body_outline(canvas, corner, voxel, body, Pen::new(colour::INK, 0.5));
    map(canvas, [left + panel - side, top + WORDS], side, gate);
    let below = top + WORDS + side + CUES;
    table(canvas, [left, below], panel, gate);
    let GateWalks {
        starts, changes, ..
    } = gate;
    let kept = format!(
        "raised starts {}/{}, changes {}/{}",
        starts.correct, starts.all, changes.correct, changes.all
    );
    canvas.fitted([left, below + 5.0 * ROW - 1.0], &kept, panel, faint);
}

/// Draws the walks at every brightness; the first cue rises upwards, the second to the right.
fn map(canvas: &mut Canvas, at: [f64; 2], side: f64, gate: &GateWalks) {
    let cell = side / LEVELS as f64;
    let last = LEVELS - 1;
    let squares = gate.walks.iter().map(|((row, column), walk)| {
        let colour = match walk {
            Some(walk) => scales::diverging(walk / STRONG),
            None => scales::BELOW,
        };
        ((last - row, column), colour)
    });
    robot::squares(canvas, at, cell, 0.0, squares);
    canvas.frame(at, [side; 2], Pen::new(colour::INK, 0.6));
    for &input in &gate.gate.true_for {
        let (a, b) = (input & 2 != 0, input & 1 != 0);
        let along = |is_bright: bool| (last as f64 * f64::from(u8::from(is_bright)) + 0.5) * cell;
        let dot = [at[0] + along(b), at[1] + side - along(a)];
        canvas.dot(dot, 0.3 * cell, colour::INK);
    }
    let middle = TextStyle::middle();
    canvas.text([at[0] + side / 2.0, at[1] + side + 7.0], "b →", middle);
    canvas.text([at[0] - 5.0, at[1] + side / 2.0], "a", middle);
    canvas.text([at[0] - 5.0, at[1] + side / 2.0 - 7.0], "↑", middle);
}

/// Draws a truth table: a bar for the walk under each input, to the left or right.
fn table(canvas: &mut Canvas, [left, top]: [f64; 2], panel: f64, gate: &GateWalks) {
    let style = TextStyle::default();
    let (labels, numbers) = (16.0, 20.0);
    let half = (panel - labels - numbers) / 2.0;
    let zero = left + labels + half;
    for input in 0..4_u8 {
        let y = top + f64::from(input) * ROW;
        let is_true = gate.gate.is_true_for(input);
        let name = match is_true {
            true => style.bold(),
            false => style,
        };
        canvas.text([left, y + 7.0], &format!("{input:02b}"), name);
        let Some(walk) = gate.walk(input) else {
            canvas.text([zero, y + 7.0], "unstable", TextStyle::middle());
            continue;
        };
        let long = half * (walk / STRONG).clamp(-1.0, 1.0);
        let at = [zero + long.min(0.0), y + 1.5];
        canvas.rectangle(
            at,
            [long.abs(), ROW - 3.0],
            scales::diverging(walk / STRONG),
        );
        let text = number::fixed(walk, 1);
        canvas.text([left + panel, y + 7.0], &text, TextStyle::end());
    }
    let axis = Pen::new(colour::FAINT, 0.5);
    canvas.line([zero, top], [zero, top + 4.0 * ROW], axis);
}
