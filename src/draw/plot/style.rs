//! [`Style`]: the width, title and font of figures, apart from their contents.

use crate::base::error::Error;
use crate::base::files::read_bytes;
use crate::draw::fonts::Font;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Width of a journal's column: 85 mm in points.
pub(crate) const COLUMN: f64 = 241.0;
/// Width of a journal's page: 178 mm in points.
pub(crate) const PAGE: f64 = 504.0;

/// Widths that a figure can have, millimetres: room for a legend, up to a large poster.
pub(crate) const MILLIMETRES: RangeInclusive<u32> = 60..=1000;

/// Points in a millimetre.
const POINTS: f64 = 72.0 / 25.4;

/// The style of a figure: its width, title and font.
///
/// Letters have the same size at every width: a wider figure has more room, not larger words.
#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// The width, points; `None` is a journal's column or page, as the figure needs.
    width: Option<f64>,
    has_title: bool,
    font: Font,
}

impl Default for Style {
    fn default() -> Self {
        Style {
            width: None,
            has_title: true,
            font: Font::default(),
        }
    }
}

impl Style {
    /// Gives the figure a width in millimetres.
    #[must_use]
    pub fn millimetres(self, width: Option<u32>) -> Self {
        let width = width.map(|width| f64::from(width) * POINTS);
        Style { width, ..self }
    }

    /// Leaves out the title and the line below it.
    #[must_use]
    pub fn without_title(self) -> Self {
        Style {
            has_title: false,
            ..self
        }
    }

    /// Writes in the font of a TrueType or OpenType file; a second file is for bold letters.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read or is no font.
    pub(crate) fn in_font(self, files: &[PathBuf]) -> Result<Self, Error> {
        let read = |path: &PathBuf| {
            let bytes = read_bytes(path).map_err(|error| Error::reading(path, &error))?;
            match Font::of(bytes.clone(), None) {
                Some(_) => Ok(bytes),
                None => Err(Error::input(format!(
                    "{}: expected a TrueType or OpenType font (.ttf, .otf)",
                    path.display()
                ))),
            }
        };
        let (regular, bold) = match files {
            [] => return Ok(self),
            [regular] => (read(regular)?, None),
            [regular, bold] => (read(regular)?, Some(read(bold)?)),
            more => {
                let text = format!("expected at most two files, these are {}", more.len());
                return Err(Error::usage(text).about("font"));
            }
        };
        let font = Font::of(regular, bold).expect("each was read as a font");
        Ok(Style { font, ..self })
    }

    /// Returns true if figures have the font that is embedded in the program.
    pub(crate) fn is_embedded(&self) -> bool {
        self.font == Font::default()
    }

    pub(super) fn has_title(&self) -> bool {
        self.has_title
    }

    pub(super) fn font(&self) -> &Font {
        &self.font
    }

    /// Returns the width of a figure that fits a column, points.
    pub(super) fn column(&self) -> f64 {
        self.width.unwrap_or(COLUMN)
    }

    /// Returns the width of a figure that needs a page, points.
    pub(super) fn page(&self) -> f64 {
        self.width.unwrap_or(PAGE)
    }

    /// Returns how many panels stand beside each other, if `usual` do so on a page: as many as are no
    /// narrower than there.
    pub(super) fn panels(&self, usual: usize) -> usize {
        // Slack for a width that is a page's in whole millimetres.
        let fitting = usual as f64 * self.page() / PAGE + 0.1;
        (fitting as usize).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::plot::{body, snapshots};
    use crate::draw::simulated;

    #[test]
    fn a_width_changes_the_layout_and_no_letter() {
        let recording = simulated("3344/5566", 4, 60, true);
        let sizes = |svg: &str| {
            let tree = roxmltree::Document::parse(svg).unwrap();
            let sizes = tree
                .descendants()
                .filter_map(|node| node.attribute("font-size"));
            let mut sizes: Vec<String> = sizes.map(str::to_string).collect();
            sizes.sort();
            sizes.dedup();
            sizes
        };
        for width in [*MILLIMETRES.start(), 130, *MILLIMETRES.end()] {
            let style = Style::default().millimetres(Some(width));
            let figures = [
                body(&"3344/5566".parse().unwrap(), "x", &style),
                snapshots(&recording, 20, "x", &style).unwrap(),
            ];
            for figure in figures {
                assert!((figure.size()[0] - f64::from(width) * POINTS).abs() < 1e-9);
                assert_eq!(sizes(&figure.outlined_svg()), ["7.2", "8.2"]);
            }
        }
        assert_eq!(Style::default().panels(4), 4);
        let panels = |width| Style::default().millimetres(Some(width)).panels(4);
        assert_eq!([60, 85, 178, 400].map(panels), [1, 2, 4, 9]);
    }

    #[test]
    fn without_a_title_a_figure_is_lower_and_has_no_title_but_a_name() {
        let drawn = |style: &Style| body(&"34/56".parse().unwrap(), "robot x", style);
        let (with, without) = (Style::default(), Style::default().without_title());
        let (with, without) = (drawn(&with), drawn(&without));
        assert_eq!(without.size()[0], with.size()[0]);
        assert!(without.size()[1] < with.size()[1] - 15.0);
        assert!(with.svg().contains(">robot x<") && !without.svg().contains(">robot x<"));
        assert!(without.svg().contains("aria-label=\"Body: robot x\""));
    }
}
