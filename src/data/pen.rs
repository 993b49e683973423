//! The pen that writes the built-in digits: variation of the strokes, and anti-aliased drawing.
//!
//! As in MNIST, the ink is scaled to a box of about 20 × 20 pixels in the middle of 28 × 28. All of
//! this ends up in stimuli, so transcendental functions come from `libm` alone.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::data::strokes::{DIGITS, Place, Variant};
use std::f64::consts::TAU;

pub(crate) const SIDE: usize = 28;

/// Version of the drawing: changes whenever any pixel of any digit does; part of the fingerprints.
pub(crate) const DRAWING: u32 = 1;

/// Longer side of the ink before its size is varied, pixels (MNIST: 20).
const BOX: f64 = 20.0;
/// Least distance of ink from the border, pixels.
const MARGIN: f64 = 1.0;
/// Most that pressure adds to the pen's radius, as a fraction of it.
const PRESSURE: f64 = 0.28;
/// Pieces into which the line between two places is cut.
const PIECES: usize = 8;
/// Standard deviation of a place's displacement, in digit heights.
const PLACE_SPREAD: f64 = 0.028;
/// Fraction of a place's displacement that the next one shares: a hand drifts rather than jumps.
const DRIFT: f64 = 0.75;

type Point = [f64; 2];

/// Writes one digit (0 … 9) with variations from the stream: 28 × 28, 0 paper, 255 ink.
pub(crate) fn write(digit: u8, chance: &mut Stream) -> Grid<u8> {
    let variant = choose(DIGITS[usize::from(digit) % DIGITS.len()], chance);
    let mut lines: Vec<Vec<Point>> = variant
        .strokes
        .iter()
        .map(|stroke| line(&displaced(stroke, chance)))
        .collect();
    warp(&mut lines, chance);
    tilt(&mut lines, digit, chance);
    let radius = (1.22 * libm::exp(0.2 * chance.normal())).clamp(0.75, 2.0);
    fit(&mut lines, radius, chance);
    ink(&lines, radius, chance)
}

fn choose<'a>(variants: &'a [Variant], chance: &mut Stream) -> &'a Variant {
    let total: u32 = variants.iter().map(|v| v.weight).sum();
    let mut ticket = chance.below(total as usize) as u32;
    let mut chosen = 0;
    while ticket >= variants[chosen].weight {
        ticket -= variants[chosen].weight;
        chosen += 1;
    }
    &variants[chosen]
}

/// Moves every place of a stroke a little: no two hands close a loop at the same point.
fn displaced(stroke: &[Place], chance: &mut Stream) -> Vec<Place> {
    let fresh = (1.0 - DRIFT * DRIFT).sqrt();
    let mut drift = [
        PLACE_SPREAD * chance.normal(),
        PLACE_SPREAD * chance.normal(),
    ];
    let moved = |place: &Place| {
        let [dx, dy] = drift;
        drift = drift.map(|d| DRIFT * d + fresh * PLACE_SPREAD * chance.normal());
        match *place {
            Place::Via(x, y) => Place::Via(x + dx, y + dy),
            Place::Turn(x, y) => Place::Turn(x + dx, y + dy),
        }
    };
    stroke.iter().map(moved).collect()
}

/// Draws a smooth line through the places (a Catmull–Rom spline) with corners at the turns.
fn line(places: &[Place]) -> Vec<Point> {
    let points: Vec<Point> = places
        .iter()
        .map(|p| match *p {
            Place::Via(x, y) | Place::Turn(x, y) => [x, y],
        })
        .collect();
    let turns = |i: usize| matches!(places[i], Place::Turn(..));
    let mut line = vec![points[0]];
    for i in 0..points.len() - 1 {
        let (from, to) = (points[i], points[i + 1]);
        // Beyond an end or a turn, the neighbour is the mirror image of the one on this side.
        let before = if i == 0 || turns(i) {
            mirror(to, from)
        } else {
            points[i - 1]
        };
        let after = if i + 2 == points.len() || turns(i + 1) {
            mirror(from, to)
        } else {
            points[i + 2]
        };
        for piece in 1..=PIECES {
            let t = piece as f64 / PIECES as f64;
            line.push(std::array::from_fn(|axis| {
                let (a, b, c, d) = (before[axis], from[axis], to[axis], after[axis]);
                let (u2, u3) = (t * t, t * t * t);
                0.5 * (2.0 * b
                    + (c - a) * t
                    + (2.0 * a - 5.0 * b + 4.0 * c - d) * u2
                    + (3.0 * b - a - 3.0 * c + d) * u3)
            }));
        }
    }
    line
}

fn mirror(point: Point, centre: Point) -> Point {
    [2.0 * centre[0] - point[0], 2.0 * centre[1] - point[1]]
}

/// Bends the whole digit by two slow waves through the paper, and shakes the hand by a quick one.
fn warp(lines: &mut [Vec<Point>], chance: &mut Stream) {
    let mut waves = Vec::new();
    for (size, low, high) in [(0.035, 0.5, 1.0), (0.02, 1.0, 1.8), (0.006, 3.0, 5.0)] {
        for axis in 0..2 {
            let strength = size * chance.normal();
            let angle = TAU * chance.unit();
            let rate = TAU * chance.uniform(low, high);
            let direction = [rate * libm::cos(angle), rate * libm::sin(angle)];
            waves.push((axis, strength, direction, TAU * chance.unit()));
        }
    }
    for point in lines.iter_mut().flatten() {
        let [x, y] = *point;
        for (axis, strength, direction, phase) in &waves {
            point[*axis] += strength * libm::sin(direction[0] * x + direction[1] * y + phase);
        }
    }
}

/// Varies aspect, slant (to the right on average, as most hands write) and rotation.
fn tilt(lines: &mut [Vec<Point>], digit: u8, chance: &mut Stream) {
    let aspect = libm::exp(0.13 * chance.normal());
    let slant = (0.14 + 0.17 * chance.normal()).clamp(-0.3, 0.6);
    // A one may lean further than the others: nothing else looks like it.
    let spread = if digit == 1 { 0.12 } else { 0.07 };
    let turn = (spread * chance.normal()).clamp(-2.5 * spread, 2.5 * spread);
    let (sin, cos) = (libm::sin(turn), libm::cos(turn));
    for point in lines.iter_mut().flatten() {
        let x = aspect * point[0] - slant * point[1];
        *point = [cos * x - sin * point[1], sin * x + cos * point[1]];
    }
}

/// Scales the lines to the ink box near the middle of the image; from here on in pixels.
fn fit(lines: &mut [Vec<Point>], radius: f64, chance: &mut Stream) {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for point in lines.iter().flatten() {
        for axis in 0..2 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let longest = (high[0] - low[0]).max(high[1] - low[1]);
    let side = BOX * chance.uniform(0.86, 1.06);
    let scale = (side - 2.0 * radius) / longest;
    let middle = SIDE as f64 / 2.0;
    let mut shift = [0.0; 2];
    for axis in 0..2 {
        let half = scale * (high[axis] - low[axis]) / 2.0 + (1.0 + PRESSURE) * radius + 0.5;
        let room = middle - MARGIN - half;
        shift[axis] = (1.1 * chance.normal()).clamp(-room, room);
    }
    for point in lines.iter_mut().flatten() {
        for axis in 0..2 {
            let centred = point[axis] - (low[axis] + high[axis]) / 2.0;
            point[axis] = middle + shift[axis] + scale * centred;
        }
    }
}

/// Draws the lines with a round pen whose pressure varies along the way; one pixel of soft edge.
fn ink(lines: &[Vec<Point>], radius: f64, chance: &mut Stream) -> Grid<u8> {
    let pressure = (PRESSURE / 2.0 * chance.normal()).clamp(-PRESSURE, PRESSURE);
    let (rate, phase) = (chance.uniform(0.5, 1.6), TAU * chance.unit());
    let mut cover = Grid::filled(SIDE, SIDE, 0.0f64);
    for line in lines {
        let segments = (line.len() - 1) as f64;
        for (i, ends) in line.windows(2).enumerate() {
            let along = i as f64 / segments;
            let pressed = 1.0 + pressure * libm::sin(TAU * rate * along + phase);
            segment(&mut cover, ends[0], ends[1], radius * pressed);
        }
    }
    cover.map(|&c| (255.0 * c).round() as u8)
}

/// Draws one straight piece; a pixel's coverage follows from its centre's distance to the piece.
fn segment(cover: &mut Grid<f64>, from: Point, to: Point, radius: f64) {
    let reach = radius + 1.0;
    let range = |axis: usize| {
        let low = (from[axis].min(to[axis]) - reach)
            .floor()
            .clamp(0.0, SIDE as f64) as usize;
        let high = (from[axis].max(to[axis]) + reach)
            .ceil()
            .clamp(0.0, SIDE as f64) as usize;
        low..high
    };
    let along = [to[0] - from[0], to[1] - from[1]];
    let length_squared = (along[0] * along[0] + along[1] * along[1]).max(1e-12);
    for row in range(1) {
        for column in range(0) {
            let centre = [column as f64 + 0.5 - from[0], row as f64 + 0.5 - from[1]];
            let t =
                ((centre[0] * along[0] + centre[1] * along[1]) / length_squared).clamp(0.0, 1.0);
            let (dx, dy) = (centre[0] - t * along[0], centre[1] - t * along[1]);
            let covered = (radius + 0.5 - (dx * dx + dy * dy).sqrt()).clamp(0.0, 1.0);
            let pixel = &mut cover[(row, column)];
            *pixel = pixel.max(covered);
        }
    }
}
