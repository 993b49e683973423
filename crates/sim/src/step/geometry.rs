//! Plane geometry of contacts: points in voxels, crossing segments.

use std::ops::{Add, Div, Mul, Sub};

/// A point or direction in the plane \[wu\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vector {
    pub x: f64,
    pub y: f64,
}

impl Vector {
    pub const ZERO: Vector = Vector::new(0.0, 0.0);

    #[inline]
    pub const fn new(x: f64, y: f64) -> Self {
        Vector { x, y }
    }

    #[inline]
    pub fn dot(self, other: Vector) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// Returns the cross product.
    #[inline]
    pub fn perp(self, other: Vector) -> f64 {
        self.x * other.y - self.y * other.x
    }

    #[inline]
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }
}

impl Add for Vector {
    type Output = Vector;
    #[inline]
    fn add(self, other: Vector) -> Vector {
        Vector::new(self.x + other.x, self.y + other.y)
    }
}

impl Sub for Vector {
    type Output = Vector;
    #[inline]
    fn sub(self, other: Vector) -> Vector {
        Vector::new(self.x - other.x, self.y - other.y)
    }
}

impl Mul<f64> for Vector {
    type Output = Vector;
    #[inline]
    fn mul(self, factor: f64) -> Vector {
        Vector::new(self.x * factor, self.y * factor)
    }
}

impl Div<f64> for Vector {
    type Output = Vector;
    #[inline]
    fn div(self, divisor: f64) -> Vector {
        Vector::new(self.x / divisor, self.y / divisor)
    }
}

/// Axis-parallel bounding box \[wu\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub low: Vector,
    pub high: Vector,
}

impl Bounds {
    #[inline]
    pub fn of(quad: &[Vector; 4]) -> Self {
        // Plain comparisons: one instruction each, unlike `f64::min`, which handles NaN.
        let low = |a: f64, b: f64| if a < b { a } else { b };
        let high = |a: f64, b: f64| if a > b { a } else { b };
        let [a, b, c, d] = quad;
        let of = |f: fn(f64, f64) -> f64| {
            Vector::new(f(f(a.x, b.x), f(c.x, d.x)), f(f(a.y, b.y), f(c.y, d.y)))
        };
        Bounds {
            low: of(low),
            high: of(high),
        }
    }

    /// Returns true if the boxes overlap when each gap may be up to `slack`; touching counts.
    #[inline]
    pub fn near(&self, other: &Bounds, slack: f64) -> bool {
        self.low.x <= other.high.x + slack
            && other.low.x <= self.high.x + slack
            && self.low.y <= other.high.y + slack
            && other.low.y <= self.high.y + slack
    }

    /// Returns true if a point lies in the box widened by `slack`.
    #[inline]
    pub fn holds(&self, point: Vector, slack: f64) -> bool {
        self.low.x <= point.x + slack
            && point.x <= self.high.x + slack
            && self.low.y <= point.y + slack
            && point.y <= self.high.y + slack
    }
}

/// Returns true if `p` lies in the quad (corners clockwise from the top left), boundary included.
/// The quad is split into the triangles TL-TR-BR and TL-BR-BL (physics.md, "Contacts").
#[inline]
pub(crate) fn inside(p: Vector, quad: &[Vector; 4]) -> bool {
    let [tl, tr, br, bl] = quad.map(|corner| corner - p);
    let (a, b, c) = (tl.perp(tr), tr.perp(br), br.perp(tl));
    if c * a >= 0.0 && c * b >= 0.0 {
        return true;
    }
    let (d, e) = (tl.perp(bl), bl.perp(br));
    c * d >= 0.0 && c * e >= 0.0
}

/// True if segments cross, ends included; parallels (cross product below `epsilon`) never do.
#[inline]
pub(crate) fn cross(a: Vector, b: Vector, p: Vector, q: Vector, epsilon: f64) -> bool {
    let (r, s, w) = (b - a, q - p, p - a);
    let product = r.perp(s);
    if product.abs() < epsilon {
        return false;
    }
    let (along_ab, along_pq) = (w.perp(s) / product, w.perp(r) / product);
    (0.0..=1.0).contains(&along_ab) && (0.0..=1.0).contains(&along_pq)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> [Vector; 4] {
        [(0.0, 0.1), (0.1, 0.1), (0.1, 0.0), (0.0, 0.0)].map(|(x, y)| Vector::new(x, y))
    }

    #[test]
    fn the_boundary_is_inside() {
        let quad = square();
        for p in [
            (0.05, 0.05),
            (0.0, 0.0),
            (0.1, 0.1),
            (0.05, 0.1),
            (0.0, 0.03),
            (0.07, 0.02),
            (0.02, 0.07),
        ] {
            assert!(inside(Vector::new(p.0, p.1), &quad), "{p:?}");
        }
        for p in [
            (0.05, 0.1001),
            (-0.001, 0.05),
            (0.1001, 0.05),
            (0.05, -0.001),
            (0.2, 0.2),
        ] {
            assert!(!inside(Vector::new(p.0, p.1), &quad), "{p:?}");
        }
    }

    #[test]
    fn segments_cross_at_their_ends_too_and_parallels_never() {
        let v = Vector::new;
        let crosses = |a: (f64, f64), b: (f64, f64), p: (f64, f64), q: (f64, f64)| {
            cross(v(a.0, a.1), v(b.0, b.1), v(p.0, p.1), v(q.0, q.1), 1e-4)
        };
        assert!(crosses((0.0, 0.0), (0.1, 0.0), (0.05, -0.1), (0.05, 0.1)));
        assert!(crosses((0.0, 0.0), (0.1, 0.0), (0.1, 0.0), (0.1, 0.1)));
        assert!(crosses((0.3, 0.1), (0.3, 0.2), (0.3, 0.2), (0.4, 0.2)));
        assert!(!crosses((0.0, 0.0), (0.1, 0.0), (0.11, -0.1), (0.11, 0.1)));
        assert!(!crosses((0.0, 0.0), (0.1, 0.0), (0.0, 0.0), (0.1, 0.0)));
        // Short segments count as parallel: the limit is on the raw product, not on the angle.
        assert!(!crosses(
            (0.0, 0.0),
            (0.009, 0.0),
            (0.005, -0.005),
            (0.005, 0.005)
        ));
    }
}
