//! Tables of pixels as CSV: a row per image, with its label first or where the header says.

use crate::base::error::Error;
use crate::data::idx;
use crate::data::import::arrays::{Scale, byte};
use crate::data::import::item::{Found, Grey, Item, Label, Part, Picture, Refused};
use std::path::PathBuf;

/// Names of the column with the labels, in lower case.
const LABELS: [&str; 6] = ["label", "labels", "class", "target", "y", "digit"];

/// A table of a source.
#[derive(Clone, Debug)]
pub(crate) struct TableFile {
    pub(crate) path: PathBuf,
    /// The path below the source.
    pub(crate) name: String,
    pub(crate) part: Option<Part>,
    pub(crate) is_emnist: bool,
}

/// A row that could be read.
struct Row {
    source: String,
    label: Label,
    part: Option<Part>,
    is_emnist: bool,
    /// Fractions are rare: whole numbers take a quarter of the memory.
    pixels: Result<Vec<u8>, Vec<f32>>,
    side: usize,
}

/// Reads tables; their pixels have one scale.
pub(crate) fn read(files: &[TableFile]) -> Result<Found, Error> {
    let mut found = Found::default();
    let mut rows = Vec::new();
    for file in files {
        let content = idx::unpacked(&file.path).map_err(|error| Error::input(error.to_string()))?;
        table(file, &content, &mut rows, &mut found.refused)?;
    }
    let largest = |row: &Row| match &row.pixels {
        Ok(bytes) => bytes.iter().max().copied().map_or(0.0, f32::from),
        Err(real) => real.iter().copied().fold(0.0, f32::max),
    };
    let scale = match rows.iter().map(largest).fold(0.0, f32::max) <= 1.0 {
        true => Scale::Unit,
        false => Scale::Byte,
    };
    found.items.extend(rows.into_iter().map(|row| {
        let pixels = match row.pixels {
            Ok(bytes) if scale == Scale::Byte => bytes,
            Ok(bytes) => bytes
                .iter()
                .map(|value| byte(f64::from(*value), scale))
                .collect(),
            Err(real) => real
                .iter()
                .map(|value| byte(f64::from(*value), scale))
                .collect(),
        };
        Item {
            picture: Picture::Grey(Grey::new(row.side, row.side, pixels)),
            label: row.label,
            part: row.part,
            source: row.source,
            is_emnist: row.is_emnist,
        }
    }));
    Ok(found)
}

fn table(
    file: &TableFile,
    content: &[u8],
    rows: &mut Vec<Row>,
    refused: &mut Vec<Refused>,
) -> Result<(), Error> {
    let place = file.path.display();
    let content = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content);
    let line = content
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    let often = |mark: u8| line.iter().filter(|byte| **byte == mark).count();
    let mark = [b',', b';', b'\t']
        .into_iter()
        .max_by_key(|mark| (often(*mark), *mark == b','));
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(mark.unwrap_or(b','))
        .trim(csv::Trim::All)
        .from_reader(content);
    let mut record = csv::ByteRecord::new();
    // The label's column and the number of columns, from the first row.
    let mut columns: Option<(usize, usize, usize)> = None;
    let mut place_of = Lines::new(content);
    loop {
        let begin = reader.position().byte();
        match reader.read_byte_record(&mut record) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                let line = place_of.line(begin);
                refused.push(Refused::new(
                    format!("{}:{line}", file.name),
                    error.to_string(),
                ));
                continue;
            }
        }
        let line = place_of.line(record.position().map_or(begin, csv::Position::byte));
        let (label, count, side) = match columns {
            Some(known) => known,
            None => {
                let named = label_column(&record);
                let label = named.unwrap_or(0);
                let side = side(record.len()).ok_or_else(|| {
                    Error::input(format!("{place}: {}", wrong_columns(record.len())))
                })?;
                columns = Some((label, record.len(), side));
                if is_header(&record, label) || counts_up(&record, named) {
                    continue;
                }
                (label, record.len(), side)
            }
        };
        match row(&record, label, count) {
            Ok((class, pixels)) => rows.push(Row {
                source: format!("{}:{line}", file.name),
                label: class,
                part: file.part,
                is_emnist: file.is_emnist,
                pixels,
                side,
            }),
            Err(reason) => refused.push(Refused::new(format!("{}:{line}", file.name), reason)),
        }
    }
    match columns {
        Some(_) => Ok(()),
        None => Err(Error::input(format!(
            "{place}: is empty: expected a row for each image"
        ))),
    }
}

/// Counts the lines of a text up to places in it, in ascending order.
struct Lines<'a> {
    text: &'a [u8],
    line: usize,
    place: usize,
}

impl<'a> Lines<'a> {
    fn new(text: &'a [u8]) -> Self {
        Lines {
            text,
            line: 1,
            place: 0,
        }
    }

    /// Returns the line of the first thing from a place on, counted from 1.
    fn line(&mut self, place: u64) -> usize {
        let from = (place as usize).clamp(self.place, self.text.len());
        let is_end = |byte: &&u8| matches!(byte, b'\r' | b'\n');
        let begin = from + self.text[from..].iter().take_while(is_end).count();
        let passed = &self.text[self.place..begin];
        self.line += passed.iter().filter(|byte| **byte == b'\n').count();
        self.place = begin;
        self.line
    }
}

/// Returns the side of squares with a label in so many columns.
fn side(columns: usize) -> Option<usize> {
    let side = columns.checked_sub(1)?.isqrt();
    (side > 1 && side * side + 1 == columns).then_some(side)
}

fn wrong_columns(found: usize) -> String {
    let text = format!(
        "expected a label and the pixels of a square in each row, such as 1 + 28 × 28 = 785 columns, found {found}"
    );
    match found > 1 && found.isqrt() * found.isqrt() == found {
        true => format!("{text}; are the labels missing?"),
        false => text,
    }
}

/// Returns the column that a header calls the label.
fn label_column(header: &csv::ByteRecord) -> Option<usize> {
    header.iter().position(|name| {
        let name = String::from_utf8_lossy(name).to_lowercase();
        LABELS.contains(&name.as_str())
    })
}

fn is_header(record: &csv::ByteRecord, label: usize) -> bool {
    let is_word = |field: &[u8]| !field.is_empty() && number(field).is_none();
    let mut pixels = record
        .iter()
        .enumerate()
        .filter(|(column, _)| *column != label);
    // One slip in the first row makes no header of it.
    pixels.clone().count() > 0 && pixels.all(|(_, field)| is_word(field))
}

/// Returns true for a row that numbers the columns, but for the one called the label, as pandas does
/// with columns without names. Hardly an image has such pixels and such a label.
fn counts_up(record: &csv::ByteRecord, named: Option<usize>) -> bool {
    let columns = record
        .iter()
        .enumerate()
        .filter(|(column, _)| Some(*column) != named);
    let numbers: Option<Vec<usize>> = columns
        .map(|(_, field)| std::str::from_utf8(field).ok()?.parse().ok())
        .collect();
    numbers.is_some_and(|numbers| {
        (named.is_some() || numbers[0] == 0)
            && numbers
                .windows(2)
                .all(|pair| pair[1].checked_sub(pair[0]) == Some(1))
    })
}

fn number(field: &[u8]) -> Option<f32> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// Class and pixels of a row.
type Parsed = (Label, Result<Vec<u8>, Vec<f32>>);

fn row(record: &csv::ByteRecord, label: usize, count: usize) -> Result<Parsed, String> {
    if record.len() != count {
        return Err(format!("has {} columns: expected {count}", record.len()));
    }
    let pixels = || {
        record
            .iter()
            .enumerate()
            .filter(|(column, _)| *column != label)
    };
    let small = |field: &[u8]| -> Option<u8> { std::str::from_utf8(field).ok()?.parse().ok() };
    let bytes: Option<Vec<u8>> = pixels().map(|(_, field)| small(field)).collect();
    let pixels = match bytes {
        Some(bytes) => Ok(bytes),
        None => {
            let real = |(column, field): (usize, &[u8])| {
                number(field)
                    .filter(|value| (0.0..=255.0).contains(value))
                    .ok_or_else(|| {
                        let found = String::from_utf8_lossy(field);
                        format!(
                            "has {found:?} in column {}: expected a pixel from 0 to 255",
                            column + 1
                        )
                    })
            };
            Err(pixels().map(real).collect::<Result<Vec<f32>, String>>()?)
        }
    };
    let text = String::from_utf8_lossy(&record[label]).into_owned();
    let whole =
        |number: f64| (number.fract() == 0.0 && number.abs() < 1e15).then_some(number as i64);
    let class = match text.parse::<f64>().ok().and_then(whole) {
        _ if text.is_empty() => return Err("has no label".to_string()),
        Some(number) => Label::Number(number),
        None => Label::Name(text),
    };
    Ok((class, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Result<Found, Error> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, text).unwrap();
        let name = "a.csv".to_string();
        read(&[TableFile {
            path,
            name,
            part: None,
            is_emnist: false,
        }])
    }

    fn first(text: &str) -> (Label, Vec<u8>, String) {
        let item = found(text).unwrap().items.remove(0);
        match item.picture {
            Picture::Grey(grey) => (item.label, grey.pixels, item.source),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_label_is_first_or_where_the_header_says() {
        let expected = (Label::Number(7), vec![0, 1, 2, 255]);
        for (text, line) in [
            ("7,0,1,2,255\n", 1),
            ("label,1x1,1x2,2x1,2x2\r\n7, 0,1,2,255\r\n", 2),
            ("pixel0,pixel1,pixel2,pixel3,Label\n0,1,2,255,7\n", 2),
            ("\u{feff}7;0;1;2;255\n", 1),
            ("7.0\t0\t1.0\t2\t255\n", 1),
            // As pandas numbers columns, with and without a name for the label.
            ("0,1,2,3,label\n0,1,2,255,7\n", 2),
            ("0,1,2,3,4\n7,0,1,2,255\n", 2),
        ] {
            let (label, pixels, source) = first(text);
            assert_eq!((label, pixels), expected, "{text}");
            assert_eq!(source, format!("a.csv:{line}"));
        }
        assert_eq!(first("cat,0,0.5,1,0\n").0, Label::Name("cat".into()));
        assert_eq!(first("cat,0,0.5,1,0\n").1, [0, 128, 255, 0]);
    }

    #[test]
    fn a_wrong_row_is_left_out_and_named_and_a_wrong_table_is_refused() {
        let found = found("1,0,1,2,3\n2,0,1,2\n3,0,x,2,3\n4,0,1,2,300\n,0,1,2,9\n5,0,1,2,-1\n");
        let found = found.unwrap();
        assert_eq!(found.items.len(), 1);
        let said: Vec<String> = found
            .refused
            .iter()
            .map(|r| format!("{} {}", r.source, r.reason))
            .collect();
        let said = said.join("\n");
        for part in [
            "a.csv:2 has 4 columns: expected 5",
            "a.csv:3 has \"x\" in column 3",
            "\"300\"",
            "no label",
            "\"-1\"",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
        let error = |text: &str| self::found(text).unwrap_err().to_string();
        assert!(error("1,2,3\n").contains("found 3"), "{}", error("1,2,3\n"));
        assert!(error("1,2,3,4\n").contains("are the labels missing?"));
        assert!(error("").contains("is empty"));
    }
}
