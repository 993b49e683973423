//! [`Function`]: the function of a CPPN node.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The function of a node, of the weighted sum s of its predecessors (paper, "Genome").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub(crate) enum Function {
    /// 2 / (1 + e^−s) − 1, in (−1, 1); outputs only.
    Squash = 0,
    /// sin s.
    Sin = 1,
    /// |s|.
    Abs = 2,
    /// s².
    Square = 3,
    /// √|s|.
    Sqrt = 4,
    /// −|s|.
    NegAbs = 5,
    /// −s².
    NegSquare = 6,
    /// −√|s|.
    NegSqrt = 7,
}

/// Largest absolute value of a node. Chains of squares would overflow to infinities, whose
/// differences are NaN; no sum of values this large does.
const LIMIT: f64 = 1e100;

impl Function {
    /// All functions, the output's squash first.
    pub(crate) const ALL: [Function; 8] = [
        Function::Squash,
        Function::Sin,
        Function::Abs,
        Function::Square,
        Function::Sqrt,
        Function::NegAbs,
        Function::NegSquare,
        Function::NegSqrt,
    ];

    /// Returns the functions allowed in a hidden node: all but squash.
    pub(crate) fn for_hidden() -> &'static [Function] {
        &Self::ALL[1..]
    }

    /// Replaces every sum by the function's value, at most 10¹⁰⁰ in size; NaN becomes 0.
    pub(crate) fn apply(self, sums: &mut [f64]) {
        match self {
            Function::Squash => each(sums, |s| 2.0 / (1.0 + libm::exp(-s)) - 1.0),
            Function::Sin => each(sums, libm::sin),
            Function::Abs => each(sums, f64::abs),
            Function::Square => each(sums, |s| s * s),
            Function::Sqrt => each(sums, |s| s.abs().sqrt()),
            Function::NegAbs => each(sums, |s| -s.abs()),
            Function::NegSquare => each(sums, |s| -(s * s)),
            Function::NegSqrt => each(sums, |s| -s.abs().sqrt()),
        }
    }
}

fn each(sums: &mut [f64], function: impl Fn(f64) -> f64) {
    for s in sums {
        let value = function(*s);
        *s = if value.is_nan() {
            0.0
        } else {
            value.clamp(-LIMIT, LIMIT)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(function: Function, s: f64) -> f64 {
        let mut sums = [s];
        function.apply(&mut sums);
        sums[0]
    }

    #[test]
    fn functions_are_the_papers() {
        let values: Vec<f64> = Function::ALL.iter().map(|f| at(*f, -4.0)).collect();
        let squash = 2.0 / (1.0 + 4f64.exp()) - 1.0;
        let expected = [squash, (-4f64).sin(), 4.0, 16.0, 2.0, -4.0, -16.0, -2.0];
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-15, "{values:?}");
        }
    }

    #[test]
    fn squash_is_odd_and_saturates() {
        assert_eq!(at(Function::Squash, 0.0), 0.0);
        assert_eq!(
            (at(Function::Squash, 1e100), at(Function::Squash, -1e100)),
            (1.0, -1.0)
        );
    }

    #[test]
    fn values_stay_finite_whatever_comes_in() {
        for s in [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            1e200,
        ] {
            for function in Function::ALL {
                let value = at(function, s);
                assert!(
                    value.is_finite() && value.abs() <= LIMIT,
                    "{function:?}({s}) = {value}"
                );
            }
        }
    }

    #[test]
    fn names_in_files_are_snake_case() {
        let text = serde_json::to_string(&Function::ALL).unwrap();
        let names = r#"["squash","sin","abs","square","sqrt","neg_abs","neg_square","neg_sqrt"]"#;
        assert_eq!(text, names);
    }
}
