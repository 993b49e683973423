//! The embedded fonts of figures and pictures, which look the same on every machine.
//!
//! An SVG lists font families no wider than the embedded one, so that text fits in any of them.

use std::sync::LazyLock;
use tiny_skia::{Path, PathBuilder};
use ttf_parser::gpos::{PairAdjustment, PositioningSubtable};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

const REGULAR: &[u8] = include_bytes!("assets/DejaVuSansCondensed-subset.ttf");
const BOLD: &[u8] = include_bytes!("assets/DejaVuSansCondensed-Bold-subset.ttf");

/// The font families that the SVG of figures lists.
pub(crate) const FAMILIES: &str =
    "'DejaVu Sans Condensed', Arial, Helvetica, 'Liberation Sans', sans-serif";

fn font(bold: bool) -> &'static Face<'static> {
    static FONTS: LazyLock<[Face; 2]> = LazyLock::new(|| {
        [REGULAR, BOLD].map(|file| {
            Face::parse(file, 0).expect("the embedded fonts are fonts: a test reads them")
        })
    });
    &FONTS[usize::from(bold)]
}

/// Returns the glyph of a letter, or the font's empty box if it lacks the letter.
fn glyph(font: &Face, letter: char) -> GlyphId {
    font.glyph_index(letter).unwrap_or_default()
}

/// Returns the width of a glyph in font units.
fn advance(font: &Face, glyph: GlyphId) -> u16 {
    font.glyph_hor_advance(glyph).unwrap_or(0)
}

/// Returns the width of an unkerned text, points, at a font size; every family of figures fits it.
pub(crate) fn width(text: &str, size: f64, bold: bool) -> f64 {
    let font = font(bold);
    let units: u64 = text
        .chars()
        .map(|letter| u64::from(advance(font, glyph(font, letter))))
        .sum();
    // Font engines round sizes to 64ths.
    (64.0 * size).floor() / 64.0 * units as f64 / f64::from(font.units_per_em())
}

/// Returns the kerned outlines of a text from the origin, y down, and its width. Blanks have none.
pub(crate) fn letters(text: &str, size: f64, bold: bool) -> (Option<Path>, f32) {
    let font = font(bold);
    let scale = size as f32 / f32::from(font.units_per_em());
    let mut outlines = Outlines {
        path: PathBuilder::new(),
        scale,
        x: 0.0,
    };
    let mut before = None;
    for letter in text.chars() {
        let glyph = glyph(font, letter);
        outlines.x += scale * f32::from(before.map_or(0, |before| kerning(font, before, glyph)));
        // Blanks have no outline.
        let _ = font.outline_glyph(glyph, &mut outlines);
        outlines.x += scale * f32::from(advance(font, glyph));
        before = Some(glyph);
    }
    (outlines.path.finish(), outlines.x)
}

/// Returns the kerning of two letters, font units. The embedded fonts have one table of class
/// pairs.
fn kerning(font: &Face, before: GlyphId, glyph: GlyphId) -> i16 {
    let table = font
        .tables()
        .gpos
        .and_then(|gpos| gpos.lookups.get(0)?.subtables.get(0));
    match table {
        Some(PositioningSubtable::Pair(PairAdjustment::Format2 {
            coverage,
            classes,
            matrix,
        })) if coverage.contains(before) => matrix
            .get((classes.0.get(before), classes.1.get(glyph)))
            .map_or(0, |(first, _)| first.x_advance),
        _ => 0,
    }
}

/// Moves a letter's outline, in font units and with y up, to its position in a text.
struct Outlines {
    path: PathBuilder,
    scale: f32,
    x: f32,
}

impl Outlines {
    fn place(&self, x: f32, y: f32) -> [f32; 2] {
        [self.x + self.scale * x, -self.scale * y]
    }
}

impl OutlineBuilder for Outlines {
    fn move_to(&mut self, x: f32, y: f32) {
        let [x, y] = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let [x, y] = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, ax: f32, ay: f32, x: f32, y: f32) {
        let ([ax, ay], [x, y]) = (self.place(ax, ay), self.place(x, y));
        self.path.quad_to(ax, ay, x, y);
    }

    fn curve_to(&mut self, ax: f32, ay: f32, bx: f32, by: f32, x: f32, y: f32) {
        let ([ax, ay], [bx, by], [x, y]) =
            (self.place(ax, ay), self.place(bx, by), self.place(x, y));
        self.path.cubic_to(ax, ay, bx, by, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// Returns a text no wider than `most` points, cut with an ellipsis if necessary.
pub(crate) fn fitted(text: &str, size: f64, bold: bool, most: f64) -> String {
    if width(text, size, bold) <= most {
        return text.to_string();
    }
    // Measures only up to the edge: a name in a file may have millions of letters.
    let left = most - width("…", size, bold);
    let mut wide = 0.0;
    let begin = text.chars().take_while(|letter| {
        wide += width(letter.encode_utf8(&mut [0; 4]), size, bold);
        wide <= left
    });
    begin.collect::<String>().trim_end().to_string() + "…"
}

/// Breaks a text at blanks into at most `count` lines, none wider than `most` points. Text that
/// does not fit even so is cut.
pub(crate) fn lines(text: &str, size: f64, bold: bool, most: f64, count: usize) -> Vec<String> {
    let mut lines = Vec::new();
    let mut rest = text;
    while lines.len() + 1 < count && width(rest, size, bold) > most {
        let blanks = rest.match_indices(' ').map(|(at, _)| at);
        let Some(end) = blanks
            .take_while(|at| width(&rest[..*at], size, bold) <= most)
            .last()
        else {
            break;
        };
        lines.push(rest[..end].to_string());
        rest = rest[end..].trim_start();
    }
    lines.push(fitted(rest, size, bold, most));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_are_those_of_the_letters() {
        assert_eq!(width("", 8.0, false), 0.0);
        assert!(width("iiii", 8.0, false) < width("mmmm", 8.0, false));
        assert!((width("10", 10.0, false) - 2.0 * width("1", 10.0, false)).abs() < 1e-6);
        assert!(width("robot", 8.0, true) > width("robot", 8.0, false));
    }

    #[test]
    fn letters_fill_their_width_kerned_and_what_the_font_lacks_is_a_box() {
        let drawn = |text: &str| letters(text, 64.0, false);
        assert!((f64::from(drawn("mnmn").1) - width("mnmn", 64.0, false)).abs() < 1e-3);
        for pair in ["Te", "AV"] {
            let (drawn, unkerned) = (drawn(pair).1, width(pair, 64.0, false) as f32);
            assert!(drawn + 2.0 < unkerned, "{pair}: {drawn} {unkerned}");
        }
        let bounds = drawn("漢").0.unwrap().bounds();
        assert!(
            bounds.width() > 20.0 && bounds.height() > 40.0 && bounds.top() < -40.0,
            "{bounds:?}"
        );
        assert_eq!(drawn(" ").0, None);
    }

    #[test]
    fn texts_are_cut_to_fit() {
        assert_eq!(fitted("short", 8.0, false, 100.0), "short");
        let cut = fitted("a very long name of a very long run", 8.0, false, 60.0);
        assert!(
            cut.ends_with('…') && width(&cut, 8.0, false) <= 60.0 && cut.len() > 8,
            "{cut}"
        );
        assert_eq!(fitted("x", 8.0, false, 0.0), "…");
        // Cutting takes no time, however long the text is.
        let endless = fitted(&"name ".repeat(1_000_000), 8.0, false, 60.0);
        assert!(
            endless.starts_with("name name") && endless.ends_with('…') && endless.len() < 40,
            "{endless}"
        );
    }

    #[test]
    fn texts_are_broken_at_blanks_into_as_many_lines_as_they_need() {
        let text = "seven runs; the fittest of each task";
        let broken = |most: f64, count: usize| lines(text, 8.0, false, most, count);
        assert_eq!(broken(500.0, 3), [text]);
        let three = broken(60.0, 3);
        assert_eq!((three.len(), three.join(" ").as_str()), (3, text));
        assert!(
            three.iter().all(|line| width(line, 8.0, false) <= 60.0),
            "{three:?}"
        );
        assert_eq!(broken(60.0, 9), three);
        assert!(broken(60.0, 2)[1].ends_with('…') && broken(60.0, 1)[0].ends_with('…'));
        // A single word that is too long is cut.
        assert_eq!(lines("morphological", 8.0, false, 30.0, 3).len(), 1);
        assert_eq!(lines("", 8.0, false, 30.0, 3), [""]);
    }

    #[test]
    fn the_fonts_have_every_letter_that_figures_use() {
        for font in [font(false), font(true)] {
            for letter in "aäßéŁΔσ0–—−×·±²→←≥≤…%|'“”°µ".chars() {
                assert!(font.glyph_index(letter).is_some(), "{letter}");
            }
        }
    }
}
