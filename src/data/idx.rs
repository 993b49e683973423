//! The IDX format (<http://yann.lecun.com/exdb/mnist/>)of MNIST and its look-alikes.
//!
//! A file is a magic number (two zero bytes, the type of the numbers, the number of dimensions),
//! the length of every dimension as a big-endian 32-bit number, and the numbers in row-major order.
//! Here the numbers are unsigned bytes; images have three dimensions (count, rows, columns), labels
//! one. The file must hold exactly the counts and sizes that its header announces.

use crate::base::Grid;
use crate::base::files::open_file;
use crate::base::hash::sha256_hex;
use flate2::read::MultiGzDecoder;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Most bytes of one file, stored or unpacked: a larger one is no set of images. (EMNIST: 0.6 GB.)
pub(crate) const MAX_BYTES: u64 = 1 << 30;

/// Type code of unsigned bytes in a magic number.
const UNSIGNED_BYTE: u8 = 0x08;

/// Images of one IDX3 file, all of the same size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct IdxImages {
    /// Number of images, at least 1.
    pub(crate) count: usize,
    /// Rows per image, at least 1.
    pub(crate) height: usize,
    /// Columns per image, at least 1.
    pub(crate) width: usize,
    /// All count × height × width pixels (0 … 255), image after image, row-major from the top left.
    pub(crate) pixels: Vec<u8>,
}

impl IdxImages {
    pub(crate) fn image(&self, index: usize) -> Option<Grid<u8>> {
        let first = index.checked_mul(self.height)?;
        let rows = self.pixels.chunks(self.width).skip(first).take(self.height);
        Grid::from_rows(rows.map(<[u8]>::to_vec).collect()).ok()
    }

    #[must_use]
    pub(crate) fn transposed(mut self) -> Self {
        let (height, width) = (self.height, self.width);
        let mut image = Vec::with_capacity(height.saturating_mul(width).min(self.pixels.len()));
        for pixels in self.pixels.chunks_exact_mut(height * width) {
            image.clear();
            image.extend(
                (0..width)
                    .flat_map(|c| (0..height).map(move |r| r * width + c))
                    .map(|i| pixels[i]),
            );
            pixels.copy_from_slice(&image);
        }
        IdxImages {
            height: width,
            width: height,
            ..self
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct IdxFile<T> {
    pub(crate) content: T,
    /// Size of the stored file (compressed, if it is), bytes.
    pub(crate) bytes: u64,
    /// SHA-256 of the stored file, in hexadecimal.
    pub(crate) sha256: String,
}

/// The reason why a file is not the expected IDX file. Every message names the file.
#[derive(Debug, thiserror::Error)]
pub enum IdxError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The gzip stream is broken.
    #[error("{}: starts like a gzip file but cannot be unpacked: {source}", file.display())]
    Gzip {
        /// The file.
        file: PathBuf,
        /// The unpacker's error.
        source: io::Error,
    },
    /// The file ends within its header.
    #[error(
        "{}: too short: an IDX header of {expected} bytes was expected, the file ends after {found}",
        file.display()
    )]
    Header {
        /// The file.
        file: PathBuf,
        /// Length of the header, bytes.
        expected: usize,
        /// Number of bytes found.
        found: usize,
    },
    /// The first four bytes are not those of an IDX file of unsigned bytes.
    #[error(
        "{}: wrong magic number: expected 00 00 08 {dimensions:02x} (IDX, unsigned bytes, {dimensions} \
         dimension(s): {what}), found {:02x} {:02x} {:02x} {:02x}",
        file.display(), found[0], found[1], found[2], found[3]
    )]
    Magic {
        /// The file.
        file: PathBuf,
        /// Number of dimensions expected.
        dimensions: u8,
        /// Expected content.
        what: &'static str,
        /// The first four bytes (after unpacking).
        found: [u8; 4],
    },
    /// An IDX file of unsigned bytes has another shape (for example labels instead of images).
    #[error(
        "{}: wrong number of dimensions: expected {expected} ({what}), found {found}; \
         are the image and the label file mixed up?",
        file.display()
    )]
    Dimensions {
        /// The file.
        file: PathBuf,
        /// Number of dimensions expected.
        expected: u8,
        /// Expected content.
        what: &'static str,
        /// Number of dimensions in the magic number.
        found: u8,
    },
    /// A dimension has length 0.
    #[error("{}: the header says {sizes:?} ({axes}): nothing in it; every size must be at least 1", file.display())]
    Zero {
        /// The file.
        file: PathBuf,
        /// Lengths of the dimensions, from the header.
        sizes: Vec<u32>,
        /// Names of the dimensions.
        axes: &'static str,
    },
    /// The header announces more than [`MAX_BYTES`]; nothing of that size was allocated.
    #[error(
        "{}: the header says {sizes:?} ({axes}), which is more than the {MAX_BYTES} bytes accepted; \
         the header is broken or this is not a set of images",
        file.display()
    )]
    Absurd {
        /// The file.
        file: PathBuf,
        /// Lengths of the dimensions, from the header.
        sizes: Vec<u32>,
        /// Names of the dimensions.
        axes: &'static str,
    },
    /// The file itself is larger than [`MAX_BYTES`].
    #[error("{}: has {found} bytes, more than the {MAX_BYTES} accepted; this is not a set of images", file.display())]
    Large {
        /// The file.
        file: PathBuf,
        /// Its size, bytes.
        found: u64,
    },
    /// There are fewer numbers than the header announces.
    #[error(
        "{}: too short: {expected} bytes were expected after the header, found {found}; \
         the file is cut off", file.display()
    )]
    Short {
        /// The file.
        file: PathBuf,
        /// Bytes announced after the header.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
    /// There are more numbers than the header announces.
    #[error(
        "{}: too long: {expected} bytes were expected after the header, found more; \
         the header is wrong or something was appended", file.display()
    )]
    Long {
        /// The file.
        file: PathBuf,
        /// Bytes announced after the header.
        expected: u64,
    },
}

impl IdxError {
    /// Returns true if the file could not be opened or read; false if it has the wrong content.
    pub(crate) fn is_io(&self) -> bool {
        matches!(self, IdxError::Io { .. })
    }
}

/// Reads an IDX3 file of unsigned bytes, raw or gzipped (detected by content, not by name).
pub(crate) fn read_images(file: &Path) -> Result<IdxFile<IdxImages>, IdxError> {
    let stored = read_file(file)?;
    let (sizes, pixels) = decode::<3>(file, &stored, "images", "count, rows, columns")?;
    let [count, height, width] = sizes;
    Ok(with_origin(
        &stored,
        IdxImages {
            count,
            height,
            width,
            pixels,
        },
    ))
}

/// Reads labels, an IDX1 file of unsigned bytes, raw or gzipped (detected by content, not by name).
pub(crate) fn read_labels(file: &Path) -> Result<IdxFile<Vec<u8>>, IdxError> {
    let stored = read_file(file)?;
    let (_, labels) = decode::<1>(file, &stored, "labels", "count")?;
    Ok(with_origin(&stored, labels))
}

/// Returns the header of unsigned bytes with these sizes: magic number and big-endian lengths.
pub(crate) fn header(sizes: &[u32]) -> Vec<u8> {
    let mut bytes = vec![0, 0, UNSIGNED_BYTE, sizes.len() as u8];
    bytes.extend(sizes.iter().flat_map(|size| size.to_be_bytes()));
    bytes
}

fn with_origin<T>(stored: &[u8], content: T) -> IdxFile<T> {
    IdxFile {
        content,
        bytes: stored.len() as u64,
        sha256: sha256_hex(stored),
    }
}

fn read_file(file: &Path) -> Result<Vec<u8>, IdxError> {
    let io = |source| IdxError::Io {
        file: file.to_path_buf(),
        source,
    };
    let found = std::fs::metadata(file).map_err(|error| io(nowhere(file, error)))?;
    // Opening a pipe would wait for a writer.
    if !found.is_file() {
        return Err(io(io::Error::other("it is not a regular file")));
    }
    let mut stored = Vec::new();
    open_file(file)
        .map_err(io)?
        .take(MAX_BYTES + 1)
        .read_to_end(&mut stored)
        .map_err(io)?;
    if stored.len() as u64 > MAX_BYTES {
        return Err(IdxError::Large {
            file: file.to_path_buf(),
            found: found.len(),
        });
    }
    Ok(stored)
}

/// Explains why a file is missing: a link to it may be broken.
fn nowhere(file: &Path, error: io::Error) -> io::Error {
    match file.read_link() {
        Ok(to) if error.kind() == io::ErrorKind::NotFound => io::Error::new(
            error.kind(),
            format!("it is a link to {}, which is not there", to.display()),
        ),
        _ => error,
    }
}

/// Returns the content of a file of at most [`MAX_BYTES`], unpacked if it is gzipped.
pub(crate) fn unpacked(file: &Path) -> Result<Vec<u8>, IdxError> {
    let stored = read_file(file)?;
    let mut content = Vec::new();
    let read = reader(&stored)
        .take(MAX_BYTES + 1)
        .read_to_end(&mut content);
    let found = read.map_err(|error| unpacking(file, error))? as u64;
    match found > MAX_BYTES {
        true => Err(IdxError::Large {
            file: file.to_path_buf(),
            found,
        }),
        false => Ok(content),
    }
}

fn unpacking(file: &Path, source: io::Error) -> IdxError {
    let file = file.to_path_buf();
    match source.kind() {
        io::ErrorKind::OutOfMemory => IdxError::Io { file, source },
        _ => IdxError::Gzip { file, source },
    }
}

fn reader(stored: &[u8]) -> Box<dyn Read + '_> {
    match stored.starts_with(&[0x1f, 0x8b]) {
        true => Box::new(MultiGzDecoder::new(stored)),
        false => Box::new(stored),
    }
}

/// Returns the lengths of the N dimensions and the numbers.
fn decode<const N: usize>(
    file: &Path,
    stored: &[u8],
    what: &'static str,
    axes: &'static str,
) -> Result<([usize; N], Vec<u8>), IdxError> {
    let mut content = reader(stored);
    let file = file.to_path_buf();
    let broken = |error| unpacking(&file, error);

    let mut header = Vec::new();
    content
        .by_ref()
        .take(4)
        .read_to_end(&mut header)
        .map_err(broken)?;
    let length = 4 + 4 * N;
    let Ok(magic) = <[u8; 4]>::try_from(header.as_slice()) else {
        return Err(IdxError::Header {
            file,
            expected: length,
            found: header.len(),
        });
    };
    let dimensions = N as u8;
    match magic {
        [0, 0, UNSIGNED_BYTE, found] if found == dimensions => {}
        [0, 0, UNSIGNED_BYTE, found] => {
            return Err(IdxError::Dimensions {
                file,
                expected: dimensions,
                what,
                found,
            });
        }
        found => {
            return Err(IdxError::Magic {
                file,
                dimensions,
                what,
                found,
            });
        }
    }
    content
        .by_ref()
        .take(4 * N as u64)
        .read_to_end(&mut header)
        .map_err(broken)?;
    if header.len() < length {
        return Err(IdxError::Header {
            file,
            expected: length,
            found: header.len(),
        });
    }
    let sizes: Vec<u32> = header[4..]
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| u32::from_be_bytes(*bytes))
        .collect();
    if sizes.contains(&0) {
        return Err(IdxError::Zero { file, sizes, axes });
    }
    let product = sizes
        .iter()
        .try_fold(1u64, |all, &size| all.checked_mul(u64::from(size)));
    let Some(expected) = product.filter(|&bytes| bytes <= MAX_BYTES) else {
        return Err(IdxError::Absurd { file, sizes, axes });
    };

    // The vector grows with what is really there, so a false header costs nothing.
    let mut numbers = Vec::new();
    content
        .take(expected + 1)
        .read_to_end(&mut numbers)
        .map_err(broken)?;
    let found = numbers.len() as u64;
    if found < expected {
        return Err(IdxError::Short {
            file,
            expected,
            found,
        });
    }
    if found > expected {
        return Err(IdxError::Long { file, expected });
    }
    Ok((std::array::from_fn(|i| sizes[i] as usize), numbers))
}

#[cfg(test)]
mod tests {
    //! Contract of the IDX reader on broken files; `tests/library/idx_reader.rs` compares it to
    //! another.

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
        assert!(
            error.to_string().contains(file.path().to_str().unwrap()),
            "{error}"
        );
        let zipped = stored(&zip(bytes));
        let same = read_images(zipped.path()).unwrap_err();
        assert_eq!(
            std::mem::discriminant(&error),
            std::mem::discriminant(&same),
            "{error} / {same}"
        );
        error
    }

    #[test]
    fn raw_and_gzipped_files_are_told_apart_by_content() {
        let bytes = images([2, 1, 3], &[1, 2, 3, 4, 5, 6]);
        for file in [stored(&bytes), stored(&zip(&bytes))] {
            let read = read_images(file.path()).unwrap();
            let expected = IdxImages {
                count: 2,
                height: 1,
                width: 3,
                pixels: vec![1, 2, 3, 4, 5, 6],
            };
            assert_eq!(read.content, expected);
            let on_disk = std::fs::read(file.path()).unwrap();
            assert_eq!(
                (read.bytes, read.sha256),
                (on_disk.len() as u64, sha256_hex(&on_disk))
            );
        }
        let labels = stored(&[header(&[3]).as_slice(), &[9, 0, 255]].concat());
        assert_eq!(read_labels(labels.path()).unwrap().content, [9, 0, 255]);
    }

    #[test]
    fn a_file_must_hold_exactly_what_its_header_announces() {
        let short = error(&images([2, 2, 2], &[0; 7]));
        assert!(
            matches!(
                short,
                IdxError::Short {
                    expected: 8,
                    found: 7,
                    ..
                }
            ),
            "{short}"
        );
        let long = error(&images([2, 2, 2], &[0; 9]));
        assert!(matches!(long, IdxError::Long { expected: 8, .. }), "{long}");
        let header_only = error(&header(&[2, 2, 2])[..13]);
        assert!(
            matches!(
                header_only,
                IdxError::Header {
                    expected: 16,
                    found: 13,
                    ..
                }
            ),
            "{header_only}"
        );
        let three_bytes = error(&[0, 0, 8]);
        assert!(
            matches!(
                three_bytes,
                IdxError::Header {
                    expected: 16,
                    found: 3,
                    ..
                }
            ),
            "{three_bytes}"
        );
    }

    #[test]
    fn wrong_magic_numbers_and_dimension_counts_say_what_was_expected() {
        let html = error(b"<!DOCTYPE html>");
        assert!(html.to_string().contains("expected 00 00 08 03"), "{html}");
        assert!(html.to_string().contains("found 3c 21 44 4f"), "{html}");
        let floats = error(&[0, 0, 0x0d, 3, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0]);
        assert!(matches!(floats, IdxError::Magic { .. }), "{floats}");
        let labels = error(&[header(&[1]).as_slice(), &[7]].concat());
        assert!(
            matches!(
                labels,
                IdxError::Dimensions {
                    expected: 3,
                    found: 1,
                    ..
                }
            ),
            "{labels}"
        );
    }

    #[test]
    fn zero_and_absurd_sizes_are_refused_without_allocating_them() {
        let empty = error(&images([0, 28, 28], &[]));
        assert!(matches!(empty, IdxError::Zero { .. }), "{empty}");
        let absurd = error(&images([u32::MAX, u32::MAX, u32::MAX], &[]));
        assert!(matches!(absurd, IdxError::Absurd { .. }), "{absurd}");
        // 1 GB announced, none there: within the limit, so only reading detects it.
        let lie = error(&images([1 << 20, 32, 32], &[0; 10]));
        assert!(matches!(lie, IdxError::Short { found: 10, .. }), "{lie}");
    }

    #[test]
    fn transposed_images_have_their_rows_and_columns_exchanged() {
        let pixels: Vec<u8> = (0..12).collect();
        let images = IdxImages {
            count: 2,
            height: 2,
            width: 3,
            pixels,
        };
        let turned = images.clone().transposed();
        assert_eq!((turned.count, turned.height, turned.width), (2, 3, 2));
        for index in 0..2 {
            let (before, after) = (images.image(index).unwrap(), turned.image(index).unwrap());
            assert!(after.iter().all(|((r, c), &pixel)| pixel == before[(c, r)]));
        }
        assert_eq!(turned.transposed(), images);
    }

    #[test]
    #[cfg(unix)]
    fn a_pipe_is_refused_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("train-images-idx3-ubyte");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        let error = read_images(&pipe).unwrap_err();
        assert!(
            error.is_io() && error.to_string().contains("not a regular file"),
            "{error}"
        );
    }

    #[test]
    fn missing_files_and_broken_gzip_streams_name_the_file() {
        let missing = read_images(Path::new("no/such/train-images-idx3-ubyte")).unwrap_err();
        assert!(
            missing.is_io()
                && missing
                    .to_string()
                    .contains("no/such/train-images-idx3-ubyte")
        );
        let whole = zip(&images([1, 2, 2], &[1, 2, 3, 4]));
        let cut = stored(&whole[..whole.len() - 6]);
        assert!(matches!(
            read_images(cut.path()).unwrap_err(),
            IdxError::Gzip { .. }
        ));
        let appended = stored(&[whole.as_slice(), b"rest"].concat());
        assert!(matches!(
            read_images(appended.path()).unwrap_err(),
            IdxError::Gzip { .. }
        ));
    }
}
