//! Ray fans: transverse aberration along a line of the pupil.

use glam::DVec2;

use super::pupil_places::PupilSampling;
use crate::{MonoLens, ObjectPoint};

/// How far the rays through a line of pupil places miss the chief ray's film point.
#[derive(Clone, Debug, PartialEq)]
pub struct RayFan {
    /// The film point of a ray less that of the chief ray, mm, along the film's x and y, for each place; `None` for rays that do not
    /// arrive.
    pub errors_mm: Vec<Option<DVec2>>,
}

impl RayFan {
    /// Traces a fan to the film as it is curved, `film_distance_mm` behind the last vertex; `None` if not even the chief ray arrives.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        sampling: &PupilSampling,
    ) -> Option<Self> {
        let chief = sampling.chief().rays_on_film(lens, point, film_distance_mm);
        if !chief.fate[0].is_in_flight() {
            return None;
        }
        let chief_mm = lens.on_film_mm(chief.point_mm(0), film_distance_mm);
        let rays = sampling.rays_on_film(lens, point, film_distance_mm);
        let error = |i: usize| {
            let is_there = rays.fate[i].is_in_flight();
            is_there.then(|| lens.on_film_mm(rays.point_mm(i), film_distance_mm) - chief_mm)
        };
        Some(Self { errors_mm: (0..rays.len()).map(error).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Lens, Vignetting,
        analysis::{PupilCoordinates, pupil_line},
    };

    fn fan(lens: &MonoLens, field_tan: f64, film_distance_mm: f64, direction: DVec2) -> RayFan {
        let sampling = PupilSampling {
            coordinates: PupilCoordinates::entrance(lens),
            places: pupil_line(direction, 21),
            rims: Vignetting::On,
        };
        let point = ObjectPoint::from_field(lens, DVec2::new(0.0, field_tan), 0.0);
        RayFan::trace(lens, &point, film_distance_mm, &sampling).unwrap()
    }

    #[test]
    fn defocus_is_a_straight_line() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        let fan = fan(&lens, 0.1, 49.0, DVec2::Y);
        for (i, error) in fan.errors_mm.iter().enumerate() {
            // One millimetre of fifty before the focus: a fiftieth of the pupil's 5 mm.
            let expected = 0.1 * (i as f64 / 10.0 - 1.0);
            assert!((error.unwrap() - DVec2::new(0.0, expected)).length() < 1e-13);
        }
    }

    #[test]
    fn sagittal_fans_are_mirror_images_and_axial_ones_are_odd() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap().at(550.0).unwrap();
        let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        let sagittal = fan(&lens, 0.2, film_distance_mm, DVec2::X);
        let axial = fan(&lens, 0.0, film_distance_mm, DVec2::Y);
        for i in 0..21 {
            let (a, b) = (sagittal.errors_mm[i].unwrap(), sagittal.errors_mm[20 - i].unwrap());
            assert!((a.x + b.x).abs() < 1e-12 && (a.y - b.y).abs() < 1e-12);
            let (a, b) = (axial.errors_mm[i].unwrap(), axial.errors_mm[20 - i].unwrap());
            assert!((a + b).length() < 1e-12);
        }
    }

    #[test]
    fn rims_open_gaps() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let fan = fan(&lens, 0.3, 36.0, DVec2::Y);
        let n_lost = fan.errors_mm.iter().filter(|error| error.is_none()).count();
        assert!((2..20).contains(&n_lost), "{n_lost}");
    }
}
