//! [`Canvas`]: the content of a figure, in points, y down. `svg` and `pixels` render it.

use crate::base::text::shortened;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::fonts::Font;
use crate::draw::plot::style::Style;

/// Maximum number of characters in a text.
const MOST: usize = 400;

/// Size of most words, points: the smallest that is easy to read in print.
pub(crate) const TEXT: f64 = 7.2;
/// Size of headings, points.
pub(crate) const HEADING: f64 = 8.2;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Anchor {
    #[default]
    Start,
    Middle,
    End,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TextStyle {
    pub(crate) size: f64,
    pub(crate) bold: bool,
    pub(crate) colour: Colour,
    pub(crate) anchor: Anchor,
    pub(crate) upwards: bool,
}

impl Default for TextStyle {
    fn default() -> Self {
        TextStyle {
            size: TEXT,
            bold: false,
            colour: colour::INK,
            anchor: Anchor::Start,
            upwards: false,
        }
    }
}

impl TextStyle {
    pub(crate) fn middle() -> Self {
        TextStyle {
            anchor: Anchor::Middle,
            ..TextStyle::default()
        }
    }

    pub(crate) fn end() -> Self {
        TextStyle {
            anchor: Anchor::End,
            ..TextStyle::default()
        }
    }

    pub(crate) fn colour(self, colour: Colour) -> Self {
        TextStyle { colour, ..self }
    }

    pub(crate) fn bold(self) -> Self {
        TextStyle { bold: true, ..self }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pen {
    pub(crate) colour: Colour,
    pub(crate) width: f64,
    /// Lengths of dashes and of the gaps between them.
    pub(crate) dashes: Option<[f64; 2]>,
}

impl Pen {
    pub(crate) fn new(colour: Colour, width: f64) -> Self {
        Pen {
            colour,
            width,
            dashes: None,
        }
    }

    pub(crate) fn dashed(self, dash: f64, gap: f64) -> Self {
        Pen {
            dashes: Some([dash, gap]),
            ..self
        }
    }
}

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
        words: TextStyle,
    },
    /// Drawn with an opacity as a whole.
    Faded {
        opacity: f64,
        content: Canvas,
    },
    /// Clipped to a rectangle.
    Clipped {
        at: [f64; 2],
        size: [f64; 2],
        content: Canvas,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ink {
    Fill(Colour),
    Line(Pen),
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Piece {
    Line(Vec<[f64; 2]>),
    /// A line through points and back to the first.
    Polygon(Vec<[f64; 2]>),
    Rectangle {
        at: [f64; 2],
        size: [f64; 2],
    },
    /// A horizontal line to the right.
    Level {
        from: [f64; 2],
        length: f64,
    },
}

/// A picture under construction: its elements in drawing order, in points.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Canvas {
    style: Style,
    elements: Vec<Element>,
}

impl Canvas {
    pub(crate) fn new(style: &Style) -> Self {
        Canvas {
            style: style.clone(),
            elements: Vec::new(),
        }
    }

    pub(super) fn style(&self) -> &Style {
        &self.style
    }

    pub(super) fn font(&self) -> &Font {
        self.style.font()
    }

    pub(super) fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// Returns all texts, and whether they are bold.
    pub(super) fn texts(&self) -> Vec<(&str, bool)> {
        fn of(element: &Element) -> Vec<(&str, bool)> {
            match element {
                Element::Text { text, words, .. } => vec![(text.as_str(), words.bold)],
                Element::Faded { content, .. } | Element::Clipped { content, .. } => {
                    content.texts()
                }
                _ => Vec::new(),
            }
        }
        self.elements.iter().flat_map(of).collect()
    }

    pub(crate) fn rectangle(&mut self, at: [f64; 2], size: [f64; 2], fill: Colour) {
        self.elements.push(Element::Rectangle {
            at,
            size,
            ink: Ink::Fill(fill),
        });
    }

    pub(crate) fn frame(&mut self, at: [f64; 2], size: [f64; 2], pen: Pen) {
        self.elements.push(Element::Rectangle {
            at,
            size,
            ink: Ink::Line(pen),
        });
    }

    pub(crate) fn line(&mut self, from: [f64; 2], to: [f64; 2], pen: Pen) {
        self.path(vec![Piece::Line(vec![from, to])], pen);
    }

    /// Draws a line through points, with gaps where a point is not finite.
    pub(crate) fn polyline(&mut self, points: &[[f64; 2]], pen: Pen) {
        let finite = |p: &[f64; 2]| p.iter().all(|v| v.is_finite());
        let pieces = points.split(|p| !finite(p)).filter(|piece| piece.len() > 1);
        let pieces: Vec<Piece> = pieces.map(|piece| Piece::Line(piece.to_vec())).collect();
        if !pieces.is_empty() {
            self.path(pieces, pen);
        }
    }

    pub(crate) fn path(&mut self, pieces: Vec<Piece>, pen: Pen) {
        self.elements.push(Element::Path {
            pieces,
            ink: Ink::Line(pen),
        });
    }

    /// Draws a filled path.
    pub(crate) fn area(&mut self, pieces: Vec<Piece>, fill: Colour) {
        self.elements.push(Element::Path {
            pieces,
            ink: Ink::Fill(fill),
        });
    }

    pub(crate) fn dot(&mut self, at: [f64; 2], radius: f64, fill: Colour) {
        self.elements.push(Element::Dot { at, radius, fill });
    }

    /// Draws a text on its baseline, shortened to what any figure has room for.
    pub(crate) fn text(&mut self, at: [f64; 2], text: &str, words: TextStyle) {
        let text = shortened(text, MOST).chars().map(printable).collect();
        self.elements.push(Element::Text { at, text, words });
    }

    /// Draws a text, cut to fit into `most` points.
    pub(crate) fn fitted(&mut self, at: [f64; 2], text: &str, most: f64, words: TextStyle) {
        let text = self.font().fitted(text, words.size, words.bold, most);
        self.text(at, &text, words);
    }

    /// Draws the content of `draw` with an opacity as a whole.
    pub(crate) fn faded(&mut self, opacity: f64, draw: impl FnOnce(&mut Canvas)) {
        let mut content = Canvas::new(&self.style);
        draw(&mut content);
        self.elements.push(Element::Faded { opacity, content });
    }

    /// Draws the content of `draw`, clipped to a rectangle; coordinates stay those of the figure.
    pub(crate) fn clipped(&mut self, at: [f64; 2], size: [f64; 2], draw: impl FnOnce(&mut Canvas)) {
        let mut content = Canvas::new(&self.style);
        draw(&mut content);
        self.elements.push(Element::Clipped { at, size, content });
    }
}

/// Clamps a number to what can be drawn; NaN becomes 0.
pub(super) fn drawable(value: f64) -> f64 {
    if value.is_nan() {
        0.0
    } else {
        value.clamp(-1e6, 1e6)
    }
}

/// Replaces letters that cannot be drawn or that XML forbids.
pub(super) fn printable(letter: char) -> char {
    let is_lost = letter.is_control() || matches!(letter, '\u{fffe}' | '\u{ffff}');
    if is_lost { '\u{fffd}' } else { letter }
}
