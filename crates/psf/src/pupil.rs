//! The vignetted pupil, found from that of a neighboring point.

use dioptric_optics::{MonoLens, ObjectPoint, PupilBoundary, rays_towards};
use glam::DVec2;

use crate::mesh::polar;

/// How near to a rim the pupil's edge must pass, mm: the pupil's area is then good to 1e-8.
const TOLERANCE_MM: f64 = 1e-8;
/// How far the center may be from the centroid of the edge about it, as a share of the radius. Rays are interpolated between points
/// by their places about the center, so it must be that of the pupil alone, wherever the search began.
const OFF_CENTER: f64 = 2e-3;

/// The edge of a pupil in the entrance-pupil plane, at equally spaced azimuths about a center.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pupil {
    pub(crate) center_mm: DVec2,
    pub(crate) z_mm: f64,
    pub(crate) rho_mm: Vec<f64>,
}

impl Pupil {
    /// Finds the pupil from nothing.
    pub(crate) fn find(lens: &MonoLens, point: &ObjectPoint, n_azimuths: usize) -> Option<Self> {
        let boundary = PupilBoundary::find(lens, point, n_azimuths)?;
        Some(Self {
            center_mm: boundary.center_mm(),
            z_mm: boundary.z_mm(),
            rho_mm: boundary.rho_at_azimuths_mm().to_vec(),
        })
    }

    /// Finds the pupil of a point whose pupil should be like this one, or from nothing if it is not.
    pub(crate) fn near(&self, lens: &MonoLens, point: &ObjectPoint) -> Option<Self> {
        self.clone().moved(lens, point).or_else(|| {
            let found = Self::find(lens, point, self.rho_mm.len())?;
            Some(found.clone().settled(lens, point).unwrap_or(found))
        })
    }

    /// Finds the pupil of a point whose pupil has the middle of this one within it; `None` where it has not, or there is none.
    pub(crate) fn moved(self, lens: &MonoLens, point: &ObjectPoint) -> Option<Self> {
        Self { z_mm: lens.projection_center_z_mm(), ..self }.settled(lens, point)
    }

    /// Returns the region about its own centroid, its edge moved to where clearances are 0; `None` if that does not converge.
    fn settled(self, lens: &MonoLens, point: &ObjectPoint) -> Option<Self> {
        const MOST_STEPS: usize = 8;
        // Any three digits of the edge tell where the center is.
        let coarse_mm = 1e-3 * TOLERANCE_MM.sqrt();
        let mut here = self.refined(lens, point, coarse_mm)?;
        for _ in 0..MOST_STEPS {
            let (center_mm, radius_mm) = (here.center_mm, here.mean_radius_mm());
            let next = here.recentered();
            if next.center_mm.distance(center_mm) <= OFF_CENTER * radius_mm {
                return next.refined(lens, point, TOLERANCE_MM);
            }
            here = next.refined(lens, point, coarse_mm)?;
        }
        here.refined(lens, point, TOLERANCE_MM)
    }

    pub(crate) fn mean_radius_mm(&self) -> f64 {
        self.rho_mm.iter().sum::<f64>() / self.rho_mm.len() as f64
    }

    /// Returns the same region with its edge at so many azimuths, by straight lines between those known.
    pub(crate) fn resampled(&self, n_azimuths: usize) -> Self {
        let n = self.rho_mm.len();
        let edge = |i: usize| {
            let place = i as f64 * n as f64 / n_azimuths as f64;
            let (below, fraction) = (place as usize, place.fract());
            self.rho_mm[below % n] * (1.0 - fraction) + self.rho_mm[(below + 1) % n] * fraction
        };
        Self { rho_mm: (0..n_azimuths).map(edge).collect(), ..self.clone() }
    }

    fn azimuth(&self, i: usize) -> f64 {
        std::f64::consts::TAU * i as f64 / self.rho_mm.len() as f64
    }

    /// Returns the same region seen from its centroid, the sum over azimuths of ρ³/3 over that of ρ²/2; its edge by straight lines between what was known.
    fn recentered(self) -> Self {
        let n = self.rho_mm.len();
        let edge: Vec<DVec2> = (0..n).map(|i| polar(DVec2::ZERO, self.rho_mm[i], self.azimuth(i))).collect();
        let area: f64 = self.rho_mm.iter().map(|r| r * r).sum::<f64>() / 2.0;
        let shift = edge.iter().map(|p| *p * (p.length_squared() / 3.0)).sum::<DVec2>() / area;
        let rho_mm = (0..n).map(|i| ray_to_polygon(shift, DVec2::from_angle(self.azimuth(i)), &edge)).collect();
        Self { center_mm: self.center_mm + shift, rho_mm, ..self }
    }

    /// Returns the region with its edge moved to where clearances are 0, or `None` if that does not converge.
    fn refined(mut self, lens: &MonoLens, point: &ObjectPoint, tolerance_mm: f64) -> Option<Self> {
        let n = self.rho_mm.len();
        let (center_mm, z_mm) = (self.center_mm, self.z_mm);
        let azimuths: Vec<f64> = (0..n).map(|i| self.azimuth(i)).collect();
        let clearances = |rho: &[f64]| {
            let targets: Vec<DVec2> = (0..n).map(|i| polar(center_mm, rho[i], azimuths[i])).collect();
            lens.clearances_mm(rays_towards(point, &targets, z_mm, 0.0))
        };
        let center = rays_towards(point, &[self.center_mm], self.z_mm, 0.0);
        let at_center = lens.clearances_mm(center)[0];
        if at_center <= 0.0 {
            return None;
        }
        let mut inside = vec![(0.0, at_center); n];
        let mut outside = vec![(f64::INFINITY, f64::NAN); n];
        let mut previous = inside.clone();
        let mut here = self.rho_mm.clone();
        for _ in 0..60 {
            let values = clearances(&here);
            let mut is_done = true;
            for i in 0..n {
                let (r, f) = (here[i], values[i]);
                if f.abs() <= tolerance_mm || outside[i].0 - inside[i].0 <= tolerance_mm {
                    self.rho_mm[i] = if f >= -tolerance_mm { r } else { inside[i].0 };
                    continue;
                }
                is_done = false;
                if f > 0.0 {
                    inside[i] = (r, f);
                } else {
                    outside[i] = (r, f);
                }
                here[i] = next_guess(previous[i], (r, f), inside[i].0, outside[i].0);
                previous[i] = (r, f);
            }
            if is_done {
                return self.rho_mm.iter().all(|r| *r > 0.0).then_some(self);
            }
        }
        None
    }
}

/// Returns the next place to look for a root: the secant's, if it stays in the bracket.
fn next_guess((r0, f0): (f64, f64), (r1, f1): (f64, f64), inside: f64, outside: f64) -> f64 {
    let secant = r1 - f1 * (r1 - r0) / (f1 - f0);
    let furthest = if outside.is_finite() { outside } else { 1.5 * r1.max(inside) };
    if secant.is_finite() && secant > inside && secant < furthest {
        secant
    } else if outside.is_finite() {
        0.5 * (inside + outside)
    } else {
        furthest
    }
}

/// Returns how far from `from` a ray leaves a closed polygon that it starts in.
fn ray_to_polygon(from: DVec2, direction: DVec2, polygon: &[DVec2]) -> f64 {
    // On which side of the ray's line a corner is: one sign for both sides of the polygon that meet there.
    let across = |corner: DVec2| direction.perp_dot(corner - from);
    let mut furthest: f64 = 0.0;
    let Some(mut a) = polygon.last().copied() else { return furthest };
    let mut across_a = across(a);
    for &b in polygon {
        let across_b = across(b);
        if (across_a <= 0.0) != (across_b <= 0.0) {
            let place = a + (b - a) * (across_a / (across_a - across_b));
            furthest = furthest.max(direction.dot(place - from));
        }
        (a, across_a) = (b, across_b);
    }
    furthest / direction.length_squared()
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;

    use super::*;

    /// Of a disc seen from a place a quarter of its radius off its middle, whatever its size.
    #[test]
    fn the_center_is_the_centroid_of_the_region() {
        for radius_mm in [0.02, 1.0, 30.0] {
            let off_mm = radius_mm * DVec2::new(0.15, -0.2);
            let rho_mm = (0..48).map(|i| {
                let direction = DVec2::from_angle(std::f64::consts::TAU * f64::from(i) / 48.0);
                let (along, across) = (direction.dot(off_mm), direction.perp_dot(off_mm));
                along + (radius_mm * radius_mm - across * across).sqrt()
            });
            let pupil = Pupil { center_mm: DVec2::splat(7.0), z_mm: 0.0, rho_mm: rho_mm.collect() }.recentered();
            assert!((pupil.center_mm - off_mm - DVec2::splat(7.0)).length() < 1e-12 * radius_mm.max(1.0));
            // Straight lines between 48 azimuths fall short by 2e-3.
            assert!(pupil.rho_mm.iter().all(|rho_mm| (rho_mm / radius_mm - 1.0).abs() < 4e-3), "{:?}", pupil.rho_mm);
        }
    }

    /// However many fields are between the axis and a point, its pupil is about the same place.
    #[test]
    fn the_center_does_not_depend_on_where_the_search_began() {
        let lens = Lens::built_in("singlet-50mm").unwrap().with_f_number(2.0, 550.0).unwrap().at(550.0).unwrap();
        let point = |field| ObjectPoint::from_field(&lens, DVec2::new(field, 0.0), 1.0);
        let center_mm = |n_steps: u32| {
            let axial = Pupil::find(&lens, &point(0.0), 48).unwrap();
            let field = |i| 0.3 * f64::from(i) / f64::from(n_steps);
            (1..=n_steps).fold(axial, |pupil, i| pupil.near(&lens, &point(field(i))).unwrap()).center_mm
        };
        let at_once = center_mm(1);
        for n_steps in [8, 64] {
            assert!(center_mm(n_steps).distance(at_once) < 1e-5, "{} {at_once}", center_mm(n_steps));
        }
    }

    #[test]
    fn the_neighbors_pupil_leads_to_the_pupil_found_from_nothing() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let point = |field| ObjectPoint::from_field(&lens, DVec2::new(field, 0.0), 0.5);
        let mut pupil = Pupil::find(&lens, &point(0.0), 32).unwrap();
        for field in [0.03, 0.06, 0.12, 0.18, 0.24] {
            pupil = pupil.near(&lens, &point(field)).unwrap();
            let found = Pupil::find(&lens, &point(field), 32).unwrap();
            let area = |p: &Pupil| p.rho_mm.iter().map(|r| r * r).sum::<f64>();
            // The centers differ a little, and with them the sum over 32 azimuths where the edge has kinks.
            assert!((area(&pupil) / area(&found) - 1.0).abs() < 1e-3, "at {field}");
            let edge = |share: f64| {
                let on = |i| polar(pupil.center_mm, share * pupil.rho_mm[i], pupil.azimuth(i));
                let targets: Vec<DVec2> = (0..32).map(on).collect();
                lens.clearances_mm(rays_towards(&point(field), &targets, pupil.z_mm, 0.0))
            };
            assert!(edge(0.999_999).iter().all(|c| *c > 0.0), "at {field}");
            assert!(edge(1.000_001).iter().all(|c| *c < 0.0), "at {field}");
        }
    }
}
