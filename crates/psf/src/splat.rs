//! Gaussians deposited on pixels.
//!
//! Each Gaussian is sampled line by line, eight samples at a time, in single precision; the exponential is a
//! polynomial, so that the compiler makes vectors of it. It is compiled for the base instruction set and for AVX2, chosen
//! at run time, without fused multiply-add and with every sum in a fixed order: all machines give the same bits.

use dioptric_diffraction::Covariance;
use glam::DVec2;
use multiversion::multiversion;

use crate::raster::Raster;

/// How many standard deviations of a Gaussian are deposited; what lies beyond, 3·10⁻⁴, is spread over the rest.
const REACH: f64 = 4.0;
/// The finest subdivision of a pixel's side. What is narrower than its samples allow is widened to 0.12 pixels, which
/// on pixels makes next to no difference.
const FINEST: usize = 5;
/// A Gaussian is sampled at this many samples a standard deviation, or more: its sum is then good to 3·10⁻⁴, and to
/// much better where Gaussians overlap.
const SAMPLES_PER_SIGMA: f64 = 0.6;
/// Samples that are computed together.
const LANES: usize = 8;

/// A Gaussian to be deposited; lengths in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaussian {
    pub(crate) at: DVec2,
    pub(crate) covariance: Covariance,
    pub(crate) energy: f64,
}

/// Deposits Gaussians, integrated over the pixels. What falls outside is lost.
pub(crate) fn deposit(raster: &mut Raster, gaussians: &[Gaussian]) {
    if gaussians.is_empty() {
        return;
    }
    let mut film = Film::new(raster.size());
    add_all(&mut film, gaussians);
    for (pixels, sums) in raster.pixels_mut().chunks_exact_mut(film.columns).zip(film.sums.chunks_exact(film.stride)) {
        for (pixel, sum) in pixels.iter_mut().zip(sums) {
            *pixel += f64::from(*sum);
        }
    }
}

/// Pixels in single precision, their rows longer than the picture's so that a group of samples may run over the edge.
struct Film {
    rows: usize,
    columns: usize,
    stride: usize,
    sums: Vec<f32>,
    /// Samples of one row of pixels.
    samples: Vec<f32>,
}

impl Film {
    fn new((rows, columns): (usize, usize)) -> Self {
        let stride = columns + LANES;
        Self { rows, columns, stride, sums: vec![0.0; rows * stride], samples: vec![0.0; columns * FINEST + 2 * LANES] }
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn add_all(film: &mut Film, gaussians: &[Gaussian]) {
    for gaussian in gaussians {
        let (narrow, _) = gaussian.covariance.axes();
        match SAMPLES_PER_SIGMA / narrow.sqrt() {
            divisions if divisions <= 1.0 => Sampled::new(gaussian, 1).add::<1>(film),
            divisions if divisions <= 2.0 => Sampled::new(gaussian, 2).add::<2>(film),
            divisions if divisions <= 3.0 => Sampled::new(gaussian, 3).add::<3>(film),
            divisions if divisions <= 4.0 => Sampled::new(gaussian, 4).add::<4>(film),
            _ => Sampled::new(gaussian, FINEST).add::<FINEST>(film),
        }
    }
}

/// A Gaussian in units of samples, as `peak · 2^(fall_y dy² + fall_x (dx − shear dy)²)`; places count from a corner of a
/// sample near its middle, so that single precision does.
struct Sampled {
    corner: (i32, i32),
    at: (f32, f32),
    peak: f32,
    fall_x: f32,
    fall_y: f32,
    shear: f32,
    sigma_y: f32,
    /// In a line.
    sigma_x: f32,
}

/// Neighbouring lines of samples through a Gaussian: their middles, the powers of 2 there, and the samples that they
/// reach.
struct Lines {
    centers: [f32; LANES],
    falls: [f32; LANES],
    firsts: [i32; LANES],
    ends: [i32; LANES],
}

/// The middles of samples, from the first's edge.
const MIDDLES: [f32; LANES] = [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5];
/// Beyond this power of 2 nothing is deposited.
const LEAST: f32 = (-0.5 * REACH * REACH * std::f64::consts::LOG2_E) as f32;
/// What is held within the reach.
const INSIDE: f64 = 1.0 - 3.354_626_279_025_118_5e-4;
/// Places further than this from the picture, in samples, are not seen.
const FAR: f64 = 1e6;

impl Sampled {
    /// Returns a Gaussian for samples, `divisions` to a pixel's side.
    #[inline(always)]
    fn new(gaussian: &Gaussian, divisions: usize) -> Self {
        // A box of one sample has the variance 1/12: sampling with that added is the box integral to fourth order.
        let scale = (divisions * divisions) as f64;
        let mut c = gaussian.covariance;
        c.xx = c.xx * scale + 1.0 / 12.0;
        c.yy = c.yy * scale + 1.0 / 12.0;
        c.xy *= scale;
        if divisions == FINEST {
            let lift = (SAMPLES_PER_SIGMA * SAMPLES_PER_SIGMA - c.axes().0).max(0.0);
            c.xx += lift;
            c.yy += lift;
        }
        let determinant = c.xx * c.yy - c.xy * c.xy;
        let at = (gaussian.at * divisions as f64).clamp(DVec2::splat(-FAR), DVec2::splat(FAR));
        let corner = at.floor();
        let per_yy = 1.0 / c.yy;
        Self {
            corner: (corner.x as i32, corner.y as i32),
            at: ((at.x - corner.x) as f32, (at.y - corner.y) as f32),
            peak: (gaussian.energy / (std::f64::consts::TAU * INSIDE * determinant.sqrt())) as f32,
            fall_x: (-0.5 * std::f64::consts::LOG2_E * c.yy / determinant) as f32,
            fall_y: (-0.5 * std::f64::consts::LOG2_E * per_yy) as f32,
            shear: (c.xy * per_yy) as f32,
            sigma_y: c.yy.sqrt() as f32,
            sigma_x: (determinant * per_yy).sqrt() as f32,
        }
    }

    /// Adds it to the pixels, a few rows at a time.
    #[inline(always)]
    fn add<const DIVISIONS: usize>(&self, film: &mut Film) {
        let divisions = DIVISIONS as i32;
        let reach = REACH as f32 * self.sigma_y;
        let first = (self.corner.1 + round(self.at.1 - reach)).max(0) / divisions;
        let end = (self.corner.1 + round(self.at.1 + reach)).min(film.rows as i32 * divisions);
        let end = (end + divisions - 1) / divisions;
        // As many rows as have their lines computed together.
        let n_rows = LANES / DIVISIONS;
        let mut row = first;
        while row < end {
            let lines = self.lines(row * divisions - self.corner.1);
            for i in 0..n_rows.min((end - row) as usize) {
                self.add_row::<DIVISIONS>(film, row as usize + i, &lines, i * DIVISIONS);
            }
            row += n_rows as i32;
        }
    }

    /// Returns the lines from one on.
    #[inline(always)]
    fn lines(&self, first: i32) -> Lines {
        let start = first as f32 - self.at.1;
        let mut lines = Lines { centers: [0.0; LANES], falls: [0.0; LANES], firsts: [0; LANES], ends: [0; LANES] };
        for lane in 0..LANES {
            let dy = start + MIDDLES[lane];
            let fall = self.fall_y * (dy * dy);
            let center = self.at.0 + self.shear * dy;
            // Where the exponent comes to its least.
            let reach = ((fall - LEAST).max(0.0) * (2.0 / std::f32::consts::LOG2_E)).sqrt() * self.sigma_x;
            lines.centers[lane] = center;
            lines.falls[lane] = fall;
            lines.firsts[lane] = self.corner.0 + round(center - reach);
            lines.ends[lane] = self.corner.0 + round(center + reach);
        }
        lines
    }

    /// Adds what falls on a row of pixels, whose lines begin with one of these.
    #[inline(always)]
    fn add_row<const DIVISIONS: usize>(&self, film: &mut Film, row: usize, lines: &Lines, from: usize) {
        let (mut first, mut end) = (i32::MAX, i32::MIN);
        for line in from..from + DIVISIONS {
            first = first.min(lines.firsts[line]);
            end = end.max(lines.ends[line]);
        }
        let n_samples = (film.columns * DIVISIONS) as i32;
        let (first, end) = (first.max(0), end.min(n_samples));
        if first >= end {
            return;
        }
        let pixel = first as usize / DIVISIONS;
        let sums = &mut film.sums[row * film.stride + pixel..(row + 1) * film.stride];
        let from_corner = |sample: i32| (sample - self.corner.0) as f32;
        let (mut start, end) = (from_corner((pixel * DIVISIONS) as i32), from_corner(end));
        // The compiler cannot count the turns of these loops, and makes its vectors of a group, not of several.
        if DIVISIONS == 1 {
            for sums in sums.chunks_exact_mut(LANES) {
                if start >= end {
                    break;
                }
                for (sum, value) in sums.iter_mut().zip(self.values::<DIVISIONS>(lines, from, start)) {
                    *sum += value;
                }
                start += LANES as f32;
            }
            return;
        }
        let mut n_samples = 0;
        for samples in film.samples.chunks_exact_mut(LANES) {
            if start >= end {
                break;
            }
            samples.copy_from_slice(&self.values::<DIVISIONS>(lines, from, start));
            start += LANES as f32;
            n_samples += LANES;
        }
        film.samples[n_samples..][..DIVISIONS].fill(0.0);
        let n_pixels = n_samples.div_ceil(DIVISIONS);
        for (sum, samples) in sums.iter_mut().zip(film.samples.chunks_exact(DIVISIONS)).take(n_pixels) {
            *sum += samples.iter().sum::<f32>();
        }
    }

    /// Returns the sums over the lines of a row of pixels, of the samples from a place along x on.
    #[inline(always)]
    fn values<const DIVISIONS: usize>(&self, lines: &Lines, from: usize, start: f32) -> [f32; LANES] {
        let mut sums = [0.0; LANES];
        for line in from..from + DIVISIONS {
            let (start, fall) = (start - lines.centers[line], lines.falls[line]);
            let mut exponents = MIDDLES;
            for exponent in &mut exponents {
                let dx = start + *exponent;
                *exponent = fall + self.fall_x * (dx * dx);
            }
            for (sum, power) in sums.iter_mut().zip(powers_of_2(exponents)) {
                *sum += power;
            }
        }
        sums.map(|sum| self.peak * sum)
    }
}

const SHIFT: f32 = 12_582_912.0;

/// Returns the whole number nearest to one below 4 million: the sample within a place, for ends of spans the first whose
/// middle lies beyond it.
#[inline(always)]
fn round(x: f32) -> i32 {
    (x.clamp(-4e6, 4e6) + SHIFT).to_bits() as i32 - SHIFT.to_bits() as i32
}

/// Returns 2^x for x from `LEAST` to 0, to 3e-7 of itself, and 0 below: quicker than the library's, and the same bits
/// everywhere.
#[inline(always)]
fn powers_of_2(x: [f32; LANES]) -> [f32; LANES] {
    x.map(|x| {
        let shifted = x + SHIFT;
        let t = x - (shifted - SHIFT);
        // Taylor's series of e^(t ln 2) over |t| < 0.5.
        let mut power = TERMS[0];
        for term in &TERMS[1..] {
            power = power * t + term;
        }
        // The whole number of doublings is in the last bits of the shifted sum; it goes to the exponent.
        let bits = power.to_bits().wrapping_add(shifted.to_bits() << 23);
        f32::from_bits(if x >= LEAST { bits } else { 0 })
    })
}

/// `(ln 2)^k / k!`, the highest first.
const TERMS: [f32; 7] = {
    let mut terms = [1.0_f32; 7];
    let mut term = 1.0;
    let mut k = 1;
    while k < 7 {
        term *= std::f64::consts::LN_2 / k as f64;
        terms[6 - k] = term as f32;
        k += 1;
    }
    terms
};

#[cfg(test)]
mod tests {
    use super::*;

    fn deposited(at: DVec2, covariance: Covariance) -> ndarray::Array2<f64> {
        let mut raster = Raster::new(61, 61);
        deposit(&mut raster, &[Gaussian { at, covariance, energy: 1.0 }]);
        raster.finish()
    }

    #[test]
    fn energy_and_moments_are_those_of_the_gaussian() {
        for (sigma_1, sigma_2, angle) in
            [(5.0, 1.0, 0.3), (3.0, 3.0, 0.0), (4.0, 0.2, 1.1), (0.3, 0.3, 0.0), (0.05, 0.05, 0.0)]
        {
            let axis = DVec2::from_angle(angle);
            let c = Covariance::along(axis * sigma_1).plus(Covariance::along(axis.perp() * sigma_2));
            let at = DVec2::new(30.3, 29.8);
            let image = deposited(at, c);
            // The sum over samples is that of the integral but for 3e-4, and what the reach cuts unevenly.
            assert!((image.sum() - 1.0).abs() < 1e-3, "{sigma_1} {sigma_2}: {}", image.sum());
            let mean = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
                image.indexed_iter().map(|((r, k), e)| e * f(k as f64 + 0.5 - at.x, r as f64 + 0.5 - at.y)).sum()
            };
            assert!(mean(&|x, _| x).abs() < 0.31 && mean(&|_, y| y).abs() < 0.31);
            if sigma_2 >= 1.0 {
                // A truncated Gaussian is a little narrower; pixels add 1/12.
                assert!((mean(&|x, _| x * x) - c.xx - 1.0 / 12.0).abs() < 4e-3 * c.xx);
                assert!((mean(&|x, y| x * y) - c.xy).abs() < 4e-3 * c.xx);
            }
        }
    }

    #[test]
    fn the_powers_are_the_librarys() {
        for i in -1154..0 {
            let x: [f32; LANES] = std::array::from_fn(|lane| (i as f32 + 0.125 * lane as f32) * 0.01);
            for (x, power) in x.into_iter().zip(powers_of_2(x)) {
                let expected = f64::from(x).exp2();
                assert!((f64::from(power) / expected - 1.0).abs() < 3e-7, "{x}: {power} {expected}");
            }
        }
        assert_eq!(powers_of_2([-11.6; LANES]), [0.0; LANES]);
    }

    #[test]
    fn pixels_hold_the_integral_not_the_value_at_their_centre() {
        let sigma: f64 = 0.5;
        let image = deposited(DVec2::splat(30.5), Covariance { xx: sigma * sigma, xy: 0.0, yy: sigma * sigma });
        // erf(0.5/(0.5·√2)) = erf(0.70711) = 0.682689.
        assert!((image[(30, 30)] - 0.682_689f64.powi(2)).abs() < 1e-3, "{}", image[(30, 30)]);
    }
}
