//! Encodes simulations as server-sent events: JSON, with positions as 16-bit numbers in base64.
//!
//! As in the page of a replay, positions are in steps of 1/200 voxel length from an origin per
//! moment, near the centre of mass.

use crate::draw::html::{STEPS, corners, named, quantised};
use crate::serve::catalogue::Who;
use crate::serve::request::{RolloutPlan, SeenPixels};
use crate::serve::simulation::{Event, STEPS_PER_SECOND};
use crate::serve::team::{Name, TeamEvent};
use crate::task::answer::THRESHOLD;
use crate::task::recording::{Frame, VoxelCorners};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};

pub(crate) fn text(event: &Event) -> String {
    let (name, data) = match event {
        Event::Begin {
            id,
            plan,
            voxels,
            frame,
        } => ("begin", begin(*id, plan, voxels, frame)),
        Event::Seen { step, until, seen } => ("seen", looks(*step, *until, seen)),
        Event::Moments {
            step,
            frames,
            answer,
        } => (
            "moments",
            json!({ "step": step, "frames": positions(frames), "answer": answer }),
        ),
        // A comment: the page has nothing to do.
        Event::Still => return ":\n\n".to_string(),
        Event::End {
            step,
            answer,
            unstable,
        } => (
            "end",
            json!({ "step": step, "answer": answer, "unstable": unstable }),
        ),
    };
    format!("event: {name}\ndata: {data}\n\n")
}

pub(crate) fn of_team(event: &TeamEvent) -> String {
    let (name, data) = match event {
        TeamEvent::Begin {
            id,
            plan,
            classes,
            stands,
        } => {
            type Stand = Option<(Vec<VoxelCorners>, Frame)>;
            let member = |((name, who, _), stand): (&(Name, Who, SeenPixels), &Stand)| {
                let (voxels, frame) = stand.as_ref()?;
                Some(json!({
                    "name": name,
                    "body": who.body.to_string(),
                    "voxels": corners(&who.body, voxels),
                    "points": frame.points.len(),
                    "frames": positions(std::slice::from_ref(frame)),
                }))
            };
            let members: Vec<Option<Value>> = plan.members.iter().zip(stands).map(member).collect();
            let seen = looks(0, plan.control_steps, &plan.together);
            let mut words = json!({
                "id": id, "unit": STEPS, "rate": STEPS_PER_SECOND, "threshold": THRESHOLD, "until": plan.control_steps,
                "classes": classes, "seen": seen, "members": members,
            });
            named(&mut words, &plan.members[0].1.names);
            ("begin", words)
        }
        TeamEvent::Moment {
            step,
            frames,
            tally,
        } => {
            let frame = |frame: &Option<Frame>| {
                frame
                    .as_ref()
                    .map(|frame| positions(std::slice::from_ref(frame)))
            };
            let frames: Vec<Option<String>> = frames.iter().map(frame).collect();
            (
                "moment",
                json!({ "step": step, "frames": frames, "tally": tally }),
            )
        }
        TeamEvent::Still => return ":\n\n".to_string(),
        TeamEvent::End { step, tally } => ("end", json!({ "step": step, "tally": tally })),
    };
    format!("event: {name}\ndata: {data}\n\n")
}

fn begin(id: u64, plan: &RolloutPlan, voxels: &[VoxelCorners], frame: &Frame) -> Value {
    let body = &plan.who.body;
    let mut words = json!({
        "id": id,
        "body": body.to_string(),
        "voxels": corners(body, voxels),
        "points": frame.points.len(),
        "unit": STEPS,
        "rate": STEPS_PER_SECOND,
        "threshold": THRESHOLD,
        "cycle": plan.who.physics.cycle_steps,
        "judge": plan.who.judge,
        "frames": positions(std::slice::from_ref(frame)),
        "seen": looks(0, plan.who.protocol.control_steps, &plan.seen),
    });
    named(&mut words, &plan.who.names);
    words
}

fn looks(step: u32, until: u32, seen: &SeenPixels) -> Value {
    let mut words = seen_pixels(seen);
    words["step"] = step.into();
    words["until"] = until.into();
    words
}

/// Describes a stimulus and, if the sensors cover only a part of it, its image.
pub(crate) fn seen_pixels(seen: &SeenPixels) -> Value {
    let mut words = json!({ "label": seen.label, "stimulus": seen.stimulus });
    if let Some(image) = &seen.image {
        words["image"] = json!(image);
    }
    words
}

/// Encodes moments: the origin [x, y] as 64-bit floats, then 16-bit pairs per point; little-endian.
fn positions(frames: &[Frame]) -> String {
    let mut bytes = Vec::new();
    for frame in frames {
        let origin = frame.centre.map(|v| (v * STEPS).round() / STEPS);
        origin
            .iter()
            .for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
        let numbers = frame
            .points
            .iter()
            .flat_map(|point| quantised(*point, origin));
        numbers.for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    }
    BASE64.encode(bytes)
}
