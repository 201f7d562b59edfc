//! Gaussians deposited on pixels.
//!
//! A broad Gaussian is sampled on eight columns of pixels at a time, in single precision. Down a column its values are
//! products: each is the last times a ratio, which itself changes by a constant factor. The compiler makes vectors of
//! that, for the base instruction set and for AVX2, chosen at run time, without fused multiply-add and with every sum in
//! a fixed order: all machines give the same bits. The derivation is in `docs/hurb.md`. Narrow ones are [strokes](crate::narrow_gaussian).

use dioptric_diffraction::Covariance;
use glam::DVec2;
use multiversion::multiversion;

use crate::{
    blurred_edge::{BlurredEdgeTable, LANES, profiles},
    narrow_gaussian::{NarrowGaussians, PaddedRows, SAMPLES_PER_SIGMA},
    power::{MOST_PRODUCTS, exp2},
    raster::Raster,
};

/// How many standard deviations of a Gaussian are deposited; what lies beyond, 3·10⁻⁴, is spread over the rest.
const REACH: f64 = 4.0;

/// Light to be deposited: a Gaussian, spread evenly over a side; lengths in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Splat {
    pub(crate) at: DVec2,
    pub(crate) covariance: Covariance,
    pub(crate) side: DVec2,
    pub(crate) energy: f64,
}

impl Splat {
    const NOTHING: Self =
        Self { at: DVec2::ZERO, covariance: Covariance { xx: 0.0, xy: 0.0, yy: 0.0 }, side: DVec2::ZERO, energy: 0.0 };

    /// Whether the Gaussian's narrow axis is 0.6 pixels or more: samples a pixel apart then miss 3·10⁻⁴ of it, and much
    /// less where Gaussians overlap.
    #[inline(always)]
    fn is_broad(&self) -> bool {
        let least = SAMPLES_PER_SIGMA * SAMPLES_PER_SIGMA;
        let Covariance { xx, xy, yy } = self.covariance;
        xx.min(yy) >= least && (xx - least) * (yy - least) >= xy * xy
    }

    /// Returns the covariance with the side's.
    #[inline(always)]
    pub(crate) fn whole(&self) -> Covariance {
        self.covariance.plus(Covariance::along(self.side / 12f64.sqrt()))
    }
}

/// Splats, the narrow from the broad: they are drawn in two ways.
#[derive(Default)]
pub(crate) struct Splats {
    narrow: Vec<Splat>,
    broad: Vec<Splat>,
}

impl Splats {
    #[inline(always)]
    pub(crate) fn push(&mut self, splat: Splat) {
        if splat.is_broad() { &mut self.broad } else { &mut self.narrow }.push(splat);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.narrow.is_empty() && self.broad.is_empty()
    }

    pub(crate) fn clear(&mut self) {
        self.narrow.clear();
        self.broad.clear();
    }
}

/// The picture twice: by rows, and by columns for the strokes along x.
pub(crate) struct SplatBuffer {
    rows: PaddedRows,
    columns: PaddedRows,
}

impl SplatBuffer {
    /// Returns a dark film of so many rows and columns.
    pub(crate) fn new((n_rows, n_columns): (usize, usize)) -> Self {
        Self { rows: PaddedRows::new(n_rows, n_columns), columns: PaddedRows::new(n_columns, n_rows) }
    }

    /// Deposits splats, integrated over the pixels. What falls outside is lost.
    pub(crate) fn add(&mut self, splats: &Splats) {
        add_all(self, splats, profiles());
    }

    /// Adds the pixels to a raster's of the same size.
    pub(crate) fn add_to(&self, raster: &mut Raster) {
        let (_, n_columns) = raster.size();
        for (row, pixels) in raster.pixels_mut().chunks_exact_mut(n_columns).enumerate() {
            for (pixel, sum) in pixels.iter_mut().zip(self.rows.line(row)) {
                *pixel += f64::from(*sum);
            }
            for (pixel, sum) in pixels.iter_mut().zip(self.columns.across(row)) {
                *pixel += f64::from(*sum);
            }
        }
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn add_all(film: &mut SplatBuffer, splats: &Splats, profiles: &[BlurredEdgeTable]) {
    let (n_rows, n_columns) = (film.rows.n_lines, film.columns.n_lines);
    let (groups, rest) = splats.narrow.as_chunks();
    for group in groups {
        NarrowGaussians::new(group, (n_rows, n_columns)).add(LANES, profiles, &mut film.rows, &mut film.columns);
    }
    let mut last = [Splat::NOTHING; LANES];
    last[..rest.len()].copy_from_slice(rest);
    NarrowGaussians::new(&last, (n_rows, n_columns)).add(rest.len(), profiles, &mut film.rows, &mut film.columns);
    for splat in &splats.broad {
        Sampled::new(splat).add(&mut film.rows);
    }
}

/// A Gaussian on pixels: `peak · 2^(fall_x dx² + fall_y (dy − shear dx)²)`. Places count from a corner of a
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

/// Samples of eight columns on a few rows, and where the first lies from the Gaussian's middle.
struct Block {
    column: usize,
    row: usize,
    n_rows: usize,
    from_x: f32,
    from_y: f32,
}

/// The least value over the peak that is deposited, at the reach; as much of the light lies beyond.
const EDGE: f64 = 3.354_626_279_025_118_5e-4;
/// Places further than this from the picture, in pixels, are not seen.
pub(crate) const FAR: f64 = 1e4;
/// Rows in standard deviations between two computations of the exponential: what comes within reach there begins above 2⁻¹¹⁰, which single precision holds.
const MOST_SIGMAS: f32 = 8.0;

impl Sampled {
    #[inline(always)]
    fn new(splat: &Splat) -> Self {
        // Add the variance of a pixel's box, 1/12 a side: samples are then box integrals to fourth order (eq. 8).
        let mut c = splat.whole();
        c.xx += 1.0 / 12.0;
        c.yy += 1.0 / 12.0;
        // Count places from a pixel's corner, so that single precision does.
        let determinant = c.xx * c.yy - c.xy * c.xy;
        let at = splat.at.clamp(DVec2::splat(-FAR), DVec2::splat(FAR));
        let corner = at.floor();
        let within = at - corner;
        // The exponent as squares of dx and of dy less its mean at that dx (eq. 9), in powers of 2.
        let per_xx = 1.0 / c.xx;
        let variance_y = determinant * per_xx;
        Self {
            corner: (corner.x as i32, corner.y as i32),
            at: (within.x as f32, within.y as f32),
            peak: (splat.energy / (std::f64::consts::TAU * (1.0 - EDGE) * determinant.sqrt())) as f32,
            fall_x: (-0.5 * std::f64::consts::LOG2_E * per_xx) as f32,
            fall_y: (-0.5 * std::f64::consts::LOG2_E / variance_y) as f32,
            shear: (c.xy * per_xx) as f32,
            sigma_x: c.xx.sqrt() as f32,
            sigma_y: variance_y.sqrt() as f32,
        }
    }

    /// Adds it to the pixels of rows, eight columns at a time.
    #[inline(always)]
    fn add(&self, rows: &mut PaddedRows) {
        let reach = REACH as f32 * self.sigma_x;
        // A Gaussian may be wider than any number of pixels.
        let first = self.corner.0.saturating_add(floor(self.at.0 - reach)).max(0);
        let end = self.corner.0.saturating_add(floor(self.at.0 + reach)).saturating_add(1).min(rows.n_pixels as i32);
        let mut column = first;
        while column < end {
            self.add_columns(rows, column as usize);
            column += LANES as i32;
        }
    }

    /// Adds what falls on eight columns, the first of which is given.
    #[inline(always)]
    fn add_columns(&self, rows: &mut PaddedRows, column: usize) {
        // How far the first and last samples lie from the middle, and which rows come within reach between them.
        let from = (column as i32 - self.corner.0) as f32 + 0.5 - self.at.0;
        let to = from + (LANES - 1) as f32;
        let reach_x = REACH as f32 * self.sigma_x;
        let (from_x, to_x) = (from.max(-reach_x), to.min(reach_x));
        let (y_from, y_to) = (self.shear * from_x, self.shear * to_x);
        // What the exponent leaves for dy at the column nearest to the middle.
        let nearest = from_x.max(-to_x).max(0.0);
        let left = REACH * REACH + f64::from(self.fall_x * nearest * nearest) * (2.0 / std::f64::consts::LOG2_E);
        let reach_y = (left.max(0.0) as f32).sqrt() * self.sigma_y;
        let corner = self.corner.1;
        let first = corner.saturating_add(floor(self.at.1 + y_from.min(y_to) - reach_y)).max(0);
        let end = corner.saturating_add(floor(self.at.1 + y_from.max(y_to) + reach_y)).saturating_add(1);
        let end = end.min(rows.n_lines as i32);
        let most = (MOST_SIGMAS * self.sigma_y).clamp(2.0, MOST_PRODUCTS as f32) as i32;
        let mut row = first;
        while row < end {
            let n = most.min(end - row);
            let from_y = (row - corner) as f32 + 0.5 - self.at.1;
            self.add_block(rows, Block { column, row: row as usize, n_rows: n as usize, from_x: from, from_y });
            row += n;
        }
    }

    /// Adds what falls on a block: exponentials on its first row, and products from row to row.
    #[inline(always)]
    fn add_block(&self, rows: &mut PaddedRows, block: Block) {
        let (mut values, mut ratios) = ([0.0; LANES], [0.0; LANES]);
        for (i, (value, ratio)) in values.iter_mut().zip(&mut ratios).enumerate() {
            let dx = block.from_x + i as f32;
            let dy = block.from_y - self.shear * dx;
            *value = exp2(self.fall_x * (dx * dx) + self.fall_y * (dy * dy));
            *ratio = exp2(self.fall_y * (1.0 + 2.0 * dy));
        }
        let change = exp2(2.0 * self.fall_y);
        for row in block.row..block.row + block.n_rows {
            let sums = &mut rows.sums[row * rows.stride + LANES + block.column..][..LANES];
            for (((sum, value), ratio), peak) in
                sums.iter_mut().zip(&mut values).zip(&mut ratios).zip([self.peak; LANES])
            {
                *sum += if *value >= EDGE as f32 { *value * peak } else { 0.0 };
                *value *= *ratio;
                *ratio *= change;
            }
        }
    }
}

/// Deposits one splat.
#[cfg(test)]
pub(crate) fn deposit(raster: &mut Raster, splat: Splat) {
    let (mut splats, mut film) = (Splats::default(), SplatBuffer::new(raster.size()));
    splats.push(splat);
    film.add(&splats);
    film.add_to(raster);
}

#[inline(always)]
fn floor(x: f32) -> i32 {
    x.floor() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deposited(at: DVec2, covariance: Covariance) -> ndarray::Array2<f64> {
        let mut raster = Raster::new(61, 61);
        deposit(&mut raster, Splat { at, covariance, side: DVec2::ZERO, energy: 1.0 });
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
    fn pixels_hold_the_integral_not_the_value_at_their_center() {
        let sigma: f64 = 0.5;
        let image = deposited(DVec2::splat(30.5), Covariance { xx: sigma * sigma, xy: 0.0, yy: sigma * sigma });
        // erf(0.5/(0.5·√2)) = erf(0.70711) = 0.682689.
        assert!((image[(30, 30)] - 0.682_689f64.powi(2)).abs() < 1e-3, "{}", image[(30, 30)]);
    }
}
