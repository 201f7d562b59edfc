//! The pupil as a set of plane waves at the film.

use std::f64::consts::TAU;

use dioptric_optics::{MonoLens, ObjectPoint, PupilBoundary, RayBatch, Rims};
use glam::{DVec2, DVec3};
use multiversion::multiversion;

use super::transform::PlaneWaves;
use crate::{DiffractionError, quadrature::gauss_legendre_on};

/// How many nodes a pupil has: Gauss–Legendre along the radius, equally spaced in azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PupilGrid {
    /// Nodes from the centre to the edge.
    pub n_radii: usize,
    /// Azimuths.
    pub n_azimuths: usize,
}

impl PupilGrid {
    /// The 12 × 48 nodes that do for any point in focus on a small window.
    pub const STANDARD: Self = Self { n_radii: 12, n_azimuths: 48 };

    /// Returns the fewest nodes that resolve these ranges of phase. With fewer the sum fails abruptly.
    ///
    /// With B the sum of both ranges: `B/7 + 8` radii and `0.8 B + 16` azimuths. Those serve while the blur exceeds the
    /// window. Light at the window's corner turns with the azimuth by all of its range, and along a radius by all of it
    /// too, where aberrations and defocus gather about half of theirs; for it (an error of 1e-5 in L1, measured on
    /// windows of up to 60 λN and defoci of up to 64 waves) `rays/6 + window/4 + 5` radii and
    /// `window + 3 ∛window + 6` azimuths are needed.
    pub fn needed(range: PhaseRange) -> Self {
        let (rays, window, total) = (range.rays, range.window, range.total());
        let n_radii = (total / 7.0 + 8.0).max(rays / 6.0 + window / 4.0 + 5.0).ceil() as usize;
        let n_azimuths = (0.8 * total + 16.0).max(window + 3.0 * window.cbrt() + 6.0).ceil() as usize;
        Self { n_radii, n_azimuths: n_azimuths.next_multiple_of(2) }
    }

    /// Returns the grid with both numbers multiplied by `factor` and rounded up.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let scaled = |n: usize| (n as f64 * factor - 1e-9).ceil() as usize;
        Self { n_radii: scaled(self.n_radii), n_azimuths: scaled(self.n_azimuths).next_multiple_of(2) }
    }

    /// Returns the larger of both, in each direction.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        let (n_radii, n_azimuths) = (self.n_radii.max(other.n_radii), self.n_azimuths.max(other.n_azimuths));
        Self { n_radii, n_azimuths }
    }

    /// Whether this grid is no coarser than another.
    pub fn covers(self, other: Self) -> bool {
        self.n_radii >= other.n_radii && self.n_azimuths >= other.n_azimuths
    }

    /// The number of nodes.
    pub fn n_nodes(self) -> usize {
        self.n_radii * self.n_azimuths
    }
}

/// How far phases range from the pupil's centre to its edge, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseRange {
    /// By the rays' places on the film about their centroid, `(2π/λ) NA q_max`: defocus and aberrations.
    pub rays: f64,
    /// By the window's reach beyond that centroid, `(2π/λ) NA δ_max`.
    pub window: f64,
}

impl PhaseRange {
    /// B, the sum of both.
    pub fn total(self) -> f64 {
        self.rays + self.window
    }
}

/// How the light gets from the lens to the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Propagation {
    /// Each ray stands for a plane wave along it (Debye): right where the pupil is many Fresnel zones wide.
    Debye,
    /// Each point of the exit pupil sends a spherical wave to the film (Huygens and Fresnel), taken as plane over the
    /// window: for pinholes and other pupils of few zones.
    Fresnel,
}

/// Pupils of fewer Fresnel zones than this send spherical waves. At 30 zones the two sums differ by a few parts in
/// a thousand.
const FEW_FRESNEL_ZONES: f64 = 30.0;

/// The light of one object point at one wavelength on the film, as plane waves: one for each node of the pupil.
///
/// The wave at the film point `reference + δ` is `U = Σ amplitude · exp(i k (Φ + n d·δ))`, k = 2π/λ in vacuum, and
/// its square is the irradiance per mm² of a point whose transmitted energy is 1. Everything is in the lens frame.
/// The lists have one length; they can be filled by hand, from interpolated ray maps for one.
#[derive(Clone, Debug, PartialEq)]
pub struct WaveNodes {
    /// Vacuum wavelength, nm.
    pub wavelength_nm: f64,
    /// Index of the image space, n.
    pub image_index: f64,
    /// How many nodes there are in each direction: what the node rule is held against.
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
    /// Share of the transmitted energy in each node; the sum is 1.
    pub energy: Vec<f64>,
    /// Amplitude of each wave, `(n/λ) √(e Δ)` with Δ the area of the node's cell in (dx, dy), 1/mm.
    pub amplitude_per_mm: Vec<f64>,
}

impl WaveNodes {
    /// Traces the nodes of the true, vignetted pupil to the film, `film_mm` behind the last vertex; the reference is
    /// the centroid of the rays, or `reference_mm` on the film.
    ///
    /// # Errors
    /// When no light gets through, rays within the pupil are lost, or all rays run in one direction.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_mm: f64,
        grid: PupilGrid,
        reference_mm: Option<DVec2>,
    ) -> Result<Self, DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let pupil =
            PupilBoundary::find(lens, point, grid.n_azimuths).ok_or(DiffractionError::NoLight { wavelength_nm })?;
        let cells = PupilCells::new(&pupil, point, grid);
        let rays = cells.trace(lens, point, film_mm)?;
        let reference_mm = reference_mm.unwrap_or_else(|| cells.centroid_mm(&rays));
        let waves = match propagation(lens, film_mm) {
            Propagation::Debye => along_rays(&rays, reference_mm, lens.image_index()),
            Propagation::Fresnel => from_exit_pupil(&rays, reference_mm, lens),
        };
        let areas = cells.direction_areas(&waves, wavelength_nm)?;
        let n = cells.n_nodes();
        let per_mm = lens.image_index() / (wavelength_nm * 1e-6);
        let q = |at: &[f64], from: f64| at[..n].iter().map(|x| x - from).collect();
        Ok(Self {
            wavelength_nm,
            image_index: lens.image_index(),
            grid,
            propagation: propagation(lens, film_mm),
            reference_mm,
            collected: cells.collected,
            q_x_mm: q(&rays.x_mm, reference_mm.x),
            q_y_mm: q(&rays.y_mm, reference_mm.y),
            d_x: waves.d[..n].iter().map(|d| d.x).collect(),
            d_y: waves.d[..n].iter().map(|d| d.y).collect(),
            phi_mm: waves.phi_mm[..n].to_vec(),
            amplitude_per_mm: areas.iter().zip(&cells.energy).map(|(area, e)| per_mm * (area * e).sqrt()).collect(),
            energy: cells.energy,
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
        let (d, energy): (Vec<DVec2>, Vec<f64>) = polar(grid, |_| 1.0).unzip();
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

    /// Returns the ranges of the phase over the pupil's radius, for places up to `reach_mm` from the reference.
    pub fn phase_range(&self, reach_mm: f64) -> PhaseRange {
        let per_mm = TAU / (self.wavelength_nm * 1e-6) * self.numerical_aperture();
        let centroid_mm = self.mean(&self.q_x_mm, &self.q_y_mm);
        let spot_mm = largest(&self.q_x_mm, &self.q_y_mm, centroid_mm);
        PhaseRange { rays: per_mm * spot_mm, window: per_mm * (reach_mm + centroid_mm.length()) }
    }

    /// Checks the node rule for places up to `reach_mm` from the reference, and returns B.
    ///
    /// # Errors
    /// When there are fewer nodes than B needs.
    pub fn check(&self, reach_mm: f64) -> Result<f64, DiffractionError> {
        let range = self.phase_range(reach_mm);
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
    pub fn irradiance_per_mm2(&self, film_mm: DVec2) -> f64 {
        let waves = self.plane_waves(DVec2::ZERO);
        let at = film_mm - self.reference_mm;
        let (mut re, mut im) = (0.0, 0.0);
        for j in 0..self.len() {
            let (c, s) = super::cis::cis(waves.turns_x_per_mm[j] * at.x + waves.turns_y_per_mm[j] * at.y);
            re += waves.re[j] * c - waves.im[j] * s;
            im += waves.re[j] * s + waves.im[j] * c;
        }
        re * re + im * im
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

/// Returns the nodes of a star-shaped region, given its edge at each azimuth, and the areas of their cells.
pub(crate) fn polar(grid: PupilGrid, rho_max: impl Fn(usize) -> f64) -> impl Iterator<Item = (DVec2, f64)> {
    let radii = gauss_legendre_on(grid.n_radii, 0.0, 1.0);
    let step = TAU / grid.n_azimuths as f64;
    (0..grid.n_azimuths).flat_map(move |azimuth| {
        let (rho, direction) = (rho_max(azimuth), DVec2::from_angle(step * azimuth as f64));
        radii.clone().into_iter().map(move |(t, w)| (direction * (rho * t), rho * rho * t * w * step))
    })
}

/// Returns the wave model for a lens and film.
pub(super) fn propagation(lens: &MonoLens, film_mm: f64) -> Propagation {
    let first = lens.first_order();
    let (radius_mm, way_mm) = (0.5 * first.exit_pupil_diameter_mm, film_mm - first.exit_pupil_z_mm);
    let zones = first.image_index * radius_mm * radius_mm / (lens.wavelength_nm() * 1e-6 * way_mm.abs());
    // A telecentric lens has a pupil infinitely large and far: no reason for doubt, and no place for waves to begin.
    let is_doubtful = way_mm.is_finite() && (first.power_per_mm == 0.0 || zones < FEW_FRESNEL_ZONES);
    if is_doubtful { Propagation::Fresnel } else { Propagation::Debye }
}

/// The cells of a pupil in the entrance-pupil plane.
struct PupilCells {
    targets_mm: Vec<DVec2>,
    areas_mm2: Vec<f64>,
    /// Shares of the energy, of sum 1.
    energy: Vec<f64>,
    collected: f64,
    z_mm: f64,
    /// Half the distance of the neighbours that derivatives are taken from, mm.
    step_mm: f64,
}

impl PupilCells {
    fn new(pupil: &PupilBoundary, point: &ObjectPoint, grid: PupilGrid) -> Self {
        let (rho_mm, center_mm, z_mm) = (pupil.rho_at_azimuths_mm(), pupil.center_mm(), pupil.z_mm());
        let (targets_mm, areas_mm2): (Vec<DVec2>, Vec<f64>) =
            polar(grid, |azimuth| rho_mm[azimuth]).map(|(offset, area)| (center_mm + offset, area)).unzip();
        let taken = |(target, area): (&DVec2, &f64)| area * solid_angle_per_area(point, target.extend(z_mm));
        let mut energy: Vec<f64> = targets_mm.iter().zip(&areas_mm2).map(taken).collect();
        let collected: f64 = energy.iter().sum();
        for e in &mut energy {
            *e /= collected;
        }
        let narrowest_mm = rho_mm.iter().copied().fold(f64::INFINITY, f64::min);
        // Truncation is of order the step squared, 1e-8 of a derivative's own change over the pupil; rounding is
        // 1e-16 over it. The outermost node stays further than that from the edge, up to 80 radii.
        let step_mm = narrowest_mm * 1e-4f64.min(0.5 / (grid.n_radii * grid.n_radii) as f64);
        Self { targets_mm, areas_mm2, energy, collected, z_mm, step_mm }
    }

    fn n_nodes(&self) -> usize {
        self.targets_mm.len()
    }

    /// Traces the nodes to the film, and after them their neighbours towards +x, −x, +y and −y.
    fn trace(&self, lens: &MonoLens, point: &ObjectPoint, film_mm: f64) -> Result<RayBatch, DiffractionError> {
        let steps = [DVec2::ZERO, DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(|u| u * self.step_mm);
        let targets_mm: Vec<DVec2> =
            steps.iter().flat_map(|step| self.targets_mm.iter().map(move |target| target + step)).collect();
        let mut rays = lens.rays_towards(point, &targets_mm, self.z_mm, 0.0);
        lens.trace(&mut rays, Rims::Ignore);
        lens.to_film(&mut rays, film_mm);
        let (n_rays, n_lost) = (rays.len(), rays.len() - rays.n_in_flight());
        match n_lost {
            0 => Ok(rays),
            _ => Err(DiffractionError::LostRays { wavelength_nm: lens.wavelength_nm(), n_lost, n_rays }),
        }
    }

    fn centroid_mm(&self, rays: &RayBatch) -> DVec2 {
        self.energy.iter().enumerate().map(|(i, e)| *e * rays.point_mm(i).truncate()).sum()
    }

    /// Returns the area of each cell in (dx, dy).
    fn direction_areas(&self, waves: &Waves, wavelength_nm: f64) -> Result<Vec<f64>, DiffractionError> {
        let n = self.n_nodes();
        let slope = |plus: usize, node: usize| {
            (waves.d[plus * n + node] - waves.d[(plus + 1) * n + node]) / (2.0 * self.step_mm)
        };
        let jacobians: Vec<f64> = (0..n).map(|node| slope(1, node).perp_dot(slope(3, node))).collect();
        let is_folded = !jacobians.iter().all(|j| j * jacobians[0] > 0.0);
        if is_folded {
            return Err(DiffractionError::Folded { wavelength_nm });
        }
        Ok(jacobians.iter().zip(&self.areas_mm2).map(|(j, area)| j.abs() * area).collect())
    }
}

/// Returns the solid angle (for a far point: the cross-section of the beam) per area of a plane across the axis.
pub(crate) fn solid_angle_per_area(point: &ObjectPoint, target_mm: DVec3) -> f64 {
    match *point {
        ObjectPoint::Finite(from) => {
            let way = target_mm - from;
            (way.z / way.length().powi(3)).abs()
        }
        ObjectPoint::Infinite(direction) => direction.z,
    }
}

/// Directions of waves, and optical paths along them to the reference point.
pub(super) struct Waves {
    pub(super) d: Vec<DVec2>,
    pub(super) phi_mm: Vec<f64>,
}

/// Each ray as a plane wave.
pub(super) fn along_rays(rays: &RayBatch, reference_mm: DVec2, index: f64) -> Waves {
    let d: Vec<DVec2> = (0..rays.len()).map(|i| rays.direction(i).truncate()).collect();
    let phi_mm = d.iter().enumerate().map(|(i, d)| {
        let q = rays.point_mm(i).truncate() - reference_mm;
        rays.opl_mm[i] - index * q.dot(*d)
    });
    Waves { phi_mm: phi_mm.collect(), d }
}

/// Each ray as a spherical wave from where it crosses the exit pupil.
fn from_exit_pupil(rays: &RayBatch, reference_mm: DVec2, lens: &MonoLens) -> Waves {
    let pupil_z_mm = lens.last_vertex_z_mm() + lens.first_order().exit_pupil_z_mm;
    let wave = |i: usize| {
        let (film_mm, direction) = (rays.point_mm(i), rays.direction(i));
        let back_mm = (film_mm.z - pupil_z_mm) / direction.z;
        let way = reference_mm.extend(film_mm.z) - (film_mm - direction * back_mm);
        // A pupil behind the film is a virtual one: the wave runs backwards to it.
        let length_mm = way.length() * back_mm.signum();
        (way.truncate() / length_mm, rays.opl_mm[i] + lens.image_index() * (length_mm - back_mm))
    };
    let (d, phi_mm) = (0..rays.len()).map(wave).unzip();
    Waves { d, phi_mm }
}
