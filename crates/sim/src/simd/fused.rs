//! Products and sums rounded once, on any machine.

use super::each;

/// Whether the target has an instruction for it: then the compiler uses that for [`f64::mul_add`],
/// else it calls a function that is slow.
const NATIVE: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

/// a · b + c, rounded once.
#[inline(always)]
pub(super) fn mul_add(a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
    if NATIVE {
        return each!(i in [0, 1, 2, 3] => a[i].mul_add(b[i], c[i]));
    }
    let ordinary = each!(i in [0, 1, 2, 3] => is_ordinary(a[i], b[i], c[i]));
    if ordinary == [true; 4] {
        each!(i in [0, 1, 2, 3] => emulated(a[i], b[i], c[i]))
    } else {
        extraordinary(a, b, c)
    }
}

/// Whether nothing in [`emulated`] overflows or underflows.
#[inline(always)]
fn is_ordinary(a: f64, b: f64, c: f64) -> bool {
    const LARGE: f64 = 1e150;
    const SMALL: f64 = 1e-250;
    let product = (a * b).abs();
    (a.abs() < LARGE) & (b.abs() < LARGE) & (c.abs() < LARGE) & ((product > SMALL) | (a == 0.0) | (b == 0.0))
}

#[cold]
#[inline(never)]
fn extraordinary(a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
    each!(i in [0, 1, 2, 3] => a[i].mul_add(b[i], c[i]))
}

/// Boldo and Melquiond (2008), "Emulation of a FMA and correctly rounded sums: proved algorithms
/// using rounding to odd".
#[inline(always)]
fn emulated(a: f64, b: f64, c: f64) -> f64 {
    let (product, rest) = exact_product(a, b);
    let (low, lowest) = exact_sum(c, rest);
    let (high, middle) = exact_sum(product, low);
    let result = high + sum_to_odd(lowest, middle);
    // Of nothing the sign is right only in the plain sum.
    if product == 0.0 { product + c } else { result }
}

/// Both halves of a sum: rounded, and what rounding took away (Knuth).
#[inline(always)]
fn exact_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// Both halves of a product (Dekker).
#[inline(always)]
fn exact_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let wide = 134_217_729.0 * x;
        let high = wide - (wide - x);
        (high, x - high)
    };
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    let product = a * b;
    (product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low)
}

/// a + b; if that is inexact, the neighbour with an odd last bit.
#[inline(always)]
fn sum_to_odd(a: f64, b: f64) -> f64 {
    let (sum, rest) = exact_sum(a, b);
    let bits = sum.to_bits();
    let inexact_and_even = (rest != 0.0) & (bits & 1 == 0);
    let outwards = (rest > 0.0) == (sum > 0.0);
    let step = if outwards { 1 } else { u64::MAX };
    f64::from_bits(bits.wrapping_add(if inexact_and_even { step } else { 0 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn close(scale: i32) -> impl Strategy<Value = f64> {
        (any::<i64>(), -scale..scale).prop_map(|(digits, power)| digits as f64 * 2f64.powi(power - 62))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn emulation_is_exact(a in close(60), b in close(60), c in close(120), near in -3i32..3) {
            prop_assert_eq!(emulated(a, b, c).to_bits(), a.mul_add(b, c).to_bits());
            // Where nearly all cancels, and half-way cases.
            let c = f64::from_bits((-a * b).to_bits().wrapping_add_signed(near.into()));
            prop_assert_eq!(emulated(a, b, c).to_bits(), a.mul_add(b, c).to_bits());
            let short = (a * b) as f32 as f64;
            prop_assert_eq!(emulated(short, 1.0, c * 1e-16).to_bits(), short.mul_add(1.0, c * 1e-16).to_bits());
        }

        #[test]
        fn anything_is_exact(a in any::<[u64; 4]>(), b in any::<[u64; 4]>(), c in any::<[u64; 4]>()) {
            let [a, b, c] = [a, b, c].map(|bits| bits.map(f64::from_bits));
            for (i, fused) in mul_add(a, b, c).into_iter().enumerate() {
                let expected = a[i].mul_add(b[i], c[i]);
                prop_assert!(fused.to_bits() == expected.to_bits() || fused.is_nan() && expected.is_nan());
            }
        }
    }

    #[test]
    fn nothing_keeps_its_sign() {
        for a in [0.0, -0.0, 1.0, -1.0] {
            for b in [0.0, -0.0, 1.0, -1.0] {
                for c in [0.0, -0.0, 1.0, -1.0] {
                    assert_eq!(mul_add([a; 4], [b; 4], [c; 4])[3].to_bits(), a.mul_add(b, c).to_bits());
                }
            }
        }
    }
}
