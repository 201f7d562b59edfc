//! The pupil that an object point sees.

mod corners;
mod holes;

use glam::DVec2;

use crate::{
    MonoLens, ObjectPoint, RayBatch, Vignetting, rays_towards,
    trace::{self, Plan},
};

/// The true, vignetted pupil that one object point sees at one wavelength: a region of the entrance-pupil plane,
/// given by its edge at equally spaced azimuths about a centre.
///
/// The edge follows the round rims and the openings of surfaces; an obscuration ([`Aperture`](crate::Aperture)) is a
/// hole in the region that is not part of it. The hole is itself the pupil of the lens
/// [with the obscuration inverted](MonoLens::with_obscurations_inverted).
#[derive(Clone, Debug, PartialEq)]
pub struct PupilBoundary {
    // Invariants: at least 3 radii, all finite and above 0.
    center_mm: DVec2,
    z_mm: f64,
    rho_mm: Vec<f64>,
}

impl PupilBoundary {
    /// Finds the pupil, or `None` if no light of the point gets through.
    ///
    /// Every ray through the region meets every surface inside its rim. The edge is found to rounding at each of
    /// `n_azimuths` (at least 8) directions; the centre is the centroid of the region.
    pub fn find(lens: &MonoLens, point: &ObjectPoint, n_azimuths: usize) -> Option<Self> {
        let n_azimuths = n_azimuths.max(8);
        let search = Search::new(lens, point);
        let inside_mm = search.inside_mm()?;
        let rough = search.boundary(inside_mm, n_azimuths, 1e-3)?;
        let centroid_mm = rough.centroid_mm();
        // A region far from convex may not hold its centroid; then the point found first serves.
        let is_clear = search.clearances(&[centroid_mm])[0] > 0.0;
        search.boundary(if is_clear { centroid_mm } else { inside_mm }, n_azimuths, EDGE_MM)
    }

    /// The centre that radii count from, in the entrance-pupil plane, mm from the axis.
    pub fn center_mm(&self) -> DVec2 {
        self.center_mm
    }

    /// z of the entrance-pupil plane from the first vertex, mm.
    pub fn z_mm(&self) -> f64 {
        self.z_mm
    }

    /// The edge's distance from the centre at the azimuths `2π i / n`, counted from +x towards +y, mm.
    pub fn rho_at_azimuths_mm(&self) -> &[f64] {
        &self.rho_mm
    }

    /// Returns the edge's distance from the centre at any azimuth, mm: exact at the azimuths that were found, a cubic
    /// through the four nearest of them elsewhere.
    pub fn rho_max_mm(&self, theta: f64) -> f64 {
        let n = self.rho_mm.len();
        let place = (theta / std::f64::consts::TAU).rem_euclid(1.0) * n as f64;
        let (below, t) = (place.floor(), place.fract());
        let at = |offset: usize| self.rho_mm[(below as usize + n + offset - 1) % n];
        let (p0, p1, p2, p3) = (at(0), at(1), at(2), at(3));
        let cubic =
            p1 + 0.5 * t * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0)));
        // At a kink a cubic may overshoot; the neighbours bound it.
        cubic.clamp(0.98 * p1.min(p2), 1.02 * p1.max(p2))
    }

    /// The area of the region, mm².
    pub fn area_mm2(&self) -> f64 {
        0.5 * std::f64::consts::TAU / self.rho_mm.len() as f64 * self.rho_mm.iter().map(|r| r * r).sum::<f64>()
    }

    fn azimuths(n: usize) -> impl Iterator<Item = DVec2> {
        (0..n).map(move |i| DVec2::from_angle(std::f64::consts::TAU * i as f64 / n as f64))
    }

    fn centroid_mm(&self) -> DVec2 {
        let n = self.rho_mm.len();
        let moment = |(r, u): (&f64, DVec2)| u * (r * r * r / 3.0);
        let sum: DVec2 = self.rho_mm.iter().zip(Self::azimuths(n)).map(moment).sum();
        self.center_mm + sum * (std::f64::consts::TAU / n as f64) / self.area_mm2()
    }
}

/// A search for the pupil of one point.
struct Search<'a> {
    lens: &'a MonoLens,
    point: &'a ObjectPoint,
    z_mm: f64,
}

impl<'a> Search<'a> {
    fn new(lens: &'a MonoLens, point: &'a ObjectPoint) -> Self {
        Self { lens, point, z_mm: lens.projection_center_z_mm() }
    }

    fn clearances(&self, targets_mm: &[DVec2]) -> Vec<f64> {
        self.lens.clearances_mm(rays_towards(self.point, targets_mm, self.z_mm, 0.0))
    }

    /// Returns a point of the pupil, if any ray gets through.
    fn inside_mm(&self) -> Option<DVec2> {
        if self.clearances(&[DVec2::ZERO])[0] > 0.0 {
            return Some(DVec2::ZERO);
        }
        let rim_mm = self.lens.semi_aperture_mm(0);
        let (mut center, mut reach) = (DVec2::ZERO, 1.0);
        let mut best = (f64::NEG_INFINITY, DVec2::ZERO);
        // Rays through a grid on the first surface, finer and finer about the one that stays clear of rims by most.
        for _ in 0..SEARCH_ROUNDS {
            const N: i32 = 10;
            let step = reach / f64::from(N);
            let grid = (-N..=N).flat_map(|i| (-N..=N).map(move |j| DVec2::new(f64::from(i), f64::from(j)) * step));
            let candidates: Vec<DVec2> =
                grid.map(|offset| center + offset).filter(|p| p.length_squared() <= 1.0).collect();
            let targets: Vec<DVec2> = candidates.iter().map(|p| self.target_through_front(*p * rim_mm)).collect();
            for ((&candidate, &target), clearance) in candidates.iter().zip(&targets).zip(self.clearances(&targets)) {
                if clearance > best.0 {
                    best = (clearance, target);
                    center = candidate;
                }
            }
            if best.0 > 0.0 {
                return Some(best.1);
            }
            reach *= 0.5;
        }
        None
    }

    /// Returns where the ray through this point of the first surface crosses the pupil plane.
    fn target_through_front(&self, on_front_mm: DVec2) -> DVec2 {
        let point = self.lens.on_front_mm(on_front_mm);
        let direction = self.point.direction_to(point);
        (point + direction * ((self.z_mm - point.z) / direction.z)).truncate()
    }

    /// Returns the edge as seen from a point inside, found to `edge_mm` of clearance.
    fn boundary(&self, center_mm: DVec2, n_azimuths: usize, edge_mm: f64) -> Option<PupilBoundary> {
        let rho_mm = self.edge_mm(center_mm, PupilBoundary::azimuths(n_azimuths), edge_mm)?;
        Some(PupilBoundary { center_mm, z_mm: self.z_mm, rho_mm })
    }

    /// Returns how far the edge is from a point inside in each direction, mm, found to `edge_mm` of clearance.
    fn edge_mm(&self, center_mm: DVec2, directions: impl Iterator<Item = DVec2>, edge_mm: f64) -> Option<Vec<f64>> {
        let at_center = self.clearances(&[center_mm])[0];
        let edge_mm = edge_mm.min(0.01 * at_center);
        let mut edges: Vec<Edge> = directions.map(|direction| Edge::new(direction, at_center)).collect();
        for _ in 0..EDGE_ROUNDS {
            let mut open: Vec<&mut Edge> = edges.iter_mut().filter(|edge| !edge.is_found(edge_mm)).collect();
            if open.is_empty() {
                break;
            }
            let radii: Vec<f64> = open.iter().map(|edge| edge.next_rho_mm()).collect();
            let target = |(edge, rho): (&&mut Edge, &f64)| center_mm + edge.direction * *rho;
            let targets: Vec<DVec2> = open.iter().zip(&radii).map(target).collect();
            for ((edge, rho), clearance) in open.iter_mut().zip(radii).zip(self.clearances(&targets)) {
                edge.note(rho, clearance);
            }
        }
        let is_whole = edges.iter().all(|edge| edge.outer.is_some() && edge.inner.0 > 0.0);
        is_whole.then(|| edges.iter().map(|edge| edge.inner.0).collect())
    }
}

/// Rounds of the search for a first ray that gets through: the grid shrinks by half in each.
const SEARCH_ROUNDS: usize = 16;
/// Rounds after which an edge is as good as it gets; a well-behaved one takes ten.
const EDGE_ROUNDS: usize = 100;
/// Clearance at which a ray is held to graze its rim, mm.
const EDGE_MM: f64 = 1e-11;

/// The edge of the pupil in one direction from the centre, between a radius inside and one outside.
struct Edge {
    direction: DVec2,
    /// Radius and clearance of the outermost ray known to get through.
    inner: (f64, f64),
    /// Radius and clearance of the innermost ray known not to, once there is one.
    outer: Option<(f64, f64)>,
    /// Which end moved last, and how often in a row.
    in_a_row: i32,
    rounds: usize,
}

impl Edge {
    fn new(direction: DVec2, at_center: f64) -> Self {
        Self { direction, inner: (0.0, at_center), outer: None, in_a_row: 0, rounds: 0 }
    }

    fn is_found(&self, edge_mm: f64) -> bool {
        self.outer.is_some_and(|outer| self.inner.1 <= edge_mm || outer.0 - self.inner.0 <= 1e-14 * (1.0 + outer.0))
    }

    /// Returns where to look next: outwards until a rim is passed, then by regula falsi with the Illinois rule.
    fn next_rho_mm(&self) -> f64 {
        let (a, fa) = self.inner;
        let Some((b, fb)) = self.outer else { return 1.3 * (a + fa.max(1e-6)) };
        // A ray that misses has no clearance, and a kink may fool the rule: halve.
        if !fb.is_finite() || self.rounds % 8 == 7 {
            return 0.5 * (a + b);
        }
        let weight = 0.5_f64.powi(self.in_a_row.abs() - 1).min(1.0);
        let (wa, wb) = if self.in_a_row > 0 { (fa, weight * fb) } else { (weight * fa, fb) };
        let root = (a * wb - b * wa) / (wb - wa);
        // A hair inwards, so that the ray found is one that gets through.
        (root - 1e-12 * (1.0 + root)).clamp(a, b)
    }

    fn note(&mut self, rho: f64, clearance: f64) {
        self.rounds += 1;
        if clearance > 0.0 {
            self.inner = (rho, clearance);
            self.in_a_row = self.in_a_row.max(0) + 1;
        } else {
            self.outer = Some((rho, clearance));
            self.in_a_row = self.in_a_row.min(0) - 1;
        }
    }
}

impl MonoLens {
    /// Returns by how much each ray stays inside the rim that it comes nearest to, mm: the least over all surfaces of
    /// semi-aperture less distance from the axis.
    ///
    /// Negative for a ray that a rim would end; −∞ for one that misses a surface or is totally reflected.
    pub fn clearances_mm(&self, mut rays: RayBatch) -> Vec<f64> {
        let mut clearances_mm = vec![f64::INFINITY; rays.len()];
        let steps = self.steps_for(rays.object_z_mm);
        match self.poses() {
            None => {
                let plan = Plan::new(&steps, 0, Vignetting::Off);
                trace::trace_clearances(&plan, rays.slices(), &mut clearances_mm);
            }
            Some(poses) => trace::placed_clearances(&steps, poses, &mut rays.slices(), &mut clearances_mm),
        }
        clearances_mm
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::Lens;

    #[track_caller]
    fn pupil(lens: &MonoLens, field_deg: f64, dioptres: f64) -> PupilBoundary {
        let point = ObjectPoint::from_field(lens, DVec2::new(field_deg.to_radians().tan(), 0.0), dioptres);
        PupilBoundary::find(lens, &point, 64).expect("light gets through")
    }

    #[test]
    fn thin_lens_shows_its_whole_disc_at_any_field() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        for (field_deg, dioptres) in [(0.0, 0.0), (20.0, 0.0), (40.0, 2.0)] {
            let pupil = pupil(&lens, field_deg, dioptres);
            assert!(pupil.center_mm().length() < 1e-9);
            assert!(pupil.rho_at_azimuths_mm().iter().all(|r| (r - 5.0).abs() < 1e-11));
            assert!((pupil.area_mm2() - 25.0 * PI).abs() < 1e-9);
            assert!((pupil.rho_max_mm(0.123) - 5.0).abs() < 1e-9);
        }
    }

    #[test]
    fn rays_just_inside_the_edge_pass_and_just_outside_do_not() {
        for (name, field_deg) in [
            ("dgauss-50mm", 0.0),
            ("dgauss-50mm", 18.0),
            ("fisheye-12.5mm", 75.0),
            ("paper-2el", 12.0),
            ("telephoto-127mm", 20.0),
        ] {
            let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
            let point = ObjectPoint::from_field(&lens, DVec2::new(tan_deg(field_deg), 0.0), 0.5);
            let pupil = PupilBoundary::find(&lens, &point, 48).unwrap();
            let directions: Vec<_> = PupilBoundary::azimuths(48).zip(pupil.rho_at_azimuths_mm()).collect();
            let at = |scale: f64| -> Vec<DVec2> {
                directions.iter().map(|(u, rho)| pupil.center_mm() + u * (*rho + scale)).collect()
            };
            for (offset_mm, n_passed) in [(0.0, 48), (1e-8, 0)] {
                let mut rays = rays_towards(&point, &at(offset_mm), pupil.z_mm(), 0.0);
                lens.trace(&mut rays, Vignetting::On);
                assert_eq!(rays.n_in_flight(), n_passed, "{name} at {field_deg} degrees");
            }
        }
    }

    fn tan_deg(angle_deg: f64) -> f64 {
        angle_deg.to_radians().tan()
    }

    #[test]
    fn vignetting_shrinks_the_pupil_and_ends_in_the_dark() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let areas: Vec<f64> = [0.0, 6.0, 12.0, 18.0, 22.0].map(|deg| pupil(&lens, deg, 0.0).area_mm2()).to_vec();
        assert!(areas.windows(2).all(|pair| pair[1] < pair[0]), "{areas:?}");
        let point = ObjectPoint::from_field(&lens, DVec2::new(40_f64.to_radians().tan(), 0.0), 0.0);
        assert_eq!(PupilBoundary::find(&lens, &point, 32), None);
    }

    #[test]
    fn stopped_down_pupil_is_the_paraxial_one() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(22.0, 550.0).unwrap().at(550.0).unwrap();
        let first = lens.first_order();
        let pupil = pupil(&lens, 0.0, 0.0);
        let expected = PI / 4.0 * first.entrance_pupil_diameter_mm.powi(2);
        // Spherical aberration of the pupil falls with the square of its size.
        assert!((pupil.area_mm2() / expected - 1.0).abs() < 1e-3);
    }
}
