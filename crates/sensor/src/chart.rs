//! Colors of the 24-patch chart in a picture, against what they should be.

use dioptric_spectrum::{Illuminant, Observer, Xyz, adapt_bradford, color_checker_reflectances, delta_e_2000};
use ndarray::Array3;

use crate::{SensorError, balance::fine_grid};

/// What a picture makes of the 24 patches.
#[derive(Clone, Debug, PartialEq)]
pub struct ChartReport {
    /// The mean linear sRGB of each patch, row by row from dark skin to black, with the white patch at its luminance.
    pub linear_srgb: Vec<[f64; 3]>,
    /// What the observer sees of each patch: linear sRGB, which has parts below 0 for a color beyond its primaries.
    pub wanted_linear_srgb: Vec<[f64; 3]>,
    /// ΔE₀₀ of each patch.
    pub delta_e: Vec<f64>,
}

impl ChartReport {
    /// Measures the patches in linear light of sRGB's primaries.
    ///
    /// `corners` are the chart's corners, as row and column: beside dark skin, bluish green, black and white (clockwise
    /// from the top left of an upright chart). The middle third of each patch is averaged. What is wanted is what the
    /// 1931 observer sees under `light`, moved to a white of D65; the exposure, a free factor, is set by the white patch.
    ///
    /// # Errors
    /// When the chart is not within the picture or its patches are smaller than three pixels.
    pub fn measure(light_rgb: &Array3<f32>, corners: [(f64, f64); 4], light: &Illuminant) -> Result<Self, SensorError> {
        let wanted = wanted(light);
        let mut means = (0..24).map(|patch| patch_mean(light_rgb, corners, patch)).collect::<Result<Vec<_>, _>>()?;
        let white = Xyz::from_linear_srgb(means[18]).luminance_cd_m2();
        if white.is_nan() || white <= 0.0 {
            let reason = "has no light on its white patch".to_owned();
            return Err(SensorError::Unsuitable { what: "the chart", reason });
        }
        let scale = wanted[18].luminance_cd_m2() / white;
        means.iter_mut().for_each(|rgb| *rgb = rgb.map(|v| v * scale));
        let lab = |rgb: &[f64; 3]| Xyz::from_linear_srgb(*rgb).to_lab(Xyz::D65);
        let delta_e = means.iter().zip(&wanted).map(|(rgb, wanted)| delta_e_2000(lab(rgb), wanted.to_lab(Xyz::D65)));
        let delta_e = delta_e.collect();
        let wanted_linear_srgb = wanted.iter().map(|xyz| xyz.to_linear_srgb()).collect();
        Ok(Self { linear_srgb: means, wanted_linear_srgb, delta_e })
    }

    /// The mean ΔE₀₀.
    pub fn mean_delta_e(&self) -> f64 {
        self.delta_e.iter().sum::<f64>() / self.delta_e.len() as f64
    }

    /// The median ΔE₀₀.
    pub fn median_delta_e(&self) -> f64 {
        let mut sorted = self.delta_e.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        0.5 * (sorted[(n - 1) / 2] + sorted[n / 2])
    }

    /// The largest ΔE₀₀.
    pub fn max_delta_e(&self) -> f64 {
        self.delta_e.iter().copied().fold(0.0, f64::max)
    }
}

/// Returns XYZ of the patches under a light, moved to D65, white having Y = 1.
fn wanted(light: &Illuminant) -> Vec<Xyz> {
    let grid = fine_grid();
    let values = light.spectrum().sample_held(&grid);
    let white = Observer::Cie1931.xyz(&grid, &values);
    let relative = |xyz: Xyz| Xyz(xyz.0.map(|v| v / white.0[1]));
    let patch = |reflectance: &dioptric_spectrum::Spectrum| {
        let lit: Vec<f64> = reflectance.sample_held(&grid).iter().zip(&values).map(|(r, s)| r * s).collect();
        adapt_bradford(relative(Observer::Cie1931.xyz(&grid, &lit)), relative(white), Xyz::D65)
    };
    color_checker_reflectances().iter().map(|(_, reflectance)| patch(reflectance)).collect()
}

fn patch_mean(picture: &Array3<f32>, corners: [(f64, f64); 4], patch: usize) -> Result<[f64; 3], SensorError> {
    let (rows, columns, _) = picture.dim();
    // A place of the chart, 0–1 across and down, between its corners.
    let place = |across: f64, down: f64| {
        let mix = |a: f64, b: f64, c: f64, d: f64| {
            (a * (1.0 - across) + b * across) * (1.0 - down) + (d * (1.0 - across) + c * across) * down
        };
        let [tl, tr, br, bl] = corners;
        (mix(tl.0, tr.0, br.0, bl.0), mix(tl.1, tr.1, br.1, bl.1))
    };
    let (mut sum, mut n) = ([0.0; 3], 0.0);
    let mut seen = std::collections::BTreeSet::new();
    const STEPS: usize = 32;
    for i in 0..STEPS * STEPS {
        let share = |k: usize| (1.0 + (k as f64 + 0.5) / STEPS as f64) / 3.0;
        let across = ((patch % 6) as f64 + share(i % STEPS)) / 6.0;
        let down = ((patch / 6) as f64 + share(i / STEPS)) / 4.0;
        let (row, column) = place(across, down);
        let (row, column) = (row.round(), column.round());
        if row < 0.0 || column < 0.0 || row >= rows as f64 || column >= columns as f64 {
            let (expected, found) = (format!("within {rows} × {columns}"), format!("row {row}, column {column}"));
            return Err(SensorError::Shape { what: "place of a chart's patch", expected, found });
        }
        let at = (row as usize, column as usize);
        if seen.insert(at) {
            sum.iter_mut().enumerate().for_each(|(k, sum)| *sum += f64::from(picture[(at.0, at.1, k)]));
            n += 1.0;
        }
    }
    Ok(sum.map(|v| v / n))
}
