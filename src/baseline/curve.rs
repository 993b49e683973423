//! Accuracy over size: a parabola through the points, and the size at which it reaches an accuracy.

use crate::base::number;
use crate::base::random::{Purpose, stream};
use crate::base::statistics::resampled_mean;
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The place where a curve reaches a value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Crossing {
    /// It reaches it at this size. A number in JSON.
    At(f64),
    /// It is above the value already at the smallest size. An object in JSON, so that nobody
    /// mistakes the bound for the size.
    Below {
        /// The smallest size.
        below: f64,
    },
}

/// The size in whole neurons or kernels, or a bound, for people.
impl fmt::Display for Crossing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Crossing::At(size) => f.write_str(&number::fixed(*size, 0)),
            Crossing::Below { below } => write!(f, "< {below}"),
        }
    }
}

/// Returns c0, c1, c2 of the least-squares c0 + c1·x + c2·x²; `None` below three different x.
pub(crate) fn parabola(points: &[(f64, f64)]) -> Option<[f64; 3]> {
    let mut xs: Vec<f64> = points.iter().map(|point| point.0).collect();
    xs.sort_by(f64::total_cmp);
    xs.dedup();
    if xs.len() < 3 {
        return None;
    }
    // Fitted to x/largest x: the squares of sizes would spoil the condition of the system.
    let scale = xs.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    let matrix = DMatrix::from_fn(points.len(), 3, |row, power| {
        let x = points[row].0 / scale;
        [1.0, x, x * x][power]
    });
    let values = DVector::from_iterator(points.len(), points.iter().map(|point| point.1));
    let solution = matrix.svd(true, true).solve(&values, 1e-12).ok()?;
    Some([
        solution[0],
        solution[1] / scale,
        solution[2] / (scale * scale),
    ])
}

/// Returns the smallest x in [from, to] at which a parabola reaches a value; `None` if none does.
pub(crate) fn first_crossing(
    [c0, c1, c2]: [f64; 3],
    value: f64,
    (from, to): (f64, f64),
) -> Option<Crossing> {
    let at = |x: f64| c0 + x * (c1 + x * c2);
    if at(from) > value {
        return Some(Crossing::Below { below: from });
    }
    if at(from) == value {
        return Some(Crossing::At(from));
    }
    let c = c0 - value;
    let roots = if c2 == 0.0 {
        [(c1 != 0.0).then(|| -c / c1), None]
    } else {
        let discriminant = c1 * c1 - 4.0 * c2 * c;
        if discriminant < 0.0 {
            return None;
        }
        // The stable form, without cancellation (Press et al., Numerical Recipes, 5.6).
        let q = -0.5 * (c1 + discriminant.sqrt().copysign(c1));
        [Some(q / c2), (q != 0.0).then(|| c / q)]
    };
    let within = roots
        .into_iter()
        .flatten()
        .filter(|root| (from..=to).contains(root));
    within.min_by(f64::total_cmp).map(Crossing::At)
}

/// Returns the parabola through points, sorted by x, and the first x at which it reaches a value.
/// Fewer than three different x have no parabola: the first point that reaches the value counts.
pub(crate) fn fit_and_crossing(
    points: &[(f64, f64)],
    value: f64,
) -> (Option<[f64; 3]>, Option<Crossing>) {
    let within = points
        .first()
        .zip(points.last())
        .map(|(first, last)| (first.0, last.0));
    let fit = parabola(points);
    let crossing = match fit.zip(within) {
        Some((fit, within)) => first_crossing(fit, value, within),
        None => first_of(points, value),
    };
    (fit, crossing)
}

/// Returns a 95 % interval of the crossing of [`fit_and_crossing`]: percentiles over resamples of
/// the values at each x, whose means are the points, and of the values whose mean is to be reached
/// (clusters of values that are not independent). The same every time. A bound is the smallest x
/// where the curve begins above the value, and `None` where it never reaches it. Returns `None` if
/// there is a single value everywhere, so that nothing can be resampled.
pub(crate) fn crossing_interval(
    samples: &[(f64, Vec<f64>)],
    reached: &[Vec<f64>],
) -> Option<[Option<f64>; 2]> {
    // Each resample is fitted anew: ten thousand would take seconds, and move no bound by much.
    const RESAMPLES: usize = 2000;
    let reached: Vec<&Vec<f64>> = reached.iter().filter(|values| !values.is_empty()).collect();
    let is_single = |values: &[f64]| values.len() < 2;
    if reached.is_empty()
        || samples.iter().any(|(_, values)| values.is_empty())
        || samples.iter().all(|(_, values)| is_single(values))
            && is_single(
                &reached
                    .iter()
                    .copied()
                    .flatten()
                    .copied()
                    .collect::<Vec<_>>(),
            )
    {
        return None;
    }
    let mut rng = stream(0, Purpose::Bootstrap, 0, 0);
    let crossing = |_| {
        let points: Vec<(f64, f64)> = samples
            .iter()
            .map(|(x, values)| (*x, resampled_mean(&[values], &mut rng)))
            .collect();
        let value = resampled_mean(&reached, &mut rng);
        match fit_and_crossing(&points, value).1 {
            Some(Crossing::At(x) | Crossing::Below { below: x }) => x,
            None => f64::INFINITY,
        }
    };
    let mut crossings: Vec<f64> = (0..RESAMPLES).map(crossing).collect();
    crossings.sort_by(f64::total_cmp);
    let percentiles = [
        crossings[RESAMPLES * 25 / 1000],
        crossings[RESAMPLES * 975 / 1000 - 1],
    ];
    Some(percentiles.map(|x| x.is_finite().then_some(x)))
}

/// Returns the first x at which a point is at or above a value; `None` if none is.
pub(crate) fn first_of(points: &[(f64, f64)], value: f64) -> Option<Crossing> {
    let place = points.iter().position(|(_, y)| *y >= value)?;
    let (x, y) = points[place];
    Some(if place == 0 && y > value {
        Crossing::Below { below: x }
    } else {
        Crossing::At(x)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_few_points_the_first_that_reaches_a_value_is_told() {
        let points = [(1.0, 0.5), (3.0, 0.7)];
        assert_eq!(first_of(&points, 0.2), Some(Crossing::Below { below: 1.0 }));
        assert_eq!(first_of(&points, 0.5), Some(Crossing::At(1.0)));
        assert_eq!(first_of(&points, 0.6), Some(Crossing::At(3.0)));
        assert_eq!((first_of(&points, 0.8), first_of(&[], 0.1)), (None, None));
    }

    #[test]
    fn the_interval_of_a_crossing_holds_it_and_widens_with_the_spread() {
        // Accuracies on the parabola 0.5 + 0.02·x − 0.0002·x², which is 0.7 at 11.27, ± a spread.
        let samples = |spread: f64| -> Vec<(f64, Vec<f64>)> {
            let at = |x: f64| 0.5 + 0.02 * x - 0.0002 * x * x;
            (1..=45)
                .map(f64::from)
                .map(|x| (x, [-1.0, 0.0, 1.0].map(|k| at(x) + k * spread).to_vec()))
                .collect()
        };
        let interval =
            |spread: f64, value: f64| crossing_interval(&samples(spread), &[vec![value]]).unwrap();
        let width = |spread: f64| {
            let [Some(low), Some(high)] = interval(spread, 0.7) else {
                panic!("a curve that reaches 0.7 has an interval");
            };
            assert!(low < 11.27 && 11.27 < high, "{low} {high}");
            high - low
        };
        assert!(width(0.01) < 0.5 * width(0.05));
        assert_eq!(interval(0.05, 0.7), interval(0.05, 0.7));
        // Robots whose accuracies differ widen it, too.
        let spread = crossing_interval(&samples(0.01), &[vec![0.6, 0.7, 0.8]]).unwrap();
        assert!(spread[1].unwrap() - spread[0].unwrap() > 2.0 * width(0.01));
        // Above all points, and below all of them.
        assert_eq!(interval(0.01, 1.1), [None, None]);
        assert_eq!(interval(0.01, 0.3), [Some(1.0), Some(1.0)]);
        let single: Vec<_> = samples(0.0)
            .into_iter()
            .map(|(x, values)| (x, values[..1].to_vec()))
            .collect();
        assert_eq!(crossing_interval(&single, &[vec![0.7]]), None);
    }

    #[test]
    fn a_parabola_through_points_of_one_is_that_one() {
        let points: Vec<(f64, f64)> = (1..=45)
            .map(f64::from)
            .map(|x| (x, 0.5 + 0.012 * x - 0.0001 * x * x))
            .collect();
        let [c0, c1, c2] = parabola(&points).unwrap();
        assert!(
            (c0 - 0.5).abs() < 1e-12 && (c1 - 0.012).abs() < 1e-13 && (c2 + 0.0001).abs() < 1e-14
        );
        assert_eq!(parabola(&[(1.0, 0.5), (2.0, 0.6), (2.0, 0.7)]), None);
    }

    #[test]
    fn the_fit_leaves_the_least_squares() {
        let points = [(1.0, 0.5), (2.0, 0.65), (3.0, 0.6), (4.0, 0.8), (5.0, 0.75)];
        let fit = parabola(&points).unwrap();
        let squares = |[c0, c1, c2]: [f64; 3]| -> f64 {
            points
                .iter()
                .map(|(x, y)| (c0 + c1 * x + c2 * x * x - y).powi(2))
                .sum()
        };
        for (place, change) in [
            (0, 1e-3),
            (1, 1e-3),
            (2, 1e-3),
            (0, -1e-3),
            (1, -1e-3),
            (2, -1e-3),
        ] {
            let mut other = fit;
            other[place] += change;
            assert!(squares(other) > squares(fit));
        }
    }

    #[test]
    fn the_first_crossing_is_the_smallest_size_that_reaches_the_value() {
        let fit = [0.5, 0.02, -0.0002];
        // 0.02x − 0.0002x² = 0.3: x = 50 − √(2500 − 1500)
        let first = |fit: [f64; 3], value: f64| match first_crossing(fit, value, (1.0, 45.0)) {
            Some(Crossing::At(x)) => x,
            other => panic!("{other:?}"),
        };
        let x = first(fit, 0.8);
        assert!((x - (50.0 - 1000_f64.sqrt())).abs() < 1e-9, "{x}");
        let below = Some(Crossing::Below { below: 3.0 });
        assert_eq!(
            first_crossing(fit, 0.4, (3.0, 45.0)),
            below,
            "the smallest is above it already"
        );
        assert_eq!(
            first([0.5, 0.25, 0.0], 0.75),
            1.0,
            "just reached by the smallest"
        );
        assert_eq!(
            first_crossing(fit, 1.01, (1.0, 45.0)),
            None,
            "above its top"
        );
        assert_eq!(
            first_crossing(fit, 0.997, (1.0, 45.0)),
            None,
            "reached, but beyond the largest size"
        );
        assert_eq!(first([0.5, 0.01, 0.0], 0.6).round(), 10.0);
        assert_eq!(first_crossing([0.5, 0.0, 0.0], 0.6, (1.0, 45.0)), None);
        // A dip, then up again.
        let x = first([0.6, -0.02, 0.001], 0.75);
        assert!((0.6 - 0.02 * x + 0.001 * x * x - 0.75).abs() < 1e-12 && x > 20.0);
    }

    #[test]
    fn what_is_below_the_smallest_size_is_no_number() {
        for (crossing, text, json) in [
            (Some(Crossing::At(16.84)), "17", "16.84"),
            (
                Some(Crossing::Below { below: 1.0 }),
                "< 1",
                "{\"below\":1.0}",
            ),
            (None, "", "null"),
        ] {
            assert_eq!(
                crossing.map_or(String::new(), |crossing| crossing.to_string()),
                text
            );
            assert_eq!(serde_json::to_string(&crossing).unwrap(), json);
            assert_eq!(
                serde_json::from_str::<Option<Crossing>>(json).unwrap(),
                crossing
            );
        }
    }
}
