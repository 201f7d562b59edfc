//! Object points, bundles of rays from them, and the pupil that they see.

use glam::{DVec2, DVec3};

use crate::{MonoLens, RayBatch, trace};

/// A point that light comes from, in the lens frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectPoint {
    /// A point, mm.
    Finite(DVec3),
    /// A far point, by the unit direction in which its light travels.
    Infinite(DVec3),
}

impl ObjectPoint {
    /// Returns the point seen from the paraxial entrance-pupil centre of `lens` under these tangents of field angles,
    /// `dioptres` = 1/Z away (Z the axial distance from that centre in metres; 0 is infinitely far).
    ///
    /// A telecentric lens has no such centre; there the first vertex stands for it.
    pub fn from_field(lens: &MonoLens, field_tan: DVec2, dioptres: f64) -> Self {
        let z_mm = lens.first_order().entrance_pupil_z_mm;
        let center_z_mm = if z_mm.is_finite() { z_mm } else { 0.0 };
        if dioptres == 0.0 {
            return Self::Infinite(DVec3::new(-field_tan.x, -field_tan.y, 1.0).normalize());
        }
        let distance_mm = 1e3 / dioptres;
        Self::Finite((field_tan * distance_mm).extend(center_z_mm - distance_mm))
    }

    /// z of the plane that the point lies in, mm; −∞ for a far point.
    pub fn z_mm(&self) -> f64 {
        match self {
            Self::Finite(point) => point.z,
            Self::Infinite(_) => f64::NEG_INFINITY,
        }
    }

    /// Returns the unit direction from this point to another.
    pub fn direction_to(&self, target_mm: DVec3) -> DVec3 {
        match *self {
            Self::Finite(point) => (target_mm - point).normalize(),
            Self::Infinite(direction) => direction,
        }
    }

    /// Returns by how much the path from this point to `a` is longer than that to `b`, mm.
    ///
    /// Computed without ever forming the paths, so that it stays exact for far points.
    pub fn path_difference_mm(&self, a: DVec3, b: DVec3) -> f64 {
        match *self {
            Self::Finite(point) => {
                let (to_a, to_b) = (a - point, b - point);
                (a - b).dot(to_a + to_b) / (to_a.length() + to_b.length())
            }
            Self::Infinite(direction) => direction.dot(a - b),
        }
    }
}

/// Returns rays from an object point aimed at targets in the plane `z_mm`, started on the plane `start_z_mm`.
///
/// Path lengths are those from the point, less that of the ray aimed at the axis in the same plane; so they are
/// small numbers, exact however far the point is. Starting on the first vertex plane (`start_z_mm` = 0) keeps
/// positions exact too.
pub fn rays_towards(point: &ObjectPoint, targets_mm: &[DVec2], z_mm: f64, start_z_mm: f64) -> RayBatch {
    let start = |target_mm: DVec2| {
        let target_mm = target_mm.extend(z_mm);
        let direction = point.direction_to(target_mm);
        (target_mm + direction * ((start_z_mm - z_mm) / direction.z), direction)
    };
    let (reference_mm, _) = start(DVec2::ZERO);
    let mut rays = RayBatch::with_capacity(targets_mm.len());
    rays.object_z_mm = point.z_mm();
    for &target_mm in targets_mm {
        let (start_mm, direction) = start(target_mm);
        rays.push(start_mm, direction, point.path_difference_mm(start_mm, reference_mm));
    }
    rays
}

/// Returns rays from an object point to a square grid of `n_across`² points, of which those in a disc are kept, on
/// the flat front disc of the lens: the paper's way of choosing rays.
///
/// The disc has the radius of the first surface's rim and lies in its vertex plane.
pub fn rays_over_front(lens: &MonoLens, point: &ObjectPoint, n_across: usize) -> RayBatch {
    let radius_mm = lens.semi_aperture_mm(0);
    let at = |i: usize| if n_across < 2 { 0.0 } else { 2.0 * i as f64 / (n_across - 1) as f64 - 1.0 };
    let grid = (0..n_across).flat_map(|row| (0..n_across).map(move |column| DVec2::new(at(column), at(row))));
    let targets: Vec<DVec2> = grid.filter(|p| p.length_squared() <= 1.0).map(|p| p * radius_mm).collect();
    rays_towards(point, &targets, 0.0, 0.0)
}

/// The true, vignetted pupil that one object point sees at one wavelength: a region of the entrance-pupil plane,
/// given by its edge at equally spaced azimuths about a centre.
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
        let inside_mm = search.clearest_mm()?;
        let rough = search.boundary(inside_mm, n_azimuths)?;
        let centroid_mm = rough.centroid_mm();
        // A region far from convex may not hold its centroid; then the clearest point serves.
        if search.clearances(&[centroid_mm])[0] > 0.0 { search.boundary(centroid_mm, n_azimuths) } else { Some(rough) }
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
        let z_mm = lens.first_order().entrance_pupil_z_mm;
        Self { lens, point, z_mm: if z_mm.is_finite() { z_mm } else { 0.0 } }
    }

    fn clearances(&self, targets_mm: &[DVec2]) -> Vec<f64> {
        self.lens.clearances_mm(rays_towards(self.point, targets_mm, self.z_mm, 0.0))
    }

    /// Returns the point of the pupil plane whose ray stays clear of all rims by most, if any ray gets through.
    fn clearest_mm(&self) -> Option<DVec2> {
        let rim_mm = self.lens.semi_aperture_mm(0);
        let (mut center, mut reach) = (DVec2::ZERO, 1.0);
        let mut best: Option<(f64, DVec2)> = None;
        for _ in 0..24 {
            const N: i32 = 12;
            let step = reach / f64::from(N);
            let grid = (-N..=N).flat_map(|i| (-N..=N).map(move |j| DVec2::new(f64::from(i), f64::from(j)) * step));
            let candidates: Vec<DVec2> =
                grid.map(|offset| center + offset).filter(|p| p.length_squared() <= 1.0).collect();
            let targets: Vec<DVec2> = candidates.iter().map(|p| self.target_through_front(*p * rim_mm)).collect();
            let clearances = self.clearances(&targets);
            for ((&candidate, &target), clearance) in candidates.iter().zip(&targets).zip(clearances) {
                if best.is_none_or(|(most, _)| clearance > most) {
                    best = Some((clearance, target));
                    center = candidate;
                }
            }
            // Inside by more than the grid is fine: a clear point well within will do.
            if best.is_some_and(|(most, _)| most > 0.0) && reach < 0.2 {
                break;
            }
            reach *= 0.4;
        }
        best.filter(|(most, _)| *most > 0.0).map(|(_, target)| target)
    }

    /// Returns where the ray through this point of the first surface crosses the pupil plane.
    fn target_through_front(&self, on_front_mm: DVec2) -> DVec2 {
        let sag_mm = self.lens.front_sag_mm(on_front_mm.length());
        let point = on_front_mm.extend(if sag_mm.is_finite() { sag_mm } else { 0.0 });
        let direction = self.point.direction_to(point);
        (point + direction * ((self.z_mm - point.z) / direction.z)).truncate()
    }

    /// Returns the edge as seen from a point inside.
    fn boundary(&self, center_mm: DVec2, n_azimuths: usize) -> Option<PupilBoundary> {
        let directions: Vec<DVec2> = PupilBoundary::azimuths(n_azimuths).collect();
        let at = |rho: &[f64]| -> Vec<f64> {
            let targets: Vec<DVec2> = directions.iter().zip(rho).map(|(u, r)| center_mm + *u * *r).collect();
            self.clearances(&targets)
        };
        let center_clearance = self.clearances(&[center_mm])[0];
        let mut inner = vec![(0.0, center_clearance); n_azimuths];
        let mut outer = vec![(f64::NAN, f64::NAN); n_azimuths];
        let mut reach = vec![center_clearance.max(1e-6); n_azimuths];
        // Go out until every direction has left the pupil.
        for _ in 0..60 {
            let clearances = at(&reach);
            for i in 0..n_azimuths {
                if outer[i].0.is_nan() {
                    match clearances[i] > 0.0 {
                        true => inner[i] = (reach[i], clearances[i]),
                        false => outer[i] = (reach[i], clearances[i]),
                    }
                }
                reach[i] = if outer[i].0.is_nan() { 1.5 * reach[i] } else { outer[i].0 };
            }
            if outer.iter().all(|o| !o.0.is_nan()) {
                break;
            }
        }
        if outer.iter().any(|o| o.0.is_nan()) {
            return None;
        }
        // Regula falsi where both ends have a clearance, halving every third time and where a ray misses.
        for round in 0..120 {
            let rho: Vec<f64> = inner
                .iter()
                .zip(&outer)
                .map(|(&(a, fa), &(b, fb))| match fb.is_finite() && round % 3 != 2 {
                    true => (a * fb - b * fa) / (fb - fa),
                    false => 0.5 * (a + b),
                })
                .zip(inner.iter().zip(&outer))
                .map(|(r, (a, b))| r.clamp(a.0, b.0))
                .collect();
            let clearances = at(&rho);
            for i in 0..n_azimuths {
                match clearances[i] > 0.0 {
                    true => inner[i] = (rho[i], clearances[i]),
                    false => outer[i] = (rho[i], clearances[i]),
                }
            }
            if inner.iter().zip(&outer).all(|(a, b)| b.0 - a.0 <= 1e-14 * (1.0 + b.0) || a.1 <= 0.0) {
                break;
            }
        }
        let rho_mm: Vec<f64> = inner.iter().map(|a| a.0).collect();
        rho_mm.iter().all(|r| *r > 0.0).then_some(PupilBoundary { center_mm, z_mm: self.z_mm, rho_mm })
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
        trace::trace_clearances(&steps, rays.slices(), &mut clearances_mm);
        clearances_mm
    }
}
