//! 1 − 1/√(1 + t) for small t by a series: neither root nor division.

use crate::simd::{Lanes, each};

/// Greatest |t| for the series. Springs beyond it (well below one in 1000) need root and division.
pub(crate) const RANGE: f64 = 1.0 / 64.0;

/// The binomial series of (1 − 1/√(1 + t))/t up to t⁵. Most springs have t near 0, where some
/// bodies amplify errors and a fit would be worse. 1 − 1/√(1 + t) is off by at most 6e-14 anywhere
/// in the range, and only by rounding for |t| up to 1/400.
pub(crate) const TERMS: [f64; 6] = [
    1.0 / 2.0,
    -3.0 / 8.0,
    5.0 / 16.0,
    -35.0 / 128.0,
    63.0 / 256.0,
    -231.0 / 1024.0,
];

/// Returns 1 − 1/√(1 + t) for t in range.
#[inline(always)]
pub(crate) fn rsqrt_series<L: Lanes>(t: L) -> L {
    let [c0, c1, c2, c3, c4, c5] = each!(i in [0, 1, 2, 3, 4, 5] => L::splat(TERMS[i]));
    t * c5
        .mul_add(t, c4)
        .mul_add(t, c3)
        .mul_add(t, c2)
        .mul_add(t, c1)
        .mul_add(t, c0)
}

/// Returns 1 − 1/√(1 + t) for any t.
#[inline(always)]
pub(crate) fn rsqrt_exact<L: Lanes>(t: L) -> L {
    let brief = rsqrt_series(t);
    let beyond = t.abs().gt(L::splat(RANGE));
    if !L::any(beyond) {
        return brief;
    }
    let one = L::splat(1.0);
    L::select(beyond, one - one / (one + t).sqrt(), brief)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{BLOCK, InstructionSet, Kernel, dispatch};

    /// Returns 1 − 1/√(1 + t) without cancellation.
    fn exact(t: f64) -> f64 {
        let root = (1.0 + t).sqrt();
        t / (root * (1.0 + root))
    }

    struct Both([f64; BLOCK]);

    impl Kernel for Both {
        type Output = [[f64; BLOCK]; 2];

        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let mut out = [[0.0; BLOCK]; 2];
            for lane in (0..BLOCK).step_by(L::WIDTH) {
                let t = L::load(&self.0, lane);
                rsqrt_series(t).store(&mut out[0], lane);
                rsqrt_exact(t).store(&mut out[1], lane);
            }
            out
        }
    }

    fn both(t: [f64; BLOCK]) -> [[f64; BLOCK]; 2] {
        dispatch(InstructionSet::in_use(), Both(t))
    }

    #[test]
    fn the_series_is_as_good_as_it_says_anywhere_in_its_range() {
        for i in -1000..=1000 {
            let t = f64::from(i) / 1000.0 * RANGE;
            let off = (both([t; BLOCK])[0][0] - exact(t)).abs();
            assert!(off < 6e-14 && off <= 5e-12 * t.abs(), "{t}: {off:e}");
        }
    }

    #[test]
    fn near_zero_where_most_springs_are_only_rounding_is_off() {
        for i in 1..=1000 {
            let t = 1.0 / 400.0 * f64::from(i) / 1000.0;
            for t in [t, -t, t * 1e-6, -t * 1e-6] {
                let off = (both([t; BLOCK])[0][0] - exact(t)).abs();
                assert!(off <= 4.0 * f64::EPSILON * exact(t).abs(), "{t}: {off:e}");
            }
        }
    }

    #[test]
    fn out_of_range_root_and_division_do_and_only_there() {
        let places = [0.0, 0.01, -0.01, 0.06, -0.5, 3.0, 1e6, -0.05];
        let [brief, careful] = both(places);
        for (i, t) in places.into_iter().enumerate() {
            assert!((careful[i] - exact(t)).abs() < 1e-12, "{t}");
            assert_eq!(careful[i] == brief[i], t.abs() <= RANGE, "{t}");
        }
    }
}
