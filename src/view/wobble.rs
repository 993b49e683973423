//! Made-up recordings for tests: bodies that wobble, drifting left in even phases and right in odd ones.

use crate::base::Grid;
use crate::body::{Body, Material};
use crate::task::recording::{Frame, Phase, Recording, VoxelCorners};
use std::f64::consts::TAU;

/// Voxel lengths walked per control step.
const SPEED: f64 = 0.034;

/// A body (text form) through `phases` phases of `steps` control steps, put back to the start for each if `fresh`.
pub fn recording(body: &str, phases: usize, steps: usize, fresh: bool) -> Recording {
    let body: Body = body.parse().unwrap();
    let (height, width) = (body.height(), body.width());
    let mut ids = Grid::filled(height + 1, width + 1, None);
    let mut count = 0;
    let mut voxels = Vec::new();
    for ((row, column), _) in body.voxels().iter().filter(|(_, m)| !m.is_empty()) {
        let corners = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(r, c)| {
            *ids[(row + r, column + c)].get_or_insert_with(|| {
                count += 1;
                count - 1
            })
        });
        voxels.push(VoxelCorners { row, column, corners });
    }
    let mut out = Recording {
        robot: "WOBBLE".into(),
        body,
        voxels,
        phases: vec![],
        frames: vec![],
        cycle: 50,
        unstable: false,
    };
    let mut x = 0.0;
    for phase in 0..phases {
        let stimulus = if phase % 2 == 0 { ring(height, width) } else { bar(height, width) };
        let sign = if phase % 2 == 0 { -1.0 } else { 1.0 };
        if fresh {
            x = 0.0;
        }
        // A sequential life shares the frame at which the image changes; a fresh one has a frame of its own.
        let last = if fresh || phase + 1 == phases { steps + 1 } else { steps };
        let first_frame = out.frames.len();
        for step in 0..last {
            let eased = if fresh && step == 0 { 0.0 } else { 1.0 };
            let time = if fresh { step } else { phase * steps + step };
            let points = pose(&out.body, &ids, count, &stimulus, time as f64 * eased, x, eased);
            let centre = [x + width as f64 / 2.0, points.iter().map(|p| p[1]).sum::<f64>() / count as f64];
            out.frames.push(Frame { points, centre });
            x += sign * SPEED;
        }
        let displacement = sign * SPEED * steps as f64;
        out.phases.push(Phase {
            first_frame,
            stimulus,
            label: format!("{} (train {})", phase % 2, 2 * phase + 1),
            displacement,
        });
        if last > steps {
            x -= sign * SPEED;
        }
    }
    out
}

fn pose(
    body: &Body,
    ids: &Grid<Option<usize>>,
    count: usize,
    stimulus: &Grid<f64>,
    time: f64,
    x: f64,
    strength: f64,
) -> Vec<[f64; 2]> {
    let wave = 0.35 * (TAU * time / 50.0).sin();
    let raw = Grid::from_fn(body.height(), body.width(), |r, c| {
        let change = match body.voxels()[(r, c)] {
            Material::MuscleInPhase => wave,
            Material::MuscleAntiphase => -wave,
            Material::SensorShrink => -0.35 * stimulus[(r, c)],
            Material::SensorExpand => 0.45 * stimulus[(r, c)],
            _ => 0.0,
        };
        1.0 + strength * change
    });
    // Neighbours hold each other back: the mean of a row's 3 × 3 surroundings, twice the weight in the middle.
    let stretch = |r: isize, c: isize| {
        let near = [(0, 0), (0, 0), (0, 1), (1, 0), (0, -1), (-1, 0)];
        let near = near.iter().filter_map(|(dr, dc)| raw.get(r + dr, c + dc));
        let (sum, n) = near.fold((0.0, 0.0), |(s, n), w| (s + w, n + 1.0));
        if n > 0.0 { sum / n } else { 1.0 }
    };
    let (height, width) = (body.height(), body.width());
    let mut points = vec![[0.0; 2]; count];
    for ((r, c), id) in ids.iter() {
        if let Some(id) = id {
            let rows = [r as isize - 1, r as isize];
            let side = |columns: std::ops::Range<usize>| -> f64 {
                columns.map(|k| rows.iter().map(|&row| stretch(row, k as isize)).sum::<f64>() / 2.0).sum()
            };
            let lift: f64 = (r..height).map(|k| 2.0 - stretch(k as isize, c as isize)).sum();
            let middle = width as f64 / 2.0;
            points[*id] = [x + middle + (side(0..c) - side(c..width)) / 2.0, lift + 0.02];
        }
    }
    points
}

/// Something like a zero.
pub fn ring(height: usize, width: usize) -> Grid<f64> {
    Grid::from_fn(height, width, |r, c| {
        let y = (r as f64 + 0.5) / height as f64 * 2.0 - 1.0;
        let x = (c as f64 + 0.5) / width as f64 * 2.0 - 1.0;
        let distance = (x * x * 1.8 + y * y).sqrt();
        (1.4 - 5.0 * (distance - 0.62).abs()).clamp(0.0, 1.0)
    })
}

/// Something like a one.
pub fn bar(height: usize, width: usize) -> Grid<f64> {
    Grid::from_fn(height, width, |r, c| {
        let y = (r as f64 + 0.5) / height as f64 * 2.0 - 1.0;
        let x = (c as f64 + 0.5) / width as f64 * 2.0 - 1.0;
        if y.abs() > 0.75 { 0.0 } else { (1.6 - 6.0 * (x + 0.25 * y).abs()).clamp(0.0, 1.0) }
    })
}
