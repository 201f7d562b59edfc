//! The light of a point that gets through a lens, by few rays of known weight.

use glam::{DVec2, DVec3};

use crate::{MonoLens, ObjectPoint, PupilPlane, PupilRegion, RayBatch, Vignetting};

/// The fewest azimuths of a pupil.
const LEAST_AZIMUTHS: usize = 48;

/// How finely the light of a point is sampled: Gauss's rule over the square of the radius in each direction of the real,
/// vignetted pupil.
///
/// Of a round pupil sums over it are exact for aberrations of degree 2n − 1 in the square of the radius; where the edge
/// passes from one rim to another they are good to the square of the angle between azimuths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PupilRule {
    /// Rays from the center to the edge.
    pub n_rings: usize,
    /// Directions, equally spaced.
    pub n_azimuths: usize,
}

impl PupilRule {
    /// Returns the rule of this many rings, and of six times as many azimuths but at least 48.
    pub fn of_rings(n_rings: usize) -> Self {
        Self { n_rings: n_rings.max(1), n_azimuths: (6 * n_rings).max(LEAST_AZIMUTHS) }
    }
}

/// The rays of a point over its whole real pupil, traced to the film, and how much light each stands for.
///
/// The weights add up to 1. Light that an obscuration stops is counted twice, the second time with negative weights: what is
/// stopped is what an opening of the same shape would pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PupilLight {
    // Invariant: all rays are in flight.
    rays: RayBatch,
    weights: Vec<f64>,
    collected: f64,
}

impl PupilLight {
    /// Traces the light of a point to the film as it is curved, `film_distance_mm` behind the last vertex; `None` where none
    /// gets there.
    ///
    /// A point shines alike in all directions: a far one evenly on a plane that faces it.
    pub fn to_film(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64, rule: PupilRule) -> Option<Self> {
        let mut light = Self { rays: RayBatch::default(), weights: Vec::new(), collected: 0.0 };
        lens.for_each_clear_part(&mut |part, sign| {
            let n_before = light.weights.len();
            if let Some(region) = PupilRegion::find(part, point, rule.n_azimuths) {
                light.add(part, (point, film_distance_mm), &region, (rule, sign));
            }
            light.weights.len() > n_before
        });
        let sum: f64 = light.weights.iter().sum();
        light.weights.iter_mut().for_each(|weight| *weight /= sum);
        light.collected = sum;
        (sum > 0.0).then_some(light)
    }

    /// The rays on the film.
    pub fn rays(&self) -> &RayBatch {
        &self.rays
    }

    /// The share of the light that each ray stands for, in their order.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// How much light of the point gets to the film: of a far one the cross-section of its beam before the lens, mm²; of a near
    /// one the solid angle of its cone, steradians.
    pub fn collected(&self) -> f64 {
        self.collected
    }

    /// Returns where the rays meet the film, mm along its own x and y, and how much light each stands for.
    pub fn on_film(&self, lens: &MonoLens, film_distance_mm: f64) -> impl Iterator<Item = (DVec2, f64)> {
        let place = move |i: usize| lens.on_film_mm(self.rays.point_mm(i), film_distance_mm);
        self.weights.iter().enumerate().map(move |(i, weight)| (place(i), *weight))
    }

    /// Returns the centroid of the light on the film, mm, and its mean squares and product about that: xx, yy and xy, mm².
    pub fn moments(&self, lens: &MonoLens, film_distance_mm: f64) -> (DVec2, [f64; 3]) {
        let centroid_mm: DVec2 = self.on_film(lens, film_distance_mm).map(|(place, weight)| place * weight).sum();
        let mut second_mm2 = [0.0; 3];
        for (place, weight) in self.on_film(lens, film_distance_mm) {
            let off = place - centroid_mm;
            for (sum, product) in second_mm2.iter_mut().zip([off.x * off.x, off.y * off.y, off.x * off.y]) {
                *sum += weight * product;
            }
        }
        (centroid_mm, second_mm2)
    }

    /// Adds the light through a region.
    fn add(
        &mut self,
        lens: &MonoLens,
        (point, film_distance_mm): (&ObjectPoint, f64),
        region: &PupilRegion,
        (rule, sign): (PupilRule, f64),
    ) {
        let (targets_mm, areas_mm2): (Vec<DVec2>, Vec<f64>) = region.nodes(rule.n_rings).into_iter().unzip();
        let mut rays = region.plane().rays(lens, point, &targets_mm);
        let per_area = |i: usize| solid_angle_per_area(region.plane(), point, rays.direction(i));
        let weights: Vec<f64> =
            areas_mm2.iter().enumerate().map(|(i, area_mm2)| sign * area_mm2 * per_area(i)).collect();
        lens.trace(&mut rays, Vignetting::On);
        lens.to_film(&mut rays, film_distance_mm);
        self.rays.object_z_mm = rays.object_z_mm;
        for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
            self.rays.push(rays.point_mm(i), rays.direction(i), rays.opl_mm[i]);
            self.weights.push(weights[i]);
        }
    }
}

/// Returns the cross-section of a far point's beam, or the solid angle of a near one's in sr/mm², for a unit of area of the
/// pupil's plane.
fn solid_angle_per_area(plane: &PupilPlane, point: &ObjectPoint, direction: DVec3) -> f64 {
    match point {
        ObjectPoint::Infinite(_) => direction.dot(plane.normal()).abs(),
        // cos θ / d², and the plane is everywhere d cos θ from the point.
        ObjectPoint::Finite(place) => {
            let away_mm = plane.normal().dot(plane.in_lens_mm(DVec2::ZERO) - *place);
            direction.dot(plane.normal()).abs().powi(3) / (away_mm * away_mm)
        }
    }
}
