//! What gratings and diffractive surfaces do to rays that have come to them.

use glam::{DVec2, DVec3};

use super::{Kind, Step};
use crate::{
    RayFate,
    rays::RaySlices,
    wavefront_error::{Meeting, WavefrontMaps},
};

/// How often a direction is found again that the phase depends on: each time it is nearer by the share of the field that the phase turns
/// light by where the field differs by one, below a hundredth.
const TURNS: usize = 8;

/// What a surface adds to the paths of light of one wavelength in one order.
#[derive(Clone, Debug)]
pub(crate) enum Phase {
    /// A path that grows evenly.
    Grating {
        /// Its slopes along x and y.
        slope: DVec2,
    },
    /// A sum of even powers of the distance from the axis.
    Rings {
        /// One over the square of the radius that distances count in.
        per_mm2: f64,
        /// The coefficients of ρ², ρ⁴ and on, mm.
        coefficients_mm: Vec<f64>,
    },
    /// A wavefront error, which is ahead where paths are shorter.
    Wavefront(WavefrontMaps),
}

impl Phase {
    /// Returns the path that is added where a ray meets the surface, mm, and its slopes there.
    fn at(&self, meeting: Meeting) -> (f64, DVec2) {
        let place_mm = meeting.place_mm;
        match self {
            Self::Grating { slope } => (slope.dot(place_mm), *slope),
            Self::Rings { per_mm2, coefficients_mm } => {
                let square = place_mm.length_squared() * per_mm2;
                let (mut sum, mut derivative) = (0.0, 0.0);
                for a in coefficients_mm.iter().rev() {
                    sum = (sum + a) * square;
                }
                for (i, a) in coefficients_mm.iter().enumerate().rev() {
                    derivative = derivative * square + (i + 1) as f64 * a;
                }
                (sum, place_mm * (2.0 * derivative * per_mm2))
            }
            Self::Wavefront(maps) => {
                let (ahead_mm, slope) = maps.at(meeting);
                (-ahead_mm, -slope)
            }
        }
    }

    /// The coefficient of r² or r⁴ (`i` 1 or 2) of the path, 1/mm or 1/mm³.
    fn of_power(&self, i: usize) -> f64 {
        match self {
            Self::Grating { .. } => 0.0,
            Self::Rings { per_mm2, coefficients_mm } => {
                coefficients_mm.get(i - 1).copied().unwrap_or(0.0) * per_mm2.powi(i as i32)
            }
            Self::Wavefront(maps) => -maps.of_power(i),
        }
    }

    /// The paraxial power, 1/mm: what it takes from n u over the height.
    pub(crate) fn power(&self) -> f64 {
        -2.0 * self.of_power(1)
    }

    /// The coefficient of r⁴ of the path, 1/mm³.
    pub(crate) fn fourth_order_per_mm3(&self) -> f64 {
        self.of_power(2)
    }

    /// Returns it for an object plane that appears there to the surface, from it, mm.
    pub(crate) fn of_object_at(self, z_mm: f64) -> Self {
        match self {
            Self::Wavefront(maps) => Self::Wavefront(maps.of_object_at(z_mm)),
            other => other,
        }
    }

    /// Returns it for light that meets it from the other side.
    pub(crate) fn turned_round(self) -> Self {
        match self {
            Self::Wavefront(maps) => Self::Wavefront(maps.turned_round()),
            other => other,
        }
    }

    /// Whether it differs between fields.
    pub(crate) fn varies(&self) -> bool {
        matches!(self, Self::Wavefront(maps) if maps.varies())
    }

    /// Whether the path depends on the direction in which light goes on, which it turns itself.
    fn depends_on_way_on(&self) -> bool {
        matches!(self, Self::Wavefront(maps) if maps.varies() && maps.is_met_from_behind)
    }

    /// Whether the path is the same all around the axis.
    fn is_rotational(&self) -> bool {
        match self {
            Self::Grating { slope } => *slope == DVec2::ZERO,
            Self::Rings { .. } => true,
            Self::Wavefront(maps) => maps.is_rotational(),
        }
    }
}

impl Step {
    /// Returns the step at which nothing bends, so that rays come to the surface and no further.
    pub(super) fn reached(&self) -> Self {
        Self { index_after: self.index_before, is_mirror: false, phase: None, ..self.clone() }
    }

    /// Whether what it does to light is the same all around its axis.
    pub(crate) fn is_rotational(&self) -> bool {
        let is_phase_round = self.phase.as_ref().is_none_or(Phase::is_rotational);
        is_phase_round && !matches!(self.kind, Kind::Toric(_))
    }

    /// Returns the normal of the surface over a place of its vertex plane, of any length, pointing downstream.
    pub(crate) fn normal_at(&self, place_mm: DVec2) -> DVec3 {
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
        let optical = direction * self.index_before;
        let turned = |slope: DVec2| {
            // What is along the surface stays, what is across it makes the length that of the index behind.
            let optical = optical + slope.extend(0.0);
            let along = optical - normal * optical.dot(normal);
            let across2 = self.index_after * self.index_after - along.length_squared();
            let across = if self.is_mirror { -across2.sqrt() } else { across2.sqrt() };
            (across2 >= 0.0).then(|| (along + normal * across) / self.index_after)
        };
        let (mut longer_mm, slope) = phase.at(Meeting { place_mm, direction });
        let mut after = turned(slope);
        let n_more = if phase.depends_on_way_on() { TURNS } else { 0 };
        for _ in 0..n_more {
            let Some(direction) = after else { break };
            let (now_mm, slope) = phase.at(Meeting { place_mm, direction });
            (longer_mm, after) = (now_mm, turned(slope));
        }
        (after, longer_mm)
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
