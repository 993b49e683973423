//! The team of a report: what it answers, and a few images to watch it by, every robot on a small
//! stage.

use crate::base::Grid;
use crate::commands::report::{Dossier, Team};
use crate::task::direction::THRESHOLD;
use crate::task::judge::Judge;
use crate::task::recording::{Frame, Recording};
use crate::task::voting::Ballot;
use crate::view::colour::TONE_AREAS;
use crate::view::error::PictureError;
use crate::view::html::{escape, materials, pack};
use crate::view::report::{figure, tables};
use crate::view::{plot, teams};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fmt::Write;

/// Steps of a position per voxel length: a body on a small stage has some four pixels to a voxel.
const STEPS: f64 = 32.0;

/// Bytes of all walks of the team together, before they are packed.
const MOST_BYTES: usize = 9_000_000;

/// Control steps from one moment to the next, at least: ten moments of a cycle.
const LEAST_APART: usize = 5;

/// Rollouts that have to be simulated.
pub(super) fn count(team: &Team) -> usize {
    team.images.len() * team.file.members.len()
}

/// What the team answers; with buttons and stages if there are images to watch it by.
pub(super) fn section(
    team: &Team,
    runs: &[Dossier],
    simulated: &(dyn Fn() + Sync),
) -> Result<String, PictureError> {
    let file = &team.file;
    let mut out = "<section id=\"team\">\n<h2>The team</h2>\n".to_string();
    out += "<p>Each robot has one vote for every class of the side it walks to; a walk of at most 3 voxel lengths gives \
     none.</p>\n";
    if let Some((headers, rows)) = teams::table(file) {
        let headers: Vec<&str> = headers.iter().map(String::as_str).collect();
        out += &tables::table(&headers, rows);
    }
    for line in teams::remarks(file) {
        out += &format!("<p>{}.</p>\n", escape(&line));
    }
    if !team.images.is_empty() && !file.members.is_empty() {
        out += &watched(team, runs, simulated)?;
    }
    let figures = [(plot::confusion(file), "column"), (plot::poster(file), "page")];
    let figures: String =
        figures.iter().filter_map(|(found, class)| Some(figure(found.as_ref()?, class))).collect();
    out += &format!("<div class=\"figures\">\n{figures}</div>\n");
    Ok(out + "</section>\n")
}

/// Buttons, the stages, and the walks.
fn watched(team: &Team, runs: &[Dossier], simulated: &(dyn Fn() + Sync)) -> Result<String, PictureError> {
    let file = &team.file;
    let members = file.members.len();
    let jobs: Vec<(usize, usize)> =
        (0..team.images.len()).flat_map(|image| (0..members).map(move |member| (image, member))).collect();
    let largest =
        file.members.iter().map(|member| (member.body.height() + 1) * (member.body.width() + 1)).max();
    // Two bytes for a point.
    let moment = 2 * largest.unwrap_or(1) * jobs.len();
    let steps = file.members.iter().zip(&team.runs).map(|(_, run)| {
        let cycle = runs[*run].run.config.physics.cycle_steps as usize;
        cycle * file.cycles as usize
    });
    let steps = steps.max().unwrap_or(0);
    let apart = (steps * moment).div_ceil(MOST_BYTES).max(LEAST_APART);
    let shown: Vec<usize> = (0..steps).step_by(apart).chain([steps]).collect();
    let walks: Vec<Walked> = jobs
        .par_iter()
        .map(|(image, member)| {
            let walked = Walked::new(&team.record(runs, *member, *image), &shown);
            simulated();
            walked
        })
        .collect();
    let judges: Vec<Judge> = file.members.iter().map(|member| member.judge()).collect();
    let robots: Vec<Value> = file
        .members
        .iter()
        .zip(&judges)
        .zip(&walks)
        .map(|((member, judge), walked)| {
            json!({ "robot": member.id, "task": member.task, "judge": judge, "voxels": walked.voxels,
                "points": walked.points, "at": walked.begin })
        })
        .collect();
    let about = json!({
        "members": robots, "classes": file.classes, "threshold": THRESHOLD, "unit": STEPS, "steps": shown,
        "materials": { "areas": TONE_AREAS, "list": materials() },
    });
    // In a script element only "<" could end it or open another.
    let mut elements = format!(
        "<script type=\"application/json\" id=\"team-robots\">{}</script>\n",
        about.to_string().replace('<', "\\u003c")
    );
    let mut buttons = String::new();
    for (number, (place, walks)) in team.images.iter().zip(walks.chunks(members)).enumerate() {
        let image = file.images[*place];
        let answer = file.answers.as_ref().map(|answers| answers.votes.answers[*place]);
        let tallies: Vec<Value> = (0..shown.len())
            .map(|moment| {
                let moved: Vec<Option<f64>> = walks.iter().map(|walked| walked.moved[moment]).collect();
                let walks = judges.iter().zip(moved.iter().copied());
                let ballot = Ballot::count(&file.classes, walks, file.threshold, file.clip);
                let is_last = moment + 1 == shown.len();
                let has_votes = ballot.votes.iter().any(|votes| *votes > 0);
                let says = if is_last { answer } else { None };
                let says = says.or(has_votes.then(|| file.classes[ballot.by_votes().0]));
                let moved: Vec<Option<f64>> =
                    moved.iter().map(|moved| moved.map(|moved| (100.0 * moved).round() / 100.0)).collect();
                json!({ "moved": moved, "votes": ballot.votes, "says": says })
            })
            .collect();
        let frames: Vec<&str> = walks.iter().map(|walked| walked.positions.as_str()).collect();
        let packed = pack(&json!({ "class": image.label, "frames": frames, "tallies": tallies }))?;
        elements += &format!("<script type=\"text/plain\" id=\"team-{number}\">{packed}</script>\n");
        let says = answer.map_or(String::new(), |answer| format!("says {answer}"));
        let label = format!("class {}, {} {}: {says}", image.label, file.split.split(), image.index);
        buttons += &format!(
            "<button type=\"button\" data-walks=\"team-{number}\" data-right=\"{}\" aria-pressed=\"false\" \
             aria-label=\"{label}\" title=\"{label}\">{}<small>{says}</small></button>",
            answer == Some(image.label),
            thumbnail(&team.seen[team.runs[0]][number].stimulus)
        );
    }
    Ok(format!(
        "<h3>Watch it</h3>\n<p>The first image of each class, as the first robot sees it.</p>\n\
         <div class=\"watch\">{buttons}</div>\n\
         <div class=\"card\"><div class=\"together\"><div class=\"stages\"></div>\
         <ol class=\"tally\" aria-label=\"Votes for each class\"></ol></div>\n\
         <div class=\"bar\"><button type=\"button\" class=\"play\">Pause</button>\
         <input type=\"range\" min=\"0\" max=\"{}\" value=\"0\" aria-label=\"Moment\"><span class=\"says\"></span></div></div>\n{elements}",
        shown.len() - 1
    ))
}

/// A walk at some moments, packed.
struct Walked {
    /// Material and corners of each voxel.
    voxels: Vec<Value>,
    points: usize,
    /// Where its centre of mass is at first \[voxel lengths\].
    begin: f64,
    /// How far it has walked \[voxel lengths\]; none of an unstable one.
    moved: Vec<Option<f64>>,
    /// Its points.
    positions: String,
}

impl Walked {
    fn new(recording: &Recording, shown: &[usize]) -> Self {
        let voxel = |v: &crate::task::recording::VoxelCorners| {
            json!([recording.body.at(v.row as isize, v.column as isize).code(), v.corners])
        };
        let begin = recording.frames[0].centre[0];
        // An unstable walk ends early, and then stands still on its stage.
        let there = |step: &usize| recording.frames.get(*step).filter(|frame| is_finite(frame));
        let frames: Vec<&Frame> = shown.iter().map_while(there).collect();
        let moved = shown.iter().map(|step| there(step).map(|frame| frame.centre[0] - begin)).collect();
        Walked {
            voxels: recording.voxels.iter().map(voxel).collect(),
            points: recording.frames[0].points.len(),
            begin,
            moved,
            positions: BASE64.encode(positions(&frames)),
        }
    }
}

fn is_finite(frame: &Frame) -> bool {
    frame.points.iter().flatten().all(|v| v.is_finite())
}

/// Points in steps of 1/32 voxel length: of the first moment 16-bit numbers, little-endian; of each
/// next one, 8-bit differences to the moment before as it was packed. What moves faster than four
/// voxel lengths from one moment to the next lags behind.
fn positions(frames: &[&Frame]) -> Vec<u8> {
    let steps = |frame: &Frame| -> Vec<i32> {
        frame.points.iter().flatten().map(|v| (v * STEPS).round() as i32).collect()
    };
    let Some((first, others)) = frames.split_first() else { return Vec::new() };
    let mut at: Vec<i32> =
        steps(first).into_iter().map(|v| v.clamp(i32::from(i16::MIN), i32::from(i16::MAX))).collect();
    let mut bytes: Vec<u8> = at.iter().flat_map(|v| (*v as i16).to_le_bytes()).collect();
    for frame in others {
        for (at, to) in at.iter_mut().zip(steps(frame)) {
            let step = to.saturating_sub(*at).clamp(i32::from(i8::MIN), i32::from(i8::MAX));
            *at += step;
            bytes.push(step as i8 as u8);
        }
    }
    bytes
}

/// What sensors see, as a picture.
fn thumbnail(stimulus: &Grid<f64>) -> String {
    let (height, width) = (stimulus.height(), stimulus.width());
    let mut out = format!(
        "<svg viewBox=\"0 0 {width} {height}\" aria-hidden=\"true\" shape-rendering=\"crispEdges\">\
         <rect width=\"{width}\" height=\"{height}\"/>"
    );
    for ((row, column), value) in stimulus.iter() {
        let grey = (255.0 * value.clamp(0.0, 1.0)).round() as u8;
        if grey > 0 {
            // Text is written to memory, which takes it all.
            let _ =
                write!(out, "<path fill=\"#{grey:02x}{grey:02x}{grey:02x}\" d=\"M{column} {row}h1v1h-1z\"/>");
        }
    }
    out + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(points: &[[f64; 2]]) -> Frame {
        Frame { points: points.to_vec(), centre: points[0] }
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
        let mut at: Vec<i32> =
            bytes[..8].chunks(2).map(|b| i32::from(i16::from_le_bytes([b[0], b[1]]))).collect();
        let near = |at: &[i32], frame: &Frame| {
            let points: Vec<f64> = frame.points.iter().flatten().copied().collect();
            at.iter().zip(points).map(|(at, v)| (f64::from(*at) / STEPS - v).abs()).fold(0.0, f64::max)
        };
        assert!(near(&at, &frames[0]) <= 0.5 / STEPS);
        for (number, moment) in bytes[8..].chunks(4).enumerate() {
            at.iter_mut().zip(moment).for_each(|(at, step)| *at += i32::from(*step as i8));
            // The second point jumps by 9.3 voxel lengths; in the third moment it is nearly there.
            let off = near(&at, &frames[number + 1]);
            assert!(if number == 0 { off > 1.0 } else { off < 2.0 }, "{number}: {off}");
        }
    }
}
