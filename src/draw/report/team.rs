//! The team of a report: its answers, and a few images under which all robots walk on small stages.

use crate::analysis::dossier::{Dossier, Team};
use crate::analysis::votes::Tally;
use crate::base::Grid;
use crate::base::threads::in_pool;
use crate::draw::error::PictureError;
use crate::draw::html::{corners, escape, materials, named, pack};
use crate::draw::plot;
use crate::draw::plot::{COLUMN, Figure, Style};
use crate::draw::report::decisions;
use crate::draw::report::{figure, tables};
use crate::search::held_out_run::control_steps;
use crate::store::team::Member;
use crate::task::answer::Readout;
use crate::task::recording::{Frame, Recording, VoxelCorners};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fmt::Write;

/// Steps of a position per voxel length: on a small stage a voxel has some four pixels.
const STEPS: f64 = 32.0;

/// Bytes of all walks of the team before packing.
const MOST_BYTES: usize = 9_000_000;

/// Minimum control steps from one moment to the next: ten moments a cycle.
const LEAST_APART: usize = 5;

pub(super) fn count(team: &Team) -> usize {
    team.images.len() * team.file.members.len()
}

/// Returns the team's answers, with buttons and stages if there are images to watch it by.
pub(super) fn section(
    team: &Team,
    runs: &[Dossier],
    simulated: &(dyn Fn() + Sync),
) -> Result<String, PictureError> {
    let file = &team.file;
    let mut out = "<section id=\"team\">\n<h2>The team</h2>\n".to_string();
    out += &format!(
        "<p>Each robot has one vote for every class of the side it walks to; a walk of at most {} voxel lengths \
         gives none.</p>\n",
        file.threshold
    );
    if let Some((headers, rows)) = decisions::table(file) {
        let headers: Vec<&str> = headers.iter().map(String::as_str).collect();
        out += &tables::table(&headers, rows);
    }
    for line in decisions::remarks(file) {
        out += &format!("<p>{}.</p>\n", escape(&line));
    }
    if count(team) > 0 {
        out += &watched(team, runs, simulated)?;
    }
    let figures = [
        plot::confusion(file, &Style::default()),
        plot::poster(file, &Style::default()),
    ]
    .into_iter()
    .flatten();
    let class = |figure: &Figure| {
        if figure.size()[0] > COLUMN + 1.0 {
            "page"
        } else {
            "column"
        }
    };
    let figures: String = figures.map(|found| figure(&found, class(&found))).collect();
    out += &format!("<div class=\"figures\">\n{figures}</div>\n");
    Ok(out + "</section>\n")
}

/// Returns the buttons, the stages and the walks.
fn watched(
    team: &Team,
    runs: &[Dossier],
    simulated: &(dyn Fn() + Sync),
) -> Result<String, PictureError> {
    let shown = shown(team, runs);
    let members = team.file.members.len();
    let jobs: Vec<(usize, usize)> = (0..team.images.len())
        .flat_map(|image| (0..members).map(move |member| (image, member)))
        .collect();
    let walk = |(image, member): &(usize, usize)| {
        let walk = PackedWalk::new(&team.record(runs, *member, *image), &shown);
        simulated();
        walk
    };
    let walks: Vec<PackedWalk> = in_pool(|| jobs.par_iter().map(walk).collect())?;
    // In a script element, only "<" can end it or open another.
    let robots = robots(team, &walks, &shown)
        .to_string()
        .replace('<', "\\u003c");
    let mut elements =
        format!("<script type=\"application/json\" id=\"team-robots\">{robots}</script>\n");
    let mut buttons = String::new();
    for (number, walks) in walks.chunks(members).enumerate() {
        elements += &format!(
            "<script type=\"text/plain\" id=\"team-{number}\">{}</script>\n",
            pack(&under_image(team, number, walks))?
        );
        buttons += &button(team, number);
    }
    Ok(format!(
        "<h3>Watch it</h3>\n<p>The first image of each class, as all robots see it together.</p>\n\
         <div class=\"watch\">{buttons}</div>\n\
         <div class=\"card\"><div class=\"together\"><div class=\"stages\"></div>\
         <ol class=\"tally\" aria-label=\"Votes for each class\"></ol></div>\n\
         <div class=\"bar\"><button type=\"button\" class=\"play\">Pause</button>\
         <input type=\"range\" min=\"0\" max=\"{}\" value=\"0\" aria-label=\"Moment\">\
         <span class=\"says\"></span></div></div>\n{elements}",
        shown.len() - 1
    ))
}

/// Returns the moments to show, in control steps, including the first and the last.
fn shown(team: &Team, runs: &[Dossier]) -> Vec<usize> {
    let Team { file, runs: of, .. } = team;
    let points = |member: &Member| (member.body.height() + 1) * (member.body.width() + 1);
    let points = file.members.iter().map(points).max().unwrap_or(0);
    let steps = of
        .iter()
        .map(|run| control_steps(&runs[*run].run.config, file.cycles) as usize);
    let steps = steps.max().unwrap_or(0);
    // Two bytes for a point.
    let apart = (steps * 2 * points * count(team))
        .div_ceil(MOST_BYTES)
        .max(LEAST_APART);
    (0..steps).step_by(apart).chain([steps]).collect()
}

/// Returns the robots and the data for the page's script that all walks share. The first walks are
/// those under the first image, one per robot.
fn robots(team: &Team, walks: &[PackedWalk], shown: &[usize]) -> Value {
    let file = &team.file;
    let robot = |(member, walk): (&Member, &PackedWalk)| {
        json!({
            "robot": member.id, "task": member.task, "judge": member.judge(), "points": walk.points,
            "voxels": corners(&member.body, &walk.voxels), "at": walk.begin,
        })
    };
    let mut robots = json!({
        "members": file.members.iter().zip(walks).map(robot).collect::<Vec<_>>(), "classes": file.classes,
        "threshold": file.threshold, "unit": STEPS, "steps": shown, "materials": materials(),
    });
    named(&mut robots, &file.names());
    robots
}

/// Returns all walks under an image, and the tally at every moment.
fn under_image(team: &Team, number: usize, walks: &[PackedWalk]) -> Value {
    let file = &team.file;
    let judges: Vec<Readout> = file.members.iter().map(Member::judge).collect();
    let judges: Vec<&Readout> = judges.iter().collect();
    let tally = |moment: usize| {
        let moved = walks.iter().map(|walk| walk.moved[moment]).collect();
        Tally::of(&file.classes, &judges, moved, (file.threshold, file.clip))
    };
    let tallies: Vec<Tally> = (0..walks[0].moved.len()).map(tally).collect();
    json!({
        "class": file.images[team.images[number]].label, "answer": answer(team, number),
        "frames": walks.iter().map(|walk| walk.positions.as_str()).collect::<Vec<_>>(), "tallies": tallies,
    })
}

/// Returns the team's answer to one of the images to watch it by.
fn answer(team: &Team, number: usize) -> u8 {
    let answers = team
        .file
        .answers
        .as_ref()
        .expect("a team that has not answered is left out");
    answers.votes.answers[team.images[number]]
}

/// Returns a button that plays the walks under an image.
fn button(team: &Team, number: usize) -> String {
    let image = team.file.images[team.images[number]];
    let (answer, names) = (answer(team, number), team.file.names());
    let says = escape(&names.name(answer));
    let label = format!(
        "class {}, {} {}: says {says}",
        escape(&names.name(image.label)),
        team.file.split.split(),
        image.index
    );
    format!(
        "<button type=\"button\" data-walks=\"team-{number}\" data-right=\"{}\" aria-pressed=\"false\" \
         aria-label=\"{label}\" title=\"{label}\">{}<small>says {says}</small></button>",
        answer == image.label,
        thumbnail(&team.together[number].stimulus)
    )
}

/// A walk at some moments, its points packed.
struct PackedWalk {
    voxels: Vec<VoxelCorners>,
    points: usize,
    /// The centre of mass at first, x \[voxel lengths\].
    begin: f64,
    /// The distance walked \[voxel lengths\]; `None` for moments that are missing or unstable.
    moved: Vec<Option<f64>>,
    /// The points, packed by [`positions`], in base64.
    positions: String,
}

impl PackedWalk {
    fn new(recording: &Recording, shown: &[usize]) -> Self {
        let first = &recording.frames[0];
        let begin = first.centre[0];
        // An unstable walk ends early, and then stands still on its stage.
        let there = |step: &usize| recording.frames.get(*step).filter(|frame| is_finite(frame));
        let frames: Vec<&Frame> = shown.iter().map_while(there).collect();
        PackedWalk {
            voxels: recording.voxels.clone(),
            points: first.points.len(),
            begin,
            moved: shown
                .iter()
                .map(|step| there(step).map(|frame| frame.centre[0] - begin))
                .collect(),
            positions: BASE64.encode(positions(&frames)),
        }
    }
}

fn is_finite(frame: &Frame) -> bool {
    frame.points.iter().flatten().all(|v| v.is_finite())
}

/// Packs points in steps of 1/32 voxel length. The first moment has 16-bit numbers, little-endian;
/// each next one has 8-bit differences from the packed previous moment. Points that move faster
/// than four voxel lengths per moment lag behind.
fn positions(frames: &[&Frame]) -> Vec<u8> {
    let steps = |frame: &Frame| -> Vec<i32> {
        frame
            .points
            .iter()
            .flatten()
            .map(|v| (v * STEPS).round() as i32)
            .collect()
    };
    let Some((first, others)) = frames.split_first() else {
        return Vec::new();
    };
    let mut at: Vec<i32> = steps(first)
        .into_iter()
        .map(|v| v.clamp(i32::from(i16::MIN), i32::from(i16::MAX)))
        .collect();
    let mut bytes: Vec<u8> = at.iter().flat_map(|v| (*v as i16).to_le_bytes()).collect();
    for frame in others {
        for (at, to) in at.iter_mut().zip(steps(frame)) {
            let step = to
                .saturating_sub(*at)
                .clamp(i32::from(i8::MIN), i32::from(i8::MAX));
            *at += step;
            bytes.push(step as i8 as u8);
        }
    }
    bytes
}

/// Draws the stimulus that the sensors measure.
fn thumbnail(stimulus: &Grid<f64>) -> String {
    let (height, width) = (stimulus.height(), stimulus.width());
    let mut out = format!(
        "<svg viewBox=\"0 0 {width} {height}\" aria-hidden=\"true\" shape-rendering=\"crispEdges\">\
         <rect width=\"{width}\" height=\"{height}\"/>"
    );
    for ((row, column), value) in stimulus.iter() {
        let grey = (255.0 * value.clamp(0.0, 1.0)).round() as u8;
        if grey > 0 {
            // Writing text to memory cannot fail.
            let _ = write!(
                out,
                "<path fill=\"#{grey:02x}{grey:02x}{grey:02x}\" d=\"M{column} {row}h1v1h-1z\"/>"
            );
        }
    }
    out + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(points: &[[f64; 2]]) -> Frame {
        Frame {
            points: points.to_vec(),
            centre: points[0],
        }
    }

    #[test]
    fn packed_points_are_within_half_a_step_and_catch_up_with_a_jump() {
        let frames = [
            frame(&[[0.0, 1.0], [-3.3, 7.77]]),
            frame(&[[0.4, 0.9], [6.0, 7.5]]),
            frame(&[[0.41, 0.9], [6.0, 7.5]]),
        ];
        let bytes = positions(&frames.iter().collect::<Vec<_>>());
        assert_eq!(bytes.len(), 8 + 2 * 4);
        let mut at: Vec<i32> = bytes[..8]
            .chunks(2)
            .map(|b| i32::from(i16::from_le_bytes([b[0], b[1]])))
            .collect();
        let near = |at: &[i32], frame: &Frame| {
            let points: Vec<f64> = frame.points.iter().flatten().copied().collect();
            at.iter()
                .zip(points)
                .map(|(at, v)| (f64::from(*at) / STEPS - v).abs())
                .fold(0.0, f64::max)
        };
        assert!(near(&at, &frames[0]) <= 0.5 / STEPS);
        for (number, moment) in bytes[8..].chunks(4).enumerate() {
            at.iter_mut()
                .zip(moment)
                .for_each(|(at, step)| *at += i32::from(*step as i8));
            // The second point jumps by 9.3 voxel lengths; in the third moment it is nearly there.
            let off = near(&at, &frames[number + 1]);
            assert!(
                if number == 0 { off > 1.0 } else { off < 2.0 },
                "{number}: {off}"
            );
        }
    }
}
