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
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let info = decoder.read_header_info().map_err(failed)?;
    check_size(info.width as usize, info.height as usize)?;
    let mut reader = decoder.read_info().map_err(failed)?;
    let size = reader.output_buffer_size();
    let mut pixels = vec![0; size.ok_or_else(|| "is too large".to_string())?];
    let info = reader.next_frame(&mut pixels).map_err(failed)?;
    // Data that are missing at the end are noticed only here.
    reader.finish().map_err(failed)?;
    pixels.truncate(info.buffer_size());
    let turned = reader
        .info()
        .exif_metadata
        .as_deref()
        .map_or(1, orientation);
    let channels = info.color_type.samples();
    let grey = of_channels(info.width as usize, info.height as usize, channels, &pixels)?;
    Ok(upright(grey, turned))
}

fn jpeg(bytes: &[u8]) -> Result<Grey, String> {
    let failed = |error: zune_jpeg::errors::DecodeErrors| broken("JPEG", &error);
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
    let space = decoder.colorspace().ok_or("has no colours")?;
    let pixels = decoder.decode().map_err(failed)?;
    of_channels(width, height, space.num_components(), &pixels)
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
    if channels % 2 == 0 {
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
