//! What gratings and diffractive surfaces do to rays that have come to them.

use glam::{DVec2, DVec3};

use super::{Kind, Step};
use crate::{PhaseProfile, RayFate, rays::RaySlices};

/// The phase of a surface in one order, as a path.
#[derive(Clone, Debug)]
pub(crate) struct Phase {
    pub(crate) profile: PhaseProfile,
    /// The order times the wavelength: the path that a cycle adds, mm.
    pub(crate) path_per_cycle_mm: f64,
}

impl Phase {
    /// The paraxial power, 1/mm.
    pub(crate) fn power(&self) -> f64 {
        self.profile.power_of_path() * self.path_per_cycle_mm
    }

    /// The coefficient of r⁴ of the path, 1/mm³.
    pub(crate) fn fourth_order_per_mm3(&self) -> f64 {
        self.profile.fourth_order_per_mm4() * self.path_per_cycle_mm
    }
}

impl Step {
    /// Returns the step at which nothing bends, so that rays come to the surface and no further.
    pub(super) fn reached(&self) -> Self {
        Self { index_after: self.index_before, is_mirror: false, phase: None, ..self.clone() }
    }

    /// Whether what it does to light is the same all around its axis.
    pub(crate) fn is_rotational(&self) -> bool {
        let is_phase_round = self.phase.as_ref().is_none_or(|phase| phase.profile.is_rotational());
        is_phase_round && !matches!(self.kind, Kind::Toric(_))
    }

    /// Returns the normal of the surface over a place of its vertex plane, of any length, pointing downstream.
    fn normal_at(&self, place_mm: DVec2) -> DVec3 {
        let c = self.curvature;
        let square = place_mm.length_squared();
        let conic_slope = |conic: f64| c / (1.0 - (1.0 + conic) * c * c * square).sqrt();
        // The slope of the sag over the distance from the axis.
        let slope = match &self.kind {
            Kind::Window | Kind::ThinLens { .. } => 0.0,
            Kind::Sphere => conic_slope(0.0),
            Kind::Conic { conic } => conic_slope(*conic),
            Kind::EvenAsphere { conic, a2, coefficients } => {
                let higher = coefficients.iter().enumerate().rev();
                let sum = higher.fold(0.0, |sum, (i, a)| sum * square + (2 * i + 4) as f64 * a);
                conic_slope(*conic) + 2.0 * a2 + sum * square
            }
            Kind::OddAsphere { conic, coefficients } => {
                let r = square.sqrt();
                let terms = coefficients.iter().enumerate().rev();
                let sum = terms.fold(0.0, |sum, (i, a)| sum * r + (i + 1) as f64 * a);
                conic_slope(*conic) + if r > 0.0 { sum / r } else { 0.0 }
            }
            Kind::Toric(toric) => {
                let sag = toric.at(place_mm.x, place_mm.y);
                return DVec3::new(-sag.slope_x, -sag.slope_y, 1.0);
            }
        };
        (-slope * place_mm).extend(1.0)
    }

    /// Refracts or reflects a ray at a place of the surface, in its own frame, with the phase that it adds there; returns the
    /// new direction, or `None` where the order does not propagate, and how much longer the path becomes.
    fn diffract(&self, phase: &Phase, place_mm: DVec2, direction: DVec3) -> (Option<DVec3>, f64) {
        let normal = self.normal_at(place_mm).normalize();
        let per_mm = phase.profile.gradient_per_mm(place_mm) * phase.path_per_cycle_mm;
        let optical = direction * self.index_before + per_mm.extend(0.0);
        // What is along the surface stays, what is across it makes the length that of the index behind.
        let along = optical - normal * optical.dot(normal);
        let across2 = self.index_after * self.index_after - along.length_squared();
        let across = if self.is_mirror { -across2.sqrt() } else { across2.sqrt() };
        let after = (across2 >= 0.0).then(|| (along + normal * across) / self.index_after);
        (after, phase.profile.cycles_at(place_mm) * phase.path_per_cycle_mm)
    }

    /// Turns the rays in flight that are on the surface, given in its own frame; those whose order does not propagate end there.
    pub(super) fn diffract_all(&self, phase: &Phase, surface: u16, rays: &mut RaySlices<'_>) {
        for i in (0..rays.fate.len()).filter(|&i| rays.fate[i].is_in_flight()).collect::<Vec<_>>() {
            let (direction, longer_mm) = self.diffract(phase, rays.point(i).truncate(), rays.direction(i));
            match direction {
                Some(direction) => rays.set_direction(i, direction),
                None => rays.fate[i] = RayFate::TotalReflection { surface },
            }
            rays.opl[i] += longer_mm;
        }
    }
}
