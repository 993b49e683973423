//! NumPy's files: an array (`.npy`), and several in a ZIP archive (`.npz`).
//!
//! The format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>

use crate::base::error::Error;
use crate::data::import::arrays::{Array, Values};
use crate::data::import::item::{self, MOST_BYTES};
use std::io::{Cursor, Read};
use std::path::Path;

/// The beginning of an array's file.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest header \[bytes\].
const MOST_HEADER: usize = 1 << 16;

/// The type of an array's values, as its header says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Type {
    /// NumPy's letter of the kind.
    kind: char,
    /// Bytes of one value, or characters of a text.
    size: usize,
    is_big: bool,
}

/// Reads a `.npy` file.
pub(crate) fn read_npy(path: &Path, name: &str) -> Result<Array, Error> {
    let place = path.display();
    let bytes = item::read(path).map_err(|reason| Error::input(format!("{place}: {reason}")))?;
    array(name, &mut bytes.as_slice()).map_err(|reason| Error::input(format!("{place}: {reason}")))
}

/// Reads all arrays of an `.npz` file but those of Python objects, sorted by name.
pub(crate) fn read_npz(path: &Path, name: &str) -> Result<Vec<Array>, Error> {
    let failed = |reason: String| Error::input(format!("{}: {reason}", path.display()));
    let bytes = item::read(path).map_err(failed)?;
    let broken = |error: &dyn std::fmt::Display| failed(format!("is no whole .npz file: {error}"));
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken(&error))?;
    let keys: Result<Vec<String>, _> = archive
        .file_names()
        .map(|key| key.map(std::borrow::Cow::into_owned))
        .collect();
    let mut keys = keys.map_err(|error| broken(&error))?;
    keys.sort();
    let mut arrays = Vec::new();
    let mut objects = Vec::new();
    for file in &keys {
        let Some(key) = file.strip_suffix(".npy") else {
            continue;
        };
        let mut entry = archive.by_name(file).map_err(|error| broken(&error))?;
        match array(&format!("{name}:{key}"), &mut entry) {
            Ok(array) => arrays.push(array),
            // Often only the names of something.
            Err(reason) if reason.contains(OBJECTS) => objects.push(key.to_string()),
            Err(reason) => return Err(failed(format!("{key}: {reason}"))),
        }
    }
    match (arrays.is_empty(), objects.first()) {
        (false, _) => Ok(arrays),
        (true, Some(key)) => Err(failed(format!("{key}: {OBJECTS}"))),
        (true, None) => Err(failed("has no arrays (.npy) in it".to_string())
            .advice("unpack it if it holds pictures")),
    }
}

const OBJECTS: &str =
    "holds Python objects: expected an array of numbers, or of texts of one length";

/// Reads an array; the error is a reason.
fn array(name: &str, source: &mut impl Read) -> Result<Array, String> {
    let failed = |error: std::io::Error| format!("cannot be unpacked: {error}");
    let mut take = |count: u64| -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        let read = source
            .by_ref()
            .take(count)
            .read_to_end(&mut bytes)
            .map_err(failed)?;
        match read as u64 == count {
            true => Ok(bytes),
            false => Err(format!(
                "is cut off: {count} more bytes were expected, found {read}"
            )),
        }
    };
    let begin = take(8)?;
    if !begin.starts_with(MAGIC) {
        return Err("is no NumPy array: it begins otherwise".to_string());
    }
    let length = match begin[6] {
        1 => take(2)?,
        _ => take(4)?,
    };
    let length = length
        .iter()
        .rev()
        .fold(0, |all, byte| all << 8 | usize::from(*byte));
    if length > MOST_HEADER {
        return Err("is no NumPy array: its header has no end".to_string());
    }
    let header = take(length as u64)?;
    let (kind, is_fortran, shape) = header_of(&String::from_utf8_lossy(&header))?;
    let each = match kind.kind {
        'U' => kind.size.checked_mul(4),
        _ => Some(kind.size),
    };
    let count = shape
        .iter()
        .try_fold(1_usize, |all, &size| all.checked_mul(size));
    let bytes = each
        .zip(count)
        .and_then(|(each, count)| each.checked_mul(count));
    // A text has an address and two lengths in memory, however short it is.
    let of_texts = if "US".contains(kind.kind) { 24 } else { 0 };
    let fits = |bytes: &usize| {
        let texts = count.unwrap_or(0).saturating_mul(of_texts);
        bytes.saturating_add(texts) as u64 <= MOST_BYTES
    };
    let (Some(bytes), Some(count)) = (bytes.filter(fits), count) else {
        return Err(format!("has a shape of {shape:?}, more than 2 GB"));
    };
    // Texts of length 0 take no bytes however many there are.
    if bytes == 0 {
        return Ok(Array {
            name: name.to_string(),
            shape: vec![0],
            values: Values::Bytes(Vec::new()),
        });
    }
    let raw = take(bytes as u64)?;
    let values = values(&raw, kind)?;
    let values = match is_fortran && shape.len() > 1 {
        true => values.picked((0..count).map(|index| fortran(index, &shape))),
        false => values,
    };
    Ok(Array {
        name: name.to_string(),
        shape,
        values,
    })
}

/// Returns the place in column-major order of a row-major index.
fn fortran(mut index: usize, shape: &[usize]) -> usize {
    let mut place = 0;
    let mut stride: usize = shape.iter().product();
    for &size in shape.iter().rev() {
        stride /= size;
        place += index % size * stride;
        index /= size;
    }
    place
}

/// Parses the header, which is a Python dict.
fn header_of(text: &str) -> Result<(Type, bool, Vec<usize>), String> {
    let unclear = || format!("has a header that is not understood: {}", text.trim());
    let after = |key: &str| {
        let place = ["'", "\""].iter().find_map(|mark| {
            let key = format!("{mark}{key}{mark}");
            text.find(&key).map(|place| place + key.len())
        });
        let rest = text[place?..].trim_start().strip_prefix(':')?;
        Some(rest.trim_start())
    };
    let descr = after("descr").ok_or_else(unclear)?;
    if descr.starts_with('[') {
        return Err("has records: expected an array of plain numbers".to_string());
    }
    let mark = descr
        .chars()
        .next()
        .filter(|c| matches!(c, '\'' | '"'))
        .ok_or_else(unclear)?;
    let kind = descr[1..].split(mark).next().ok_or_else(unclear)?;
    let is_fortran = after("fortran_order")
        .ok_or_else(unclear)?
        .starts_with("True");
    let shape = after("shape")
        .and_then(|rest| rest.strip_prefix('('))
        .ok_or_else(unclear)?;
    let shape = shape.split(')').next().ok_or_else(unclear)?;
    let sizes = shape
        .split(',')
        .map(|size| size.trim().trim_end_matches('L'));
    let sizes: Result<Vec<usize>, _> = sizes
        .filter(|size| !size.is_empty())
        .map(str::parse)
        .collect();
    Ok((type_of(kind)?, is_fortran, sizes.map_err(|_| unclear())?))
}

fn type_of(text: &str) -> Result<Type, String> {
    let is_big = text.starts_with('>') || text.starts_with('=') && cfg!(target_endian = "big");
    let plain = text.trim_start_matches(['<', '>', '|', '=']);
    let kind = plain.chars().next().unwrap_or(' ');
    let size = plain
        .get(kind.len_utf8()..)
        .and_then(|size| size.parse().ok());
    match (kind, size) {
        ('O', _) => Err(OBJECTS.to_string()),
        ('b', Some(size @ 1)) | ('u' | 'i', Some(size @ (1 | 2 | 4 | 8))) => {
            Ok(Type { kind, size, is_big })
        }
        ('f', Some(size @ (4 | 8))) => Ok(Type { kind, size, is_big }),
        ('U' | 'S', Some(size)) => Ok(Type { kind, size, is_big }),
        _ => Err(format!(
            "has values of type {text}: expected bool, whole numbers, float32, float64 or texts"
        )),
    }
}

/// Converts the bytes of values, of which there are whole ones only.
fn values(raw: &[u8], Type { kind, size, is_big }: Type) -> Result<Values, String> {
    let unsigned = |bytes: &[u8]| -> u64 {
        let join = |all: u64, byte: &u8| all << 8 | u64::from(*byte);
        match is_big {
            true => bytes.iter().fold(0, join),
            false => bytes.iter().rev().fold(0, join),
        }
    };
    let each = || raw.chunks_exact(size);
    Ok(match (kind, size) {
        ('b', _) => Values::Bools(raw.iter().map(|byte| u8::from(*byte != 0)).collect()),
        ('u', 1) => Values::Bytes(raw.to_vec()),
        ('u', 8) => {
            let whole: Option<Vec<i64>> = each()
                .map(|bytes| unsigned(bytes).try_into().ok())
                .collect();
            Values::Whole(whole.ok_or("has numbers of more than 18 digits")?)
        }
        ('u', _) => Values::Whole(each().map(|bytes| unsigned(bytes).cast_signed()).collect()),
        ('i', _) => {
            let unused = 64 - 8 * size as u32;
            let signed = |bytes: &[u8]| (unsigned(bytes) << unused).cast_signed() >> unused;
            Values::Whole(each().map(signed).collect())
        }
        ('f', 4) => {
            let real = |bytes: &[u8]| f64::from(f32::from_bits(unsigned(bytes) as u32));
            Values::Real(each().map(real).collect())
        }
        ('f', _) => Values::Real(
            each()
                .map(|bytes| f64::from_bits(unsigned(bytes)))
                .collect(),
        ),
        ('U', _) => {
            let text = |bytes: &[u8]| -> String {
                let codes = bytes.chunks_exact(4).map(|bytes| unsigned(bytes) as u32);
                let characters = codes.take_while(|code| *code != 0);
                characters
                    .map(|code| char::from_u32(code).unwrap_or('\u{fffd}'))
                    .collect()
            };
            Values::Texts(raw.chunks_exact(4 * size).map(text).collect())
        }
        _ => {
            let text = |bytes: &[u8]| {
                let text = String::from_utf8_lossy(bytes).into_owned();
                text.trim_end_matches('\0').to_string()
            };
            Values::Texts(each().map(text).collect())
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes an array as NumPy does.
    fn npy(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header =
            format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [MAGIC, &[1, 0], &length, header.as_bytes(), data].concat()
    }

    fn read(bytes: &[u8]) -> Result<Array, String> {
        array("x", &mut &bytes[..])
    }

    #[test]
    fn every_type_and_either_byte_order_is_read() {
        let real = |value: f64| value.to_be_bytes().to_vec();
        let cases = [
            ("|u1", vec![1, 255], Values::Bytes(vec![1, 255])),
            ("|b1", vec![0, 1], Values::Bools(vec![0, 1])),
            ("|i1", vec![255, 2], Values::Whole(vec![-1, 2])),
            ("<u2", vec![1, 0, 0, 1], Values::Whole(vec![1, 256])),
            (">u2", vec![1, 0, 0, 1], Values::Whole(vec![256, 1])),
            (
                ">i4",
                vec![255, 255, 255, 254, 0, 0, 0, 7],
                Values::Whole(vec![-2, 7]),
            ),
            (
                "<i8",
                [(-5_i64).to_le_bytes(), 9_i64.to_le_bytes()].concat(),
                Values::Whole(vec![-5, 9]),
            ),
            (
                "<u8",
                [5_u64.to_le_bytes(), 9_u64.to_le_bytes()].concat(),
                Values::Whole(vec![5, 9]),
            ),
            (
                "<f4",
                [0.5_f32.to_le_bytes(), 1_f32.to_le_bytes()].concat(),
                Values::Real(vec![0.5, 1.0]),
            ),
            (
                ">f8",
                [real(0.25), real(-3.0)].concat(),
                Values::Real(vec![0.25, -3.0]),
            ),
            (
                "|S3",
                b"catax\0".to_vec(),
                Values::Texts(vec!["cat".into(), "ax".into()]),
            ),
            (
                "<U1",
                [u32::from('ä').to_le_bytes(), [0; 4]].concat(),
                Values::Texts(vec!["ä".into(), String::new()]),
            ),
        ];
        for (descr, data, expected) in cases {
            let found = read(&npy(descr, "False", "(2,)", &data)).unwrap();
            assert_eq!((found.values, found.shape), (expected, vec![2]), "{descr}");
        }
    }

    #[test]
    fn columns_first_is_turned_to_rows_first() {
        // [[0, 1, 2], [3, 4, 5]]
        let found = read(&npy("|u1", "True", "(2, 3)", &[0, 3, 1, 4, 2, 5])).unwrap();
        assert_eq!(found.values, Values::Bytes(vec![0, 1, 2, 3, 4, 5]));
    }

    #[test]
    fn what_is_no_array_is_refused_with_the_reason() {
        let good = npy("<i4", "False", "(2,)", &[0; 8]);
        for (bytes, said) in [
            (good[..good.len() - 1].to_vec(), "cut off"),
            (b"\x93NUMPX\x01\x00".to_vec(), "begins otherwise"),
            (npy("|O", "False", "(2,)", &[0; 16]), "Python objects"),
            (npy("<c16", "False", "(2,)", &[0; 32]), "type <c16"),
            (
                npy("<i4", "False", "(99999999999, 99999999999)", &[]),
                "more than 2 GB",
            ),
            (npy("<i4", "False", "(x,)", &[]), "not understood"),
        ] {
            let error = read(&bytes).unwrap_err();
            assert!(error.contains(said), "{said}: {error}");
        }
    }

    #[test]
    fn texts_are_limited_by_what_they_take_in_memory() {
        let many = npy("|S1", "False", "(400000000,)", b"");
        let error = read(&many).unwrap_err();
        assert!(error.contains("more than 2 GB"), "{error}");
    }

    #[test]
    fn any_beginning_of_an_array_is_an_error_and_no_panic() {
        let good = npy("<f8", "True", "(2, 1, 1)", &[0; 16]);
        for end in 0..good.len() {
            assert!(read(&good[..end]).is_err());
        }
    }
}
