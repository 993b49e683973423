//! [`Figure`]: a vector picture, written as SVG, or as PNG with embedded fonts.

use crate::draw::colour;
use crate::draw::error::PictureError;
use crate::draw::fonts;
use crate::draw::plot::canvas::Canvas;
use crate::draw::plot::svg::{escape, number};
use tiny_skia::{Color, Pixmap, Transform};

/// Width of a journal's column: 85 mm in points.
pub(crate) const COLUMN: f64 = 241.0;
/// Width of a journal's page: 178 mm in points.
pub(crate) const PAGE: f64 = 504.0;
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

    /// Returns the figure as SVG: one element `svg`, for a file or for a page.
    pub fn svg(&self) -> String {
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
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\" font-family=\"{}\">\n\
             <title>{title}</title>\n{paper}{}</svg>\n",
            fonts::FAMILIES,
            self.content.svg()
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

    fn figure() -> Figure {
        let mut canvas = Canvas::new();
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
            let long = Figure::new("long", [60.0, height], Canvas::new());
            let pixels = |dpi: u32| (height * f64::from(dpi) / 72.0).ceil();
            let dpi = long.fitting(2400);
            assert!(pixels(dpi) <= MOST_PIXELS || dpi == 1, "{height}: {dpi}");
            assert!(pixels(dpi + 1) >= MOST_PIXELS, "{height}: {dpi}");
            assert_eq!(long.fitting(PRINT), dpi.min(PRINT));
        }
        let long = Figure::new("long", [60.0, 17_000.0], Canvas::new());
        assert_eq!(
            Pixmap::decode_png(&long.print().unwrap()).unwrap().height(),
            15_820
        );
    }
}
