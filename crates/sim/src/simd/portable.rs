//! Lanes for any machine: an array that the compiler turns into the vectors available.

use super::{Lanes, each};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Returns a · b + c, rounded once: by `libm`, which looks for an instruction at run time, since
/// the C library's (`f64::mul_add`) is not exact everywhere. WebAssembly has no such instruction, and
/// in software it would be several times as slow as all else: there it is rounded twice, and a
/// browser's walks agree with the program's as far as rounding lets them.
#[inline(always)]
#[allow(clippy::disallowed_methods, reason = "these are the lanes")]
fn mul_add(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(any(target_arch = "aarch64", target_feature = "fma")) {
        a.mul_add(b, c)
    } else if cfg!(target_family = "wasm") {
        a * b + c
    } else {
        libm::fma(a, b, c)
    }
}

#[derive(Clone, Copy)]
pub(super) struct F64x4([f64; 4]);

#[derive(Clone, Copy)]
pub(super) struct Mask([bool; 4]);

impl BitAnd for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Mask(each!(i in [0, 1, 2, 3] => self.0[i] & other.0[i]))
    }
}

impl BitOr for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Mask(each!(i in [0, 1, 2, 3] => self.0[i] | other.0[i]))
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident, $symbol:tt) => {
        impl $operator for F64x4 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                F64x4(each!(i in [0, 1, 2, 3] => self.0[i] $symbol other.0[i]))
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Lanes for F64x4 {
    type Mask = Mask;
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        F64x4([value; 4])
    }

    #[inline(always)]
    fn load(from: &[f64], at: usize) -> Self {
        let from = &from[at..at + 4];
        F64x4(each!(i in [0, 1, 2, 3] => from[i]))
    }

    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        to[at..at + 4].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, more: Self) -> Self {
        F64x4(each!(i in [0, 1, 2, 3] => mul_add(self.0[i], factor.0[i], more.0[i])))
    }

    #[inline(always)]
    fn mul_sub_from(self, factor: Self, more: Self) -> Self {
        F64x4(each!(i in [0, 1, 2, 3] => mul_add(-self.0[i], factor.0[i], more.0[i])))
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, less: Self) -> Self {
        F64x4(each!(i in [0, 1, 2, 3] => mul_add(self.0[i], factor.0[i], -less.0[i])))
    }

    #[inline(always)]
    fn bits_and(self, other: Self) -> Self {
        F64x4(
            each!(i in [0, 1, 2, 3] => f64::from_bits(self.0[i].to_bits() & other.0[i].to_bits())),
        )
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        F64x4(each!(i in [0, 1, 2, 3] => self.0[i].sqrt()))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        F64x4(each!(i in [0, 1, 2, 3] => self.0[i].abs()))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        F64x4(
            each!(i in [0, 1, 2, 3] => if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }),
        )
    }

    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        let (a, b) = (self.abs(), other.abs());
        F64x4(
            each!(i in [0, 1, 2, 3] => if a.0[i].to_bits() > b.0[i].to_bits() { a.0[i] } else { b.0[i] }),
        )
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Mask {
        Mask(each!(i in [0, 1, 2, 3] => self.0[i] > other.0[i]))
    }

    #[inline(always)]
    fn select(mask: Mask, yes: Self, no: Self) -> Self {
        F64x4(each!(i in [0, 1, 2, 3] => if mask.0[i] { yes.0[i] } else { no.0[i] }))
    }

    #[inline(always)]
    fn any(mask: Mask) -> bool {
        mask.0[0] | mask.0[1] | mask.0[2] | mask.0[3]
    }

    #[inline(always)]
    fn all(mask: Mask) -> bool {
        mask.0[0] & mask.0[1] & mask.0[2] & mask.0[3]
    }

    #[inline(always)]
    fn shift_in(self, previous: Self) -> Self {
        F64x4([previous.0[3], self.0[0], self.0[1], self.0[2]])
    }
}
