//! Renders a [`Canvas`] to pixels.

use crate::draw::fonts::Font;
use crate::draw::plot::canvas::{Anchor, Canvas, Element, Ink, Pen, Piece, TextStyle, drawable};
use crate::draw::raster::paint;
use tiny_skia::{
    FillRule, FilterQuality, LineJoin, Paint, Path, PathBuilder, Pattern, Pixmap, Rect, SpreadMode,
    Stroke, StrokeDash, Transform,
};

impl Canvas {
    /// Draws the elements; `to_pixels` maps points to pixels.
    pub(crate) fn draw(&self, pixmap: &mut Pixmap, to_pixels: Transform) {
        for element in self.elements() {
            match element {
                Element::Rectangle { at, size, ink } => {
                    if let Some(rectangle) = rectangle(*at, *size) {
                        // SVG draws the corners of a frame sharp.
                        inked(
                            pixmap,
                            &PathBuilder::from_rect(rectangle),
                            ink,
                            LineJoin::Miter,
                            to_pixels,
                        );
                    }
                }
                Element::Path { pieces, ink } => {
                    if let Some(path) = path(pieces) {
                        inked(pixmap, &path, ink, LineJoin::Round, to_pixels);
                    }
                }
                Element::Dot { at, radius, fill } => {
                    let ([x, y], radius) = (place(*at), drawable(*radius) as f32);
                    if let Some(circle) = PathBuilder::from_circle(x, y, radius) {
                        inked(
                            pixmap,
                            &circle,
                            &Ink::Fill(*fill),
                            LineJoin::Round,
                            to_pixels,
                        );
                    }
                }
                Element::Text { at, text, words } => {
                    lettered(pixmap, self.font(), *at, text, words, to_pixels);
                }
                Element::Faded { opacity, content } => {
                    let (width, height) = (pixmap.width() as f32, pixmap.height() as f32);
                    let whole = Rect::from_xywh(0.0, 0.0, width, height);
                    layer(pixmap, whole, content, *opacity as f32, to_pixels);
                }
                Element::Clipped { at, size, content } => {
                    let area =
                        rectangle(*at, *size).and_then(|rectangle| rectangle.transform(to_pixels));
                    layer(pixmap, area, content, 1.0, to_pixels);
                }
            }
        }
    }
}

fn place(point: [f64; 2]) -> [f32; 2] {
    point.map(|v| drawable(v) as f32)
}

fn rectangle(at: [f64; 2], size: [f64; 2]) -> Option<Rect> {
    let ([x, y], [width, height]) = (place(at), place(size));
    Rect::from_xywh(x, y, width, height)
}

fn path(pieces: &[Piece]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    let through = |builder: &mut PathBuilder, points: &[[f64; 2]]| {
        for (k, [x, y]) in points.iter().map(|point| place(*point)).enumerate() {
            if k == 0 {
                builder.move_to(x, y)
            } else {
                builder.line_to(x, y)
            }
        }
    };
    for piece in pieces {
        match piece {
            Piece::Line(points) => through(&mut builder, points),
            Piece::Polygon(points) => {
                through(&mut builder, points);
                builder.close();
            }
            Piece::Rectangle { at, size } => rectangle(*at, *size)
                .into_iter()
                .for_each(|r| builder.push_rect(r)),
            Piece::Level { from, length } => {
                through(&mut builder, &[*from, [from[0] + length, from[1]]]);
            }
        }
    }
    builder.finish()
}

fn inked(pixmap: &mut Pixmap, path: &Path, ink: &Ink, line_join: LineJoin, to_pixels: Transform) {
    match *ink {
        Ink::Fill(fill) => {
            pixmap.fill_path(path, &paint(fill, true), FillRule::Winding, to_pixels, None);
        }
        Ink::Line(Pen {
            colour,
            width,
            dashes,
        }) => {
            let dash =
                dashes.and_then(|lengths| StrokeDash::new(lengths.map(|v| v as f32).to_vec(), 0.0));
            let stroke = Stroke {
                width: width as f32,
                line_join,
                dash,
                ..Stroke::default()
            };
            pixmap.stroke_path(path, &paint(colour, true), &stroke, to_pixels, None);
        }
    }
}

fn lettered(
    pixmap: &mut Pixmap,
    font: &Font,
    at: [f64; 2],
    text: &str,
    words: &TextStyle,
    to_pixels: Transform,
) {
    let (letters, width) = font.letters(text, words.size, words.bold);
    let before = match words.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => width / 2.0,
        Anchor::End => width,
    };
    let [x, y] = place(at);
    let turn = if words.upwards { -90.0 } else { 0.0 };
    let transform = to_pixels
        .pre_translate(x, y)
        .pre_rotate(turn)
        .pre_translate(-before, 0.0);
    if let Some(letters) = letters {
        inked(
            pixmap,
            &letters,
            &Ink::Fill(words.colour),
            LineJoin::Round,
            transform,
        );
    }
}

/// Draws `content` on a layer of its own and composites an area \[pixels\] of it over the picture.
fn layer(
    pixmap: &mut Pixmap,
    area: Option<Rect>,
    content: &Canvas,
    opacity: f32,
    to_pixels: Transform,
) {
    let Some(area) = area else { return };
    let edge = |v: f32, most: u32| v.clamp(0.0, most as f32);
    let [left, right] = [area.left().floor(), area.right().ceil()].map(|x| edge(x, pixmap.width()));
    let [top, bottom] =
        [area.top().floor(), area.bottom().ceil()].map(|y| edge(y, pixmap.height()));
    let Some(mut layer) = Pixmap::new((right - left) as u32, (bottom - top) as u32) else {
        return;
    };
    content.draw(&mut layer, to_pixels.post_translate(-left, -top));
    let back = Transform::from_translate(left, top);
    let shader = Pattern::new(
        layer.as_ref(),
        SpreadMode::Pad,
        FilterQuality::Nearest,
        opacity,
        back,
    );
    pixmap.fill_rect(
        area,
        &Paint {
            shader,
            ..Paint::default()
        },
        Transform::identity(),
        None,
    );
}
