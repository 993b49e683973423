//! The figure of what every pixel means to a robot.

use super::axes::{Axis, MARGIN, colour_bar, heading};
use super::canvas::{Canvas, Pen, Words};
use super::figure::{COLUMN, Figure, PAGE};
use super::{robot, scales};
use crate::body::Body;
use crate::run::sensitivity::Sensitivity;
use crate::view::colour::{self, Colour};
use crate::view::panel::signed;

/// Voxels that follow no pixel.
const BLIND: Colour = Colour::new(214, 216, 220);
/// Sensors whose flipped pixel makes the life unstable.
const UNSTABLE: Colour = colour::ALARM;

/// By how much the displacement changes when a pixel is flipped, drawn over the body; a panel per image. `of` says whose it
/// is.
pub fn sensitivity(body: &Body, images: &[Sensitivity], of: &str) -> Figure {
    let mut canvas = Canvas::new();
    let (columns, width) = if images.len() <= 2 { (2, COLUMN) } else { (4, PAGE) };
    let top = heading(&mut canvas, "How much each pixel matters", of, width);
    let changes = || images.iter().flat_map(|image| image.pixels.iter().filter_map(|p| image.change(p)));
    let largest = changes().map(f64::abs).fold(0.0, f64::max);
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let axis = Axis::exact(-largest, largest, 4);
    let gap = 10.0;
    let side = (width - 2.0 * MARGIN - (columns - 1) as f64 * gap) / columns as f64;
    let cell = side / body.height().max(body.width()).max(1) as f64;
    let high = cell * body.height() as f64 + 12.0;
    for (k, image) in images.iter().enumerate() {
        let (row, column) = (k / columns, k % columns);
        let at = [MARGIN + column as f64 * (side + gap), top + row as f64 * (high + 8.0)];
        panel(&mut canvas, at, [side, cell], body, image, &|change| scales::diverging(change / largest));
    }
    let below = top + images.len().div_ceil(columns) as f64 * (high + 8.0);
    let name = "change of displacement [voxel lengths], right positive";
    let bar = (COLUMN - 2.0 * MARGIN - 8.0).min(width);
    colour_bar(&mut canvas, [MARGIN + 4.0, below + 10.0], bar, &axis, name, |change| {
        scales::diverging(change / largest)
    });
    let y = below + 38.0;
    let words = Words::default();
    let x = MARGIN + 4.0;
    canvas.rectangle([x, y - 6.0], [7.0, 7.0], BLIND);
    canvas.text([x + 10.5, y], "no sensor", words);
    canvas.frame([x + 54.0, y - 6.0], [7.0, 7.0], Pen::new(colour::INK, 1.3));
    canvas.text([x + 64.5, y], "flip turns it round", words);
    canvas.dot([x + 142.5, y - 2.5], 1.1, colour::INK);
    canvas.text([x + 147.0, y], "lit pixel", words);
    let is_unstable =
        images.iter().any(|image| image.pixels.iter().any(|pixel| image.change(pixel).is_none()));
    let mut height = y + 4.0;
    if is_unstable {
        canvas.rectangle([x, y + 5.0], [7.0, 7.0], UNSTABLE);
        canvas.text([x + 10.5, y + 11.0], "unstable", words);
        height += 11.0;
    }
    Figure::new(&format!("Sensitivity to pixels: {of}"), [width, height + MARGIN], canvas.finish())
}

fn panel(
    canvas: &mut Canvas,
    [x, y]: [f64; 2],
    [side, cell]: [f64; 2],
    body: &Body,
    image: &Sensitivity,
    colour_of: &dyn Fn(f64) -> Colour,
) {
    let walked = image.displacement.map_or("unstable".to_string(), |d| format!("{} vl", signed(d)));
    canvas.fitted([x, y + 7.0], &format!("{}: {walked}", image.label), side, Words::default().bold());
    let at = [x, y + 12.0];
    let blind = body.voxels().iter().filter(|(_, m)| !m.is_empty() && !m.is_sensor());
    robot::squares(canvas, at, cell, 0.4, blind.map(|(place, _)| (place, BLIND)));
    let seen = image.pixels.iter().map(|p| (p.place, image.change(p).map_or(UNSTABLE, colour_of)));
    robot::squares(canvas, at, cell, 0.4, seen);
    let sensor = |r: isize, c: isize| body.at(r, c).is_sensor();
    let size = [body.height(), body.width()];
    robot::outline(canvas, at, cell, size, sensor, Pen::new(colour::FAINT, 0.4));
    robot::body_outline(canvas, at, cell, body, Pen::new(colour::FAINT, 0.7));
    for pixel in &image.pixels {
        let (row, column) = pixel.place;
        let corner = [at[0] + column as f64 * cell, at[1] + row as f64 * cell];
        if image.turns(pixel) {
            canvas.frame([corner[0] + 0.5, corner[1] + 0.5], [cell - 1.0; 2], Pen::new(colour::INK, 1.3));
        }
        if image.stimulus.get(row as isize, column as isize).is_some_and(|v| *v >= 0.5) {
            let change = image.change(pixel).map_or(UNSTABLE, colour_of);
            let dark = change.rgb.iter().map(|v| u32::from(*v)).sum::<u32>() < 330;
            let fill = if dark { colour::PAPER } else { colour::INK };
            canvas.dot([corner[0] + cell / 2.0, corner[1] + cell / 2.0], (0.15 * cell).min(1.2), fill);
        }
    }
}
