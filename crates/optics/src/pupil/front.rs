//! The front of a lens as coordinates of a pupil.

use glam::{DVec2, DVec3};

use super::PupilPlane;
use crate::{MonoLens, ObjectPoint, Placement, Surface, Vignetting};

/// How far from where a ray was aimed at on the first surface it may meet it, over the rim's radius.
const SAME_PLACE: f64 = 1e-8;
/// The cross-section over the area of a place below which light counts as passing the front by: where a ray meets it is known to rounding
/// over this, and where it leaves a sphere again lies twice the radius times this from there. A hundred-millionth of the light of the axis and less comes so.
const LEAST_FACING: f64 = 1e-5;
/// The step of differences over the first surface, over the rim's radius.
const STEP: f64 = 1e-6;

/// The first surface of a lens as seen by a point: places are x and y of where light meets it.
///
/// Across light that grazes the front, a pupil is a strip along the front's outline, too narrow to be found in a plane that faces the
/// light. Over the front itself it is as wide as a square root of that, and its ends are corners.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Front {
    surface: Surface,
    /// Where it stands.
    placement: Placement,
    point: ObjectPoint,
    plane: PupilPlane,
}

impl Front {
    /// Returns the front of a lens.
    pub(super) fn of(lens: &MonoLens, point: &ObjectPoint, plane: PupilPlane) -> Self {
        let placement = lens.placements().map_or(Placement::centered(0.0), |placements| placements[0]);
        // The rim of a front that blades close is that of the open stop.
        let surface = Surface { semi_aperture_mm: lens.semi_aperture_mm(0), ..lens.front().clone() };
        Self { surface, placement, point: *point, plane }
    }

    /// Returns the point of the first surface over a place, mm; `None` beyond its rim or its equator.
    fn on_front_mm(&self, place_mm: DVec2) -> Option<DVec3> {
        let z_mm = self.surface.sag_at_mm(place_mm.x, place_mm.y);
        let is_on_front = place_mm.length() <= self.surface.semi_aperture_mm && z_mm.is_finite();
        is_on_front.then(|| self.placement.lens_from_surface(place_mm.extend(z_mm)))
    }

    /// Returns where the ray through a place crosses the pupil's plane, mm.
    pub(super) fn target_mm(&self, place_mm: DVec2) -> DVec2 {
        let on_front_mm = self.on_front_mm(place_mm).unwrap_or(self.placement.lens_from_surface(place_mm.extend(0.0)));
        self.plane.meets_mm(on_front_mm, self.point.direction_to(on_front_mm))
    }

    /// The light's cross-section over the area of the places, at a place and its point, where it meets the front from before it; below 0
    /// where it would meet it from behind.
    fn facing(&self, place_mm: DVec2, on_front_mm: DVec3) -> f64 {
        let step_mm = STEP * self.surface.semi_aperture_mm;
        let sag_mm = |x: f64, y: f64| self.surface.sag_at_mm(place_mm.x + x * step_mm, place_mm.y + y * step_mm);
        let (rise_x, rise_y) = (sag_mm(1.0, 0.0) - sag_mm(-1.0, 0.0), sag_mm(0.0, 1.0) - sag_mm(0.0, -1.0));
        let direction = self.placement.direction_to_own(self.point.direction_to(on_front_mm));
        direction.z - 0.5 * (direction.x * rise_x + direction.y * rise_y) / step_mm
    }

    /// Returns the area in the pupil's plane of a unit of area of the places.
    pub(super) fn stretch(&self, place_mm: DVec2) -> f64 {
        let Some(on_front_mm) = self.on_front_mm(place_mm) else { return 0.0 };
        let direction = self.point.direction_to(on_front_mm);
        let across = self.facing(place_mm, on_front_mm) / direction.dot(self.plane.normal()).abs();
        match self.point {
            ObjectPoint::Infinite(_) => across,
            // As seen from the point, areas grow with the square of their distance.
            ObjectPoint::Finite(from_mm) => {
                let in_plane_mm = self.plane.in_lens_mm(self.target_mm(place_mm));
                across * from_mm.distance_squared(in_plane_mm) / from_mm.distance_squared(on_front_mm)
            }
        }
    }

    /// Returns by how much each ray through these places stays inside what it comes nearest to, mm: the rims, or the outline of the
    /// front.
    pub(super) fn clearances(&self, lens: &MonoLens, places_mm: &[DVec2]) -> Vec<f64> {
        let radius_mm = self.surface.semi_aperture_mm;
        let mut clearances = Vec::with_capacity(places_mm.len());
        // Only where light meets the front from before it are there rays to trace.
        let (mut faced, mut targets_mm) = (Vec::new(), Vec::new());
        for (i, &place_mm) in places_mm.iter().enumerate() {
            let Some(on_front_mm) = self.on_front_mm(place_mm) else {
                let beyond_mm = radius_mm - place_mm.length();
                clearances.push(if beyond_mm < 0.0 { beyond_mm } else { f64::NEG_INFINITY });
                continue;
            };
            let facing_mm = (self.facing(place_mm, on_front_mm) - LEAST_FACING) * radius_mm;
            clearances.push(facing_mm);
            if facing_mm > 0.0 {
                faced.push(i);
                targets_mm.push(self.plane.meets_mm(on_front_mm, self.point.direction_to(on_front_mm)));
            }
        }
        let rays = self.plane.rays(lens, &self.point, &targets_mm);
        let mut met = rays.clone();
        lens.trace_surfaces(0..1, &mut met, Vignetting::Off);
        for (number, (i, clearance_mm)) in faced.into_iter().zip(lens.clearances_mm(rays)).enumerate() {
            let met_mm = self.placement.surface_from_lens(met.point_mm(number)).truncate();
            let is_met = met_mm.distance(places_mm[i]) <= SAME_PLACE * radius_mm;
            clearances[i] = if is_met { clearances[i].min(clearance_mm) } else { f64::NEG_INFINITY };
        }
        clearances
    }

    /// Returns where rays to these places of the pupil's plane, mm, meet the front.
    pub(super) fn places_mm(&self, lens: &MonoLens, targets_mm: &[DVec2]) -> Vec<DVec2> {
        let mut rays = self.plane.rays(lens, &self.point, targets_mm);
        lens.trace_surfaces(0..1, &mut rays, Vignetting::Off);
        let met = (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight());
        met.map(|i| self.placement.surface_from_lens(rays.point_mm(i)).truncate()).collect()
    }
}
