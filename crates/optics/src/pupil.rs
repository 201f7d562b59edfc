//! The pupil that an object point sees.

mod corners;
mod edge;
mod front;
mod holes;
mod light;
mod plane;
mod region;
mod strips;

use glam::{DVec2, DVec3};

pub(crate) use self::edge::EdgeSearch;
use self::front::Front;
pub use self::{plane::PupilPlane, region::PupilRegion};
use crate::{
    MonoLens, ObjectPoint, Placement, RayBatch, Vignetting,
    trace::{self, Plan},
};

/// The true, vignetted pupil that one object point sees at one wavelength, or a part of it: a region of a plane,
/// given by its edge at equally spaced azimuths about a center.
///
/// The plane is that of the paraxial entrance pupil; for light that comes in across the axis or from behind, as that of the
/// widest lenses, it faces the point ([`PupilPlane`]). The edge follows the round rims and the openings of surfaces; an
/// obscuration ([`Aperture`](crate::Aperture)) is a hole in the region that is not part of it. The hole is itself the
/// pupil of the lens [with the obscuration inverted](MonoLens::with_obscurations_inverted).
#[derive(Clone, Debug, PartialEq)]
pub struct PupilBoundary {
    // Invariants: at least 3 radii, all finite and above 0.
    center_mm: DVec2,
    plane: PupilPlane,
    rho_mm: Vec<f64>,
}

impl PupilBoundary {
    /// Finds the pupil, or `None` if no light of the point gets through; of a pupil that no single place of it sees whole,
    /// what is seen from a place well inside ([`PupilRegion::find`] finds the rest).
    ///
    /// Every ray through the region meets every surface inside its rim. The edge is found to rounding at each of
    /// `n_azimuths` (at least 8) directions; the center is the centroid of the region.
    pub fn find(lens: &MonoLens, point: &ObjectPoint, n_azimuths: usize) -> Option<Self> {
        Search::new(lens, point).largest(n_azimuths.max(8))
    }

    /// The center that radii count from, in the pupil's plane, mm from its origin.
    pub fn center_mm(&self) -> DVec2 {
        self.center_mm
    }

    /// The plane that the region lies in.
    pub fn plane(&self) -> &PupilPlane {
        &self.plane
    }

    /// z of the pupil's plane on the axis, from the first vertex, mm.
    pub fn z_mm(&self) -> f64 {
        self.plane.z_mm()
    }

    /// The edge's distance from the center at the azimuths `2π i / n`, counted from +x towards +y, mm.
    pub fn rho_at_azimuths_mm(&self) -> &[f64] {
        &self.rho_mm
    }

    /// The places of the edge at these azimuths in the pupil's plane, mm.
    pub fn edge_mm(&self) -> Vec<DVec2> {
        let place = |(rho, u): (&f64, DVec2)| self.center_mm + *rho * u;
        self.rho_mm.iter().zip(Self::azimuths(self.rho_mm.len())).map(place).collect()
    }

    /// Returns the edge's distance from the center at any azimuth, mm: exact at the azimuths that were found, a cubic
    /// through the four nearest of them elsewhere.
    pub fn rho_max_mm(&self, theta: f64) -> f64 {
        let n = self.rho_mm.len();
        let place = (theta / std::f64::consts::TAU).rem_euclid(1.0) * n as f64;
        let (below, t) = (place.floor(), place.fract());
        let at = |offset: usize| self.rho_mm[(below as usize + n + offset - 1) % n];
        let (p0, p1, p2, p3) = (at(0), at(1), at(2), at(3));
        let cubic =
            p1 + 0.5 * t * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0)));
        // At a kink a cubic may overshoot; the neighbors bound it.
        cubic.clamp(0.98 * p1.min(p2), 1.02 * p1.max(p2))
    }

    /// The area of the region, mm².
    pub fn area_mm2(&self) -> f64 {
        0.5 * std::f64::consts::TAU / self.rho_mm.len() as f64 * self.rho_mm.iter().map(|r| r * r).sum::<f64>()
    }

    pub(crate) fn azimuths(n: usize) -> impl Iterator<Item = DVec2> {
        (0..n).map(move |i| DVec2::from_angle(std::f64::consts::TAU * i as f64 / n as f64))
    }

    fn rho_max(&self) -> f64 {
        self.rho_mm.iter().copied().fold(0.0, f64::max)
    }

    /// The area between the edge at an azimuth and at the next, beyond a circle through the nearer one.
    fn ramp_mm2(&self, i: usize) -> f64 {
        let n = self.rho_mm.len();
        let squares = self.rho_mm[i].powi(2) - self.rho_mm[(i + 1) % n].powi(2);
        0.25 * squares.abs() * std::f64::consts::TAU / n as f64
    }

    fn centroid_mm(&self) -> DVec2 {
        let n = self.rho_mm.len();
        let moment = |(r, u): (&f64, DVec2)| u * (r * r * r / 3.0);
        let sum: DVec2 = self.rho_mm.iter().zip(Self::azimuths(n)).map(moment).sum();
        self.center_mm + sum * (std::f64::consts::TAU / n as f64) / self.area_mm2()
    }

    /// How far beyond the edge a place lies, seen from the center, mm; negative inside.
    fn beyond_mm(&self, place_mm: DVec2) -> f64 {
        let from_center = place_mm - self.center_mm;
        from_center.length() - self.rho_max_mm(from_center.to_angle())
    }
}

/// A search for the pupil of one point.
struct Search<'a> {
    lens: &'a MonoLens,
    point: &'a ObjectPoint,
    plane: PupilPlane,
    /// Where it is looked for over the front of the lens instead of the plane.
    front: Option<&'a Front>,
}

impl EdgeSearch for Search<'_> {
    fn clearances(&self, targets_mm: &[DVec2]) -> Vec<f64> {
        #[cfg(test)]
        tests::N_RAYS.with(|n_rays| n_rays.set(n_rays.get() + targets_mm.len()));
        match self.front {
            None => self.lens.clearances_mm(self.plane.rays(self.lens, self.point, targets_mm)),
            Some(front) => front.clearances(self.lens, targets_mm),
        }
    }
}

impl<'a> Search<'a> {
    fn new(lens: &'a MonoLens, point: &'a ObjectPoint) -> Self {
        Self { lens, point, plane: PupilPlane::of(lens, point), front: None }
    }

    /// Returns the middle of the pupil's plane, if light passes there, as it does for most fields of most lenses.
    fn lit_middle(&self) -> Option<DVec2> {
        (self.clearances(&[DVec2::ZERO])[0] > 0.0).then_some(DVec2::ZERO)
    }

    /// Finds what is seen of the pupil from a place well inside.
    fn largest(&self, n_azimuths: usize) -> Option<PupilBoundary> {
        let in_middle = self.lit_middle().and_then(|seed| self.part_about(seed, n_azimuths));
        in_middle.or_else(|| {
            let lit = self.lit_over_front();
            let part = self.part_of(&lit, n_azimuths);
            part.or_else(|| if lit.is_empty() { None } else { self.part_beside(n_azimuths) })
        })
    }

    /// Returns the part about the middle of the one that is found in the plane of the whole region, which is less oblique to steep
    /// light.
    fn part_beside(&self, n_azimuths: usize) -> Option<PupilBoundary> {
        let facing = Self { plane: PupilPlane::of_region(self.lens, self.point), ..*self };
        let part = facing.part_of(&facing.lit_over_front(), n_azimuths)?;
        let middle = facing.plane.rays(self.lens, self.point, &[part.center_mm]);
        self.part_about(self.plane.meets_mm(middle.point_mm(0), middle.direction(0)), n_azimuths)
    }

    /// Returns the part around the first of these places, those of most clearance first, that has an area.
    fn part_of(&self, lit: &[(DVec2, f64)], n_azimuths: usize) -> Option<PupilBoundary> {
        let mut lit = lit.to_vec();
        lit.sort_by(|a, b| b.1.total_cmp(&a.1));
        // A few places may all be at the tip of a crescent, from which little is seen.
        let is_tip = lit.len() < FEW;
        let seed = |place: &(DVec2, f64)| if is_tip { self.climbed(*place) } else { place.0 };
        lit.iter().take(MOST_SEEDS).find_map(|place| self.part_about(seed(place), n_azimuths))
    }

    /// Returns how much of a part's area may be wrong where its edge jumps from one azimuth to the next, because a nearer
    /// edge ends there: where the ray just within the chord between both is dark.
    fn uncertain_mm2(&self, part: &PupilBoundary) -> f64 {
        let edge = part.edge_mm();
        let n = edge.len();
        let within = |i: usize| part.center_mm + WITHIN_CHORD * (edge[i].midpoint(edge[(i + 1) % n]) - part.center_mm);
        let clearances = self.clearances(&(0..n).map(within).collect::<Vec<_>>());
        (0..n).filter(|&i| clearances[i] <= 0.0).map(|i| part.ramp_mm2(i)).sum()
    }

    /// Returns how much of a part's area may be wrong where its edge comes nearer from one azimuth to the next by more than this, mm²,
    /// and light that the nearer edge hides lies beyond it, as that of a horn seen from its foot.
    fn hidden_mm2(&self, part: &PupilBoundary, least_mm2: f64) -> f64 {
        let n = part.rho_mm.len();
        let jumps: Vec<usize> = (0..n).filter(|&i| part.ramp_mm2(i) > least_mm2).collect();
        let beyond = |&i: &usize| {
            let next = (i + 1) % n;
            let (near, far) = if part.rho_mm[i] < part.rho_mm[next] { (i, next) } else { (next, i) };
            let direction = DVec2::from_angle(std::f64::consts::TAU * near as f64 / n as f64);
            let step_mm = (part.rho_mm[far] - part.rho_mm[near]) / HIDDEN_PLACES as f64;
            let rho_mm = part.rho_mm[near];
            (0..HIDDEN_PLACES).map(move |k| part.center_mm + (rho_mm + (k as f64 + 0.5) * step_mm) * direction)
        };
        let clearances = self.clearances(&jumps.iter().flat_map(beyond).collect::<Vec<_>>());
        let is_lit = |clearances: &[f64]| clearances.iter().any(|clearance| *clearance > 0.0);
        let hiding = jumps.iter().zip(clearances.chunks(HIDDEN_PLACES)).filter(|(_, clearances)| is_lit(clearances));
        hiding.map(|(&i, _)| part.ramp_mm2(i)).sum()
    }

    /// Returns the part of the pupil around a place of it, as far as rays see the edge from the part's centroid or, where
    /// that is dark or sees less, from the place itself.
    fn part_about(&self, seed_mm: DVec2, n_azimuths: usize) -> Option<PupilBoundary> {
        let rough = self.boundary(seed_mm, n_azimuths, 1e-3)?;
        let centroid_mm = rough.centroid_mm();
        let is_clear = self.clearances(&[centroid_mm])[0] > 0.0;
        let from_centroid = is_clear.then(|| self.boundary(centroid_mm, n_azimuths, EDGE_MM)).flatten();
        match from_centroid {
            Some(part) if part.area_mm2() >= SEES_ENOUGH * rough.area_mm2() => Some(part),
            _ => self.boundary(seed_mm, n_azimuths, EDGE_MM),
        }
    }

    /// Returns the edge as seen from a place inside, found to `edge_mm` of clearance.
    fn boundary(&self, center_mm: DVec2, n_azimuths: usize, edge_mm: f64) -> Option<PupilBoundary> {
        let directions: Vec<DVec2> = PupilBoundary::azimuths(n_azimuths).collect();
        let rho_mm = self.edge_mm(center_mm, &directions, edge_mm)?;
        Some(PupilBoundary { center_mm, plane: self.plane, rho_mm })
    }
}

/// Places from which the edge of a part is looked for before the part is given up.
const MOST_SEEDS: usize = 16;
/// How near to the chord between two azimuths the edge must come.
const WITHIN_CHORD: f64 = 0.99;
/// Fewer first places than this are climbed from.
const FEW: usize = 32;
/// The share of what a first place sees of a part that the part's centroid must see to be its center.
const SEES_ENOUGH: f64 = 0.98;
/// Places beyond an edge that are looked at for light that it hides.
const HIDDEN_PLACES: usize = 12;
/// Clearance at which a ray is held to graze its rim, mm.
pub(crate) const EDGE_MM: f64 = 1e-11;

impl MonoLens {
    /// Returns a point and a direction of the lens frame in that of a surface.
    fn in_frame_of(&self, surface: usize, point_mm: DVec3, direction: DVec3) -> [DVec3; 2] {
        let placement = self.placements().map_or(Placement::centered(self.vertex_z_mm(surface)), |all| all[surface]);
        [placement.surface_from_lens(point_mm), placement.direction_to_own(direction)]
    }

    /// How far inside the rim and the openings of a surface a place of it lies, mm from its vertex.
    fn clearance_on_mm(&self, surface: usize, at: DVec2) -> f64 {
        let step = &self.steps()[surface];
        let openings = step.apertures.iter().map(|aperture| aperture.clearance_mm(at.x, at.y));
        openings.fold(step.semi_aperture - at.length(), f64::min)
    }

    /// Returns by how much each ray stays inside the rim that it comes nearest to, mm: the least over all surfaces of
    /// semi-aperture less distance from the axis.
    ///
    /// Negative for a ray that a rim would end; −∞ for one that misses a surface or is totally reflected.
    pub fn clearances_mm(&self, mut rays: RayBatch) -> Vec<f64> {
        let mut clearances_mm = vec![f64::INFINITY; rays.len()];
        let steps = self.steps_for(rays.object_z_mm);
        match self.placements() {
            None => {
                let plan = Plan::new(&steps, 0, Vignetting::Off);
                trace::trace_clearances(&plan, rays.slices(), &mut clearances_mm);
            }
            Some(placements) => trace::placed_clearances(&steps, placements, &mut rays.slices(), &mut clearances_mm),
        }
        clearances_mm
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{CoordinateBreak, Glass, Interface, Lens, Surface, rays_towards};

    thread_local! {
        /// The rays that searches of this thread looked at.
        pub(super) static N_RAYS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
    }

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

    /// A singlet at f/8 that is tilted and raised, whose last light grazes its front.
    fn askew() -> MonoLens {
        let front = Interface {
            surface: Surface::sphere(50.0, 6.0),
            medium_after: Glass::Constant { index: 1.5 },
            thickness_after_mm: 3.0,
        };
        let back =
            Interface { surface: Surface::sphere(-50.0, 4.0), medium_after: Glass::Air, thickness_after_mm: 0.0 };
        let lens = Lens::new("askew", "test", vec![front, back], 1).unwrap().with_f_number(8.0, 550.0).unwrap();
        let turn = CoordinateBreak {
            surfaces: (0, 1),
            pivot_mm: lens.at(550.0).unwrap().projection_center_z_mm(),
            decenter_mm: [0.0, 0.5, 0.0],
            tilt_deg: [-5.0, 1.0, 0.0],
            tilt_first: false,
        };
        lens.with_moves(vec![turn]).unwrap().at(550.0).unwrap()
    }

    #[track_caller]
    fn check_rays_looked_at(lens: &MonoLens, field_deg: f64, most: usize) {
        N_RAYS.set(0);
        let region = PupilRegion::find(lens, &ObjectPoint::far(field_deg.to_radians(), DVec2::Y), 48);
        let n_rays = N_RAYS.get();
        assert!(n_rays <= most, "{n_rays} rays at {field_deg} degrees, {region:?}");
    }

    #[test]
    fn searches_look_at_a_bounded_number_of_rays() {
        let lens = askew();
        let mut fields_deg: Vec<f64> = (0..150).map(|i| 86.0 + 0.01 * f64::from(i)).collect();
        // The fields by whose bisection the last light is found, down to the one whose search never ended.
        fields_deg.extend([86.582_519_531_25, 86.582_397_460_937_5, 86.582_5]);
        for field_deg in fields_deg {
            check_rays_looked_at(&lens, field_deg, 60_000);
        }
    }

    #[test]
    fn outline_that_grazes_the_front_smoothly_takes_few_rays() {
        let lens = Lens::built_in("singlet-50mm").unwrap().at(550.0).unwrap();
        for field_deg in [36.0, 48.0, 60.0, 64.0] {
            check_rays_looked_at(&lens, field_deg, 12_000);
        }
    }
}
