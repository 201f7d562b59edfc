//! Gaussians deposited on pixels.
//!
//! Each Gaussian is sampled on eight columns of pixels at a time, in single precision. Down a column its values are
//! products: each is the last times a ratio, which itself changes by a constant factor. The compiler makes vectors of
//! that, for the base instruction set and for AVX2, chosen at run time, without fused multiply-add and with every sum in
//! a fixed order: all machines give the same bits.

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
/// Columns of pixels that are computed together.
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

/// Pixels in single precision, their rows longer than the picture's so that eight columns may run over the edge.
struct Film {
    rows: usize,
    columns: usize,
    stride: usize,
    sums: Vec<f32>,
}

impl Film {
    fn new((rows, columns): (usize, usize)) -> Self {
        let stride = columns + LANES;
        Self { rows, columns, stride, sums: vec![0.0; rows * stride] }
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

/// A Gaussian in units of samples: `peak · 2^(fall_x dx² + fall_y (dy − shear dx)²)`. Places count from a corner of a
/// pixel near its middle, so that single precision does.
struct Sampled {
    /// Column and row of the pixel.
    corner: (i32, i32),
    at: (f32, f32),
    peak: f32,
    fall_x: f32,
    fall_y: f32,
    shear: f32,
    sigma_x: f32,
    /// At one x.
    sigma_y: f32,
}

/// Samples of eight columns on a few lines, and where the first lies from the Gaussian's middle.
struct Block {
    column: usize,
    line: usize,
    n_lines: usize,
    from_x: f32,
    from_y: f32,
}

/// The numbers of the lanes.
const COUNT: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
/// Beyond this power of 2 nothing is deposited.
const LEAST: f32 = (-0.5 * REACH * REACH * std::f64::consts::LOG2_E) as f32;
/// That power: the least value over the peak.
const EDGE: f32 = 3.354_626_3e-4;
/// What is held within the reach.
const INSIDE: f64 = 1.0 - 3.354_626_279_025_118_5e-4;
/// Places further than this from the picture, in pixels, are not seen.
const FAR: f64 = 1e5;
/// Lines between two computations of the exponential, at most: products carry its error, which grows to 5·10⁻⁵.
const MOST_LINES: f32 = 32.0;
/// The same in standard deviations: what comes within reach there begins above 2⁻¹¹⁰, which single precision holds.
const MOST_SIGMAS: f32 = 8.0;

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
        let at = gaussian.at.clamp(DVec2::splat(-FAR), DVec2::splat(FAR));
        let corner = at.floor();
        let within = (at - corner) * divisions as f64;
        let per_xx = 1.0 / c.xx;
        let variance_y = determinant * per_xx;
        Self {
            corner: (corner.x as i32, corner.y as i32),
            at: (within.x as f32, within.y as f32),
            peak: (gaussian.energy / (std::f64::consts::TAU * INSIDE * determinant.sqrt())) as f32,
            fall_x: (-0.5 * std::f64::consts::LOG2_E * per_xx) as f32,
            fall_y: (-0.5 * std::f64::consts::LOG2_E / variance_y) as f32,
            shear: (c.xy * per_xx) as f32,
            sigma_x: c.xx.sqrt() as f32,
            sigma_y: variance_y.sqrt() as f32,
        }
    }

    /// Adds it to the pixels, eight columns at a time.
    #[inline(always)]
    fn add<const DIVISIONS: usize>(&self, film: &mut Film) {
        let per_pixel = 1.0 / DIVISIONS as f32;
        let reach = REACH as f32 * self.sigma_x;
        let first = (self.corner.0 + floor((self.at.0 - reach) * per_pixel)).max(0);
        let end = (self.corner.0 + floor((self.at.0 + reach) * per_pixel) + 1).min(film.columns as i32);
        let mut column = first;
        while column < end {
            self.add_columns::<DIVISIONS>(film, column as usize);
            column += LANES as i32;
        }
    }

    /// Adds what falls on eight columns, the first of which is given.
    #[inline(always)]
    fn add_columns<const DIVISIONS: usize>(&self, film: &mut Film, column: usize) {
        // How far the first and last samples lie from the middle, and which lines come within reach between them.
        let from = ((column as i32 - self.corner.0) * DIVISIONS as i32) as f32 + 0.5 - self.at.0;
        let to = from + (LANES * DIVISIONS - 1) as f32;
        let reach_x = REACH as f32 * self.sigma_x;
        let (from_x, to_x) = (from.max(-reach_x), to.min(reach_x));
        let (y_from, y_to) = (self.shear * from_x, self.shear * to_x);
        let nearest = from_x.max(-to_x).max(0.0);
        let reach_y = ((self.fall_x * nearest * nearest - LEAST).max(0.0) * (2.0 / std::f32::consts::LOG2_E)).sqrt()
            * self.sigma_y;
        let corner = self.corner.1 * DIVISIONS as i32;
        let first = (corner + floor(self.at.1 + y_from.min(y_to) - reach_y)).max(0);
        let end = (corner + floor(self.at.1 + y_from.max(y_to) + reach_y) + 1).min((film.rows * DIVISIONS) as i32);
        let most = (MOST_SIGMAS * self.sigma_y).clamp(2.0, MOST_LINES) as i32;
        let mut line = first;
        while line < end {
            let n = most.min(end - line);
            let from_y = (line - corner) as f32 + 0.5 - self.at.1;
            self.add_lines::<DIVISIONS>(
                film,
                Block { column, line: line as usize, n_lines: n as usize, from_x: from, from_y },
            );
            line += n;
        }
    }

    /// Adds what falls on a block: exponentials on its first line, and products from line to line.
    #[inline(always)]
    fn add_lines<const DIVISIONS: usize>(&self, film: &mut Film, block: Block) {
        let (mut values, mut ratios) = ([[0.0; LANES]; DIVISIONS], [[0.0; LANES]; DIVISIONS]);
        for (phase, (values, ratios)) in values.iter_mut().zip(&mut ratios).enumerate() {
            let from_x = block.from_x + phase as f32;
            for ((value, ratio), count) in values.iter_mut().zip(ratios).zip(COUNT) {
                let dx = from_x + count * DIVISIONS as f32;
                let dy = block.from_y - self.shear * dx;
                *value = exp2(self.fall_x * (dx * dx) + self.fall_y * (dy * dy));
                *ratio = exp2(self.fall_y * (1.0 + 2.0 * dy));
            }
        }
        let change = exp2(2.0 * self.fall_y);
        for line in block.line..block.line + block.n_lines {
            let mut total = [0.0; LANES];
            for (values, ratios) in values.iter_mut().zip(&mut ratios) {
                for ((sum, value), ratio) in total.iter_mut().zip(values).zip(ratios) {
                    *sum += if *value >= EDGE { *value } else { 0.0 };
                    *value *= *ratio;
                    *ratio *= change;
                }
            }
            let sums = &mut film.sums[line / DIVISIONS * film.stride + block.column..][..LANES];
            for (sum, total) in sums.iter_mut().zip(total) {
                *sum += self.peak * total;
            }
        }
    }
}

/// Returns 2^x to 3e-7 of itself, 0 below 2⁻¹²⁶ and 2¹²⁶ above that: quicker than the library's, and the same bits
/// everywhere.
#[inline(always)]
fn exp2(x: f32) -> f32 {
    const SHIFT: f32 = 12_582_912.0;
    let most = if x < 126.0 { x } else { 126.0 };
    let shifted = most + SHIFT;
    let t = most - (shifted - SHIFT);
    // Taylor's series of e^(t ln 2) over |t| < 0.5.
    let mut power = TERMS[0];
    for term in &TERMS[1..] {
        power = power * t + term;
    }
    // The whole number of doublings is in the last bits of the shifted sum; it goes to the exponent.
    let bits = power.to_bits().wrapping_add(shifted.to_bits() << 23);
    f32::from_bits(if x > -126.0 { bits } else { 0 })
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

#[inline(always)]
fn floor(x: f32) -> i32 {
    x.floor() as i32
}

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
        for i in -12_500..12_500 {
            let x = i as f32 * 0.01;
            let expected = f64::from(x).exp2();
            assert!((f64::from(exp2(x)) / expected - 1.0).abs() < 3e-7, "{x}: {} {expected}", exp2(x));
        }
    }

    #[test]
    fn pixels_hold_the_integral_not_the_value_at_their_centre() {
        let sigma: f64 = 0.5;
        let image = deposited(DVec2::splat(30.5), Covariance { xx: sigma * sigma, xy: 0.0, yy: sigma * sigma });
        // erf(0.5/(0.5·√2)) = erf(0.70711) = 0.682689.
        assert!((image[(30, 30)] - 0.682_689f64.powi(2)).abs() < 1e-3, "{}", image[(30, 30)]);
    }
}
