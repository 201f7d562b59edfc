//! Field angles along x and y, and the points that they name.

use dioptric_optics::{MonoLens, ObjectPoint, analysis::WIDEST_FIELD_DEG, glam::DVec2};

/// The direction of a point of the field from the entrance pupil.
///
/// Two angles are those of the direction as the x–z and the y–z plane see it, from +z: below 90° both, or beyond it both, for then
/// the point lies behind the entrance pupil. One alone is the angle from the axis. Beyond 90° points are far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FieldAngles {
    /// From the axis, degrees, of 0 or more.
    pub(crate) angle_deg: f64,
    /// The unit vector from the axis to the point; upwards on the axis.
    pub(crate) direction: DVec2,
}

/// What [`FieldAngles::are_known`] asks for, in words.
pub(crate) const KNOWN_ANGLES: &str = "angles of up to 120 degrees from the axis of a far object, else below 90 degrees; of x/y both are below or both beyond 90 (ANGLE@AZIMUTH)";

impl FieldAngles {
    pub(crate) fn of_deg([x_deg, y_deg]: [f64; 2]) -> Self {
        let (angle_deg, direction) = match (x_deg == 0.0, y_deg == 0.0) {
            (true, _) => (y_deg.abs(), DVec2::new(0.0, if y_deg < 0.0 { -1.0 } else { 1.0 })),
            (false, true) => (x_deg.abs(), DVec2::new(x_deg.signum(), 0.0)),
            (false, false) => {
                // Behind the pupil z is −1, and the signs of the tangents turn with it.
                let z = if x_deg.abs() > 90.0 && y_deg.abs() > 90.0 { -1.0 } else { 1.0 };
                let across = z * DVec2::new(x_deg.to_radians().tan(), y_deg.to_radians().tan());
                (across.length().atan2(z).to_degrees(), across.normalize())
            }
        };
        Self { angle_deg, direction }
    }

    /// Whether there is a point under these angles, degrees, at a distance.
    pub(crate) fn are_known(angles_deg: [f64; 2], distance_mm: f64) -> bool {
        let [x, y] = angles_deg.map(f64::abs);
        let is_ahead = x < 90.0 && y < 90.0;
        let is_named = x.min(y) == 0.0 || (x.min(y) > 90.0 && x.max(y) < 180.0);
        let is_near_axis = || Self::of_deg(angles_deg).angle_deg <= WIDEST_FIELD_DEG;
        is_ahead || (is_named && distance_mm.is_infinite() && is_near_axis())
    }

    /// Returns the point, `dioptres` = 1/Z away, as [`ObjectPoint::from_field`] has it.
    pub(crate) fn point(&self, lens: &MonoLens, dioptres: f64) -> ObjectPoint {
        let angle_rad = self.angle_deg.to_radians();
        match dioptres == 0.0 {
            true => ObjectPoint::far(angle_rad, self.direction),
            false => ObjectPoint::from_field(lens, self.direction * angle_rad.tan(), dioptres),
        }
    }

    /// Returns the direction of the point's meridional plane on the film, from +x; of the axis it is taken through x.
    pub(crate) fn meridian_rad(&self) -> f64 {
        if self.angle_deg == 0.0 { 0.0 } else { self.direction.to_angle() }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_6;

    use super::*;

    #[test]
    fn two_angles_name_points_on_both_sides_of_the_pupil() {
        // At 30° from x, so far from the axis: the planes see the tangents of both components.
        for angle_deg in [20.0, 60.0, 89.0, 91.0, 100.0, 119.0_f64] {
            let (sine, cosine) = angle_deg.to_radians().sin_cos();
            let [x, y] = [FRAC_PI_6.cos(), FRAC_PI_6.sin()].map(|c| (sine * c).atan2(cosine).to_degrees());
            for (sign_x, sign_y) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                let angles_deg = [sign_x * x, sign_y * y];
                let found = FieldAngles::of_deg(angles_deg);
                assert!((found.angle_deg - angle_deg).abs() < 1e-9, "{angle_deg}: {found:?}");
                let expected = DVec2::new(sign_x * FRAC_PI_6.cos(), sign_y * FRAC_PI_6.sin());
                assert!((found.direction - expected).length() < 1e-9, "{angle_deg}: {found:?}");
                assert!(FieldAngles::are_known(angles_deg, f64::INFINITY));
                assert_eq!(FieldAngles::are_known(angles_deg, 1e3), angle_deg < 90.0, "near points end at 90°");
            }
        }
        // One ahead and one behind, beyond 120° from the axis, and none at all.
        for angles_deg in [[100.0, 20.0], [20.0, -95.0], [150.0, 150.0], [90.0, 90.0], [121.0, 0.0], [f64::NAN, 1.0]] {
            assert!(!FieldAngles::are_known(angles_deg, f64::INFINITY), "{angles_deg:?}");
        }
    }
}
