//! 1 − 1/√(1 + t) for small t by a series: neither root nor division.
//!
//! The binomial series, with its last two terms spread over the others as Chebyshev's polynomials prescribe. Beyond its range root and
//! division do.

use crate::base::lanes::Lanes;

/// The series (1 − 1/√(1 + t))/t = `terms[0]` + `terms[1]`·t + …
#[derive(Clone, Copy, Debug)]
pub(super) struct Series<const TERMS: usize> {
    /// Greatest |t| it is for.
    pub range: f64,
    pub terms: [f64; TERMS],
}

/// For changes of length within a substep; well below one spring in 1000 is out of its range. Off by no more than 3e-13.
pub(super) const SHORT: Series<5> = {
    const RANGE: f64 = 1.0 / 64.0;
    const SQUARE: f64 = RANGE * RANGE;
    const SIXTH: f64 = -231.0 / 1024.0;
    let terms = [
        1.0 / 2.0,
        -3.0 / 8.0 - SIXTH * SQUARE * SQUARE * 9.0 / 16.0,
        5.0 / 16.0,
        -35.0 / 128.0 + SIXTH * SQUARE * 3.0 / 2.0,
        63.0 / 256.0,
    ];
    Series { range: RANGE, terms }
};

/// For changes from one substep to the next, in which limits and contacts move points, and for lengths beyond their limits.
/// Off by no more than 1e-12.
pub(super) const LONG: Series<7> = {
    const RANGE: f64 = 1.0 / 16.0;
    const R2: f64 = RANGE * RANGE;
    const EIGHTH: f64 = -6435.0 / 32768.0;
    const NINTH: f64 = 12155.0 / 65536.0;
    let terms = [
        1.0 / 2.0 - NINTH * R2 * R2 * R2 * R2 / 128.0,
        -3.0 / 8.0 + EIGHTH * R2 * R2 * R2 * 7.0 / 64.0,
        5.0 / 16.0 + NINTH * R2 * R2 * R2 / 4.0,
        -35.0 / 128.0 - EIGHTH * R2 * R2 * 7.0 / 8.0,
        63.0 / 256.0 - NINTH * R2 * R2 * 5.0 / 4.0,
        -231.0 / 1024.0 + EIGHTH * R2 * 7.0 / 4.0,
        429.0 / 2048.0 + NINTH * R2 * 2.0,
    ];
    Series { range: RANGE, terms }
};

impl<const TERMS: usize> Series<TERMS> {
    /// 1 − 1/√(1 + t) for t in range.
    #[inline(always)]
    pub fn briefly<L: Lanes>(&self, t: L) -> L {
        let mut sum = L::splat(self.terms[TERMS - 1]);
        for term in self.terms[..TERMS - 1].iter().rev() {
            sum = sum.mul_add(t, L::splat(*term));
        }
        t * sum
    }

    /// 1 − 1/√(1 + t) for any t.
    #[inline(always)]
    pub fn carefully<L: Lanes>(&self, t: L) -> L {
        let brief = self.briefly(t);
        let beyond = t.abs().above(L::splat(self.range));
        if !L::any(beyond) {
            return brief;
        }
        let one = L::splat(1.0);
        (one - one / (one + t).sqrt()).or_else(beyond, brief)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::lanes::{BLOCK, InstructionSet, Kernel, dispatch};

    /// 1 − 1/√(1 + t) without cancellation.
    fn exact(t: f64) -> f64 {
        let root = (1.0 + t).sqrt();
        t / (root * (1.0 + root))
    }

    struct Both<const TERMS: usize>(Series<TERMS>, [f64; BLOCK]);

    impl<const TERMS: usize> Kernel for Both<TERMS> {
        type Output = [[f64; BLOCK]; 2];

        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let mut out = [[0.0; BLOCK]; 2];
            for lane in (0..BLOCK).step_by(L::WIDTH) {
                let t = L::load(&self.1, lane);
                self.0.briefly(t).store(&mut out[0], lane);
                self.0.carefully(t).store(&mut out[1], lane);
            }
            out
        }
    }

    fn worst<const TERMS: usize>(series: Series<TERMS>) -> f64 {
        let places = (-1000..=1000).map(|i| f64::from(i) / 1000.0 * series.range);
        let off =
            |t: f64| (dispatch(InstructionSet::in_use(), Both(series, [t; BLOCK]))[0][0] - exact(t)).abs();
        places.map(off).fold(0.0, f64::max)
    }

    #[test]
    fn series_are_as_good_as_they_say_anywhere_in_their_range() {
        assert!(worst(SHORT) < 3e-13, "{:e}", worst(SHORT));
        assert!(worst(LONG) < 1e-12, "{:e}", worst(LONG));
        // And for tiny changes to the last bit but one.
        for t in [1e-9, -3e-7, 1e-5] {
            let [short, long] = [Both(SHORT, [t; BLOCK]).run_first(), Both(LONG, [t; BLOCK]).run_first()];
            assert!((short / exact(t) - 1.0).abs() < 1e-9 && (long / exact(t) - 1.0).abs() < 1e-9);
        }
    }

    impl<const TERMS: usize> Both<TERMS> {
        fn run_first(self) -> f64 {
            dispatch(InstructionSet::in_use(), self)[0][0]
        }
    }

    #[test]
    fn out_of_range_root_and_division_do_and_only_there() {
        let t = [0.0, 0.01, -0.01, 0.06, -0.5, 3.0, 1e6, -0.05];
        let [short, long] = [
            dispatch(InstructionSet::in_use(), Both(SHORT, t)),
            dispatch(InstructionSet::in_use(), Both(LONG, t)),
        ];
        for i in 0..BLOCK {
            let within = |range: f64| t[i].abs() <= range;
            assert!((short[1][i] - exact(t[i])).abs() < 1e-12 && (long[1][i] - exact(t[i])).abs() < 1e-12);
            assert_eq!(short[1][i] == short[0][i], within(SHORT.range), "{}", t[i]);
            assert_eq!(long[1][i] == long[0][i], within(LONG.range), "{}", t[i]);
        }
    }
}
