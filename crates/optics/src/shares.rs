//! The share of light that a lens lets through, over the rays of a beam.

use glam::DVec3;

use crate::{MonoLens, ObjectPoint, PupilRegion, RayBatch, RayLight, Vignetting};

/// Rings of rays over which the transmission of the beam on the axis is taken, and azimuths.
const AXIAL_RINGS: usize = 4;
const AXIAL_AZIMUTHS: usize = 48;

impl MonoLens {
    /// Whether no light is lost at surfaces or in glass.
    pub fn is_lossless(&self) -> bool {
        self.losses.is_none()
    }

    /// Traces rays through all surfaces, as [`trace`](Self::trace) does, and returns for each the share of unpolarized light that surfaces
    /// and the glass between the first and the last let through; 0 of rays that end.
    ///
    /// The light is that which goes straight on: what is reflected twice comes on top (ghosts). Diffraction orders are not in it
    /// ([`diffraction_efficiency`](Self::diffraction_efficiency)).
    pub fn trace_shares(&self, rays: &mut RayBatch, rims: Vignetting) -> Vec<f64> {
        let mut light = RayLight::unpolarized(rays.len());
        self.trace_light(rays, &mut light, rims);
        (0..rays.len()).map(|i| if rays.fate[i].is_in_flight() { light.share(i) } else { 0.0 }).collect()
    }

    /// Returns the mean share of light that the lens lets through over the beam of a point on the axis that gets through its rims; `None`
    /// where none does. Far points have a distance of infinity; others are counted in mm from the first vertex.
    pub fn axial_transmission(&self, object_distance_mm: f64) -> Option<f64> {
        if self.is_lossless() {
            return Some(1.0);
        }
        let point = match object_distance_mm.is_finite() {
            true => ObjectPoint::Finite(DVec3::new(0.0, 0.0, -object_distance_mm)),
            false => ObjectPoint::Infinite(DVec3::Z),
        };
        let region = PupilRegion::find(self, &point, AXIAL_AZIMUTHS)?;
        Some(self.mean_share(&region, &point, AXIAL_RINGS))
    }

    /// Returns the f-number of the round beam with as much light, of a lens whose pupil is no whole disc: with openings of other shapes or
    /// obscurations, tilted or decentered; that of first-order optics for others.
    pub fn f_number_by_area(&self) -> f64 {
        let f_number = self.first_order().f_number;
        let has_odd_apertures = !self.is_rotational() || self.n_obscurations() > 0;
        // Of a stop that is no circle, by how its area compares with that of the round axial beam.
        match (has_odd_apertures.then(|| self.f_number_of_light()).flatten(), self.real_f_number()) {
            (Some(of_light), Some(real)) => f_number * (of_light / real),
            (of_light, _) => of_light.unwrap_or(f_number),
        }
    }

    /// Returns the T-number: the f-number, by area, of a lens without losses that has as much light, for a point on the axis at this distance. `None`
    /// where no light gets through the rims.
    pub fn t_number(&self, object_distance_mm: f64) -> Option<f64> {
        self.axial_transmission(object_distance_mm).map(|share| self.f_number_by_area() / share.sqrt())
    }

    /// Returns the mean share of a point's light that the lens lets through, over a region of its pupil.
    pub(crate) fn mean_share(&self, region: &PupilRegion, point: &ObjectPoint, n_rings: usize) -> f64 {
        if self.is_lossless() {
            return 1.0;
        }
        let (targets, areas): (Vec<_>, Vec<f64>) = region.nodes(n_rings).into_iter().unzip();
        let mut rays = region.plane().rays(self, point, &targets);
        let shares = self.trace_shares(&mut rays, Vignetting::Off);
        let lit = (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight());
        let (light, area) = lit.fold((0.0, 0.0), |(light, area), i| (light + shares[i] * areas[i], area + areas[i]));
        if area > 0.0 { light / area } else { 0.0 }
    }
}
