//! The light of a point over its pupil as smooth functions, which can be interpolated between points.
//!
//! The derivation is in `docs/wave.md`, which comments name by its equations.

use std::{cell::RefCell, f64::consts::TAU};

use dioptric_optics::{MonoLens, ObjectPoint, Vignetting, quadrature::gauss_legendre_on};
use glam::DVec2;
use multiversion::multiversion;

use super::{
    LARGEST_BANDWIDTH, PupilGrid, PupilSamples, WavePsf, WaveWindow, WindowCenter,
    cells::solid_angle_per_area,
    propagation::{FilmRays, Waves, has_few_zones},
    smooth::{Azimuth, Parity, Places, Ray, horner, radial_slope},
};
use crate::DiffractionError;

/// The edge of a pupil that is symmetric about its x axis, in the entrance-pupil plane.
#[derive(Clone, Copy, Debug)]
pub struct PupilOutline<'a> {
    /// What the distances count from, mm from the axis along x.
    pub center_x_mm: f64,
    /// z of the plane from the first vertex, mm.
    pub z_mm: f64,
    /// Distances at the azimuths `2π i / n`, mm; n is a multiple of 4.
    pub rho_mm: &'a [f64],
}

/// The light of one object point at one wavelength on the film, as smooth functions over its pupil: polynomials of
/// degree 12 for the directions behind the lens, the angular eikonal Φ and the brightness, and the pupil's edge.
///
/// Maps of neighboring fields, depths and wavelengths can be added with weights ([`mix`](Self::mix)), and nodes for
/// the wave sum be taken from them in any number ([`nodes`](Self::nodes)). The field lies along +x of the film's frame;
/// the pupil is then symmetric about x. Coordinates over the pupil count from its middle in units of twice its rms
/// width and height, so that pupils of different vignetting correspond.
#[derive(Clone, Debug, PartialEq)]
pub struct PupilFunctionFit {
    scalars: Scalars,
    /// The coefficients of dx, dy, Φ (mm) and ln brightness, one function after the other: see [`span`].
    coefficients: Vec<f64>,
    /// The distance of the outline from the middle, mm, at even azimuths from 0 to π.
    outline_mm: Vec<f64>,
}

/// What a fit has beside functions.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scalars {
    image_index: f64,
    /// What the whole pupil takes in, as [`PupilSamples::collected`].
    collected: f64,
    /// The centroid of the light along x, mm.
    centroid_x_mm: f64,
    /// Half the width and half the height of the pupil, mm.
    half_mm: DVec2,
    /// Error of the polynomials, waves rms.
    error_waves: f64,
}

impl Scalars {
    /// Returns these with each number changed by that of others.
    fn zipped(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            image_index: of(self.image_index, other.image_index),
            collected: of(self.collected, other.collected),
            centroid_x_mm: of(self.centroid_x_mm, other.centroid_x_mm),
            half_mm: DVec2::new(of(self.half_mm.x, other.half_mm.x), of(self.half_mm.y, other.half_mm.y)),
            error_waves: of(self.error_waves, other.error_waves),
        }
    }
}

/// Radii at which functions are fitted, and every how many azimuths of the edge.
const FIT_RADII: usize = 12;
const FIT_AZIMUTHS: usize = 48;

/// The places of a function's coefficients.
fn span(function: usize) -> (Parity, std::ops::Range<usize>) {
    let (even, odd) = (Parity::Even.n_terms(), Parity::Odd.n_terms());
    let (parity, start) = match function {
        0 => (Parity::Even, 0),
        1 => (Parity::Odd, even),
        2 => (Parity::Even, even + odd),
        _ => (Parity::Even, 2 * even + odd),
    };
    (parity, start..start + parity.n_terms())
}

impl PupilFunctionFit {
    /// Traces the light of a point in a field along x to the film, `film_distance_mm` behind the last vertex, and fits it.
    ///
    /// # Errors
    /// When rays within the pupil are lost, all run in one direction, or the pupil is one of few Fresnel zones, whose
    /// waves are not those of rays.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        edge: PupilOutline<'_>,
    ) -> Result<Self, DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let folded = DiffractionError::Folded { wavelength_nm };
        if has_few_zones(lens, film_distance_mm) {
            return Err(folded);
        }
        // Trace rays through half the pupil, which the other half mirrors.
        let half_mm = edge.half_sizes_mm();
        let (targets_mm, areas, places) = edge.places(half_mm);
        let mut rays = lens.rays_towards(point, &targets_mm, edge.z_mm, 0.0);
        lens.trace(&mut rays, Vignetting::Off);
        lens.to_film(&mut rays, film_distance_mm);
        let (n_rays, n_lost) = (rays.len(), rays.len() - rays.n_in_flight());
        if n_lost > 0 {
            return Err(DiffractionError::LostRays { wavelength_nm, n_lost, n_rays });
        }
        // The energy of each place: its area times the solid angle an area is seen under.
        let brightness: Vec<f64> =
            targets_mm.iter().map(|target| solid_angle_per_area(point, target.extend(edge.z_mm))).collect();
        let taken: Vec<f64> = brightness.iter().zip(&areas).map(|(b, area)| b * area).collect();
        let half_collected: f64 = taken.iter().sum();
        // The other half of the pupil mirrors this one.
        // The waves that the rays stand for, about the centroid (eqs. 1 to 4).
        let rays = FilmRays::new(&rays, lens, film_distance_mm);
        let moment_mm = taken.iter().enumerate().map(|(i, e)| e * rays.place_mm(i).x).sum::<f64>();
        let centroid_x_mm = moment_mm / half_collected;
        let waves = Waves::of(&rays, DVec2::new(centroid_x_mm, 0.0));
        // Fit directions, eikonal and brightness with polynomials that are even or odd about x.
        let piston_mm = waves.phi_mm[0];
        let phi_mm: Vec<f64> = waves.phi_mm.iter().map(|phi| phi - piston_mm).collect();
        let d_x: Vec<f64> = waves.d.iter().map(|d| d.x).collect();
        let d_y: Vec<f64> = waves.d.iter().map(|d| d.y).collect();
        let ln_brightness: Vec<f64> = brightness.iter().map(|b| b.ln()).collect();
        let [fit_x, fit_phi, fit_b] =
            places.fit(Parity::Even, [&d_x, &phi_mm, &ln_brightness]).ok_or_else(|| folded.clone())?;
        let [fit_y] = places.fit(Parity::Odd, [&d_y]).ok_or(folded)?;
        let error_waves = rms_error(&places, &fit_phi, &phi_mm) / (wavelength_nm * 1e-6);
        let coefficients = [fit_x, fit_y, fit_phi, fit_b].concat();
        let scalars = Scalars {
            image_index: lens.image_index(),
            collected: 2.0 * half_collected,
            centroid_x_mm,
            half_mm,
            error_waves,
        };
        Ok(Self { scalars, coefficients, outline_mm: edge.rho_mm[..=edge.rho_mm.len() / 2].to_vec() })
    }

    /// Returns the sum of maps with weights of sum 1, or `None` of none; all edges must be known at the same azimuths.
    pub fn mix<'a>(weighted: impl Iterator<Item = (&'a Self, f64)>) -> Option<Self> {
        let mut sum: Option<Self> = None;
        for (map, weight) in weighted {
            match &mut sum {
                None => {
                    let scaled = |list: &[f64]| list.iter().map(|x| x * weight).collect();
                    sum = Some(Self {
                        scalars: map.scalars.zipped(map.scalars, |x, _| x * weight),
                        coefficients: scaled(&map.coefficients),
                        outline_mm: scaled(&map.outline_mm),
                    });
                }
                Some(sum) => {
                    sum.scalars = sum.scalars.zipped(map.scalars, |total, x| total + weight * x);
                    let lists = [(&mut sum.coefficients, &map.coefficients), (&mut sum.outline_mm, &map.outline_mm)];
                    for (total, x) in lists.into_iter().flat_map(|(total, x)| total.iter_mut().zip(x)) {
                        *total += weight * x;
                    }
                }
            }
        }
        sum
    }

    /// How far the polynomials are from the traced eikonal, waves rms: of a mixed map, of those that it is mixed from.
    pub fn error_waves(&self) -> f64 {
        self.scalars.error_waves
    }

    /// Returns the distance of the edge from the middle at an azimuth, mm: exact where it was found, else a cubic.
    fn edge_mm(&self, azimuth: f64) -> f64 {
        let edge = &self.outline_mm;
        let half = edge.len() as i64 - 1;
        let place = (azimuth / TAU).rem_euclid(1.0) * (2 * half) as f64;
        let (below, t) = (place.floor() as i64, place.fract());
        let at = |i: i64| {
            let i = i.rem_euclid(2 * half);
            edge[i.min(2 * half - i) as usize]
        };
        let (p0, p1, p2, p3) = (at(below - 1), at(below), at(below + 1), at(below + 2));
        let cubic =
            p1 + 0.5 * t * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0)));
        // At a kink a cubic may overshoot; the neighbors bound it.
        cubic.clamp(0.98 * p1.min(p2), 1.02 * p1.max(p2))
    }

    /// Returns the nodes of the wave sum at a wavelength in a field along the unit vector `turn` of the film's frame,
    /// with the centroid of the light as their reference.
    ///
    /// # Errors
    /// When the rays do not fill the directions one to one.
    pub fn nodes(&self, grid: PupilGrid, wavelength_nm: f64, turn: DVec2) -> Result<PupilSamples, DiffractionError> {
        let mut room = Room { half: Lists::default(), nodes: PupilSamples::none() };
        self.fill(&mut room, grid, wavelength_nm, turn)?;
        Ok(room.nodes)
    }

    /// Computes the nodes in place of others.
    fn fill(&self, room: &mut Room, grid: PupilGrid, wavelength_nm: f64, turn: DVec2) -> Result<(), DiffractionError> {
        let half = &mut room.half;
        let half_azimuths = grid.n_azimuths / 2;
        let n_radii = grid.n_radii;
        let radii = gauss_legendre_on(n_radii, 0.0, 1.0);
        let step = TAU / grid.n_azimuths as f64;
        let Scalars { image_index: index, half_mm: DVec2 { x: half_x, y: half_y }, .. } = self.scalars;
        let mut sector = Sector::new(n_radii);
        half.clear();
        for j in 0..=half_azimuths {
            let rho_mm = self.edge_mm(step * j as f64);
            let (c, s) = super::cis::cis(j as f64 / grid.n_azimuths as f64);
            let stretched = DVec2::new(c / half_x, s / half_y);
            let stretch = stretched.length();
            let azimuth = Azimuth::new(stretched.x / stretch, stretched.y / stretch);
            for (radius, (t, _)) in sector.radii.iter_mut().zip(&radii) {
                *radius = rho_mm * stretch * t;
            }
            sector.fill(&self.rays_along(&azimuth), index);
            half.append(&sector, radii.iter().map(|(t, w)| rho_mm * rho_mm * t * w * step), half_x * half_y);
        }
        if !half.jacobian.iter().all(|j| j * half.jacobian[0] > 0.0) {
            return Err(DiffractionError::Folded { wavelength_nm });
        }
        room.nodes.wavelength_nm = wavelength_nm;
        room.nodes.grid = grid;
        self.assemble(&mut room.nodes, turn, half);
        Ok(())
    }

    /// The functions along an azimuth.
    fn rays_along(&self, azimuth: &Azimuth) -> Rays {
        let of = |function: usize| {
            let (parity, span) = span(function);
            (azimuth.value(parity, &self.coefficients[span.clone()]), azimuth.slope(parity, &self.coefficients[span]))
        };
        let ((d_x, around_x), (d_y, around_y), (phi, around_phi)) = (of(0), of(1), of(2));
        let (brightness, _) = of(3);
        let along = [radial_slope(&d_x), radial_slope(&d_y), radial_slope(&phi)];
        Rays { values: [d_x, d_y, phi, brightness], along, around: [around_x, around_y, around_phi] }
    }

    /// Mirrors the half pupil, turns it to its field and counts from the centroid.
    fn assemble(&self, nodes: &mut PupilSamples, turn: DVec2, half: &Lists) {
        let PupilSamples { wavelength_nm, grid, .. } = *nodes;
        let (n_radii, n_azimuths) = (grid.n_radii, grid.n_azimuths);
        // Each azimuth as its own in the half, and whether it is mirrored.
        let azimuths = || {
            let place = |j: usize| if 2 * j > n_azimuths { (n_azimuths - j, -1.0) } else { (j, 1.0) };
            (0..n_azimuths).map(place).map(|(j, sign)| (j * n_radii..(j + 1) * n_radii, sign))
        };
        let Scalars { image_index: index, collected, centroid_x_mm, .. } = self.scalars;
        // The energy of both halves and its centroid, from which places count.
        let (mut total, mut along_x) = (0.0, 0.0);
        for (span, _) in azimuths() {
            for (e, q_x) in half.energy[span.clone()].iter().zip(&half.q_x[span]) {
                total += e;
                along_x += e * q_x;
            }
        }
        let along_x = along_x / total;
        let per_mm = index / (wavelength_nm * 1e-6);
        nodes.reference_mm = turn * (centroid_x_mm + along_x);
        (nodes.image_index, nodes.collected) = (index, collected);
        for list in [
            &mut nodes.q_x_mm,
            &mut nodes.q_y_mm,
            &mut nodes.d_x,
            &mut nodes.d_y,
            &mut nodes.phi_mm,
            &mut nodes.energy,
            &mut nodes.amplitude_per_mm,
        ] {
            list.resize(grid.n_nodes(), 0.0);
        }
        // Mirror and turn each azimuth; amplitudes from energies and Jacobians (eq. 5).
        for ((span, sign), to) in azimuths().zip((0..).step_by(n_radii)) {
            let to = to..to + n_radii;
            let rotate = |x: &mut [f64], y: &mut [f64], from_x: &[f64], from_y: &[f64], along_x: f64| {
                for ((x, y), (from_x, from_y)) in x.iter_mut().zip(y).zip(from_x.iter().zip(from_y)) {
                    let (from_x, from_y) = (from_x - along_x, sign * from_y);
                    *x = turn.x * from_x - turn.y * from_y;
                    *y = turn.y * from_x + turn.x * from_y;
                }
            };
            let (q_x, q_y) = (&half.q_x[span.clone()], &half.q_y[span.clone()]);
            rotate(&mut nodes.q_x_mm[to.clone()], &mut nodes.q_y_mm[to.clone()], q_x, q_y, along_x);
            let (d_x, d_y) = (&half.d_x[span.clone()], &half.d_y[span.clone()]);
            rotate(&mut nodes.d_x[to.clone()], &mut nodes.d_y[to.clone()], d_x, d_y, 0.0);
            for (phi, (from, d_x)) in nodes.phi_mm[to.clone()].iter_mut().zip(half.phi_mm[span.clone()].iter().zip(d_x))
            {
                *phi = from + index * along_x * d_x;
            }
            let (energy, jacobian) = (&half.energy[span.clone()], &half.jacobian[span]);
            let to = nodes.energy[to.clone()].iter_mut().zip(&mut nodes.amplitude_per_mm[to]);
            for ((share, amplitude), (energy, jacobian)) in to.zip(energy.iter().zip(jacobian)) {
                *share = energy / total;
                *amplitude = per_mm * (*share * jacobian.abs()).sqrt();
            }
        }
    }

    /// Returns the point spread function on a window, with as many nodes as it needs.
    ///
    /// # Errors
    /// When the window makes no sense, the blur and window are too large for a wave sum, or those of
    /// [`nodes`](Self::nodes).
    pub fn psf(&self, wavelength_nm: f64, turn: DVec2, window: &WaveWindow) -> Result<WavePsf, DiffractionError> {
        let extent_mm = window.check()?;
        ROOM.with_borrow_mut(|room| {
            // A few nodes tell how many are needed.
            self.fill(room, PupilGrid { n_radii: 8, n_azimuths: 32 }, wavelength_nm, turn)?;
            while let Some(grid) = room.nodes.finer_grid(extent_mm, LARGEST_BANDWIDTH)? {
                self.fill(room, grid, wavelength_nm, turn)?;
            }
            let center = WindowCenter::At(window.center.on_film_mm(|| room.nodes.reference_mm));
            room.nodes.psf(&WaveWindow { center, ..*window }, None)
        })
    }
}

thread_local! {
    /// One for each thread: asking for memory and giving it back took as long as the nodes.
    static ROOM: RefCell<Room> = RefCell::new(Room { half: Lists::default(), nodes: PupilSamples::none() });
}

/// The nodes of a sum and of half of its pupil.
struct Room {
    half: Lists,
    nodes: PupilSamples,
}

impl PupilOutline<'_> {
    fn azimuth(&self, i: usize) -> DVec2 {
        let (c, s) = super::cis::cis(i as f64 / self.rho_mm.len() as f64);
        DVec2::new(c, s)
    }

    /// Returns twice the rms width and height of the pupil, mm: its half axes, if it is an ellipse.
    fn half_sizes_mm(&self) -> DVec2 {
        let (mut area, mut first, mut second) = (0.0, 0.0, DVec2::ZERO);
        for (i, rho) in self.rho_mm.iter().enumerate() {
            let u = self.azimuth(i);
            area += rho * rho / 2.0;
            first += rho.powi(3) / 3.0 * u.x;
            second += rho.powi(4) / 4.0 * u * u;
        }
        let mean_x = first / area;
        let variance = second / area - DVec2::new(mean_x * mean_x, 0.0);
        DVec2::new(2.0 * variance.x.sqrt(), 2.0 * variance.y.sqrt())
    }

    /// Returns the points of half the pupil at which functions are fitted, with their areas.
    fn places(&self, half_mm: DVec2) -> (Vec<DVec2>, Vec<f64>, Places) {
        let n = self.rho_mm.len();
        let stride = (n / FIT_AZIMUTHS).max(1);
        let radii = gauss_legendre_on(FIT_RADII, 0.0, 1.0);
        let (mut targets_mm, mut areas, mut polar) = (vec![], vec![], vec![]);
        for i in (0..=n / 2).step_by(stride) {
            let (rho, u) = (self.rho_mm[i], self.azimuth(i));
            let stretched = u / half_mm;
            let azimuth = Azimuth::new(stretched.x / stretched.length(), stretched.y / stretched.length());
            // The azimuths on the axis belong to both halves.
            let share = if i == 0 || 2 * i == n { 0.5 } else { 1.0 };
            for (t, w) in &radii {
                let area = share * rho * rho * t * w * TAU * stride as f64 / n as f64;
                targets_mm.push(DVec2::new(self.center_x_mm, 0.0) + u * (rho * t));
                areas.push(area);
                polar.push((rho * t * stretched.length(), azimuth, area));
            }
        }
        (targets_mm, areas, Places { polar })
    }
}

/// Returns the weighted rms of what a fit leaves.
fn rms_error(places: &Places, fit: &[f64], values: &[f64]) -> f64 {
    let (mut square, mut total) = (0.0, 0.0);
    for ((radius, azimuth, weight), value) in places.polar.iter().zip(values) {
        let mut found = [0.0];
        horner(&azimuth.value(Parity::Even, fit), &[*radius], &mut found);
        square += weight * (found[0] - value).powi(2);
        total += weight;
    }
    (square / total).sqrt()
}

/// Functions along one azimuth: dx, dy, Φ and ln brightness, and the first three's derivatives outwards and around.
struct Rays {
    values: [Ray; 4],
    along: [Ray; 3],
    around: [Ray; 3],
}

/// The nodes of one azimuth.
struct Sector {
    /// In units of the pupil's half axes.
    radii: Vec<f64>,
    /// dx, dy, Φ and brightness.
    values: [Vec<f64>; 4],
    along: [Vec<f64>; 3],
    around: [Vec<f64>; 3],
    q_x: Vec<f64>,
    q_y: Vec<f64>,
    /// Of (dx, dy) by the coordinates over the pupil.
    jacobian: Vec<f64>,
}

impl Sector {
    fn new(n_radii: usize) -> Self {
        let list = || vec![0.0; n_radii];
        let three = || [(); 3].map(|()| list());
        Self {
            radii: list(),
            values: [(); 4].map(|()| list()),
            along: three(),
            around: three(),
            q_x: list(),
            q_y: list(),
            jacobian: list(),
        }
    }

    /// Computes all lists from the radii.
    fn fill(&mut self, rays: &Rays, index: f64) {
        fill_sector(self, rays, index);
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn fill_sector(sector: &mut Sector, rays: &Rays, index: f64) {
    let of = rays.values.iter().chain(&rays.along).chain(&rays.around);
    let lists = sector.values.iter_mut().chain(&mut sector.along).chain(&mut sector.around);
    for (ray, values) in of.zip(lists) {
        horner(ray, &sector.radii, values);
    }
    for value in &mut sector.values[3] {
        *value = super::cis::exp(*value);
    }
    let n = sector.radii.len();
    let [x_r, y_r, phi_r] = sector.along.each_ref().map(|list| &list[..n]);
    let [x_a, y_a, phi_a] = sector.around.each_ref().map(|list| &list[..n]);
    let (q_x, q_y, jacobian) = (&mut sector.q_x[..n], &mut sector.q_y[..n], &mut sector.jacobian[..n]);
    for i in 0..n {
        let determinant = x_r[i] * y_a[i] - x_a[i] * y_r[i];
        // dΦ = −n q·dd, outwards and around.
        let factor = -1.0 / (index * determinant);
        q_x[i] = (phi_r[i] * y_a[i] - phi_a[i] * y_r[i]) * factor;
        q_y[i] = (x_r[i] * phi_a[i] - x_a[i] * phi_r[i]) * factor;
        jacobian[i] = determinant / sector.radii[i];
    }
}

/// The nodes of half a pupil.
#[derive(Default)]
struct Lists {
    d_x: Vec<f64>,
    d_y: Vec<f64>,
    phi_mm: Vec<f64>,
    q_x: Vec<f64>,
    q_y: Vec<f64>,
    /// Up to a common factor.
    energy: Vec<f64>,
    /// Area of each node's cell in (dx, dy), with its sign.
    jacobian: Vec<f64>,
}

impl Lists {
    fn clear(&mut self) {
        for list in [
            &mut self.d_x,
            &mut self.d_y,
            &mut self.phi_mm,
            &mut self.q_x,
            &mut self.q_y,
            &mut self.energy,
            &mut self.jacobian,
        ] {
            list.clear();
        }
    }

    fn append(&mut self, sector: &Sector, areas_mm2: impl Iterator<Item = f64>, unit_mm2: f64) {
        let per_unit = 1.0 / unit_mm2;
        for (area, (brightness, jacobian)) in areas_mm2.zip(sector.values[3].iter().zip(&sector.jacobian)) {
            self.energy.push(area * brightness);
            self.jacobian.push(jacobian * area * per_unit);
        }
        self.d_x.extend(&sector.values[0]);
        self.d_y.extend(&sector.values[1]);
        self.phi_mm.extend(&sector.values[2]);
        self.q_x.extend(&sector.q_x);
        self.q_y.extend(&sector.q_y);
    }
}
