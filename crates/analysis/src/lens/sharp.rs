//! Depth of field.

use dioptric_optics::MonoLens;
use serde::Serialize;

use dioptric_pipeline::PipelineError;

/// Between which distances an object is sharp enough, where a blur of a diameter is taken to be sharp.
///
/// Distances count from the first vertex, as those of objects. First-order geometry: an entrance pupil of diameter D at a distance s from
/// what is in focus, imaged at the magnification m, blurs what is at s′ to D |m| |s − s′| / s′; diffraction is left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SharpDepths {
    /// The diameter of the blur on the film, µm.
    pub blur_um: f64,
    /// Focused there, all is sharp from half of it to infinity, counted from the entrance pupil; mm.
    pub hyperfocal_mm: f64,
    /// The nearest distance that is sharp when the distance asked for is in focus, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sharp_from_mm: Option<f64>,
    /// The farthest one; infinite beyond the hyperfocal distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sharp_to_mm: Option<f64>,
}

impl SharpDepths {
    /// Returns them for a lens, focused at a distance before the first vertex, mm; `None` of lenses without power, and of those with
    /// another in the x–z than in the y–z plane.
    ///
    /// Before an entrance pupil that is infinitely far the cone of light has one width everywhere: blurred by 2 u |m| |s − s′| for its slope
    /// u, such a lens is sharp as far on either side, and has no hyperfocal distance.
    ///
    /// # Errors
    /// When the blur is no diameter above 0.
    pub fn of(lens: &MonoLens, blur_um: f64, focused_mm: Option<f64>) -> Result<Option<Self>, PipelineError> {
        if !(blur_um > 0.0 && blur_um.is_finite()) {
            return Err(PipelineError::Value {
                origin: "the depth of field".to_owned(),
                key: "blur_um",
                found: blur_um.to_string(),
                expected: "a finite diameter above 0".to_owned(),
            });
        }
        let first = lens.first_order_for(focused_mm.unwrap_or(f64::INFINITY));
        let far = lens.first_order();
        let pupil_mm = far.entrance_pupil_diameter_mm;
        let x_plane = lens.first_order_x();
        let has_one_power = (x_plane.power_per_mm - far.power_per_mm).abs() <= 1e-9 * far.power_per_mm.abs();
        if !(far.efl_mm.is_finite() && has_one_power) {
            return Ok(None);
        }
        let blur_mm = 1e-3 * blur_um;
        if !(pupil_mm.is_finite() && far.entrance_pupil_z_mm.is_finite()) {
            let of_cone = |focused_mm: f64| {
                let slope = lens.axial_beam(focused_mm)?.slope_before.abs();
                let half_mm = blur_mm / (2.0 * slope * lens.conjugate(focused_mm).magnification.abs());
                Some([focused_mm - half_mm, focused_mm + half_mm])
            };
            let Some(limits_mm) = focused_mm.filter(|mm| mm.is_finite()).and_then(of_cone) else { return Ok(None) };
            let [sharp_from_mm, sharp_to_mm] = limits_mm.map(Some);
            return Ok(Some(Self { blur_um, hyperfocal_mm: f64::INFINITY, sharp_from_mm, sharp_to_mm }));
        }
        // Where |m| is the blur over the pupil, the distance from the front focal point being f n / |m|.
        let hyperfocal_mm = far.efl_mm.abs() * far.object_index * pupil_mm / blur_mm - far.ffl_mm;
        let limits_mm = focused_mm.map(|focused_mm| {
            let from_pupil_mm = focused_mm + first.entrance_pupil_z_mm;
            let magnification = lens.conjugate(focused_mm).magnification.abs();
            let share = blur_mm / (first.entrance_pupil_diameter_mm * magnification);
            let at = |factor: f64| match factor > 0.0 && from_pupil_mm.is_finite() {
                true => from_pupil_mm / factor - first.entrance_pupil_z_mm,
                false => f64::INFINITY,
            };
            match focused_mm.is_finite() {
                true => [at(1.0 + share), at(1.0 - share)],
                // A far focus is sharp from the hyperfocal distance on.
                false => [hyperfocal_mm, f64::INFINITY],
            }
        });
        let [sharp_from_mm, sharp_to_mm] = [0, 1].map(|i| limits_mm.map(|limits| limits[i]));
        Ok(Some(Self { blur_um, hyperfocal_mm, sharp_from_mm, sharp_to_mm }))
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use dioptric_optics::{Glass, Interface, Lens, Shape, Surface};

    use super::*;

    /// H = f + f²/(N c); near = s (H − f) / (H + s − 2 f), far = s (H − f) / (H − s) of a thin lens, from its plane.
    #[test]
    fn thin_lens_has_the_textbooks_limits() {
        let lens = Lens::thin(50.0, 12.5).unwrap().at(550.0).unwrap();
        let (f, h) = (50.0, 50.0 + 2500.0 / (4.0 * 0.03));
        for s in [500.0, 3000.0, 15_000.0, 40_000.0] {
            let found = SharpDepths::of(&lens, 30.0, Some(s)).unwrap().unwrap();
            assert_relative_eq!(found.hyperfocal_mm, h, max_relative = 1e-12);
            assert_relative_eq!(found.sharp_from_mm.unwrap(), s * (h - f) / (h + s - 2.0 * f), max_relative = 1e-9);
            let far = if s < h { s * (h - f) / (h - s) } else { f64::INFINITY };
            assert_relative_eq!(found.sharp_to_mm.unwrap(), far, max_relative = 1e-9);
        }
        let found = SharpDepths::of(&lens, 30.0, None).unwrap().unwrap();
        assert_eq!((found.sharp_from_mm, found.sharp_to_mm), (None, None));
        assert!(SharpDepths::of(&lens, 0.0, None).is_err());
    }

    /// A stop in the rear focal plane of a thin lens: the cone from an object in front of it has the slope a/f for a stop of radius a,
    /// whatever its distance s, and is magnified by f/(s − f).
    #[test]
    fn telecentric_lens_is_sharp_as_far_on_either_side() {
        let (f, a, s) = (50.0, 2.0, 100.0);
        let row = |shape, semi_aperture_mm, thickness_after_mm| Interface {
            surface: Surface { curvature_per_mm: 0.0, shape, semi_aperture_mm },
            medium_after: Glass::Air,
            thickness_after_mm,
        };
        let rows = vec![row(Shape::ThinLens { power_per_mm: 1.0 / f }, 20.0, f), row(Shape::Sphere, a, 0.0)];
        let lens = Lens::new("telecentric", "test", rows, 1).unwrap().at(550.0).unwrap();
        let found = SharpDepths::of(&lens, 20.0, Some(s)).unwrap().unwrap();
        let half_mm = 0.02 / (2.0 * (a / f) * f / (s - f));
        assert_relative_eq!(found.sharp_from_mm.unwrap(), s - half_mm, max_relative = 1e-6);
        assert_relative_eq!(found.sharp_to_mm.unwrap(), s + half_mm, max_relative = 1e-6);
        assert_eq!(SharpDepths::of(&lens, 20.0, None).unwrap(), None);
    }

    /// At the limits that a thick lens has, its own first-order image is blurred by as much.
    #[test]
    fn thick_lens_is_blurred_by_as_much_at_its_limits() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap().at(550.0).unwrap();
        let found = SharpDepths::of(&lens, 20.0, Some(1000.0)).unwrap().unwrap();
        let film_mm = lens.conjugate(1000.0).image_z_mm;
        let first = lens.first_order();
        let (exit_z_mm, exit_mm) = (first.exit_pupil_z_mm, first.exit_pupil_diameter_mm);
        for limit_mm in [found.sharp_from_mm.unwrap(), found.sharp_to_mm.unwrap()] {
            let image_mm = lens.conjugate(limit_mm).image_z_mm;
            let blur_um = 1e3 * exit_mm * (film_mm - image_mm).abs() / (image_mm - exit_z_mm);
            assert_relative_eq!(blur_um, 20.0, max_relative = 1e-6);
        }
    }
}
