//! [`Canvas`]: SVG elements in points, y down, without ids, classes or styles.

use crate::base::number;
use crate::base::text::shortened;
use crate::view::colour;
use crate::view::colour::Colour;
use crate::view::fonts;
use std::fmt::Write;

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

    fn attributes(&self) -> String {
        let mut text = format!(
            " fill=\"none\" stroke=\"{}\"{} stroke-width=\"{}\"",
            self.colour.hex(),
            opacity("stroke-opacity", self.colour),
            number(self.width)
        );
        if let Some([dash, gap]) = self.dashes {
            text += &format!(" stroke-dasharray=\"{} {}\"", number(dash), number(gap));
        }
        text
    }
}

/// SVG under construction.
#[derive(Clone, Debug, Default)]
pub struct Canvas {
    out: String,
}

impl Canvas {
    /// Nothing yet.
    pub fn new() -> Self {
        Canvas::default()
    }

    /// The elements.
    pub fn finish(self) -> String {
        self.out
    }

    fn push(&mut self, element: std::fmt::Arguments) {
        // Writing into a text cannot fail.
        let _ = self.out.write_fmt(element);
        self.out.push('\n');
    }

    /// A filled rectangle from its top left corner.
    pub fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], fill: Colour) {
        let [x, y, width, height] = [x, y, width, height].map(number);
        let fill = filled(fill);
        self.push(format_args!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{fill}/>"));
    }

    /// The outline of a rectangle.
    pub fn frame(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], pen: Pen) {
        let [x, y, width, height] = [x, y, width, height].map(number);
        let pen = pen.attributes();
        self.push(format_args!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{pen}/>"));
    }

    /// A line between two points.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], pen: Pen) {
        self.path(&path(&[from, to], false), pen);
    }

    /// A line through points; pieces where a point is not finite are left out.
    pub fn polyline(&mut self, points: &[[f64; 2]], pen: Pen) {
        let finite = |p: &[f64; 2]| p.iter().all(|v| v.is_finite());
        let pieces = points.split(|p| !finite(p)).filter(|piece| piece.len() > 1);
        let data: String = pieces.map(|piece| path(piece, false)).collect();
        if !data.is_empty() {
            self.path(&data, Pen { ..pen });
        }
    }

    /// A path's line.
    pub fn path(&mut self, data: &str, pen: Pen) {
        self.push(format_args!("<path d=\"{data}\"{} stroke-linejoin=\"round\"/>", pen.attributes()));
    }

    /// A filled path.
    pub fn area(&mut self, data: &str, fill: Colour) {
        self.push(format_args!("<path d=\"{data}\"{}/>", filled(fill)));
    }

    /// A filled circle.
    pub fn dot(&mut self, [x, y]: [f64; 2], radius: f64, fill: Colour) {
        let [x, y, radius] = [x, y, radius].map(number);
        self.push(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"{}/>", filled(fill)));
    }

    /// A text on its baseline; no more of it than any figure has room for.
    pub fn text(&mut self, [x, y]: [f64; 2], text: &str, words: Words) {
        let text = &shortened(text, MOST);
        let [x, y] = [x, y].map(number);
        let anchor = match words.anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let bold = if words.bold { " font-weight=\"bold\"" } else { "" };
        let turn = if words.upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let (size, fill, text) = (number(words.size), filled(words.colour), escape(text));
        self.push(format_args!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor}{bold}{turn}{fill}>{text}</text>"
        ));
    }

    /// A text cut to fit into `most` points.
    pub fn fitted(&mut self, at: [f64; 2], text: &str, most: f64, words: Words) {
        self.text(at, &fonts::fitted(text, words.size, words.bold, most), words);
    }

    /// What `draw` draws, see-through as a whole.
    pub fn faded(&mut self, opacity: f64, draw: impl FnOnce(&mut Canvas)) {
        self.push(format_args!("<g opacity=\"{}\">", number(opacity)));
        draw(self);
        self.push(format_args!("</g>"));
    }

    /// What `draw` draws, cut at the edges of a rectangle; its coordinates stay the figure's.
    pub fn clipped(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], draw: impl FnOnce(&mut Canvas)) {
        let [x, y, width, height] = [x, y, width, height].map(number);
        // A nested svg clips without an id that a clip path would need.
        self.push(format_args!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" viewBox=\"{x} {y} {width} {height}\" \
             overflow=\"hidden\">"
        ));
        draw(self);
        self.push(format_args!("</svg>"));
    }
}

/// The path through points.
pub fn path(points: &[[f64; 2]], closed: bool) -> String {
    let mut data = String::new();
    for (k, [x, y]) in points.iter().enumerate() {
        let letter = if k == 0 { 'M' } else { 'L' };
        data += &format!("{letter}{} {}", number(*x), number(*y));
    }
    if closed {
        data.push('Z');
    }
    data
}

/// A number with two decimals at most; what is not finite or absurd becomes something that can be
/// drawn.
pub fn number(value: f64) -> String {
    let value = if value.is_nan() { 0.0 } else { value.clamp(-1e6, 1e6) };
    let text = number::fixed(value, 2);
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// A text as it may stand in XML.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // XML has no place for these, not even as entities.
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

fn filled(fill: Colour) -> String {
    format!(" fill=\"{}\"{}", fill.hex(), opacity("fill-opacity", fill))
}

fn opacity(name: &str, colour: Colour) -> String {
    match colour.opacity {
        255 => String::new(),
        opacity => format!(" {name}=\"{}\"", number(f64::from(opacity) / 255.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_always_drawable() {
        assert_eq!([0.0, -0.001, 1.5, 2.0, 3.1459].map(number), ["0", "0", "1.5", "2", "3.15"]);
        assert_eq!([f64::NAN, f64::INFINITY, -1e300].map(number), ["0", "1000000", "-1000000"]);
    }

    #[test]
    fn any_text_is_fit_for_xml() {
        assert_eq!(escape("a<b>&\"c\u{0}\n"), "a&lt;b&gt;&amp;&quot;c\u{fffd}\u{fffd}");
    }

    #[test]
    fn lines_are_broken_where_there_is_no_number() {
        let mut canvas = Canvas::new();
        let nan = f64::NAN;
        let points = [[0.0, 0.0], [1.0, 1.0], [2.0, nan], [3.0, 1.0], [4.0, 1.0], [nan, 0.0], [5.0, 5.0]];
        canvas.polyline(&points, Pen::new(colour::INK, 1.0));
        assert!(canvas.finish().contains("d=\"M0 0L1 1M3 1L4 1\""));
    }
}
