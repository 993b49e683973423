//! Renders a [`Canvas`] to SVG elements, without ids, classes or styles.

use crate::base::number;
use crate::draw::colour::Colour;
use crate::draw::fonts::Font;
use crate::draw::plot::canvas::{
    Anchor, Canvas, Element, Ink, Pen, Piece, TextStyle, drawable, printable,
};
use std::fmt;
use tiny_skia::{PathSegment, Point};

/// The form of the words of an SVG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Words {
    /// Text, for pages: it can be selected and searched, in a font that the viewer has.
    Text,
    /// Outlines of the canvas's font, for files: they look the same everywhere.
    Outlines,
}

impl Canvas {
    /// Returns the elements as SVG.
    pub fn svg(&self, words: Words) -> String {
        let font = self.font();
        let elements = self.elements().iter();
        let elements = elements.map(|element| Drawn {
            element,
            font,
            words,
        });
        elements.map(|element| format!("{element}\n")).collect()
    }
}

/// An element, and how to write its words.
struct Drawn<'a> {
    element: &'a Element,
    font: &'a Font,
    words: Words,
}

impl fmt::Display for Drawn<'_> {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self.element {
            Element::Rectangle { at, size, ink } => {
                let ([x, y], [width, height]) = (at.map(number), size.map(number));
                write!(
                    out,
                    "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{}/>",
                    attributes(ink)
                )
            }
            Element::Path { pieces, ink } => {
                let join = if matches!(ink, Ink::Line(_)) {
                    " stroke-linejoin=\"round\""
                } else {
                    ""
                };
                write!(out, "<path d=\"")?;
                pieces.iter().try_for_each(|piece| write!(out, "{piece}"))?;
                write!(out, "\"{}{join}/>", attributes(ink))
            }
            Element::Dot { at, radius, fill } => {
                let ([x, y], radius) = (at.map(number), number(*radius));
                write!(
                    out,
                    "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"{}/>",
                    filled(*fill)
                )
            }
            Element::Text { at, text, words } if self.words == Words::Outlines => {
                let Some((path, width)) = outlines(self.font, text, words) else {
                    return Ok(());
                };
                let before = match words.anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => f64::from(width) / 2.0,
                    Anchor::End => f64::from(width),
                };
                let (at, turn) = match words.upwards {
                    true => ([at[0], at[1] + before], " rotate(-90)"),
                    false => ([at[0] - before, at[1]], ""),
                };
                let ([x, y], size, fill) =
                    (at.map(number), number(words.size), filled(words.colour));
                // The label and the size are what other programs keep of text that became outlines.
                write!(
                    out,
                    "<path aria-label=\"{}\" font-size=\"{size}\" \
                     transform=\"translate({x} {y}){turn} scale({FINE})\" d=\"{path}\"{fill}/>",
                    escape(text)
                )
            }
            Element::Text { at, text, words } => {
                let [x, y] = at.map(number);
                let anchor = match words.anchor {
                    Anchor::Start => "",
                    Anchor::Middle => " text-anchor=\"middle\"",
                    Anchor::End => " text-anchor=\"end\"",
                };
                let bold = if words.bold {
                    " font-weight=\"bold\""
                } else {
                    ""
                };
                let turn = if words.upwards {
                    format!(" transform=\"rotate(-90 {x} {y})\"")
                } else {
                    String::new()
                };
                let (size, fill, text) = (number(words.size), filled(words.colour), escape(text));
                write!(
                    out,
                    "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor}{bold}{turn}{fill}>{text}</text>"
                )
            }
            Element::Faded { opacity, content } => {
                write!(
                    out,
                    "<g opacity=\"{}\">\n{}</g>",
                    number(*opacity),
                    content.svg(self.words)
                )
            }
            Element::Clipped { at, size, content } => {
                let ([x, y], [width, height]) = (at.map(number), size.map(number));
                // A nested svg clips without the id that a clip path would need.
                write!(
                    out,
                    "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" viewBox=\"{x} {y} {width} {height}\" \
                     overflow=\"hidden\">\n{}</svg>",
                    content.svg(self.words)
                )
            }
        }
    }
}

/// Returns the outlines of a text as path data, from the beginning of its baseline, in units of
/// [`FINE`]; and its width, points. A blank text has no outlines.
fn outlines(font: &Font, text: &str, words: &TextStyle) -> Option<(String, f32)> {
    let (path, width) = font.letters(text, words.size, words.bold);
    let mut data = PathData::default();
    for segment in path?.segments() {
        match segment {
            PathSegment::MoveTo(p) => data.step('m', &[p]),
            PathSegment::LineTo(p) => data.step('l', &[p]),
            PathSegment::QuadTo(a, p) => data.step('q', &[a, p]),
            PathSegment::CubicTo(a, b, p) => data.step('c', &[a, b, p]),
            PathSegment::Close => {
                data.text.push('z');
                (data.at, data.letter) = (data.start, 'z');
            }
        }
    }
    Some((data.text, width))
}

/// The unit of outlines, points: coordinates are whole numbers, which keeps files small.
const FINE: f32 = 0.01;

/// Path data under construction, with relative coordinates.
#[derive(Default)]
struct PathData {
    text: String,
    at: [i32; 2],
    /// Where the present part of the path begins.
    start: [i32; 2],
    letter: char,
}

impl PathData {
    fn step(&mut self, letter: char, points: &[Point]) {
        if letter != self.letter {
            self.text.push(letter);
        }
        let mut is_first = letter != self.letter;
        let mut end = self.at;
        for point in points {
            // Differences of rounded places: errors do not add up.
            end = [point.x, point.y].map(|v| (v / FINE).round() as i32);
            for distance in [end[0] - self.at[0], end[1] - self.at[1]] {
                // A minus separates numbers, too.
                if !is_first && distance >= 0 {
                    self.text.push(' ');
                }
                self.text += &distance.to_string();
                is_first = false;
            }
        }
        (self.at, self.letter) = (end, letter);
        if letter == 'm' {
            self.start = end;
        }
    }
}

/// Writes path data.
impl fmt::Display for Piece {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let through = |out: &mut fmt::Formatter, points: &[[f64; 2]]| {
            let letters = std::iter::once('M').chain(std::iter::repeat('L'));
            let places = points.iter().map(|point| point.map(number));
            letters
                .zip(places)
                .try_for_each(|(letter, [x, y])| write!(out, "{letter}{x} {y}"))
        };
        match self {
            Piece::Line(points) => through(out, points),
            Piece::Polygon(points) => {
                through(out, points)?;
                write!(out, "Z")
            }
            Piece::Rectangle { at, size } => {
                let ([x, y], [width, height]) = (at.map(number), size.map(number));
                write!(out, "M{x} {y}h{width}v{height}h-{width}z")
            }
            Piece::Level { from, length } => {
                let [x, y] = from.map(number);
                write!(out, "M{x} {y}h{}", number(*length))
            }
        }
    }
}

/// Formats a number with at most two decimals; NaN and extreme values become drawable ones.
pub(crate) fn number(value: f64) -> String {
    let text = number::fixed(drawable(value), 2);
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Escapes a text for XML.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            letter => out.push(printable(letter)),
        }
    }
    out
}

fn attributes(ink: &Ink) -> String {
    match ink {
        Ink::Fill(fill) => filled(*fill),
        Ink::Line(Pen {
            colour,
            width,
            dashes,
        }) => {
            let dashes = dashes.map(|lengths| lengths.map(number));
            let dashes = dashes.map(|[dash, gap]| format!(" stroke-dasharray=\"{dash} {gap}\""));
            let (stroke, opacity, width) = (
                colour.hex(),
                opacity("stroke-opacity", *colour),
                number(*width),
            );
            let dashes = dashes.unwrap_or_default();
            format!(" fill=\"none\" stroke=\"{stroke}\"{opacity} stroke-width=\"{width}\"{dashes}")
        }
    }
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
    use crate::draw::colour;
    use crate::draw::plot::canvas::TextStyle;

    #[test]
    fn every_element_has_its_svg() {
        let mut canvas = Canvas::default();
        let pen = Pen::new(colour::INK.with_opacity(51), 0.5);
        canvas.rectangle([1.0, 2.0], [3.0, 4.5], colour::PAPER);
        canvas.frame([1.0, 2.0], [3.0, 4.0], pen.dashed(3.0, 2.0));
        canvas.line([0.0, 0.0], [1.0, 1.0], pen);
        let [square, level] = [
            Piece::Rectangle {
                at: [1.0, 2.0],
                size: [3.0, 4.0],
            },
            Piece::Level {
                from: [5.0, 6.0],
                length: 7.0,
            },
        ];
        canvas.area(
            vec![
                square,
                level,
                Piece::Polygon(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),
            ],
            colour::INK,
        );
        canvas.dot([1.0, 2.0], 3.0, colour::INK);
        canvas.text(
            [1.0, 2.0],
            "a\n&",
            TextStyle {
                upwards: true,
                ..TextStyle::middle()
            }
            .bold(),
        );
        canvas.clipped([1.0, 2.0], [3.0, 4.0], |canvas| {
            canvas.faded(0.25, |canvas| {
                canvas.text([1.0, 2.0], "b", TextStyle::end())
            });
        });
        let expected = r##"<rect x="1" y="2" width="3" height="4.5" fill="#ffffff"/>
<rect x="1" y="2" width="3" height="4" fill="none" stroke="#222428" stroke-opacity="0.2" stroke-width="0.5" stroke-dasharray="3 2"/>
<path d="M0 0L1 1" fill="none" stroke="#222428" stroke-opacity="0.2" stroke-width="0.5" stroke-linejoin="round"/>
<path d="M1 2h3v4h-3zM5 6h7M0 0L1 0L1 1Z" fill="#222428"/>
<circle cx="1" cy="2" r="3" fill="#222428"/>
<text x="1" y="2" font-size="7.2" text-anchor="middle" font-weight="bold" transform="rotate(-90 1 2)" fill="#222428">a\n&amp;</text>
<svg x="1" y="2" width="3" height="4" viewBox="1 2 3 4" overflow="hidden">
<g opacity="0.25">
<text x="1" y="2" font-size="7.2" text-anchor="end" fill="#222428">b</text>
</g>
</svg>
"##;
        assert_eq!(canvas.svg(Words::Text), expected);
    }

    #[test]
    fn numbers_are_short_and_always_drawable() {
        assert_eq!(
            [0.0, -0.001, 1.5, 2.0, 3.1459].map(number),
            ["0", "0", "1.5", "2", "3.15"]
        );
        assert_eq!(
            [f64::NAN, f64::INFINITY, -1e300].map(number),
            ["0", "1000000", "-1000000"]
        );
    }

    #[test]
    fn any_text_is_fit_for_xml() {
        assert_eq!(
            escape("a<b>&\"c\u{0}\n"),
            "a&lt;b&gt;&amp;&quot;c\u{fffd}\u{fffd}"
        );
    }

    #[test]
    fn lines_are_broken_where_there_is_no_number() {
        let mut canvas = Canvas::default();
        let nan = f64::NAN;
        let points = [
            [0.0, 0.0],
            [1.0, 1.0],
            [2.0, nan],
            [3.0, 1.0],
            [4.0, 1.0],
            [nan, 0.0],
            [5.0, 5.0],
        ];
        canvas.polyline(&points, Pen::new(colour::INK, 1.0));
        assert!(canvas.svg(Words::Text).contains("d=\"M0 0L1 1M3 1L4 1\""));
    }
}
