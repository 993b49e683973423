//! The fonts of figures and pictures: embedded ones, which look the same on every machine, or files
//! of the user's.

use std::borrow::Cow;
use std::fmt;
use std::sync::{Arc, LazyLock};
use tiny_skia::{Path, PathBuilder};
use ttf_parser::gpos::{PairAdjustment, PositioningSubtable};
use ttf_parser::{Face, GlyphId, OutlineBuilder, Tag};

const REGULAR: &[u8] = include_bytes!("assets/DejaVuSansCondensed-subset.ttf");
const BOLD: &[u8] = include_bytes!("assets/DejaVuSansCondensed-Bold-subset.ttf");

/// The font families that the SVG of figures on a page lists: none wider than the embedded one, so
/// that text fits in any of them.
pub(crate) const FAMILIES: &str =
    "'DejaVu Sans Condensed', Arial, Helvetica, 'Liberation Sans', sans-serif";

/// The embedded font.
pub(crate) const EMBEDDED: Font = Font { files: None };

/// A regular and a bold typeface; by default those that are embedded in the program.
#[derive(Clone, Default)]
pub struct Font {
    /// The files of the user's font; they are fonts.
    files: Option<Arc<[Vec<u8>; 2]>>,
}

impl fmt::Debug for Font {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Font")
            .field("name", &self.name(false))
            .finish()
    }
}

impl PartialEq for Font {
    fn eq(&self, other: &Self) -> bool {
        self.data(false) == other.data(false) && self.data(true) == other.data(true)
    }
}

impl Font {
    /// Creates a font from the bytes of TrueType or OpenType files; without a bold one, the regular
    /// one serves for both. Returns `None` if a file is no font with outlines.
    pub(crate) fn of(regular: Vec<u8>, bold: Option<Vec<u8>>) -> Option<Self> {
        let bold = bold.unwrap_or_else(|| regular.clone());
        let has_outlines = |file: &Vec<u8>| {
            let tables = Face::parse(file, 0).ok()?.tables().clone();
            Some(tables.glyf.is_some() || tables.cff.is_some())
        };
        let files = [regular, bold];
        let are_fonts = files.iter().all(|file| has_outlines(file) == Some(true));
        are_fonts.then(|| Font {
            files: Some(Arc::new(files)),
        })
    }

    /// Returns the bytes of a typeface's file.
    pub(crate) fn data(&self, bold: bool) -> &[u8] {
        match &self.files {
            Some(files) => &files[usize::from(bold)],
            None => [REGULAR, BOLD][usize::from(bold)],
        }
    }

    pub(crate) fn face(&self, bold: bool) -> Cow<'_, Face<'_>> {
        static FONTS: LazyLock<[Face; 2]> = LazyLock::new(|| {
            [REGULAR, BOLD].map(|file| {
                Face::parse(file, 0).expect("the embedded fonts are fonts: a test reads them")
            })
        });
        match &self.files {
            Some(files) => Cow::Owned(
                Face::parse(&files[usize::from(bold)], 0).expect("it was parsed when it was read"),
            ),
            None => Cow::Borrowed(&FONTS[usize::from(bold)]),
        }
    }

    /// Returns the PostScript name of a typeface, in letters that a PDF's names can have.
    pub(crate) fn name(&self, bold: bool) -> String {
        let face = self.face(bold);
        let name = face
            .names()
            .into_iter()
            .filter(|name| name.name_id == ttf_parser::name_id::POST_SCRIPT_NAME)
            .find_map(|name| name.to_string())
            .unwrap_or_default();
        let is_plain = |letter: &char| letter.is_ascii_alphanumeric() || *letter == '-';
        let name: String = name.chars().filter(is_plain).take(60).collect();
        match name.is_empty() {
            true => "Font".to_string(),
            false => name,
        }
    }

    /// Returns the letters that a typeface lacks, each once and in order.
    pub(crate) fn lacking(&self, bold: bool, letters: impl Iterator<Item = char>) -> Vec<char> {
        let face = self.face(bold);
        let lacks = |letter: &char| face.glyph_index(*letter).is_none();
        let mut lacking: Vec<char> = letters.filter(lacks).collect();
        lacking.sort_unstable();
        lacking.dedup();
        lacking
    }

    /// Returns the width of an unkerned text, points, at a font size; the families of
    /// [`FAMILIES`] are no wider than the embedded font.
    pub(crate) fn width(&self, text: &str, size: f64, bold: bool) -> f64 {
        let font = self.face(bold);
        let units: u64 = text
            .chars()
            .map(|letter| u64::from(advance(&font, glyph(&font, letter))))
            .sum();
        // Font engines round sizes to 64ths.
        (64.0 * size).floor() / 64.0 * units as f64 / f64::from(font.units_per_em())
    }

    /// Returns the kerned outlines of a text from the origin, y down, and its width. Blanks have
    /// none.
    pub(crate) fn letters(&self, text: &str, size: f64, bold: bool) -> (Option<Path>, f32) {
        let font = self.face(bold);
        let scale = size as f32 / f32::from(font.units_per_em());
        let mut outlines = Outlines {
            path: PathBuilder::new(),
            scale,
            x: 0.0,
        };
        for Letter { glyph, kerning, .. } in self.set(text, bold) {
            outlines.x += scale * f32::from(kerning);
            // Blanks have no outline.
            let _ = font.outline_glyph(glyph, &mut outlines);
            outlines.x += scale * f32::from(advance(&font, glyph));
        }
        (outlines.path.finish(), outlines.x)
    }

    /// Returns the glyphs of a text with their kerning.
    pub(crate) fn set(&self, text: &str, bold: bool) -> Vec<Letter> {
        let font = self.face(bold);
        let pairs = Pairs::of(&font);
        let mut before = None;
        let set = text.chars().map(|letter| {
            let glyph = glyph(&font, letter);
            let kerning = before.map_or(0, |before| pairs.kerning(before, glyph));
            before = Some(glyph);
            Letter {
                letter,
                glyph,
                kerning,
                advance: advance(&font, glyph),
            }
        });
        set.collect()
    }

    /// Returns a text no wider than `most` points, cut with an ellipsis if necessary.
    pub(crate) fn fitted(&self, text: &str, size: f64, bold: bool, most: f64) -> String {
        let width = |text: &str| self.width(text, size, bold);
        if width(text) <= most {
            return text.to_string();
        }
        // Measures only up to the edge: a name in a file may have millions of letters.
        let left = most - width("…");
        let mut wide = 0.0;
        let begin = text.chars().take_while(|letter| {
            wide += width(letter.encode_utf8(&mut [0; 4]));
            wide <= left
        });
        begin.collect::<String>().trim_end().to_string() + "…"
    }

    /// Breaks a text at blanks into at most `count` lines, none wider than `most` points. Text that
    /// does not fit even so is cut.
    pub(crate) fn lines(
        &self,
        text: &str,
        size: f64,
        bold: bool,
        most: f64,
        count: usize,
    ) -> Vec<String> {
        let width = |text: &str| self.width(text, size, bold);
        let mut lines = Vec::new();
        let mut rest = text;
        while lines.len() + 1 < count && width(rest) > most {
            let blanks = rest.match_indices(' ').map(|(at, _)| at);
            let Some(end) = blanks.take_while(|at| width(&rest[..*at]) <= most).last() else {
                break;
            };
            lines.push(rest[..end].to_string());
            rest = rest[end..].trim_start();
        }
        lines.push(self.fitted(rest, size, bold, most));
        lines
    }
}

/// A letter of a text that is set in a typeface; lengths in font units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Letter {
    pub(crate) letter: char,
    pub(crate) glyph: GlyphId,
    /// The distance to add before it, mostly negative.
    pub(crate) kerning: i16,
    pub(crate) advance: u16,
}

/// Returns the glyph of a letter, or the font's empty box if it lacks the letter.
fn glyph(font: &Face, letter: char) -> GlyphId {
    font.glyph_index(letter).unwrap_or_default()
}

/// Returns the width of a glyph in font units.
fn advance(font: &Face, glyph: GlyphId) -> u16 {
    font.glyph_hor_advance(glyph).unwrap_or(0)
}

/// The tables of a typeface that kern pairs of letters.
struct Pairs<'a> {
    tables: Vec<PairAdjustment<'a>>,
}

impl<'a> Pairs<'a> {
    fn of(font: &Face<'a>) -> Self {
        let mut tables = Vec::new();
        if let Some(gpos) = font.tables().gpos {
            let is_kern = |tag: Tag| tag == Tag::from_bytes(b"kern");
            let features = gpos.features.into_iter().filter(|f| is_kern(f.tag));
            let mut lookups: Vec<u16> = features.flat_map(|f| f.lookup_indices).collect();
            lookups.sort_unstable();
            lookups.dedup();
            for lookup in lookups.into_iter().filter_map(|k| gpos.lookups.get(k)) {
                let subtables = lookup.subtables.into_iter::<PositioningSubtable>();
                tables.extend(subtables.filter_map(|subtable| match subtable {
                    PositioningSubtable::Pair(pairs) => Some(pairs),
                    _ => None,
                }));
            }
        }
        Pairs { tables }
    }

    /// Returns the kerning of two letters, font units: that of the first table that knows them.
    fn kerning(&self, before: GlyphId, glyph: GlyphId) -> i16 {
        let of = |table: &PairAdjustment| {
            let known = table.coverage().get(before)?;
            match table {
                PairAdjustment::Format1 { sets, .. } => {
                    Some(sets.get(known)?.get(glyph)?.0.x_advance)
                }
                PairAdjustment::Format2 {
                    classes, matrix, ..
                } => {
                    let (first, _) = matrix.get((classes.0.get(before), classes.1.get(glyph)))?;
                    Some(first.x_advance)
                }
            }
        };
        self.tables.iter().find_map(of).unwrap_or(0)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_are_those_of_the_letters() {
        assert_eq!(EMBEDDED.width("", 8.0, false), 0.0);
        assert!(EMBEDDED.width("iiii", 8.0, false) < EMBEDDED.width("mmmm", 8.0, false));
        assert!(
            (EMBEDDED.width("10", 10.0, false) - 2.0 * EMBEDDED.width("1", 10.0, false)).abs()
                < 1e-6
        );
        assert!(EMBEDDED.width("robot", 8.0, true) > EMBEDDED.width("robot", 8.0, false));
    }

    #[test]
    fn letters_fill_their_width_kerned_and_what_the_font_lacks_is_a_box() {
        let drawn = |text: &str| EMBEDDED.letters(text, 64.0, false);
        assert!((f64::from(drawn("mnmn").1) - EMBEDDED.width("mnmn", 64.0, false)).abs() < 1e-3);
        for pair in ["Te", "AV"] {
            let (drawn, unkerned) = (drawn(pair).1, EMBEDDED.width(pair, 64.0, false) as f32);
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
        assert_eq!(EMBEDDED.fitted("short", 8.0, false, 100.0), "short");
        let cut = EMBEDDED.fitted("a very long name of a very long run", 8.0, false, 60.0);
        assert!(
            cut.ends_with('…') && EMBEDDED.width(&cut, 8.0, false) <= 60.0 && cut.len() > 8,
            "{cut}"
        );
        assert_eq!(EMBEDDED.fitted("x", 8.0, false, 0.0), "…");
        // Cutting takes no time, however long the text is.
        let endless = EMBEDDED.fitted(&"name ".repeat(1_000_000), 8.0, false, 60.0);
        assert!(
            endless.starts_with("name name") && endless.ends_with('…') && endless.len() < 40,
            "{endless}"
        );
    }

    #[test]
    fn texts_are_broken_at_blanks_into_as_many_lines_as_they_need() {
        let text = "seven runs; the fittest of each task";
        let broken = |most: f64, count: usize| EMBEDDED.lines(text, 8.0, false, most, count);
        assert_eq!(broken(500.0, 3), [text]);
        let three = broken(60.0, 3);
        assert_eq!((three.len(), three.join(" ").as_str()), (3, text));
        assert!(
            three
                .iter()
                .all(|line| EMBEDDED.width(line, 8.0, false) <= 60.0),
            "{three:?}"
        );
        assert_eq!(broken(60.0, 9), three);
        assert!(broken(60.0, 2)[1].ends_with('…') && broken(60.0, 1)[0].ends_with('…'));
        // A single word that is too long is cut.
        assert_eq!(
            EMBEDDED.lines("morphological", 8.0, false, 30.0, 3).len(),
            1
        );
        assert_eq!(EMBEDDED.lines("", 8.0, false, 30.0, 3), [""]);
    }

    #[test]
    fn the_fonts_have_every_letter_that_figures_use() {
        for font in [false, true].map(|bold| EMBEDDED.face(bold)) {
            for letter in "aäßéŁΔσ0–—−×·±²→←≥≤…%|'“”°µ".chars() {
                assert!(font.glyph_index(letter).is_some(), "{letter}");
            }
        }
    }
}
