//! Field angles along x and y, and the points that they name.

use dioptric_optics::{MonoLens, ObjectPoint, analysis::WIDEST_FIELD_DEG, glam::DVec2};

/// The direction of a point of the field from the entrance pupil.
///
/// Of two angles, in the x–z and the y–z plane, the tangents add up; of one alone it may be 90° or more, of a far point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FieldAngles {
    /// From the axis, degrees, of 0 or more.
    pub(crate) angle_deg: f64,
    /// The unit vector from the axis to the point; upwards on the axis.
    pub(crate) direction: DVec2,
}

/// What [`FieldAngles::are_known`] asks for, in words.
pub(crate) const KNOWN_ANGLES: &str =
    "angles of up to 120 degrees along x or along y of a far object, else below 90 degrees";

impl FieldAngles {
    pub(crate) fn of_deg([x_deg, y_deg]: [f64; 2]) -> Self {
        let (angle_deg, direction) = match (x_deg == 0.0, y_deg == 0.0) {
            (true, _) => (y_deg.abs(), DVec2::new(0.0, if y_deg < 0.0 { -1.0 } else { 1.0 })),
            (false, true) => (x_deg.abs(), DVec2::new(x_deg.signum(), 0.0)),
            (false, false) => {
                let tan = DVec2::new(x_deg.to_radians().tan(), y_deg.to_radians().tan());
                (tan.length().atan().to_degrees(), tan.normalize())
            }
        };
        Self { angle_deg, direction }
    }

    /// Whether there is a point under these angles, degrees, at a distance.
    pub(crate) fn are_known(angles_deg: [f64; 2], distance_mm: f64) -> bool {
        let [x, y] = angles_deg.map(f64::abs);
        let is_alone = distance_mm.is_infinite() && x.min(y) == 0.0;
        if is_alone { x.max(y) <= WIDEST_FIELD_DEG } else { x < 90.0 && y < 90.0 }
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
