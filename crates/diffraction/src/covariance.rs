//! Covariances in the plane.

use glam::DVec2;

/// The symmetric covariance of a two-dimensional Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Covariance {
    /// Variance along x.
    pub xx: f64,
    /// Covariance.
    pub xy: f64,
    /// Variance along y.
    pub yy: f64,
}

impl Covariance {
    /// Returns the covariance of a step along a vector with unit variance.
    pub fn along(v: DVec2) -> Self {
        Self { xx: v.x * v.x, xy: v.x * v.y, yy: v.y * v.y }
    }

    /// Returns the sum of the two.
    pub fn plus(self, other: Self) -> Self {
        Self { xx: self.xx + other.xx, xy: self.xy + other.xy, yy: self.yy + other.yy }
    }

    /// Returns the covariance after the linear map that takes the steps along x and y to these.
    #[inline]
    pub fn mapped(self, x: DVec2, y: DVec2) -> Self {
        let (from_x, from_y) = (x * self.xx + y * self.xy, x * self.xy + y * self.yy);
        Self {
            xx: x.x * from_x.x + y.x * from_y.x,
            xy: x.x * from_x.y + y.x * from_y.y,
            yy: x.y * from_x.y + y.y * from_y.y,
        }
    }

    /// Returns the variances along the narrow and the wide axis.
    pub fn axes(self) -> (f64, f64) {
        let (middle, aside) = (0.5 * (self.xx + self.yy), 0.5 * (self.xx - self.yy));
        let half = (aside * aside + self.xy * self.xy).sqrt();
        let wide = middle + half;
        // The product of the two is the determinant: no cancellation.
        let narrow = if wide > 0.0 { (self.xx * self.yy - self.xy * self.xy).max(0.0) / wide } else { 0.0 };
        (narrow, wide)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_are_found() {
        let axis = DVec2::from_angle(0.7);
        let (narrow, wide) = Covariance::along(axis * 7.0).plus(Covariance::along(axis.perp() * 0.1)).axes();
        assert!((wide - 49.0).abs() < 1e-9 && (narrow - 0.01).abs() < 1e-9);
    }

    #[test]
    fn a_map_moves_what_a_covariance_is_along() {
        let (x, y) = (DVec2::new(2.0, -0.5), DVec2::new(0.3, 1.4));
        let (a, b) = (DVec2::new(1.0, 3.0), DVec2::new(-0.7, 0.2));
        let moved = |v: DVec2| Covariance::along(x * v.x + y * v.y);
        let (found, wanted) = (Covariance::along(a).plus(Covariance::along(b)).mapped(x, y), moved(a).plus(moved(b)));
        for (found, wanted) in [(found.xx, wanted.xx), (found.xy, wanted.xy), (found.yy, wanted.yy)] {
            assert!((found - wanted).abs() < 1e-14, "{found} {wanted}");
        }
    }
}
