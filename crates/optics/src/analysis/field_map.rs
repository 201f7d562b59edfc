//! Where real chief rays land: distortion and lateral color.

use glam::{DMat2, DVec2};

use super::pupil_places::{PupilCoordinates, PupilSampling};
use crate::{MonoLens, ObjectPoint, RayBatch, Vignetting, paraxial::Matrix};

/// How an image without distortion grows with the field angle θ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// In step with tan θ: straight lines stay straight.
    Tangent,
    /// In step with θ: equal angles stay equal, as a fisheye has it.
    Angle,
}

/// The image height of a chief ray against that of an image without distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// Height of the real chief ray, mm, in the picture frame: positive on the side that the point lies on.
    pub height_mm: f64,
    /// The height with the paraxial scale on the same film, mm.
    pub ideal_mm: f64,
}

impl Distortion {
    /// Returns the distortion of a field on a film `film_distance_mm` behind the last vertex; `None` if no ray passes the middle
    /// of the stop.
    ///
    /// The field is the tangent of the angle at the paraxial entrance pupil. The paraxial scale is that of this film and
    /// wavelength, in focus or not, so that distortion is 0 for small fields: focal length, for a far point in focus.
    pub fn of(
        lens: &MonoLens,
        (field_tan, dioptres): (f64, f64),
        film_distance_mm: f64,
        projection: Projection,
    ) -> Option<Self> {
        let point = ObjectPoint::from_field(lens, DVec2::new(0.0, field_tan), dioptres);
        let height_mm = -lens.chief_film_point_mm(&point, film_distance_mm)?.y;
        let field = match projection {
            Projection::Tangent => field_tan,
            Projection::Angle => field_tan.atan(),
        };
        Some(Self { height_mm, ideal_mm: field * lens.film_scale_mm(film_distance_mm) })
    }

    /// Returns the relative distortion: 0.01 for an image 1 % too large, −1 for one shrunk to a point; 0 on the axis.
    pub fn relative(&self) -> f64 {
        if self.ideal_mm == 0.0 { 0.0 } else { self.height_mm / self.ideal_mm - 1.0 }
    }
}

impl MonoLens {
    /// Returns where the ray of a point through the middle of the real stop meets the film as it is curved, mm, in x and y
    /// of the lens frame (of the film's own, where it is tilted or decentered); rims do not end it. `None` if there is no
    /// such ray.
    ///
    /// Its difference between wavelengths is lateral color.
    pub fn chief_film_point_mm(&self, point: &ObjectPoint, film_distance_mm: f64) -> Option<DVec2> {
        self.chief_ray_on_film(point, film_distance_mm).map(|ray| self.on_film_mm(ray.point_mm(0), film_distance_mm))
    }

    /// Returns the tangents of the field angles of the point, `dioptres` = 1/Z away, whose ray through the middle of the real
    /// stop meets the film at this place of it, mm; `None` if none is found.
    ///
    /// Newton's method, led from the axis to the place in steps, to 1e-10 of the height.
    pub fn field_tan_of_image(&self, image_mm: DVec2, film_distance_mm: f64, dioptres: f64) -> Option<DVec2> {
        const STEPS: u32 = 8;
        const ROUNDS: usize = 30;
        let lands_mm =
            |tan: DVec2| self.chief_film_point_mm(&ObjectPoint::from_field(self, tan, dioptres), film_distance_mm);
        let mut tan = DVec2::ZERO;
        for step in 1..=STEPS {
            let goal_mm = image_mm * (f64::from(step) / f64::from(STEPS));
            let mut is_found = false;
            for _ in 0..ROUNDS {
                let here_mm = lands_mm(tan)?;
                let miss_mm = goal_mm - here_mm;
                is_found = miss_mm.length() <= 1e-10 * (1.0 + image_mm.length());
                if is_found {
                    break;
                }
                let by = 1e-6 * (1.0 + tan.length());
                let along = |u: DVec2| Some((lands_mm(tan + u * by)? - here_mm) / by);
                let slope = DMat2::from_cols(along(DVec2::X)?, along(DVec2::Y)?);
                let change = slope.inverse() * miss_mm;
                if !change.is_finite() {
                    return None;
                }
                tan += change.clamp_length_max(0.2 * (1.0 + tan.length()));
            }
            if !is_found {
                return None;
            }
        }
        Some(tan)
    }

    /// Returns the ray of a point through the middle of the real stop where it meets the film as it is curved; rims do
    /// not end it. `None` if there is no such ray.
    pub fn chief_ray_on_film(&self, point: &ObjectPoint, film_distance_mm: f64) -> Option<RayBatch> {
        let coordinates = PupilCoordinates::stop(self);
        let sampling = PupilSampling { coordinates, places: vec![DVec2::ZERO], rims: Vignetting::Off };
        let ray = sampling.rays_on_film(self, point, film_distance_mm);
        ray.fate[0].is_in_flight().then_some(ray)
    }

    /// Returns the paraxial image height on a film over the tangent of the field angle at the entrance pupil, mm,
    /// positive for an image upside down: the focal length, for a film in the rear focal plane.
    pub fn film_scale_mm(&self, film_distance_mm: f64) -> f64 {
        let steps = self.steps();
        let matrix = Matrix::of(steps);
        // A ray of slope 1 through the middle of the entrance pupil; where that is infinitely far, of the first vertex.
        let y = -self.projection_center_z_mm();
        let w = steps[0].index_before;
        matrix.a * y + matrix.b * w + film_distance_mm * (matrix.c * y + matrix.d * w) / self.image_index()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lens;

    #[track_caller]
    fn relative(lens: &MonoLens, field_tan: f64, film_distance_mm: f64, projection: Projection) -> f64 {
        Distortion::of(lens, (field_tan, 0.0), film_distance_mm, projection).unwrap().relative()
    }

    #[test]
    fn field_of_an_image_height_is_that_of_its_chief_ray() {
        for (name, image_mm) in [("dgauss-50mm", DVec2::new(3.0, 15.0)), ("fisheye-12.5mm", DVec2::new(0.0, -14.0))] {
            let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
            let film_distance_mm = lens.film_distance_mm_for(1000.0).unwrap();
            let dioptres = 1e3 / (1000.0 + lens.projection_center_z_mm());
            let tan = lens.field_tan_of_image(image_mm, film_distance_mm, dioptres).unwrap();
            let point = ObjectPoint::from_field(&lens, tan, dioptres);
            let landed_mm = lens.chief_film_point_mm(&point, film_distance_mm).unwrap();
            assert!(landed_mm.distance(image_mm) < 1e-8, "{name}: {landed_mm}");
            assert_eq!(lens.field_tan_of_image(DVec2::new(0.0, 400.0), film_distance_mm, dioptres), None);
        }
    }

    #[test]
    fn pinholes_and_ideal_lenses_have_none() {
        for lens in [Lens::pinhole(0.5).unwrap(), Lens::thin(50.0, 10.0).unwrap()] {
            let lens = lens.at(550.0).unwrap();
            for field_tan in [0.0, 0.1, 1.0, 5.0] {
                assert!(relative(&lens, field_tan, 37.0, Projection::Tangent).abs() < 1e-13);
            }
            // θ / tan θ by definition.
            assert!((relative(&lens, 1.0, 37.0, Projection::Angle) - (4.0 / std::f64::consts::PI - 1.0)).abs() < 1e-13);
        }
    }

    #[test]
    fn scale_is_the_focal_length_in_focus_and_the_magnification_near() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let first = lens.first_order();
        let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        assert!((lens.film_scale_mm(film_distance_mm) / first.efl_mm - 1.0).abs() < 1e-13);
        let conjugate = lens.conjugate(500.0);
        let expected = -conjugate.magnification * (500.0 + first.entrance_pupil_z_mm);
        assert!((lens.film_scale_mm(conjugate.image_z_mm) / expected - 1.0).abs() < 1e-13);
    }

    #[test]
    fn small_fields_bend_as_the_fifth_seidel_sum_says() {
        for name in ["dgauss-50mm", "telephoto-127mm", "singlet-50mm"] {
            let lens = Lens::built_in(name).unwrap();
            let mono = lens.at(550.0).unwrap();
            let field_tan = 0.02;
            let settings = crate::SeidelSettings {
                wavelength_nm: 550.0,
                colors_nm: [500.0, 600.0],
                object_distance_mm: f64::INFINITY,
                chief_slope: field_tan,
            };
            let sums = lens.seidel(&settings).unwrap();
            let film_distance_mm = mono.film_distance_mm_for(f64::INFINITY).unwrap();
            // δh = S5 / (2 n' u'), h = H / (n' u'): relative S5 / 2H.
            let expected = sums.total.s5 / (2.0 * sums.lagrange_mm);
            let found = relative(&mono, field_tan, film_distance_mm, Projection::Tangent);
            // Fifth order is smaller by the square of the field, times some tens.
            assert!((found / expected - 1.0).abs() < 0.02, "{name}: {found:e} {expected:e}");
        }
    }

    #[test]
    fn fisheye_keeps_angles_rather_than_straight_lines() {
        let lens = Lens::built_in("fisheye-12.5mm").unwrap().at(550.0).unwrap();
        let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        let at = |degrees: f64, projection| relative(&lens, degrees.to_radians().tan(), film_distance_mm, projection);
        assert!(at(85.0, Projection::Tangent) < -0.85);
        assert!(at(80.0, Projection::Angle).abs() < 0.15, "{}", at(80.0, Projection::Angle));
    }
}
