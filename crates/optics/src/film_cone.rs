//! The cone of light that reaches a point of the film.

use glam::{DMat3, DQuat, DVec2, DVec3};

use crate::pupil::{EDGE_MM, EdgeSearch};
use crate::{Placement, PupilBoundary, RayBatch, ReversedLens};

/// Directions across in a first look, and in a second where that finds no light.
const LOOKS: [usize; 2] = [32, 96];
/// How many of the directions that come nearest to the light lead to finer ones, and how often.
const N_LEADERS: usize = 24;
const FINER_ROUNDS: usize = 16;

/// A point of the film that looks back into the lens, whose rays are named by their direction cosines.
///
/// The cosines are those along the film's own x and y there, of the way from the film to the lens: an area of cosines is a projected
/// solid angle. For the light of a scene of even radiance in air the irradiance over the radiance is thus the area of the region of
/// cosines that light comes from, times the square of the index before the film.
#[derive(Clone, Debug)]
pub struct FilmCone<'a> {
    lens: &'a ReversedLens,
    point_mm: DVec3,
    /// Film's own x and y at the point, and the normal along the light.
    axes: DMat3,
    /// The tangent plane of the last surface, on which rays start.
    plane: Placement,
    /// From the point to the plane, mm: the scale of clearances.
    distance_mm: f64,
}

impl<'a> FilmCone<'a> {
    /// Returns the view from a place of the film, mm along its own x and y; `None` where a curved film does not reach, or lies before the last vertex.
    pub fn new(lens: &'a ReversedLens, on_film_mm: DVec2, film_distance_mm: f64) -> Option<Self> {
        let forward = lens.forward();
        let site = forward.film_site(on_film_mm, film_distance_mm)?;
        let flat = forward.film_placement(film_distance_mm).rotation;
        let axes = DMat3::from_quat(DQuat::from_rotation_arc(flat.z_axis, site.normal)) * flat;
        let plane = forward.surface_placement(forward.n_surfaces() - 1);
        let distance_mm = plane.surface_from_lens(site.point_mm).z;
        (distance_mm > 0.0).then_some(Self { lens, point_mm: site.point_mm, axes, plane, distance_mm })
    }

    /// The point of the film in the lens frame, mm.
    pub fn point_mm(&self) -> DVec3 {
        self.point_mm
    }

    /// Returns the direction of the ray with these cosines, in the lens frame, from the film to the lens.
    fn direction(&self, cosines: DVec2) -> DVec3 {
        let along = (1.0 - cosines.length_squared()).max(0.0).sqrt();
        self.axes * cosines.extend(-along)
    }

    /// Returns the point of the tangent plane of the last surface that a ray passes; `None` of one that never does.
    fn start_mm(&self, direction: DVec3) -> Option<DVec3> {
        let towards = -direction.dot(self.plane.rotation.z_axis);
        (towards > 1e-6).then(|| self.point_mm + direction * (self.distance_mm / towards))
    }

    /// Returns the rays with these cosines, on their way back through the lens; those that never reach it start on the film.
    pub fn rays(&self, cosines: &[DVec2]) -> RayBatch {
        let mut rays = RayBatch::with_capacity(cosines.len());
        for &cosines in cosines {
            let direction = self.direction(cosines);
            rays.push(self.start_mm(direction).unwrap_or(self.point_mm), direction, 0.0);
        }
        rays
    }

    /// Returns by how much each ray stays inside the rim or the opening that it comes nearest to, over the distance from the point to the
    /// last vertex; −∞ for one that does not get through whatever the rims.
    pub fn clearances(&self, cosines: &[DVec2]) -> Vec<f64> {
        let mut clearances = self.lens.clearances_mm(&mut self.rays(cosines), false);
        for (clearance, &cosines) in clearances.iter_mut().zip(cosines) {
            let is_towards = cosines.length_squared() < 1.0 && self.start_mm(self.direction(cosines)).is_some();
            *clearance = if is_towards { *clearance / self.distance_mm } else { f64::NEG_INFINITY };
        }
        clearances
    }

    /// Whether light is found to come from anywhere.
    pub fn is_lit(&self) -> bool {
        self.lit().is_some()
    }

    /// Finds the region of cosines from which light comes: its center and its edge at `n_azimuths` from +x on, as
    /// [`PupilBoundary`] has them; `None` where no light gets through.
    pub fn edge(&self, n_azimuths: usize) -> Option<(DVec2, Vec<f64>)> {
        let lit = self.lit()?;
        let directions: Vec<DVec2> = PupilBoundary::azimuths(n_azimuths).collect();
        let center = self.climbed(lit);
        Some((center, self.edge_mm(center, &directions, EDGE_MM)?))
    }

    /// Finds cosines from which light comes, and their clearance: over all directions, then about those that come nearest to the light.
    fn lit(&self) -> Option<(DVec2, f64)> {
        LOOKS.into_iter().find_map(|n_across| {
            let mut step = 2.0 / n_across as f64;
            let middle = |i: usize| (i as f64 + 0.5) * step - 1.0;
            let all = (0..n_across * n_across).map(|i| DVec2::new(middle(i % n_across), middle(i / n_across)));
            let mut leaders = self.best(all.filter(|cosines| cosines.length_squared() < 1.0).collect());
            for _ in 0..FINER_ROUNDS {
                let &(cosines, clearance) = leaders.first()?;
                if clearance > 0.0 {
                    return Some((cosines, clearance));
                }
                step *= 0.5;
                let offsets = [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|x| step * DVec2::new(x, y)));
                let about = |leader: &(DVec2, f64)| {
                    offsets.as_flattened().iter().map(|offset| leader.0 + *offset).collect::<Vec<_>>()
                };
                leaders = self.best(leaders.iter().flat_map(about).collect());
            }
            None
        })
    }

    /// Returns the cosines of most clearance of these, the best first; none that do not get through whatever the rims.
    fn best(&self, cosines: Vec<DVec2>) -> Vec<(DVec2, f64)> {
        let clearances = self.clearances(&cosines);
        let mut found: Vec<(DVec2, f64)> =
            cosines.into_iter().zip(clearances).filter(|(_, clearance)| clearance.is_finite()).collect();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found.truncate(N_LEADERS);
        found
    }
}

impl EdgeSearch for FilmCone<'_> {
    fn clearances(&self, places: &[DVec2]) -> Vec<f64> {
        self.clearances(places)
    }
}
