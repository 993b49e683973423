//! Contract of the IDX reader on broken files; `tests/idx_reader.rs` compares it with another reader.

use super::*;
use flate2::{Compression, write::GzEncoder};
use std::io::Write;

fn zip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn stored(bytes: &[u8]) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(bytes).unwrap();
    file
}

fn images(sizes: [u32; 3], pixels: &[u8]) -> Vec<u8> {
    [header(&sizes).as_slice(), pixels].concat()
}

fn error(bytes: &[u8]) -> IdxError {
    let file = stored(bytes);
    let error = read_images(file.path()).unwrap_err();
    assert!(error.to_string().contains(file.path().to_str().unwrap()), "{error}");
    let zipped = stored(&zip(bytes));
    let same = read_images(zipped.path()).unwrap_err();
    assert_eq!(std::mem::discriminant(&error), std::mem::discriminant(&same), "{error} / {same}");
    error
}

#[test]
fn raw_and_gzipped_files_are_told_apart_by_content() {
    let bytes = images([2, 1, 3], &[1, 2, 3, 4, 5, 6]);
    for file in [stored(&bytes), stored(&zip(&bytes))] {
        let read = read_images(file.path()).unwrap();
        let expected = IdxImages { count: 2, height: 1, width: 3, pixels: vec![1, 2, 3, 4, 5, 6] };
        assert_eq!(read.content, expected);
        let on_disk = std::fs::read(file.path()).unwrap();
        assert_eq!((read.bytes, read.sha256), (on_disk.len() as u64, sha256_hex(&on_disk)));
    }
    let labels = stored(&[header(&[3]).as_slice(), &[9, 0, 255]].concat());
    assert_eq!(read_labels(labels.path()).unwrap().content, [9, 0, 255]);
}

#[test]
fn a_file_must_hold_exactly_what_its_header_announces() {
    let short = error(&images([2, 2, 2], &[0; 7]));
    assert!(matches!(short, IdxError::Short { expected: 8, found: 7, .. }), "{short}");
    let long = error(&images([2, 2, 2], &[0; 9]));
    assert!(matches!(long, IdxError::Long { expected: 8, .. }), "{long}");
    let header_only = error(&header(&[2, 2, 2])[..13]);
    assert!(matches!(header_only, IdxError::Header { expected: 16, found: 13, .. }), "{header_only}");
    let three_bytes = error(&[0, 0, 8]);
    assert!(matches!(three_bytes, IdxError::Header { expected: 16, found: 3, .. }), "{three_bytes}");
}

#[test]
fn wrong_magic_numbers_and_dimension_counts_say_what_was_expected() {
    let html = error(b"<!DOCTYPE html>");
    assert!(html.to_string().contains("expected 00 00 08 03"), "{html}");
    assert!(html.to_string().contains("found 3c 21 44 4f"), "{html}");
    let floats = error(&[0, 0, 0x0d, 3, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0]);
    assert!(matches!(floats, IdxError::Magic { .. }), "{floats}");
    let labels = error(&[header(&[1]).as_slice(), &[7]].concat());
    assert!(matches!(labels, IdxError::Dimensions { expected: 3, found: 1, .. }), "{labels}");
}

#[test]
fn zero_and_absurd_sizes_are_refused_without_allocating_them() {
    let empty = error(&images([0, 28, 28], &[]));
    assert!(matches!(empty, IdxError::Zero { .. }), "{empty}");
    let absurd = error(&images([u32::MAX, u32::MAX, u32::MAX], &[]));
    assert!(matches!(absurd, IdxError::Absurd { .. }), "{absurd}");
    // 1 GB announced, none there: within the limit, so only the reading finds out.
    let lie = error(&images([1 << 20, 32, 32], &[0; 10]));
    assert!(matches!(lie, IdxError::Short { found: 10, .. }), "{lie}");
}

#[test]
fn missing_files_and_broken_gzip_streams_name_the_file() {
    let missing = read_images(Path::new("no/such/train-images-idx3-ubyte")).unwrap_err();
    assert!(missing.is_io() && missing.to_string().contains("no/such/train-images-idx3-ubyte"));
    let whole = zip(&images([1, 2, 2], &[1, 2, 3, 4]));
    let cut = stored(&whole[..whole.len() - 6]);
    assert!(matches!(read_images(cut.path()).unwrap_err(), IdxError::Gzip { .. }));
    let appended = stored(&[whole.as_slice(), b"rest"].concat());
    assert!(matches!(read_images(appended.path()).unwrap_err(), IdxError::Gzip { .. }));
}
