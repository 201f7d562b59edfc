//! The matrix from a sensor's channels to linear sRGB.

use dioptric_spectrum::{Illuminant, Lab, Observer, Spectrum, Xyz, adapt_bradford, delta_e_2000};
use serde::{Deserialize, Serialize};

use crate::{
    Sensor,
    balance::{fine_grid, white_response},
    least_squares::Normal,
};

/// How the sensor's channels become colors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum ColorCorrection {
    /// A matrix fitted under the light that white is balanced for; where white is found in the picture, under the light on
    /// the scene if that is known, and else under the black body or daylight that comes nearest. None where white is not
    /// balanced.
    #[default]
    Auto,
    /// The first three channels are taken as red, green and blue; one channel alone is gray.
    None,
    /// A matrix fitted to the sensor, the 1931 observer and the 24-patch chart under this light.
    Fitted(Illuminant),
    /// Three rows, one for each of linear red, green and blue, of one factor a (balanced) channel.
    Matrix([Vec<f64>; 3]),
}

/// A matrix from balanced channels to linear sRGB, and how well it does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColorMatrix {
    /// For linear red, green and blue the factor of each channel. Rows of a fitted matrix sum to 1, so that what is
    /// balanced stays neutral.
    pub rows: [Vec<f64>; 3],
    /// ΔE₀₀ of each training color; empty where the matrix was not fitted.
    pub delta_e: Vec<f64>,
}

impl ColorMatrix {
    /// Returns the matrix that takes the first three channels, or a single one, as they are.
    pub fn identity(n_channels: usize) -> Self {
        let row = |i: usize| (0..n_channels).map(|j| f64::from(u8::from(j == i.min(n_channels - 1)))).collect();
        Self { rows: [row(0), row(1), row(2)], delta_e: Vec::new() }
    }

    /// Returns the matrix fitted to a sensor and reflectances under a light.
    ///
    /// The sensor's channels are balanced for the light; the colors wanted are those that the 1931 observer sees,
    /// moved from the light's white to that of sRGB (Bradford). The sum of squared differences is minimized, in
    /// lightness, chroma and hue with the weights of chroma that ΔE₀₀ has, starting from the best linear fit.
    pub fn fit(sensor: &Sensor, light: &Illuminant, reflectances: &[Spectrum]) -> Self {
        let training = Training::new(sensor, light, reflectances);
        let n_channels = sensor.filters.len();
        let mut parameters = training.linear_fit();
        if n_channels > 1 {
            training.refine(&mut parameters);
        }
        let rows = rows_of(&parameters, n_channels);
        let delta_e = (0..reflectances.len()).map(|i| training.delta_e(&rows, i)).collect();
        Self { rows, delta_e }
    }

    /// The mean ΔE₀₀ of the training colors, or `None` where the matrix was not fitted.
    pub fn mean_delta_e(&self) -> Option<f64> {
        let n = self.delta_e.len();
        (n > 0).then(|| self.delta_e.iter().sum::<f64>() / n as f64)
    }

    /// Returns linear sRGB of balanced channels.
    pub fn apply(&self, channels: &[f64]) -> [f64; 3] {
        apply(&self.rows, channels)
    }
}

fn apply(rows: &[Vec<f64>; 3], channels: &[f64]) -> [f64; 3] {
    rows.each_ref().map(|row| row.iter().zip(channels).map(|(m, c)| m * c).sum())
}

/// Returns rows that sum to 1 from all their factors but the last.
fn rows_of(parameters: &[f64], n_channels: usize) -> [Vec<f64>; 3] {
    [0, 1, 2].map(|i| {
        let mut row = parameters[i * (n_channels - 1)..(i + 1) * (n_channels - 1)].to_vec();
        row.push(1.0 - row.iter().sum::<f64>());
        row
    })
}

/// What a matrix is fitted to.
struct Training {
    /// Balanced channels of each color, white being all 1.
    channels: Vec<Vec<f64>>,
    /// Linear sRGB wanted.
    rgb: Vec<[f64; 3]>,
    lab: Vec<Lab>,
}

impl Training {
    fn new(sensor: &Sensor, light: &Illuminant, reflectances: &[Spectrum]) -> Self {
        let grid = fine_grid();
        let light_values = light.spectrum().sample_held(&grid);
        let weights = sensor.electron_weights(&grid);
        let white = white_response(sensor, light);
        let white_xyz = Observer::Cie1931.xyz(&grid, &light_values);
        let lit = |reflectance: &Spectrum| -> Vec<f64> {
            reflectance.sample_held(&grid).iter().zip(&light_values).map(|(r, s)| r * s).collect()
        };
        let unit_white = Xyz(white_xyz.0.map(|v| v / white_xyz.0[1]));
        let (mut channels, mut rgb, mut lab) = (Vec::new(), Vec::new(), Vec::new());
        for reflectance in reflectances {
            let lit = lit(reflectance);
            let see = |(w, white): (&Vec<f64>, &f64)| {
                let signal: f64 = w.iter().zip(&lit).map(|(w, s)| w * s).sum();
                if *white > 0.0 { signal / white } else { 0.0 }
            };
            channels.push(weights.iter().zip(&white).map(see).collect());
            let xyz = Xyz(Observer::Cie1931.xyz(&grid, &lit).0.map(|v| v / white_xyz.0[1]));
            let seen = adapt_bradford(xyz, unit_white, Xyz::D65);
            rgb.push(seen.to_linear_srgb());
            lab.push(seen.to_lab(Xyz::D65));
        }
        Self { channels, rgb, lab }
    }

    /// Returns all factors but the last of each row of the matrix that is best in linear sRGB.
    fn linear_fit(&self) -> Vec<f64> {
        let n = self.channels[0].len() - 1;
        let mut parameters = Vec::with_capacity(3 * n);
        for color in 0..3 {
            // With rows that sum to 1, wanted − last channel = Σ factor × (channel − last channel).
            let mut normal = Normal::new(n);
            for (channels, rgb) in self.channels.iter().zip(&self.rgb) {
                let slopes: Vec<f64> = channels[..n].iter().map(|c| c - channels[n]).collect();
                normal.add(&slopes, rgb[color] - channels[n]);
            }
            parameters.extend(normal.solve(1e-9));
        }
        parameters
    }

    /// Improves the factors by Levenberg and Marquardt's method.
    fn refine(&self, parameters: &mut Vec<f64>) {
        const STEP: f64 = 1e-6;
        let n_channels = self.channels[0].len();
        let residuals = |p: &[f64]| self.residuals(&rows_of(p, n_channels));
        let cost = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>();
        let mut damping = 1e-3;
        let mut current = residuals(parameters);
        for _ in 0..100 {
            let columns: Vec<Vec<f64>> = (0..parameters.len())
                .map(|j| {
                    let mut moved = parameters.clone();
                    moved[j] += STEP;
                    residuals(&moved).iter().zip(&current).map(|(m, c)| (m - c) / STEP).collect()
                })
                .collect();
            let mut normal = Normal::new(parameters.len());
            for (i, residual) in current.iter().enumerate() {
                let slopes: Vec<f64> = columns.iter().map(|column| column[i]).collect();
                normal.add(&slopes, -residual);
            }
            let moved: Vec<f64> = normal.solve(damping).iter().zip(&*parameters).map(|(d, p)| p + d).collect();
            let next = residuals(&moved);
            let (before, after) = (cost(&current), cost(&next));
            if after < before {
                (*parameters, current) = (moved, next);
                damping *= 0.3;
                if before - after < 1e-12 * before {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
    }

    /// Returns the weighted differences of all colors in lightness, chroma and hue.
    fn residuals(&self, rows: &[Vec<f64>; 3]) -> Vec<f64> {
        let difference = |(channels, wanted): (&Vec<f64>, &Lab)| {
            let got = lab_of(apply(rows, channels));
            let chroma = wanted.a.hypot(wanted.b);
            let (cos, sin) = if chroma > 0.0 { (wanted.a / chroma, wanted.b / chroma) } else { (1.0, 0.0) };
            let (da, db) = (got.a - wanted.a, got.b - wanted.b);
            let (along, across) = (da * cos + db * sin, db * cos - da * sin);
            [got.l - wanted.l, along / (1.0 + 0.045 * chroma), across / (1.0 + 0.015 * chroma)]
        };
        self.channels.iter().zip(&self.lab).flat_map(difference).collect()
    }

    fn delta_e(&self, rows: &[Vec<f64>; 3], i: usize) -> f64 {
        delta_e_2000(lab_of(apply(rows, &self.channels[i])), self.lab[i])
    }
}

/// Returns CIELAB of linear sRGB, white being (1, 1, 1).
pub(crate) fn lab_of(linear_srgb: [f64; 3]) -> Lab {
    // The white is that of the conversion itself, so that equal channels are exactly neutral.
    Xyz::from_linear_srgb(linear_srgb).to_lab(Xyz::from_linear_srgb([1.0; 3]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_spectrum::color_checker_reflectances;

    fn chart() -> Vec<Spectrum> {
        color_checker_reflectances().into_iter().map(|(_, spectrum)| spectrum).collect()
    }

    #[test]
    fn a_sensor_that_sees_like_the_observer_is_corrected_exactly() {
        let matrix = ColorMatrix::fit(&Sensor::built_in("ideal").unwrap(), &Illuminant::D65, &chart());
        // What is left comes from 5 nm steps in the sensor's curves.
        assert!(matrix.mean_delta_e().unwrap() < 0.1, "{:?}", matrix.mean_delta_e());
    }

    #[test]
    fn real_sensors_come_close() {
        for (name, light, most) in [
            ("imx363", Illuminant::D65, 3.0),
            ("imx363", Illuminant::A, 4.0),
            ("nikon-d5100", Illuminant::D65, 3.0),
            ("nikon-d100", Illuminant::D65, 3.0),
        ] {
            let sensor = Sensor::built_in(name).unwrap();
            let matrix = ColorMatrix::fit(&sensor, &light, &chart());
            let mean = matrix.mean_delta_e().unwrap();
            assert!(mean < most, "{name} under {light:?}: {mean}");
            for row in &matrix.rows {
                assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn one_channel_is_gray() {
        let mono = Sensor::built_in("machine-vision-mono").unwrap();
        assert_eq!(ColorMatrix::fit(&mono, &Illuminant::D65, &chart()).rows, [vec![1.0], vec![1.0], vec![1.0]]);
        assert_eq!(ColorMatrix::identity(1).apply(&[0.3]), [0.3; 3]);
        assert_eq!(ColorMatrix::identity(4).apply(&[0.1, 0.2, 0.3, 0.4]), [0.1, 0.2, 0.3]);
    }
}
