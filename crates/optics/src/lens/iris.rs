//! The blades of a lens's stop.

use super::Lens;
use crate::{Iris, IrisOpening, OpticsError, Shape};

impl Lens {
    /// Returns the lens with blades that close its stop, or without any: `None` for a stop that stays round.
    ///
    /// Blades show where the stop is closed below the prescription's own ([`with_f_number`](Self::with_f_number),
    /// [`with_stop_diameter_mm`](Self::with_stop_diameter_mm)); at that it is the round rim.
    ///
    /// # Errors
    /// When a number makes no sense, or the lens is a pinhole, which cannot be closed.
    pub fn with_iris(mut self, iris: Option<Iris>) -> Result<Self, OpticsError> {
        if let Some(iris) = &iris {
            iris.check()?;
            if let [hole] = self.interfaces.as_slice()
                && hole.surface.curvature_per_mm == 0.0
                && hole.surface.shape == Shape::Sphere
            {
                let reason = "it is a hole in a plate";
                return Err(OpticsError::NoIris { lens: self.name, reason });
            }
        }
        self.iris = iris;
        Ok(self)
    }

    /// The blades that close the stop; `None` of a stop that stays round.
    pub fn iris(&self) -> Option<&Iris> {
        self.iris.as_ref()
    }

    /// The opening that the blades leave; `None` without blades, and where the stop is fully open.
    pub fn iris_opening(&self) -> Option<IrisOpening> {
        self.iris?.opening(self.stop_semi_aperture_mm(), self.full_stop_semi_aperture_mm)
    }

    /// Returns a sentence where the lens has blades that do not show, since its stop is fully open.
    pub fn note_on_iris(&self) -> Option<String> {
        let iris = self.iris.filter(|_| self.iris_opening().is_none())?;
        Some(format!("the stop is fully open and round: its {} blades show where it is closed", iris.blades))
    }

    /// Returns this lens with the blades and the widest stop of another, of which it was made.
    pub(crate) fn with_stop_of(mut self, other: &Self) -> Self {
        (self.iris, self.full_stop_semi_aperture_mm) = (other.iris, other.full_stop_semi_aperture_mm);
        self
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::{DVec2, DVec3};

    use super::*;
    use crate::{MonoLens, ObjectPoint, RayBatch, RayBatchF32, Vignetting};

    const SIX: Iris = Iris { blades: 6, rotation_deg: 0.0, curvature: 0.0 };

    fn stopped(lens: &Lens, iris: Option<Iris>, f_number: f64) -> MonoLens {
        lens.clone().with_iris(iris).unwrap().with_f_number(f_number, 550.0).unwrap().at(550.0).unwrap()
    }

    /// Rays along the axis over a square of this half width at the stop of a thin lens.
    fn grid(half_mm: f64, n: usize) -> RayBatch {
        let place = |i: usize| (2.0 * (i as f64 + 0.5) / n as f64 - 1.0) * half_mm;
        let points: Vec<DVec3> = (0..n * n).map(|i| DVec3::new(place(i % n), place(i / n), -1.0)).collect();
        RayBatch::from_points(&points, &vec![DVec3::Z; points.len()])
    }

    #[test]
    fn rays_through_the_iris_are_those_of_the_circle_in_number() {
        let lens = Lens::thin(50.0, 25.0).unwrap();
        // No side lies along the lines of the grid.
        for iris in [
            Iris { rotation_deg: 7.0, ..SIX },
            Iris { blades: 5, rotation_deg: 12.0, curvature: 0.4 },
            Iris { curvature: 1.0, ..SIX },
        ] {
            let stopped = stopped(&lens, Some(iris), 4.0);
            let (half_mm, n) = (9.0, 1200);
            let mut rays = grid(half_mm, n);
            stopped.trace(&mut rays, Vignetting::On);
            let counted_mm2 = rays.n_in_flight() as f64 * (2.0 * half_mm / n as f64).powi(2);
            // A grid counts an area to a few of the cells along its edge.
            assert!((counted_mm2 / (PI * 6.25f64.powi(2)) - 1.0).abs() < 1e-4, "{iris:?} {counted_mm2}");
            // Backwards and in single precision they are the same rays.
            let mut back = grid(half_mm, 300);
            let single = RayBatchF32::from(&back);
            let mut single = RayBatchF32 { z_mm: vec![1.0; back.len()], n: vec![-1.0; back.len()], ..single };
            stopped.trace(&mut back, Vignetting::On);
            stopped.reversed().trace_f32(&mut single);
            let differ = (0..back.len()).filter(|&i| back.fate[i].is_in_flight() != single.fate[i].is_in_flight());
            assert!(differ.count() <= 4);
        }
    }

    #[test]
    fn f_numbers_are_those_of_the_circle_to_the_digit() {
        for name in ["dgauss-50mm", "cooke-50mm"] {
            let lens = Lens::built_in(name).unwrap();
            let iris = Iris { rotation_deg: 30.0, ..SIX };
            let (round, iris) = (stopped(&lens, None, 8.0), stopped(&lens, Some(iris), 8.0));
            assert_eq!(round.first_order(), iris.first_order());
            assert_eq!(round.real_f_number(), iris.real_f_number());
            assert_eq!(round.working_f_number(700.0), iris.working_f_number(700.0));
            assert_eq!(round.stop_semi_aperture_mm(), iris.stop_semi_aperture_mm());
            let [a, b] = [&round, &iris].map(|lens| lens.f_number_of_light().unwrap());
            // The aberration of the pupil is another over a hexagon than over a circle.
            assert!((a / b - 1.0).abs() < 1e-3, "{name}: {a} {b}");
        }
    }

    #[test]
    fn fully_open_and_without_blades_every_digit_is_that_of_the_round_lens() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let open = lens.clone().with_iris(Some(Iris { curvature: 1.0, ..SIX })).unwrap();
        assert!(open.is_rotational() && open.iris_opening().is_none());
        let point = ObjectPoint::far(0.2, DVec2::Y);
        let [a, b] = [&lens, &open].map(|lens| crate::PupilRegion::find(&lens.at(550.0).unwrap(), &point, 48));
        assert_eq!(a, b);
        assert!(open.note_on_iris().unwrap().contains("its 6 blades show where it is closed"));
        let closed = open.with_f_number(4.0, 550.0).unwrap();
        assert!(!closed.is_rotational() && closed.is_centered_and_rotational() && closed.note_on_iris().is_none());
        assert_eq!(closed.mirror_symmetries(), [true; 2]);
    }

    #[test]
    fn the_pupil_of_a_thin_lens_is_the_opening() {
        let lens = stopped(&Lens::thin(50.0, 25.0).unwrap(), Some(SIX), 4.0);
        let point = ObjectPoint::Infinite(DVec3::Z);
        let boundary = crate::PupilBoundary::find(&lens, &point, 48).unwrap();
        let corners = boundary.corners_rad(&lens, &point);
        assert_eq!(corners.len(), 6, "{corners:?}");
        // A corner at the top.
        assert!(corners.iter().any(|corner| (corner - 0.5 * PI).abs() < 1e-4), "{corners:?}");
        let region = crate::PupilRegion::find(&lens, &point, 48).unwrap();
        assert!((region.area_mm2() / (PI * 6.25f64.powi(2)) - 1.0).abs() < 1e-3, "{}", region.area_mm2());
    }

    #[test]
    fn a_pinhole_has_no_iris_and_scale_keeps_its_shape() {
        let message = Lens::pinhole(0.2).unwrap().with_iris(Some(SIX)).unwrap_err().to_string();
        assert_eq!(message, "pinhole has no iris: it is a hole in a plate");
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_iris(Some(SIX)).unwrap();
        let lens = lens.with_f_number(8.0, 550.0).unwrap();
        let (one, twice) = (lens.iris_opening().unwrap(), lens.scaled(2.0).unwrap().iris_opening().unwrap());
        assert!((twice.extent_mm() / one.extent_mm() - 2.0).abs() < 1e-12);
        let behind = lens.with_ideal_lens_behind(1000.0).unwrap();
        assert_eq!(behind.iris_opening(), Some(one));
    }
}
