//! Lanes of any machine: an array that the compiler turns into what vectors there are.

use super::fused::mul_add;
use super::{Lanes, each};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Four lanes.
#[derive(Clone, Copy)]
pub(super) struct Few([f64; 4]);

/// Truth of four lanes.
#[derive(Clone, Copy)]
pub(super) struct Truth([bool; 4]);

impl BitAnd for Truth {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Truth(each!(i in [0, 1, 2, 3] => self.0[i] & other.0[i]))
    }
}

impl BitOr for Truth {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Truth(each!(i in [0, 1, 2, 3] => self.0[i] | other.0[i]))
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident, $symbol:tt) => {
        impl $operator for Few {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Few(each!(i in [0, 1, 2, 3] => self.0[i] $symbol other.0[i]))
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Lanes for Few {
    type Mask = Truth;
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Few([value; 4])
    }

    #[inline(always)]
    fn load(from: &[f64], at: usize) -> Self {
        let from = &from[at..at + 4];
        Few(each!(i in [0, 1, 2, 3] => from[i]))
    }

    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        to[at..at + 4].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, more: Self) -> Self {
        Few(mul_add(self.0, factor.0, more.0))
    }

    #[inline(always)]
    fn mul_sub_from(self, factor: Self, more: Self) -> Self {
        Few(mul_add(each!(i in [0, 1, 2, 3] => -self.0[i]), factor.0, more.0))
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, less: Self) -> Self {
        Few(mul_add(self.0, factor.0, each!(i in [0, 1, 2, 3] => -less.0[i])))
    }

    #[inline(always)]
    fn bits_and(self, other: Self) -> Self {
        Few(each!(i in [0, 1, 2, 3] => f64::from_bits(self.0[i].to_bits() & other.0[i].to_bits())))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Few(each!(i in [0, 1, 2, 3] => self.0[i].sqrt()))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Few(each!(i in [0, 1, 2, 3] => self.0[i].abs()))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Few(each!(i in [0, 1, 2, 3] => if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        let (a, b) = (self.abs(), other.abs());
        Few(each!(i in [0, 1, 2, 3] => if a.0[i].to_bits() > b.0[i].to_bits() { a.0[i] } else { b.0[i] }))
    }

    #[inline(always)]
    fn above(self, other: Self) -> Truth {
        Truth(each!(i in [0, 1, 2, 3] => self.0[i] > other.0[i]))
    }

    #[inline(always)]
    fn or_else(self, mask: Truth, other: Self) -> Self {
        Few(each!(i in [0, 1, 2, 3] => if mask.0[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn any(mask: Truth) -> bool {
        mask.0[0] | mask.0[1] | mask.0[2] | mask.0[3]
    }

    #[inline(always)]
    fn all(mask: Truth) -> bool {
        mask.0[0] & mask.0[1] & mask.0[2] & mask.0[3]
    }

    #[inline(always)]
    fn after(self, previous: Self) -> Self {
        Few([previous.0[3], self.0[0], self.0[1], self.0[2]])
    }
}
