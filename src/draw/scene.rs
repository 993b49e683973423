//! One frame as drawing primitives in world coordinates (voxel lengths, y up), from which all
//! raster pictures are made.

use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::walk::{Walk, area};
use crate::sim::TerrainObject;
use std::fmt;
use std::str::FromStr;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Look {
    /// With a ruler on the ground.
    #[default]
    Plain,
    /// Like the paper's videos: with the world's grid and the voxels of the ground.
    Paper,
}

impl fmt::Display for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Look::Plain => "plain",
            Look::Paper => "paper",
        })
    }
}

impl FromStr for Look {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let found = [Look::Plain, Look::Paper]
            .into_iter()
            .find(|look| look.to_string() == text);
        found.ok_or_else(|| "expected plain or paper".to_string())
    }
}

/// Something to draw. Coordinates are in the world (voxel lengths, y up) or in pixels (y down),
/// depending on the function that creates it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Primitive {
    Quad {
        corners: [[f64; 2]; 4],
        fill: Colour,
        /// True if the edges are smoothed; axis-parallel rectangles on whole pixels do not need it.
        smooth: bool,
    },
    Line {
        points: Vec<[f64; 2]>,
        /// The width as a multiple of the picture's zoom (about a pixel in a small picture).
        width: f64,
        colour: Colour,
        smooth: bool,
    },
    Text {
        text: String,
        /// The start of the baseline.
        at: [f64; 2],
        /// The font size, pixels.
        size: f64,
        bold: bool,
        colour: Colour,
    },
}

/// The pixels per voxel length from which materials are marked: smaller marks would be specks.
const MARKED: f64 = 5.0;
/// The share of a mark's colour in crisp pictures; the rest is that of its voxel.
const CRISP_MARK: f64 = 0.7;
/// The minimum width of a mark, pixels; it takes a larger share of small voxels.
const MARK_PIXELS: f64 = 4.0;

impl Primitive {
    /// Creates a filled axis-parallel rectangle between two opposite corners.
    pub(crate) fn rectangle(a: [f64; 2], b: [f64; 2], fill: Colour) -> Self {
        Primitive::Quad {
            corners: [a, [b[0], a[1]], b, [a[0], b[1]]],
            fill,
            smooth: false,
        }
    }

    pub(crate) fn line(from: [f64; 2], to: [f64; 2], width: f64, colour: Colour) -> Self {
        Primitive::Line {
            points: vec![from, to],
            width,
            colour,
            smooth: true,
        }
    }
}

/// A visible part of the world, voxel lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Window {
    pub(crate) left: f64,
    pub(crate) right: f64,
    /// The lower edge, below the ground's surface at 0.
    pub(crate) bottom: f64,
    pub(crate) top: f64,
    /// The pixels per voxel length; details too small to see are left out.
    pub(crate) scale: f64,
    /// The size of letters and lines: 1 in a small picture.
    pub(crate) zoom: f64,
    /// True if voxels have hard edges, whose fewer colours keep animations small.
    pub(crate) crisp: bool,
    pub(crate) look: Look,
}

impl Window {
    fn shows(&self, points: &[[f64; 2]]) -> bool {
        let beyond = |outside: &dyn Fn(&[f64; 2]) -> bool| points.iter().all(outside);
        !(beyond(&|p| p[0] < self.left)
            || beyond(&|p| p[0] > self.right)
            || beyond(&|p| p[1] < self.bottom)
            || beyond(&|p| p[1] > self.top))
    }
}

/// Returns the multiples of `step` voxel lengths from the ruler's `zero` that lie in the window, at
/// most about 10⁴ of them.
pub(crate) fn ruler(window: &Window, zero: f64, step: f64) -> impl Iterator<Item = f64> + use<> {
    let first = ((window.left - zero) / step).ceil();
    let count = ((window.right - zero) / step).floor() - first + 1.0;
    (0..count.clamp(0.0, 1e4) as u32).map(move |k| (first + f64::from(k)) * step)
}

/// Draws the world at a frame, from back to front: sky, ground with its ruler, start marks, body,
/// path of the centre of mass. The ruler's zero is the centre of mass at the start of the rollout.
pub(crate) fn world(walk: &Walk, frame: usize, window: &Window) -> Vec<Primitive> {
    let mut out = ground(walk, frame, window);
    let objects = walk.recording().terrain.iter();
    for object in objects.flat_map(|terrain| terrain.objects()) {
        terrain(object, window, &mut out);
    }
    out.extend(body(walk, frame, window));
    out.extend(path(walk, frame, window));
    out
}

fn ground(walk: &Walk, frame: usize, window: &Window) -> Vec<Primitive> {
    let Window {
        left,
        right,
        bottom,
        top,
        scale,
        ..
    } = *window;
    let mut out = vec![
        Primitive::rectangle([left, top], [right, bottom], colour::PAPER),
        Primitive::rectangle([left, 0.0], [right, bottom], colour::GROUND),
    ];
    let zero = walk.centre(walk.rollout(frame).start)[0];
    if window.look == Look::Paper {
        grid(window, &mut out);
    }
    for (step, depth, line) in [(1.0, 3.0, 1.0), (10.0, 7.0, 1.5)] {
        // Ticks closer than four pixels would merge into a gray band.
        if step * scale >= 4.0 {
            let tick =
                |at| Primitive::line([at, 0.0], [at, -depth / scale], line, colour::GROUND_LINE);
            out.extend(ruler(window, zero, step).map(|mark| tick(zero + mark)));
        }
    }
    out.push(Primitive::line(
        [left, 0.0],
        [right, 0.0],
        1.5,
        colour::GROUND_LINE,
    ));
    // Marks the start of the rollout and of a continued phase: dashes of five pixels, five apart.
    let phase = walk.centre(walk.phase(frame).first_frame)[0];
    for x in if phase == zero {
        vec![zero]
    } else {
        vec![zero, phase]
    } {
        let dash = 5.0 / scale;
        let count = (top / (2.0 * dash)).clamp(0.0, 1e3) as u32;
        let dashes = (0..count).map(|k| 2.0 * dash * f64::from(k));
        out.extend(dashes.map(|y| Primitive::line([x, y], [x, y + dash], 1.0, Colour::gray(0.72))));
    }
    out
}

/// Draws the fixed cells of an object with its outline.
pub(crate) fn terrain(object: &TerrainObject, window: &Window, out: &mut Vec<Primitive>) {
    let line = |points: &[[f64; 2]], width, colour| Primitive::Line {
        points: points.to_vec(),
        width,
        colour,
        smooth: false,
    };
    let (seams, outline) = (colour::PAPER, colour::GROUND_LINE);
    let mut sides = Vec::new();
    let (left, low) = (i64::from(object.column), i64::from(object.row));
    let (columns, rows) = (object.cells.width() as i64, object.cells.height() as i64);
    let is_fixed = |[column, row]: [i64; 2]| {
        let (down, right) = (low + rows - 1 - row, column - left);
        object.cells.get(down as isize, right as isize) == Some(&true)
    };
    // The cells in the window; casts saturate.
    let within = |first: i64, count: i64, low: f64, high: f64| {
        let end = first.saturating_add(count);
        (low.floor() as i64).clamp(first, end)..(high.ceil() as i64).clamp(first, end)
    };
    for row in within(low, rows, window.bottom, window.top) {
        for column in within(left, columns, window.left, window.right) {
            if !is_fixed([column, row]) {
                continue;
            }
            let ([left, bottom], [right, top]) = (
                [column as f64, row as f64],
                [column as f64 + 1.0, row as f64 + 1.0],
            );
            out.push(Primitive::rectangle(
                [left, top],
                [right, bottom],
                colour::GROUND,
            ));
            for (beside, side) in [
                ([column, row + 1], [[left, top], [right, top]]),
                ([column + 1, row], [[right, top], [right, bottom]]),
                ([column, row - 1], [[right, bottom], [left, bottom]]),
                ([column - 1, row], [[left, bottom], [left, top]]),
            ] {
                match is_fixed(beside) {
                    true if window.scale >= MARKED => sides.push(line(&side, 1.0, seams)),
                    true => {}
                    false => sides.push(line(&side, 1.5, outline)),
                }
            }
        }
    }
    // Seams first, so that they do not cut the outline.
    let is_seam =
        |side: &Primitive| matches!(side, Primitive::Line { colour, .. } if *colour == seams);
    let (inner, outer): (Vec<_>, Vec<_>) = sides.into_iter().partition(is_seam);
    out.extend(inner);
    out.extend(outer);
}

/// Draws the world's columns and rows, and the visible upper part of the ground's voxels.
fn grid(window: &Window, out: &mut Vec<Primitive>) {
    let Window {
        left,
        right,
        top,
        scale,
        ..
    } = *window;
    let line = |points| Primitive::Line {
        points,
        width: 1.0,
        colour: colour::GRID,
        smooth: false,
    };
    // Lines closer than five pixels would merge into a gray veil; then every second, every fifth …
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|step| step * scale >= 5.0)
        .unwrap_or(20.0);
    out.extend(ruler(window, 0.0, step).map(|x| line(vec![[x, 0.0], [x, top]])));
    let rows = (top / step).clamp(0.0, 1e3) as u32;
    out.extend((1..=rows).map(|k| {
        line(vec![
            [left, step * f64::from(k)],
            [right, step * f64::from(k)],
        ])
    }));
    let depth = (8.0 / scale).min(1.0);
    let gap = (0.5 / scale).max(0.05);
    let peg = |x: f64| Primitive::rectangle([x + gap, 0.0], [x + step - gap, -depth], colour::PEG);
    let before = std::iter::once((left / step).floor() * step);
    out.extend(before.chain(ruler(window, 0.0, step)).map(peg));
}

/// Draws the voxels of a frame with their marks, seams and outline.
pub(crate) fn body(walk: &Walk, frame: usize, window: &Window) -> Vec<Primitive> {
    let smooth = !window.crisp;
    let voxels = || {
        walk.voxels(frame)
            .filter(|(_, corners)| window.shows(corners))
    };
    let quad = |(material, corners)| {
        let fill = colour::shade(material, area(&corners));
        Primitive::Quad {
            corners,
            fill,
            smooth,
        }
    };
    let mut out: Vec<Primitive> = voxels().map(quad).collect();
    // The paper's pictures have no marks.
    if window.scale >= MARKED && window.look == Look::Plain {
        out.extend(voxels().flat_map(|(material, corners)| {
            let fill = colour::shade(material, area(&corners));
            let mark = colour::mark_colour(material, fill);
            // Hard edges would make a mark stronger than smooth ones do.
            let colour = match smooth {
                true => mark,
                false => mark.mixed(fill, CRISP_MARK),
            };
            let width = (colour::MARK_WIDTH * window.scale / window.zoom).max(1.0);
            let larger = (MARK_PIXELS / (colour::MARK_EXTENT * window.scale)).max(1.0);
            let line = move |points: &&[[f64; 2]]| Primitive::Line {
                points: points
                    .iter()
                    .map(|point| colour::placed(point.map(|v| larger * v), corners))
                    .collect(),
                width,
                colour,
                smooth,
            };
            colour::mark(material).iter().map(line)
        }));
    }
    let seam = if window.crisp {
        colour::SEAM
    } else {
        colour::PAPER.with_opacity(120)
    };
    // At small scales the lines would hide the voxels.
    if window.scale >= 5.0 {
        let seams = walk.seams(frame).filter(|side| window.shows(side));
        let line = |points: [[f64; 2]; 2]| Primitive::Line {
            points: points.to_vec(),
            width: 1.0,
            colour: seam,
            smooth,
        };
        out.extend(seams.map(line));
    }
    let rim = walk.outline(frame).filter(|side| window.shows(side));
    let line = |side: [[f64; 2]; 2]| Primitive::Line {
        points: side.to_vec(),
        width: 1.2,
        colour: colour::INK,
        smooth,
    };
    out.extend(rim.map(line));
    out
}

fn path(walk: &Walk, frame: usize, window: &Window) -> Vec<Primitive> {
    let rollout = walk.rollout(frame).start..=frame;
    let points: Vec<[f64; 2]> = rollout.map(|f| walk.centre(f)).collect();
    let mut out = Vec::new();
    // Splits the path where it leaves the window: a long walk costs no more than a short one.
    for piece in points
        .chunk_by(|a, b| window.shows(&[*a, *b]))
        .filter(|piece| piece.len() > 1)
    {
        let line = |width, colour| Primitive::Line {
            points: piece.to_vec(),
            width,
            colour,
            smooth: true,
        };
        out.push(line(3.4, colour::PAPER.with_opacity(170)));
        out.push(line(1.6, colour::TRACE));
    }
    if let Some([x, y]) = points.last() {
        for (half, fill) in [(4.0, colour::PAPER), (3.0, colour::TRACE)] {
            let h = half / window.scale;
            let corners = [[*x, y + h], [x + h, *y], [*x, y - h], [x - h, *y]];
            out.push(Primitive::Quad {
                corners,
                fill,
                smooth: true,
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::simulated;

    const WINDOW: Window = Window {
        left: -10.0,
        right: 20.0,
        bottom: -2.0,
        top: 10.0,
        scale: 16.0,
        zoom: 1.0,
        crisp: false,
        look: Look::Plain,
    };

    #[test]
    fn marks_keep_their_share_of_a_voxel_in_large_pictures() {
        let recording = simulated("34/56", 1, 4, false);
        let walk = Walk::new(&recording).unwrap();
        let widest = |scale: f64, zoom: f64| {
            let window = Window {
                scale,
                zoom,
                ..WINDOW
            };
            let lines = body(&walk, 2, &window);
            let widths = lines.iter().filter_map(|primitive| match primitive {
                Primitive::Line { width, .. } => Some(zoom * width / scale),
                _ => None,
            });
            widths.fold(0.0, f64::max)
        };
        assert!((widest(48.0, 3.0) - widest(16.0, 1.0)).abs() < 1e-12);
        assert!(widest(48.0, 3.0) <= colour::MARK_WIDTH + 1e-12);
    }

    #[test]
    fn every_visible_voxel_is_a_quad_with_its_shade() {
        let recording = simulated("34/56", 1, 40, false);
        let walk = Walk::new(&recording).unwrap();
        let scene = world(&walk, 20, &WINDOW);
        for (material, corners) in walk.voxels(20) {
            let fill = colour::shade(material, area(&corners));
            assert!(
                scene.contains(&Primitive::Quad {
                    corners,
                    fill,
                    smooth: true
                }),
                "{material:?}"
            );
        }
        let elsewhere = Window {
            left: 100.0,
            right: 130.0,
            ..WINDOW
        };
        assert!(body(&walk, 20, &elsewhere).is_empty());
    }

    #[test]
    fn the_ruler_counts_from_the_start_and_survives_any_window() {
        let marks: Vec<f64> = ruler(&WINDOW, 0.5, 10.0).collect();
        assert_eq!(marks, [-10.0, 0.0, 10.0]);
        let far = Window {
            left: 1e6,
            right: 1e6 + 30.0,
            ..WINDOW
        };
        assert_eq!(ruler(&far, 0.0, 10.0).count(), 4);
        let broken = Window {
            left: f64::NAN,
            right: f64::INFINITY,
            ..WINDOW
        };
        assert!(ruler(&broken, 0.0, 1.0).count() <= 10_000);
    }

    #[test]
    fn the_papers_look_has_a_peg_for_every_column_of_the_ground() {
        let recording = simulated("34/56", 1, 4, false);
        let walk = Walk::new(&recording).unwrap();
        let pegs = |window: &Window| {
            let is_peg =
                |p: &&Primitive| matches!(p, Primitive::Quad { fill, .. } if *fill == colour::PEG);
            ground(&walk, 2, window).iter().filter(is_peg).count()
        };
        let paper = Window {
            look: Look::Paper,
            ..WINDOW
        };
        assert_eq!((pegs(&WINDOW), pegs(&paper)), (0, 32));
        assert!(
            pegs(&Window {
                left: f64::NAN,
                right: f64::INFINITY,
                ..paper
            }) <= 10_001
        );
        assert_eq!("paper".parse(), Ok(Look::Paper));
        assert!("pretty".parse::<Look>().is_err());
    }

    #[test]
    fn the_path_starts_at_the_last_reset() {
        let fresh = simulated("33/44", 2, 30, true);
        let walk = Walk::new(&fresh).unwrap();
        let lengths = |frame| {
            let path = path(&walk, frame, &WINDOW);
            path.iter()
                .filter_map(|p| match p {
                    Primitive::Line { points, .. } => Some(points.len()),
                    Primitive::Quad { .. } | Primitive::Text { .. } => None,
                })
                .max()
        };
        assert_eq!(
            (lengths(30), lengths(31), lengths(33)),
            (Some(31), None, Some(3))
        );
    }
}
