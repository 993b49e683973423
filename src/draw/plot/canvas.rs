//! [`Canvas`]: what a figure shows, in points, y down. `svg` and `pixels` draw it.

use crate::base::text::shortened;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::fonts;

/// Most characters of a text.
const MOST: usize = 400;

/// Size of most words, points: the least that is easily read in print.
pub const TEXT: f64 = 7.2;
/// Size of headings, points.
pub const HEADING: f64 = 8.2;

/// Where a text is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Anchor {
    /// By its left end.
    #[default]
    Start,
    /// By its middle.
    Middle,
    /// By its right end.
    End,
}

/// How a text looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Words {
    pub size: f64,
    pub bold: bool,
    pub colour: Colour,
    pub anchor: Anchor,
    /// Whether it runs upwards.
    pub upwards: bool,
}

impl Default for Words {
    fn default() -> Self {
        Words { size: TEXT, bold: false, colour: colour::INK, anchor: Anchor::Start, upwards: false }
    }
}

impl Words {
    /// Held by its middle.
    pub fn middle() -> Self {
        Words { anchor: Anchor::Middle, ..Words::default() }
    }

    /// Held by its right end.
    pub fn end() -> Self {
        Words { anchor: Anchor::End, ..Words::default() }
    }

    /// The same in another colour.
    pub fn colour(self, colour: Colour) -> Self {
        Words { colour, ..self }
    }

    /// The same in bold.
    pub fn bold(self) -> Self {
        Words { bold: true, ..self }
    }
}

/// How a line looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    pub colour: Colour,
    pub width: f64,
    /// Lengths of dashes and of the gaps between them.
    pub dashes: Option<[f64; 2]>,
}

impl Pen {
    /// A solid line.
    pub fn new(colour: Colour, width: f64) -> Self {
        Pen { colour, width, dashes: None }
    }

    /// The same dashed.
    pub fn dashed(self, dash: f64, gap: f64) -> Self {
        Pen { dashes: Some([dash, gap]), ..self }
    }
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Element {
    Rectangle {
        at: [f64; 2],
        size: [f64; 2],
        ink: Ink,
    },
    Path {
        pieces: Vec<Piece>,
        ink: Ink,
    },
    Dot {
        at: [f64; 2],
        radius: f64,
        fill: Colour,
    },
    Text {
        at: [f64; 2],
        text: String,
        words: Words,
    },
    /// See-through as a whole.
    Faded {
        opacity: f64,
        content: Canvas,
    },
    /// Cut at the edges of a rectangle.
    Clipped {
        at: [f64; 2],
        size: [f64; 2],
        content: Canvas,
    },
}

/// The inside of a shape, or its line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ink {
    Fill(Colour),
    Line(Pen),
}

/// A piece of a path.
#[derive(Clone, Debug, PartialEq)]
pub enum Piece {
    /// A line through points.
    Line(Vec<[f64; 2]>),
    /// The same back to its first point.
    Polygon(Vec<[f64; 2]>),
    /// A rectangle from its top left corner.
    Rectangle {
        /// The corner.
        at: [f64; 2],
        /// Width and height.
        size: [f64; 2],
    },
    /// A line to the right.
    Level {
        /// Its left end.
        from: [f64; 2],
        /// How long it is.
        length: f64,
    },
}

/// A picture under construction: what is drawn, in order, in points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Canvas {
    elements: Vec<Element>,
}

impl Canvas {
    /// Nothing yet.
    pub fn new() -> Self {
        Canvas::default()
    }

    /// What was drawn, in order.
    pub(super) fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// A filled rectangle from its top left corner.
    pub fn rectangle(&mut self, at: [f64; 2], size: [f64; 2], fill: Colour) {
        self.elements.push(Element::Rectangle { at, size, ink: Ink::Fill(fill) });
    }

    /// The outline of a rectangle.
    pub fn frame(&mut self, at: [f64; 2], size: [f64; 2], pen: Pen) {
        self.elements.push(Element::Rectangle { at, size, ink: Ink::Line(pen) });
    }

    /// A line between two points.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], pen: Pen) {
        self.path(vec![Piece::Line(vec![from, to])], pen);
    }

    /// A line through points; pieces where a point is not finite are left out.
    pub fn polyline(&mut self, points: &[[f64; 2]], pen: Pen) {
        let finite = |p: &[f64; 2]| p.iter().all(|v| v.is_finite());
        let pieces = points.split(|p| !finite(p)).filter(|piece| piece.len() > 1);
        let pieces: Vec<Piece> = pieces.map(|piece| Piece::Line(piece.to_vec())).collect();
        if !pieces.is_empty() {
            self.path(pieces, pen);
        }
    }

    /// A path's line.
    pub fn path(&mut self, pieces: Vec<Piece>, pen: Pen) {
        self.elements.push(Element::Path { pieces, ink: Ink::Line(pen) });
    }

    /// A filled path.
    pub fn area(&mut self, pieces: Vec<Piece>, fill: Colour) {
        self.elements.push(Element::Path { pieces, ink: Ink::Fill(fill) });
    }

    /// A filled circle.
    pub fn dot(&mut self, at: [f64; 2], radius: f64, fill: Colour) {
        self.elements.push(Element::Dot { at, radius, fill });
    }

    /// A text on its baseline; no more of it than any figure has room for.
    pub fn text(&mut self, at: [f64; 2], text: &str, words: Words) {
        let text = shortened(text, MOST).chars().map(printable).collect();
        self.elements.push(Element::Text { at, text, words });
    }

    /// A text cut to fit into `most` points.
    pub fn fitted(&mut self, at: [f64; 2], text: &str, most: f64, words: Words) {
        self.text(at, &fonts::fitted(text, words.size, words.bold, most), words);
    }

    /// What `draw` draws, see-through as a whole.
    pub fn faded(&mut self, opacity: f64, draw: impl FnOnce(&mut Canvas)) {
        let mut content = Canvas::new();
        draw(&mut content);
        self.elements.push(Element::Faded { opacity, content });
    }

    /// What `draw` draws, cut at the edges of a rectangle; its coordinates stay the figure's.
    pub fn clipped(&mut self, at: [f64; 2], size: [f64; 2], draw: impl FnOnce(&mut Canvas)) {
        let mut content = Canvas::new();
        draw(&mut content);
        self.elements.push(Element::Clipped { at, size, content });
    }
}

/// A number that can be drawn, even if it is not finite or absurd.
pub(super) fn drawable(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.clamp(-1e6, 1e6) }
}

/// A letter that can be drawn and that XML has a place for.
pub(super) fn printable(letter: char) -> char {
    let is_lost = letter.is_control() || matches!(letter, '\u{fffe}' | '\u{ffff}');
    if is_lost { '\u{fffd}' } else { letter }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_where_there_is_no_number() {
        let mut canvas = Canvas::new();
        let nan = f64::NAN;
        let points = [[0.0, 0.0], [1.0, 1.0], [2.0, nan], [3.0, 1.0], [4.0, 1.0], [nan, 0.0], [5.0, 5.0]];
        canvas.polyline(&points, Pen::new(colour::INK, 1.0));
        assert!(canvas.svg().contains("d=\"M0 0L1 1M3 1L4 1\""));
    }
}
