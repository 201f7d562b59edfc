//! Colors of the 24-patch chart in a picture, against what they should be.

use dioptric_spectrum::{Illuminant, Observer, Xyz, adapt_bradford, color_checker_reflectances, delta_e_2000};
use ndarray::Array3;

use crate::{SensorError, white_light::fine_grid};

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
        median(&self.delta_e)
    }

    /// The largest ΔE₀₀.
    pub fn max_delta_e(&self) -> f64 {
        self.delta_e.iter().copied().fold(0.0, f64::max)
    }

    /// Returns how many times as bright each patch is as it should be, of the median of all, which some hidden patches do not move.
    fn brightness(&self) -> Vec<f64> {
        let luminance = |rgb: &[f64; 3]| Xyz::from_linear_srgb(*rgb).luminance_cd_m2();
        let pairs = self.linear_srgb.iter().zip(&self.wanted_linear_srgb);
        let ratios: Vec<f64> = pairs.map(|(found, wanted)| luminance(found).max(0.0) / luminance(wanted)).collect();
        let median = median(&ratios);
        ratios.iter().map(|ratio| if median > 0.0 { ratio / median } else { f64::INFINITY }).collect()
    }

    /// The rms of the patches' brightness about what the median of all makes them, stops: unevenness of the light, errors of
    /// the curve and patches that something hides. Patches darker than a tenth of white, where flare is much, do not count.
    pub fn brightness_spread_stops(&self) -> f64 {
        let is_bright = |rgb: &&[f64; 3]| Xyz::from_linear_srgb(**rgb).luminance_cd_m2() > 0.1;
        let bright = self.brightness().into_iter().zip(&self.wanted_linear_srgb).filter(|(_, rgb)| is_bright(rgb));
        let squares: Vec<f64> = bright.map(|(ratio, _)| ratio.log2().powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    /// The patches, from 0, that cannot be those of the chart: more than twice as bright or dark as all together make them, and off by
    /// more than a twentieth of white. Something hides or shades them, they are clipped, or the corners are others.
    pub fn misfits(&self) -> Vec<usize> {
        let wanted = self.wanted_linear_srgb.iter().map(|rgb| Xyz::from_linear_srgb(*rgb).luminance_cd_m2());
        let is_off =
            |(ratio, wanted): (f64, f64)| !(0.5..=2.0).contains(&ratio) && ((ratio - 1.0) * wanted).abs() > 0.05;
        let ratios = self.brightness().into_iter().zip(wanted).enumerate();
        ratios.filter(|(_, pair)| is_off(*pair)).map(|(patch, _)| patch).collect()
    }
}

/// Returns the median of values, or NaN of none.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n => 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]),
    }
}

/// Returns XYZ of the patches under a light, moved to D65, white having Y = 1.
fn wanted(light: &Illuminant) -> Vec<Xyz> {
    let grid = fine_grid();
    let values = light.on_bands(&grid);
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

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_spectrum::Lab;

    const SIDE: usize = 12;
    const CORNERS: [(f64, f64); 4] = [(-0.5, -0.5), (-0.5, 71.5), (47.5, 71.5), (47.5, -0.5)];

    /// The chart as an observer sees it under a light, `scale` times as bright, with something else on the borders of patches.
    fn chart(light: &Illuminant, scale: f64) -> Array3<f32> {
        let colors = wanted(light).into_iter().map(Xyz::to_linear_srgb).collect::<Vec<_>>();
        Array3::from_shape_fn((4 * SIDE, 6 * SIDE, 3), |(row, column, k)| {
            let is_border = |i: usize| !(3..9).contains(&(i % SIDE));
            match is_border(row) || is_border(column) {
                true => 0.7,
                false => (scale * colors[6 * (row / SIDE) + column / SIDE][k]) as f32,
            }
        })
    }

    fn lab(rgb: [f64; 3]) -> Lab {
        Xyz::from_linear_srgb(rgb).to_lab(Xyz::D65)
    }

    #[test]
    fn the_chart_itself_is_without_error() {
        for light in [Illuminant::D65, Illuminant::A] {
            let report = ChartReport::measure(&chart(&light, 0.37), CORNERS, &light).unwrap();
            assert_eq!((report.delta_e.len(), report.linear_srgb.len(), report.wanted_linear_srgb.len()), (24, 24, 24));
            // Single precision; the white of sRGB has five digits.
            assert!(report.max_delta_e() < 2e-3, "{light:?}: {:?}", report.delta_e);
            for (found, wanted) in report.linear_srgb.iter().zip(&report.wanted_linear_srgb) {
                assert!(found.iter().zip(wanted).all(|(f, w)| (f - w).abs() < 1e-5), "{found:?} {wanted:?}");
            }
        }
        // White is neutral under every light, and as bright as its reflectance.
        let report = ChartReport::measure(&chart(&Illuminant::A, 1.0), CORNERS, &Illuminant::A).unwrap();
        let [r, g, b] = report.wanted_linear_srgb[18];
        assert!((0.85..0.95).contains(&g) && (r - g).abs() < 0.03 && (b - g).abs() < 0.05, "{r} {g} {b}");
        // The light matters: what was taken under A is off under D65.
        let wrong = ChartReport::measure(&chart(&Illuminant::A, 1.0), CORNERS, &Illuminant::D65).unwrap();
        assert!(wrong.mean_delta_e() > 1.0);
    }

    #[test]
    fn a_wrong_patch_has_its_difference() {
        let mut picture = chart(&Illuminant::D65, 1.0);
        let darker = |rgb: [f64; 3]| [0.5 * rgb[0], rgb[1], rgb[2]];
        let colors = wanted(&Illuminant::D65).into_iter().map(Xyz::to_linear_srgb).collect::<Vec<_>>();
        for patch in [3, 14, 20] {
            let (top, left) = (SIDE * (patch / 6), SIDE * (patch % 6));
            picture.slice_mut(ndarray::s![top + 3..top + 9, left + 3..left + 9, 0]).mapv_inplace(|v| 0.5 * v);
        }
        let report = ChartReport::measure(&picture, CORNERS, &Illuminant::D65).unwrap();
        for (patch, color) in colors.iter().enumerate() {
            let changed = if [3, 14, 20].contains(&patch) { darker(*color) } else { *color };
            let expected = delta_e_2000(lab(changed), lab(*color));
            assert!((report.delta_e[patch] - expected).abs() < 2e-3, "{patch}: {}", report.delta_e[patch]);
        }
        assert!(report.max_delta_e() > 5.0 && report.median_delta_e() < 2e-3);
    }

    #[test]
    fn a_turned_chart_is_the_same() {
        let upright = chart(&Illuminant::D65, 1.0);
        let turned = upright.slice(ndarray::s![..;-1, ..;-1, ..]).to_owned();
        let corners = [CORNERS[2], CORNERS[3], CORNERS[0], CORNERS[1]];
        let found = ChartReport::measure(&turned, corners, &Illuminant::D65).unwrap();
        assert!(found.max_delta_e() < 2e-3, "{:?}", found.delta_e);
        // Read upright its dark skin is the black.
        let wrong = ChartReport::measure(&turned, CORNERS, &Illuminant::D65).unwrap();
        assert!(wrong.delta_e[0] > 10.0);
    }

    #[test]
    fn hidden_patches_do_not_fit() {
        // Unlike what a camera does to all of them: an exposure, flare of 1 % of white, a cast, light that falls off by half.
        let upright = chart(&Illuminant::D65, 1.0);
        let seen = Array3::from_shape_fn(upright.dim(), |(row, column, k)| {
            let light = [0.5, 0.4, 0.3][k] * (1.0 - 0.5 * column as f32 / 71.0);
            light * (upright[(row, column, k)] + 0.01)
        });
        let measured = |picture: &Array3<f32>| ChartReport::measure(picture, CORNERS, &Illuminant::D65).unwrap();
        let whole = measured(&seen);
        assert_eq!((whole.misfits(), measured(&upright).brightness_spread_stops() < 1e-4), (vec![], true));
        assert!((0.2..0.4).contains(&whole.brightness_spread_stops()), "{}", whole.brightness_spread_stops());
        // A white vase before the first column, the white patch too.
        let mut hidden = seen;
        hidden.slice_mut(ndarray::s![.., ..SIDE, ..]).fill(0.9);
        let report = measured(&hidden);
        assert_eq!(report.misfits(), [0, 6, 12, 18]);
        assert!(report.brightness_spread_stops() > 0.5);
    }

    #[test]
    fn mean_median_and_largest_differ() {
        let of = |delta_e: &[f64]| ChartReport {
            linear_srgb: Vec::new(),
            wanted_linear_srgb: Vec::new(),
            delta_e: delta_e.to_vec(),
        };
        let even = of(&[3.0, 1.0, 2.0, 10.0]);
        assert_eq!((even.mean_delta_e(), even.median_delta_e(), even.max_delta_e()), (4.0, 2.5, 10.0));
        assert_eq!(of(&[5.0, 1.0, 3.0]).median_delta_e(), 3.0);
    }

    #[test]
    fn dark_and_absent_charts_are_refused() {
        let picture = chart(&Illuminant::D65, 1.0);
        let measured = |picture: &Array3<f32>, corners| ChartReport::measure(picture, corners, &Illuminant::D65);
        let mut dark = picture.clone();
        // The white patch is the first of the last row.
        dark.slice_mut(ndarray::s![3 * SIDE.., ..SIDE, ..]).fill(0.0);
        assert!(measured(&dark, CORNERS).unwrap_err().to_string().contains("no light"));
        for (row, column) in [(-20.0, 0.0), (0.0, -20.0), (30.0, 0.0), (0.0, 30.0)] {
            let moved = CORNERS.map(|(r, c)| (r + row, c + column));
            assert!(measured(&picture, moved).unwrap_err().to_string().contains("within 48 × 72"), "{row} {column}");
        }
    }
}
