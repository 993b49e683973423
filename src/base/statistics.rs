//! Spreads and intervals.

use crate::base::random::{Purpose, Stream, stream};

/// Returns the 95 % Wilson score interval of a proportion (Wilson 1927).
pub(crate) fn wilson(right: usize, total: usize) -> [f64; 2] {
    const Z: f64 = 1.959_963_984_540_054;
    if total == 0 {
        return [0.0, 1.0];
    }
    let n = total as f64;
    let share = right as f64 / n;
    let centre = share + Z * Z / (2.0 * n);
    let spread = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    // With none or all right the bounds are exactly 0 and 1, which rounding would miss.
    let low = if right == 0 {
        0.0
    } else {
        ((centre - spread) / scale).max(0.0)
    };
    let high = if right == total {
        1.0
    } else {
        ((centre + spread) / scale).min(1.0)
    };
    [low, high]
}

/// Returns the standard deviation of a sample; none for fewer than two values.
pub(crate) fn standard_deviation(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares = values
        .iter()
        .map(|value| (value - mean) * (value - mean))
        .sum::<f64>();
    (values.len() > 1).then(|| (squares / (n - 1.0)).sqrt())
}

/// Draws a resample of all values and returns its mean. With several clusters, clusters are drawn
/// first, then as many values within each. No cluster may be empty.
pub(crate) fn resampled_mean(clusters: &[&Vec<f64>], rng: &mut Stream) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for _ in 0..clusters.len() {
        // A single cluster needs no draw.
        let place = if clusters.len() == 1 {
            0
        } else {
            rng.below(clusters.len())
        };
        let values = clusters[place];
        sum += (0..values.len())
            .map(|_| values[rng.below(values.len())])
            .sum::<f64>();
        count += values.len();
    }
    sum / count as f64
}

/// Returns a 95 % interval of the mean of all values: percentiles of the means of resamples (Efron
/// 1979), the same every time. Values of one cluster, such as the robots of one run, are not
/// independent. With several clusters, clusters are drawn first, then as many values within each
/// (Davison & Hinkley 1997, section 3.8). None for fewer than two values.
pub(crate) fn bootstrap(clusters: &[Vec<f64>]) -> Option<[f64; 2]> {
    const RESAMPLES: usize = 10_000;
    let clusters: Vec<&Vec<f64>> = clusters
        .iter()
        .filter(|values| !values.is_empty())
        .collect();
    if clusters.iter().map(|values| values.len()).sum::<usize>() < 2 {
        return None;
    }
    let mut rng = stream(0, Purpose::Bootstrap, 0, 0);
    let mean = |_| resampled_mean(&clusters, &mut rng);
    let mut means: Vec<f64> = (0..RESAMPLES).map(mean).collect();
    means.sort_by(f64::total_cmp);
    Some([
        means[RESAMPLES * 25 / 1000],
        means[RESAMPLES * 975 / 1000 - 1],
    ])
}

/// Returns the two-sided p-value of McNemar's exact test: of trials that only one of two subjects
/// passed, `first` and `second` of them, each would be either one's with a probability of one half.
pub(crate) fn mcnemar(first: usize, second: usize) -> f64 {
    let discordant = (first + second) as f64;
    let log_factorial = |count: f64| libm::lgamma(count + 1.0);
    // Logarithms, since 2ⁿ overflows with a thousand trials.
    let probability = |count: usize| {
        let count = count as f64;
        let ways =
            log_factorial(discordant) - log_factorial(count) - log_factorial(discordant - count);
        libm::exp(ways - discordant * std::f64::consts::LN_2)
    };
    let tail: f64 = (0..=first.min(second)).map(probability).sum();
    (2.0 * tail).min(1.0)
}

/// Adjusts the p-values of several tests, so that the probability of any false positive among them
/// stays below the level of one (Holm 1979).
pub(crate) fn holm(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut adjusted = vec![1.0; values.len()];
    let mut least = 0.0_f64;
    for (rank, place) in order.into_iter().enumerate() {
        least = least.max((values.len() - rank) as f64 * values[place]);
        adjusted[place] = least.min(1.0);
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::{bootstrap, holm, mcnemar, standard_deviation, wilson};

    #[test]
    fn the_exact_test_is_the_textbooks_and_does_not_overflow() {
        // 2·(1 + 10)/2¹⁰ of one against nine; 2/2⁵ of none against five.
        for (found, expected) in [
            (mcnemar(1, 9), 0.021_484_375),
            (mcnemar(9, 1), 0.021_484_375),
            (mcnemar(0, 5), 0.0625),
            (mcnemar(4, 4), 1.0),
            (mcnemar(0, 0), 1.0),
        ] {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        // The normal approximation with its correction for continuity: z = 199/√4000, p = 0.0017.
        let many = mcnemar(1900, 2100);
        assert!((0.0016..0.0018).contains(&many), "{many}");
    }

    #[test]
    fn several_tests_are_adjusted_as_holm_does() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.9]);
        for (found, expected) in adjusted.into_iter().zip([0.04, 0.09, 0.09, 0.9]) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert_eq!((holm(&[0.03]), holm(&[])), (vec![0.03], vec![]));
    }

    #[test]
    fn means_have_a_spread_and_an_interval_that_holds_them() {
        let values = [0.5, 0.6, 0.7, 0.8, 0.9];
        // √(0.1/4)
        assert!((standard_deviation(&values).unwrap() - 0.158_113_883).abs() < 1e-9);
        let values = [values.to_vec()];
        let [low, high] = bootstrap(&values).unwrap();
        // The normal approximation: 0.7 ± 1.96·0.1414/√5.
        assert!(
            (low - 0.576).abs() < 0.02 && (high - 0.824).abs() < 0.02,
            "{low} {high}"
        );
        assert_eq!(bootstrap(&values), bootstrap(&values));
        assert_eq!(
            (standard_deviation(&[0.5]), bootstrap(&[vec![0.5]])),
            (None, None)
        );
    }

    #[test]
    fn values_of_one_cluster_do_not_count_as_independent() {
        let width = |clusters: &[Vec<f64>]| {
            let [low, high] = bootstrap(clusters).unwrap();
            high - low
        };
        // Clusters that differ, values that do not: as wide as one value of each.
        let alike: Vec<Vec<f64>> = [0.5, 0.6, 0.7, 0.8, 0.9]
            .map(|value| vec![value; 10])
            .to_vec();
        let single: Vec<Vec<f64>> = [0.5, 0.6, 0.7, 0.8, 0.9].map(|value| vec![value]).to_vec();
        assert!((width(&alike) - width(&single)).abs() < 0.02);
        assert!(width(&alike) > 2.5 * width(&[alike.concat()]));
        // Values that differ, clusters that do not: no narrower than without clusters.
        let mixed = vec![vec![0.5, 0.6, 0.7, 0.8, 0.9]; 5];
        assert!(width(&mixed) > 0.95 * width(&[mixed.concat()]));
    }

    #[test]
    fn the_wilson_interval_is_the_textbooks() {
        // 8 of 10: 0.4902 to 0.9433 (Brown, Cai & DasGupta 2001 use the same formula).
        let [low, high] = wilson(8, 10);
        assert!(
            (low - 0.4902).abs() < 5e-5 && (high - 0.9433).abs() < 5e-5,
            "{low} {high}"
        );
        assert!(wilson(0, 50)[0] < 1e-15 && wilson(50, 50)[1] > 1.0 - 1e-15);
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
    }
}
