//! Wide lanes: which vector instructions the numerical loops are compiled for, chosen when the program runs.
//!
//! The loops are plain Rust over slices that the compiler turns into vector code; here the same loop is compiled
//! once per instruction set. Rust never contracts a·b + c into a fused multiply-add and never reorders a sum,
//! so every version gives the same bits (`tests/lanes_agree.rs`).

use std::sync::OnceLock;

/// An instruction set that the numerical loops exist for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// What every machine of the target has (SSE2 on x86-64, NEON on AArch64).
    Baseline,
    /// x86-64 with 256-bit vectors.
    Avx2,
    /// x86-64 with 512-bit vectors.
    Avx512,
}

impl InstructionSet {
    /// All instruction sets, narrowest first.
    pub const ALL: [InstructionSet; 3] =
        [InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512];

    /// Its name, as the environment variable `MORPHCOG_ISA` takes it.
    pub fn name(self) -> &'static str {
        match self {
            InstructionSet::Baseline => "baseline",
            InstructionSet::Avx2 => "avx2",
            InstructionSet::Avx512 => "avx512",
        }
    }

    /// Whether this machine has it.
    pub fn is_available(self) -> bool {
        match self {
            InstructionSet::Baseline => true,
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The one in use: the widest this machine has, or the one named by the environment variable `MORPHCOG_ISA`
    /// if the machine has that.
    pub fn in_use() -> Self {
        static IN_USE: OnceLock<InstructionSet> = OnceLock::new();
        *IN_USE.get_or_init(|| {
            let asked = std::env::var("MORPHCOG_ISA").unwrap_or_default();
            let available = || InstructionSet::ALL.into_iter().filter(|set| set.is_available());
            available()
                .find(|set| set.name() == asked)
                .or_else(|| available().next_back())
                .unwrap_or(InstructionSet::Baseline)
        })
    }
}

/// A numerical loop to be compiled for every instruction set. `run` must be `#[inline(always)]`, and so must
/// all that is to be vectorised below it.
pub trait Kernel {
    /// What it computes.
    type Output;
    /// Computes it.
    fn run(self) -> Self::Output;
}

/// Runs a kernel compiled for an instruction set (the baseline's version if this machine lacks it).
#[allow(unsafe_code)] // Each block calls a function compiled for features that were just found present.
pub fn dispatch<K: Kernel>(set: InstructionSet, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    match set {
        // SAFETY: `is_available` has asked the processor for exactly these features.
        InstructionSet::Avx512 if set.is_available() => return unsafe { avx512(kernel) },
        // SAFETY: as above.
        InstructionSet::Avx2 if set.is_available() => return unsafe { avx2(kernel) },
        _ => {}
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq")]
fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
