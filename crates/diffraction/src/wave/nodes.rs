//! The pupil as a set of plane waves at the film.

use std::f64::consts::TAU;

use dioptric_optics::{MonoLens, ObjectPoint};
use glam::DVec2;
use multiversion::multiversion;

use super::{
    cells::{CellWaves, PupilCells, disc},
    grid::{PhaseRange, PupilGrid},
    propagation::Propagation,
    transform::PlaneWaves,
};
use crate::DiffractionError;

/// The light of one object point at one wavelength on the film, as plane waves: one for each node of the pupil.
///
/// The wave at the film point `reference + δ` is `U = Σ amplitude · exp(i k (Φ + n d·δ))`, k = 2π/λ in vacuum, and
/// its square is the irradiance per mm² of a point whose transmitted energy is 1. Everything is in the film's own frame.
/// The lists have one length and go azimuth by azimuth, `grid.n_radii` nodes from the inside outwards each; they can be
/// filled by hand, from interpolated ray maps for one.
#[derive(Clone, Debug, PartialEq)]
pub struct PupilSamples {
    /// Vacuum wavelength, nm.
    pub wavelength_nm: f64,
    /// Index of the image space, n.
    pub image_index: f64,
    /// How many nodes there are in each direction at least: what the node rule is held against. Pupils with corners, with
    /// holes, and long and narrow ones have more azimuths.
    pub grid: PupilGrid,
    /// What the nodes stand for.
    pub propagation: Propagation,
    /// The film point that q, Φ and δ count from, mm.
    pub reference_mm: DVec2,
    /// What the pupil takes in: the solid angle in sr for a near point, the cross-section of the beam in mm² for a
    /// far one.
    pub collected: f64,
    /// x of where each ray meets the film, from the reference, mm.
    pub q_x_mm: Vec<f64>,
    /// y of the same.
    pub q_y_mm: Vec<f64>,
    /// x of each wave's unit direction.
    pub d_x: Vec<f64>,
    /// y of the same.
    pub d_y: Vec<f64>,
    /// Optical path to the reference point along each wave, Φ = OPL − n q·d, mm.
    pub phi_mm: Vec<f64>,
    /// Share of the transmitted energy in each node; the sum is 1. What obscurations stop is counted as negative.
    pub energy: Vec<f64>,
    /// Amplitude of each wave, `(n/λ) √(e Δ)` with Δ the area of the node's cell in (dx, dy), 1/mm; negative where the
    /// energy is.
    pub amplitude_per_mm: Vec<f64>,
}

impl PupilSamples {
    /// Traces the nodes of the true, vignetted pupil to the film, `film_distance_mm` behind the last vertex; the reference is
    /// the centroid of the rays, or `reference_mm` on the film.
    ///
    /// # Errors
    /// When no light gets through, rays within the pupil are lost, or all rays run in one direction.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        grid: PupilGrid,
        reference_mm: Option<DVec2>,
    ) -> Result<Self, DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let cells = PupilCells::find(lens, point, grid).ok_or(DiffractionError::NoLight { wavelength_nm })?;
        let CellWaves { rays, centroid_mm, waves, areas } = cells.waves(lens, point, film_distance_mm)?;
        let n = cells.n_nodes();
        let per_mm = lens.image_index() / (wavelength_nm * 1e-6);
        let amplitude = |(area, e): (&f64, &f64)| (per_mm * (area * e).sqrt()).copysign(*e);
        let q = |of: fn(DVec2) -> f64| (0..n).map(|i| of(rays.place_mm(i)) - of(centroid_mm)).collect();
        let nodes = Self {
            wavelength_nm,
            image_index: lens.image_index(),
            grid,
            propagation: waves.propagation,
            reference_mm: centroid_mm,
            collected: cells.collected,
            q_x_mm: q(|place| place.x),
            q_y_mm: q(|place| place.y),
            d_x: waves.d.iter().map(|d| d.x).collect(),
            d_y: waves.d.iter().map(|d| d.y).collect(),
            phi_mm: waves.phi_mm,
            amplitude_per_mm: areas.iter().zip(&cells.energy).map(amplitude).collect(),
            energy: cells.energy,
        };
        // The sphere is that about the centroid, whatever the reference: all windows see the same waves.
        Ok(match reference_mm {
            Some(reference_mm) => nodes.about(reference_mm),
            None => nodes,
        })
    }

    /// Returns the nodes of a perfect lens: a round pupil, evenly bright over the directions, all in phase at the
    /// reference point. Its PSF is Airy's, with λN = λ / (2 NA).
    ///
    /// # Errors
    /// When the numerical aperture is not between 0 and the index.
    pub fn perfect(
        numerical_aperture: f64,
        image_index: f64,
        wavelength_nm: f64,
        grid: PupilGrid,
    ) -> Result<Self, DiffractionError> {
        let radius = numerical_aperture / image_index;
        if !(radius > 0.0 && radius <= 1.0) {
            let (what, expected) = ("the numerical aperture", "above 0 and at most the index of the image space");
            return Err(DiffractionError::Setting { what, found: numerical_aperture, expected });
        }
        let (d, energy): (Vec<DVec2>, Vec<f64>) = disc(grid).into_iter().unzip();
        let n = d.len();
        let disc = energy.iter().sum::<f64>();
        let amplitude = |e: &f64| image_index / (wavelength_nm * 1e-6) * e / disc.sqrt() * radius;
        Ok(Self {
            wavelength_nm,
            image_index,
            grid,
            propagation: Propagation::Debye,
            reference_mm: DVec2::ZERO,
            collected: disc * radius * radius,
            q_x_mm: vec![0.0; n],
            q_y_mm: vec![0.0; n],
            d_x: d.iter().map(|d| radius * d.x).collect(),
            d_y: d.iter().map(|d| radius * d.y).collect(),
            phi_mm: vec![0.0; n],
            amplitude_per_mm: energy.iter().map(amplitude).collect(),
            energy: energy.iter().map(|e| e / disc).collect(),
        })
    }

    /// Returns no nodes at all.
    pub(super) fn none() -> Self {
        let grid = PupilGrid { n_radii: 0, n_azimuths: 0 };
        Self {
            wavelength_nm: 0.0,
            image_index: 1.0,
            grid,
            propagation: Propagation::Debye,
            reference_mm: DVec2::ZERO,
            collected: 0.0,
            q_x_mm: vec![],
            q_y_mm: vec![],
            d_x: vec![],
            d_y: vec![],
            phi_mm: vec![],
            energy: vec![],
            amplitude_per_mm: vec![],
        }
    }

    /// The number of nodes.
    pub fn len(&self) -> usize {
        self.energy.len()
    }

    /// Whether there are no nodes.
    pub fn is_empty(&self) -> bool {
        self.energy.is_empty()
    }

    /// Returns the centroid of the light on the film, mm: that of the rays, which is exactly that of the wave.
    pub fn centroid_mm(&self) -> DVec2 {
        self.reference_mm + self.mean(&self.q_x_mm, &self.q_y_mm)
    }

    /// Returns the mean direction of the light, as (dx, dy).
    pub fn mean_direction(&self) -> DVec2 {
        self.mean(&self.d_x, &self.d_y)
    }

    fn mean(&self, x: &[f64], y: &[f64]) -> DVec2 {
        let [total, x, y] = sums(&self.energy, x, y);
        DVec2::new(x, y) / total
    }

    /// Returns the numerical aperture: the index times the largest difference of a direction from the mean one, at
    /// the pupil's edge.
    pub fn numerical_aperture(&self) -> f64 {
        // The outermost Gauss–Legendre node, by the first zero of J₀, 2.4048: to 1e-5 of the radius.
        let outermost = 1.0 - (2.4048 / (2.0 * self.grid.n_radii as f64 + 1.0)).powi(2);
        self.image_index * largest(&self.d_x, &self.d_y, self.mean_direction()) / outermost
    }

    /// Returns λN, the wavelength times the working f-number, mm: the unit of Airy's pattern.
    pub fn airy_unit_mm(&self) -> f64 {
        self.wavelength_nm * 1e-6 / (2.0 * self.numerical_aperture())
    }

    /// Returns how far from the centroid the farthest ray meets the film, mm.
    pub(super) fn spot_mm(&self) -> f64 {
        largest(&self.q_x_mm, &self.q_y_mm, self.mean(&self.q_x_mm, &self.q_y_mm))
    }

    /// Returns the ranges of the phase over the pupil's radius, for places up to `extent_mm` from the reference.
    pub fn phase_range(&self, extent_mm: f64) -> PhaseRange {
        let per_mm = TAU / (self.wavelength_nm * 1e-6) * self.numerical_aperture();
        let centroid_mm = self.mean(&self.q_x_mm, &self.q_y_mm);
        PhaseRange {
            rays: per_mm * self.spot_mm(),
            along_radius: per_mm * self.widest_along_radius(centroid_mm) / PhaseRange::DEFOCUS_ALONG_RADIUS,
            window: per_mm * (extent_mm + centroid_mm.length()),
        }
    }

    /// Returns the largest distance of rays from a place, each times √(t (1 − t)) at the share t of its radius.
    fn widest_along_radius(&self, from_mm: DVec2) -> f64 {
        let n_radii = self.grid.n_radii.max(1);
        // Gauss and Legendre's nodes are t = (1 + cos θ)/2 with these θ, to a part in n².
        let theta = |i: usize| std::f64::consts::PI * (i as f64 + 0.75) / (n_radii as f64 + 0.5);
        let weights: Vec<f64> = (0..n_radii).map(|i| 0.5 * theta(i).sin()).collect();
        let azimuths = self.q_x_mm.chunks(n_radii).zip(self.q_y_mm.chunks(n_radii));
        azimuths.map(|(x, y)| widest(x, y, &weights, from_mm)).fold(0.0, f64::max).sqrt()
    }

    /// Checks the node rule for places up to `extent_mm` from the reference, and returns B.
    ///
    /// # Errors
    /// When there are fewer nodes than B needs.
    pub fn check(&self, extent_mm: f64) -> Result<f64, DiffractionError> {
        let range = self.phase_range(extent_mm);
        let needed = PupilGrid::needed(range);
        if self.grid.covers(needed) {
            return Ok(range.total());
        }
        Err(DiffractionError::TooFewNodes {
            n_radii: self.grid.n_radii,
            n_azimuths: self.grid.n_azimuths,
            bandwidth: range.total(),
            needed_radii: needed.n_radii,
            needed_azimuths: needed.n_azimuths,
        })
    }

    /// Returns the nodes with another reference point; spherical waves are taken as plane on the way there.
    #[must_use]
    pub fn about(mut self, reference_mm: DVec2) -> Self {
        let shift = reference_mm - self.reference_mm;
        self.reference_mm = reference_mm;
        for i in 0..self.len() {
            self.q_x_mm[i] -= shift.x;
            self.q_y_mm[i] -= shift.y;
            self.phi_mm[i] += self.image_index * (shift.x * self.d_x[i] + shift.y * self.d_y[i]);
        }
        self
    }

    /// Returns the irradiance at one film point, per mm² for unit transmitted energy: the sum written out, in double
    /// precision.
    pub fn irradiance_per_mm2(&self, on_film_mm: DVec2) -> f64 {
        self.plane_waves(DVec2::ZERO).irradiance_at(on_film_mm - self.reference_mm).value
    }

    /// The irradiance at the peak if all waves were in phase, per mm² for unit transmitted energy.
    pub fn perfect_peak_per_mm2(&self) -> f64 {
        self.amplitude_per_mm.iter().sum::<f64>().powi(2)
    }

    /// Returns the waves with the common piston and tilt taken out, which |U|² does not feel; places count from
    /// `origin_mm` beside the reference.
    pub(crate) fn plane_waves(&self, origin_mm: DVec2) -> PlaneWaves {
        let mut waves = PlaneWaves::default();
        self.fill_plane_waves(&mut waves, origin_mm);
        waves
    }

    /// The same, in an old list.
    pub(crate) fn fill_plane_waves(&self, waves: &mut PlaneWaves, origin_mm: DVec2) {
        for list in [&mut waves.re, &mut waves.im, &mut waves.turns_x_per_mm, &mut waves.turns_y_per_mm] {
            list.resize(self.len(), 0.0);
        }
        let per_mm = 1.0 / (self.wavelength_nm * 1e-6);
        let (mean, piston_mm) = (self.mean_direction(), self.phi_mm.first().copied().unwrap_or(0.0));
        for (turns, d, mean) in
            [(&mut waves.turns_x_per_mm, &self.d_x, mean.x), (&mut waves.turns_y_per_mm, &self.d_y, mean.y)]
        {
            for (turns, d) in turns.iter_mut().zip(d) {
                *turns = self.image_index * (d - mean) * per_mm;
            }
        }
        for ((turns, phi), (x, y)) in
            waves.re.iter_mut().zip(&self.phi_mm).zip(waves.turns_x_per_mm.iter().zip(&waves.turns_y_per_mm))
        {
            *turns = (phi - piston_mm) * per_mm + (x * origin_mm.x + y * origin_mm.y);
        }
        turn_to_phasors(&mut waves.re, &mut waves.im, &self.amplitude_per_mm);
    }
}

/// Replaces phases in turns by the waves of these amplitudes: real and imaginary parts.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn turn_to_phasors(re: &mut [f64], im: &mut [f64], amplitudes: &[f64]) {
    for ((re, im), amplitude) in re.iter_mut().zip(im).zip(amplitudes) {
        let (c, s) = super::cis::cis(*re);
        (*re, *im) = (amplitude * c, amplitude * s);
    }
}

/// Returns the largest distance of points from one.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn largest(x: &[f64], y: &[f64], from: DVec2) -> f64 {
    let square = |x: f64, y: f64| (x - from.x) * (x - from.x) + (y - from.y) * (y - from.y);
    let mut most = [0.0_f64; LANES];
    let (x_groups, y_groups) = (x.chunks_exact(LANES), y.chunks_exact(LANES));
    let rest = x_groups.remainder().iter().zip(y_groups.remainder());
    for (x, y) in x_groups.zip(y_groups) {
        for lane in 0..LANES {
            let square = square(x[lane], y[lane]);
            most[lane] = if square > most[lane] { square } else { most[lane] };
        }
    }
    rest.map(|(x, y)| square(*x, *y)).chain(most).fold(0.0, f64::max).sqrt()
}

/// Returns the largest square of weighted distances of points from one.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn widest(x: &[f64], y: &[f64], weights: &[f64], from: DVec2) -> f64 {
    let mut most = 0.0;
    for ((x, y), weight) in x.iter().zip(y).zip(weights) {
        let square = weight * weight * ((x - from.x) * (x - from.x) + (y - from.y) * (y - from.y));
        most = if square > most { square } else { most };
    }
    most
}

/// Returns the sums of a list, and of its products with two others; numbers eight apart are added first.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn sums(weights: &[f64], x: &[f64], y: &[f64]) -> [f64; 3] {
    let mut partial = [[0.0; LANES]; 3];
    for ((w, x), y) in weights.chunks(LANES).zip(x.chunks(LANES)).zip(y.chunks(LANES)) {
        for (lane, ((w, x), y)) in w.iter().zip(x).zip(y).enumerate() {
            partial[0][lane] += w;
            partial[1][lane] += w * x;
            partial[2][lane] += w * y;
        }
    }
    partial.map(|lanes| lanes.iter().sum())
}

const LANES: usize = 8;
