//! [`Figure`]: a vector picture, written as SVG, PDF, or as PNG.

use crate::draw::colour;
use crate::draw::error::{PictureError, write_whole};
use crate::draw::fonts::FAMILIES;
use crate::draw::plot::canvas::Canvas;
use crate::draw::plot::svg::{Words, escape, number};
use crate::store::names::FigureFormat;
use std::path::PathBuf;
use tiny_skia::{Color, Pixmap, Transform};

/// Pixels per inch of pictures for print.
pub(crate) const PRINT: u32 = 300;
/// Maximum number of pixels on a side of a PNG.
const MOST_PIXELS: f64 = 16_000.0;

/// The background of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// White.
    Paper,
    /// Transparent: the page behind shows through.
    Transparent,
}

/// A vector picture. Its SVG has no ids, classes or styles: a page can hold any number of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    title: String,
    size: [f64; 2],
    content: Canvas,
    background: Background,
}

impl Figure {
    /// Creates a figure of a width and height in points, the content's origin at the top left.
    pub(super) fn new(title: &str, size: [f64; 2], content: Canvas) -> Self {
        Figure {
            title: title.to_string(),
            size,
            content,
            background: Background::Paper,
        }
    }

    #[must_use]
    pub(crate) fn on(self, background: Background) -> Self {
        Figure { background, ..self }
    }

    /// Returns the width and height in points.
    pub(crate) fn size(&self) -> [f64; 2] {
        self.size
    }

    /// Returns the title, for those who cannot see the figure.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// Returns the figure as SVG for a page: one element `svg`, whose words can be selected.
    pub fn svg(&self) -> String {
        self.written(Words::Text)
    }

    /// Returns the figure as SVG for a file: its words are outlines, which look the same everywhere.
    pub fn outlined_svg(&self) -> String {
        self.written(Words::Outlines)
    }

    /// Returns the figure as PDF: one page of its size, with the fonts that it uses.
    ///
    /// # Errors
    /// Returns a [`PictureError`] if a font cannot be embedded.
    pub fn pdf(&self) -> Result<Vec<u8>, PictureError> {
        let paper = (self.background == Background::Paper).then_some(colour::PAPER);
        self.content.pdf(&self.title, self.size, paper)
    }

    /// Returns the bytes of a file of the figure; a PNG is as for print.
    pub(crate) fn bytes(&self, format: FigureFormat) -> Result<Vec<u8>, PictureError> {
        match format {
            FigureFormat::Svg => Ok(self.outlined_svg().into_bytes()),
            FigureFormat::Png => self.print(),
            FigureFormat::Pdf => self.pdf(),
        }
    }

    /// Writes the figure to a file for each format, in the order of [`FigureFormat::ALL`]. Makes
    /// all files before writing any.
    pub(crate) fn write(&self, paths: &[PathBuf; 3]) -> Result<(), PictureError> {
        let bytes = FigureFormat::ALL.iter().map(|format| self.bytes(*format));
        let bytes = bytes.collect::<Result<Vec<_>, _>>()?;
        paths
            .iter()
            .zip(&bytes)
            .try_for_each(|(path, bytes)| write_whole(path, bytes))
    }

    /// Returns the letters of the figure that its font lacks, each once and in order.
    pub(crate) fn lacking(&self) -> Vec<char> {
        let font = self.content.font();
        let mut lacking = Vec::new();
        for (text, bold) in self.content.texts() {
            // A letter that cannot be drawn is a box in any font.
            let letters = text.chars().filter(|letter| *letter != '\u{fffd}');
            lacking.extend(font.lacking(bold, letters));
        }
        lacking.sort_unstable();
        lacking.dedup();
        lacking
    }

    fn written(&self, words: Words) -> String {
        let [width, height] = self.size.map(number);
        let title = escape(&self.title);
        let paper = match self.background {
            Background::Transparent => String::new(),
            Background::Paper => {
                format!(
                    "<rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
                    colour::PAPER.hex()
                )
            }
        };
        let families = match words {
            Words::Text => format!(" font-family=\"{FAMILIES}\""),
            Words::Outlines => String::new(),
        };
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\"{families}>\n\
             <title>{title}</title>\n{paper}{}</svg>\n",
            self.content.svg(words)
        )
    }

    /// Returns the largest resolution up to `dpi`, pixels per inch, at which a PNG is possible.
    pub(crate) fn fitting(&self, dpi: u32) -> u32 {
        let longest = self.size.into_iter().fold(1.0, f64::max);
        // One pixel less, because a pixel cut by the edge counts too.
        dpi.min(((MOST_PIXELS - 1.0) * 72.0 / longest) as u32)
            .max(1)
    }

    /// Returns the figure as PNG for print, with [`PRINT`] pixels per inch or as many as possible.
    ///
    /// # Errors
    /// Returns a [`PictureError`] if it cannot be encoded.
    pub fn print(&self) -> Result<Vec<u8>, PictureError> {
        self.png(self.fitting(PRINT))
    }

    /// Returns the figure as PNG with `dpi` pixels per inch; the file states its intended size.
    ///
    /// # Errors
    /// Returns a [`PictureError`] if it would have too many pixels, or cannot be encoded.
    pub fn png(&self, dpi: u32) -> Result<Vec<u8>, PictureError> {
        let scale = f64::from(dpi) / 72.0;
        let [width, height] = self.size.map(|points| (points * scale).ceil());
        let possible = |pixels: f64| (1.0..=MOST_PIXELS).contains(&pixels);
        if !possible(width) || !possible(height) {
            return Err(PictureError::Figure { width, height });
        }
        let mut pixmap = Pixmap::new(width as u32, height as u32)
            .ok_or(PictureError::Figure { width, height })?;
        if self.background == Background::Paper {
            pixmap.fill(Color::WHITE);
        }
        self.content.draw(
            &mut pixmap,
            Transform::from_scale(scale as f32, scale as f32),
        );
        encode_png(&pixmap, scale, self.background)
            .map_err(|error| PictureError::Encode(error.to_string()))
    }
}

fn encode_png(
    pixmap: &Pixmap,
    scale: f64,
    background: Background,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, pixmap.width(), pixmap.height());
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let per_metre = (scale * 72.0 / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    let pixels = pixmap.pixels().iter().map(|pixel| pixel.demultiply());
    let data: Vec<u8> = match background {
        Background::Paper => {
            encoder.set_color(png::ColorType::Rgb);
            pixels
                .flat_map(|p| [p.red(), p.green(), p.blue()])
                .collect()
        }
        Background::Transparent => {
            encoder.set_color(png::ColorType::Rgba);
            pixels
                .flat_map(|p| [p.red(), p.green(), p.blue(), p.alpha()])
                .collect()
        }
    };
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&data)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::plot::canvas::TextStyle;

    #[test]
    fn a_file_has_outlines_with_their_words_and_a_page_has_text() {
        let count = |svg: &str, name: &str| {
            let tree = roxmltree::Document::parse(svg).unwrap();
            tree.descendants()
                .filter(|node| node.has_tag_name(name))
                .count()
        };
        let (file, page) = (figure().outlined_svg(), figure().svg());
        assert_eq!([count(&file, "text"), count(&file, "path")], [0, 1]);
        assert_eq!([count(&page, "text"), count(&page, "path")], [1, 0]);
        assert!(file.contains("aria-label=\"a &lt; b &amp; c\" font-size=\"7.2\""));
    }

    /// Returns the decompressed streams of a PDF, those that are text.
    fn streams(pdf: &[u8]) -> Vec<String> {
        let find = |bytes: &[u8], word: &[u8]| bytes.windows(word.len()).position(|w| w == word);
        let (mut rest, mut found) = (pdf, Vec::new());
        while let Some(begin) = find(rest, b"\nstream\n") {
            rest = &rest[begin + 8..];
            let mut text = Vec::new();
            let mut decoder = flate2::read::ZlibDecoder::new(rest);
            std::io::Read::read_to_end(&mut decoder, &mut text).unwrap();
            found.extend(String::from_utf8(text));
            rest = &rest[find(rest, b"endstream").unwrap()..];
        }
        found
    }

    #[test]
    fn a_pdf_has_its_size_and_text_in_embedded_subsets_that_can_be_read_back() {
        let pdf = figure().pdf().unwrap();
        assert_eq!(pdf, figure().pdf().unwrap());
        let text = String::from_utf8_lossy(&pdf).into_owned();
        assert!(text.starts_with("%PDF-1.7\n") && text.ends_with("%%EOF\n"));
        assert!(text.contains("/MediaBox[0 0 60 50]") && !text.contains("Date"));
        assert!(text.contains("+DejaVuSansCondensed/") && text.contains("/FontFile2 "));
        // Only the regular typeface is used, and only the letters that are there.
        assert!(
            !text.contains("Bold") && pdf.len() < 12_000,
            "{}",
            pdf.len()
        );
        let streams = streams(&pdf);
        let letters: Vec<&str> = streams
            .iter()
            .find(|stream| stream.contains("beginbfchar"))
            .unwrap()
            .lines()
            .filter_map(|line| {
                line.strip_prefix("<00")?
                    .split_once("> <")?
                    .1
                    .strip_suffix('>')
            })
            .filter(|letter| *letter != "FFFF")
            .collect();
        let expected: Vec<String> = "a <b&c"
            .chars()
            .map(|c| format!("{:04X}", c as u32))
            .collect();
        assert_eq!(letters, expected);
        assert!(streams[0].contains("10 10 20 10 re f") && streams[0].contains("/FR 7.2 Tf"));
        // Every object is where the table of the file says.
        let table: usize = text.lines().rev().nth(1).unwrap().parse().unwrap();
        assert!(pdf[table..].starts_with(b"xref\n"));
        let places = text[text.rfind("xref\n0 ").unwrap()..].lines().skip(3);
        let places = places.map_while(|line| line.strip_suffix(" 00000 n "));
        for (number, place) in (1..).zip(places.map(|place| place.parse::<usize>().unwrap())) {
            let object = format!("{number} 0 obj\n");
            assert!(pdf[place..].starts_with(object.as_bytes()), "{number}");
        }
    }

    #[test]
    fn a_transparent_pdf_has_no_paper() {
        let paper = |figure: Figure| streams(&figure.pdf().unwrap())[0].contains("0 0 60 50 re");
        assert!(paper(figure()) && !paper(figure().on(Background::Transparent)));
    }

    fn figure() -> Figure {
        let mut canvas = Canvas::default();
        canvas.rectangle([10.0, 10.0], [20.0, 10.0], colour::INK);
        canvas.text([5.0, 40.0], "a < b & c", TextStyle::default());
        Figure::new("A \"test\" <1>", [60.0, 50.0], canvas)
    }

    #[test]
    fn an_svg_is_well_formed_and_has_nothing_that_could_clash() {
        let svg = figure().svg();
        let tree = roxmltree::Document::parse(&svg).unwrap();
        for node in tree.descendants() {
            assert!(
                !node.has_attribute("id") && !node.has_attribute("class"),
                "{node:?}"
            );
            assert!(node.tag_name().name() != "style");
        }
        assert_eq!(
            tree.root_element().attribute("aria-label"),
            Some("A \"test\" <1>")
        );
    }

    #[test]
    fn a_png_has_the_asked_size_and_background() {
        let read = |bytes: &[u8]| Pixmap::decode_png(bytes).unwrap();
        let paper = read(&figure().png(144).unwrap());
        assert_eq!((paper.width(), paper.height()), (120, 100));
        assert_eq!(paper.pixel(1, 1).unwrap().red(), 255);
        assert_eq!(paper.pixel(30, 30).unwrap().red(), colour::INK.rgb[0]);
        let clear = read(&figure().on(Background::Transparent).png(144).unwrap());
        assert_eq!(
            (
                clear.pixel(1, 1).unwrap().alpha(),
                clear.pixel(30, 30).unwrap().alpha()
            ),
            (0, 255)
        );
        // The letters are there, in the embedded font.
        let dark = (60..90).any(|y| (8..100).any(|x| paper.pixel(x, y).unwrap().red() < 100));
        assert!(dark);
        assert!(figure().png(0).is_err() && figure().png(u32::MAX).is_err());
        assert_eq!(figure().png(144).unwrap(), figure().png(144).unwrap());
    }

    #[test]
    fn a_figure_has_as_many_pixels_as_it_can_have_and_no_more() {
        assert_eq!(figure().fitting(PRINT), PRINT);
        for height in [3839.9, 3840.0, 3840.1, 17_003.25, 720.0, 1e5, 1e9] {
            let long = Figure::new("long", [60.0, height], Canvas::default());
            let pixels = |dpi: u32| (height * f64::from(dpi) / 72.0).ceil();
            let dpi = long.fitting(2400);
            assert!(pixels(dpi) <= MOST_PIXELS || dpi == 1, "{height}: {dpi}");
            assert!(pixels(dpi + 1) >= MOST_PIXELS, "{height}: {dpi}");
            assert_eq!(long.fitting(PRINT), dpi.min(PRINT));
        }
        let long = Figure::new("long", [60.0, 17_000.0], Canvas::default());
        assert_eq!(
            Pixmap::decode_png(&long.print().unwrap()).unwrap().height(),
            15_820
        );
    }
}
