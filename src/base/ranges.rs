//! Ranges of the numbers in files. A field that names its range, as in `#[serde(deserialize_with =
//! "ranges::share")]`, is checked while it is read, so that the error has its line and key.

use crate::base::error::Error;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The largest magnitude of a number in a file. No simulation comes near it, and no sum, square or
/// mean of such numbers overflows.
pub(crate) const MOST: f64 = 1e50;

const SHARE: RangeInclusive<f64> = 0.0..=1.0;
const SIZE: RangeInclusive<f64> = 0.0..=MOST;
const NUMBER: RangeInclusive<f64> = -MOST..=MOST;

/// A value that holds numbers: one, several or none.
pub(crate) trait Numbers {
    fn outside(&self, range: &RangeInclusive<f64>) -> Option<f64>;
}

impl Numbers for f64 {
    fn outside(&self, range: &RangeInclusive<f64>) -> Option<f64> {
        (!range.contains(self)).then_some(*self)
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn outside(&self, range: &RangeInclusive<f64>) -> Option<f64> {
        self.as_ref()?.outside(range)
    }
}

impl<T: Numbers> Numbers for Vec<T> {
    fn outside(&self, range: &RangeInclusive<f64>) -> Option<f64> {
        self.iter().find_map(|number| number.outside(range))
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn outside(&self, range: &RangeInclusive<f64>) -> Option<f64> {
        self.iter().find_map(|number| number.outside(range))
    }
}

impl<K, T: Numbers> Numbers for BTreeMap<K, T> {
    fn outside(&self, range: &RangeInclusive<f64>) -> Option<f64> {
        self.values().find_map(|number| number.outside(range))
    }
}

/// Reads fractions, from 0 to 1.
pub(crate) fn share<'de, D: Deserializer<'de>, T: Numbers + Deserialize<'de>>(
    from: D,
) -> Result<T, D::Error> {
    read(from, SHARE)
}

/// Reads numbers that are not negative.
pub(crate) fn size<'de, D: Deserializer<'de>, T: Numbers + Deserialize<'de>>(
    from: D,
) -> Result<T, D::Error> {
    read(from, SIZE)
}

pub(crate) fn number<'de, D: Deserializer<'de>, T: Numbers + Deserialize<'de>>(
    from: D,
) -> Result<T, D::Error> {
    read(from, NUMBER)
}

pub(crate) fn at_most_one<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    read(from, -MOST..=1.0)
}

/// Reads an interval of fractions.
pub(crate) fn interval<'de, D, T>(from: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Numbers + Deserialize<'de> + Clone + Into<Option<[f64; 2]>>,
{
    ordered(from, SHARE)
}

/// Reads an interval of fitnesses, from −1 to 1.
pub(crate) fn fitness_interval<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    ordered(from, -1.0..=1.0)
}

fn ordered<'de, D, T>(from: D, range: RangeInclusive<f64>) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Numbers + Deserialize<'de> + Clone + Into<Option<[f64; 2]>>,
{
    let found: T = read(from, range)?;
    match found.clone().into() {
        Some([low, high]) if low > high => Err(serde::de::Error::custom(format!(
            "expected the lower end first, found [{low}, {high}]"
        ))),
        _ => Ok(found),
    }
}

fn read<'de, D: Deserializer<'de>, T: Numbers + Deserialize<'de>>(
    from: D,
    range: RangeInclusive<f64>,
) -> Result<T, D::Error> {
    let found = T::deserialize(from)?;
    match found.outside(&range) {
        None => Ok(found),
        Some(number) => Err(serde::de::Error::custom(refusal(number, &range))),
    }
}

/// Checks a number whose type belongs to another crate; the error names `key`.
pub(crate) fn check(key: &str, number: f64) -> Result<(), Error> {
    match number.outside(&NUMBER) {
        None => Ok(()),
        Some(number) => Err(Error::at_key(key, refusal(number, &NUMBER))),
    }
}

fn refusal(number: f64, range: &RangeInclusive<f64>) -> String {
    let [low, high, number] = [*range.start(), *range.end(), number].map(short);
    format!("expected a number from {low} to {high}, found {number}")
}

/// Formats a number in few characters, however large it is.
fn short(number: f64) -> String {
    if number.abs() < 1e6 {
        number.to_string()
    } else {
        format!("{number:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    #[expect(dead_code, reason = "only read")]
    struct File {
        #[serde(default, deserialize_with = "share")]
        shares: BTreeMap<u8, f64>,
        #[serde(default, deserialize_with = "size")]
        sizes: Vec<Option<f64>>,
        #[serde(default, deserialize_with = "number")]
        number: f64,
        #[serde(default, deserialize_with = "interval")]
        interval: Option<[f64; 2]>,
    }

    #[test]
    fn numbers_outside_their_range_are_refused_with_the_range_and_what_was_found() {
        let error = |text: &str| {
            serde_json::from_str::<File>(text)
                .map(drop)
                .unwrap_err()
                .to_string()
        };
        for (text, expected) in [
            (
                r#"{"shares": {"3": 0.5, "4": 7.5}}"#,
                "expected a number from 0 to 1, found 7.5",
            ),
            (
                r#"{"sizes": [1, null, -2]}"#,
                "expected a number from 0 to 1e50, found -2",
            ),
            (
                r#"{"number": -1e308}"#,
                "expected a number from -1e50 to 1e50, found -1e308",
            ),
            (
                r#"{"interval": [5, -3]}"#,
                "expected a number from 0 to 1, found 5",
            ),
            (
                r#"{"interval": [0.5, 0.25]}"#,
                "expected the lower end first, found [0.5, 0.25]",
            ),
        ] {
            assert!(error(text).contains(expected), "{text}: {}", error(text));
        }
        for text in [
            "{}",
            r#"{"shares": {"3": 0, "4": 1}, "sizes": [0, null], "number": 1e50, "interval": [0.5, 0.5]}"#,
            r#"{"interval": null}"#,
        ] {
            assert!(serde_json::from_str::<File>(text).is_ok(), "{text}");
        }
        assert!(check("a.b", -0.5).is_ok());
        assert_eq!(
            check("a.b", f64::NAN).unwrap_err().key.as_deref(),
            Some("a.b")
        );
    }
}
