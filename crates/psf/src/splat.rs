//! Gaussians deposited on pixels.

use dioptric_diffraction::Covariance;
use glam::DVec2;

use crate::raster::Raster;

/// How many standard deviations of a Gaussian are deposited; what lies beyond, 3·10⁻⁴, is spread over the rest.
const REACH: f64 = 4.0;
/// The finest subdivision of a pixel's side. What is narrower than its samples allow is widened to 0.12 pixels, which
/// on pixels makes next to no difference.
const FINEST: f64 = 5.0;
/// A Gaussian is sampled at this many samples a standard deviation, or more: its sum is then good to 3·10⁻⁴, and to
/// much better where Gaussians overlap.
const SAMPLES_PER_SIGMA: f64 = 0.6;

/// Deposits a Gaussian, integrated over the pixels; lengths in pixels. What falls outside is lost.
pub(crate) fn deposit(raster: &mut Raster, at: DVec2, covariance: Covariance, energy: f64) {
    let (narrow, _) = covariance.axes();
    let divisions = (SAMPLES_PER_SIGMA / narrow.sqrt()).ceil().clamp(1.0, FINEST);
    // A box of one sample has the variance 1/12: sampling with that added is the box integral to fourth order.
    let mut c = covariance;
    let scale = divisions * divisions;
    c.xx = c.xx * scale + 1.0 / 12.0;
    c.yy = c.yy * scale + 1.0 / 12.0;
    c.xy *= scale;
    if divisions >= FINEST {
        let lift = (SAMPLES_PER_SIGMA * SAMPLES_PER_SIGMA - c.axes().0).max(0.0);
        c.xx += lift;
        c.yy += lift;
    }
    sample(raster, at * divisions, c, energy, divisions as usize);
}

/// Adds a Gaussian at the centres of samples, `divisions` to a pixel's side; lengths in samples.
fn sample(raster: &mut Raster, at: DVec2, c: Covariance, energy: f64, divisions: usize) {
    let (rows, columns) = raster.size();
    // Lines run along the wider of the two directions: so they are few, and long.
    if c.xx >= c.yy {
        let grid = Grid { lines: (rows, columns), across: (columns, 1), divisions };
        sample_lines(raster.pixels_mut(), grid, at, c, energy);
    } else {
        let turned = Covariance { xx: c.yy, xy: c.xy, yy: c.xx };
        let grid = Grid { lines: (columns, 1), across: (rows, columns), divisions };
        sample_lines(raster.pixels_mut(), grid, DVec2::new(at.y, at.x), turned, energy);
    }
}

/// Pixels as lines of pixels: the number of each, and how far apart they are kept.
#[derive(Clone, Copy)]
struct Grid {
    lines: (usize, usize),
    across: (usize, usize),
    divisions: usize,
}

/// Adds a Gaussian line by line; x runs along lines.
fn sample_lines(pixels: &mut [f64], grid: Grid, at: DVec2, c: Covariance, energy: f64) {
    let Grid { lines: (n_lines, line_step), across: (n_across, step), divisions } = grid;
    let determinant = c.xx * c.yy - c.xy * c.xy;
    let (q_xx, shear) = (c.yy / determinant, c.xy / c.yy);
    let inside = 1.0 - (-0.5 * REACH * REACH).exp();
    let peak = energy / (2.0 * std::f64::consts::PI * determinant.sqrt() * inside);
    let sigma_x_given_y = (1.0 / q_xx).sqrt();
    let q_yy = 1.0 / c.yy;
    // exp(−½ q (dx + 1)²) = exp(−½ q dx²)·exp(−q dx)·exp(−½ q): two products a sample.
    let ratio_step = (-q_xx).exp();
    for line in span(at.y, REACH * c.yy.sqrt(), n_lines * divisions) {
        let dy = line as f64 + 0.5 - at.y;
        let t2 = dy * dy * q_yy;
        let center = at.x + shear * dy;
        let reach = (REACH * REACH - t2).max(0.0).sqrt() * sigma_x_given_y;
        let std::ops::Range { start: first, end } = span(center, reach, n_across * divisions);
        if first >= end {
            continue;
        }
        let dx = first as f64 + 0.5 - center;
        let mut value = peak * exp(-0.5 * (t2 + q_xx * dx * dx));
        let mut ratio = exp(-q_xx * (dx + 0.5));
        let pixels = &mut pixels[line / divisions * line_step..];
        let (mut pixel, mut phase) = (first / divisions * step, first % divisions);
        let mut left = end - first;
        while left > 0 {
            let n = left.min(divisions - phase);
            let mut sum = 0.0;
            for _ in 0..n {
                sum += value;
                value *= ratio;
                ratio *= ratio_step;
            }
            pixels[pixel] += sum;
            pixel += step;
            phase = 0;
            left -= n;
        }
    }
}

/// Returns e^x for |x| < 700, to 1e-7 of itself: quicker than the library's, and the same bits everywhere.
#[inline(always)]
fn exp(x: f64) -> f64 {
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    let turns = x * std::f64::consts::LOG2_E;
    let shifted = turns + SHIFT;
    let t = (turns - (shifted - SHIFT)) * std::f64::consts::LN_2;
    // Taylor's series to the seventh power over |t| < 0.35, in pairs so that few steps wait for each other.
    let (t2, t4) = (t * t, t * t * t * t);
    let low = (1.0 + t) + t2 * (0.5 + t * (1.0 / 6.0));
    let high = (1.0 / 24.0 + t * (1.0 / 120.0)) + t2 * (1.0 / 720.0 + t * (1.0 / 5040.0));
    // The whole number of doublings is in the last bits of the shifted sum; it goes to the exponent.
    f64::from_bits((low + t4 * high).to_bits().wrapping_add(shifted.to_bits() << 52))
}

/// Returns the samples whose centres lie within `reach` of a place, of the `n` that there are.
fn span(at: f64, reach: f64, n: usize) -> std::ops::Range<usize> {
    // Casts go towards 0 and stop at it; they are quicker than rounding.
    let first = (at - reach + 0.5) as usize;
    let end = (at + reach + 0.5) as usize;
    first..end.min(n)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deposited(at: DVec2, covariance: Covariance) -> ndarray::Array2<f64> {
        let mut raster = Raster::new(61, 61);
        deposit(&mut raster, at, covariance, 1.0);
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
    fn the_exponential_is_the_librarys() {
        for i in -6900..6900 {
            let x = f64::from(i) * 0.1;
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-7, "{x}: {} {}", exp(x), x.exp());
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
