//! The fonts of figures and pictures: embedded, so that they are the same on every machine.
//!
//! An SVG names a list of families as wide as the embedded one or a little narrower: with any of
//! them the words fit.

use resvg::usvg::fontdb::Database;
use skrifa::prelude::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};
use std::sync::{Arc, LazyLock};

const REGULAR: &[u8] = include_bytes!("assets/DejaVuSansCondensed-subset.ttf");
const BOLD: &[u8] = include_bytes!("assets/DejaVuSansCondensed-Bold-subset.ttf");
const FAMILY: &str = "DejaVu Sans Condensed";

/// What the figures' SVG asks for.
pub const FAMILIES: &str = "'DejaVu Sans Condensed', Arial, Helvetica, 'Liberation Sans', sans-serif";

/// An embedded font.
pub fn font(bold: bool) -> FontRef<'static> {
    FontRef::new(if bold { BOLD } else { REGULAR }).expect("the embedded fonts are fonts: a test reads them")
}

/// The embedded fonts and no others.
pub fn database() -> Arc<Database> {
    static DATABASE: LazyLock<Arc<Database>> = LazyLock::new(|| {
        let mut database = Database::new();
        database.load_font_data(REGULAR.to_vec());
        database.load_font_data(BOLD.to_vec());
        database.set_sans_serif_family(FAMILY);
        Arc::new(database)
    });
    DATABASE.clone()
}

/// Width of a text in points at a font size.
pub fn width(text: &str, size: f64, bold: bool) -> f64 {
    let font = font(bold);
    let metrics = font.glyph_metrics(Size::new(size as f32), LocationRef::default());
    let charmap = font.charmap();
    let advance =
        |letter: char| metrics.advance_width(charmap.map(letter).unwrap_or_default()).unwrap_or(0.0);
    text.chars().map(|letter| f64::from(advance(letter))).sum()
}

/// A text no wider than `most` points: cut, with an ellipsis, if it has to be.
pub fn fitted(text: &str, size: f64, bold: bool, most: f64) -> String {
    if width(text, size, bold) <= most {
        return text.to_string();
    }
    // Letter by letter up to the edge: a name in a file may have millions.
    let left = most - width("…", size, bold);
    let mut wide = 0.0;
    let begin = text.chars().take_while(|letter| {
        wide += width(letter.encode_utf8(&mut [0; 4]), size, bold);
        wide <= left
    });
    begin.collect::<String>().trim_end().to_string() + "…"
}

/// A text in at most `count` lines no wider than `most` points, broken at blanks; what is too long
/// even so is cut.
pub fn lines(text: &str, size: f64, bold: bool, most: f64, count: usize) -> Vec<String> {
    let mut lines = Vec::new();
    let mut rest = text;
    while lines.len() + 1 < count && width(rest, size, bold) > most {
        let blanks = rest.match_indices(' ').map(|(at, _)| at);
        let Some(end) = blanks.take_while(|at| width(&rest[..*at], size, bold) <= most).last() else { break };
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
    fn texts_are_cut_to_fit() {
        assert_eq!(fitted("short", 8.0, false, 100.0), "short");
        let cut = fitted("a very long name of a very long run", 8.0, false, 60.0);
        assert!(cut.ends_with('…') && width(&cut, 8.0, false) <= 60.0 && cut.len() > 8, "{cut}");
        assert_eq!(fitted("x", 8.0, false, 0.0), "…");
        // However long it is, at once.
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
        assert!(three.iter().all(|line| width(line, 8.0, false) <= 60.0), "{three:?}");
        assert_eq!(broken(60.0, 9), three);
        assert!(broken(60.0, 2)[1].ends_with('…') && broken(60.0, 1)[0].ends_with('…'));
        // A word that is too long by itself is cut.
        assert_eq!(lines("morphological", 8.0, false, 30.0, 3).len(), 1);
        assert_eq!(lines("", 8.0, false, 30.0, 3), [""]);
    }

    #[test]
    fn the_fonts_have_every_letter_that_figures_use() {
        for font in [font(false), font(true)] {
            for letter in "aäßéŁΔσ0–—−×·±²→←≥≤…%|'“”°µ".chars() {
                assert!(font.charmap().map(letter).is_some(), "{letter}");
            }
        }
        assert_eq!(database().len(), 2);
    }
}
