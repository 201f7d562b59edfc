//! Huygens and Fresnel's sum of spherical waves, written out: slow, and an independent check of the plane-wave sum.

mod cells;

use std::f64::consts::TAU;

use dioptric_optics::{ImageSurface, MonoLens, ObjectPoint, RayBatch, Vignetting};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::{DiffractionError, wave::FilmRays};
use cells::{Cell, cells};

/// Secondary sources on a sphere about an image point, each with its exact distance to every film point.
#[derive(Clone, Debug)]
pub struct HuygensSources {
    wave_number_turns_per_mm: f64,
    film: ImageSurface,
    sources: Vec<Source>,
}

/// A point of the wave in the exit sphere, in the frame of the film.
#[derive(Clone, Copy, Debug)]
struct Source {
    at_mm: DVec3,
    /// Optical path from the object, in turns of phase, fraction only.
    turns: f64,
    /// √(energy × area of the cell).
    strength_mm: f64,
}

/// The shares of the pupil's width by which rays beside a source are moved, for derivatives.
const STEP: f64 = 1e-5;

impl HuygensSources {
    /// Traces sources within the vignetted pupil of a point, `n_across` cells along its width and height, and carries
    /// them back from the film to the sphere about `center_mm` (a place of the film, along its own x and y) through the center of the exit
    /// pupil or, where that is infinitely far, through the last vertex.
    ///
    /// The pupil is what rays get through with their rims, tried on a square grid, and rims are followed through its
    /// cells. That shares nothing with the nodes of the plane-wave sum; neither do energies, areas and phases. Where the
    /// phase turns by φ along a cell, the sum errs by φ⁴/4000; rims by 2/(3 n²).
    ///
    /// # Errors
    /// When no light gets through or rays within the pupil are lost.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        center_mm: DVec2,
        n_across: usize,
    ) -> Result<Self, DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let (cells, z_mm) = cells(lens, point, n_across)
            .filter(|(cells, _)| !cells.is_empty())
            .ok_or(DiffractionError::NoLight { wavelength_nm })?;
        let widest_mm = cells.iter().map(|cell| cell.at_mm.distance(cells[0].at_mm)).fold(0.0, f64::max);
        let beside = Beside::trace(lens, point, film_distance_mm, (&cells, z_mm, STEP * widest_mm))?;

        // Carry every ray back to the sphere.
        let placement = lens.film_placement(film_distance_mm);
        let on_film = beside.rays.each_ref().map(|rays| FilmRays::new(rays, lens, film_distance_mm));
        let exit_mm =
            on_film[0].exit_pupil_mm.unwrap_or_else(|| placement.surface_from_lens(lens.film_placement(0.0).vertex_mm));
        let center = on_film[0].film_point_mm(center_mm);
        let radius_mm = center.distance(exit_mm).copysign(-exit_mm.z);
        let on_sphere = on_film.each_ref().map(|rays| back_to_sphere(rays, center, radius_mm));

        // Give each its share of the energy and its cell of the sphere.
        let energies: Vec<f64> = (0..cells.len()).map(|i| cells[i].area_mm2 * beside.brightness(i)).collect();
        let total: f64 = energies.iter().sum();
        let per_mm = 1.0 / (wavelength_nm * 1e-6);
        let sources = cells.iter().enumerate().map(|(i, cell)| {
            let stretch = beside.stretch(|batch| on_sphere[batch][i].0);
            let (at_mm, back_mm) = on_sphere[0][i];
            let paths_mm = &beside.rays[0].opl_mm;
            let turns = (paths_mm[i] - lens.image_index() * back_mm - paths_mm[0]) * per_mm;
            // The film takes up the part of the flux that goes through it: per area of its vertex plane.
            let slope = lens.image_surface().slope_at(center_mm);
            let cosine = ((center - at_mm).dot(DVec3::new(-slope.x, -slope.y, 1.0)) / radius_mm).abs();
            let strength_mm = (energies[i] / total * cell.area_mm2 * stretch * cosine).sqrt();
            Source { at_mm, turns: turns.fract(), strength_mm }
        });
        Ok(Self {
            wave_number_turns_per_mm: lens.image_index() * per_mm,
            film: lens.image_surface(),
            sources: sources.collect(),
        })
    }

    /// The number of sources.
    pub fn n_sources(&self) -> usize {
        self.sources.len()
    }

    /// Returns the irradiance at film points, per mm² for unit transmitted energy, on the threads of the current
    /// rayon pool.
    pub fn irradiance_per_mm2(&self, on_film_mm: &[DVec2]) -> Vec<f64> {
        on_film_mm.par_iter().map(|at| self.irradiance_at(self.point_mm(*at))).collect()
    }

    /// Returns the irradiance at a film point over that of the same sources all in phase there.
    pub fn strehl_at(&self, on_film_mm: DVec2) -> f64 {
        let at = self.point_mm(on_film_mm);
        let amplitude: f64 = self.sources.iter().map(|source| source.strength_mm / at.distance(source.at_mm)).sum();
        self.irradiance_at(at) / (amplitude * self.wave_number_turns_per_mm).powi(2)
    }

    /// Returns the point of the film over a place.
    fn point_mm(&self, place_mm: DVec2) -> DVec3 {
        place_mm.extend(self.film.sag_at_mm(place_mm))
    }

    fn irradiance_at(&self, at: DVec3) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        for source in &self.sources {
            let distance_mm = at.distance(source.at_mm) * (at.z - source.at_mm.z).signum();
            let (s, c) = (TAU * (source.turns + self.wave_number_turns_per_mm * distance_mm).fract()).sin_cos();
            let strength = source.strength_mm / distance_mm;
            re += strength * c;
            im += strength * s;
        }
        (re * re + im * im) * self.wave_number_turns_per_mm * self.wave_number_turns_per_mm
    }
}

/// The rays of cells on the film, and those beside them towards +x, −x, +y and −y.
struct Beside {
    rays: [RayBatch; 5],
    /// Directions of all as they leave the object.
    from: [Vec<DVec3>; 5],
    is_far: bool,
    step_mm: f64,
}

impl Beside {
    fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        (cells, z_mm, step_mm): (&[Cell], f64, f64),
    ) -> Result<Self, DiffractionError> {
        let batches = [DVec2::ZERO, DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(|step| {
            let targets: Vec<DVec2> = cells.iter().map(|cell| cell.at_mm + step * step_mm).collect();
            let mut rays = lens.rays_towards(point, &targets, z_mm, 0.0);
            let from: Vec<DVec3> = (0..rays.len()).map(|i| rays.direction(i)).collect();
            lens.trace(&mut rays, Vignetting::Off);
            lens.to_film(&mut rays, film_distance_mm);
            (rays, from)
        });
        let n_lost = batches.iter().map(|(rays, _)| rays.len() - rays.n_in_flight()).sum();
        if n_lost > 0 {
            let (wavelength_nm, n_rays) = (lens.wavelength_nm(), 5 * cells.len());
            return Err(DiffractionError::LostRays { wavelength_nm, n_lost, n_rays });
        }
        let from = batches.each_ref().map(|(_, from)| from.clone());
        let is_far = matches!(point, ObjectPoint::Infinite(_));
        Ok(Self { rays: batches.map(|(rays, _)| rays), from, is_far, step_mm })
    }

    /// Returns by how much an area of the pupil's plane grows on a surface, of which the places in each batch are given.
    fn stretch(&self, place: impl Fn(usize) -> DVec3) -> f64 {
        let slope = |plus: usize| (place(plus) - place(plus + 1)) / (2.0 * self.step_mm);
        slope(1).cross(slope(3)).length()
    }

    /// Returns the solid angle per area of the pupil's plane that a cell is seen under; of far points the cross-section.
    fn brightness(&self, i: usize) -> f64 {
        if self.is_far { self.from[0][i].z } else { self.stretch(|batch| self.from[batch][i]) }
    }
}

/// Returns where rays on the film have crossed a sphere, and how far back that is.
fn back_to_sphere(rays: &FilmRays, center: DVec3, radius_mm: f64) -> Vec<(DVec3, f64)> {
    let crossing = |i: usize| {
        let (film, direction) = (rays.points_mm[i], rays.directions[i]);
        let q = film - center;
        let along = q.dot(direction);
        let back_mm = along + (along * along + radius_mm * radius_mm - q.length_squared()).sqrt().copysign(radius_mm);
        (film - direction * back_mm, back_mm)
    };
    (0..rays.points_mm.len()).map(crossing).collect()
}
