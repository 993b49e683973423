//! Text in pictures: a small bitmap font, 5 × 7 dots a letter, drawn in `font.txt`.
//!
//! `font.txt` holds bands of eight lines: the letters, six columns apart, then their seven rows of
//! dots. Letters of `DESCENDERS` stand `DESCENT` dots lower.

use crate::view::colour::Colour;
use crate::view::scene::Primitive;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Dots from one letter to the next.
pub const ADVANCE: f64 = 6.0;
/// Dots of a letter's height.
pub const HEIGHT: f64 = 7.0;

/// Letters that reach below the line.
const DESCENDERS: &str = "gpqy";
/// By how many dots.
const DESCENT: f64 = 2.0;

type Glyph = [[bool; 5]; 7];

static GLYPHS: LazyLock<BTreeMap<char, Glyph>> = LazyLock::new(|| parse(include_str!("font.txt")));

fn parse(drawing: &str) -> BTreeMap<char, Glyph> {
    let lines: Vec<Vec<char>> = drawing.lines().map(|l| l.chars().collect()).collect();
    let mut glyphs = BTreeMap::new();
    for band in lines.chunks_exact(8) {
        for (k, letter) in band[0].iter().step_by(6).enumerate() {
            let dot = |r: usize, c: usize| band[r + 1].get(6 * k + c) == Some(&'#');
            glyphs.insert(*letter, std::array::from_fn(|r| std::array::from_fn(|c| dot(r, c))));
        }
    }
    glyphs
}

/// Width of a text in dots.
pub fn width(text: &str) -> f64 {
    (ADVANCE * text.chars().count() as f64 - 1.0).max(0.0)
}

/// Text as filled quads, one per horizontal run of dots, in pixels with y down; (x, y) is its top
/// left corner, `dot` the side of a dot. Letters that the font lacks become a box.
pub fn text(text: &str, [x, y]: [f64; 2], dot: f64, colour: Colour) -> Vec<Primitive> {
    let mut out = Vec::new();
    for (k, letter) in text.chars().enumerate().filter(|(_, c)| *c != ' ') {
        let Some(glyph) = GLYPHS.get(&letter).or_else(|| GLYPHS.get(&'\u{fffd}')) else { continue };
        let y = if DESCENDERS.contains(letter) { y + DESCENT * dot } else { y };
        for (r, row) in glyph.iter().enumerate() {
            let mut c = 0;
            while c < row.len() {
                let run = row[c..].iter().take_while(|on| **on).count();
                if run > 0 {
                    let left = x + dot * (ADVANCE * k as f64 + c as f64);
                    let top = y + dot * r as f64;
                    out.push(Primitive::rectangle([left, top], [left + dot * run as f64, top + dot], colour));
                }
                c += run + 1;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printable_ascii_letter_has_a_glyph_of_its_own() {
        let glyphs: Vec<&Glyph> =
            ('!'..='~').map(|c| GLYPHS.get(&c).unwrap_or_else(|| panic!("{c}"))).collect();
        let different: std::collections::BTreeSet<_> = glyphs.iter().collect();
        assert_eq!(different.len(), glyphs.len());
        assert!(glyphs.iter().all(|g| g.iter().flatten().any(|dot| *dot)));
    }

    #[test]
    fn text_is_as_wide_as_said_and_unknown_letters_are_boxes() {
        assert_eq!((width(""), width("1"), width("10")), (0.0, 5.0, 11.0));
        assert!(text("   ", [0.0, 0.0], 1.0, crate::view::colour::INK).is_empty());
        let boxed = text("\u{4e00}", [0.0, 0.0], 1.0, crate::view::colour::INK);
        assert_eq!(boxed.len(), 2 + 5 * 2);
    }
}
