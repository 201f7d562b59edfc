//! The movements of a view camera: the lens turned and moved before the film.

use dioptric_optics::{CoordinateBreak, Lens};
use serde::{Deserialize, Serialize};

use crate::{PipelineError, REFERENCE_WAVELENGTH_NM};

/// How the lens as a whole is turned about the middle of its entrance pupil and moved, while film and scene stay.
///
/// Where tilts and swings change the plane of focus, rise and shift choose the part of the lens's picture that the film sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Movements {
    /// Turn about the horizontal, degrees; above 0 forwards: the lens looks down.
    pub tilt_deg: f64,
    /// Turn about the vertical, degrees; above 0 the lens looks to the right.
    pub swing_deg: f64,
    /// How far it is moved up, mm.
    pub rise_mm: f64,
    /// How far it is moved to the right, mm.
    pub shift_mm: f64,
}

impl Movements {
    /// Returns the lens so turned and moved.
    ///
    /// # Errors
    /// When a number is not finite, or the lens has as many moves of its surfaces as it may have.
    pub fn apply(self, lens: Lens) -> Result<Lens, PipelineError> {
        self.apply_at(lens, REFERENCE_WAVELENGTH_NM)
    }

    /// Returns the lens so turned and moved; the entrance pupil is that at this wavelength, nm.
    ///
    /// # Errors
    /// As [`apply`](Self::apply), and when a glass is not known at the wavelength.
    pub fn apply_at(self, lens: Lens, wavelength_nm: f64) -> Result<Lens, PipelineError> {
        if self == Self::default() {
            return Ok(lens);
        }
        let pupil_z_mm = lens.at(wavelength_nm)?.projection_center_z_mm();
        let whole = CoordinateBreak {
            surfaces: (0, lens.interfaces().len() - 1),
            // The pupil of a lens that is telecentric before the object is infinitely far.
            pivot_mm: if pupil_z_mm.is_finite() { pupil_z_mm } else { 0.0 },
            decenter_mm: [self.shift_mm, self.rise_mm, 0.0],
            // By the right-hand rule, the axis pointing to the film.
            tilt_deg: [-self.tilt_deg, -self.swing_deg, 0.0],
            tilt_first: false,
        };
        // Moves of single surfaces are stated in the frame of the whole.
        let moves = std::iter::once(whole).chain(lens.moves().iter().copied()).collect();
        Ok(lens.with_moves(moves)?)
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::{ObjectPoint, Vignetting, glam::DVec2, rays_towards};

    use super::*;

    /// Returns where the ray along a field through the middle of the entrance pupil lands in the picture, mm.
    fn lands_mm(lens: &Lens, field_tan: DVec2) -> DVec2 {
        let mono = lens.at(550.0).unwrap();
        let point = ObjectPoint::from_field(&mono, field_tan, 0.0);
        let mut rays = rays_towards(&point, &[DVec2::ZERO], mono.projection_center_z_mm(), 0.0);
        mono.trace(&mut rays, Vignetting::Off);
        let film_distance_mm = mono.first_order().bfl_mm;
        mono.to_film(&mut rays, film_distance_mm);
        mono.film_point(rays.point_mm(0), film_distance_mm).in_picture_mm()
    }

    #[test]
    fn a_shifted_lens_moves_its_picture() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let of = |movements: Movements| lands_mm(&movements.apply(lens.clone()).unwrap(), DVec2::ZERO);
        // A far scene follows the lens; in the picture, which is the film turned by 180°, the other way.
        let moved = of(Movements { rise_mm: 2.0, shift_mm: 1.0, ..Movements::default() });
        // The straight ray passes the lens 2.2 mm off its axis: spherical aberration takes some micrometres.
        assert!((moved - DVec2::new(-1.0, -2.0)).length() < 0.03, "{moved}");
        assert_eq!(Movements::default().apply(lens.clone()).unwrap(), lens);
    }

    #[test]
    fn a_lens_that_looks_down_and_right_has_its_axis_there() {
        // What lies along the turned axis passes the lens along it, unbent: it lands where the straight line does.
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let turned = Movements { tilt_deg: 3.0, swing_deg: 2.0, ..Movements::default() }.apply(lens.clone()).unwrap();
        let mono = turned.at(550.0).unwrap();
        let axis = DVec2::new(2f64.to_radians().tan() / 3f64.to_radians().cos(), -3f64.to_radians().tan());
        let film_z_mm: f64 =
            lens.interfaces().iter().map(|i| i.thickness_after_mm).sum::<f64>() + mono.first_order().bfl_mm;
        let straight = axis * (film_z_mm - mono.projection_center_z_mm());
        assert!((lands_mm(&turned, axis) - straight).length() < 1e-9, "{} {straight}", lands_mm(&turned, axis));
    }
}
