//! The beam of a point on the axis that real rays get through a lens with.

use glam::{DVec2, DVec3};

use crate::{Aperture, MonoLens, ObjectPoint, RayBatch, Vignetting, rays_towards, trace::Step};

/// Heights on the front at which rays are tried before the marginal ray is sought.
const N_HEIGHTS: usize = 256;
/// Halvings of the height between a ray that gets through and one that does not: to rounding.
const HALVINGS: usize = 60;
/// By how much of its radius the stop, or the beam that first-order optics has it let through, may be wider than the real
/// beam and the stop still count as what limits it: rims in files are rounded, and often just as wide as the beam.
const STOP_LIMITS: f64 = 1e-3;

/// The real beam of a point on the axis: what is nearest to the axis of the light that gets through.
///
/// Its marginal ray is the first ray from the axis outwards that a rim ends. The rim that ends it is the one that limits the
/// light, whichever surface the prescription calls the stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxialBeam {
    /// The surface whose rim, or whose end, limits the beam.
    pub limiting_surface: usize,
    /// Whether that is the stop; or a rim ends the beam that is, to 1e-3, no narrower than the stop or than the beam of
    /// first-order optics through its edge.
    pub is_limited_by_stop: bool,
    /// The marginal ray's height in the plane of the first vertex, mm.
    pub height_mm: f64,
    /// The tangent of the marginal ray's angle before the lens: 0 for a far point.
    pub slope_before: f64,
    /// The sine of the marginal ray's angle behind the lens, positive.
    pub sine_after: f64,
    /// How far from the middle of the stop the marginal ray passes it, mm.
    pub stop_radius_mm: f64,
}

impl MonoLens {
    /// Finds the beam of the point on the axis at this distance before the first vertex, mm (infinite for a far one).
    ///
    /// `None` where no light gets through close to the axis, and for lenses that are tilted, decentered or not of
    /// revolution: of those the stop is taken to limit the light. Obscurations are left out.
    pub fn axial_beam(&self, object_distance_mm: f64) -> Option<AxialBeam> {
        let is_round = |aperture: &Aperture| aperture.is_obscuration || aperture.is_rotational();
        let are_all_round = self.steps().iter().flat_map(|step| &step.apertures).all(is_round);
        if !self.is_centered() || !are_all_round || !self.steps().iter().all(Step::is_rotational) {
            return None;
        }
        let search = AxialSearch { lens: self, object_distance_mm };
        let front_mm = self.semi_aperture_mm(0);
        let height = |i: usize| front_mm * (i as f64 + 0.5) / N_HEIGHTS as f64;
        let heights: Vec<f64> = (0..N_HEIGHTS).map(height).collect();
        let dark = search.clearances(&heights).iter().position(|clearance| *clearance <= 0.0);
        let (mut inside_mm, mut outside_mm) = match dark {
            Some(0) => return None,
            Some(dark) => (heights[dark - 1], heights[dark]),
            None => (heights[N_HEIGHTS - 1], front_mm * (1.0 + 1e-12)),
        };
        for _ in 0..HALVINGS {
            let middle_mm = 0.5 * (inside_mm + outside_mm);
            *(if search.clearances(&[middle_mm])[0] > 0.0 { &mut inside_mm } else { &mut outside_mm }) = middle_mm;
        }
        search.beam(inside_mm, outside_mm)
    }
}

struct AxialSearch<'a> {
    lens: &'a MonoLens,
    object_distance_mm: f64,
}

impl AxialSearch<'_> {
    /// Returns the rays through these heights of the first surface, from before it.
    fn rays(&self, heights_mm: &[f64]) -> RayBatch {
        let on_front = |height_mm: &f64| self.lens.on_front_mm(DVec2::new(0.0, *height_mm));
        let points: Vec<DVec3> = heights_mm.iter().map(on_front).collect();
        let point = match self.object_distance_mm.is_finite() {
            true => ObjectPoint::Finite(DVec3::Z * -self.object_distance_mm),
            false => ObjectPoint::Infinite(DVec3::Z),
        };
        let in_vertex_plane = |on_front: &DVec3| {
            let direction = point.direction_to(*on_front);
            (*on_front - direction * (on_front.z / direction.z)).truncate()
        };
        let targets: Vec<DVec2> = points.iter().map(in_vertex_plane).collect();
        rays_towards(&point, &targets, 0.0, 0.0)
    }

    fn clearances(&self, heights_mm: &[f64]) -> Vec<f64> {
        self.lens.clearances_mm(self.rays(heights_mm))
    }

    /// Returns the beam between a ray just inside and one just outside.
    fn beam(&self, inside_mm: f64, outside_mm: f64) -> Option<AxialBeam> {
        let mut rays = self.rays(&[inside_mm, outside_mm]);
        let (height_mm, before) = (rays.y_mm[0], rays.direction(0));
        let (mut least_mm, mut limiting_surface, mut stop_radius_mm) = (f64::INFINITY, 0, f64::NAN);
        for (surface, step) in self.lens.steps().iter().enumerate() {
            self.lens.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::Off);
            let openings = step.apertures.iter().map(|aperture| aperture.clearance_mm(0.0, rays.y_mm[0]));
            let clearance_mm = openings.fold(step.semi_aperture - rays.y_mm[0].abs(), f64::min);
            if surface == self.lens.stop() {
                stop_radius_mm = rays.y_mm[0].abs();
            }
            // A surface that the outer ray does not meet, or that reflects it totally, ends the beam as a rim does.
            let is_end = !rays.fate[1].is_in_flight() && rays.fate[1].surface() == Some(surface);
            if clearance_mm < least_mm || is_end {
                (least_mm, limiting_surface) = (if is_end { f64::NEG_INFINITY } else { clearance_mm }, surface);
            }
        }
        if !rays.fate[0].is_in_flight() || height_mm <= 0.0 {
            return None;
        }
        let stop = self.lens.stop();
        let (is_far, slope) = (self.object_distance_mm.is_infinite(), before.y / before.z);
        let to_stop = self.lens.marginal_ray_of_stop(self.object_distance_mm);
        let of_paraxial = match is_far {
            true => height_mm / to_stop.height_mm,
            false => slope * self.lens.object_index() / to_stop.reduced_slope,
        };
        let of_stop = stop_radius_mm / self.lens.stop_semi_aperture_mm();
        let is_limited_by_stop = limiting_surface == stop || of_stop.max(of_paraxial.abs()) >= 1.0 - STOP_LIMITS;
        let after = rays.direction(0);
        Some(AxialBeam {
            limiting_surface: if is_limited_by_stop { stop } else { limiting_surface },
            is_limited_by_stop,
            height_mm,
            slope_before: if is_far { 0.0 } else { slope },
            sine_after: after.y.abs(),
            stop_radius_mm,
        })
    }
}
