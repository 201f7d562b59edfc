//! The matrix from a sensor's channels to linear sRGB.

use dioptric_spectrum::{Illuminant, Lab, Observer, Spectrum, Xyz, adapt_bradford, delta_e_2000};
use serde::{Deserialize, Serialize};

use crate::{
    Sensor, SensorError,
    least_squares::Normal,
    white_light::{color_weights, fine_grid, white_response},
};

/// How the sensor's channels become colors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum ColorCorrection {
    /// A matrix fitted under the light that white is balanced for; where white is found in the picture, under the light on
    /// the scene if that is known, and else under the black body or daylight that comes nearest. None where white is not
    /// balanced. Where no matrix comes near enough to the observer's colors (a mean ΔE₀₀ beyond 1.5 of the 24 patches), roots as in
    /// `Roots` count as well, with all their weight from 2 on, and less in frames of much noise.
    #[default]
    Auto,
    /// The same, fitted under this light.
    AutoUnder(Illuminant),
    /// The first three channels are taken as red, green and blue; one channel alone is gray.
    None,
    /// As `Auto`, always of the channels and the square roots of their products: nearer to the observer's colors than a matrix can come, at
    /// every exposure alike. For three or four channels; noise grows a little more.
    Roots,
    /// A matrix fitted to the sensor, the 1931 observer and the 24-patch chart under this light.
    Fitted(Illuminant),
    /// The same of the channels and the square roots of their products.
    FittedRoots(Illuminant),
    /// Three rows, one for each of linear red, green and blue, of one factor a (balanced) channel.
    Matrix([Vec<f64>; 3]),
}

impl ColorCorrection {
    /// Returns the correction of a name: `auto`, `roots` or `none`.
    ///
    /// # Errors
    /// When the name is another.
    pub fn parse(name: &str) -> Result<Self, SensorError> {
        match name.to_ascii_lowercase().as_str() {
            "auto" => Ok(Self::Auto),
            "roots" => Ok(Self::Roots),
            "none" => Ok(Self::None),
            _ => Err(SensorError::Word {
                what: "a color correction",
                found: name.to_owned(),
                expected: "auto, roots, none".to_owned(),
            }),
        }
    }

    /// Checks that the correction can be had for so many channels.
    pub(crate) fn check(&self, n_channels: usize) -> Result<(), SensorError> {
        let (rows, light) = match self {
            Self::Auto | Self::None => return Ok(()),
            Self::AutoUnder(light) | Self::Fitted(light) => return Ok(light.check()?),
            Self::Roots => (None, None),
            Self::FittedRoots(light) => (None, Some(light)),
            Self::Matrix(rows) => (Some(rows), None),
        };
        light.map_or(Ok(()), Illuminant::check)?;
        let found = match rows {
            Some(rows) => rows.iter().map(Vec::len).find(|n| *n != n_channels),
            None if (3..=4).contains(&n_channels) => None,
            None => {
                let reason = format!("needs three or four channels, but the sensor has {n_channels}");
                return Err(SensorError::Unsuitable { what: "color: Roots", reason });
            }
        };
        match found {
            Some(found) => Err(SensorError::Shape {
                what: "factors in a row of the color matrix",
                expected: n_channels.to_string(),
                found: found.to_string(),
            }),
            None => Ok(()),
        }
    }
}

/// Returns the pairs of different channels, in the order in which rows have factors for their roots.
pub(crate) fn pairs(n_channels: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n_channels).flat_map(move |i| (i + 1..n_channels).map(move |j| (i, j)))
}

/// The mean ΔE₀₀ of a matrix from which on roots are mixed with it, and from which on they stand alone. Roots amplify noise more and
/// have a mean of their own where it is as large as the signal (docs/sensor.md), so that sensors that see nearly as the observer does
/// go without. In between both are mixed, so that no picture jumps as its light changes.
const MISSED_DELTA_E: [f64; 2] = [1.5, 2.0];

/// A matrix from balanced channels to linear sRGB, and how well it does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColorMatrix {
    /// For linear red, green and blue the factor of each channel, and where [`has_roots`](Self::has_roots) those of the square roots of
    /// the products of each two (the first with each later one, then the second, …). Rows of a fitted matrix sum to 1, so that
    /// what is balanced stays neutral.
    pub rows: [Vec<f64>; 3],
    /// Whether roots have factors (Finlayson, Mackiewicz & Hurlbert, "Color correction using root-polynomial regression", IEEE
    /// Trans. Image Process. 24, 2015): unlike products they grow as light does, so that exposure changes no color.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub has_roots: bool,
    /// ΔE₀₀ of each training color; empty where the matrix was not fitted.
    pub delta_e: Vec<f64>,
}

impl ColorMatrix {
    /// Returns the matrix that takes the first three channels, or a single one, as they are.
    pub fn identity(n_channels: usize) -> Self {
        let row = |i: usize| (0..n_channels).map(|j| f64::from(u8::from(j == i.min(n_channels - 1)))).collect();
        Self { rows: [row(0), row(1), row(2)], has_roots: false, delta_e: Vec::new() }
    }

    /// Returns the matrix fitted to a sensor and reflectances under a light.
    ///
    /// The sensor's channels are balanced for the light; the colors wanted are those that the 1931 observer sees,
    /// moved from the light's white to that of sRGB (Bradford). The sum of squared differences is minimized, in
    /// lightness, chroma and hue with the weights of chroma that ΔE₀₀ has, starting from the best linear fit.
    pub fn fit(sensor: &Sensor, light: &Illuminant, reflectances: &[Spectrum]) -> Self {
        Self::fitted(&Training::new(sensor, light, reflectances), false)
    }

    /// Returns such a matrix of the channels and the roots of their products.
    pub fn fit_roots(sensor: &Sensor, light: &Illuminant, reflectances: &[Spectrum]) -> Self {
        let mut training = Training::new(sensor, light, reflectances);
        training.channels = training.channels.iter().map(|channels| with_roots(channels)).collect();
        Self::fitted(&training, true)
    }

    /// Returns the matrix, mixed with that of roots as far as the matrix alone misses the observer's colors and the frame's noise lets it:
    /// `roots_weight` is 1 without noise and 0 where it is much.
    pub(crate) fn fit_mixed(sensor: &Sensor, light: &Illuminant, reflectances: &[Spectrum], roots_weight: f64) -> Self {
        let matrix = Self::fit(sensor, light, reflectances);
        let [least, most] = MISSED_DELTA_E;
        let missed = (matrix.mean_delta_e().unwrap_or(0.0) - least) / (most - least);
        let weight = roots_weight * missed.clamp(0.0, 1.0);
        if weight <= 0.0 || !(3..=4).contains(&sensor.filters.len()) {
            return matrix;
        }
        let mut training = Training::new(sensor, light, reflectances);
        training.channels = training.channels.iter().map(|channels| with_roots(channels)).collect();
        let roots = Self::fitted(&training, true);
        let mut rows = roots.rows;
        for (row, without) in rows.iter_mut().zip(&matrix.rows) {
            row.iter_mut().for_each(|factor| *factor *= weight);
            row.iter_mut().zip(without).for_each(|(factor, without)| *factor += (1.0 - weight) * without);
        }
        let delta_e = (0..training.rgb.len()).map(|i| training.delta_e(&rows, i)).collect();
        Self { rows, has_roots: true, delta_e }
    }

    fn fitted(training: &Training, has_roots: bool) -> Self {
        let n_terms = training.channels[0].len();
        let mut parameters = training.linear_fit();
        if n_terms > 1 {
            training.refine(&mut parameters);
        }
        let rows = rows_of(&parameters, n_terms);
        let delta_e = (0..training.rgb.len()).map(|i| training.delta_e(&rows, i)).collect();
        Self { rows, has_roots, delta_e }
    }

    /// Returns the share of each channel in luminance, near gray: there a root changes by half as much as each of its channels.
    pub(crate) fn luminance_shares(&self, n_channels: usize) -> Vec<f64> {
        let terms = self.rows[0].len();
        // The luminance of linear sRGB (IEC 61966-2-1).
        let share = |term: usize| self.rows.iter().zip([0.2126, 0.7152, 0.0722]).map(|(row, y)| y * row[term]).sum();
        let mut shares: Vec<f64> = (0..n_channels).map(share).collect();
        for ((i, j), term) in pairs(n_channels).zip(n_channels..terms) {
            let half: f64 = 0.5 * share(term);
            shares[i] += half;
            shares[j] += half;
        }
        shares
    }

    /// The mean ΔE₀₀ of the training colors, or `None` where the matrix was not fitted.
    pub fn mean_delta_e(&self) -> Option<f64> {
        let n = self.delta_e.len();
        (n > 0).then(|| self.delta_e.iter().sum::<f64>() / n as f64)
    }

    /// Returns linear sRGB of balanced channels.
    pub fn apply(&self, channels: &[f64]) -> [f64; 3] {
        if self.has_roots { apply(&self.rows, &with_roots(channels)) } else { apply(&self.rows, channels) }
    }
}

/// Returns channels with the square roots of their products; what is below 0 counts as 0 there.
fn with_roots(channels: &[f64]) -> Vec<f64> {
    let roots = pairs(channels.len()).map(|(i, j)| (channels[i].max(0.0) * channels[j].max(0.0)).sqrt());
    channels.iter().copied().chain(roots).collect()
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
        let light_values = light.on_bands(&grid);
        let weights = color_weights(sensor, &grid);
        let white = white_response(sensor, light);
        // Once for all colors: they take longer than everything else here.
        let observer = Observer::Cie1931.weights(&grid);
        let xyz_of = |values: &[f64]| -> Xyz {
            Xyz(observer.each_ref().map(|w| w.iter().zip(values).map(|(w, v)| w * v).sum()))
        };
        let white_xyz = xyz_of(&light_values);
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
            let xyz = Xyz(xyz_of(&lit).0.map(|v| v / white_xyz.0[1]));
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
    fn roots_come_nearer_and_keep_grays_and_exposure() {
        for (name, light, most) in [("imx363", Illuminant::A, 2.0), ("nikon-d5100", Illuminant::D65, 1.1)] {
            let sensor = Sensor::built_in(name).unwrap();
            let (matrix, roots) =
                (ColorMatrix::fit(&sensor, &light, &chart()), ColorMatrix::fit_roots(&sensor, &light, &chart()));
            let (of_matrix, of_roots) = (matrix.mean_delta_e().unwrap(), roots.mean_delta_e().unwrap());
            assert!(of_roots < most && of_roots < of_matrix, "{name}: {of_matrix} {of_roots}");
            assert_eq!(roots.rows[0].len(), 6);
            for gray in [0.02, 0.4] {
                assert!(roots.apply(&[gray; 3]).iter().all(|v| (v - gray).abs() < 1e-12));
            }
            let color = [0.3, 0.2, 0.05];
            for (once, twice) in roots.apply(&color).iter().zip(roots.apply(&color.map(|v| 2.0 * v))) {
                assert!((2.0 * once - twice).abs() < 1e-12);
            }
            assert!((roots.luminance_shares(3).iter().sum::<f64>() - 1.0).abs() < 1e-9);
        }
    }

    /// The mean ΔE₀₀ of patches that the fit did not see, each left out of one.
    fn unseen_delta_e(
        sensor: &Sensor,
        light: &Illuminant,
        fit: fn(&Sensor, &Illuminant, &[Spectrum]) -> ColorMatrix,
    ) -> f64 {
        let all = Training::new(sensor, light, &chart());
        let unseen = |left_out: usize| {
            let mut others = chart();
            others.remove(left_out);
            let seen = fit(sensor, light, &others).apply(&all.channels[left_out]);
            delta_e_2000(lab_of(seen), all.lab[left_out])
        };
        (0..24).map(unseen).sum::<f64>() / 24.0
    }

    #[test]
    fn roots_come_nearer_to_colors_they_were_not_fitted_to() {
        for (name, light, most) in [("imx363", Illuminant::A, 1.9), ("nikon-d5100", Illuminant::D65, 1.1)] {
            let sensor = Sensor::built_in(name).unwrap();
            let of_matrix = unseen_delta_e(&sensor, &light, ColorMatrix::fit);
            let of_roots = unseen_delta_e(&sensor, &light, ColorMatrix::fit_roots);
            assert!(of_roots < most && of_roots < of_matrix, "{name}: {of_matrix} {of_roots}");
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
