//! Wide lanes: numerical loops compiled for every instruction set, one chosen at run time.
//!
//! A loop is a [`Kernel`], generic over [`Lanes`], a few `f64` side by side. [`dispatch`] runs it
//! with the widest lanes that the machine has. Every operation of [`Lanes`] is an exactly rounded
//! IEEE 754 operation; products and sums are fused only where the loop says so. Lanes never mix
//! except in [`Lanes::shift_in`]. So every instruction set gives the same bits
//! (`tests/lanes_agree.rs`). The few x86-64 machines without fused operations (before 2013, and
//! some small ones since) compute them exactly in software, slowly.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};
use std::sync::OnceLock;

mod buffer;
mod environment;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use buffer::Buffer;
pub use environment::FloatEnvironment;

/// A multiple of the width of all lane types: loops over a multiple of it need no remainder.
pub const BLOCK: usize = 8;

/// An instruction set that the numerical loops are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// The target's baseline (SSE2 on x86-64, NEON on AArch64).
    Baseline,
    /// x86-64 with 256-bit vectors (AVX2 and FMA).
    Avx2,
    /// x86-64 with 512-bit vectors (AVX-512 F and DQ).
    Avx512,
}

impl InstructionSet {
    /// All instruction sets, narrowest first.
    pub const ALL: [InstructionSet; 3] = [
        InstructionSet::Baseline,
        InstructionSet::Avx2,
        InstructionSet::Avx512,
    ];

    /// Returns its name, as the environment variable `MORPHCOG_ISA` takes it.
    pub fn name(self) -> &'static str {
        match self {
            InstructionSet::Baseline => "baseline",
            InstructionSet::Avx2 => "avx2",
            InstructionSet::Avx512 => "avx512",
        }
    }

    /// Returns true if this machine has it.
    pub fn is_available(self) -> bool {
        match self {
            InstructionSet::Baseline => true,
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => {
                is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
            }
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => {
                InstructionSet::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// Returns the one that the environment variable `MORPHCOG_ISA` names, if it is set.
    ///
    /// # Errors
    /// Returns the name and those available if this machine has no such instruction set.
    pub fn asked() -> Result<Option<Self>, String> {
        let Some(asked) = std::env::var_os("MORPHCOG_ISA").filter(|asked| !asked.is_empty()) else {
            return Ok(None);
        };
        let available = || {
            InstructionSet::ALL
                .into_iter()
                .filter(|set| set.is_available())
        };
        let found = available().find(|set| asked == set.name());
        let names: Vec<&str> = available().map(InstructionSet::name).collect();
        let text = || {
            format!(
                "MORPHCOG_ISA={}: expected one of {}",
                asked.display(),
                names.join(", ")
            )
        };
        found.map(Some).ok_or_else(text)
    }

    /// Returns the one in use: the [requested](InstructionSet::asked) one, or else the widest.
    pub fn in_use() -> Self {
        static IN_USE: OnceLock<InstructionSet> = OnceLock::new();
        *IN_USE.get_or_init(|| {
            let widest = InstructionSet::ALL
                .into_iter()
                .rfind(|set| set.is_available());
            InstructionSet::asked()
                .ok()
                .flatten()
                .or(widest)
                .unwrap_or(InstructionSet::Baseline)
        })
    }
}

/// A few `f64` side by side.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// One truth value per lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;
    /// Number of lanes.
    const WIDTH: usize;

    /// Returns the same value in every lane.
    fn splat(value: f64) -> Self;
    /// Loads `from[at..at + WIDTH]`; panics beyond the end.
    fn load(from: &[f64], at: usize) -> Self;
    /// Stores to `to[at..at + WIDTH]`; panics beyond the end.
    fn store(self, to: &mut [f64], at: usize);
    /// Returns self · factor + more, rounded once.
    fn mul_add(self, factor: Self, more: Self) -> Self;
    /// Returns more − self · factor, rounded once.
    fn mul_sub_from(self, factor: Self, more: Self) -> Self;
    /// Returns self · factor − less, rounded once.
    fn mul_sub(self, factor: Self, less: Self) -> Self;
    /// Returns the common bits: the absolute value if `other` lacks only the sign bit, 0 if it is
    /// 0.
    fn bits_and(self, other: Self) -> Self;
    /// Returns the square root.
    fn sqrt(self) -> Self;
    /// Returns the absolute value.
    fn abs(self) -> Self;
    /// Returns self > other ? self : other (so `other` if one is NaN).
    fn max(self, other: Self) -> Self;
    /// Returns the greater absolute value, or NaN if either is NaN, so that a maximum over many
    /// keeps it. (Without the sign, bits are in the order of the numbers, with NaN last.)
    fn max_abs(self, other: Self) -> Self;
    /// Returns the lanes in which self > other (false where one is NaN).
    fn gt(self, other: Self) -> Self::Mask;
    /// Returns `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Returns true if a mask holds in any lane.
    fn any(mask: Self::Mask) -> bool;
    /// Returns true if a mask holds in all lanes.
    fn all(mask: Self::Mask) -> bool;
    /// Moves the lanes up by one and fills the lowest with the last of `previous`: the result of
    /// `load` one place earlier.
    fn shift_in(self, previous: Self) -> Self;
}

/// Makes an array of an expression for some indices, `each!(i in [0, 1] => a[i] + b[i])`. Unlike
/// `array::map` it needs no inlining: a closure that is not inlined would lose wide instructions.
macro_rules! each {
    ($index:ident in [$($value:expr),*] => $expression:expr) => {
        [$({
            let $index = $value;
            $expression
        }),*]
    };
}
pub(crate) use each;

/// A numerical loop compiled for every instruction set. `run` must be `#[inline(always)]`, as must
/// everything below it that is to be vectorised.
pub trait Kernel {
    /// The result of the loop.
    type Output;
    /// Runs the loop.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Runs a kernel compiled for an instruction set (the baseline if this machine lacks it).
#[allow(unsafe_code)] // Each block calls a function compiled for features that were just found present.
pub fn dispatch<K: Kernel>(set: InstructionSet, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    match set {
        // SAFETY: `is_available` has asked the processor for exactly these features.
        InstructionSet::Avx512 if set.is_available() => return unsafe { x86::avx512(kernel) },
        // SAFETY: as above.
        InstructionSet::Avx2 if set.is_available() => return unsafe { x86::avx2(kernel) },
        _ => {}
    }
    kernel.run::<portable::F64x4>()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct MaxAbs([f64; BLOCK], [f64; BLOCK]);

    impl Kernel for MaxAbs {
        type Output = [f64; BLOCK];

        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let mut out = [0.0; BLOCK];
            for lane in (0..BLOCK).step_by(L::WIDTH) {
                L::load(&self.0, lane)
                    .max_abs(L::load(&self.1, lane))
                    .store(&mut out, lane);
            }
            out
        }
    }

    #[test]
    fn max_abs_loses_no_nan_and_is_the_same_on_every_instruction_set() {
        let values = [
            0.0,
            -0.0,
            1e-310,
            -1.0,
            1.5,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            -f64::NAN,
        ];
        for set in InstructionSet::ALL
            .into_iter()
            .filter(|set| set.is_available())
        {
            for a in values {
                for b in values {
                    let greatest = if a.is_nan() || b.is_nan() {
                        f64::NAN
                    } else {
                        a.abs().max(b.abs())
                    };
                    let found = dispatch(set, MaxAbs([a; BLOCK], [b; BLOCK]));
                    for lane in found {
                        assert_eq!(lane.to_bits(), greatest.to_bits(), "{set:?}: {a} and {b}");
                    }
                }
            }
        }
    }
}
