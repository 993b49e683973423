//! Bodies, poses and stimuli in figures.

use crate::base::Grid;
use crate::body::{Body, Material};
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::plot::canvas::{Canvas, Pen, Piece, TextStyle};
use crate::draw::plot::scales;
use crate::draw::walk::{Walk, area};
use crate::task::recording::FramedImage;
use std::collections::BTreeMap;

/// Shades of a material in a figure: more would look alike in print.
const SHADES: f64 = 6.0;

/// Returns a material's colour at rest.
pub(crate) fn plain(material: Material) -> Colour {
    let [_, [red, green, blue], _] = colour::tones(material);
    Colour::new(red, green, blue)
}

/// Draws squares with thin paper-white seams; squares of equal colour form one path, to save bytes.
pub(crate) fn squares(
    canvas: &mut Canvas,
    [left, top]: [f64; 2],
    cell: f64,
    seam: f64,
    squares: impl Iterator<Item = ((usize, usize), Colour)>,
) {
    let mut paths = BTreeMap::<([u8; 3], u8), Vec<Piece>>::new();
    for ((row, column), fill) in squares {
        let (x, y) = (
            left + column as f64 * cell + seam / 2.0,
            top + row as f64 * cell + seam / 2.0,
        );
        let square = Piece::Rectangle {
            at: [x, y],
            size: [cell - seam; 2],
        };
        paths
            .entry((fill.rgb, fill.opacity))
            .or_default()
            .push(square);
    }
    for ((rgb, opacity), squares) in paths {
        canvas.area(squares, Colour { rgb, opacity });
    }
}

/// The cell size, points, from which materials are marked.
const MARKED: f64 = 4.5;

/// Draws the marks of the materials of a body's cells, over squares of these colours.
pub(crate) fn marks(
    canvas: &mut Canvas,
    [left, top]: [f64; 2],
    cell: f64,
    cells: impl Iterator<Item = ((usize, usize), Material)>,
    fill: impl Fn(Material) -> Colour,
) {
    if cell < MARKED {
        return;
    }
    let corners = |(row, column): (usize, usize)| {
        let (x, y) = (left + column as f64 * cell, top + row as f64 * cell);
        [[x, y], [x + cell, y], [x + cell, y + cell], [x, y + cell]]
    };
    stroked(
        canvas,
        cell,
        cells.map(|(place, material)| (material, corners(place), fill(material))),
    );
}

/// Draws the marks of voxels, `cell` points wide, as one path for each colour.
fn stroked(
    canvas: &mut Canvas,
    cell: f64,
    voxels: impl Iterator<Item = (Material, [[f64; 2]; 4], Colour)>,
) {
    let mut paths = BTreeMap::<([u8; 3], u8), Vec<Piece>>::new();
    for (material, corners, fill) in voxels {
        let colour = Colour {
            opacity: fill.opacity,
            ..colour::mark_colour(material, fill)
        };
        let lines = paths.entry((colour.rgb, colour.opacity)).or_default();
        for line in colour::mark(material) {
            lines.push(Piece::Line(
                line.iter()
                    .map(|point| colour::placed(*point, corners))
                    .collect(),
            ));
        }
    }
    for ((rgb, opacity), lines) in paths.into_iter().filter(|(_, lines)| !lines.is_empty()) {
        canvas.path(
            lines,
            Pen::new(Colour { rgb, opacity }, colour::MARK_WIDTH * cell),
        );
    }
}

/// Outlines the cells of a grid for which `holds` returns true.
pub(crate) fn outline(
    canvas: &mut Canvas,
    [left, top]: [f64; 2],
    cell: f64,
    [height, width]: [usize; 2],
    holds: impl Fn(isize, isize) -> bool,
    pen: Pen,
) {
    let mut sides = Vec::new();
    for row in 0..height as isize {
        for column in 0..width as isize {
            if !holds(row, column) {
                continue;
            }
            let (x, y) = (left + column as f64 * cell, top + row as f64 * cell);
            let corners = [[x, y], [x + cell, y], [x + cell, y + cell], [x, y + cell]];
            let beyond = [(-1, 0), (0, 1), (1, 0), (0, -1)];
            for (k, (dr, dc)) in beyond.into_iter().enumerate() {
                if !holds(row + dr, column + dc) {
                    sides.push(Piece::Line(vec![corners[k], corners[(k + 1) % 4]]));
                }
            }
        }
    }
    if !sides.is_empty() {
        canvas.path(sides, pen);
    }
}

pub(crate) fn body_outline(canvas: &mut Canvas, at: [f64; 2], cell: f64, body: &Body, pen: Pen) {
    outline(
        canvas,
        at,
        cell,
        [body.height(), body.width()],
        |r, c| !body.at(r, c).is_empty(),
        pen,
    );
}

/// Draws a framed stimulus, `side` points on its longer side; returns its width and height.
pub(crate) fn stimulus(
    canvas: &mut Canvas,
    at: [f64; 2],
    side: f64,
    image: &Grid<f64>,
) -> [f64; 2] {
    let cell = side / image.height().max(image.width()).max(1) as f64;
    let size = [cell * image.width() as f64, cell * image.height() as f64];
    canvas.rectangle(at, size, Colour::gray(0.0));
    // Sixteen grays suffice here; a negative seam hides the lines between squares.
    let gray = |intensity: f64| Colour::gray((intensity * 15.0).round() / 15.0);
    let lit = image
        .iter()
        .map(|(place, intensity)| (place, gray(*intensity)));
    canvas.clipped(at, size, |canvas| {
        squares(
            canvas,
            at,
            cell,
            -0.05,
            lit.filter(|(_, fill)| fill.rgb[0] > 0),
        );
    });
    canvas.frame(at, size, Pen::new(colour::FAINT, 0.5));
    size
}

/// Draws an image with the part framed that a body covers.
pub(crate) fn framed(canvas: &mut Canvas, at: [f64; 2], side: f64, image: &FramedImage) {
    let pixels = &image.pixels;
    stimulus(
        canvas,
        at,
        side,
        &pixels.map(|pixel| f64::from(*pixel) / 255.0),
    );
    let cell = side / pixels.height().max(pixels.width()).max(1) as f64;
    let [rows, columns] = image
        .window()
        .map(|ends| ends.map(|place| cell * place as f64));
    // The line lies inside the frame.
    canvas.frame(
        [at[0] + columns[0] + 0.5, at[1] + rows[0] + 0.5],
        [columns[1] - columns[0] - 1.0, rows[1] - rows[0] - 1.0],
        Pen::new(colour::WINDOW, 1.0),
    );
}

/// Draws the body at a frame with its outline: voxels in the colour of their material, darker the
/// smaller they are.
pub(crate) fn pose(
    canvas: &mut Canvas,
    walk: &Walk,
    frame: usize,
    place: impl Fn([f64; 2]) -> [f64; 2],
) {
    let [small, _, large] = colour::TONE_AREAS;
    let mut paths = BTreeMap::<[u8; 3], Vec<Piece>>::new();
    for (material, corners) in walk.voxels(frame) {
        let share = (area(&corners) - small) / (large - small);
        let stepped = small + (share * SHADES).round() / SHADES * (large - small);
        let fill = colour::shade(material, stepped);
        paths
            .entry(fill.rgb)
            .or_default()
            .push(Piece::Polygon(corners.map(&place).to_vec()));
    }
    for (rgb, voxels) in paths {
        canvas.area(voxels, Colour { rgb, opacity: 255 });
    }
    let cell = place([1.0, 0.0])[0] - place([0.0, 0.0])[0];
    if cell >= MARKED {
        let voxels = walk.voxels(frame);
        let on_page = voxels.map(|(material, corners)| {
            (
                material,
                corners.map(&place),
                colour::shade(material, area(&corners)),
            )
        });
        stroked(canvas, cell, on_page);
    }
    let rim: Vec<Piece> = walk
        .outline(frame)
        .map(|side| Piece::Line(side.map(&place).to_vec()))
        .collect();
    if !rim.is_empty() {
        canvas.path(rim, Pen::new(colour::INK, 0.5));
    }
}

/// Draws squares with their meanings, one below the other; returns the y below the last.
pub(crate) fn legend<'a>(
    canvas: &mut Canvas,
    [x, y]: [f64; 2],
    lines: impl IntoIterator<Item = (Material, Colour, &'a str)>,
    most: f64,
) -> f64 {
    const LINE: f64 = 11.0;
    let mut top = y;
    for (material, fill, text) in lines {
        canvas.rectangle([x, top], [7.0, 7.0], fill);
        marks(
            canvas,
            [x, top],
            7.0,
            std::iter::once(((0, 0), material)),
            |_| fill,
        );
        canvas.frame([x, top], [7.0, 7.0], Pen::new(scales::CELL, 0.4));
        canvas.fitted(
            [x + 10.5, top + 6.2],
            text,
            most - 10.5,
            TextStyle::default(),
        );
        top += LINE;
    }
    top
}
