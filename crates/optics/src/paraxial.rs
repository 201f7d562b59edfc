//! First-order optics: cardinal points, pupils and conjugates.

use serde::Serialize;

use crate::trace::{Kind, Phase, Step};

/// The first-order data of a lens at one wavelength.
///
/// z of things in front is from the first vertex, of things behind from the last, both positive downstream: behind an odd
/// number of mirrors, towards −z of the lens frame.
/// A lens without power (a pinhole) has infinite focal lengths; a telecentric one an infinitely far pupil.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FirstOrder {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Power: one over the effective focal length, 1/mm.
    pub power_per_mm: f64,
    /// Effective focal length, one over the power, mm.
    pub efl_mm: f64,
    /// z of the rear focal point from the last vertex, mm.
    pub bfl_mm: f64,
    /// z of the front focal point from the first vertex, mm.
    pub ffl_mm: f64,
    /// z of the front principal plane from the first vertex, mm.
    pub front_principal_mm: f64,
    /// z of the rear principal plane from the last vertex, mm.
    pub rear_principal_mm: f64,
    /// z of the entrance pupil from the first vertex, mm.
    pub entrance_pupil_z_mm: f64,
    /// Diameter of the entrance pupil, mm.
    pub entrance_pupil_diameter_mm: f64,
    /// z of the exit pupil from the last vertex, mm.
    pub exit_pupil_z_mm: f64,
    /// Diameter of the exit pupil, mm.
    pub exit_pupil_diameter_mm: f64,
    /// f-number for a far object: effective focal length over entrance-pupil diameter.
    pub f_number: f64,
    /// Index of the object space.
    pub object_index: f64,
    /// Index of the image space.
    pub image_index: f64,
}

impl FirstOrder {
    /// Front focal length, from the front principal plane to the front focal point: −n / power, n being the index of the
    /// object space, mm.
    pub fn object_focal_mm(&self) -> f64 {
        -self.object_index / self.power_per_mm
    }

    /// Rear focal length, from the rear principal plane to the rear focal point: n′ / power, mm.
    pub fn image_focal_mm(&self) -> f64 {
        self.image_index / self.power_per_mm
    }

    /// Returns the same with pupils of another size.
    pub(crate) fn with_entrance_pupil_diameter_mm(self, diameter_mm: f64) -> Self {
        let exit_pupil_diameter_mm = diameter_mm * self.pupil_magnification();
        let f_number = if self.power_per_mm == 0.0 { f64::INFINITY } else { self.efl_mm.abs() / diameter_mm };
        Self { entrance_pupil_diameter_mm: diameter_mm, exit_pupil_diameter_mm, f_number, ..self }
    }

    /// Exit-pupil diameter over entrance-pupil diameter.
    pub fn pupil_magnification(&self) -> f64 {
        self.exit_pupil_diameter_mm / self.entrance_pupil_diameter_mm
    }
}

/// The paraxial ray from an axial object point to the edge of the stop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MarginalRay {
    /// Index times slope where it comes in: 0 for a far point.
    pub(crate) reduced_slope: f64,
    /// Height on the first vertex plane, mm.
    pub(crate) height_mm: f64,
    /// Index times slope where it leaves.
    pub(crate) reduced_slope_after: f64,
}

impl MarginalRay {
    /// Returns the ray with all its heights and slopes times a factor.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self {
            reduced_slope: self.reduced_slope * factor,
            height_mm: self.height_mm * factor,
            reduced_slope_after: self.reduced_slope_after * factor,
        }
    }

    /// Returns the ray from the point at `object_distance_mm` before the first vertex (infinite for a far one).
    ///
    /// Heights and slopes are infinite where no such ray reaches the stop's edge, as from a far point to the stop of a
    /// lens that is telecentric on that side.
    pub(crate) fn of(steps: &[Step], stop: usize, object_distance_mm: f64) -> Self {
        let (front, whole) = (Matrix::up_to(steps, stop), Matrix::of(steps));
        let edge_mm = steps[stop].semi_aperture;
        if object_distance_mm.is_infinite() {
            let height_mm = edge_mm / front.a.abs();
            return Self { reduced_slope: 0.0, height_mm, reduced_slope_after: whole.c * height_mm };
        }
        let reduced_mm = object_distance_mm / steps[0].index_before;
        let reduced_slope = (edge_mm / (front.a * reduced_mm + front.b)).copysign(1.0);
        Self {
            reduced_slope,
            height_mm: reduced_slope * reduced_mm,
            reduced_slope_after: reduced_slope * (whole.c * reduced_mm + whole.d),
        }
    }
}

/// The image of an axial object point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Conjugate {
    /// z of the image from the last vertex, mm; infinite for an object in the front focal plane.
    pub image_z_mm: f64,
    /// Lateral magnification, negative for an image upside down; 0 for a far object.
    pub magnification: f64,
}

/// A system's action on (height, index × slope), from one plane to another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix {
    pub(crate) a: f64,
    pub(crate) b: f64,
    pub(crate) c: f64,
    pub(crate) d: f64,
}

impl Matrix {
    const IDENTITY: Self = Self { a: 1.0, b: 0.0, c: 0.0, d: 1.0 };

    /// Returns the matrix, with nothing in place of what is no more than rounding of sums of terms as large as these.
    ///
    /// So an afocal lens has no power and a telecentric one a pupil that is infinitely far, whatever the last digits of
    /// its prescription.
    fn cleared(self, terms: &Self) -> Self {
        let clear = |element: f64, terms: f64| if element.abs() <= ROUNDING * terms { 0.0 } else { element };
        Self {
            a: clear(self.a, terms.a),
            b: clear(self.b, terms.b),
            c: clear(self.c, terms.c),
            d: clear(self.d, terms.d),
        }
    }

    fn after_refraction(self, power: f64) -> Self {
        Self { c: self.c - power * self.a, d: self.d - power * self.b, ..self }
    }

    fn after_transfer(self, reduced_mm: f64) -> Self {
        Self { a: self.a + reduced_mm * self.c, b: self.b + reduced_mm * self.d, ..self }
    }

    /// Returns the action from the first vertex of these steps to the last, that of the last's own power included.
    pub(crate) fn of(steps: &[Step]) -> Self {
        Self::product(steps).cleared(&Self::terms(steps))
    }

    fn product(steps: &[Step]) -> Self {
        Self::product_of(steps, |power| power, |reduced_mm| reduced_mm)
    }

    /// Returns the sums of the absolute terms that make the elements of the product.
    fn terms(steps: &[Step]) -> Self {
        Self::product_of(steps, |power| -power.abs(), f64::abs)
    }

    fn product_of(steps: &[Step], power: impl Fn(f64) -> f64, way: impl Fn(f64) -> f64) -> Self {
        let mut matrix = Self::IDENTITY;
        for (i, step) in steps.iter().enumerate() {
            if i > 0 {
                matrix = matrix.after_transfer(way((step.vertex_z - steps[i - 1].vertex_z) / step.index_before));
            }
            matrix = matrix.after_refraction(power(step.power()));
        }
        matrix
    }

    /// Returns the action from the first vertex to just before the surface at `stop`.
    fn up_to(steps: &[Step], stop: usize) -> Self {
        let (before, gap_mm) = (&steps[..stop], reduced_gap_mm(steps, stop));
        let terms = Self::terms(before).after_transfer(gap_mm.abs());
        Self::product(before).after_transfer(gap_mm).cleared(&terms)
    }

    /// Returns the image of a point at `object_z` from the first vertex.
    pub(crate) fn image_of(self, object_z: f64, index_before: f64, index_after: f64) -> Conjugate {
        // A ray of reduced slope 1 from the object point, or of height 1 from a far one.
        let (y, w) = if object_z.is_infinite() { (1.0, 0.0) } else { (-object_z / index_before, 1.0) };
        let (y2, w2) = (self.a * y + self.b * w, self.c * y + self.d * w);
        // In the front focal plane, to rounding: the light leaves in parallel.
        if w2.abs() <= ROUNDING * ((self.c * y).abs() + (self.d * w).abs()) {
            let magnification = if w == 0.0 { 0.0 } else { f64::INFINITY };
            return Conjugate { image_z_mm: f64::INFINITY, magnification };
        }
        Conjugate { image_z_mm: -index_after * y2 / w2, magnification: w / w2 }
    }

    /// Returns z from the first vertex of the point that is imaged at `image_z` from the last; infinite where that
    /// is the focal plane to rounding.
    pub(crate) fn object_of(self, image_z: f64, index_before: f64, index_after: f64) -> f64 {
        let y2 = -image_z / index_after;
        let (y, w) = (self.d * y2 - self.b, self.a - self.c * y2);
        if w.abs() <= 1e-14 * (self.a.abs() + (self.c * y2).abs()) {
            return f64::NEG_INFINITY;
        }
        -index_before * y / w
    }
}

/// How much rounding may leave of a sum that vanishes, over the sum of its absolute terms.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Returns the distance to a surface from the one before it over the index between them, mm; 0 for the first.
fn reduced_gap_mm(steps: &[Step], surface: usize) -> f64 {
    match surface {
        0 => 0.0,
        _ => (steps[surface].vertex_z - steps[surface - 1].vertex_z) / steps[surface].index_before,
    }
}

impl Step {
    /// The paraxial power of the surface, 1/mm.
    pub(crate) fn power(&self) -> f64 {
        let of_phase = self.phase.as_ref().map_or(0.0, Phase::power);
        of_phase + self.power_of_shape()
    }

    fn power_of_shape(&self) -> f64 {
        match self.kind {
            Kind::Window => 0.0,
            Kind::ThinLens { power, .. } => power,
            // Light that runs on towards +z behind a mirror does so in an index of the opposite sign.
            _ if self.is_mirror => -2.0 * self.index_before * self.vertex_curvature(),
            _ => (self.index_after - self.index_before) * self.vertex_curvature(),
        }
    }

    /// The curvature at the vertex, 1/mm, a square term of an asphere included.
    ///
    /// Of a surface that is not one of revolution it is that along y.
    pub(crate) fn vertex_curvature(&self) -> f64 {
        if let Kind::Toric(toric) = &self.kind {
            return toric.vertex_curvatures()[1];
        }
        let square_term = match &self.kind {
            Kind::EvenAsphere { a2, .. } => *a2,
            Kind::OddAsphere { coefficients, .. } => coefficients.get(1).copied().unwrap_or(0.0),
            _ => 0.0,
        };
        self.curvature + 2.0 * square_term
    }
}

pub(crate) fn first_order(steps: &[Step], stop: usize, wavelength_nm: f64) -> FirstOrder {
    let whole = Matrix::of(steps);
    let front = Matrix::up_to(steps, stop);
    let rear = Matrix::of(&steps[stop..]);
    let (n0, n1) = (steps[0].index_before, steps[steps.len() - 1].index_after);
    let power = 0.0 - whole.c;
    let stop_diameter_mm = 2.0 * steps[stop].semi_aperture;
    let entrance_pupil_diameter_mm = stop_diameter_mm / front.a.abs();
    FirstOrder {
        wavelength_nm,
        power_per_mm: power,
        efl_mm: 1.0 / power,
        bfl_mm: n1 * whole.a / power,
        ffl_mm: -n0 * whole.d / power,
        front_principal_mm: n0 * (1.0 - whole.d) / power,
        rear_principal_mm: n1 * (whole.a - 1.0) / power,
        entrance_pupil_z_mm: n0 * front.b / front.a,
        entrance_pupil_diameter_mm,
        exit_pupil_z_mm: -n1 * rear.b / rear.d,
        exit_pupil_diameter_mm: stop_diameter_mm / rear.d.abs(),
        f_number: if power == 0.0 { f64::INFINITY } else { (1.0 / power).abs() / entrance_pupil_diameter_mm },
        object_index: n0,
        image_index: n1,
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use crate::{Glass, Interface, Lens, ObjectPoint, PupilBoundary, Shape, Surface, Vignetting, analysis::StopAim};

    /// The published lengths have four decimals, the last off by one at times.
    const ANCHOR_MM: f64 = 1e-4;

    #[track_caller]
    fn check(lens: &Lens, wavelength_nm: f64, [efl, bfl, film_8m, film_2m]: [f64; 4]) {
        let mono = lens.at(wavelength_nm).unwrap();
        let first = mono.first_order();
        let film = |mm: f64| mono.film_distance_mm_for(mm).unwrap();
        for (found, expected) in [
            (first.efl_mm, efl),
            (first.bfl_mm, bfl),
            (film(8e3), film_8m),
            (film(2e3), film_2m),
            (film(f64::INFINITY), bfl),
        ] {
            assert!((found - expected).abs() < ANCHOR_MM, "{wavelength_nm} nm: {found}, expected {expected}");
        }
        let back_mm = mono.object_distance_mm_for(film(2e3)).unwrap();
        assert!((back_mm - 2e3).abs() < 1e-7, "{back_mm}");
        assert_eq!(mono.object_distance_mm_for(film(f64::INFINITY)).unwrap(), f64::INFINITY);
    }

    #[test]
    fn double_gauss_has_the_published_lengths() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        check(&lens, 400.0, [50.2380, 35.9674, 36.2840, 37.2465]);
        check(&lens, 550.0, [50.3463, 36.0920, 36.4099, 37.3768]);
        check(&lens, 700.0, [50.3802, 36.1322, 36.4505, 37.4187]);
        let first = lens.at(550.0).unwrap().first_order();
        for (found, expected) in [
            (first.entrance_pupil_z_mm, 19.9558),
            (0.5 * first.entrance_pupil_diameter_mm, 12.4149),
            (first.exit_pupil_z_mm, -17.7832),
            (0.5 * first.exit_pupil_diameter_mm, 13.2851),
            (first.f_number, 2.0277),
            (first.pupil_magnification(), 1.0701),
        ] {
            assert!((found - expected).abs() < ANCHOR_MM, "{found}, expected {expected}");
        }
    }

    #[test]
    fn paper_lens_has_the_published_lengths() {
        let lens = Lens::built_in("paper-2el").unwrap();
        check(&lens, 400.0, [50.4532, 49.5468, 49.8670, 50.8519]);
        check(&lens, 550.0, [51.9971, 51.0799, 51.4200, 52.4671]);
        check(&lens, 700.0, [53.6387, 52.7105, 53.0725, 54.1880]);
        let first = lens.with_stop_diameter_mm(10.0).unwrap().at(550.0).unwrap().first_order();
        assert!((first.f_number - 5.154).abs() < 5e-4, "{}", first.f_number);
    }

    #[test]
    fn thin_lens_obeys_its_equation() {
        let lens = Lens::thin(50.0, 10.0).unwrap();
        let mono = lens.at(550.0).unwrap();
        let film_distance_mm = mono.film_distance_mm_for(2_000.0).unwrap();
        assert!((film_distance_mm - 1.0 / (1.0 / 50.0 - 1.0 / 2_000.0)).abs() < 1e-12);
        assert!((mono.conjugate(2_000.0).magnification + film_distance_mm / 2_000.0).abs() < 1e-15);
        let first = mono.first_order();
        assert!((mono.working_f_number(2_000.0) - film_distance_mm / 10.0).abs() < 1e-12);
        assert!((mono.working_f_number(f64::INFINITY) - first.f_number).abs() < 1e-12);
    }

    fn train(parts: [(f64, f64, f64); 3], stop: usize) -> Lens {
        let part = |(power_per_mm, semi_aperture_mm, thickness_after_mm)| Interface {
            surface: Surface { shape: Shape::ThinLens { power_per_mm }, ..Surface::plane(semi_aperture_mm) },
            medium_after: Glass::Air,
            thickness_after_mm,
        };
        Lens::new("train", "test", parts.map(part).into(), stop).unwrap()
    }

    #[test]
    fn telecentric_afocal_relay_has_no_power_and_pupils_without_end() {
        // 1/49 and 1/81 are no binary numbers: what rounding leaves must not pass for a focal length.
        let relay = train([(1.0 / 49.0, 40.0, 49.0), (0.0, 5.0, 81.0), (1.0 / 81.0, 60.0, 0.0)], 1);
        let mono = relay.at(550.0).unwrap();
        let first = mono.first_order();
        assert_eq!((first.power_per_mm, first.efl_mm, first.f_number), (0.0, f64::INFINITY, f64::INFINITY));
        for infinite in [first.entrance_pupil_z_mm, first.exit_pupil_z_mm, first.entrance_pupil_diameter_mm] {
            assert!(infinite.is_infinite(), "{first:?}");
        }
        assert!(mono.film_distance_mm_for(f64::INFINITY).is_err());
        // Every object is imaged at 81/49 of its size; the cone is that of the stop seen from the second focus.
        for object_mm in [20.0, 49.0, 300.0] {
            let expected = -81.0 / 49.0;
            assert!((mono.conjugate(object_mm).magnification - expected).abs() < 1e-12);
            assert!((mono.working_f_number(object_mm) - 81.0 / 10.0).abs() < 1e-12);
        }
        assert_eq!(mono.projection_center_z_mm(), 0.0);
    }

    #[test]
    fn object_in_the_front_focal_plane_is_imaged_infinitely_far() {
        let lens = Lens::thin(49.0, 10.0).unwrap().at(550.0).unwrap();
        assert_eq!(lens.conjugate(49.0).image_z_mm, f64::INFINITY);
        assert!(lens.film_distance_mm_for(49.0).is_err() && lens.film_distance_mm_for(49.001).is_ok());
    }

    #[test]
    fn light_reaches_a_lens_whose_pupil_appears_behind_the_object() {
        // The stop lies beyond the rear focus: its image, the entrance pupil, lies 294 mm before the lens.
        let hypercentric = train([(1.0 / 49.0, 300.0, 58.8), (0.0, 2.0, 30.0), (1.0 / 60.0, 300.0, 0.0)], 1);
        let mono = hypercentric.at(550.0).unwrap();
        assert!((mono.first_order().entrance_pupil_z_mm + 294.0).abs() < 1e-9);
        for object_mm in [100.0, 280.0, 400.0] {
            let point = ObjectPoint::Finite(DVec3::new(3.0, -2.0, -object_mm));
            let pupil = PupilBoundary::find(&mono, &point, 32).unwrap();
            assert!(pupil.center_mm().length() < 1e-9, "{object_mm}: {}", pupil.center_mm());
            let aim = StopAim::find(&mono, &point, &[DVec2::ZERO, DVec2::new(0.6, -0.8)]);
            let targets_mm: Vec<DVec2> = aim.targets_mm().iter().map(|target| target.unwrap()).collect();
            let mut rays = aim.plane().rays(&mono, &point, &targets_mm);
            mono.trace_surfaces(0..2, &mut rays, Vignetting::Off);
            assert!(rays.point_mm(0).truncate().length() < 1e-9);
            assert!((rays.point_mm(1).truncate() - DVec2::new(1.2, -1.6)).length() < 1e-9);
        }
    }

    #[test]
    fn what_cannot_focus_says_so() {
        let pinhole = Lens::pinhole(0.3).unwrap().at(550.0).unwrap();
        assert_eq!(pinhole.first_order().power_per_mm, 0.0);
        assert!(pinhole.film_distance_mm_for(1_000.0).is_err());
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        // Within the front focal length the image is virtual.
        let message = lens.film_distance_mm_for(5.0).unwrap_err().to_string();
        assert!(message.contains("dgauss-50mm forms no image behind it"), "{message}");
        assert!(lens.film_distance_mm_for(-5.0).is_err());
        assert!(lens.film_distance_mm_for(f64::NAN).is_err());
        assert!(lens.object_distance_mm_for(20.0).is_err());
    }

    #[test]
    fn stop_opens_no_further_than_it_goes() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let f4 = lens.with_f_number(4.0, 550.0).unwrap();
        assert!((f4.at(550.0).unwrap().first_order().f_number - 4.0).abs() < 1e-12);
        let message = f4.with_f_number(1.4, 550.0).unwrap_err().to_string();
        assert!(message.contains("opens to f/2.0"), "{message}");
        let full = f4.with_f_number(lens.at(550.0).unwrap().first_order().f_number, 550.0).unwrap();
        assert!((full.stop_semi_aperture_mm() - 8.55).abs() < 1e-12);
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(lens.with_stop_diameter_mm(wrong).is_err());
        }
    }
}
