//! Numerical apertures of real cones of light.

use glam::{DVec2, DVec3};

use super::aim::StopAim;
use crate::{MonoLens, ObjectPoint, Vignetting};

/// The share of the stop's radius that the edge is taken at, so that a stop as wide as its surface has one.
const EDGE: f64 = 1.0 - 1e-9;

/// Index times sine of the half angle of the cone of light of a point on the axis, before and behind a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NumericalApertures {
    /// In object space; 0 for a far point.
    pub object: f64,
    /// In image space.
    pub image: f64,
}

impl NumericalApertures {
    /// Finds the apertures of the point on the axis at this distance before the first vertex, mm (infinite for a far one): those of its real
    /// beam, whatever limits it; of a lens without a beam about the axis those of the rays through the upper and the lower edge of the
    /// stop, whatever rims stop them. `None` where they do not come through.
    pub fn find(lens: &MonoLens, object_distance_mm: f64) -> Option<Self> {
        if let Some(beam) = lens.axial_beam(object_distance_mm) {
            let object = lens.object_index() * beam.slope_before.atan().sin().abs();
            return Some(Self { object, image: lens.image_index() * beam.sine_after });
        }
        let point = &match object_distance_mm.is_finite() {
            true => ObjectPoint::Finite(DVec3::Z * -object_distance_mm),
            false => ObjectPoint::Infinite(DVec3::Z),
        };
        let aim = StopAim::find(lens, point, &[DVec2::Y * EDGE, DVec2::NEG_Y * EDGE]);
        let targets_mm: Vec<DVec2> = aim.targets_mm().iter().copied().collect::<Option<_>>()?;
        let mut rays = aim.plane().rays(lens, point, &targets_mm);
        let half_sine = |rays: &crate::RayBatch| (0.5 * rays.direction(0).angle_between(rays.direction(1))).sin();
        let object = lens.object_index() * half_sine(&rays);
        lens.trace(&mut rays, Vignetting::Off);
        let is_through = rays.n_in_flight() == rays.len();
        is_through.then(|| Self { object, image: lens.image_index() * half_sine(&rays) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Glass, Lens};

    #[test]
    fn an_ideal_lens_has_those_of_its_triangles_in_any_medium() {
        for index in [1.0, 1.33] {
            let lens = Lens::thin(50.0, 20.0).unwrap().with_object_medium(Glass::Constant { index }).unwrap();
            let lens = lens.at(550.0).unwrap();
            let found = NumericalApertures::find(&lens, 100.0).unwrap();
            let image_mm = 1.0 / (1.0 / 50.0 - index / 100.0);
            let aperture = |index: f64, way_mm: f64| index * 10.0 / 10f64.hypot(way_mm);
            assert!((found.object / aperture(index, 100.0) - 1.0).abs() < 1e-8);
            assert!((found.image / aperture(1.0, image_mm) - 1.0).abs() < 1e-8, "{found:?} {image_mm}");
            let far = NumericalApertures::find(&lens, f64::INFINITY).unwrap();
            assert!(far.object == 0.0 && (far.image / aperture(1.0, 50.0) - 1.0).abs() < 1e-8);
        }
    }

    #[test]
    fn a_rim_that_limits_the_light_limits_them() {
        // The glass that ends an objective is 0.3544 mm across, through which light of a near object goes before the stop is full.
        let lens = Lens::built_in("microscope-20x").unwrap().at(550.0).unwrap();
        let found = NumericalApertures::find(&lens, 109.0).unwrap();
        assert!((found.image * 2.0 * lens.working_f_number(109.0) - 1.0).abs() < 0.01, "{found:?}");
    }
}
