//! Optical transfer functions: the autocorrelation of the pupil, free of pixels and windows.
//!
//! The pupil is laid out on a rectangular lattice of the directions that waves arrive from: rays are sent where a polynomial says that
//! such waves come from, and their paths carried over to the lattice by what a path changes with the direction, dΦ = −n q·dd
//! (`docs/wave.md`). The transfer function at the frequency f is then ∫ P(d + λf/n) P*(d) dd over ∫ |P|² dd (Goodman, Introduction to
//! Fourier Optics, 6.3). Everything that is measured of a point spread function follows from it: the modulation, the light within a
//! circle, the spread of a line.

use std::f64::consts::{PI, TAU};

use dioptric_fft::{Complex, Planner};
use dioptric_optics::{
    MonoLens, ObjectPoint, Vignetting,
    analysis::{PupilLight, PupilRule},
};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    PupilGrid,
    cells::{CellWaves, PupilCells, solid_angle_on_plane},
    propagation::{FilmRays, Waves},
};
use crate::{DiffractionError, airy::bessel_j, zernike::fit};

/// How a transfer function was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransferMethod {
    /// From the pupil with its aberrations: the diffraction integral.
    Waves,
    /// As that of the rays times that of the pupil without aberrations: where the blur is hundreds of wavelengths wide.
    Rays,
}

/// The optical transfer function of a point at one wavelength, about the centroid of its light.
#[derive(Clone, Debug)]
pub struct TransferFunction {
    /// Values at the frequencies of a rectangular lattice, rows along y, columns along x; 0 in the middle.
    values: Array2<Complex<f32>>,
    /// Distances of neighboring frequencies along x and y, cycles per mm.
    step_per_mm: DVec2,
    /// The centroid of the light, mm along the film's own x and y.
    centroid_mm: DVec2,
    method: TransferMethod,
    /// Places about the centroid and shares of the light of the rays whose own transfer function is the other factor; none of waves.
    rays: Vec<(DVec2, f64)>,
}

/// How finely a transfer function is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransferQuality {
    /// Modulations to 1e-4 from a fiftieth of the cut-off on.
    Fine,
    /// To a part in a thousand, in a tenth of the time: for curves.
    Quick,
}

impl TransferQuality {
    /// The least samples across the pupil.
    fn least_samples(self) -> usize {
        match self {
            Self::Fine => 512,
            Self::Quick => 192,
        }
    }
}

/// The most samples across the pupil: a transform of 2048².
const MOST_SAMPLES: usize = 1024;
/// Samples across the pupil for each wavelength over numerical aperture that the farthest ray lies off the centroid: four a
/// turn of the phase.
const SAMPLES_A_TURN: f64 = 8.0;
/// How far the lattice reaches beyond the outermost node, over the pupil's radius.
const MARGIN: f64 = 1.05;
/// Degree of the polynomial that says where light of a direction passes the pupil.
const DEGREE: usize = 7;
const N_MONOMIALS: usize = (DEGREE + 1) * (DEGREE + 2) / 2;
/// Rings of the rays that stand for the light where waves are too many.
const RINGS: usize = 64;
/// Azimuths over which a transfer function is averaged for the light in circles, and steps of the frequency.
const AZIMUTHS: usize = 48;
const FREQUENCIES: usize = 600;

/// Returns the least size of a lattice that is not below this and transforms fast.
fn good_size(least: usize) -> usize {
    [192, 256, 384, 512, 768, MOST_SAMPLES].into_iter().find(|size| *size >= least).unwrap_or(MOST_SAMPLES)
}

/// The pupil of a point on a lattice of directions.
struct Pupil {
    /// Amplitudes with their phases, rows along dy, columns along dx.
    waves: Array2<Complex<f32>>,
    /// The amplitudes alone.
    amplitudes: Array2<Complex<f32>>,
    /// The energy, Σ amplitude² × coverage.
    energy: f64,
    /// Distances of neighboring directions along x and y.
    step: DVec2,
}

impl TransferFunction {
    /// Finds the transfer function of a point on the film, `film_distance_mm` behind the last vertex, and that of the same pupil without
    /// aberrations: the diffraction limit.
    ///
    /// # Errors
    /// When no light gets through, rays within the pupil are lost, or the waves fold over one another.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        quality: TransferQuality,
    ) -> Result<(Self, Self), DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let cells =
            PupilCells::find(lens, point, PupilGrid::STANDARD).ok_or(DiffractionError::NoLight { wavelength_nm })?;
        let CellWaves { rays, centroid_mm, waves, .. } = cells.waves(lens, point, film_distance_mm)?;
        let n = cells.n_nodes();
        let mean: DVec2 = cells.energy.iter().zip(&waves.d).map(|(e, d)| *e * *d).sum();
        let radius = waves.d.iter().map(|d| d.distance(mean)).fold(0.0, f64::max);
        // As wide as the pupil along each axis: the edges of a slit take cells as narrow as it is.
        let half = MARGIN * waves.d.iter().map(|d| (*d - mean).abs()).fold(DVec2::ZERO, DVec2::max);
        let spot_mm = (0..n).map(|i| rays.place_mm(i).distance(centroid_mm)).fold(0.0, f64::max);
        let turns = lens.image_index() * radius * spot_mm / (wavelength_nm * 1e-6);
        let needed = (SAMPLES_A_TURN * turns).ceil() as usize;
        let is_of_waves = needed <= MOST_SAMPLES;
        let least = quality.least_samples();
        let n_samples = if is_of_waves { good_size(needed.max(least)) } else { least };
        let layout = Layout { lens, point, film_distance_mm, centroid_mm, mean, half, n: n_samples };
        let pupil = layout.pupil(&cells, &waves)?;
        let limit = Self::of(&pupil.amplitudes, &pupil, lens, centroid_mm);
        let transfer = match is_of_waves {
            true => Self::of(&pupil.waves, &pupil, lens, centroid_mm),
            false => limit.times_rays(lens, point, film_distance_mm),
        };
        Ok((transfer, limit))
    }

    /// Returns the autocorrelation of a pupil, by transforms of twice its size.
    fn of(waves: &Array2<Complex<f32>>, pupil: &Pupil, lens: &MonoLens, centroid_mm: DVec2) -> Self {
        let n = waves.nrows();
        let m = 2 * n;
        let mut field = vec![Complex::new(0.0, 0.0); m * m];
        for (row, from) in field.chunks_exact_mut(m).zip(waves.rows()) {
            row[..n].copy_from_slice(from.as_slice().expect("rows of a matrix in its own order"));
        }
        transform(&mut field, m, n, true);
        field.iter_mut().for_each(|value| *value = Complex::new(value.norm_sqr(), 0.0));
        transform(&mut field, m, m, false);
        let scale = 1.0 / (pupil.energy * (m * m) as f64);
        // Shifts below 0 stand at the end.
        let at = |i: usize| (i + m - n + 1) % m;
        let values =
            Array2::from_shape_fn((m - 1, m - 1), |(row, column)| field[at(row) * m + at(column)] * scale as f32);
        let step_per_mm = pupil.step * lens.image_index() / (lens.wavelength_nm() * 1e-6);
        let mut found = Self { values, step_per_mm, centroid_mm, method: TransferMethod::Waves, rays: vec![] };
        // At rest all light counts; cells that the edge cuts count by halves in neighbors alone.
        found.values[(n - 1, n - 1)] = Complex::new(1.0, 0.0);
        found
    }

    /// Returns the product with the transfer function of a point's rays, which turns too fast for a lattice.
    fn times_rays(&self, lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64) -> Self {
        let Some(light) = PupilLight::to_film(lens, point, film_distance_mm, PupilRule::of_rings(RINGS)) else {
            return self.clone();
        };
        let total: f64 = light.weights().iter().sum();
        let rays = light.rays();
        let rays: Vec<(DVec2, f64)> = (lens.landed(rays, film_distance_mm))
            .zip(light.weights())
            .map(|(place, weight)| (place.mm - self.centroid_mm, weight / total))
            .collect();
        Self { rays, method: TransferMethod::Rays, ..self.clone() }
    }

    fn middle(&self) -> f64 {
        (self.values.nrows() / 2) as f64
    }

    /// How it was found.
    pub fn method(&self) -> TransferMethod {
        self.method
    }

    /// The centroid of the light, mm along the film's own x and y.
    pub fn centroid_mm(&self) -> DVec2 {
        self.centroid_mm
    }

    /// The highest frequency at which anything is left, cycles per mm, in any direction.
    pub fn cutoff_per_mm(&self) -> f64 {
        self.step_per_mm.max_element() * self.middle()
    }

    /// Returns the value at a frequency, cycles per mm along the film's own x and y, as real and imaginary part: between those of the
    /// lattice by cubics.
    pub fn at(&self, per_mm: DVec2) -> DVec2 {
        let place = per_mm / self.step_per_mm + self.middle();
        let (below, t) = (place.floor(), place - place.floor());
        let last = self.values.nrows() as i64 - 1;
        let value = |row: i64, column: i64| match (0..=last).contains(&row) && (0..=last).contains(&column) {
            true => {
                let value = self.values[(row as usize, column as usize)];
                DVec2::new(f64::from(value.re), f64::from(value.im))
            }
            false => DVec2::ZERO,
        };
        let (row, column) = (below.y as i64, below.x as i64);
        let along_x = |row: i64| cubic([-1, 0, 1, 2].map(|i| value(row, column + i)), t.x);
        let of_waves = cubic([-1, 0, 1, 2].map(|i| along_x(row + i)), t.y);
        if self.rays.is_empty() {
            return of_waves;
        }
        let of_rays: DVec2 = self.rays.iter().map(|(q, w)| DVec2::from_angle(-TAU * per_mm.dot(*q)) * *w).sum();
        of_waves.rotate(of_rays)
    }

    /// Returns what is left of a wave along a direction from +x.
    pub fn modulation(&self, direction_rad: f64, cycles_per_mm: f64) -> f64 {
        self.at(DVec2::from_angle(direction_rad) * cycles_per_mm).length()
    }

    /// Returns it along spokes from the middle: evenly over half a turn, and along two directions from +x.
    pub fn spokes(&self, directions_rad: [f64; 2]) -> TransferSpokes {
        let step_per_mm = self.cutoff_per_mm() / FREQUENCIES as f64;
        let value = |(spoke, i)| {
            let along = DVec2::from_angle(spoke_rad(directions_rad, spoke));
            let value = self.at(along * (step_per_mm * i as f64));
            Complex::new(value.x as f32, value.y as f32)
        };
        let values = Array2::from_shape_fn((AZIMUTHS + 2, FREQUENCIES + 1), value);
        TransferSpokes { values, directions_rad, step_per_mm, centroid_mm: self.centroid_mm, method: self.method }
    }
}

/// A transfer function along spokes from the middle, about the centroid of its light: of one wavelength, or of several together.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferSpokes {
    /// Values at equal steps of the frequency from 0, a row each spoke: those over half a turn, then those along the two directions.
    values: Array2<Complex<f32>>,
    directions_rad: [f64; 2],
    step_per_mm: f64,
    centroid_mm: DVec2,
    method: TransferMethod,
}

/// Returns the direction of a spoke.
fn spoke_rad(directions_rad: [f64; 2], spoke: usize) -> f64 {
    if spoke < AZIMUTHS { PI * spoke as f64 / AZIMUTHS as f64 } else { directions_rad[spoke - AZIMUTHS] }
}

impl TransferSpokes {
    /// Returns that of the light of several wavelengths of a point, each with its share; all are along the same directions.
    pub fn sum(parts: &[(&Self, f64)]) -> Option<Self> {
        let (first, _) = parts.first()?;
        let total: f64 = parts.iter().map(|(_, share)| share).sum();
        let centroid_mm = parts.iter().map(|(part, share)| part.centroid_mm * (share / total)).sum();
        let step_per_mm = parts.iter().map(|(part, _)| part.step_per_mm).fold(0.0, f64::max);
        let value = |(spoke, i)| {
            let f = DVec2::from_angle(spoke_rad(first.directions_rad, spoke)) * (step_per_mm * i as f64);
            let of = |(part, share): &(&Self, f64)| {
                let aside = DVec2::from_angle(-TAU * f.dot(part.centroid_mm - centroid_mm));
                aside.rotate(part.along(spoke, f.length())) * (share / total)
            };
            let sum: DVec2 = parts.iter().map(of).sum();
            Complex::new(sum.x as f32, sum.y as f32)
        };
        let is_of_waves = parts.iter().all(|(part, _)| part.method == TransferMethod::Waves);
        Some(Self {
            values: Array2::from_shape_fn(first.values.dim(), value),
            directions_rad: first.directions_rad,
            step_per_mm,
            centroid_mm,
            method: if is_of_waves { TransferMethod::Waves } else { TransferMethod::Rays },
        })
    }

    /// Returns the value along a spoke, between its samples by cubics.
    fn along(&self, spoke: usize, cycles_per_mm: f64) -> DVec2 {
        let row = self.values.row(spoke);
        let place = cycles_per_mm / self.step_per_mm;
        let value = |i: i64| match usize::try_from(i.abs()).ok().and_then(|at| row.get(at)) {
            // Opposite frequencies are conjugate.
            Some(value) => {
                DVec2::new(f64::from(value.re), if i < 0 { -f64::from(value.im) } else { f64::from(value.im) })
            }
            None => DVec2::ZERO,
        };
        let below = place.floor() as i64;
        cubic([-1, 0, 1, 2].map(|i| value(below + i)), place - place.floor())
    }

    /// How it was found: by rays where any of its wavelengths is.
    pub fn method(&self) -> TransferMethod {
        self.method
    }

    /// Returns what is left of a wave along each of the two directions.
    pub fn modulations(&self, cycles_per_mm: f64) -> [f64; 2] {
        [AZIMUTHS, AZIMUTHS + 1].map(|spoke| self.along(spoke, cycles_per_mm).length())
    }

    /// Returns the light within circles about the centroid.
    pub fn encircled(&self) -> Encircled {
        // Opposite frequencies are conjugate: half a turn serves.
        let mean = |i: usize| (0..AZIMUTHS).map(|k| f64::from(self.values[(k, i)].re)).sum::<f64>() / AZIMUTHS as f64;
        Encircled { means: (0..=FREQUENCIES).map(mean).collect(), step_per_mm: self.step_per_mm }
    }

    /// Returns the spread of lines across x and across y.
    pub fn line_spreads(&self) -> [LineSpread; 2] {
        [0, AZIMUTHS / 2].map(|spoke| {
            let values = self.values.row(spoke).iter().map(|v| DVec2::new(f64::from(v.re), f64::from(v.im))).collect();
            LineSpread { values, step_per_mm: self.step_per_mm }
        })
    }
}

/// The light within circles.
#[derive(Clone, Debug)]
pub struct Encircled {
    /// Means of the transfer function over all directions, at equal steps of the frequency from 0.
    means: Vec<f64>,
    step_per_mm: f64,
}

impl Encircled {
    /// Returns the share within a circle of this radius, mm: 2πR ∫ J₁(2πRf) T(f) df.
    pub fn share(&self, radius_mm: f64) -> f64 {
        let term = |(i, mean): (usize, &f64)| {
            let f = self.step_per_mm * i as f64;
            simpson(i, self.means.len()) * bessel_j(1, TAU * radius_mm * f) * mean
        };
        TAU * radius_mm * self.step_per_mm * self.means.iter().enumerate().map(term).sum::<f64>()
    }

    /// Returns the radius that holds a share of all light, mm; NaN where none does that the samples resolve.
    pub fn radius_mm(&self, share: f64) -> f64 {
        // Up to where the waves of neighboring samples of the frequency part.
        let last_mm = 0.2 / self.step_per_mm;
        let mut below_mm = 0.0;
        let step_mm = 0.25 / (self.step_per_mm * self.means.len() as f64);
        let mut above_mm = step_mm;
        while self.share(above_mm) < share {
            (below_mm, above_mm) = (above_mm, above_mm * 1.25 + step_mm);
            if above_mm > last_mm {
                return f64::NAN;
            }
        }
        for _ in 0..40 {
            let middle_mm = 0.5 * (below_mm + above_mm);
            *(if self.share(middle_mm) < share { &mut below_mm } else { &mut above_mm }) = middle_mm;
        }
        0.5 * (below_mm + above_mm)
    }
}

/// The spread of a line.
#[derive(Clone, Debug)]
pub struct LineSpread {
    values: Vec<DVec2>,
    step_per_mm: f64,
}

impl LineSpread {
    /// Returns the light per mm at this distance from the centroid, mm; of all the sum is 1.
    pub fn per_mm(&self, at_mm: f64) -> f64 {
        let term = |(i, value): (usize, &DVec2)| {
            let wave = DVec2::from_angle(TAU * self.step_per_mm * i as f64 * at_mm);
            simpson(i, self.values.len()) * (value.x * wave.x - value.y * wave.y)
        };
        2.0 * self.step_per_mm * self.values.iter().enumerate().map(term).sum::<f64>()
    }

    /// Returns the full width at half of the highest place, mm.
    pub fn full_width_at_half_maximum_mm(&self) -> f64 {
        let pitch_mm = 0.1 / (self.step_per_mm * self.values.len() as f64);
        let half = (0.2 / (self.step_per_mm * pitch_mm)) as i64;
        let samples: Vec<f64> = (-half..=half).into_par_iter().map(|i| self.per_mm(pitch_mm * i as f64)).collect();
        let highest = (0..samples.len()).max_by(|&a, &b| samples[a].total_cmp(&samples[b])).unwrap_or(0);
        let half = 0.5 * samples[highest];
        // Where the profile first falls below half on the way out, on a straight line between samples.
        let falls = |places: &mut dyn Iterator<Item = usize>| {
            let mut before = highest;
            for i in places {
                if samples[i] < half {
                    let part = (samples[before] - half) / (samples[before] - samples[i]);
                    return Some((before as f64 - highest as f64).abs() + part);
                }
                before = i;
            }
            None
        };
        let (left, right) = (falls(&mut (0..highest).rev()), falls(&mut (highest + 1..samples.len())));
        left.zip(right).map_or(f64::NAN, |(left, right)| (left + right) * pitch_mm)
    }
}

/// Returns the weight of a place of Simpson's rule, of an odd number of them.
fn simpson(i: usize, n: usize) -> f64 {
    match i {
        _ if i == 0 || i + 1 == n => 1.0 / 3.0,
        _ if i % 2 == 1 => 4.0 / 3.0,
        _ => 2.0 / 3.0,
    }
}

/// Returns the value between the middle two of four by Catmull and Rom's cubic.
fn cubic([p0, p1, p2, p3]: [DVec2; 4], t: f64) -> DVec2 {
    p1 + 0.5 * t * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0)))
}

/// Transforms a square of m² samples in place; forth, only the first `n_rows` rows hold anything.
fn transform(field: &mut [Complex<f32>], m: usize, n_rows: usize, is_forward: bool) {
    let mut planner = Planner::new();
    let plan = if is_forward { planner.forward(m) } else { planner.inverse(m) };
    field[..n_rows * m].par_chunks_exact_mut(m).for_each(|row| plan.process(row));
    transpose(field, m);
    field.par_chunks_exact_mut(m).for_each(|row| plan.process(row));
    transpose(field, m);
}

fn transpose(field: &mut [Complex<f32>], m: usize) {
    // In squares, whose lines stay in the cache.
    const SIDE: usize = 16;
    for first_row in (0..m).step_by(SIDE) {
        for first_column in (first_row..m).step_by(SIDE) {
            for row in first_row..(first_row + SIDE).min(m) {
                for column in first_column.max(row + 1)..(first_column + SIDE).min(m) {
                    field.swap(row * m + column, column * m + row);
                }
            }
        }
    }
}

/// Where a pupil is laid out, and of what.
struct Layout<'a> {
    lens: &'a MonoLens,
    point: &'a ObjectPoint,
    film_distance_mm: f64,
    centroid_mm: DVec2,
    mean: DVec2,
    /// Half the sides of the rectangle of directions.
    half: DVec2,
    /// Samples along each of its sides.
    n: usize,
}

/// A lens without obscurations and whether its pupil counts or is taken away, with its clearances.
struct Part {
    sign: f64,
    clearances_mm: Array2<f64>,
}

impl Layout<'_> {
    /// Traces the pupil.
    fn pupil(&self, cells: &PupilCells, waves: &Waves) -> Result<Pupil, DiffractionError> {
        let n = self.n;
        let step = 2.0 * self.half / n as f64;
        let targets_mm = self.targets_mm(cells, waves);

        // Trace a ray through each place, whatever rims say, and carry its path over to the lattice.
        let per_mm = 1.0 / (self.lens.wavelength_nm() * 1e-6);
        let traced: Vec<Vec<(f64, bool)>> = (0..n)
            .into_par_iter()
            .map(|row| {
                let targets = targets_mm.row(row).to_vec();
                let mut rays = cells.plane.rays(self.lens, self.point, &targets);
                self.lens.trace(&mut rays, Vignetting::Off);
                self.lens.to_film(&mut rays, self.film_distance_mm);
                let is_there: Vec<bool> = rays.fate.iter().map(|fate| fate.is_in_flight()).collect();
                let on_film = FilmRays::new(&rays, self.lens, self.film_distance_mm);
                let found = waves.propagation.waves_of(&on_film, self.centroid_mm);
                let turns = |column: usize| {
                    let q = on_film.place_mm(column) - self.centroid_mm;
                    let beside = self.direction(row, column) - found.d[column];
                    (found.phi_mm[column] - self.lens.image_index() * q.dot(beside)) * per_mm
                };
                (0..n).map(|column| (turns(column), is_there[column])).collect()
            })
            .collect();

        // How far inside the rims each place is, of every part that obscurations make.
        let mut parts: Vec<Part> = Vec::new();
        self.lens.for_each_clear_part(&mut |part, sign| {
            let rows: Vec<Vec<f64>> = (0..n)
                .into_par_iter()
                .map(|row| {
                    let targets = targets_mm.row(row).to_vec();
                    part.clearances_mm(cells.plane.rays(part, self.point, &targets))
                })
                .collect();
            let clearances_mm = Array2::from_shape_fn((n, n), |(row, column)| rows[row][column]);
            let is_any_clear = clearances_mm.iter().any(|clearance| *clearance > 0.0);
            parts.push(Part { sign, clearances_mm });
            is_any_clear
        });

        // Amplitudes are those of the energy a range of directions; cells that an edge cuts count by their share.
        let piston = traced[n / 2][n / 2].0;
        let mut pupil = Pupil {
            waves: Array2::from_elem((n, n), Complex::new(0.0, 0.0)),
            amplitudes: Array2::from_elem((n, n), Complex::new(0.0, 0.0)),
            energy: 0.0,
            step,
        };
        for ((row, column), wave) in pupil.waves.indexed_iter_mut() {
            let coverage: f64 = parts.iter().map(|part| part.sign * coverage(&part.clearances_mm, row, column)).sum();
            let (turns, is_there) = traced[row][column];
            if coverage <= 0.0 || !is_there || !turns.is_finite() {
                continue;
            }
            let target = targets_mm[(row, column)];
            let density =
                solid_angle_on_plane(self.point, &cells.plane, target) * stretch(&targets_mm, row, column, step);
            let amplitude = density.sqrt();
            let (re, im) = DVec2::from_angle(TAU * (turns - piston)).into();
            let weighed = amplitude * coverage.min(1.0);
            *wave = Complex::new((weighed * re) as f32, (weighed * im) as f32);
            pupil.amplitudes[(row, column)] = Complex::new(weighed as f32, 0.0);
            pupil.energy += density * coverage.min(1.0);
        }
        match pupil.energy > 0.0 {
            true => Ok(pupil),
            false => Err(DiffractionError::NoLight { wavelength_nm: self.lens.wavelength_nm() }),
        }
    }

    /// The direction of a cell of the lattice.
    fn direction(&self, row: usize, column: usize) -> DVec2 {
        let at = |i: usize| (2 * i + 1) as f64 / self.n as f64 - 1.0;
        self.mean + self.half * DVec2::new(at(column), at(row))
    }

    /// Returns where light of each direction of the lattice passes the pupil's plane, by polynomials through the nodes, mm.
    fn targets_mm(&self, cells: &PupilCells, waves: &Waves) -> Array2<DVec2> {
        let n_nodes = cells.n_nodes();
        let places: Vec<DVec2> = waves.d[..n_nodes].iter().map(|d| (*d - self.mean) / self.half).collect();
        let weights: Vec<f64> = cells.energy.iter().map(|energy| energy.abs()).collect();
        let of = |axis: fn(&DVec2) -> f64| {
            let values: Vec<f64> = cells.targets_mm.iter().map(axis).collect();
            fit(monomial, &places, &values, &weights, N_MONOMIALS)
        };
        let (x, y) = (of(|target| target.x), of(|target| target.y));
        Array2::from_shape_fn((self.n, self.n), |(row, column)| {
            let u = (self.direction(row, column) - self.mean) / self.half;
            DVec2::new(polynomial(&x, u), polynomial(&y, u))
        })
    }
}

/// Returns the powers of x and y of the `j`-th monomial, from 1: by their sum, and within it by that of y.
fn powers(j: usize) -> (i32, i32) {
    let mut degree = 0;
    while (degree + 1) * (degree + 2) / 2 < j {
        degree += 1;
    }
    let of_y = j - 1 - degree * (degree + 1) / 2;
    ((degree - of_y) as i32, of_y as i32)
}

fn monomial(j: usize, at: DVec2) -> f64 {
    let (of_x, of_y) = powers(j);
    at.x.powi(of_x) * at.y.powi(of_y)
}

/// Returns the value of a polynomial with these coefficients of its monomials.
fn polynomial(coefficients: &[f64], at: DVec2) -> f64 {
    let (mut sum, mut j) = (0.0, 0);
    let mut x_powers = [1.0; DEGREE + 1];
    let mut y_powers = [1.0; DEGREE + 1];
    for k in 1..=DEGREE {
        (x_powers[k], y_powers[k]) = (x_powers[k - 1] * at.x, y_powers[k - 1] * at.y);
    }
    for degree in 0..=DEGREE {
        for of_y in 0..=degree {
            sum += coefficients[j] * x_powers[degree - of_y] * y_powers[of_y];
            j += 1;
        }
    }
    sum
}

/// Returns the share of a cell that lies inside the edge, from how far inside it and its neighbors are.
fn coverage(clearances_mm: &Array2<f64>, row: usize, column: usize) -> f64 {
    let here = clearances_mm[(row, column)];
    if !here.is_finite() {
        return 0.0;
    }
    let last = clearances_mm.nrows() - 1;
    let slope = |before: (usize, usize), after: (usize, usize)| {
        let (a, b) = (clearances_mm[before], clearances_mm[after]);
        let steps = (after.0 - before.0 + after.1 - before.1) as f64;
        if a.is_finite() && b.is_finite() { (b - a) / steps } else { 0.0 }
    };
    let along_x = slope((row, column.saturating_sub(1)), (row, (column + 1).min(last)));
    let along_y = slope((row.saturating_sub(1), column), ((row + 1).min(last), column));
    let gradient = along_x.hypot(along_y);
    if gradient == 0.0 {
        return f64::from(u8::from(here > 0.0));
    }
    (0.5 + here / gradient).clamp(0.0, 1.0)
}

/// Returns the area of the pupil's plane for an area of directions at a cell, mm².
fn stretch(targets_mm: &Array2<DVec2>, row: usize, column: usize, step: DVec2) -> f64 {
    let last = targets_mm.nrows() - 1;
    let (left, right) = (column.saturating_sub(1), (column + 1).min(last));
    let (below, above) = (row.saturating_sub(1), (row + 1).min(last));
    let along_x = (targets_mm[(row, right)] - targets_mm[(row, left)]) / ((right - left) as f64 * step.x);
    let along_y = (targets_mm[(above, column)] - targets_mm[(below, column)]) / ((above - below) as f64 * step.y);
    along_x.perp_dot(along_y).abs()
}
