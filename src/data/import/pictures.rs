//! Pictures as grey images: PNG, JPEG, GIF, BMP and WebP, told apart by their content.

use crate::data::import::item::Grey;
use std::io::Cursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;

/// Longest side of a picture \[pixels\].
const MOST_SIDE: usize = 16_384;
/// Most pixels of a picture: more than cameras make.
const MOST_PIXELS: usize = 1 << 26;

/// The kinds of pictures, for messages.
pub(crate) const KINDS: &str = "PNG, JPEG, GIF, BMP or WebP";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Png,
    Jpeg,
    Gif,
    Bmp,
    WebP,
}

/// Returns the kind of a picture by the beginning of its file.
pub(crate) fn kind(bytes: &[u8]) -> Option<Kind> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some(Kind::Png),
        [0xff, 0xd8, 0xff, ..] => Some(Kind::Jpeg),
        [b'G', b'I', b'F', b'8', ..] => Some(Kind::Gif),
        [
            b'R',
            b'I',
            b'F',
            b'F',
            _,
            _,
            _,
            _,
            b'W',
            b'E',
            b'B',
            b'P',
            ..,
        ] => Some(Kind::WebP),
        // The four bytes after the size are not used.
        [b'B', b'M', _, _, _, _, 0, 0, 0, 0, ..] => Some(Kind::Bmp),
        _ => None,
    }
}

/// Returns the kind of a picture that is not read.
pub(crate) fn other_kind(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => Some("TIFF"),
        [_, _, _, _, b'f', b't', b'y', b'p', b'a', b'v', b'i', ..] => Some("AVIF"),
        [_, _, _, _, b'f', b't', b'y', b'p', b'h', b'e', b'i', ..]
        | [_, _, _, _, b'f', b't', b'y', b'p', b'm', b'i', b'f', ..] => Some("HEIC"),
        [0xff, 0x0a, ..] | [0, 0, 0, 12, b'J', b'X', b'L', b' ', ..] => Some("JPEG XL"),
        [b'8', b'B', b'P', b'S', ..] => Some("Photoshop"),
        [b'P', b'1'..=b'6', b' ' | b'\n' | b'\r', ..] => Some("PNM"),
        _ if bytes.windows(4).any(|word| word == b"<svg") => Some("SVG"),
        _ => None,
    }
}

/// Returns true if a file's ending says that it is a picture.
pub(crate) fn claims_to_be(name: &str) -> bool {
    const ENDINGS: [&str; 21] = [
        "png", "apng", "jpg", "jpeg", "jpe", "jfif", "gif", "bmp", "dib", "webp", "tif", "tiff",
        "heic", "heif", "avif", "jxl", "svg", "psd", "pgm", "ppm", "pbm",
    ];
    let ending = name.rsplit_once('.').map(|(_, ending)| ending);
    ending.is_some_and(|ending| {
        ENDINGS
            .iter()
            .any(|known| ending.eq_ignore_ascii_case(known))
    })
}

/// Returns a picture as grey; the error is the reason why it is left out.
pub(crate) fn grey(bytes: &[u8]) -> Result<Grey, String> {
    if bytes.is_empty() {
        return Err("is empty".to_string());
    }
    match kind(bytes) {
        Some(Kind::Png) => png(bytes),
        Some(Kind::Jpeg) => jpeg(bytes),
        Some(Kind::Gif) => gif(bytes),
        Some(Kind::Bmp) => bmp(bytes),
        Some(Kind::WebP) => webp(bytes),
        None => Err(match other_kind(bytes) {
            Some(other) => format!("{other} is not read: expected {KINDS}"),
            None => format!("is no picture: expected {KINDS}"),
        }),
    }
}

fn broken(kind: &str, error: &dyn std::fmt::Display) -> String {
    format!("is no whole {kind}: {error}")
}

fn check_size(width: usize, height: usize) -> Result<(), String> {
    let area = width.saturating_mul(height);
    match width.max(height) > MOST_SIDE || area > MOST_PIXELS || area == 0 {
        true => Err(format!(
            "has {width} × {height} pixels: expected sides of 1 to {MOST_SIDE}, and at most 64 million in all"
        )),
        false => Ok(()),
    }
}

fn png(bytes: &[u8]) -> Result<Grey, String> {
    let failed = |error: png::DecodingError| broken("PNG", &error);
    let limits = png::Limits {
        bytes: 8 * MOST_PIXELS,
    };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND);
    let info = decoder.read_header_info().map_err(failed)?;
    check_size(info.width as usize, info.height as usize)?;
    let mut reader = decoder.read_info().map_err(failed)?;
    let size = reader.output_buffer_size();
    let mut pixels = vec![0; size.ok_or_else(|| "is too large".to_string())?];
    let info = reader.next_frame(&mut pixels).map_err(failed)?;
    // Data that are missing at the end are noticed only here.
    reader.finish().map_err(failed)?;
    pixels.truncate(info.buffer_size());
    if info.bit_depth == png::BitDepth::Sixteen {
        pixels = of_sixteen_bits(&pixels);
    }
    let turned = reader
        .info()
        .exif_metadata
        .as_deref()
        .map_or(1, orientation);
    let channels = info.color_type.samples();
    let grey = of_channels(info.width as usize, info.height as usize, channels, &pixels)?;
    Ok(upright(grey, turned))
}

/// Makes bytes of big-endian numbers of 16 bits. Some programs store bytes in them.
fn of_sixteen_bits(pixels: &[u8]) -> Vec<u8> {
    let pairs = pixels.as_chunks::<2>().0;
    let place = usize::from(pairs.iter().all(|pair| pair[0] == 0));
    pairs.iter().map(|pair| pair[place]).collect()
}

fn jpeg(bytes: &[u8]) -> Result<Grey, String> {
    let failed = |error: zune_jpeg::errors::DecodeErrors| broken("JPEG", &error);
    // The decoder takes the last pixels that are missing for grey.
    let scan = bytes.windows(2).rposition(|marker| marker == [0xff, 0xda]);
    let scan = scan.map_or(&[][..], |begin| &bytes[begin..]);
    if !scan.windows(2).any(|marker| marker == [0xff, 0xd9]) {
        return Err(broken("JPEG", &"it is cut off"));
    }
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(MOST_SIDE)
        .set_max_height(MOST_SIDE);
    let mut decoder = zune_jpeg::JpegDecoder::new_with_options(Cursor::new(bytes), options);
    decoder.decode_headers().map_err(failed)?;
    let (width, height) = decoder.dimensions().ok_or("has no size")?;
    check_size(width, height)?;
    // The Y of a JPEG is the grey that is wanted.
    let wanted = match decoder.input_colorspace() {
        Some(ColorSpace::Luma | ColorSpace::YCbCr) => ColorSpace::Luma,
        _ => ColorSpace::RGB,
    };
    decoder.set_options(options.jpeg_set_out_colorspace(wanted));
    let pixels = decoder.decode().map_err(failed)?;
    let turned = decoder.exif().map_or(1, |exif| orientation(exif));
    let channels = decoder
        .output_colorspace()
        .map_or(0, |space| space.num_components());
    let grey = of_channels(width, height, channels, &pixels)?;
    Ok(upright(grey, turned))
}

fn gif(bytes: &[u8]) -> Result<Grey, String> {
    let failed = |error: gif::DecodingError| broken("GIF", &error);
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    options.check_frame_consistency(true);
    options.check_lzw_end_code(false);
    let most = std::num::NonZeroU64::new(4 * MOST_PIXELS as u64).expect("it is not 0");
    options.set_memory_limit(gif::MemoryLimit::Bytes(most));
    let mut decoder = options.read_info(Cursor::new(bytes)).map_err(failed)?;
    let (width, height) = (usize::from(decoder.width()), usize::from(decoder.height()));
    check_size(width, height)?;
    let frame = decoder.read_next_frame().map_err(failed)?;
    let frame = frame.ok_or_else(|| broken("GIF", &"it has no frame"))?;
    let (left, top, wide) = (
        usize::from(frame.left),
        usize::from(frame.top),
        usize::from(frame.width),
    );
    // The first frame may be smaller than the picture.
    let mut pixels = vec![0; 4 * width * height];
    for (row, line) in frame.buffer.chunks_exact((4 * wide).max(1)).enumerate() {
        let count = wide.min(width.saturating_sub(left));
        let to = 4 * ((top + row) * width + left);
        if top + row < height && count > 0 {
            pixels[to..to + 4 * count].copy_from_slice(&line[..4 * count]);
        }
    }
    of_channels(width, height, 4, &pixels)
}

fn bmp(bytes: &[u8]) -> Result<Grey, String> {
    let failed = |error: zune_bmp::BmpDecoderErrors| broken("BMP", &format!("{error:?}"));
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(MOST_SIDE)
        .set_max_height(MOST_SIDE);
    let mut decoder = zune_bmp::BmpDecoder::new_with_options(Cursor::new(bytes), options);
    decoder.decode_headers().map_err(failed)?;
    let (width, height) = decoder.dimensions().ok_or("has no size")?;
    check_size(width, height)?;
    if is_cut_bmp(bytes, width, height) {
        return Err(broken("BMP", &"it is cut off"));
    }
    let space = decoder.colorspace().ok_or("has no colours")?;
    let pixels = decoder.decode().map_err(failed)?;
    of_channels(width, height, space.num_components(), &pixels)
}

/// True if pixels are missing that are not packed; the decoder would take them for black.
fn is_cut_bmp(bytes: &[u8], width: usize, height: usize) -> bool {
    let number = |at: usize, count: usize| {
        let bytes = bytes.get(at..at + count).unwrap_or_default();
        let join = |all: usize, byte: &u8| all << 8 | usize::from(*byte);
        bytes.iter().rev().fold(0, join)
    };
    let (begin, header) = (number(10, 4), number(14, 4));
    let (bits, is_packed) = match header {
        12 => (number(24, 2), false),
        _ => (number(28, 2), matches!(number(30, 4), 1 | 2)),
    };
    let row = (width * bits).div_ceil(32) * 4;
    !is_packed && bytes.len() < begin.saturating_add(row * height)
}

fn webp(bytes: &[u8]) -> Result<Grey, String> {
    let failed = |error: image_webp::DecodingError| broken("WebP", &error);
    let mut decoder = image_webp::WebPDecoder::new(Cursor::new(bytes)).map_err(failed)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    decoder.set_memory_limit(8 * MOST_PIXELS);
    let channels = if decoder.has_alpha() { 4 } else { 3 };
    let mut pixels = vec![0; channels * width * height];
    decoder.read_image(&mut pixels).map_err(failed)?;
    let exif = decoder.exif_metadata().ok().flatten();
    let grey = of_channels(width, height, channels, &pixels)?;
    Ok(upright(grey, exif.as_deref().map_or(1, orientation)))
}

/// Makes grey of 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA) bytes per pixel.
pub(crate) fn of_channels(
    width: usize,
    height: usize,
    channels: usize,
    bytes: &[u8],
) -> Result<Grey, String> {
    if !(1..=4).contains(&channels) || bytes.len() != width * height * channels {
        return Err("has other pixels than its header says".to_string());
    }
    let luma = |pixel: &[u8]| match pixel {
        [red, green, blue, ..] => luma([*red, *green, *blue]),
        [grey, ..] => *grey,
        [] => 0,
    };
    let mut pixels: Vec<u8> = bytes.chunks_exact(channels).map(luma).collect();
    let mut is_cut_out = false;
    if channels.is_multiple_of(2) {
        let alphas = || bytes.iter().skip(channels - 1).step_by(channels).copied();
        is_cut_out = alphas().any(|alpha| alpha < 255);
        let weight: u64 = alphas().map(u64::from).sum();
        let both = alphas().zip(&pixels);
        let sum: u64 = both
            .map(|(alpha, grey)| u64::from(alpha) * u64::from(*grey))
            .sum();
        // Dark things are inverted: what is not there is dark.
        let is_bright = 2 * sum >= 255 * weight;
        if is_cut_out {
            for (grey, alpha) in pixels.iter_mut().zip(alphas()) {
                let ink = if is_bright { *grey } else { 255 - *grey };
                *grey = ((u32::from(ink) * u32::from(alpha) + 127) / 255) as u8;
            }
        }
    }
    Ok(Grey {
        is_cut_out,
        ..Grey::new(height, width, pixels)
    })
}

/// Returns the luma of Rec. 601.
fn luma([red, green, blue]: [u8; 3]) -> u8 {
    let [red, green, blue] = [red, green, blue].map(u32::from);
    ((299 * red + 587 * green + 114 * blue + 500) / 1000) as u8
}

/// Returns the orientation, 1 to 8, that a camera has noted in EXIF data; 1 is upright.
fn orientation(exif: &[u8]) -> u8 {
    let tiff = exif.strip_prefix(b"Exif\0\0").unwrap_or(exif);
    let is_little = tiff.starts_with(b"II");
    let number = |at: usize, count: usize| -> Option<usize> {
        let bytes = tiff.get(at..at.checked_add(count)?)?;
        let join = |all: usize, byte: &u8| all << 8 | usize::from(*byte);
        Some(match is_little {
            true => bytes.iter().rev().fold(0, join),
            false => bytes.iter().fold(0, join),
        })
    };
    let found = || {
        let entries = number(4, 4)?;
        let count = number(entries, 2)?;
        let mut places = (0..count).map(|entry| entries + 2 + 12 * entry);
        let place = places.find(|&place| number(place, 2) == Some(0x112))?;
        number(place + 8, 2)
    };
    found()
        .filter(|turned| (1..=8).contains(turned))
        .map_or(1, |turned| turned as u8)
}

/// Turns a picture as its orientation says.
fn upright(grey: Grey, orientation: u8) -> Grey {
    let (height, width) = (grey.height, grey.width);
    let (down, right) = (height - 1, width - 1);
    match orientation {
        2 => grey.rearranged(height, width, |row, column| (row, right - column)),
        3 => grey.rearranged(height, width, |row, column| (down - row, right - column)),
        4 => grey.rearranged(height, width, |row, column| (down - row, column)),
        5 => grey.transposed(),
        6 => grey.rearranged(width, height, |row, column| (down - column, row)),
        7 => grey.rearranged(width, height, |row, column| (down - column, right - row)),
        8 => grey.rearranged(width, height, |row, column| (column, right - row)),
        _ => grey,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// An 8 × 8 JPEG: a dark square of 4 × 4 pixels on a bright ground.
    const JPEG: &str = "ffd8ffe000104a46494600010100000100010000ffdb004300100b0c0e0c0a100e0d0e1211101318\
                        281a181616183123251d283a333d3c3933383740485c4e404457453738506d51575f626768673e4d\
                        71797064785c656763ffc0000b080008000801011100ffc400140001000000000000000000000000\
                        00000005ffc4001d1000000505000000000000000000000000001116263253658392f0ffda000801\
                        0100003f007dc0acb2e3a7b4b887ffd9";

    pub(crate) fn jpeg_bytes() -> Vec<u8> {
        let pairs = JPEG.as_bytes().as_chunks::<2>().0.iter();
        let byte = |pair: &[u8; 2]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16);
        pairs.map(|pair| byte(pair).unwrap()).collect()
    }

    pub(crate) fn png_bytes(
        width: u32,
        height: u32,
        colour: png::ColorType,
        depth: png::BitDepth,
        pixels: &[u8],
    ) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(pixels).unwrap();
        writer.finish().unwrap();
        bytes
    }

    pub(crate) fn gif_bytes(width: u16, height: u16, frame: gif::Frame) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = gif::Encoder::new(&mut bytes, width, height, &[]).unwrap();
        encoder.write_frame(&frame).unwrap();
        drop(encoder);
        bytes
    }

    fn grey_palette() -> Vec<u8> {
        (0..=255).flat_map(|grey| [grey; 3]).collect()
    }

    /// Returns a BMP of 24 bits, rows from the bottom, all of one grey per row.
    pub(crate) fn bmp_bytes(rows: &[u8]) -> Vec<u8> {
        let side = rows.len() as u32;
        let row = (side * 3).div_ceil(4) * 4;
        let mut bytes = b"BM".to_vec();
        let numbers = [54 + row * side, 0, 54, 40, side, side, 1 | 24 << 16, 0];
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes.resize(54, 0);
        let line = |grey: &u8| {
            [
                vec![*grey; side as usize * 3],
                vec![0; (row - side * 3) as usize],
            ]
            .concat()
        };
        bytes.extend(rows.iter().rev().flat_map(line));
        bytes
    }

    pub(crate) fn webp_bytes(width: u32, height: u32, rgba: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let encoder = image_webp::WebPEncoder::new(&mut bytes);
        encoder
            .encode(rgba, width, height, image_webp::ColorType::Rgba8)
            .unwrap();
        bytes
    }

    /// Returns one good picture of every kind.
    pub(crate) fn all() -> Vec<Vec<u8>> {
        let rgba: Vec<u8> = (0..6 * 5 * 4).map(|i| (i * 37 % 256) as u8).collect();
        let frame = gif::Frame::from_palette_pixels(6, 5, &rgba[..30], grey_palette(), None);
        vec![
            png_bytes(6, 5, png::ColorType::Rgba, png::BitDepth::Eight, &rgba),
            png_bytes(
                6,
                5,
                png::ColorType::Grayscale,
                png::BitDepth::Sixteen,
                &rgba[..60],
            ),
            jpeg_bytes(),
            gif_bytes(7, 7, frame),
            bmp_bytes(&[0, 50, 100, 150, 255]),
            webp_bytes(6, 5, &rgba),
        ]
    }

    #[test]
    fn every_kind_is_known_by_its_content_and_becomes_grey() {
        let jpeg = grey(&jpeg_bytes()).unwrap();
        assert_eq!((jpeg.height, jpeg.width, jpeg.is_cut_out), (8, 8, false));
        assert!(jpeg.pixels[0] > 200 && jpeg.pixels[3 * 8 + 3] < 60);
        assert_eq!(
            grey(&bmp_bytes(&[0, 50, 100])).unwrap().pixels[3..6],
            [50; 3]
        );
        let colours = [255, 0, 0, 0, 255, 0, 0, 0, 255];
        let expected = [76, 150, 29];
        let png = png_bytes(3, 1, png::ColorType::Rgb, png::BitDepth::Eight, &colours);
        assert_eq!(grey(&png).unwrap().pixels, expected);
        let rgba: Vec<u8> = colours
            .chunks(3)
            .flat_map(|rgb| [rgb, &[255]].concat())
            .collect();
        let webp = grey(&webp_bytes(3, 1, &rgba)).unwrap();
        assert_eq!((&webp.pixels[..], webp.is_cut_out), (&expected[..], false));
        let sixteen = |pixels: &[u8]| {
            let png = png_bytes(
                2,
                1,
                png::ColorType::Grayscale,
                png::BitDepth::Sixteen,
                pixels,
            );
            grey(&png).unwrap().pixels
        };
        assert_eq!(sixteen(&[200, 7, 1, 0]), [200, 1]);
        // Bytes in numbers of 16 bits.
        assert_eq!(sixteen(&[0, 200, 0, 1]), [200, 1]);
        // A first frame that is smaller than the picture leaves the rest transparent.
        let mut frame = gif::Frame::from_palette_pixels(1, 1, [255], grey_palette(), None);
        (frame.left, frame.top) = (1, 1);
        let gif = grey(&gif_bytes(3, 2, frame)).unwrap();
        assert_eq!(
            (&gif.pixels[..], gif.is_cut_out),
            (&[0, 0, 0, 0, 255, 0][..], true)
        );
    }

    #[test]
    fn what_is_not_transparent_becomes_bright() {
        let of = |grey: u8| {
            let pixels = [grey, 255, grey, 128, 77, 0];
            of_channels(3, 1, 2, &pixels).unwrap()
        };
        assert_eq!(of(0).pixels, [255, 128, 0]);
        assert_eq!(of(255).pixels, [255, 128, 0]);
        assert_eq!(of(30).pixels, [225, 113, 0]);
        // Without transparency nothing is changed.
        assert_eq!(of_channels(1, 1, 4, &[0, 0, 0, 255]).unwrap().pixels, [0]);
    }

    #[test]
    fn a_camera_that_was_turned_is_turned_back() {
        // Numbers of pixels: 0 1 2 / 3 4 5
        let stored = Grey::new(2, 3, (0..6).collect());
        let turned = |orientation| upright(stored.clone(), orientation);
        assert_eq!(turned(1), stored);
        assert_eq!(turned(3).pixels, [5, 4, 3, 2, 1, 0]);
        assert_eq!(
            (turned(6).height, turned(6).pixels),
            (3, vec![3, 0, 4, 1, 5, 2])
        );
        assert_eq!(
            (turned(8).height, turned(8).pixels),
            (3, vec![2, 5, 1, 4, 0, 3])
        );
        for (first, second) in [(2, 2), (4, 4), (5, 5), (7, 7), (6, 8)] {
            assert_eq!(upright(turned(first), second), stored, "{first}");
        }
        let exif = |head: &[u8], entry: &[u8]| [head, entry].concat();
        let big = exif(
            b"Exif\0\0MM\0*\0\0\0\x08\0\x01",
            &[1, 0x12, 0, 3, 0, 0, 0, 1, 0, 6, 0, 0],
        );
        let little = exif(
            b"II*\0\x08\0\0\0\x01\0",
            &[0x12, 1, 3, 0, 1, 0, 0, 0, 8, 0, 0, 0],
        );
        assert_eq!(
            [orientation(&big), orientation(&little), orientation(b"MM")],
            [6, 8, 1]
        );
    }

    #[test]
    fn pictures_that_are_broken_absurd_or_of_another_kind_are_refused_with_the_reason() {
        let png = png_bytes(
            2,
            1,
            png::ColorType::Grayscale,
            png::BitDepth::Eight,
            &[1, 2],
        );
        let mut wide = png.clone();
        wide[16..20].copy_from_slice(&20_000_u32.to_be_bytes());
        // The checksum of the header is to be right.
        let mut sum = flate2::Crc::new();
        sum.update(&wide[12..29]);
        wide[29..33].copy_from_slice(&sum.sum().to_be_bytes());
        let cut = |bytes: Vec<u8>| bytes[..bytes.len() - 4].to_vec();
        let svg = b"<?xml version='1.0'?><svg/>".to_vec();
        for (bytes, said) in [
            (Vec::new(), "is empty"),
            (b"hello".to_vec(), "is no picture: expected PNG"),
            (b"II*\0....".to_vec(), "TIFF is not read"),
            (svg, "SVG is not read"),
            (wide, "20000 × 1"),
            (cut(jpeg_bytes()), "no whole JPEG"),
            (cut(bmp_bytes(&[1, 2, 3])), "no whole BMP"),
            (png[..png.len() - 16].to_vec(), "no whole PNG"),
            (webp_bytes(2, 1, &[7; 8])[..20].to_vec(), "no whole WebP"),
        ] {
            let error = grey(&bytes).unwrap_err();
            assert!(error.contains(said), "{said}: {error}");
        }
    }
}
