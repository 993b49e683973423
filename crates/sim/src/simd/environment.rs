//! [`FloatEnvironment`]: the rounding mode of the processor.
#![allow(unsafe_code)]

use std::marker::PhantomData;

/// Makes this thread round to nearest and keep subnormal numbers, which Rust and our promise of the
/// same bits both assume. A host program may have chosen otherwise (`fesetround`, or libraries
/// built with `-ffast-math`); dropping the value restores its choice. New threads inherit the
/// environment of their parent.
#[derive(Debug)]
#[must_use = "the environment is the host's again as soon as this is dropped"]
pub struct FloatEnvironment {
    before: Register,
    /// Ties the value to its thread.
    of_thread: PhantomData<*const ()>,
}

impl FloatEnvironment {
    /// Sets the standard environment until the value is dropped.
    #[inline(never)] // What follows is not computed before.
    pub fn standard() -> Self {
        let before = read();
        if before & CONTROL != STANDARD & CONTROL {
            write(STANDARD);
        }
        FloatEnvironment {
            before,
            of_thread: PhantomData,
        }
    }
}

impl Drop for FloatEnvironment {
    #[inline(never)]
    fn drop(&mut self) {
        if self.before & CONTROL != STANDARD & CONTROL {
            write(self.before);
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod register {
    use std::arch::asm;

    pub type Register = u32;
    /// All exceptions masked, round to nearest, subnormals kept.
    pub const STANDARD: Register = 0x1f80;
    /// All bits but the exception flags.
    pub const CONTROL: Register = 0xffc0;

    pub fn read() -> Register {
        let mut value: Register = 0;
        // SAFETY: stores MXCSR, four bytes, to where `value` is.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags)) };
        value
    }

    pub fn write(value: Register) {
        // SAFETY: loads MXCSR from `value`: Rust's default or, at the end, the host's setting. No
        // reserved bit is set, as both come from the processor or its manual.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack)) };
    }
}

#[cfg(target_arch = "aarch64")]
mod register {
    use std::arch::asm;

    pub type Register = u64;
    /// No exception traps, round to nearest, subnormals kept.
    pub const STANDARD: Register = 0;
    /// All bits: the exception flags are in another register.
    pub const CONTROL: Register = u64::MAX;

    pub fn read() -> Register {
        let value: Register;
        // SAFETY: reads FPCR, and nothing else.
        unsafe { asm!("mrs {}, fpcr", out(reg) value, options(nostack, preserves_flags)) };
        value
    }

    pub fn write(value: Register) {
        // SAFETY: writes FPCR: Rust's default or, at the end, the host's setting.
        unsafe { asm!("msr fpcr, {}", in(reg) value, options(nostack)) };
    }
}

/// Does nothing on other processors.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod register {
    pub type Register = u32;
    pub const STANDARD: Register = 0;
    pub const CONTROL: Register = 0;

    pub fn read() -> Register {
        STANDARD
    }

    pub fn write(_: Register) {}
}

use register::{CONTROL, Register, STANDARD, read, write};

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use std::hint::black_box;

    /// Computes results that depend on the environment: 1 ± a little, and subnormal numbers.
    #[inline(never)]
    fn computed() -> [f64; 4] {
        let (one, tiny, subnormal) = (black_box(1.0), black_box(1e-30), black_box(5e-324));
        [
            one + tiny,
            one - tiny,
            black_box(f64::MIN_POSITIVE) / black_box(4.0),
            subnormal * black_box(1e300),
        ]
    }

    #[test]
    fn whatever_the_host_has_chosen_numbers_are_the_same_and_it_has_its_choice_again() {
        let usual = computed();
        // Down, up, towards zero; subnormals flushed, or read as zero; all of them.
        for choice in [0x2000, 0x4000, 0x6000, 0x8000, 0x0040, 0xe040] {
            let host = STANDARD | choice;
            write(host);
            let odd = computed();
            let environment = FloatEnvironment::standard();
            let (within, in_thread) = (computed(), std::thread::spawn(computed).join());
            drop(environment);
            let (again, after) = (computed(), read() & CONTROL);
            write(STANDARD);
            assert_ne!(odd, usual, "{choice:x}");
            assert_eq!((within, in_thread.unwrap()), (usual, usual), "{choice:x}");
            assert_eq!((again, after), (odd, host), "{choice:x}");
        }
    }
}
