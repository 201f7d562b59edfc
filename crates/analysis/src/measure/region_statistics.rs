//! The numbers of a region: means, noise, percentiles, uniformity, profiles and colors.

use std::path::Path;

use dioptric_scene::{Noted, read_spectral_exr};
use dioptric_spectrum::{ColorTemperature, Lab, Observer, Quantity, Xyz, delta_e_2000};
use ndarray::{Array2, ArrayView2, Axis};
use serde::Serialize;

use super::{CodeCurve, MeasuredPicture, Measurement, PixelRegion};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::PipelineError;

/// The percentiles that are stated.
const PERCENTILES: [f64; 7] = [1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0];
/// Bars of a histogram, and the sides of the blocks that tell uniformity.
const N_BARS: usize = 64;
const BLOCKS: usize = 5;

/// A region whose numbers are asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegionRequest {
    /// The region; the whole picture where it is not given.
    pub region: Option<PixelRegion>,
    /// A region of the same file whose color it is compared with.
    pub reference: Option<PixelRegion>,
}

/// The numbers of a region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegionMeasurement {
    /// The file.
    pub picture: String,
    /// The region.
    pub region: PixelRegion,
    /// What a sample is: its unit, or a share of the highest code or of saturation.
    pub unit: String,
    /// The numbers of each channel; of bands of a spectral file those of the luminance, and of the bands their means alone.
    pub channels: Vec<RegionChannel>,
    /// The mean color, where the file has one.
    pub color: Option<RegionColor>,
    /// The mean of each band of a spectral file.
    pub spectrum: Vec<BandMean>,
    /// How the mean color differs from that of the other region.
    pub difference: Option<ColorDifference>,
}

/// The numbers of one channel of a region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegionChannel {
    /// The channel.
    pub channel: String,
    /// How many samples there are.
    pub n_samples: usize,
    /// Their mean.
    pub mean: f64,
    /// One standard error of the mean, if samples are independent.
    pub mean_error: f64,
    /// Their standard deviation.
    pub deviation: f64,
    /// The standard deviation of rows' means beyond what that of single samples gives, 0 where it is less.
    pub row_deviation: f64,
    /// The same of columns.
    pub column_deviation: f64,
    /// The mean over the standard deviation; none where all samples are equal.
    pub signal_to_noise: Option<f64>,
    /// The same in decibels, 20 times its logarithm.
    pub signal_to_noise_db: Option<f64>,
    /// The least sample.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// Percents, and the samples that these do not exceed.
    pub percentiles: Vec<(f64, f64)>,
    /// The mean of the darkest of 5 × 5 blocks over that of the brightest; none where the region is smaller.
    pub uniformity: Option<f64>,
    /// The mean of each row.
    pub rows: Vec<f64>,
    /// The mean of each column.
    pub columns: Vec<f64>,
    /// How many samples lie in each of equal steps from the least to the largest.
    pub histogram: Vec<usize>,
}

/// A mean color.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RegionColor {
    /// X, Y and Z: absolute of spectral files (Y in cd/m² or lux), of pictures those of their codes with a white of Y = 1.
    pub xyz: [f64; 3],
    /// The chromaticity x, y.
    pub xy: [f64; 2],
    /// The correlated color temperature, K.
    pub cct_kelvin: f64,
    /// How far the color is from that of a black body (Duv); a temperature tells little beyond 0.05.
    pub duv: f64,
    /// L*, a*, b*: of pictures under D65, of spectral files with the white of the other region, where there is one.
    pub lab: Option<[f64; 3]>,
}

/// The mean of a band.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BandMean {
    /// The wavelength, nm.
    pub wavelength_nm: f64,
    /// The mean sample.
    pub mean: f64,
    /// Their standard deviation.
    pub deviation: f64,
}

/// How far two colors are apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColorDifference {
    /// CIE 1976, L*a*b*.
    pub delta_e_76: f64,
    /// CIE 1994, graphic arts; the other region is the standard.
    pub delta_e_94: f64,
    /// CIEDE2000.
    pub delta_e_2000: f64,
    /// CIE 1976, L*u*v*.
    pub delta_e_uv: f64,
}

impl RegionRequest {
    /// Measures a region of a file, whose samples stand for light so; with what of the file is not used, a sentence each.
    ///
    /// # Errors
    /// When the file cannot be read, or a region is not within it.
    pub fn measure_file(&self, path: &Path, curve: CodeCurve) -> Result<Noted<RegionMeasurement>, PipelineError> {
        let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        match is_exr.then(|| read_spectral_exr(path)) {
            Some(Ok(file)) => file.try_map(|file| self.measure_bands(&path.display().to_string(), &file.image)),
            _ => {
                let picture = MeasuredPicture::open(path, curve)?;
                Ok(Noted::new(self.measure(&picture)?, picture.notes))
            }
        }
    }

    fn whole((rows, columns): (usize, usize)) -> PixelRegion {
        PixelRegion { column: 0, row: 0, columns, rows }
    }

    /// Measures a region of a picture.
    ///
    /// # Errors
    /// When a region is not within it.
    pub fn measure(&self, picture: &MeasuredPicture) -> Result<RegionMeasurement, PipelineError> {
        let size = picture.size();
        let region = self.region.unwrap_or(Self::whole(size)).check_within(size)?;
        let reference = self.reference.map(|region| region.check_within(size)).transpose()?;
        let mut channels: Vec<RegionChannel> = match &picture.mosaic {
            Some((tile, names)) => {
                let plane = &picture.planes[0].1;
                let filters = names.iter().enumerate().map(|(filter, name)| {
                    let own = |(r, c): (usize, usize)| tile.filter_at(region.row + r, region.column + c) == filter;
                    RegionChannel::of_some(name, region.of(plane), own)
                });
                filters.filter(|channel| channel.n_samples > 0).collect()
            }
            None => picture
                .planes
                .iter()
                .map(|(name, plane)| RegionChannel::of_some(name, region.of(plane), |_| true))
                .collect(),
        };
        let rgb = picture.rgb().ok().filter(|_| picture.planes.len() > 1);
        if rgb.is_some() {
            let luminance = picture.luminance();
            channels.push(RegionChannel::of_some("luminance", region.of(&luminance), |_| true));
        }
        let mean_xyz = |region: PixelRegion| {
            rgb.as_ref().map(|rgb| {
                let part = region.of_picture(rgb);
                let mean = [0, 1, 2].map(|k| part.index_axis(Axis(2), k).iter().map(|v| f64::from(*v)).sum::<f64>());
                Xyz::from_linear_srgb(mean.map(|sum| sum / (region.rows * region.columns) as f64))
            })
        };
        let (own, other) = (mean_xyz(region), reference.and_then(mean_xyz));
        Ok(RegionMeasurement {
            unit: picture.unit().to_owned(),
            picture: picture.name.clone(),
            region,
            channels,
            color: own.map(|xyz| RegionColor::of(xyz, Some(Xyz::D65))),
            spectrum: Vec::new(),
            difference: own.zip(other).map(|(own, other)| ColorDifference::of(own, other, Xyz::D65)),
        })
    }

    /// Measures a region of a spectral image: luminance or illuminance, color, and the mean of each band.
    ///
    /// # Errors
    /// When a region is not within it.
    pub fn measure_bands(
        &self,
        picture: &str,
        image: &dioptric_spectrum::SpectralImage,
    ) -> Result<RegionMeasurement, PipelineError> {
        let size = (image.rows(), image.columns());
        let region = self.region.unwrap_or(Self::whole(size)).check_within(size)?;
        let reference = self.reference.map(|region| region.check_within(size)).transpose()?;
        let weights = Observer::Cie1931.weights(image.grid());
        let mut luminance = Array2::<f32>::zeros(size);
        for (plane, weight) in image.planes().iter().zip(&weights[1]) {
            luminance.scaled_add(*weight as f32, plane);
        }
        let means = |region: PixelRegion| -> Vec<(f64, f64)> {
            image
                .planes()
                .iter()
                .map(|plane| mean_and_deviation(region.of(plane).iter().map(|v| f64::from(*v))))
                .collect()
        };
        let xyz = |region: PixelRegion| {
            let means = means(region);
            Xyz(weights.each_ref().map(|w| w.iter().zip(&means).map(|(w, (mean, _))| w * mean).sum()))
        };
        let (own, white) = (xyz(region), reference.map(xyz));
        let (name, luminance_unit) = match image.quantity() {
            Quantity::Irradiance => ("illuminance", "lux"),
            _ => ("luminance", "cd/m²"),
        };
        let spectrum = image.grid().centers_nm().iter().zip(means(region));
        Ok(RegionMeasurement {
            picture: picture.to_owned(),
            region,
            unit: format!("{luminance_unit}; of bands {}", image.quantity().unit()),
            channels: vec![RegionChannel::of_some(name, region.of(&luminance), |_| true)],
            color: Some(RegionColor::of(own, white)),
            spectrum: spectrum
                .map(|(&wavelength_nm, (mean, deviation))| BandMean { wavelength_nm, mean, deviation })
                .collect(),
            // The other region is the white.
            difference: white.map(|white| ColorDifference::of(own, white, white)),
        })
    }
}

fn mean_and_deviation(samples: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = samples.clone().count() as f64;
    let mean = samples.clone().sum::<f64>() / n;
    let squares: f64 = samples.map(|v| (v - mean).powi(2)).sum();
    (mean, if n > 1.0 { (squares / (n - 1.0)).sqrt() } else { 0.0 })
}

impl RegionChannel {
    /// Returns the numbers of the samples at some places of a plane.
    fn of_some(name: &str, plane: ArrayView2<'_, f32>, is_own: impl Fn((usize, usize)) -> bool) -> Self {
        let (n_rows, n_columns) = plane.dim();
        let own = || plane.indexed_iter().filter(|(at, _)| is_own(*at)).map(|(at, v)| (at, f64::from(*v)));
        let mut samples: Vec<f64> = own().map(|(_, v)| v).collect();
        let n = samples.len();
        let (mean, deviation) = mean_and_deviation(samples.iter().copied());
        samples.sort_unstable_by(f64::total_cmp);
        let (least, most) = (samples.first().copied().unwrap_or(0.0), samples.last().copied().unwrap_or(0.0));
        let percentile = |percent: f64| (percent, samples[((n - 1) as f64 * percent / 100.0).round() as usize]);
        let mut row_sums = vec![(0.0, 0.0); n_rows];
        let mut column_sums = vec![(0.0, 0.0); n_columns];
        let mut blocks = vec![(0.0, 0.0); BLOCKS * BLOCKS];
        let mut histogram = vec![0; N_BARS];
        for ((row, column), value) in own() {
            let block = (row * BLOCKS / n_rows) * BLOCKS + column * BLOCKS / n_columns;
            for sum in [&mut row_sums[row], &mut column_sums[column], &mut blocks[block]] {
                *sum = (sum.0 + value, sum.1 + 1.0);
            }
            let share = if most > least { (value - least) / (most - least) } else { 0.0 };
            histogram[((share * N_BARS as f64) as usize).min(N_BARS - 1)] += 1;
        }
        let lines = |sums: &[(f64, f64)]| -> Vec<f64> {
            sums.iter().filter(|(_, n)| *n > 0.0).map(|(sum, n)| sum / n).collect()
        };
        let (rows, columns) = (lines(&row_sums), lines(&column_sums));
        // Of independent samples the mean of a line scatters by their deviation over the root of its length.
        let beyond = |lines: &[f64]| {
            let of_samples = deviation * deviation * lines.len() as f64 / n.max(1) as f64;
            (mean_and_deviation(lines.iter().copied()).1.powi(2) - of_samples).max(0.0).sqrt()
        };
        let block_means: Vec<f64> = blocks.iter().filter(|(_, n)| *n > 0.0).map(|(sum, n)| sum / n).collect();
        let brightest = block_means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let darkest = block_means.iter().copied().fold(f64::INFINITY, f64::min);
        let is_large = block_means.len() == BLOCKS * BLOCKS && brightest > 0.0;
        let signal_to_noise = (deviation > 0.0).then(|| mean / deviation);
        Self {
            channel: name.to_owned(),
            n_samples: n,
            mean,
            mean_error: deviation / (n.max(1) as f64).sqrt(),
            deviation,
            row_deviation: beyond(&rows),
            column_deviation: beyond(&columns),
            signal_to_noise,
            signal_to_noise_db: signal_to_noise.filter(|ratio| *ratio > 0.0).map(|ratio| 20.0 * ratio.log10()),
            least,
            most,
            percentiles: if n > 0 { PERCENTILES.into_iter().map(percentile).collect() } else { Vec::new() },
            uniformity: is_large.then(|| darkest / brightest),
            rows,
            columns,
            histogram,
        }
    }
}

impl RegionColor {
    fn of(xyz: Xyz, white: Option<Xyz>) -> Self {
        let xy = xyz.chromaticity();
        let ColorTemperature { kelvin, duv } = ColorTemperature::of_chromaticity(xy);
        let lab = white.map(|white| {
            let Lab { l, a, b } = xyz.to_lab(white);
            [l, a, b]
        });
        Self { xyz: xyz.0, xy, cct_kelvin: kelvin, duv, lab }
    }
}

impl ColorDifference {
    /// Returns the differences of a color from a standard.
    fn of(color: Xyz, standard: Xyz, white: Xyz) -> Self {
        let (lab, standard_lab) = (color.to_lab(white), standard.to_lab(white));
        let (dl, da, db) = (lab.l - standard_lab.l, lab.a - standard_lab.a, lab.b - standard_lab.b);
        let (chroma, standard_chroma) = (lab.a.hypot(lab.b), standard_lab.a.hypot(standard_lab.b));
        let dc = chroma - standard_chroma;
        let dh2 = (da * da + db * db - dc * dc).max(0.0);
        // CIE 116-1995: weights by the chroma of the standard.
        let by_chroma = dc / (1.0 + 0.045 * standard_chroma);
        let by_hue = dh2 / (1.0 + 0.015 * standard_chroma).powi(2);
        let (luv, standard_luv) = (to_luv(color, white), to_luv(standard, white));
        Self {
            delta_e_76: dl.hypot(da).hypot(db),
            delta_e_94: (dl * dl + by_chroma * by_chroma + by_hue).sqrt(),
            delta_e_2000: delta_e_2000(standard_lab, lab),
            delta_e_uv: (0..3).map(|i| (luv[i] - standard_luv[i]).powi(2)).sum::<f64>().sqrt(),
        }
    }
}

/// Returns L*, u*, v* (CIE 15:2018, 8.2.2).
fn to_luv(xyz: Xyz, white: Xyz) -> [f64; 3] {
    let uv = |Xyz([x, y, z]): Xyz| {
        let sum = x + 15.0 * y + 3.0 * z;
        if sum > 0.0 { [4.0 * x / sum, 9.0 * y / sum] } else { [0.0; 2] }
    };
    let l = xyz.to_lab(white).l;
    let (own, of_white) = (uv(xyz), uv(white));
    [l, 13.0 * l * (own[0] - of_white[0]), 13.0 * l * (own[1] - of_white[1])]
}

impl Measurement for RegionMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let profile = |name: &str, title: &str, of: &dyn Fn(&RegionChannel) -> Vec<f64>, first: usize| {
            let series = self.channels.iter().map(|channel| Series {
                label: Some(channel.channel.clone()),
                color: palette::channel(&channel.channel),
                points: of(channel).into_iter().enumerate().map(|(i, v)| ((first + i) as f64, v)).collect(),
                is_dashed: channel.channel == "luminance",
            });
            (name.to_owned(), chart(title, (&format!("{name} of pixels"), "mean"), series.collect()))
        };
        let mut charts = vec![
            profile("columns", "Means of columns", &|channel| channel.columns.clone(), self.region.column),
            profile("rows", "Means of rows", &|channel| channel.rows.clone(), self.region.row),
        ];
        let bars = self.channels.iter().map(|channel| {
            let step = (channel.most - channel.least) / N_BARS as f64;
            let at = |i: usize| channel.least + (i as f64 + 0.5) * step;
            Series {
                label: Some(channel.channel.clone()),
                color: palette::channel(&channel.channel),
                points: channel.histogram.iter().enumerate().map(|(i, n)| (at(i), *n as f64)).collect(),
                is_dashed: channel.channel == "luminance",
            }
        });
        charts.push(("histogram".to_owned(), chart("Histogram", ("sample", "samples a step"), bars.collect())));
        if !self.spectrum.is_empty() {
            let points = self.spectrum.iter().map(|band| (band.wavelength_nm, band.mean)).collect();
            let line = Series { label: None, color: palette::line(0), points, is_dashed: false };
            charts.push(("spectrum".to_owned(), chart("Mean spectrum", ("wavelength, nm", "mean"), vec![line])));
        }
        charts
    }
}

/// Returns a chart whose axes hold all points.
fn chart(title: &str, (x_label, y_label): (&str, &str), series: Vec<Series>) -> LineChart {
    let range = |of: fn(&(f64, f64)) -> f64| {
        let all = || series.iter().flat_map(|line| &line.points).map(of);
        let (least, most) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        if most > least { (least, most) } else { (least.min(0.0), least.max(0.0) + 1.0) }
    };
    let (x_range, (least, most)) = (range(|point| point.0), range(|point| point.1));
    let margin = 0.05 * (most - least);
    LineChart {
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        x_range,
        y_range: (least - margin, most + margin),
        series,
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_in_comes_back() {
        // A plane of 5 + rows of ±1 + a slope over columns, without noise.
        let plane =
            Array2::from_shape_fn((40, 60), |(r, c)| 5.0 + if r % 2 == 0 { 1.0 } else { -1.0 } + 0.1 * c as f32);
        let channel = RegionChannel::of_some("Y", plane.view(), |_| true);
        assert!((channel.mean - (5.0 + 0.1 * 29.5)).abs() < 1e-5);
        // Variances of ±1, and of sixty steps of a tenth.
        let wanted = (1.0_f64 + 0.01 * (60.0 * 60.0 - 1.0) / 12.0).sqrt();
        assert!((channel.deviation / wanted - 1.0).abs() < 1e-3, "{} {wanted}", channel.deviation);
        assert_eq!((channel.rows.len(), channel.columns.len(), channel.n_samples), (40, 60, 2400));
        assert!((channel.signal_to_noise.unwrap() - channel.mean / channel.deviation).abs() < 1e-12);
        assert_eq!(channel.histogram.iter().sum::<usize>(), 2400);
        assert!((channel.percentiles[3].1 - channel.mean).abs() < 1.1);
        // Twelve columns a block: the first and last block differ by 48 steps.
        let uniformity = (5.0 + 0.55) / (5.0 + 0.1 * 53.5);
        assert!((channel.uniformity.unwrap() - uniformity).abs() < 1e-3, "{:?} {uniformity}", channel.uniformity);
    }

    #[test]
    fn rows_of_their_own_are_told_from_noise() {
        let mut state = 7_u64;
        let mut noise = || {
            // Twelve even numbers sum to a nearly normal one of variance 1.
            (0..12)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 11) as f64 / (1_u64 << 53) as f64
                })
                .sum::<f64>()
                - 6.0
        };
        let offsets: Vec<f64> = (0..200).map(|_| 0.5 * noise()).collect();
        let plane = Array2::from_shape_fn((200, 200), |(r, _)| (100.0 + offsets[r] + noise()) as f32);
        let channel = RegionChannel::of_some("Y", plane.view(), |_| true);
        // 200 rows tell their deviation to 5 %.
        assert!((channel.row_deviation / 0.5 - 1.0).abs() < 0.15, "{}", channel.row_deviation);
        assert!(channel.column_deviation < 0.05, "{}", channel.column_deviation);
    }

    #[test]
    fn differences_are_those_of_the_literature() {
        // A gray of L* 50 and another of 60 differ by 10 in both 1976 formulas and by 10 in that of 1994.
        let gray = |l: f64| Xyz(Xyz::D65.0.map(|v| v * ((l + 16.0) / 116.0).powi(3)));
        let of = ColorDifference::of(gray(60.0), gray(50.0), Xyz::D65);
        for value in [of.delta_e_76, of.delta_e_94, of.delta_e_uv] {
            assert!((value - 10.0).abs() < 1e-9, "{of:?}");
        }
        // A color of chroma 40 against one of chroma 50 and equal hue: 10 / (1 + 0.045 × 50).
        let lab = |a: f64| {
            // L* 50: Y of the gray; X by a*.
            let f = 66.0 / 116.0;
            Xyz([Xyz::D65.0[0] * (f + a / 500.0_f64).powi(3), gray(50.0).0[1], gray(50.0).0[2]])
        };
        let of = ColorDifference::of(lab(40.0), lab(50.0), Xyz::D65);
        assert!((of.delta_e_76 - 10.0).abs() < 1e-9 && (of.delta_e_94 - 10.0 / 3.25).abs() < 1e-9, "{of:?}");
    }
}
