//! Rendering of primitives to pixels with tiny-skia, and PNG files.

use crate::draw::colour::Colour;
use crate::draw::error::{PictureError, write_whole};
use crate::draw::fonts::EMBEDDED;
use crate::draw::scene::Primitive;
use crate::draw::stage::Stage;
use crate::draw::walk::Walk;
use crate::draw::{panel, scene};
use std::path::Path;
use tiny_skia::{FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform};

/// The distance beyond the picture's edges, pixels, at which lines are cut: far enough to be
/// invisible, near enough for 32-bit floats.
const BEYOND: f64 = 8192.0;

/// Returns a frame of a walk as a PNG of this width in pixels.
///
/// # Errors
/// Returns a [`PictureError`] if the width is out of range, or the picture cannot be encoded.
pub fn png(walk: &Walk, frame: usize, width: u32) -> Result<Vec<u8>, PictureError> {
    let picture = picture(walk, frame, &Stage::new(walk, width)?)?;
    png_bytes(&picture)
}

/// Renders the picture of a frame as opaque RGBA.
pub(crate) fn picture(walk: &Walk, frame: usize, stage: &Stage) -> Result<Pixmap, PictureError> {
    let (width, height) = (stage.width, stage.height);
    let mut pixmap = Pixmap::new(width, height).ok_or(PictureError::Size { width, height })?;
    pixmap.fill(tiny_skia::Color::WHITE);
    let world = scene::world(walk, frame, &stage.window(frame));
    draw(&mut pixmap, &world, stage.zoom, |p| {
        stage.to_pixels(frame, p)
    });
    draw(
        &mut pixmap,
        &panel::panel(walk, frame, stage),
        stage.zoom,
        |p| p,
    );
    Ok(pixmap)
}

/// Draws primitives; `to_pixels` maps coordinates to pixels (y down), `zoom` scales line widths.
pub(crate) fn draw(
    pixmap: &mut Pixmap,
    primitives: &[Primitive],
    zoom: f64,
    to_pixels: impl Fn([f64; 2]) -> [f64; 2],
) {
    let place = |point: &[f64; 2]| to_pixels(*point).map(|v| v.clamp(-BEYOND, BEYOND) as f32);
    for primitive in primitives {
        match primitive {
            Primitive::Quad {
                corners,
                fill,
                smooth,
            } => {
                if let Some(path) = polyline(corners.iter().map(place), true) {
                    let paint = paint(*fill, *smooth);
                    pixmap.fill_path(
                        &path,
                        &paint,
                        FillRule::Winding,
                        Transform::identity(),
                        None,
                    );
                }
            }
            Primitive::Text {
                text,
                at,
                size,
                bold,
                colour,
            } => {
                if let (Some(path), _) = EMBEDDED.letters(text, *size, *bold) {
                    let [x, y] = place(at);
                    let (paint, there) = (paint(*colour, true), Transform::from_translate(x, y));
                    pixmap.fill_path(&path, &paint, FillRule::Winding, there, None);
                }
            }
            Primitive::Line {
                points,
                width,
                colour,
                smooth,
            } => {
                if let Some(path) = polyline(points.iter().map(place), false) {
                    let stroke = Stroke {
                        width: (width * zoom) as f32,
                        line_cap: LineCap::Round,
                        line_join: LineJoin::Round,
                        ..Stroke::default()
                    };
                    pixmap.stroke_path(
                        &path,
                        &paint(*colour, *smooth),
                        &stroke,
                        Transform::identity(),
                        None,
                    );
                }
            }
        }
    }
}

fn polyline(points: impl Iterator<Item = [f32; 2]>, closed: bool) -> Option<tiny_skia::Path> {
    let mut builder = PathBuilder::new();
    for (k, [x, y]) in points.enumerate() {
        if k == 0 {
            builder.move_to(x, y)
        } else {
            builder.line_to(x, y)
        }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

pub(crate) fn paint(colour: Colour, smooth: bool) -> Paint<'static> {
    let mut paint = Paint {
        anti_alias: smooth,
        ..Paint::default()
    };
    let [r, g, b] = colour.rgb;
    paint.set_color_rgba8(r, g, b, colour.opacity);
    paint
}

/// Writes a picture as PNG, atomically.
pub(crate) fn write_png(path: &Path, picture: &Pixmap) -> Result<(), PictureError> {
    write_whole(path, &png_bytes(picture)?)
}

pub(crate) fn png_bytes(picture: &Pixmap) -> Result<Vec<u8>, PictureError> {
    picture
        .encode_png()
        .map_err(|e| PictureError::Encode(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{colour, simulated};

    fn pixel(picture: &Pixmap, [x, y]: [f64; 2]) -> [u8; 3] {
        let p = picture.pixel(x as u32, y as u32).unwrap();
        [p.red(), p.green(), p.blue()]
    }

    #[test]
    fn voxels_ground_and_sky_are_where_the_stage_says() {
        let recording = simulated("3456/3412", 1, 20, false);
        let walk = Walk::new(&recording).unwrap();
        let stage = Stage::new(&walk, 480).unwrap();
        let picture = picture(&walk, 10, &stage).unwrap();
        let mut seen = 0;
        for (material, quad) in walk.voxels(10) {
            // Off the middle, so that the path of the centre of mass does not cover it.
            let at = [
                0.7 * quad[0][0] + 0.3 * quad[1][0],
                0.7 * quad[0][1] + 0.3 * quad[2][1],
            ];
            let expected = colour::shade(material, crate::draw::walk::area(&quad)).rgb;
            seen += usize::from(pixel(&picture, stage.to_pixels(10, at)) == expected);
        }
        assert!(seen >= 7, "only {seen} of 8 voxels have their colour");
        let [x, y] = stage.to_pixels(10, [stage.window(10).left + 0.4, 0.0]);
        assert_eq!(pixel(&picture, [x, y - 6.0]), colour::PAPER.rgb);
        assert_eq!(pixel(&picture, [x, y + 20.0]), colour::GROUND.rgb);
    }

    #[test]
    fn pictures_are_written_as_png_and_read_back_equal() {
        let recording = simulated("34/56", 1, 5, false);
        let walk = Walk::new(&recording).unwrap();
        let picture = picture(&walk, 5, &Stage::new(&walk, 320).unwrap()).unwrap();
        let path = tempfile::tempdir().unwrap().keep().join("robot.png");
        write_png(&path, &picture).unwrap();
        assert!(Pixmap::load_png(&path).unwrap() == picture);
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }

    #[test]
    fn exploded_bodies_are_drawn_without_panic() {
        let mut recording = simulated("333/343/356", 1, 6, false);
        let wild = [1e3, -1e8, 1e300, f64::INFINITY, f64::NAN, 0.0];
        for (k, frame) in recording.frames.iter_mut().enumerate() {
            for (i, p) in frame.points.iter_mut().enumerate() {
                *p = [p[0] + wild[(i + k) % 6], p[1] - wild[(i * k) % 6]];
            }
            frame.centre = [wild[k % 6], wild[(k + 1) % 6]];
        }
        recording.unstable = true;
        let walk = Walk::new(&recording).unwrap();
        let stage = Stage::new(&walk, 480).unwrap();
        for frame in 0..walk.frames() {
            assert_eq!(picture(&walk, frame, &stage).unwrap().width(), 480);
        }
    }
}
