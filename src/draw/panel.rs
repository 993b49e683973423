//! The raster picture around the world: stimulus, read-outs, legend, ruler numbers; pixels, y down.

use crate::base::number;
use crate::body::{Body, Material};
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::fonts::EMBEDDED;
use crate::draw::scene::{Primitive, ruler};
use crate::draw::stage::Stage;
use crate::draw::walk::Walk;
use crate::task::answer;
use crate::task::recording::{FramedImage, LabelledStimulus};

/// The side of the stimulus picture at zoom 1, pixels.
const STIMULUS: f64 = 84.0;
/// The largest side of the whole image at zoom 1, pixels, and its distance from the stimulus.
const WHOLE: f64 = 64.0;
const BESIDE: f64 = 6.0;
/// The width of the legend at zoom 1, pixels.
const LEGEND: f64 = 116.0;
/// The margin at the picture's edges at zoom 1, pixels.
const MARGIN: f64 = 10.0;
/// The gap between the words and their neighbours left and right at zoom 1, pixels.
const GAP: f64 = 12.0;

/// Font sizes at zoom 1, pixels.
const LARGE: f64 = 15.0;
const SMALL: f64 = 11.0;
/// The unit of a displacement, and its distance from the number at zoom 1, pixels.
const UNIT: &str = "voxel lengths";
const BEFORE_UNIT: f64 = 5.0;

/// Draws everything around the world at a frame.
pub(crate) fn panel(walk: &Walk, frame: usize, stage: &Stage) -> Vec<Primitive> {
    let z = stage.zoom;
    let mut out = vec![Primitive::rectangle(
        [0.0, 0.0],
        [f64::from(stage.width), stage.panel],
        colour::PAPER,
    )];
    let left = MARGIN * z + whole(walk, frame, [MARGIN * z, MARGIN * z], z, &mut out);
    let side = stimulus(walk, frame, [left, MARGIN * z], z, &mut out);
    let (words, mut end) = (
        left + side[0] + GAP * z,
        f64::from(stage.width) - MARGIN * z,
    );
    if stage.has_legend {
        end -= LEGEND * z;
        legend(walk, [end, MARGIN * z], z, &mut out);
        end -= GAP * z;
    }
    readouts(
        walk,
        frame,
        [words, MARGIN * z],
        (end - words) / z,
        z,
        &mut out,
    );
    numbers(walk, frame, stage, &mut out);
    out
}

/// Returns the width at zoom 1, pixels, from which the legend fits beside the words of a walk. The
/// names of image and robot do not count: they may have any length, and are cut.
pub(crate) fn least_width(walk: &Walk) -> f64 {
    let recording = walk.recording();
    let large = |text: &str| EMBEDDED.width(text, LARGE, true);
    let small = |text: &str| EMBEDDED.width(text, SMALL, false);
    let farthest = (0..walk.frames())
        .map(|frame| walk.displacement(frame).abs())
        .fold(0.0, f64::max);
    let distance = large(&format!("← {}", signed(-farthest))) + BEFORE_UNIT + small(UNIT);
    let ends = (0..recording.phases.len()).map(|phase| walk.phase_frames(phase).end - 1);
    let time = ends
        .map(|frame| readout(walk, frame).time)
        .max_by_key(String::len)
        .unwrap_or_default();
    let judge = recording.judge.as_ref();
    let sides = judge
        .iter()
        .flat_map(|j| [(f64::NEG_INFINITY, &j.left), (f64::INFINITY, &j.right)]);
    let verdicts = sides.map(|(moved, classes)| {
        let class = classes.first().copied().unwrap_or_default();
        large(&answer::verdict(
            judge,
            &recording.names,
            moved,
            class,
            true,
        ))
    });
    let words = verdicts.fold(distance.max(small(&time)), f64::max);
    let images = recording.phases.iter().flat_map(|phase| &phase.seen.image);
    let whole = images.map(|image| whole_size(image, 1.0)[1] + BESIDE);
    MARGIN + whole.fold(0.0, f64::max) + STIMULUS + GAP + words + GAP + LEGEND + MARGIN
}

/// Returns the height and width of an image, pixels, of which a body covers a part: its pixels are
/// squares of whole pixels.
fn whole_size(image: &FramedImage, z: f64) -> [f64; 2] {
    let sides = [image.pixels.height(), image.pixels.width()].map(|side| side as f64);
    let cell = WHOLE * z / sides[0].max(sides[1]).max(1.0);
    let cell = if cell < 1.0 { cell } else { cell.floor() };
    sides.map(|side| cell * side)
}

/// Draws the image of which the sensors see a part, with that part framed. Returns the width that
/// it takes, with the gap behind it; 0 if the sensors see all of the image.
fn whole(walk: &Walk, frame: usize, [x, y]: [f64; 2], z: f64, out: &mut Vec<Primitive>) -> f64 {
    let Some(image) = &walk.phase(frame).seen.image else {
        return 0.0;
    };
    let [height, width] = whole_size(image, z);
    let cell = height / image.pixels.height().max(1) as f64;
    let place = |row: usize, column: usize| [x + cell * column as f64, y + cell * row as f64];
    let edge = Primitive::rectangle([x - z, y - z], [x + width + z, y + height + z], colour::INK);
    out.push(edge);
    for ((row, column), pixel) in image.pixels.iter() {
        out.push(Primitive::rectangle(
            place(row, column),
            place(row + 1, column + 1),
            Colour::gray(f64::from(*pixel) / 255.0),
        ));
    }
    let [rows, columns] = image.window();
    let ([left, top], [right, bottom]) = (place(rows[0], columns[0]), place(rows[1], columns[1]));
    let line = 2.0 * z;
    for [a, b] in [
        [[left, top], [right, top + line]],
        [[left, bottom - line], [right, bottom]],
        [[left, top], [left + line, bottom]],
        [[right - line, top], [right, bottom]],
    ] {
        out.push(Primitive::rectangle(a, b, colour::WINDOW));
    }
    width + BESIDE * z
}

/// The words about a moment of a walk that every view shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Caption {
    pub(crate) label: String,
    /// The control steps completed in the phase, their total, and the cycles completed.
    pub(crate) time: String,
    /// The signed distance in the phase, with the direction as an arrow.
    pub(crate) displacement: String,
    /// The conclusion from the distance ([`answer::verdict`]).
    pub(crate) verdict: String,
}

pub(crate) fn readout(walk: &Walk, frame: usize) -> Caption {
    let frames = walk.phase_frames(walk.phase_index(frame));
    // A phase that continues into the next ends with the first frame of that phase.
    let goes_on = frames.end < walk.frames() && !walk.is_fresh(walk.phase_index(frame) + 1);
    let last = if goes_on {
        frames.end
    } else {
        frames.end.saturating_sub(1)
    };
    let every = walk.recording().every;
    let step = every * frame.saturating_sub(frames.start);
    let cycles = step as f64 / walk.recording().cycle.max(1) as f64;
    let d = walk.displacement(frame);
    let arrow = if d.abs() < 0.005 {
        ' '
    } else if d < 0.0 {
        '←'
    } else {
        '→'
    };
    let LabelledStimulus { class, label, .. } = &walk.phase(frame).seen;
    Caption {
        label: label.clone(),
        time: format!(
            "step {step}/{} · cycle {}",
            every * (last - frames.start),
            number::fixed(cycles, 1)
        ),
        displacement: format!("{arrow} {}", signed(d)),
        verdict: answer::verdict(
            walk.recording().judge.as_ref(),
            &walk.recording().names,
            d,
            *class,
            frame + 1 >= frames.end,
        ),
    }
}

/// Formats a distance with its sign and two decimals, or shorter if it is huge.
pub(crate) fn signed(distance: f64) -> String {
    let is_short = distance.abs() < 1e5;
    let text = if is_short {
        number::signed(distance, 2)
    } else {
        format!("{distance:+.1e}")
    };
    text.replace('-', "−")
}

/// Draws the stimulus, its sensor voxels framed in their colour. Returns its width and height; 0 if
/// it drives nothing of a body with actuators.
fn stimulus(
    walk: &Walk,
    frame: usize,
    [x, y]: [f64; 2],
    z: f64,
    out: &mut Vec<Primitive>,
) -> [f64; 2] {
    // A body that only targets drive sees nothing.
    let has = |is: fn(Material) -> bool| present(&walk.recording().body).any(is);
    if has(Material::is_actuator) && !has(Material::is_sensor) {
        return [0.0; 2];
    }
    let image = &walk.phase(frame).seen.stimulus;
    let longest = image.height().max(image.width()) as f64;
    let cell = (STIMULUS * z / longest).floor().max(1.0);
    let size = [cell * image.width() as f64, cell * image.height() as f64];
    let frame_line = Primitive::rectangle(
        [x - z, y - z],
        [x + size[0] + z, y + size[1] + z],
        colour::INK,
    );
    out.push(frame_line);
    let body = &walk.recording().body;
    for ((row, column), intensity) in image.iter() {
        let [left, top] = [x + cell * column as f64, y + cell * row as f64];
        let [right, bottom] = [left + cell, top + cell];
        out.push(Primitive::rectangle(
            [left, top],
            [right, bottom],
            Colour::gray(*intensity),
        ));
        let at = |dr: isize, dc: isize| body.at(row as isize + dr, column as isize + dc);
        let material = at(0, 0);
        if material.is_sensor() {
            // Outlines the region of one kind of sensor, inside its cells.
            let line = (z * 1.0).min(cell / 3.0).max(1.0);
            let colour = sensor_line(material);
            let mut side = |a, b| out.push(Primitive::rectangle(a, b, colour));
            if at(-1, 0) != material {
                side([left, top], [right, top + line]);
            }
            if at(1, 0) != material {
                side([left, bottom - line], [right, bottom]);
            }
            if at(0, -1) != material {
                side([left, top], [left + line, bottom]);
            }
            if at(0, 1) != material {
                side([right - line, top], [right, bottom]);
            }
        }
    }
    size
}

/// Returns a colour brighter than the voxel, visible on black and on white.
fn sensor_line(material: Material) -> Colour {
    if material == Material::SensorShrink {
        Colour::new(240, 62, 82)
    } else {
        Colour::new(38, 186, 120)
    }
}

/// Draws the words, each line at most `room` wide \[pixels at zoom 1\].
fn readouts(
    walk: &Walk,
    frame: usize,
    [x, y]: [f64; 2],
    room: f64,
    z: f64,
    out: &mut Vec<Primitive>,
) {
    let words = readout(walk, frame);
    let recording = walk.recording();
    let mut line = |[dx, dy]: [f64; 2], text: &str, size: f64, bold, colour| {
        let text = EMBEDDED.fitted(text, size, bold, room - dx);
        let wide = EMBEDDED.width(&text, size, bold);
        out.push(Primitive::Text {
            text,
            at: [x + dx * z, y + dy * z],
            size: size * z,
            bold,
            colour,
        });
        dx + wide
    };
    line([0.0, 14.0], &words.label, LARGE, true, colour::INK);
    line([0.0, 30.0], &words.time, SMALL, false, colour::FAINT);
    let end = line([0.0, 49.0], &words.displacement, LARGE, true, colour::TRACE);
    line([end + BEFORE_UNIT, 49.0], UNIT, SMALL, false, colour::FAINT);
    line([0.0, 67.0], &words.verdict, LARGE, true, colour::INK);
    let end = recording.unstable.then_some("ended unstable");
    let name = Some(format!("robot {}", recording.robot)).filter(|_| !recording.robot.is_empty());
    let parts: Vec<&str> = name.as_deref().into_iter().chain(end).collect();
    let (note, colour) = match recording.unstable {
        true => (parts.join(" · "), colour::ALARM),
        false => (parts.join(" · "), colour::FAINT),
    };
    line([0.0, 83.0], &note, SMALL, false, colour);
}

/// Returns all materials, those that do not evolve last.
pub(crate) fn known() -> impl Iterator<Item = Material> {
    Material::ALL.into_iter().chain(Material::ACTUATORS)
}

/// Returns the materials of a body.
pub(crate) fn present(body: &Body) -> impl Iterator<Item = Material> {
    known().filter(|m| !m.is_empty() && body.voxels().cells().contains(m))
}

fn legend(walk: &Walk, [x, y]: [f64; 2], z: f64, out: &mut Vec<Primitive>) {
    for (k, material) in present(&walk.recording().body).enumerate() {
        let top = y + 14.0 * k as f64 * z;
        // Small, at rest with its mark, and large.
        let (low, high) = (top + 9.0 * z, [x + 4.0 * z, x + 13.0 * z]);
        for (rgb, left, right) in [
            (colour::tones(material)[0], x, high[0]),
            (colour::tones(material)[1], high[0], high[1]),
            (colour::tones(material)[2], high[1], x + 17.0 * z),
        ] {
            out.push(Primitive::rectangle(
                [left, top],
                [right, low],
                Colour { rgb, opacity: 255 },
            ));
        }
        let [_, rgb, _] = colour::tones(material);
        let corners = [
            [high[0], top],
            [high[1], top],
            [high[1], low],
            [high[0], low],
        ];
        let colour = colour::mark_colour(material, Colour { rgb, opacity: 255 });
        out.extend(colour::mark(material).iter().map(|line| {
            Primitive::Line {
                points: line
                    .iter()
                    .map(|point| colour::placed(*point, corners))
                    .collect(),
                width: 1.0,
                colour,
                smooth: true,
            }
        }));
        out.push(Primitive::Text {
            text: material.name().to_string(),
            at: [x + 22.0 * z, top + 8.5 * z],
            size: SMALL * z,
            bold: false,
            colour: colour::INK,
        });
    }
}

fn numbers(walk: &Walk, frame: usize, stage: &Stage, out: &mut Vec<Primitive>) {
    let z = stage.zoom;
    let zero = walk.centre(walk.rollout(frame).start)[0];
    let window = stage.window(frame);
    let step = if window.scale * 10.0 > 45.0 * z {
        10.0
    } else {
        50.0
    };
    for mark in ruler(&window, zero, step) {
        let at = stage.to_pixels(frame, [zero + mark, 0.0]);
        let text = if mark == 0.0 {
            "0".into()
        } else {
            format!("{mark:+}").replace('-', "−")
        };
        // The sign hangs over, so that the digits are centred under their tick.
        let size = SMALL * z;
        let digits = EMBEDDED.width(text.trim_start_matches(['+', '−']), size, false);
        let left = at[0] - digits / 2.0 - (EMBEDDED.width(&text, size, false) - digits);
        // A number that would be cut off at the edge is left out.
        let end = left + EMBEDDED.width(&text, size, false);
        if left < 0.0 || end > f64::from(stage.width) {
            continue;
        }
        let at = [left.round(), at[1] + 18.0 * z];
        out.push(Primitive::Text {
            text,
            at,
            size,
            bold: false,
            colour: colour::FAINT,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Grid;
    use crate::draw::simulated;
    use crate::task::answer::Readout;
    use crate::task::margins::Margins;
    use crate::task::recording::Recording;
    use crate::task::stimulus::StimulusParams;

    #[test]
    fn readouts_count_steps_of_the_phase_and_agree_with_the_displacement() {
        for fresh in [false, true] {
            let recording = simulated("33/44", 2, 100, fresh);
            let walk = Walk::new(&recording).unwrap();
            let first = readout(&walk, walk.phase_frames(1).start);
            assert_eq!(first.time, "step 0/100 · cycle 0.0");
            assert_eq!(first.displacement.trim(), "0.00");
            let last = readout(&walk, walk.frames() - 1);
            assert_eq!(last.time, "step 100/100 · cycle 2.0");
            let walked = recording.phases[1].displacement;
            let arrow = if walked > 0.0 { "→" } else { "←" };
            assert_ne!(signed(walked), "0.00");
            assert_eq!(last.displacement, format!("{arrow} {}", signed(walked)));
            assert_eq!(readout(&walk, 50).time, "step 50/100 · cycle 1.0");
        }
    }

    #[test]
    fn read_outs_end_before_the_legend_and_verdicts_are_whole_at_every_width() {
        let mut recording = simulated("3344/5566", 2, 50, true);
        for (number, frame) in recording.frames.iter_mut().enumerate() {
            frame.centre[0] -= 0.5 * (number % 51) as f64;
        }
        for (left, right, from) in [
            (vec![0], vec![1], 320),
            (vec![0, 1, 2], vec![3], 320),
            ((0..5).collect(), (5..10).collect(), 400),
        ] {
            recording.judge = Some(Readout { left, right });
            let walk = Walk::new(&recording).unwrap();
            let verdict = readout(&walk, 50).verdict;
            assert!(verdict.ends_with(": correct"), "{verdict}");
            let mut with_legend = 0;
            for width in (320..=1500).chain([2048, 4096]) {
                let stage = Stage::new(&walk, width).unwrap();
                let all = panel(&walk, 50, &stage);
                let texts = all.iter().filter_map(|primitive| match primitive {
                    Primitive::Text {
                        text,
                        at,
                        size,
                        bold,
                        ..
                    } if at[1] < stage.panel => Some((
                        text.as_str(),
                        at[0],
                        at[0] + EMBEDDED.width(text, *size, *bold),
                    )),
                    _ => None,
                });
                let is_of_legend = |text: &str| Material::ALL.iter().any(|m| m.name() == text);
                let (legend, words): (Vec<_>, Vec<_>) =
                    texts.partition(|(text, ..)| is_of_legend(text));
                let end = legend
                    .iter()
                    .map(|(_, left, _)| left - 22.0 * stage.zoom)
                    .fold(f64::from(width), f64::min);
                assert!(
                    words.iter().all(|(.., right)| *right < end),
                    "{width}: {words:?} {end}"
                );
                let is_whole = words.iter().any(|(text, ..)| *text == verdict)
                    && words.iter().any(|(text, ..)| *text == UNIT);
                assert!(is_whole || width < from, "{width}: {words:?}");
                assert_eq!(legend.is_empty(), !stage.has_legend);
                with_legend += usize::from(stage.has_legend);
            }
            assert!(with_legend > 980, "{with_legend}");
        }
    }

    #[test]
    fn distances_have_a_sign_and_never_a_negative_zero() {
        assert_eq!(
            [-3.456, -0.001, 2.0].map(signed),
            ["−3.46", "0.00", "+2.00"]
        );
        assert!(signed(-1.0e300).len() < 16 && signed(f64::NAN).len() < 16);
    }

    #[test]
    fn the_image_of_which_sensors_see_a_part_is_beside_it_with_that_part_framed() {
        let mut recording = simulated("3344/5566", 1, 1, false);
        let width = |recording: &Recording| {
            let walk = Walk::new(recording).unwrap();
            (
                least_width(&walk),
                whole(&walk, 0, [0.0; 2], 1.0, &mut Vec::new()),
            )
        };
        let (without, none) = width(&recording);
        let margin = Margins {
            top: 2,
            right: 9,
            bottom: 10,
            left: 3,
        };
        recording.phases[0].seen.image = FramedImage::of(
            &Grid::filled(28, 28, 200),
            &StimulusParams {
                margin,
                ..StimulusParams::default()
            },
        );
        let (with, taken) = width(&recording);
        assert_eq!((none, taken), (0.0, 2.0 * 28.0 + BESIDE));
        assert_eq!(with - without, taken);
        let walk = Walk::new(&recording).unwrap();
        let mut out = Vec::new();
        whole(&walk, 0, [0.0; 2], 1.0, &mut out);
        let corners = out.iter().filter_map(|primitive| match primitive {
            Primitive::Quad { corners, fill, .. } if *fill == colour::WINDOW => Some(*corners),
            _ => None,
        });
        let corners: Vec<[f64; 2]> = corners.flatten().collect();
        let ends = |axis: usize| {
            let places = corners.iter().map(|corner| corner[axis]);
            [
                places.clone().fold(f64::MAX, f64::min),
                places.fold(0.0, f64::max),
            ]
        };
        assert_eq!((ends(0), ends(1)), ([6.0, 38.0], [4.0, 36.0]));
    }

    #[test]
    fn sensors_are_framed_in_the_stimulus() {
        let frames = |body| {
            let recording = simulated(body, 1, 1, false);
            let walk = Walk::new(&recording).unwrap();
            let mut out = vec![];
            stimulus(&walk, 0, [0.0, 0.0], 1.0, &mut out);
            let shrinks = sensor_line(Material::SensorShrink);
            let line =
                |p: &&Primitive| matches!(p, Primitive::Quad { fill, .. } if *fill == shrinks);
            out.iter().filter(line).count()
        };
        assert_eq!(
            (frames("33/33"), frames("53/33"), frames("55/33")),
            (0, 4, 6)
        );
    }
}
