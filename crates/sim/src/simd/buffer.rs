//! [`Buffer`]: numbers aligned for wide loads.

use super::BLOCK;
use std::ops::{Deref, DerefMut};

/// A block of numbers that starts on a cache line, so that no aligned load straddles two lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
struct Block([f64; BLOCK]);

/// A slice of fixed length, aligned to cache lines.
#[derive(Clone, Debug, Default)]
pub struct Buffer {
    blocks: Vec<Block>,
    len: usize,
}

impl Buffer {
    /// Makes a buffer of `len` equal values.
    pub fn filled(len: usize, value: f64) -> Self {
        Buffer {
            blocks: vec![Block([value; BLOCK]); len.div_ceil(BLOCK)],
            len,
        }
    }

    /// Makes a buffer of `len` zeros.
    pub fn zeros(len: usize) -> Self {
        Buffer::filled(len, 0.0)
    }
}

impl Deref for Buffer {
    type Target = [f64];
    #[inline(always)]
    #[allow(unsafe_code)]
    fn deref(&self) -> &[f64] {
        // SAFETY: a block is BLOCK numbers without padding (repr(C); its size is its alignment),
        // and the blocks are contiguous. `len` is at most BLOCK times their number.
        unsafe { std::slice::from_raw_parts(self.blocks.as_ptr().cast(), self.len) }
    }
}

impl DerefMut for Buffer {
    #[inline(always)]
    #[allow(unsafe_code)]
    fn deref_mut(&mut self) -> &mut [f64] {
        // SAFETY: as in `deref`, and the borrow is exclusive.
        unsafe { std::slice::from_raw_parts_mut(self.blocks.as_mut_ptr().cast(), self.len) }
    }
}

impl PartialEq for Buffer {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl FromIterator<f64> for Buffer {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let values: Vec<f64> = values.into_iter().collect();
        let mut buffer = Buffer::zeros(values.len());
        buffer.copy_from_slice(&values);
        buffer
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Buffer {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (**self).serialize(serializer)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for Buffer {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Vec::<f64>::deserialize(deserializer)?.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_is_a_slice_on_a_cache_line() {
        for len in [0, 1, 7, 8, 9, 100] {
            let mut buffer: Buffer = (0..len).map(f64::from).collect();
            assert_eq!(
                (buffer.len(), buffer.as_ptr() as usize % 64),
                (len as usize, 0)
            );
            buffer.iter_mut().for_each(|v| *v += 0.5);
            assert!(buffer.iter().enumerate().all(|(i, v)| *v == i as f64 + 0.5));
        }
    }
}
