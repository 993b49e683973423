//! The figure of a rollout: poses laid over each other.

use crate::draw::colour;
use crate::draw::error::PictureError;
use crate::draw::panel::signed;
use crate::draw::plot::axes::{Axis, MARGIN, Plot, heading};
use crate::draw::plot::canvas::{Canvas, Pen, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::robot;
use crate::draw::plot::style::Style;
use crate::draw::walk::Walk;
use crate::task::recording::Recording;

/// Side of the stimulus, points.
const STIMULUS: f64 = 27.0;
/// Space between panels, points.
const GAP: f64 = 7.0;
/// Largest size of a voxel, points.
const LARGEST: f64 = 7.0;
/// Opacity of the first pose.
const FAINTEST: f64 = 0.22;

/// Plots poses of a simulation, one per `every` control steps (0: chosen from the walk), earlier
/// ones fainter; a panel per stimulus. `of` names the robot.
pub(crate) fn snapshots(
    recording: &Recording,
    every: usize,
    of: &str,
    style: &Style,
) -> Result<Figure, PictureError> {
    let walk = Walk::new(recording)?;
    let phases = recording.phases.len();
    let (columns, width) = match phases {
        0..=3 => (1, style.column()),
        _ => (style.panels(2), style.page()),
    };
    let every = if every == 0 { suitable(&walk) } else { every };
    let mut canvas = Canvas::new(style);
    let is_rest =
        (0..phases).any(|phase| !(walk.phase_frames(phase).len() - 1).is_multiple_of(every));
    let rest = if is_rest { ", and the last" } else { "" };
    let title = format!("Snapshots every {every} control steps{rest}");
    let top = heading(&mut canvas, &title, of, width);
    let wide = (width - 2.0 * MARGIN - (columns - 1) as f64 * 12.0) / columns as f64;
    // All panels share one scale; each begins where its walk does.
    let reach = (0..phases).map(|phase| reach(&walk, phase));
    let [left, right, highest] = reach.fold([0.0, 0.0, 1.0f64], |a, b| {
        [a[0].min(b[0]), a[1].max(b[1]), a[2].max(b[2])]
    });
    // The whole image stands before what the sensors see of it.
    let has_images = recording
        .phases
        .iter()
        .any(|phase| phase.seen.image.is_some());
    let pictures = STIMULUS + if has_images { STIMULUS + 3.0 } else { 0.0 } + 8.0;
    let plot_width = wide - pictures;
    let scale = (plot_width / (right - left + 2.0)).min(LARGEST);
    let x = Axis::exact(
        (left + right - plot_width / scale) / 2.0,
        (left + right + plot_width / scale) / 2.0,
        6,
    );
    let high = (highest + 0.5) * scale;
    let panel_height = 10.0 + high.max(STIMULUS - 6.0) + 12.0;
    for phase in 0..phases {
        let (row, column) = (phase / columns, phase % columns);
        let at = [
            MARGIN + column as f64 * (wide + 12.0),
            top + row as f64 * (panel_height + GAP),
        ];
        let label = &recording.phases[phase].seen.label;
        let d = signed(recording.phases[phase].displacement);
        let text = format!("{label}: {d} voxel lengths");
        canvas.fitted(
            [at[0] + pictures, at[1] + 7.0],
            &text,
            plot_width,
            TextStyle::default().bold(),
        );
        let seen = &recording.phases[phase].seen;
        if let Some(image) = &seen.image {
            robot::framed(&mut canvas, [at[0], at[1] + 1.0], STIMULUS, image);
        }
        robot::stimulus(
            &mut canvas,
            [at[0] + pictures - STIMULUS - 8.0, at[1] + 1.0],
            STIMULUS,
            &seen.stimulus,
        );
        let plot = Plot {
            at: [at[0] + pictures, at[1] + panel_height - 12.0 - high],
            size: [plot_width, high],
            x: x.clone(),
            y: Axis::exact(0.0, high / scale, 2),
        };
        panel(&mut canvas, &walk, phase, every, &plot);
    }
    let below = top + phases.div_ceil(columns) as f64 * (panel_height + GAP);
    let note = if recording.unstable {
        "ended early: unstable"
    } else {
        "x [voxel lengths] from the start"
    };
    canvas.text([width / 2.0, below + 2.0], note, TextStyle::middle());
    Ok(Figure::new(
        &format!("Snapshots: {of}"),
        [width, below + 4.0 + MARGIN],
        canvas,
    ))
}

/// Returns the steps in which the robot moves half its width, at least a tenth of the longest
/// phase.
fn suitable(walk: &Walk) -> usize {
    let size = walk.extent(0..1);
    let half = 0.5 * (size.right - size.left).max(1.0);
    let phases = &walk.recording().phases;
    let farthest = phases
        .iter()
        .map(|phase| phase.displacement.abs())
        .fold(0.0, f64::max);
    let longest = (0..phases.len())
        .map(|phase| walk.phase_frames(phase).len())
        .max()
        .unwrap_or(1);
    let poses = (farthest / half).round().clamp(2.0, 6.0);
    let cycle = walk.recording().cycle.max(1);
    // Whole cycles, so that all poses have the same muscle phase.
    let steps = longest as f64 / poses;
    ((steps / cycle as f64).round() as usize).max(1) * cycle
}

/// Returns the leftmost and rightmost x from the start of a phase, and the highest y.
fn reach(walk: &Walk, phase: usize) -> [f64; 3] {
    let frames = walk.phase_frames(phase);
    let [zero, start] = walk.centre(frames.start);
    let size = walk.recording().body.width() as f64 + 2.0;
    let height = walk.recording().body.height() as f64;
    let all = walk.extent(frames.clone());
    let centres = || frames.clone().map(|frame| walk.centre(frame)[0] - zero);
    // A body that is thrown apart does not decide the scale.
    let low = (all.left - zero).max(centres().fold(0.0, f64::min) - size);
    let high = (all.right - zero).min(centres().fold(0.0, f64::max) + size);
    [
        low,
        high,
        all.top.min((2.0 * height).max(start + height) + 2.0),
    ]
}

fn panel(canvas: &mut Canvas, walk: &Walk, phase: usize, every: usize, plot: &Plot) {
    let frames = walk.phase_frames(phase);
    let zero = walk.centre(frames.start)[0];
    let place = |[x, y]: [f64; 2]| plot.place([x - zero, y]);
    let last = frames.end - 1;
    let mut shown: Vec<usize> = frames.clone().step_by(every.max(1)).collect();
    // Always draws the last pose; one shortly before it would only blur it.
    shown.retain(|frame| *frame == frames.start || last - frame >= every / 2);
    if !shown.contains(&last) {
        shown.push(last);
    }
    let [left, bottom] = [plot.at[0], plot.at[1] + plot.size[1]];
    canvas.clipped(
        [left, plot.at[1] - 1.0],
        [plot.size[0], plot.size[1] + 1.0],
        |canvas| {
            for (k, frame) in shown.iter().enumerate() {
                let share = (k + 1) as f64 / shown.len() as f64;
                canvas.faded(FAINTEST + (1.0 - FAINTEST) * share * share, |canvas| {
                    robot::pose(canvas, walk, *frame, place);
                });
            }
            let path: Vec<[f64; 2]> = frames
                .clone()
                .step_by(2)
                .map(|frame| place(walk.centre(frame)))
                .collect();
            canvas.polyline(&path, Pen::new(colour::PAPER.with_opacity(190), 1.8));
            canvas.polyline(&path, Pen::new(colour::TRACE, 0.8));
        },
    );
    canvas.line(
        [left, bottom],
        [left + plot.size[0], bottom],
        Pen::new(colour::GROUND_LINE, 0.9),
    );
    for tick in plot.x.ticks() {
        let x = plot.place([tick, 0.0])[0];
        canvas.line(
            [x, bottom],
            [x, bottom + 2.5],
            Pen::new(colour::GROUND_LINE, 0.6),
        );
        // Leaves out numbers that would extend beyond the panel.
        if (left + 4.0..left + plot.size[0] - 4.0).contains(&x) {
            canvas.text(
                [x, bottom + 4.0 + 0.72 * TEXT],
                &plot.x.label(tick),
                TextStyle::middle(),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::plot::style::{COLUMN, PAGE};
    use crate::draw::simulated;

    #[test]
    fn there_is_a_panel_per_stimulus_and_a_pose_every_so_often() {
        let recording = simulated("3344/5566", 2, 100, true);
        let figure = snapshots(&recording, 25, "robot x", &Style::default()).unwrap();
        assert_eq!(figure.svg().matches("<g opacity").count(), 2 * 5);
        assert!(figure.svg().contains("1 (train 3)") && figure.size()[0] == COLUMN);
        let four = simulated("3344/5566", 4, 100, true);
        assert_eq!(
            snapshots(&four, 0, "robot x", &Style::default())
                .unwrap()
                .size()[0],
            PAGE
        );
    }

    #[test]
    fn a_robot_that_starts_high_up_is_not_above_the_figure() {
        let mut recording = simulated("34/56", 1, 5, false);
        for frame in &mut recording.frames {
            frame.points.iter_mut().for_each(|point| point[1] += 40.0);
            frame.centre[1] += 40.0;
        }
        assert!(reach(&Walk::new(&recording).unwrap(), 0)[2] > 41.0);
    }

    #[test]
    fn exploded_and_single_frames_are_drawn() {
        let mut recording = simulated("34/56", 1, 5, false);
        recording.frames[5].points[0] = [f64::NAN, 1e300];
        recording.frames[4].points[1] = [1e8, -1e8];
        recording.frames[5].centre = [f64::INFINITY; 2];
        recording.unstable = true;
        assert!(
            snapshots(&recording, 1, "x", &Style::default())
                .unwrap()
                .svg()
                .contains("unstable")
        );
        recording.frames.truncate(1);
        assert!(snapshots(&recording, 0, "x", &Style::default()).is_ok());
    }
}
