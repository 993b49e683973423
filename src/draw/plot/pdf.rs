//! Renders a [`Canvas`] to PDF: vectors, and text in embedded subsets of its fonts. The same canvas
//! gives the same bytes: the file has no dates.

use crate::base::hash::sha256_hex;
use crate::draw::colour::Colour;
use crate::draw::error::PictureError;
use crate::draw::fonts::Font;
use crate::draw::plot::canvas::{Anchor, Canvas, Element, Ink, Pen, Piece, TextStyle};
use crate::draw::plot::svg::number;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write as _;
use subsetter::GlyphRemapper;
use ttf_parser::{RawFace, Tag};

/// Length of the handles of a Bézier curve that is a quarter of a circle of radius 1.
const HANDLE: f64 = 0.5523;

/// Numbers of the objects that every file has.
const CATALOGUE: usize = 1;
const PAGES: usize = 2;
const PAGE: usize = 3;
const CONTENT: usize = 4;
const RESOURCES: usize = 5;
const INFO: usize = 6;
const OTHERS: usize = 7;

impl Canvas {
    /// Returns a document of one page of a size in points, the elements over `paper`, if there is
    /// one.
    pub(super) fn pdf(
        &self,
        title: &str,
        size: [f64; 2],
        paper: Option<Colour>,
    ) -> Result<Vec<u8>, PictureError> {
        let mut page = Page {
            fonts: [false, true].map(|bold| Subset::new(self.font(), bold)),
            opacities: BTreeSet::new(),
            forms: Vec::new(),
        };
        let [width, height] = size.map(number);
        // Coordinates of figures run downwards, those of PDF upwards.
        let mut content = format!("1 0 0 -1 0 {height} cm\n");
        if let Some(paper) = paper {
            let ink = Ink::Fill(paper);
            content += &page.inked(&format!("0 0 {width} {height} re"), &ink, 0);
        }
        content += &page.drawn(self);

        let mut file = File::new();
        file.object(CATALOGUE, &format!("<</Type/Catalog/Pages {PAGES} 0 R>>"));
        file.object(PAGES, &format!("<</Type/Pages/Kids[{PAGE} 0 R]/Count 1>>"));
        let form = format!("/Resources {RESOURCES} 0 R/Group<</S/Transparency/CS/DeviceRGB>>");
        let text = format!(
            "<</Type/Page/Parent {PAGES} 0 R/MediaBox[0 0 {width} {height}]\
             /Contents {CONTENT} 0 R{form}>>"
        );
        file.object(PAGE, &text);
        file.stream(CONTENT, "", content.as_bytes())?;
        let title = utf16(title);
        file.object(INFO, &format!("<</Title<FEFF{title}>/Producer(morphcog)>>"));
        let mut resources = String::from("<</ExtGState<<");
        for opacity in &page.opacities {
            let share = number(f64::from(*opacity) / 255.0);
            resources += &format!("/O{opacity}<</ca {share}/CA {share}>>");
        }
        resources += ">>/XObject<<";
        let mut next = OTHERS;
        for (number, content) in page.forms.iter().enumerate() {
            resources += &format!("/X{number} {next} 0 R");
            let form = format!("/Type/XObject/Subtype/Form/BBox[0 0 {width} {height}]{form}");
            file.stream(next, &form, content.as_bytes())?;
            next += 1;
        }
        resources += ">>/Font<<";
        for font in page.fonts.iter().filter(|font| !font.used.is_empty()) {
            resources += &format!("/{} {next} 0 R", font.resource());
            next = font.embed(&mut file, next)?;
        }
        file.object(RESOURCES, &(resources + ">>>>"));
        Ok(file.finish())
    }
}

/// The state of a page under construction.
struct Page<'a> {
    fonts: [Subset<'a>; 2],
    opacities: BTreeSet<u8>,
    /// Contents that are drawn as a whole with an opacity.
    forms: Vec<String>,
}

impl Page<'_> {
    fn drawn(&mut self, canvas: &Canvas) -> String {
        let mut out = String::new();
        for element in canvas.elements() {
            out += &match element {
                Element::Rectangle { at, size, ink } => self.inked(&rectangle(*at, *size), ink, 0),
                Element::Path { pieces, ink } => {
                    let path: Vec<String> = pieces.iter().map(piece).collect();
                    self.inked(&path.join("\n"), ink, 1)
                }
                Element::Dot { at, radius, fill } => {
                    self.inked(&circle(*at, *radius), &Ink::Fill(*fill), 1)
                }
                Element::Text { at, text, words } => self.lettered(*at, text, words),
                Element::Faded { opacity, content } => {
                    let form = self.drawn(content);
                    self.forms.push(form);
                    let opacity = self.opacity((opacity * 255.0).round() as u8);
                    format!("q {opacity} /X{} Do Q\n", self.forms.len() - 1)
                }
                Element::Clipped { at, size, content } => {
                    let content = self.drawn(content);
                    format!("q {} W n\n{content}Q\n", rectangle(*at, *size))
                }
            };
        }
        out
    }

    fn opacity(&mut self, opacity: u8) -> String {
        self.opacities.insert(opacity);
        format!("/O{opacity} gs")
    }

    /// Fills or strokes a path; `join` is PDF's number for the corners of lines.
    fn inked(&mut self, path: &str, ink: &Ink, join: u8) -> String {
        match ink {
            Ink::Fill(fill) => {
                let (opacity, [r, g, b]) = (self.opacity(fill.opacity), rgb(*fill));
                format!("{opacity} {r} {g} {b} rg\n{path} f\n")
            }
            Ink::Line(Pen {
                colour,
                width,
                dashes,
            }) => {
                let (opacity, [r, g, b]) = (self.opacity(colour.opacity), rgb(*colour));
                let dashes = dashes.map(|lengths| lengths.map(number).join(" "));
                let (width, dashes) = (number(*width), dashes.unwrap_or_default());
                format!("{opacity} {r} {g} {b} RG {width} w {join} j [{dashes}] 0 d\n{path} S\n")
            }
        }
    }

    fn lettered(&mut self, at: [f64; 2], text: &str, words: &TextStyle) -> String {
        let opacity = self.opacity(words.colour.opacity);
        let font = &mut self.fonts[usize::from(words.bold)];
        let (shown, width) = font.shown(text);
        let before = width
            * words.size
            * match words.anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => 0.5,
                Anchor::End => 1.0,
            };
        let [x, y] = at;
        let (matrix, [x, y]) = match words.upwards {
            true => ("0 -1 -1 0", [x, y + before]),
            false => ("1 0 0 -1", [x - before, y]),
        };
        let ([x, y], [r, g, b]) = ([x, y].map(number), rgb(words.colour));
        let (name, size) = (font.resource(), number(words.size));
        format!(
            "{opacity} {r} {g} {b} rg BT /{name} {size} Tf {matrix} {x} {y} Tm [{shown}] TJ ET\n"
        )
    }
}

fn rgb(colour: Colour) -> [String; 3] {
    colour.rgb.map(|level| {
        let text = crate::base::number::fixed(f64::from(level) / 255.0, 4);
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    })
}

fn rectangle(at: [f64; 2], size: [f64; 2]) -> String {
    let ([x, y], [width, height]) = (at.map(number), size.map(number));
    format!("{x} {y} {width} {height} re")
}

fn piece(piece: &Piece) -> String {
    let through = |points: &[[f64; 2]]| {
        let steps = std::iter::once('m').chain(std::iter::repeat('l'));
        let places = points.iter().map(|point| point.map(number));
        let steps = steps
            .zip(places)
            .map(|(step, [x, y])| format!("{x} {y} {step}"));
        steps.collect::<Vec<_>>().join(" ")
    };
    match piece {
        Piece::Line(points) => through(points),
        Piece::Polygon(points) => through(points) + " h",
        Piece::Rectangle { at, size } => rectangle(*at, *size),
        Piece::Level { from, length } => through(&[*from, [from[0] + length, from[1]]]),
    }
}

fn circle([x, y]: [f64; 2], radius: f64) -> String {
    let place = |[dx, dy]: [f64; 2]| {
        let [x, y] = [x + dx * radius, y + dy * radius].map(number);
        format!("{x} {y}")
    };
    let mut out = format!("{} m", place([1.0, 0.0]));
    for [x, y] in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]] {
        // Each quarter ends where the next begins: a right angle further.
        let handles = [
            [x - HANDLE * y, y + HANDLE * x],
            [HANDLE * x - y, HANDLE * y + x],
        ];
        let [a, b] = handles.map(place);
        let _ = write!(out, " {a} {b} {} c", place([-y, x]));
    }
    out + " h"
}

fn utf16(text: &str) -> String {
    text.encode_utf16()
        .map(|unit| format!("{unit:04X}"))
        .collect()
}

/// The glyphs of a typeface that a page uses.
struct Subset<'a> {
    font: &'a Font,
    bold: bool,
    units: f64,
    glyphs: GlyphRemapper,
    /// The letter and the advance (font units) of each glyph, by its number in the subset.
    used: BTreeMap<u16, (char, u16)>,
}

impl<'a> Subset<'a> {
    fn new(font: &'a Font, bold: bool) -> Self {
        Subset {
            font,
            bold,
            units: f64::from(font.face(bold).units_per_em()),
            glyphs: GlyphRemapper::new(),
            used: BTreeMap::new(),
        }
    }

    fn resource(&self) -> &'static str {
        if self.bold { "FB" } else { "FR" }
    }

    /// Returns a text as an operand of TJ, and its width as a multiple of the font size.
    fn shown(&mut self, text: &str) -> (String, f64) {
        let (mut out, mut width) = (String::new(), 0.0);
        for letter in self.font.set(text, self.bold) {
            let kerning = f64::from(letter.kerning) / self.units;
            if letter.kerning != 0 {
                let _ = write!(out, "{}", number(-1000.0 * kerning));
            }
            let glyph = self.glyphs.remap(letter.glyph.0);
            let of = (letter.letter, letter.advance);
            self.used.entry(glyph).or_insert(of);
            let _ = write!(out, "<{glyph:04X}>");
            width += kerning + f64::from(letter.advance) / self.units;
        }
        (out, width)
    }

    /// Writes the objects of the font from a number on, the font first; returns the next number.
    fn embed(&self, file: &mut File, first: usize) -> Result<usize, PictureError> {
        let failed = |error: String| {
            let name = self.font.name(self.bold);
            PictureError::Encode(format!("the font {name} cannot be embedded: {error}"))
        };
        let face = self.font.face(self.bold);
        let subset = subsetter::subset(self.font.data(self.bold), 0, &self.glyphs)
            .map_err(|error| failed(error.to_string()))?;
        let raw = RawFace::parse(&subset, 0).map_err(|error| failed(error.to_string()))?;
        let (kind, key, extra, program) = match raw.table(Tag::from_bytes(b"CFF ")) {
            Some(cff) => ("CIDFontType0", "FontFile3", "/Subtype/CIDFontType0C", cff),
            None => ("CIDFontType2", "FontFile2", "", &*subset),
        };
        // Programs that join documents tell subsets of one font apart by these letters.
        let letters = sha256_hex(&subset)
            .bytes()
            .map(|digit| char::from(b'A' + digit % 26))
            .take(6)
            .collect::<String>();
        let name = format!("{letters}+{}", self.font.name(self.bold));
        let [composite, descendant, descriptor, data, unicode] = [0, 1, 2, 3, 4].map(|k| first + k);
        let text = format!(
            "<</Type/Font/Subtype/Type0/BaseFont/{name}/Encoding/Identity-H\
             /DescendantFonts[{descendant} 0 R]/ToUnicode {unicode} 0 R>>"
        );
        file.object(composite, &text);
        let per_mille = |units: f64| number(1000.0 * units / self.units);
        let widths = self
            .used
            .iter()
            .map(|(glyph, (_, advance))| format!("{glyph}[{}]", per_mille(f64::from(*advance))));
        let widths: String = widths.collect();
        let map = if kind == "CIDFontType2" {
            "/CIDToGIDMap/Identity"
        } else {
            ""
        };
        let text = format!(
            "<</Type/Font/Subtype/{kind}/BaseFont/{name}/FontDescriptor {descriptor} 0 R/DW 0\
             /CIDSystemInfo<</Registry(Adobe)/Ordering(Identity)/Supplement 0>>/W[{widths}]{map}>>"
        );
        file.object(descendant, &text);
        let limits = face.global_bounding_box();
        let limits = [limits.x_min, limits.y_min, limits.x_max, limits.y_max];
        let [ascent, descent, capitals] = [
            face.ascender(),
            face.descender(),
            face.capital_height().unwrap_or(face.ascender()),
        ]
        .map(|units| per_mille(f64::from(units)));
        // Flags: its letters are numbered in a way of their own. StemV is a usual value.
        let text = format!(
            "<</Type/FontDescriptor/FontName/{name}/Flags 4/FontBBox[{}]/ItalicAngle {}\
             /Ascent {ascent}/Descent {descent}/CapHeight {capitals}/StemV 80/{key} {data} 0 R>>",
            limits.map(|units| per_mille(f64::from(units))).join(" "),
            number(f64::from(face.italic_angle())),
        );
        file.object(descriptor, &text);
        let length = match kind {
            "CIDFontType2" => format!("/Length1 {}", program.len()),
            _ => extra.to_string(),
        };
        file.stream(data, &length, program)?;
        file.stream(unicode, "", self.to_unicode().as_bytes())?;
        Ok(unicode + 1)
    }

    /// Returns the table from glyphs to letters, by which text can be selected and searched.
    fn to_unicode(&self) -> String {
        let mut out = String::from(
            "/CIDInit /ProcSet findresource begin\n12 dict begin\nbegincmap\n\
             /CIDSystemInfo <</Registry (Adobe) /Ordering (UCS) /Supplement 0>> def\n\
             /CMapName /Adobe-Identity-UCS def\n/CMapType 2 def\n\
             1 begincodespacerange\n<0000> <FFFF>\nendcodespacerange\n",
        );
        // Glyph 0 is the box for letters that the font lacks.
        let known: Vec<_> = self.used.iter().filter(|(glyph, _)| **glyph > 0).collect();
        for some in known.chunks(100) {
            let _ = writeln!(out, "{} beginbfchar", some.len());
            for (glyph, (letter, _)) in some {
                let letter = utf16(letter.encode_utf8(&mut [0; 4]));
                let _ = writeln!(out, "<{glyph:04X}> <{letter}>");
            }
            out += "endbfchar\n";
        }
        out + "endcmap\nCMapName currentdict /CMap defineresource pop\nend\nend\n"
    }
}

/// A PDF file under construction: numbered objects.
struct File {
    bytes: Vec<u8>,
    /// Where each object begins.
    places: BTreeMap<usize, usize>,
}

impl File {
    fn new() -> Self {
        File {
            // Bytes above 127 tell programs that the file is binary.
            bytes: b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n".to_vec(),
            places: BTreeMap::new(),
        }
    }

    fn object(&mut self, number: usize, text: &str) {
        self.places.insert(number, self.bytes.len());
        let object = format!("{number} 0 obj\n{text}\nendobj\n");
        self.bytes.extend(object.as_bytes());
    }

    /// Adds a compressed stream; `keys` are those of its dictionary besides the usual ones.
    fn stream(&mut self, number: usize, keys: &str, content: &[u8]) -> Result<(), PictureError> {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        let compressed = encoder.write_all(content).and_then(|()| encoder.finish());
        let compressed = compressed.map_err(|error| PictureError::Encode(error.to_string()))?;
        self.places.insert(number, self.bytes.len());
        let length = compressed.len();
        let head =
            format!("{number} 0 obj\n<</Length {length}/Filter/FlateDecode{keys}>>\nstream\n");
        self.bytes.extend(head.as_bytes());
        self.bytes.extend(compressed);
        self.bytes.extend(b"\nendstream\nendobj\n");
        Ok(())
    }

    fn finish(mut self) -> Vec<u8> {
        let (start, count) = (self.bytes.len(), self.places.len() + 1);
        let mut table = format!("xref\n0 {count}\n0000000000 65535 f \n");
        for place in self.places.values() {
            // An entry has 20 bytes with its end.
            table += &format!("{place:010} 00000 n \n");
        }
        let _ = write!(
            table,
            "trailer\n<</Size {count}/Root {CATALOGUE} 0 R/Info {INFO} 0 R>>\n\
             startxref\n{start}\n%%EOF\n"
        );
        self.bytes.extend(table.as_bytes());
        self.bytes
    }
}
