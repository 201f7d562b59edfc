//! The beam of a point on the axis that real rays get through a lens with.

use glam::{DVec2, DVec3};

use crate::{MonoLens, ObjectPoint, RayBatch, Vignetting, rays_towards, trace::Step};

/// Heights on the front at which rays are tried before the marginal ray is sought.
const N_HEIGHTS: usize = 256;
/// Halvings of the height between a ray that gets through and one that does not: to rounding.
const HALVINGS: usize = 60;
/// By how much of its radius the stop, or the beam that first-order optics has it let through, may be wider than the real
/// beam and the stop still count as what limits it: rims in files are rounded, and often just as wide as the beam.
const STOP_LIMITS: f64 = 1e-3;

/// The real beam of a point on the axis: what is nearest to the axis of the light that gets through.
///
/// Its marginal ray is the first ray from the axis outwards that a rim or an opening ends. What ends it is what limits the
/// light, whichever surface the prescription calls the stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxialBeam {
    /// The surface whose rim or opening, or whose end, limits the beam.
    pub limiting_surface: usize,
    /// Whether that is the rim of the stop; or a rim ends the beam that is, to 1e-3, no narrower than the stop or than the beam of
    /// first-order optics through its edge.
    pub is_limited_by_stop: bool,
    /// Whether it is an opening that is no round rim.
    pub is_limited_by_opening: bool,
    /// The marginal ray's height in the plane of the first vertex, mm; where the beam reaches farther to one side of the axis
    /// than to the other, the mean of both, here and below.
    pub height_mm: f64,
    /// The tangent of the marginal ray's angle before the lens: 0 for a far point.
    pub slope_before: f64,
    /// The sine of the marginal ray's angle behind the lens, positive.
    pub sine_after: f64,
    /// How far from the middle of the stop the marginal ray passes it, mm.
    pub stop_radius_mm: f64,
}

impl MonoLens {
    /// Finds the beam of the point on the axis at this distance before the first vertex, mm (infinite for a far one), in the
    /// y–z plane.
    ///
    /// `None` where no light gets through close to the axis, and for lenses that are tilted, decentered or not of
    /// revolution: of those the stop is taken to limit the light. Obscurations are left out, and blades count as the circle of the area that
    /// they leave open.
    pub fn axial_beam(&self, object_distance_mm: f64) -> Option<AxialBeam> {
        self.axial_beam_along(object_distance_mm, DVec2::Y)
    }

    /// The same in the plane through the axis and this direction across it.
    pub(super) fn axial_beam_along(&self, object_distance_mm: f64, direction: DVec2) -> Option<AxialBeam> {
        if let Some(round) = self.with_round_iris() {
            return round.axial_beam_along(object_distance_mm, direction);
        }
        if !self.is_centered() || !self.steps().iter().all(Step::is_rotational) {
            return None;
        }
        let one_side = |direction| AxialSearch { lens: self, object_distance_mm, direction }.find();
        let beam = one_side(direction)?;
        let mut apertures = self.steps().iter().flat_map(|step| &step.apertures);
        if apertures.all(|aperture| aperture.is_obscuration || aperture.center_mm == [0.0; 2]) {
            return Some(beam);
        }
        // An opening beside the axis lets the light of one side farther than that of the other.
        let other = one_side(-direction)?;
        let (near, far) = if beam.height_mm < other.height_mm { (beam, other) } else { (other, beam) };
        let mean = |of: fn(&AxialBeam) -> f64| 0.5 * (of(&near) + of(&far));
        Some(AxialBeam {
            is_limited_by_stop: near.is_limited_by_stop && far.is_limited_by_stop,
            height_mm: mean(|beam| beam.height_mm),
            slope_before: mean(|beam| beam.slope_before),
            sine_after: mean(|beam| beam.sine_after),
            stop_radius_mm: mean(|beam| beam.stop_radius_mm),
            ..near
        })
    }
}

/// A search for the beam to one side of the axis.
struct AxialSearch<'a> {
    lens: &'a MonoLens,
    object_distance_mm: f64,
    /// The side: a unit vector across the axis.
    direction: DVec2,
}

impl AxialSearch<'_> {
    fn find(&self) -> Option<AxialBeam> {
        let front_mm = self.lens.semi_aperture_mm(0);
        let height = |i: usize| front_mm * (i as f64 + 0.5) / N_HEIGHTS as f64;
        let heights: Vec<f64> = (0..N_HEIGHTS).map(height).collect();
        let dark = self.clearances(&heights).iter().position(|clearance| *clearance <= 0.0);
        let (mut inside_mm, mut outside_mm) = match dark {
            Some(0) => return None,
            Some(dark) => (heights[dark - 1], heights[dark]),
            None => (heights[N_HEIGHTS - 1], front_mm * (1.0 + 1e-12)),
        };
        for _ in 0..HALVINGS {
            let middle_mm = 0.5 * (inside_mm + outside_mm);
            *(if self.clearances(&[middle_mm])[0] > 0.0 { &mut inside_mm } else { &mut outside_mm }) = middle_mm;
        }
        self.beam(inside_mm, outside_mm)
    }

    /// Returns the rays through these heights of the first surface, from before it.
    fn rays(&self, heights_mm: &[f64]) -> RayBatch {
        let on_front = |height_mm: &f64| self.lens.on_front_mm(*height_mm * self.direction);
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
        let across = |rays: &RayBatch| rays.point_mm(0).truncate();
        let (height_mm, before) = (across(&rays).dot(self.direction), rays.direction(0));
        let (mut least_mm, mut limiting_surface, mut stop_radius_mm) = (f64::INFINITY, 0, f64::NAN);
        let mut is_limited_by_opening = false;
        for (surface, step) in self.lens.steps().iter().enumerate() {
            self.lens.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::Off);
            let at = across(&rays);
            let of_rim_mm = step.semi_aperture - at.length();
            let openings = step.apertures.iter().map(|aperture| aperture.clearance_mm(at.x, at.y));
            let clearance_mm = openings.fold(of_rim_mm, f64::min);
            if surface == self.lens.stop() {
                stop_radius_mm = at.length();
            }
            // A surface that the outer ray does not meet, or that reflects it totally, ends the beam as a rim does.
            let is_end = !rays.fate[1].is_in_flight() && rays.fate[1].surface() == Some(surface);
            if clearance_mm < least_mm || is_end {
                (least_mm, limiting_surface) = (if is_end { f64::NEG_INFINITY } else { clearance_mm }, surface);
                is_limited_by_opening = !is_end && clearance_mm < of_rim_mm;
            }
        }
        if !rays.fate[0].is_in_flight() || height_mm <= 0.0 {
            return None;
        }
        let stop = self.lens.stop();
        let (is_far, slope) = (self.object_distance_mm.is_infinite(), before.truncate().dot(self.direction) / before.z);
        let to_stop = self.lens.marginal_ray_of_stop(self.object_distance_mm);
        let of_paraxial = match is_far {
            true => height_mm / to_stop.height_mm,
            false => slope * self.lens.object_index() / to_stop.reduced_slope,
        };
        let of_stop = stop_radius_mm / self.lens.stop_semi_aperture_mm();
        let is_rim_of_stop = limiting_surface == stop && !is_limited_by_opening;
        let is_limited_by_stop = is_rim_of_stop || of_stop.max(of_paraxial.abs()) >= 1.0 - STOP_LIMITS;
        let after = rays.direction(0);
        Some(AxialBeam {
            limiting_surface: if is_limited_by_stop { stop } else { limiting_surface },
            is_limited_by_stop,
            is_limited_by_opening: is_limited_by_opening && !is_limited_by_stop,
            height_mm,
            slope_before: if is_far { 0.0 } else { slope },
            sine_after: after.truncate().length(),
            stop_radius_mm,
        })
    }
}
