//! Accuracy over size: a parabola through the points, and the size at which it reaches an accuracy.

use nalgebra::{DMatrix, DVector};

/// c0, c1, c2 of the least-squares parabola c0 + c1·x + c2·x² through points; `None` of fewer than three different x.
pub fn parabola(points: &[(f64, f64)]) -> Option<[f64; 3]> {
    let mut xs: Vec<f64> = points.iter().map(|point| point.0).collect();
    xs.sort_by(f64::total_cmp);
    xs.dedup();
    if xs.len() < 3 {
        return None;
    }
    // Of x/largest x: the squares of sizes would spoil the condition of the system.
    let scale = xs.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    let matrix = DMatrix::from_fn(points.len(), 3, |row, power| {
        let x = points[row].0 / scale;
        [1.0, x, x * x][power]
    });
    let values = DVector::from_iterator(points.len(), points.iter().map(|point| point.1));
    let solution = matrix.svd(true, true).solve(&values, 1e-12).ok()?;
    Some([solution[0], solution[1] / scale, solution[2] / (scale * scale)])
}

/// The smallest x in [from, to] at which a parabola reaches a value: where it is at or above it first. `None` if it
/// never is.
pub fn first_crossing([c0, c1, c2]: [f64; 3], value: f64, (from, to): (f64, f64)) -> Option<f64> {
    let at = |x: f64| c0 + x * (c1 + x * c2);
    if at(from) >= value {
        return Some(from);
    }
    let c = c0 - value;
    let roots = if c2 == 0.0 {
        [(c1 != 0.0).then(|| -c / c1), None]
    } else {
        let discriminant = c1 * c1 - 4.0 * c2 * c;
        if discriminant < 0.0 {
            return None;
        }
        // The stable form: no difference of nearly equal numbers (Press et al., Numerical Recipes, 5.6).
        let q = -0.5 * (c1 + discriminant.sqrt().copysign(c1));
        [Some(q / c2), (q != 0.0).then(|| c / q)]
    };
    let within = roots.into_iter().flatten().filter(|root| (from..=to).contains(root));
    within.min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_through_points_of_one_is_that_one() {
        let points: Vec<(f64, f64)> =
            (1..=45).map(f64::from).map(|x| (x, 0.5 + 0.012 * x - 0.0001 * x * x)).collect();
        let [c0, c1, c2] = parabola(&points).unwrap();
        assert!((c0 - 0.5).abs() < 1e-12 && (c1 - 0.012).abs() < 1e-13 && (c2 + 0.0001).abs() < 1e-14);
        assert_eq!(parabola(&[(1.0, 0.5), (2.0, 0.6), (2.0, 0.7)]), None);
    }

    #[test]
    fn the_fit_leaves_the_least_squares() {
        let points = [(1.0, 0.5), (2.0, 0.65), (3.0, 0.6), (4.0, 0.8), (5.0, 0.75)];
        let fit = parabola(&points).unwrap();
        let squares = |[c0, c1, c2]: [f64; 3]| -> f64 {
            points.iter().map(|(x, y)| (c0 + c1 * x + c2 * x * x - y).powi(2)).sum()
        };
        for (place, change) in [(0, 1e-3), (1, 1e-3), (2, 1e-3), (0, -1e-3), (1, -1e-3), (2, -1e-3)] {
            let mut other = fit;
            other[place] += change;
            assert!(squares(other) > squares(fit));
        }
    }

    #[test]
    fn the_first_crossing_is_the_smallest_size_that_reaches_the_value() {
        let fit = [0.5, 0.02, -0.0002];
        // 0.02x − 0.0002x² = 0.3: x = 50 − √(2500 − 1500)
        let x = first_crossing(fit, 0.8, (1.0, 45.0)).unwrap();
        assert!((x - (50.0 - 1000_f64.sqrt())).abs() < 1e-9, "{x}");
        assert_eq!(first_crossing(fit, 0.4, (1.0, 45.0)), Some(1.0), "already the smallest");
        assert_eq!(first_crossing(fit, 1.01, (1.0, 45.0)), None, "above its top");
        assert_eq!(first_crossing(fit, 0.997, (1.0, 45.0)), None, "reached, but beyond the largest size");
        assert_eq!(first_crossing([0.5, 0.01, 0.0], 0.6, (1.0, 45.0)).map(f64::round), Some(10.0));
        assert_eq!(first_crossing([0.5, 0.0, 0.0], 0.6, (1.0, 45.0)), None);
        // A dip, then up again.
        let x = first_crossing([0.7, -0.02, 0.001], 0.75, (1.0, 45.0)).unwrap();
        assert!((0.7 - 0.02 * x + 0.001 * x * x - 0.75).abs() < 1e-12 && x > 20.0);
    }
}
