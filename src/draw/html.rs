//! One self-contained HTML page that plays a recording: no network, works from `file://`.
//!
//! Positions are embedded as 16-bit numbers, in steps of 1/200 voxel length from an origin per
//! frame (near the centre of mass, as 64-bit floats). They are accurate to 0.0025 voxel lengths
//! however far the robot walks. Small pages are coarser and keep only some moments of the walk.

use crate::body::{Body, Material};
use crate::draw::colour::{TONE_AREAS, mark, tones};
use crate::draw::error::{PictureError, write_whole};
use crate::draw::film;
use crate::draw::panel::known;
use crate::draw::walk::Walk;
use crate::sim::TerrainObject;
use crate::task::answer::THRESHOLD;
use crate::task::class_names::ClassNames;
use crate::task::recording::{Recording, VoxelCorners};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;

const TEMPLATE: &str = include_str!("replay.html");
const SCRIPT: &str = concat!(include_str!("drawing.js"), include_str!("replay.js"));
/// The steps of a position per voxel length.
pub(crate) const STEPS: f64 = 200.0;
/// The steps per voxel length in small pages, whose voxels are some twenty pixels wide.
const COARSE_STEPS: f64 = 50.0;
/// The approximate number of coordinates in a small page: ten moments a cycle for a body of 14 × 14
/// voxels under two images.
const SMALL: usize = 100_000;
/// The maximum size of a small page's recording, bytes in base64: with the script and a still
/// picture, a notebook's robot stays below 150 kB.
const MOST_SMALL: usize = 85_000;
/// Code of a position that is not finite or over 163 voxel lengths from the frame's origin.
const NOWHERE: i16 = i16::MIN;
/// The maximum size of positions in a page, bytes (a third more in base64). Longer recordings keep
/// every second frame, third …
const MOST_BYTES: usize = 5_500_000;

/// Writes the page. The `title` and `metadata` (a table, in order) may contain any text.
pub(crate) fn write(
    path: &Path,
    recording: &Recording,
    title: &str,
    metadata: &[(String, String)],
) -> Result<(), PictureError> {
    write_whole(path, page(recording, title, metadata)?.as_bytes())
}

/// Returns the page as text.
///
/// # Errors
/// [`PictureError::Recording`] if the recording cannot be drawn.
pub fn page(
    recording: &Recording,
    title: &str,
    metadata: &[(String, String)],
) -> Result<String, PictureError> {
    let walk = Walk::new(recording)?;
    let rollout = rollout(&walk, MOST_BYTES).to_string();
    // In a script element, only "<" can end it or open another.
    Ok(filled(
        recording,
        title,
        metadata,
        &rollout.replace('<', "\\u003c"),
    ))
}

/// Returns a page as text, small enough for a notebook with many robots. It keeps some moments of
/// the walk; its script interpolates points linearly between them.
///
/// # Errors
/// Returns a [`PictureError`] if the recording cannot be drawn.
pub fn small_page(
    recording: &Recording,
    title: &str,
    metadata: &[(String, String)],
) -> Result<String, PictureError> {
    let walk = Walk::new(recording)?;
    let coordinates = walk.frames() * 2 * points(recording);
    let mut every = coordinates.div_ceil(SMALL).max(1);
    let packed = loop {
        let (mut rollout, positions) = moments(&walk, every, COARSE_STEPS);
        rollout["positions"] =
            packed_bytes(&differences(&positions, 2 * points(recording)))?.into();
        rollout["small"] = true.into();
        let packed = pack(&rollout)?;
        // Bodies that shake a lot compress badly; with two moments of each image there is no less.
        if packed.len() <= MOST_SMALL || every >= walk.frames() {
            break packed;
        }
        every += every.div_ceil(4);
    };
    Ok(filled(recording, title, metadata, &packed))
}

/// Fills the template with a recording, as JSON or packed.
fn filled(
    recording: &Recording,
    title: &str,
    metadata: &[(String, String)],
    rollout: &str,
) -> String {
    let rows = metadata.iter().map(|(key, value)| {
        format!(
            "<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n",
            escape(key),
            escape(value)
        )
    });
    let warning = if recording.unstable {
        "<p class=\"alarm\" role=\"alert\">The simulation became unstable and ended early.</p>"
    } else {
        ""
    };
    fill(
        TEMPLATE,
        &[
            ("title", &escape(title)),
            ("style", include_str!("replay.css")),
            ("script", SCRIPT),
            ("metadata", &rows.collect::<String>()),
            ("warning", warning),
            ("rollout", rollout),
        ],
    )
}

/// Returns a page whose recording is `rollout`.
pub(super) fn player(rollout: &str) -> String {
    fill(
        TEMPLATE,
        &[
            ("title", ""),
            (
                "style",
                concat!(
                    include_str!("replay.css"),
                    include_str!("report/player.css")
                ),
            ),
            ("script", SCRIPT),
            ("metadata", ""),
            ("warning", ""),
            ("rollout", rollout),
        ],
    )
}

/// Packs a recording for [`player`]: gzip in base64, of about `most` bytes at the largest.
pub(super) fn packed(walk: &Walk, most: usize) -> Result<String, PictureError> {
    pack(&rollout(walk, most))
}

/// Packs a value as text: gzip in base64. The bytes are reproducible: the header holds no time.
pub(super) fn pack(value: &Value) -> Result<String, PictureError> {
    packed_bytes(value.to_string().as_bytes())
}

fn packed_bytes(bytes: &[u8]) -> Result<String, PictureError> {
    let failed = |error: std::io::Error| PictureError::Encode(error.to_string());
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(bytes).map_err(failed)?;
    Ok(BASE64.encode(packer.finish().map_err(failed)?))
}

/// Returns the differences of positions from the previous moment, coordinate by coordinate. All low
/// bytes come before all high bytes, which compresses best.
fn differences(positions: &[i16], width: usize) -> Vec<u8> {
    let of_coordinate = |coordinate: usize| {
        let own = positions.iter().skip(coordinate).step_by(width.max(1));
        own.scan(0_i16, |before, &now| {
            Some(now.wrapping_sub(std::mem::replace(before, now)))
        })
    };
    let words: Vec<[u8; 2]> = (0..width)
        .flat_map(of_coordinate)
        .map(i16::to_le_bytes)
        .collect();
    [0, 1]
        .into_iter()
        .flat_map(|byte| words.iter().map(move |word| word[byte]))
        .collect()
}

fn points(recording: &Recording) -> usize {
    recording
        .frames
        .iter()
        .map(|f| f.points.len())
        .min()
        .unwrap_or(0)
}

/// Returns the recording in the format of the page's script. Longer rollouts keep fewer frames, so
/// that positions take at most `most` bytes.
fn rollout(walk: &Walk, most: usize) -> Value {
    let every = (walk.frames() * points(walk.recording()) * 4)
        .div_ceil(most.max(1))
        .max(1);
    let (mut rollout, positions) = moments(walk, every, STEPS);
    rollout["positions"] = BASE64
        .encode(bytes(positions.into_iter().map(i16::to_le_bytes)))
        .into();
    rollout
}

/// Samples every `every`-th frame of each phase and its last. Returns everything but the positions,
/// and the positions in steps of 1/`unit` voxel length from the origin of their frame.
fn moments(walk: &Walk, every: usize, unit: f64) -> (Value, Vec<i16>) {
    let recording = walk.recording();
    let points = points(recording);
    let shown = film::shown(walk, every);
    let origins: Vec<[f64; 2]> = shown
        .iter()
        .map(|f| walk.centre(*f).map(|v| (v * STEPS).round() / STEPS))
        .collect();
    let positions = shown.iter().zip(&origins).flat_map(|(f, origin)| {
        recording.frames[*f]
            .points
            .iter()
            .take(points)
            .flat_map(|p| in_steps(*p, *origin, unit))
    });
    let positions = positions.collect();
    let phases = recording.phases.iter().enumerate().map(|(k, phase)| {
        let range = walk.phase_frames(k);
        let first = shown.partition_point(|f| *f < range.start);
        let stimulus = phase
            .seen
            .stimulus
            .rows()
            .flatten()
            .map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8);
        let mut words = json!({
            "first": first,
            "label": phase.seen.label,
            "class": phase.seen.class,
            "displacement": number(phase.displacement),
            "fresh": walk.is_fresh(k),
            "height": phase.seen.stimulus.height(),
            "width": phase.seen.stimulus.width(),
            "stimulus": BASE64.encode(stimulus.collect::<Vec<u8>>()),
        });
        if let Some(image) = &phase.seen.image {
            words["image"] = json!(image);
        }
        words
    });
    let body = &recording.body;
    let has_actuators = body.voxels().cells().iter().any(|m| m.is_actuator());
    let mut rollout = json!({
        "robot": recording.robot,
        "body": body.to_string(),
        "voxels": corners(body, &recording.voxels),
        "points": points,
        "cycle": recording.cycle.max(1),
        "unstable": recording.unstable,
        "judge": recording.judge,
        "threshold": THRESHOLD,
        "steps": shown,
        "phases": phases.collect::<Vec<_>>(),
        "unit": unit,
        "origins": BASE64.encode(bytes(origins.iter().flatten().map(|v| v.to_le_bytes()))),
        "materials": if has_actuators { described(known()) } else { materials() },
    });
    if let Some(terrain) = &recording.terrain {
        let object = |object: &TerrainObject| {
            let rows = object.cells.rows().map(|row| {
                let cell = |fixed: &bool| if *fixed { '5' } else { '0' };
                row.iter().map(cell).collect::<String>()
            });
            json!({ "column": object.column, "row": object.row, "grid": rows.collect::<Vec<_>>() })
        };
        let objects = terrain.objects().iter().map(object);
        rollout["terrain"] = objects.collect::<Vec<_>>().into();
    }
    named(&mut rollout, &recording.names);
    (rollout, positions)
}

/// Adds the names of the classes for the pages' scripts, if there are any.
pub(crate) fn named(object: &mut Value, names: &ClassNames) {
    if !names.all().is_empty() {
        object["class_names"] = names.all().into();
    }
}

/// Describes the materials that evolve for the pages' scripts.
pub(crate) fn materials() -> Value {
    described(Material::ALL.into_iter())
}

/// Describes materials for the pages' scripts, in the order of their numbers.
fn described(materials: impl Iterator<Item = Material>) -> Value {
    let material = |m: Material| {
        let (name, tones, mark) = (m.name(), tones(m), mark(m));
        json!({ "name": name, "tones": tones, "mark": mark, "sensor": m.is_sensor(), "muscle": m.is_muscle() })
    };
    json!({ "areas": TONE_AREAS, "list": materials.map(material).collect::<Vec<_>>() })
}

/// Describes voxels for the pages' scripts: material, corners, row and column.
pub(crate) fn corners(body: &Body, voxels: &[VoxelCorners]) -> Vec<Value> {
    let corners = |v: &VoxelCorners| {
        let material = body.at(v.row as isize, v.column as isize);
        json!([material.code(), v.corners, v.row, v.column])
    };
    voxels.iter().map(corners).collect()
}

fn bytes<const N: usize>(words: impl Iterator<Item = [u8; N]>) -> Vec<u8> {
    words.flatten().collect()
}

pub(crate) fn quantised(point: [f64; 2], origin: [f64; 2]) -> [i16; 2] {
    in_steps(point, origin, STEPS)
}

fn in_steps(point: [f64; 2], origin: [f64; 2], unit: f64) -> [i16; 2] {
    let steps = [0, 1].map(|k| ((point[k] - origin[k]) * unit).round());
    if steps.iter().all(|s| s.abs() < 32767.0) {
        steps.map(|s| s as i16)
    } else {
        [NOWHERE; 2]
    }
}

/// Returns `None` for infinite values and NaN, which JSON lacks.
fn number(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Escapes text for HTML elements and quoted attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            _ => out.push(letter),
        }
    }
    out
}

/// Replaces each `{{name}}` of a template in one pass; inserted values are not expanded again.
pub(super) fn fill(template: &str, values: &[(&str, &str)]) -> String {
    let mut out = String::new();
    let mut rest = template;
    while let Some((before, (name, after))) = rest
        .split_once("{{")
        .and_then(|(b, r)| Some((b, r.split_once("}}")?)))
    {
        out.push_str(before);
        out.extend(
            values
                .iter()
                .find(|(n, _)| *n == name)
                .map(|(_, value)| *value),
        );
        rest = after;
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Grid;
    use crate::draw::simulated;
    use crate::task::margins::Margins;
    use crate::task::recording::FramedImage;
    use crate::task::stimulus::StimulusParams;

    fn embedded(page: &str) -> Value {
        let (_, rest) = page
            .split_once("<script type=\"application/json\" id=\"rollout\">")
            .unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    /// Decodes the positions of every stored frame as the script does.
    fn positions(rollout: &Value) -> Vec<Vec<Option<[f64; 2]>>> {
        let data = |key: &str| BASE64.decode(rollout[key].as_str().unwrap()).unwrap();
        let origins: Vec<f64> = data("origins")
            .chunks(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
            .collect();
        let steps: Vec<i16> = data("positions")
            .chunks(2)
            .map(|b| i16::from_le_bytes(b.try_into().unwrap()))
            .collect();
        let points = rollout["points"].as_u64().unwrap() as usize;
        let frames = steps.chunks(2 * points).zip(origins.chunks(2));
        let position = |p: &[i16], o: &[f64]| {
            (p[0] != NOWHERE)
                .then(|| [0, 1].map(|k| f64::from(p[k]) / rollout["unit"].as_f64().unwrap() + o[k]))
        };
        frames
            .map(|(frame, o)| frame.chunks(2).map(|p| position(p, o)).collect())
            .collect()
    }

    #[test]
    fn embedded_positions_decode_within_a_200th_of_a_voxel_however_far() {
        for far in [0.0, -321.7, 1e6] {
            let mut recording = simulated("3344/1256", 2, 40, true);
            recording.frames.iter_mut().for_each(|f| {
                f.points.iter_mut().for_each(|p| p[0] += far);
                f.centre[0] += far;
            });
            let rollout = embedded(&page(&recording, "", &[]).unwrap());
            let decoded = positions(&rollout);
            assert_eq!(decoded.len(), recording.frames.len());
            for (frame, points) in recording.frames.iter().zip(&decoded) {
                for (p, q) in frame.points.iter().zip(points) {
                    let q = q.unwrap();
                    assert!(
                        (p[0] - q[0]).abs() < 0.005 && (p[1] - q[1]).abs() < 0.005,
                        "{p:?} {q:?}"
                    );
                }
            }
            assert_eq!(rollout["phases"][1]["first"], 41);
            assert_eq!(rollout["phases"][1]["fresh"], true);
        }
    }

    #[test]
    fn the_page_needs_no_network_and_lets_no_text_become_markup() {
        let mut recording = simulated("34/56", 1, 5, false);
        recording.robot = "</script><script>alert(1)</script>".into();
        recording.phases[0].seen.label = "<script>".into();
        let metadata = [(
            "<b>".to_string(),
            "\"{{rollout}}\" & <script>x</script>".to_string(),
        )];
        let page = page(&recording, "<script>alert('t')</script>", &metadata).unwrap();
        for forbidden in [
            "http://",
            "https://",
            "src=",
            "@import",
            "url(",
            "<link",
            "{{title",
            "{{rollout}}</",
        ] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
        let scripts = TEMPLATE.matches("<script").count();
        assert_eq!(page.matches("<script").count(), scripts);
        assert_eq!(page.matches("</script").count(), scripts);
        assert!(
            page.contains("&lt;script&gt;alert(&#39;t&#39;)")
                && page.contains("{{rollout}}&quot; &amp; &lt;")
        );
        assert_eq!(embedded(&page)["robot"], recording.robot.as_str());
    }

    #[test]
    fn the_page_has_the_image_of_which_sensors_see_a_part_and_the_margins_of_that_part() {
        let mut recording = simulated("34/56", 2, 5, true);
        let margin = Margins {
            top: 1,
            right: 2,
            bottom: 3,
            left: 4,
        };
        recording.phases[1].seen.image = FramedImage::of(
            &Grid::filled(8, 9, 7),
            &StimulusParams {
                margin,
                ..StimulusParams::default()
            },
        );
        let phases = embedded(&page(&recording, "", &[]).unwrap())["phases"].clone();
        assert_eq!(phases[0]["image"], Value::Null);
        let image = json!({ "margin": [1, 2, 3, 4], "pixels": vec![vec![7; 9]; 8] });
        assert_eq!(phases[1]["image"], image);
    }

    #[test]
    fn unstable_rollouts_say_so_and_leave_out_what_is_nowhere() {
        let mut recording = simulated("34/56", 1, 5, false);
        assert!(
            !page(&recording, "", &[])
                .unwrap()
                .contains("became unstable")
        );
        recording.unstable = true;
        recording.frames[5].points[0] = [f64::NAN, 1.0];
        recording.frames[5].points[1] = [1e200, 1.0];
        recording.frames[5].centre = [f64::NAN; 2];
        recording.phases[0].displacement = f64::NAN;
        let page = page(&recording, "", &[]).unwrap();
        assert!(page.contains("became unstable"));
        let last = positions(&embedded(&page)).pop().unwrap();
        assert!(last[0].is_none() && last[1].is_none() && last[2].is_some());
    }

    #[test]
    fn a_small_page_holds_its_moments_and_needs_less_than_130_kilobytes() {
        let body = ["34215634215634"; 14].join("/");
        let mut recording = simulated(&body, 2, 500, true);
        recording.frames[5].points[3] = [f64::NAN, 1.0];
        let page = small_page(&recording, "a robot", &[]).unwrap();
        assert!(page.len() < 130_000, "{}", page.len());
        let unpacked = |text: &str| {
            let mut bytes = Vec::new();
            let packed = BASE64.decode(text).unwrap();
            std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&packed[..]), &mut bytes)
                .unwrap();
            bytes
        };
        let (_, rest) = page.split_once("id=\"rollout\">").unwrap();
        let rollout: Value =
            serde_json::from_slice(&unpacked(rest.split_once('<').unwrap().0)).unwrap();
        let steps: Vec<usize> = serde_json::from_value(rollout["steps"].clone()).unwrap();
        assert_eq!((steps[1], steps.last()), (5, Some(&1001)));
        let bytes = unpacked(rollout["positions"].as_str().unwrap());
        let width = 2 * points(&recording);
        let (low, high) = bytes.split_at(bytes.len() / 2);
        let mut at = vec![0_i16; width];
        for (moment, step) in steps.iter().enumerate() {
            for (coordinate, at) in at.iter_mut().enumerate() {
                let place = coordinate * steps.len() + moment;
                *at = at.wrapping_add(i16::from_le_bytes([low[place], high[place]]));
            }
            let walk = Walk::new(&recording).unwrap();
            let origin = walk.centre(*step).map(|v| (v * STEPS).round() / STEPS);
            let expected: Vec<i16> = recording.frames[*step]
                .points
                .iter()
                .flat_map(|p| in_steps(*p, origin, 50.0))
                .collect();
            assert_eq!(at, expected, "moment {moment}");
        }
    }

    #[test]
    fn pages_stay_below_eight_megabytes() {
        let full = ["34215634215634"; 14].join("/");
        let recording = simulated(&full, 4, 500, true);
        let text = page(&recording, "", &[]).unwrap();
        assert!(text.len() < 8_000_000, "{}", text.len());
        assert_eq!(positions(&embedded(&text)).len(), recording.frames.len());
        let huge = [&*"3".repeat(64); 64].join("/");
        let text = page(&simulated(&huge, 2, 250, true), "", &[]).unwrap();
        assert!(text.len() < 8_000_000, "{}", text.len());
    }
}
