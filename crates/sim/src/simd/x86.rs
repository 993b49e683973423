//! Lanes of x86-64. Values of these types are only made inside [`avx2`] and [`avx512`], which
//! `dispatch` calls only if the processor has the instructions; that makes the calls below sound.
#![allow(unsafe_code)]

use super::{Kernel, Lanes};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

#[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
pub(super) fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<F64x8>()
}

#[target_feature(enable = "avx2,fma")]
pub(super) fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<F64x4>()
}

/// F64x4 lanes (AVX2).
#[derive(Clone, Copy)]
pub(super) struct F64x4(__m256d);

/// Mask of four lanes: all bits of a lane, or none.
#[derive(Clone, Copy)]
pub(super) struct Mask4(__m256d);

/// F64x8 lanes (AVX-512).
#[derive(Clone, Copy)]
pub(super) struct F64x8(__m512d);

/// Mask of eight lanes: one bit each.
#[derive(Clone, Copy)]
pub(super) struct Mask8(__mmask8);

macro_rules! operators {
    ($lanes:ident: $($operator:ident $method:ident $instruction:ident),*) => {$(
        impl $operator for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: the processor has the instruction (see the module).
                unsafe { $lanes($instruction(self.0, other.0)) }
            }
        }
    )*};
}
operators!(F64x4: Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);
operators!(F64x8: Add add _mm512_add_pd, Sub sub _mm512_sub_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd);
operators!(Mask4: BitAnd bitand _mm256_and_pd, BitOr bitor _mm256_or_pd);

impl BitAnd for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Mask8(self.0 & other.0)
    }
}

impl BitOr for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Mask8(self.0 | other.0)
    }
}

impl Lanes for F64x4 {
    type Mask = Mask4;
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_set1_pd(value)) }
    }

    #[inline(always)]
    fn load(from: &[f64], at: usize) -> Self {
        let from = &from[at..at + 4];
        // SAFETY: the slice holds four values; loads need no alignment.
        unsafe { F64x4(_mm256_loadu_pd(from.as_ptr())) }
    }

    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        let to = &mut to[at..at + 4];
        // SAFETY: the slice has room for four values; stores need no alignment.
        unsafe { _mm256_storeu_pd(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, more: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_fmadd_pd(self.0, factor.0, more.0)) }
    }

    #[inline(always)]
    fn mul_sub_from(self, factor: Self, more: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_fnmadd_pd(self.0, factor.0, more.0)) }
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, less: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_fmsub_pd(self.0, factor.0, less.0)) }
    }

    #[inline(always)]
    fn bits_and(self, other: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_and_pd(self.0, other.0)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_sqrt_pd(self.0)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: the processor has the instructions (see the module).
        unsafe { F64x4(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_max_pd(self.0, other.0)) }
    }

    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        let (a, b) = (self.abs().0, other.abs().0);
        // SAFETY: the processor has the instructions (see the module).
        unsafe {
            let greater = _mm256_cmpgt_epi64(_mm256_castpd_si256(a), _mm256_castpd_si256(b));
            F64x4(_mm256_blendv_pd(b, a, _mm256_castsi256_pd(greater)))
        }
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Mask4 {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { Mask4(_mm256_cmp_pd::<_CMP_GT_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn select(mask: Mask4, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x4(_mm256_blendv_pd(no.0, yes.0, mask.0)) }
    }

    #[inline(always)]
    fn any(mask: Mask4) -> bool {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { _mm256_movemask_pd(mask.0) != 0 }
    }

    #[inline(always)]
    fn all(mask: Mask4) -> bool {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { _mm256_movemask_pd(mask.0) == 0b1111 }
    }

    #[inline(always)]
    fn shift_in(self, previous: Self) -> Self {
        // SAFETY: the processor has the instructions (see the module).
        unsafe {
            // [previous 2, previous 3, self 0, self 1]; then its odd with self's even lanes.
            let middle = _mm256_permute2f128_pd::<0x21>(previous.0, self.0);
            F64x4(_mm256_shuffle_pd::<0b0101>(middle, self.0))
        }
    }
}

impl Lanes for F64x8 {
    type Mask = Mask8;
    const WIDTH: usize = 8;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_set1_pd(value)) }
    }

    #[inline(always)]
    fn load(from: &[f64], at: usize) -> Self {
        let from = &from[at..at + 8];
        // SAFETY: the slice holds eight values; loads need no alignment.
        unsafe { F64x8(_mm512_loadu_pd(from.as_ptr())) }
    }

    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        let to = &mut to[at..at + 8];
        // SAFETY: the slice has room for eight values; stores need no alignment.
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, more: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_fmadd_pd(self.0, factor.0, more.0)) }
    }

    #[inline(always)]
    fn mul_sub_from(self, factor: Self, more: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_fnmadd_pd(self.0, factor.0, more.0)) }
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, less: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_fmsub_pd(self.0, factor.0, less.0)) }
    }

    #[inline(always)]
    fn bits_and(self, other: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe {
            F64x8(_mm512_castsi512_pd(_mm512_and_si512(
                _mm512_castpd_si512(self.0),
                _mm512_castpd_si512(other.0),
            )))
        }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_sqrt_pd(self.0)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_abs_pd(self.0)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_max_pd(self.0, other.0)) }
    }

    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        let (a, b) = (self.abs().0, other.abs().0);
        // SAFETY: the processor has the instruction (see the module).
        unsafe {
            F64x8(_mm512_castsi512_pd(_mm512_max_epi64(
                _mm512_castpd_si512(a),
                _mm512_castpd_si512(b),
            )))
        }
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Mask8 {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { Mask8(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn select(mask: Mask8, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has the instruction (see the module).
        unsafe { F64x8(_mm512_mask_blend_pd(mask.0, no.0, yes.0)) }
    }

    #[inline(always)]
    fn any(mask: Mask8) -> bool {
        mask.0 != 0
    }

    #[inline(always)]
    fn all(mask: Mask8) -> bool {
        mask.0 == 0xff
    }

    #[inline(always)]
    fn shift_in(self, previous: Self) -> Self {
        // SAFETY: the processor has the instructions (see the module).
        unsafe {
            let (below, here) = (_mm512_castpd_si512(previous.0), _mm512_castpd_si512(self.0));
            F64x8(_mm512_castsi512_pd(_mm512_alignr_epi64::<7>(here, below)))
        }
    }
}
