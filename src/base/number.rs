//! Numbers for people: tables, labels and messages all format theirs here.

pub(crate) fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// Formats a number with fixed decimals. A value that rounds to 0 has no sign: no −0.00.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    unsigned_zero(format!("{value:.decimals$}"))
}

/// Formats a number as [`fixed`], with a plus if it is positive.
pub(crate) fn signed(value: f64, decimals: usize) -> String {
    unsigned_zero(format!("{value:+.decimals$}"))
}

/// Formats a fraction as a percentage with one decimal.
pub(crate) fn percent(share: f64) -> String {
    fixed(100.0 * share, 1)
}

/// Formats the share of a variance that a model with this R² explains, in percent without decimals.
/// A model with a negative cross-validated R² predicts worse than the mean, and explains nothing.
pub(crate) fn explained(r_squared: f64) -> String {
    fixed(100.0 * r_squared.max(0.0), 0)
}

fn unsigned_zero(text: String) -> String {
    let is_zero = text.chars().all(|c| matches!(c, '+' | '-' | '0' | '.'));
    if is_zero {
        text.trim_start_matches(['+', '-']).to_string()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_explains_less_than_nothing() {
        assert_eq!(
            [-1.03, -0.0, 0.874, 1.0].map(explained),
            ["0", "0", "87", "100"]
        );
    }

    #[test]
    fn what_rounds_to_nothing_has_no_sign() {
        for value in [-0.0, 0.0, -0.004, 0.004, -f64::MIN_POSITIVE] {
            assert_eq!(
                (fixed(value, 2), signed(value, 2)),
                ("0.00".to_string(), "0.00".to_string())
            );
        }
        assert_eq!(
            (fixed(-0.4, 0), signed(-0.4, 0), percent(-0.0004)),
            ("0".into(), "0".into(), "0.0".into())
        );
        assert_eq!(
            (fixed(-0.006, 2), signed(-0.006, 2)),
            ("-0.01".to_string(), "-0.01".to_string())
        );
        assert_eq!(
            (fixed(1.25, 1), signed(1.26, 1)),
            ("1.2".to_string(), "+1.3".to_string())
        );
        assert_eq!(
            (fixed(f64::NAN, 2), signed(-f64::INFINITY, 1)),
            ("NaN".to_string(), "-inf".to_string())
        );
    }
}
