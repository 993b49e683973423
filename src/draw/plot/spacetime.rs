//! The figure of a walk: the robot from above over time, one row per moment.

use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::error::PictureError;
use crate::draw::panel::signed;
use crate::draw::plot::axes::{AXIS, Axis, MARGIN, Plot, heading, left_space};
use crate::draw::plot::canvas::{Canvas, Pen, Piece, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::robot;
use crate::draw::plot::style::Style;
use crate::draw::walk::{Walk, area};
use crate::task::recording::Recording;
use std::ops::Range;

/// Maximum number of rows in a panel: finer ones would be invisible in print.
const ROWS: usize = 220;
/// Cells across a panel.
const CELLS: usize = 150;
/// Grays, from the smallest voxels to the largest.
const GRAYS: usize = 6;
const DARKEST: f64 = 0.15;
const LIGHTEST: f64 = 0.86;
/// Side of a stimulus, points.
const STIMULUS: f64 = 30.0;
/// Height of a panel per control step, points, and the least and largest height.
const PER_STEP: f64 = 0.2;
const HEIGHTS: [f64; 2] = [90.0, 210.0];

/// Plots x over time, which runs downwards. Every row is the robot from above at that time, darker
/// where its voxels are compressed. There is a panel per rollout, with dashed lines where the
/// stimulus changes. `of` names the robot.
pub(crate) fn spacetime(
    recording: &Recording,
    of: &str,
    style: &Style,
) -> Result<Figure, PictureError> {
    let walk = Walk::new(recording)?;
    let mut rollouts = Vec::<Range<usize>>::new();
    while rollouts.last().map_or(0, |rollout| rollout.end) < walk.frames() {
        let rollout = walk.rollout(rollouts.last().map_or(0, |rollout| rollout.end));
        rollouts.push(rollout.start..rollout.end.max(rollout.start + 1));
    }
    let columns = rollouts.len().min(style.panels(4));
    let width = if columns <= 2 {
        style.column()
    } else {
        style.page()
    };
    let mut canvas = Canvas::new(style);
    let top = heading(&mut canvas, "Position over time", of, width);
    let x = positions(&walk, &rollouts, columns);
    let grays = grays(&walk, &rollouts, &x);
    let longest = rollouts
        .iter()
        .map(|rollout| rollout.len() - 1)
        .max()
        .unwrap_or(1)
        .max(1);
    let cycle = recording.cycle.max(1) as f64;
    let y = Axis::exact(0.0, longest as f64 / cycle, 5);
    let height = (PER_STEP * longest as f64).clamp(HEIGHTS[0], HEIGHTS[1]);
    let left = MARGIN + left_space(y.labels_width(style.font()));
    // A single rollout has its stimuli beside it, several have them above.
    let (beside, above) = if rollouts.len() == 1 {
        (STIMULUS + 8.0, 4.0)
    } else {
        (0.0, STIMULUS + 6.0)
    };
    let gap = 8.0;
    let wide = (width - MARGIN - 4.0 - left - beside - gap * (columns - 1) as f64) / columns as f64;
    let row_height = above + height + AXIS + 6.0;
    for (k, rollout) in rollouts.iter().enumerate() {
        let at = [
            left + (k % columns) as f64 * (wide + gap),
            top + above + (k / columns) as f64 * row_height,
        ];
        let plot = Plot {
            at,
            size: [wide, height],
            x: x.clone(),
            y: y.clone(),
        };
        rows(&mut canvas, &walk, rollout, &plot, grays);
        stimuli(&mut canvas, &walk, rollout, &plot, rollouts.len() == 1);
        axes(&mut canvas, &plot, k % columns == 0);
    }
    let bottom = top + rollouts.len().div_ceil(columns) as f64 * row_height;
    Ok(Figure::new(
        &format!("Position over time: {of}"),
        [width, bottom + MARGIN - 4.0],
        canvas,
    ))
}

/// Returns an axis that holds all rollouts, each measured from its start.
fn positions(walk: &Walk, rollouts: &[Range<usize>], columns: usize) -> Axis {
    let size = walk.recording().body.width() as f64 + 2.0;
    let reach = |rollout: &Range<usize>| {
        let zero = walk.centre(rollout.start)[0];
        let all = walk.extent(rollout.clone());
        let centres = || rollout.clone().map(|frame| walk.centre(frame)[0] - zero);
        let low = (all.left - zero).max(centres().fold(0.0, f64::min) - size);
        (
            low,
            (all.right - zero).min(centres().fold(0.0, f64::max) + size),
        )
    };
    let (low, high) = rollouts
        .iter()
        .map(reach)
        .fold((0.0f64, 0.0f64), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    Axis::exact(low - 1.0, high + 1.0, if columns == 1 { 6 } else { 4 })
}

/// Returns the y of a moment of a rollout, points from the top of the figure.
fn moment(plot: &Plot, cycles: f64) -> f64 {
    plot.at[1] + plot.y.share(cycles) * plot.size[1]
}

/// Returns the number of frames per row.
fn every(rollout: &Range<usize>) -> usize {
    rollout.len().div_ceil(ROWS).max(1)
}

fn rows(canvas: &mut Canvas, walk: &Walk, rollout: &Range<usize>, plot: &Plot, grays: [f64; 2]) {
    let cycle = walk.recording().cycle.max(1) as f64;
    let zero = walk.centre(rollout.start)[0];
    let high = moment(plot, every(rollout) as f64 / cycle) - plot.at[1];
    let mut paths = vec![Vec::new(); GRAYS];
    let cell = plot.size[0] / CELLS as f64;
    for frame in rollout.clone().step_by(every(rollout)) {
        let row: Vec<Option<usize>> = areas(walk, frame, zero, &plot.x)
            .into_iter()
            .map(|area| Some(gray(area?, grays)))
            .collect();
        let y = moment(plot, (frame - rollout.start) as f64 / cycle) + high / 2.0;
        let mut from = 0;
        for run in row.chunk_by(|a, b| a == b) {
            if let Some(gray) = run[0] {
                let x = plot.at[0] + cell * from as f64;
                paths[gray].push(Piece::Level {
                    from: [x, y],
                    length: cell * run.len() as f64,
                });
            }
            from += run.len();
        }
    }
    canvas.clipped(plot.at, plot.size, |canvas| {
        for (gray, lines) in paths
            .into_iter()
            .enumerate()
            .filter(|(_, lines)| !lines.is_empty())
        {
            let level = DARKEST + (LIGHTEST - DARKEST) * gray as f64 / (GRAYS - 1) as f64;
            // Slightly higher than a row, so that no light shines through.
            canvas.path(lines, Pen::new(Colour::gray(level), high + 0.12));
        }
        let centres = rollout.clone().step_by(2).map(|frame| {
            [
                plot.place([walk.centre(frame)[0] - zero, 0.0])[0],
                moment(plot, (frame - rollout.start) as f64 / cycle),
            ]
        });
        let centres: Vec<[f64; 2]> = centres.collect();
        canvas.polyline(&centres, Pen::new(colour::PAPER.with_opacity(150), 1.5));
        canvas.polyline(&centres, Pen::new(colour::TRACE, 0.8));
    });
}

/// Returns the areas of the darkest and lightest gray; only the walk's extremes lie beyond.
fn grays(walk: &Walk, rollouts: &[Range<usize>], x: &Axis) -> [f64; 2] {
    let mut all = Vec::new();
    for rollout in rollouts {
        let zero = walk.centre(rollout.start)[0];
        for frame in rollout.clone().step_by(4 * every(rollout)) {
            all.extend(areas(walk, frame, zero, x).into_iter().flatten());
        }
    }
    all.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        all.get((share * all.len() as f64) as usize)
            .copied()
            .unwrap_or(1.0)
    };
    let (low, high) = (quantile(0.03), quantile(0.97));
    // Keeps a body that hardly changes from looking as if it did.
    let least = (0.2 - (high - low)).max(0.0) / 2.0;
    [low - least, high + least]
}

fn gray(area: f64, [small, large]: [f64; 2]) -> usize {
    let share = ((area - small) / (large - small)).clamp(0.0, 1.0);
    (share * (GRAYS - 1) as f64).round() as usize
}

/// Returns the mean area of the voxels over every cell across.
fn areas(walk: &Walk, frame: usize, zero: f64, axis: &Axis) -> Vec<Option<f64>> {
    let mut sums = vec![(0.0, 0u32); CELLS];
    for (_, corners) in walk.voxels(frame) {
        let xs = corners.map(|[x, _]| axis.share(x - zero) * CELLS as f64);
        let low = xs.iter().copied().fold(f64::INFINITY, f64::min);
        let high = xs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Cells whose middle the voxel covers.
        let first = (low - 0.5).ceil().clamp(0.0, CELLS as f64) as usize;
        let end = ((high - 0.5).floor() + 1.0).clamp(0.0, CELLS as f64) as usize;
        for (sum, count) in sums.iter_mut().take(end).skip(first) {
            (*sum, *count) = (*sum + area(&corners), *count + 1);
        }
    }
    sums.into_iter()
        .map(|(sum, count)| (count > 0).then(|| sum / f64::from(count)))
        .collect()
}

fn stimuli(canvas: &mut Canvas, walk: &Walk, rollout: &Range<usize>, plot: &Plot, beside: bool) {
    let recording = walk.recording();
    let cycle = recording.cycle.max(1) as f64;
    let [left, top] = plot.at;
    let right = left + plot.size[0];
    for (k, phase) in recording
        .phases
        .iter()
        .enumerate()
        .filter(|(_, p)| rollout.contains(&p.first_frame))
    {
        let words = format!("{} vl", signed(phase.displacement));
        let y = moment(plot, (phase.first_frame - rollout.start) as f64 / cycle);
        if phase.first_frame > rollout.start {
            canvas.line(
                [left, y],
                [right + STIMULUS + 8.0, y],
                Pen::new(colour::INK, 0.7).dashed(3.0, 2.0),
            );
        }
        if beside {
            let at = [right + 6.0, y + 3.0];
            // Short phases of a long rollout have room for the picture only, or for nothing.
            let room = moment(plot, walk.phase_frames(k).len() as f64 / cycle) - top;
            if room >= STIMULUS + 6.0 {
                robot::stimulus(canvas, at, STIMULUS, &phase.seen.stimulus);
            }
            if room >= STIMULUS + 18.0 {
                let label = &phase.seen.label;
                let name = label
                    .rsplit_once(" (")
                    .map_or(label.as_str(), |(name, _)| name);
                canvas.fitted(
                    [at[0], at[1] + STIMULUS + 8.0],
                    name,
                    STIMULUS,
                    TextStyle::default().bold(),
                );
                canvas.fitted(
                    [at[0], at[1] + STIMULUS + 17.0],
                    &signed(phase.displacement),
                    STIMULUS,
                    TextStyle::default(),
                );
            }
        } else {
            let size = robot::stimulus(
                canvas,
                [left, top - STIMULUS - 4.0],
                STIMULUS,
                &phase.seen.stimulus,
            );
            let x = left + size[0] + 4.0;
            let most = plot.size[0] - size[0] - 4.0;
            canvas.fitted(
                [x, top - STIMULUS + 4.0],
                &phase.seen.label,
                most,
                TextStyle::default().bold(),
            );
            canvas.fitted(
                [x, top - STIMULUS + 14.0],
                &words,
                most,
                TextStyle::default(),
            );
        }
    }
}

fn axes(canvas: &mut Canvas, plot: &Plot, is_first: bool) {
    plot.lower_axis(canvas, Some("x [voxel lengths]"));
    let [left, top] = plot.at;
    let pen = Pen::new(colour::INK, 0.6);
    canvas.line([left, top], [left, top + plot.size[1]], pen);
    for tick in plot.y.ticks() {
        let y = moment(plot, tick);
        canvas.line([left - 2.5, y], [left, y], pen);
        if is_first {
            canvas.text(
                [left - 4.5, y + 0.36 * TEXT],
                &plot.y.label(tick),
                TextStyle::end(),
            );
        }
    }
    if is_first {
        let x = left - 8.5 - plot.y.labels_width(canvas.font());
        let words = TextStyle {
            upwards: true,
            ..TextStyle::middle()
        };
        canvas.text(
            [x, top + plot.size[1] / 2.0],
            "time [actuation cycles]",
            words,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::simulated;

    #[test]
    fn fresh_rollouts_have_a_panel_each_and_a_continuous_one_has_a_dashed_line_per_change() {
        let panels = |fresh| {
            let recording = simulated("3344/5566", 3, 60, fresh);
            let svg = spacetime(&recording, "robot x", &Style::default())
                .unwrap()
                .svg();
            (
                svg.matches("x [voxel lengths]").count(),
                svg.matches("stroke-dasharray").count(),
            )
        };
        assert_eq!((panels(true), panels(false)), ((3, 0), (1, 2)));
    }

    #[test]
    fn compressed_columns_are_darker() {
        let mut recording = simulated("33", 1, 2, false);
        recording.frames[1] = recording.frames[0].clone();
        recording.frames[1]
            .points
            .iter_mut()
            .for_each(|p| p[1] *= 0.5);
        let walk = Walk::new(&recording).unwrap();
        let x = Axis::exact(-2.0, 2.0, 3);
        let zero = walk.centre(0)[0];
        let middle = |frame| areas(&walk, frame, zero, &x)[CELLS / 2].unwrap();
        assert!(middle(1) < middle(0), "{:?} {:?}", middle(1), middle(0));
        assert_eq!(areas(&walk, 0, zero, &x)[0], None);
        assert_eq!(
            [0.2, 1.0, 9.0].map(|area| gray(area, [0.5, 1.5])),
            [0, 3, GRAYS - 1]
        );
    }

    #[test]
    fn exploded_and_single_frames_are_drawn() {
        let mut recording = simulated("34/56", 1, 5, false);
        recording.frames[5].points[0] = [f64::NAN, 1e300];
        recording.frames[4].points[1] = [1e8, -1e8];
        assert!(spacetime(&recording, "x", &Style::default()).is_ok());
        recording.frames.truncate(1);
        assert!(spacetime(&recording, "x", &Style::default()).is_ok());
    }
}
