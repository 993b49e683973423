//! LZW for GIFs that may take a similar colour where that makes the file smaller.

/// Most codes of a GIF.
const CODES: usize = 4096;

/// No code.
const NONE: u16 = u16::MAX;

/// The codes known so far: a tree of sequences of indices. The children of a code are a list.
struct Codes {
    first: Vec<u16>,
    next: Vec<u16>,
    parent: Vec<u16>,
    last: Vec<u8>,
}

impl Codes {
    /// Creates the codes of single indices, and those for "clear" and "end".
    fn new(bits: u8) -> Self {
        let count = (1 << bits) + 2;
        let last = (0..count).map(|code: usize| code as u8).collect();
        let none = vec![NONE; count];
        Codes {
            first: none.clone(),
            next: none.clone(),
            parent: none,
            last,
        }
    }

    fn len(&self) -> usize {
        self.last.len()
    }

    fn children(&self, code: u16) -> impl Iterator<Item = u16> {
        let some = |code: u16| (code != NONE).then_some(code);
        std::iter::successors(some(self.first[usize::from(code)]), move |code| {
            some(self.next[usize::from(*code)])
        })
    }

    /// Returns the code of the longest known sequence that pixels from `place` on may have, the one
    /// with the least error of several.
    fn longest(&self, place: usize, bits: u8, error: &impl Fn(usize, u8) -> Option<u32>) -> u16 {
        let mut best = (0, std::cmp::Reverse(0), NONE);
        let mut open: Vec<(u16, usize, u32)> = (0..1 << bits)
            .filter_map(|code: u16| Some((code, 1, error(place, code as u8)?)))
            .collect();
        while let Some((code, length, total)) = open.pop() {
            best = best.max((length, std::cmp::Reverse(total), code));
            let longer = |child: u16| {
                let found = error(place + length, self.last[usize::from(child)])?;
                Some((child, length + 1, total.saturating_add(found)))
            };
            open.extend(self.children(code).filter_map(longer));
        }
        best.2
    }

    /// Returns the indices that a code stands for.
    fn sequence(&self, code: u16) -> Vec<u8> {
        let up = std::iter::successors(Some(code), |code| {
            Some(self.parent[usize::from(*code)]).filter(|code| *code != NONE)
        });
        let mut sequence: Vec<u8> = up.map(|code| self.last[usize::from(code)]).collect();
        sequence.reverse();
        sequence
    }

    fn add(&mut self, parent: u16, index: u8) {
        let code = self.len() as u16;
        self.first.push(NONE);
        self.next.push(self.first[usize::from(parent)]);
        self.parent.push(parent);
        self.last.push(index);
        self.first[usize::from(parent)] = code;
    }
}

/// Codes as a stream of bits.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    pending: u32,
    count: u32,
}

impl Bits {
    fn push(&mut self, code: u16, width: u32) {
        self.pending |= u32::from(code) << self.count;
        self.count += width;
        while self.count >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.count -= 8;
        }
    }

    fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.pending as u8);
        }
        self.bytes
    }
}

/// Compresses the pixels of a frame. `error(pixel, index)` says how far an index is off, or `None` if
/// it must not be taken, as for pixels beyond the last; every pixel needs an index. Calls `taken` with
/// each pixel and its index. Returns the data as the `gif` crate takes them: the size of an index in
/// bits, and the codes.
pub(crate) fn compress(
    pixels: usize,
    bits: u8,
    error: impl Fn(usize, u8) -> Option<u32>,
    mut taken: impl FnMut(usize, u8),
) -> Vec<u8> {
    let (clear, end) = (1u16 << bits, (1u16 << bits) + 1);
    let error = |pixel: usize, index: u8| match pixel < pixels {
        true => error(pixel, index),
        false => None,
    };
    let mut codes = Codes::new(bits);
    let mut out = Bits::default();
    let mut width = u32::from(bits) + 1;
    out.push(clear, width);
    let mut place = 0;
    let mut before = None;
    while place < pixels {
        let code = codes.longest(place, bits, &error);
        let sequence = codes.sequence(code);
        // The reader learns a code from the one before and the first index of this one.
        if let Some(before) = before.filter(|_| codes.len() < CODES) {
            codes.add(before, sequence[0]);
            if codes.len() > 1 << width && width < 12 {
                width += 1;
            }
        }
        out.push(code, width);
        for index in sequence {
            taken(place, index);
            place += 1;
        }
        before = Some(code);
        if codes.len() == CODES {
            out.push(clear, width);
            codes = Codes::new(bits);
            width = u32::from(bits) + 1;
            before = None;
        }
    }
    out.push(end, width);
    let mut data = vec![bits];
    data.extend(out.finish());
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use gif::{DecodeOptions, Encoder, Frame};

    /// Decodes a frame of one row as any viewer does.
    fn decoded(data: Vec<u8>, pixels: usize, bits: u8) -> Vec<u8> {
        let width = pixels as u16;
        let palette = vec![0; 3 << bits];
        let mut encoder = Encoder::new(Vec::new(), width, 1, &palette).unwrap();
        let frame = Frame {
            width,
            height: 1,
            buffer: data.into(),
            ..Frame::default()
        };
        encoder.write_lzw_pre_encoded_frame(&frame).unwrap();
        let file = encoder.into_inner().unwrap();
        let mut decoder = DecodeOptions::new().read_info(&*file).unwrap();
        decoder.read_next_frame().unwrap().unwrap().buffer.to_vec()
    }

    /// Pixels in which nothing repeats for long.
    fn noise(pixels: usize, colours: u32) -> Vec<u8> {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % colours
        };
        (0..pixels).map(|_| next() as u8).collect()
    }

    #[test]
    fn without_tolerance_every_pixel_comes_back_however_many_codes_that_needs() {
        for (pixels, colours, bits) in [(1, 2, 2), (60_000, 64, 6), (60_000, 2, 2), (9, 255, 8)] {
            let image = noise(pixels, colours);
            let exact = |pixel: usize, index: u8| (image[pixel] == index).then_some(0);
            let mut said = vec![0; pixels];
            let data = compress(pixels, bits, exact, |pixel, index| said[pixel] = index);
            assert_eq!(said, image);
            assert!(decoded(data, pixels, bits) == image, "{pixels} {colours}");
        }
    }

    #[test]
    fn with_tolerance_the_file_is_shorter_and_no_pixel_is_further_off() {
        let image = noise(20_000, 64);
        let within = |most: u32| {
            let near = |pixel: usize, index: u8| {
                let error = u32::from(image[pixel].abs_diff(index));
                (error <= most && index < 64).then_some(error)
            };
            let mut said = vec![0; image.len()];
            let data = compress(image.len(), 6, near, |pixel, index| said[pixel] = index);
            assert!(decoded(data.clone(), image.len(), 6) == said);
            let errors = said.iter().zip(&image).map(|(a, b)| a.abs_diff(*b));
            assert!(errors.max().map(u32::from) <= Some(most));
            data.len()
        };
        let sizes = [0, 2, 8].map(within);
        assert!(sizes.is_sorted_by(|a, b| a > b), "{sizes:?}");
    }
}
