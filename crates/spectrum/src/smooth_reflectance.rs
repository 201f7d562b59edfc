//! Colors lifted to smooth spectra.
//!
//! A reflectance is S(λ) = ½ + x / (2 √(1 + x²)) with x a parabola of the wavelength (Jakob & Hanika 2019, "A
//! low-dimensional function space for efficient spectral upsampling"): smooth, and within [0, 1] for every color. The
//! three coefficients are fitted here, to linear sRGB under D65 as the CIE 1931 observer sees it.

use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

use rayon::prelude::*;

use crate::{Illuminant, Observer, WavelengthGrid, Xyz, lanes};

/// The smooth reflectance of a color: one lift for photographs and textures.
///
/// It was fitted from 380 to 780 nm; beyond, the parabola goes on, which says nothing of what a thing reflects there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SmoothReflectance {
    /// Of the parabola in (λ − 550 nm) / 200 nm, the constant first.
    c: [f32; 3],
    scale: f32,
}

impl SmoothReflectance {
    /// The wavelengths between which it was fitted, nm.
    pub const FITTED_NM: [f64; 2] = [380.0, 780.0];

    /// Returns the reflectance at wavelengths, nm.
    pub fn at<const N: usize>(&self, wavelengths_nm: &[f32; N]) -> [f32; N] {
        let [c0, c1, c2] = self.c;
        lanes(|lane| {
            let s = (wavelengths_nm[lane] - 550.0) * (1.0 / 200.0);
            let x = c0 + s * (c1 + s * c2);
            // Written so that a large parabola gives exactly 0 or 1.
            self.scale * (0.5 + 0.5 * x / (1.0 + x * x).sqrt())
        })
    }

    /// Returns the reflectance of a linear sRGB color, clamped to [0, 1]; grays are flat.
    ///
    /// Of the whole cube of colors it comes back under D65 within 0.02, and within 0.004 on average.
    pub fn of_rgb(rgb: [f32; 3]) -> Self {
        let rgb = rgb.map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) });
        let [r, g, b] = rgb;
        if r == g && g == b {
            return Self { c: [0.0; 3], scale: 2.0 * r };
        }
        Table::get().look_up(rgb)
    }
}

/// Coefficients over the colors: by which channel is largest, its value, and the other two in proportion to it.
struct Table {
    c: Vec<[f32; 3]>,
}

/// Points of the table along each axis.
const N: usize = 24;
/// Colors darker than this are scaled from it.
const DARKEST: f64 = 2e-3;

impl Table {
    fn get() -> &'static Self {
        static TABLE: OnceLock<Table> = OnceLock::new();
        TABLE.get_or_init(Self::fit)
    }

    /// The value of the largest channel at a point: close together at both ends, where coefficients change quickly.
    fn value_at(index: usize) -> f64 {
        let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
        DARKEST + (1.0 - DARKEST) * smooth(smooth(index as f64 / (N - 1) as f64))
    }

    fn fit() -> Self {
        let fit = Fit::new();
        let columns: Vec<Vec<[f32; 3]>> = (0..3 * N * N)
            .into_par_iter()
            .map(|column| {
                let (largest, y, x) = (column / (N * N), column / N % N, column % N);
                let [x, y] = [x, y].map(|i| i as f64 / (N - 1) as f64);
                let mut coefficients = vec![[0.0; 3]; N];
                // Walk up and down from a middling brightness, each point starting from its neighbor.
                for indices in [(N / 3..N).collect::<Vec<_>>(), (0..N / 3).rev().collect()] {
                    let mut c = match indices.first() {
                        Some(&first) if first < N / 3 => coefficients[N / 3].map(f64::from),
                        _ => [0.0; 3],
                    };
                    for index in indices {
                        let value = Self::value_at(index);
                        let mut rgb = [0.0; 3];
                        rgb[largest] = value;
                        rgb[(largest + 1) % 3] = x * value;
                        rgb[(largest + 2) % 3] = y * value;
                        c = fit.solve(rgb, c);
                        coefficients[index] = c.map(|c| c as f32);
                    }
                }
                coefficients
            })
            .collect();
        Self { c: columns.into_iter().flatten().collect() }
    }

    fn look_up(&self, rgb: [f32; 3]) -> SmoothReflectance {
        let largest = if rgb[0] >= rgb[1] && rgb[0] >= rgb[2] { 0 } else { usize::from(rgb[1] < rgb[2]) + 1 };
        let value = f64::from(rgb[largest]);
        let shown = value.clamp(DARKEST, 1.0);
        let along = |v: f64| {
            let at = (v * (N - 1) as f64).clamp(0.0, (N - 1) as f64);
            let below = (at as usize).min(N - 2);
            (below, (at - below as f64) as f32)
        };
        let [(x, fx), (y, fy)] = [1, 2].map(|k| along(f64::from(rgb[(largest + k) % 3]) / value));
        // The few brightness points are searched; between them coefficients run straight.
        let z = (1..N - 1).find(|&i| Self::value_at(i) > shown).unwrap_or(N - 1) - 1;
        let (low, high) = (Self::value_at(z), Self::value_at(z + 1));
        let fz = ((shown - low) / (high - low)) as f32;
        let at = |x: usize, y: usize, z: usize| self.c[((largest * N + y) * N + x) * N + z];
        let mut c = [0.0; 3];
        for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
            for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
                for (dz, wz) in [(0, 1.0 - fz), (1, fz)] {
                    let corner = at(x + dx, y + dy, z + dz);
                    c = std::array::from_fn(|k| c[k] + wx * wy * wz * corner[k]);
                }
            }
        }
        SmoothReflectance { c, scale: (value / shown) as f32 }
    }
}

/// What a reflectance looks like: linear sRGB as weighted sums, and how to find coefficients of a wanted one.
struct Fit {
    /// (λ − 550 nm) / 200 nm, and what each wavelength gives to red, green and blue.
    samples: Vec<(f64, [f64; 3])>,
}

impl Fit {
    fn new() -> Self {
        let grid = WavelengthGrid::uniform(380.0, 780.0, 10.0).expect("a valid range");
        let light = Illuminant::D65.spectrum().sample_held(&grid);
        let [x, y, z] = Observer::Cie1931.weights(&grid);
        let each: Vec<[f64; 3]> =
            (0..grid.len()).map(|i| Xyz([x[i], y[i], z[i]].map(|w| w * light[i])).to_linear_srgb()).collect();
        // White is white: the perfect reflector has (1, 1, 1).
        let white = [0, 1, 2].map(|k| each.iter().map(|rgb| rgb[k]).sum::<f64>());
        let samples = grid
            .centers_nm()
            .iter()
            .zip(&each)
            .map(|(nm, rgb)| ((nm - 550.0) / 200.0, [0, 1, 2].map(|k| rgb[k] / white[k])))
            .collect();
        Self { samples }
    }

    /// Returns the color of coefficients, and its derivative by each.
    fn color(&self, c: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
        let (mut rgb, mut jacobian) = ([0.0; 3], [[0.0; 3]; 3]);
        for (s, weights) in &self.samples {
            let x = c[0] + s * (c[1] + s * c[2]);
            let root = (1.0 + x * x).sqrt();
            let (value, slope) = (0.5 + 0.5 * x / root, 0.5 / (root * root * root));
            for k in 0..3 {
                rgb[k] += weights[k] * value;
                let by = weights[k] * slope;
                jacobian[k] = [jacobian[k][0] + by, jacobian[k][1] + by * s, jacobian[k][2] + by * s * s];
            }
        }
        (rgb, jacobian)
    }

    /// Returns the coefficients of a color by Levenberg's damped Gauss–Newton steps.
    fn solve(&self, wanted: [f64; 3], start: [f64; 3]) -> [f64; 3] {
        const LIMIT: f64 = 300.0;
        let error = |rgb: [f64; 3]| [0, 1, 2].map(|k| (rgb[k] - wanted[k]) / (wanted[k] + 0.05));
        let cost = |e: [f64; 3]| e.iter().map(|e| e * e).sum::<f64>();
        let (mut c, mut damping) = (start, 1e-4);
        let (mut rgb, mut jacobian) = self.color(c);
        for _ in 0..40 {
            let e = error(rgb);
            if cost(e) < 1e-12 {
                break;
            }
            let j: [[f64; 3]; 3] = std::array::from_fn(|k| jacobian[k].map(|d| d / (wanted[k] + 0.05)));
            let normal = |a: usize, b: usize| (0..3).map(|k| j[k][a] * j[k][b]).sum::<f64>();
            let matrix: [[f64; 3]; 3] = std::array::from_fn(|a| {
                std::array::from_fn(|b| {
                    normal(a, b) * if a == b { 1.0 + damping } else { 1.0 } + if a == b { 1e-14 } else { 0.0 }
                })
            });
            let right: [f64; 3] = std::array::from_fn(|a| -(0..3).map(|k| j[k][a] * e[k]).sum::<f64>());
            let m = glam::DMat3::from_cols_array_2d(&matrix);
            let step = m.inverse() * glam::DVec3::from_array(right);
            let next = (glam::DVec3::from_array(c) + step).clamp(glam::DVec3::splat(-LIMIT), glam::DVec3::splat(LIMIT));
            let (next_rgb, next_jacobian) = self.color(next.to_array());
            if next.is_finite() && cost(error(next_rgb)) < cost(e) {
                (c, rgb, jacobian, damping) = (next.to_array(), next_rgb, next_jacobian, (0.2 * damping).max(1e-9));
            } else {
                damping *= 10.0;
                if damping > 1e8 {
                    break;
                }
            }
        }
        c
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(smooth: &SmoothReflectance) -> [f64; 3] {
        let fit = Fit::new();
        let values: Vec<f64> =
            fit.samples.iter().map(|(s, _)| f64::from(smooth.at(&[(550.0 + 200.0 * s) as f32])[0])).collect();
        [0, 1, 2].map(|k| fit.samples.iter().zip(&values).map(|((_, w), v)| w[k] * v).sum())
    }

    /// Over the whole cube, saturated corners included, a color comes back within .02, and within .004 on average.
    #[test]
    fn colors_come_back() {
        let (mut worst, mut sum, mut n) = (0.0_f64, 0.0, 0.0);
        for r in 0..=7 {
            for g in 0..=7 {
                for b in 0..=7 {
                    let rgb = [r, g, b].map(|v| v as f32 / 7.0);
                    let smooth = SmoothReflectance::of_rgb(rgb);
                    let values = smooth.at(&[300.0, 400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 1000.0]);
                    assert!(values.iter().all(|v| (0.0..=1.0).contains(v)), "{rgb:?}: {values:?}");
                    let back = seen(&smooth);
                    let off = (0..3).map(|k| (back[k] - f64::from(rgb[k])).abs()).fold(0.0, f64::max);
                    worst = worst.max(off);
                    sum += off;
                    n += 1.0;
                }
            }
        }
        assert!(worst < 0.02 && sum / n < 0.004, "worst {worst}, mean {}", sum / n);
    }

    #[test]
    fn grays_are_flat_and_white_is_white() {
        for v in [0.0, 1e-4, 0.18, 0.5, 1.0] {
            assert_eq!(SmoothReflectance::of_rgb([v; 3]).at(&[380.0, 700.0]), [v; 2]);
        }
        let almost = SmoothReflectance::of_rgb([1.0, 1.0, 0.999]).at(&[450.0, 600.0]);
        assert!(almost.iter().all(|&v| v > 0.97), "{almost:?}");
    }
}
