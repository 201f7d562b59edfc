//! Huygens and Fresnel's sum of spherical waves, written out: slow, and an independent check of the plane-wave sum.

use std::f64::consts::TAU;

use dioptric_optics::{MonoLens, ObjectPoint, PupilBoundary, RayBatch, Rims};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::{
    DiffractionError,
    wave::{cis::cis, solid_angle_per_area},
};

/// Secondary sources on a sphere about an image point, each with its exact distance to every film point.
#[derive(Clone, Debug)]
pub struct HuygensSources {
    wave_number_turns_per_mm: f64,
    film_z_mm: f64,
    sources: Vec<Source>,
}

/// A point of the wave in the exit sphere.
#[derive(Clone, Copy, Debug)]
struct Source {
    at_mm: DVec3,
    /// Optical path from the object, in turns of phase, fraction only.
    turns: f64,
    /// √(energy × area of the cell).
    strength_mm: f64,
}

impl HuygensSources {
    /// Traces `n_rings` rings of equally spaced sources within the vignetted pupil of a point, and carries them back
    /// from the film to the sphere about `center_mm` (a film point, lens frame) through the centre of the exit pupil
    /// or, where that is infinitely far, through the last vertex.
    ///
    /// The sources sit in the middle of cells of about equal area: 6 in the innermost ring, 6 more in each further
    /// one. That shares nothing with the nodes of the plane-wave sum.
    ///
    /// # Errors
    /// When no light gets through or rays within the pupil are lost.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_mm: f64,
        center_mm: DVec2,
        n_rings: usize,
    ) -> Result<Self, DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let pupil = PupilBoundary::find(lens, point, 720).ok_or(DiffractionError::NoLight { wavelength_nm })?;
        let cells = rings(&pupil, n_rings);
        let step_mm = 1e-4 * pupil.rho_at_azimuths_mm().iter().copied().fold(f64::INFINITY, f64::min);
        let moved = [DVec2::ZERO, DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(|step| {
            let targets: Vec<DVec2> = cells.iter().map(|(target, _)| target + step * step_mm).collect();
            let mut rays = lens.rays_towards(point, &targets, pupil.z_mm(), 0.0);
            lens.trace(&mut rays, Rims::Ignore);
            lens.to_film(&mut rays, film_mm);
            rays
        });
        let (n_rays, n_lost) = (5 * cells.len(), moved.iter().map(|rays| rays.len() - rays.n_in_flight()).sum());
        if n_lost > 0 {
            return Err(DiffractionError::LostRays { wavelength_nm, n_lost, n_rays });
        }

        // Carry every ray back to the sphere.
        let film_z_mm = lens.last_vertex_z_mm() + film_mm;
        let exit_z_mm = lens.first_order().exit_pupil_z_mm;
        let exit_z_mm = lens.last_vertex_z_mm() + if exit_z_mm.is_finite() { exit_z_mm } else { 0.0 };
        let center = center_mm.extend(film_z_mm);
        let radius_mm = center.distance(DVec3::Z * exit_z_mm).copysign(film_z_mm - exit_z_mm);
        let on_sphere = moved.each_ref().map(|rays| back_to_sphere(rays, center, radius_mm));

        // Give each its share of the energy and its cell of the sphere.
        let solid_angles: Vec<f64> = cells
            .iter()
            .map(|(target, area)| area * solid_angle_per_area(point, target.extend(pupil.z_mm())))
            .collect();
        let total: f64 = solid_angles.iter().sum();
        let per_mm = 1.0 / (wavelength_nm * 1e-6);
        let sources = cells.iter().enumerate().map(|(i, (_, area))| {
            let slope = |plus: usize| (on_sphere[plus][i].0 - on_sphere[plus + 1][i].0) / (2.0 * step_mm);
            let stretch = slope(1).cross(slope(3)).length();
            let (at_mm, back_mm) = on_sphere[0][i];
            let turns = (moved[0].opl_mm[i] - lens.image_index() * back_mm - moved[0].opl_mm[0]) * per_mm;
            // A plane takes up the part of the flux that goes through it.
            let cosine = ((center - at_mm).z / radius_mm).abs();
            let strength_mm = (solid_angles[i] / total * area * stretch * cosine).sqrt();
            Source { at_mm, turns: turns.fract(), strength_mm }
        });
        Ok(Self { wave_number_turns_per_mm: lens.image_index() * per_mm, film_z_mm, sources: sources.collect() })
    }

    /// The number of sources.
    pub fn n_sources(&self) -> usize {
        self.sources.len()
    }

    /// Returns the irradiance at film points, per mm² for unit transmitted energy, on the threads of the current
    /// rayon pool.
    pub fn irradiance_per_mm2(&self, film_mm: &[DVec2]) -> Vec<f64> {
        film_mm.par_iter().map(|at| self.irradiance_at(at.extend(self.film_z_mm))).collect()
    }

    /// Returns the irradiance at a film point over that of the same sources all in phase there.
    pub fn strehl_at(&self, film_mm: DVec2) -> f64 {
        let at = film_mm.extend(self.film_z_mm);
        let amplitude: f64 = self.sources.iter().map(|source| source.strength_mm / at.distance(source.at_mm)).sum();
        self.irradiance_at(at) / (amplitude * self.wave_number_turns_per_mm).powi(2)
    }

    fn irradiance_at(&self, at: DVec3) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        for source in &self.sources {
            let distance_mm = at.distance(source.at_mm) * (self.film_z_mm - source.at_mm.z).signum();
            let (c, s) = cis(source.turns + self.wave_number_turns_per_mm * distance_mm);
            let strength = source.strength_mm / distance_mm;
            re += strength * c;
            im += strength * s;
        }
        (re * re + im * im) * self.wave_number_turns_per_mm * self.wave_number_turns_per_mm
    }
}

/// Returns the middles and areas of cells that fill the pupil, in rings.
fn rings(pupil: &PupilBoundary, n_rings: usize) -> Vec<(DVec2, f64)> {
    let mut cells = Vec::with_capacity(3 * n_rings * (n_rings + 1));
    for ring in 0..n_rings {
        let n = 6 * (ring + 1);
        // The radius at which a ring of cells has its centroid, to second order, and its share of the area.
        let (inner, outer) = (ring as f64 / n_rings as f64, (ring + 1) as f64 / n_rings as f64);
        let share = outer * outer - inner * inner;
        let t = (0.5 * (inner * inner + outer * outer)).sqrt();
        for i in 0..n {
            let theta = TAU * (i as f64 + 0.5) / n as f64;
            let rho_mm = pupil.rho_max_mm(theta);
            let area = 0.5 * rho_mm * rho_mm * share * TAU / n as f64;
            cells.push((pupil.center_mm() + DVec2::from_angle(theta) * (t * rho_mm), area));
        }
    }
    cells
}

/// Returns where rays on the film have crossed a sphere, and how far back that is.
fn back_to_sphere(rays: &RayBatch, center: DVec3, radius_mm: f64) -> Vec<(DVec3, f64)> {
    let crossing = |i: usize| {
        let (film, direction) = (rays.point_mm(i), rays.direction(i));
        let q = film - center;
        let along = q.dot(direction);
        let back_mm = along + (along * along + radius_mm * radius_mm - q.length_squared()).sqrt().copysign(radius_mm);
        (film - direction * back_mm, back_mm)
    };
    (0..rays.len()).map(crossing).collect()
}
