//! Measurements of a robot's points: centre, orientation, area and sight.

use crate::evogym::worlds::Object;

/// EvoGym's π, of orientations only.
#[expect(clippy::approx_constant, reason = "the digits that EvoGym has")]
const PI: f64 = 3.1415926;
/// The cosine that stands for one that rounding has made larger than 1.
const ALMOST: f64 = 0.99999;
/// Products of distances from the centre below which a point has no direction \[wu²\].
const NEAR: f64 = 1e-7;

/// Returns the mean of some points, summed in order.
pub(crate) fn centre(points: impl ExactSizeIterator<Item = [f64; 2]>) -> [f64; 2] {
    let count = points.len() as f64;
    let [x, y] = points.fold([0.0; 2], |[x, y], point| [x + point[0], y + point[1]]);
    [x / count, y / count]
}

/// Returns the mean of some points, summed in EvoGym's order of its orientation. At rest, only
/// rounding decides the orientation, so the order matters.
fn centre_in_groups(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|axis| {
        let (first, others) = points
            .split_first()
            .map_or((0.0, points), |(p, o)| (p[axis], o));
        let (groups, rest) = others.as_chunks::<4>();
        let sum = groups.iter().fold(first, |sum, [a, b, c, d]| {
            sum + ((a[axis] + b[axis]) + (c[axis] + d[axis]))
        });
        rest.iter().fold(sum, |sum, point| sum + point[axis]) / points.len() as f64
    })
}

/// Returns the directions and distances of points from their centre; of the centre itself, 0.
fn rays(points: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], f64)> + '_ {
    let [cx, cy] = centre_in_groups(points);
    points.iter().map(move |[x, y]| {
        let (x, y) = (x - cx, y - cy);
        let length = (x * x + y * y).sqrt();
        match length > 0.0 {
            true => ([x / length, y / length], length),
            false => ([0.0; 2], length),
        }
    })
}

/// The undeformed robot, against which orientations are measured.
#[derive(Clone, Debug)]
pub(crate) struct Rest(Vec<([f64; 2], f64)>);

impl Rest {
    pub(crate) fn new(points: &[[f64; 2]]) -> Self {
        Rest(rays(points).collect())
    }

    /// Returns the orientation of points, 0 to 2π, counter-clockwise: the mean of their angles
    /// without signs, weighted by their distances at rest, and a common sign.
    pub(crate) fn orientation(&self, points: &[[f64; 2]]) -> f64 {
        let (mut angles, mut weights, mut turn) = (0.0, 0.0, 0.0);
        for (([px, py], now), ([sx, sy], then)) in rays(points).zip(self.0.iter().copied()) {
            let cosine = match px * sx + py * sy {
                _ if now * then < NEAR => ALMOST,
                over if over > 1.0 => ALMOST,
                under if under < -1.0 => -ALMOST,
                cosine => cosine,
            };
            angles += libm::acos(cosine) * then;
            weights += then;
            turn += px * sy - py * sx;
        }
        let angle = angles / weights;
        if turn > 0.0 { 2.0 * PI - angle } else { angle }
    }
}

/// Returns the area of the convex hull of some points.
pub(crate) fn hull_area(points: &[[f64; 2]]) -> f64 {
    let mut sorted = points.to_vec();
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn = |[ax, ay]: [f64; 2], [bx, by]: [f64; 2], [cx, cy]: [f64; 2]| {
        (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    };
    // The lower side from left to right, then the upper one back.
    let mut hull: Vec<[f64; 2]> = Vec::with_capacity(sorted.len() + 1);
    let add = |point: [f64; 2], least: usize, hull: &mut Vec<[f64; 2]>| {
        while let [.., a, b] = hull[..]
            && hull.len() > least
            && turn(a, b, point) <= 0.0
        {
            hull.pop();
        }
        hull.push(point);
    };
    sorted.iter().for_each(|point| add(*point, 1, &mut hull));
    let lower = hull.len();
    sorted
        .iter()
        .rev()
        .skip(1)
        .for_each(|point| add(*point, lower, &mut hull));
    let Some(&[ox, oy]) = hull.first() else {
        return 0.0;
    };
    // From the first point: differences of large numbers would lose digits.
    let crossed = hull.windows(2).map(|side| {
        let [[ax, ay], [bx, by]] = [side[0], side[1]].map(|[x, y]| [x - ox, y - oy]);
        ax * by - bx * ay
    });
    crossed.sum::<f64>() / 2.0
}

/// Returns the extent of some points along an axis.
pub(crate) fn extent(points: &[[f64; 2]], axis: usize) -> f64 {
    let along = || points.iter().map(|point| point[axis]);
    along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
}

/// Corners of ground, by column \[voxel lengths\].
#[derive(Clone, Debug)]
pub(crate) struct Sight(Vec<(f64, Vec<f64>)>);

impl Sight {
    pub(crate) fn new<'a>(objects: impl IntoIterator<Item = &'a Object>) -> Self {
        let mut columns: Vec<(f64, Vec<f64>)> = Vec::new();
        for object in objects {
            // Columns of several objects may differ in the last bit.
            let first = columns.len();
            let width = object.cells.first().map_or(0, Vec::len);
            columns
                .extend((0..=width).map(|right| (object.place((right, 0))[0] / 0.1, Vec::new())));
            for (right, down) in object.corners() {
                let y = object.place((right, down))[1] / 0.1;
                columns[first + right].1.push(y);
            }
        }
        Sight(columns)
    }

    /// Returns 2·`distance` + 1 free heights \[wu\] below or above a place \[voxel lengths\], from left
    /// to right.
    pub(crate) fn heights(
        &self,
        [x, y]: [f64; 2],
        distance: u32,
        range: f64,
        above: bool,
    ) -> impl Iterator<Item = f64> {
        let distance = i64::from(distance);
        (-distance..=distance).map(move |step| {
            let (left, right) = (x + step as f64 - 0.5, x + step as f64 + 0.5);
            let seen = self.0.iter().filter(|(column, _)| {
                left < *column && *column < right && (column - x).abs() < distance as f64 + 0.5
            });
            let heights = seen.flat_map(|(_, corners)| corners).filter_map(|corner| {
                let is_there = if above { *corner > y } else { *corner < y };
                is_there.then(|| if above { corner - y } else { y - corner })
            });
            heights.fold(range, f64::min).clamp(0.0, range) * 0.1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_is_that_of_the_outermost_points() {
        let square = [
            [1.0, 1.0],
            [3.0, 1.0],
            [2.0, 1.5],
            [2.0, 1.0],
            [1.0, 4.0],
            [3.0, 4.0],
        ];
        assert_eq!(hull_area(&square), 6.0);
        assert_eq!(hull_area(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), 0.0);
        assert_eq!(hull_area(&[[0.5, 0.5]]), 0.0);
        assert_eq!((extent(&square, 0), extent(&square, 1)), (2.0, 3.0));
    }

    #[test]
    fn orientations_grow_counter_clockwise() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let rest = Rest::new(&square);
        for quarter in 1..4 {
            let turned: Vec<_> = (0..4).map(|k| square[(k + quarter) % 4]).collect();
            let found = rest.orientation(&turned);
            // Half a turn's cosine may round beyond -1.
            assert!(
                (found - quarter as f64 * PI / 2.0).abs() < 5e-3,
                "{quarter} {found}"
            );
        }
    }

    #[test]
    fn corners_beside_the_centre_are_seen_up_to_its_height() {
        let step = Object {
            name: "step",
            column: 0,
            row: 0,
            cells: vec![vec![false, true], vec![true, true]],
        };
        let sight = Sight::new([&step]);
        let heights = |y, above| -> Vec<f64> {
            let heights = sight.heights([0.9, y], 1, 5.0, above);
            heights
                .map(|height| (height * 100.0).round() / 10.0)
                .collect()
        };
        assert_eq!(heights(2.5, false), [1.5, 0.5, 0.5]);
        assert_eq!(heights(1.5, false), [0.5, 0.5, 0.5]);
        assert_eq!(heights(1.5, true), [5.0, 0.5, 0.5]);
        assert_eq!(heights(0.0, false), [5.0; 3]);
    }
}
