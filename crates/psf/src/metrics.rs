//! What is read off a point spread function on pixels.
//!
//! Any picture of a point will do: [`Picture`] borrows it together with its pitch. Lengths are µm, x is to the right
//! and y is up from the middle of the picture, frequencies are cycles per mm.

use std::f64::consts::PI;

use dioptric_diffraction::Covariance;
use glam::DVec2;
use ndarray::{Array2, ArrayView2, Axis};

use crate::Kernel;

/// A picture of a point: its energies, of which only the ratios matter, and the side of a pixel.
#[derive(Clone, Debug)]
pub struct Picture {
    energy: Array2<f64>,
    row_sums: Vec<f64>,
    column_sums: Vec<f64>,
    pitch_um: f64,
}

/// A sampled profile across a point spread function.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Places of the samples, µm, from the middle of the picture.
    pub at_um: Vec<f64>,
    /// Energy per µm for a line spread, energy up to there for an edge spread; the whole energy is 1.
    pub values: Vec<f64>,
}

impl Picture {
    /// Returns a picture normalised to unit energy; dark pictures stay dark.
    pub fn new<T: Copy + Into<f64>>(energy: ArrayView2<'_, T>, pitch_um: f64) -> Self {
        let energy = energy.mapv(Into::into);
        let sum = energy.sum();
        let energy = if sum > 0.0 { energy / sum } else { energy };
        let (row_sums, column_sums) = (energy.sum_axis(Axis(1)).to_vec(), energy.sum_axis(Axis(0)).to_vec());
        Self { energy, row_sums, column_sums, pitch_um }
    }

    /// The energies: their sum is 1.
    pub fn energy(&self) -> &Array2<f64> {
        &self.energy
    }

    /// Side of a pixel, µm.
    pub fn pitch_um(&self) -> f64 {
        self.pitch_um
    }

    pub(crate) fn at_um(&self, row: usize, column: usize) -> DVec2 {
        let (rows, columns) = self.energy.dim();
        let x = column as f64 - 0.5 * (columns as f64 - 1.0);
        let y = 0.5 * (rows as f64 - 1.0) - row as f64;
        DVec2::new(x, y) * self.pitch_um
    }

    fn mean(&self, of: impl Fn(DVec2) -> f64) -> f64 {
        self.energy.indexed_iter().map(|((row, column), e)| e * of(self.at_um(row, column))).sum()
    }

    /// Returns the centroid, µm.
    pub fn centroid_um(&self) -> DVec2 {
        DVec2::new(self.mean(|p| p.x), self.mean(|p| p.y))
    }

    /// Returns the second moments about the centroid, µm². Pixels count as points at their centers.
    pub fn second_moments_um2(&self) -> Covariance {
        let c = self.centroid_um();
        Covariance {
            xx: self.mean(|p| (p.x - c.x).powi(2)),
            xy: self.mean(|p| (p.x - c.x) * (p.y - c.y)),
            yy: self.mean(|p| (p.y - c.y).powi(2)),
        }
    }

    /// Returns the root mean square distance from the centroid, µm.
    pub fn rms_radius_um(&self) -> f64 {
        let m = self.second_moments_um2();
        (m.xx + m.yy).sqrt()
    }

    /// Returns the line spread along `direction_rad` from +x: energy per µm at distances from the middle of the picture.
    ///
    /// For a direction along the rows or columns these are the sums of columns or rows; for others, the pixels'
    /// energies are spread over their own projections.
    pub fn line_spread(&self, direction_rad: f64) -> Profile {
        let along = DVec2::from_angle(direction_rad);
        let (rows, columns) = self.energy.dim();
        let n = 2 * ((0.5 * (rows as f64).hypot(columns as f64)).ceil() as usize) + 1;
        let middle = (n / 2) as f64;
        let offset = if along.x.abs() > along.y.abs() { (columns + 1) % 2 } else { (rows + 1) % 2 } as f64 * 0.5;
        let mut values = vec![0.0; n];
        for ((row, column), e) in self.energy.indexed_iter() {
            let at = self.at_um(row, column).dot(along) / self.pitch_um + middle + offset;
            let (below, fraction) = (at.floor(), at - at.floor());
            // Rounding must not push a whole number to the neighbor below.
            let (below, fraction) = if fraction > 1.0 - 1e-9 { (below + 1.0, 0.0) } else { (below, fraction) };
            values[below as usize] += e * (1.0 - fraction) / self.pitch_um;
            if fraction > 0.0 {
                values[below as usize + 1] += e * fraction / self.pitch_um;
            }
        }
        Profile { at_um: (0..n).map(|i| (i as f64 - middle - offset) * self.pitch_um).collect(), values }
    }

    /// Returns the edge spread along `direction_rad`: the energy below each upper border of a sample.
    pub fn edge_spread(&self, direction_rad: f64) -> Profile {
        let mut profile = self.line_spread(direction_rad);
        let mut below = 0.0;
        for (at, value) in profile.at_um.iter_mut().zip(&mut profile.values) {
            below += *value * self.pitch_um;
            *value = below;
            *at += 0.5 * self.pitch_um;
        }
        profile
    }

    /// Returns the modulation for a wave along `direction_rad`, at `cycles_per_mm`: that of the pixel averages as they
    /// are, which includes the pixel's own.
    pub fn mtf(&self, direction_rad: f64, cycles_per_mm: f64) -> f64 {
        let (real, imaginary) = self.optical_transfer(direction_rad, cycles_per_mm);
        real.hypot(imaginary)
    }

    /// Returns the real and imaginary part of the picture's Fourier transform for a wave along `direction_rad`: the
    /// modulation and, as its angle, how far the wave is moved towards the direction.
    ///
    /// Those of several wavelengths can be added with weights; the modulation of the sum is that of the polychromatic light.
    pub fn optical_transfer(&self, direction_rad: f64, cycles_per_mm: f64) -> (f64, f64) {
        let along = DVec2::from_angle(direction_rad);
        let wave = along * (2.0 * PI * cycles_per_mm * 1e-3);
        // Along rows or columns a pixel's phase is that of its column or row. A right angle in radians is not exact.
        let rounding = f64::EPSILON.sqrt();
        if along.y.abs() < rounding {
            return transform(&self.column_sums, |column| self.at_um(0, column).x * wave.x);
        }
        if along.x.abs() < rounding {
            return transform(&self.row_sums, |row| self.at_um(row, 0).y * wave.y);
        }
        // A pixel's phase is the sum of its column's and its row's.
        let (rows, columns) = self.energy.dim();
        let of_columns: Vec<(f64, f64)> =
            (0..columns).map(|column| (self.at_um(0, column).x * wave.x).sin_cos()).collect();
        let mut sum = (0.0, 0.0);
        for row in 0..rows {
            let energies = self.energy.row(row);
            let (real, imaginary) = energies
                .iter()
                .zip(&of_columns)
                .fold((0.0, 0.0), |(real, imaginary), (e, phase)| (real + e * phase.1, imaginary + e * phase.0));
            let (sin, cos) = (self.at_um(row, 0).y * wave.y).sin_cos();
            sum = (sum.0 + real * cos - imaginary * sin, sum.1 + real * sin + imaginary * cos);
        }
        sum
    }
}

impl From<&Kernel> for Picture {
    fn from(kernel: &Kernel) -> Self {
        Self::new(kernel.samples.view(), kernel.pitch_um)
    }
}

impl Profile {
    /// Returns the full width at half the maximum, µm, with straight lines between samples.
    pub fn full_width_at_half_maximum_um(&self) -> f64 {
        let Some(peak) = (0..self.values.len()).max_by(|&a, &b| self.values[a].total_cmp(&self.values[b])) else {
            return f64::NAN;
        };
        let half = 0.5 * self.values[peak];
        let crossing = |outside: usize, inside: usize| {
            let (low, high) = (self.values[outside], self.values[inside]);
            let fraction = (half - low) / (high - low);
            self.at_um[outside] + fraction * (self.at_um[inside] - self.at_um[outside])
        };
        let right = (peak + 1..self.values.len()).find(|&i| self.values[i] < half).map(|i| crossing(i, i - 1));
        let left = (0..peak).rev().find(|&i| self.values[i] < half).map(|i| crossing(i, i + 1));
        match (left, right) {
            (Some(left), Some(right)) => right - left,
            _ => f64::NAN,
        }
    }
}

/// Returns the real and imaginary part of the sum of energies at these phases.
fn transform(energies: &[f64], phase: impl Fn(usize) -> f64) -> (f64, f64) {
    energies.iter().enumerate().fold((0.0, 0.0), |(real, imaginary), (i, e)| {
        let (sin, cos) = phase(i).sin_cos();
        (real + e * cos, imaginary + e * sin)
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;
    use crate::{raster::Raster, splat};

    /// A Gaussian of this many pixels about a place on 101 × 101 pixels of 2 µm.
    pub(crate) fn gaussian(sigma: f64, at: DVec2) -> Picture {
        let mut raster = Raster::new(101, 101);
        let covariance = Covariance { xx: sigma * sigma, xy: 0.0, yy: sigma * sigma };
        splat::deposit(&mut raster, splat::Splat { side: DVec2::ZERO, at, covariance, energy: 1.0 });
        Picture::new(raster.finish().view(), 2.0)
    }

    #[test]
    fn a_gaussian_has_the_metrics_of_one() {
        let sigma = 6.0;
        let picture = gaussian(sigma, DVec2::new(53.5, 48.5));
        let sigma_um = 2.0 * sigma;
        assert!((picture.centroid_um() - DVec2::new(6.0, 4.0)).length() < 1e-3);
        // Cut at 4σ the second moment is 0.3 % low, and a pixel adds a 12th.
        assert_abs_diff_eq!(picture.rms_radius_um(), sigma_um * 2f64.sqrt(), epsilon = 0.05);
        assert_abs_diff_eq!(picture.energy_radius_um(0.5), sigma_um * 1.1774, epsilon = 0.04);
        for direction in [0.0, PI / 2.0] {
            let spread = picture.line_spread(direction);
            assert_abs_diff_eq!(spread.full_width_at_half_maximum_um(), 2.3548 * sigma_um, epsilon = 0.1);
            let frequency: f64 = 10.0;
            let expected = (-2.0 * (PI * frequency * 1e-3 * sigma_um).powi(2)).exp();
            assert_abs_diff_eq!(picture.mtf(direction, frequency), expected, epsilon = 3e-3);
        }
        let oblique = picture.line_spread(0.4).full_width_at_half_maximum_um();
        assert_abs_diff_eq!(oblique, 2.3548 * sigma_um, epsilon = 0.5);
    }

    #[test]
    fn a_line_spread_sums_columns_or_rows() {
        let energy = ndarray::arr2(&[[0.0, 1.0, 0.0], [2.0, 0.0, 1.0], [0.0, 0.0, 0.0]]);
        let picture = Picture::new(energy.view(), 1.0);
        let columns = picture.line_spread(0.0);
        let at = |profile: &Profile, x: f64| {
            profile.at_um.iter().position(|u| (u - x).abs() < 1e-12).map(|i| profile.values[i] * 4.0)
        };
        assert_eq!([-1.0, 0.0, 1.0].map(|x| at(&columns, x)), [Some(2.0), Some(1.0), Some(1.0)]);
        let rows = picture.line_spread(PI / 2.0);
        assert_eq!([-1.0, 0.0, 1.0].map(|y| at(&rows, y)), [Some(0.0), Some(3.0), Some(1.0)]);
        let edge = picture.edge_spread(0.0);
        assert_eq!(at(&edge, 0.5), Some(3.0));
    }

    #[test]
    fn oblique_waves_are_those_of_every_pixel() {
        let picture = gaussian(7.0, DVec2::new(40.3, 61.8));
        for (direction, frequency) in [(0.4, 9.0), (2.0, 30.0), (-1.1, 140.0)] {
            let wave = DVec2::from_angle(direction) * (2.0 * PI * frequency * 1e-3);
            let found = picture.optical_transfer(direction, frequency);
            assert_abs_diff_eq!(found.0, picture.mean(|p| p.dot(wave).cos()), epsilon = 1e-13);
            assert_abs_diff_eq!(found.1, picture.mean(|p| p.dot(wave).sin()), epsilon = 1e-13);
        }
    }

    #[test]
    fn waves_along_rows_are_those_of_any_direction() {
        let picture = gaussian(7.0, DVec2::new(40.3, 61.8));
        for right_angle in [0.0, 0.5 * PI, PI] {
            let (on, off) =
                (picture.optical_transfer(right_angle, 9.0), picture.optical_transfer(right_angle + 1e-9, 9.0));
            // The phase turns by 1e-9 of some radians.
            assert_abs_diff_eq!(on.0, off.0, epsilon = 1e-8);
            assert_abs_diff_eq!(on.1, off.1, epsilon = 1e-8);
        }
    }
}
