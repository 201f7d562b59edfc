//! Shading of an even plane (ISO 17957): how luminance and color change over the field.

use std::path::Path;

use dioptric_pipeline::PipelineError;
use ndarray::Array2;
use serde::Serialize;

use super::{CodeCurve, MeasuredPicture, Measurement};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_spectrum::Xyz;

/// Blocks across and down.
const BLOCKS: usize = 15;
/// The fewest pixels a block has on a side.
const FEWEST: usize = 4;
/// The share of samples at the ends of the codes from which on a frame is refused.
const CLIPPED: f64 = 0.01;

/// How an even plane is measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadingRequest {
    /// How samples stand for light.
    pub curve: CodeCurve,
}

/// The shading of a picture of an even plane.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShadingMeasurement {
    /// The file.
    pub picture: String,
    /// The blocks across and down, whose means these numbers are of.
    pub blocks: [usize; 2],
    /// The shading of each channel; of a mosaic each filter by itself.
    pub channels: Vec<ShadingChannel>,
    /// The largest distance in a* b* between a block and the brightest one, both at its luminance; none without colors.
    pub color_shading: Option<f64>,
}

/// The shading of one channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShadingChannel {
    /// The channel.
    pub channel: String,
    /// The largest block mean less the least one, of the largest, percent.
    pub shading_percent: f64,
    /// The four corner blocks over the middle one: top left, top right, bottom left, bottom right.
    pub corners: [f64; 4],
    /// The brightest block: column and row of its middle, pixels.
    pub brightest_px: [f64; 2],
    /// The mean of each block over that of the brightest, a row a row of blocks.
    pub map: Vec<Vec<f64>>,
    /// One standard error of a block by the noise of its pixels, percent.
    pub error_percent: f64,
}

impl ShadingRequest {
    /// Measures the shading of a picture file that shows an even plane.
    ///
    /// # Errors
    /// When the file cannot be read, is smaller than its blocks, has no light, or more than 1 % of its samples at the ends of the codes.
    pub fn measure(&self, path: &Path) -> Result<ShadingMeasurement, PipelineError> {
        let picture = MeasuredPicture::open(path, self.curve)?;
        let in_file = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
        let (rows, columns) = picture.size();
        let period = picture.mosaic.as_ref().map_or(1, |(tile, _)| tile.rows().max(tile.columns()));
        let smallest = BLOCKS * FEWEST * period;
        if rows < smallest || columns < smallest {
            return Err(in_file(format!(
                "has {columns} × {rows} pixels, expected {smallest} × {smallest} or more for shading"
            )));
        }
        let clipped = picture.clipped_share();
        if clipped > CLIPPED {
            return Err(in_file(format!(
                "has {:.1} % of its samples at 0 or at the highest code, expected an exposure between: shading would look less than it is",
                100.0 * clipped
            )));
        }
        let mut channels = Vec::new();
        for (name, plane, is_own) in picture.filters() {
            channels.push(
                ShadingChannel::of(&name, plane, &is_own).ok_or_else(|| in_file(format!("has no light in {name}")))?,
            );
        }
        let mut color_shading = None;
        if picture.planes.len() > 1
            && let Ok(rgb) = picture.rgb()
        {
            let luminance = picture.luminance();
            let own = ShadingChannel::of("luminance", &luminance, &|_| true)
                .ok_or_else(|| in_file("has no light".to_owned()))?;
            let planes = [0, 1, 2].map(|k| rgb.index_axis(ndarray::Axis(2), k).to_owned());
            color_shading = Some(color_shading_of(&planes));
            channels.push(own);
        }
        Ok(ShadingMeasurement { picture: picture.name.clone(), blocks: [BLOCKS; 2], channels, color_shading })
    }
}

/// Returns the mean, the variance and the number of the samples of each block that are a channel's own.
fn blocks(plane: &Array2<f32>, is_own: &dyn Fn((usize, usize)) -> bool) -> Vec<(f64, f64, f64)> {
    let (rows, columns) = plane.dim();
    let mut sums = vec![(0.0, 0.0, 0.0); BLOCKS * BLOCKS];
    for (at, &v) in plane.indexed_iter().filter(|(at, _)| is_own(*at)) {
        let sum = &mut sums[at.0 * BLOCKS / rows * BLOCKS + at.1 * BLOCKS / columns];
        let v = f64::from(v);
        *sum = (sum.0 + v, sum.1 + v * v, sum.2 + 1.0);
    }
    sums.into_iter().map(|(sum, squares, n)| (sum / n, (squares / n - (sum / n).powi(2)).max(0.0), n)).collect()
}

impl ShadingChannel {
    fn of(name: &str, plane: &Array2<f32>, is_own: &dyn Fn((usize, usize)) -> bool) -> Option<Self> {
        let blocks = blocks(plane, is_own);
        let (brightest, &(most, ..)) = blocks.iter().enumerate().max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        if most.is_nan() || most <= 0.0 {
            return None;
        }
        let least = blocks.iter().map(|(mean, ..)| *mean).fold(f64::INFINITY, f64::min);
        let middle = blocks[BLOCKS / 2 * BLOCKS + BLOCKS / 2].0;
        let error = blocks.iter().map(|(_, variance, n)| variance / n).sum::<f64>() / blocks.len() as f64;
        let (rows, columns) = plane.dim();
        let place = |i: usize, n: usize| (i as f64 + 0.5) * n as f64 / BLOCKS as f64 - 0.5;
        Some(Self {
            channel: name.to_owned(),
            shading_percent: 100.0 * (most - least) / most,
            corners: [0, BLOCKS - 1, (BLOCKS - 1) * BLOCKS, BLOCKS * BLOCKS - 1].map(|block| blocks[block].0 / middle),
            brightest_px: [place(brightest % BLOCKS, columns), place(brightest / BLOCKS, rows)],
            map: blocks.chunks_exact(BLOCKS).map(|row| row.iter().map(|(mean, ..)| mean / most).collect()).collect(),
            error_percent: 100.0 * error.sqrt() / most,
        })
    }
}

/// Returns the largest distance in a* b* of a block from the brightest, each block as bright as that.
fn color_shading_of(planes: &[Array2<f32>; 3]) -> f64 {
    let of_planes = planes.each_ref().map(|plane| blocks(plane, &|_| true));
    let xyz: Vec<Xyz> =
        (0..BLOCKS * BLOCKS).map(|i| Xyz::from_linear_srgb([0, 1, 2].map(|k| of_planes[k][i].0))).collect();
    let brightest = xyz.iter().max_by(|a, b| a.0[1].total_cmp(&b.0[1])).copied().unwrap_or(Xyz::D65);
    // L* 50, where the brightest block is the gray of a card.
    let as_bright = |own: Xyz| Xyz(own.0.map(|v| 0.184 * v / own.0[1].max(f64::MIN_POSITIVE))).to_lab(Xyz::D65);
    let wanted = as_bright(brightest);
    let distance = |own: &Xyz| {
        let lab = as_bright(*own);
        (lab.a - wanted.a).hypot(lab.b - wanted.b)
    };
    xyz.iter().map(distance).fold(0.0, f64::max)
}

impl Measurement for ShadingMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let series = self.channels.iter().map(|channel| Series {
            label: Some(channel.channel.clone()),
            color: palette::channel(&channel.channel),
            // From the top left corner to the bottom right one.
            points: (0..BLOCKS).map(|i| (i as f64 / (BLOCKS - 1) as f64, channel.map[i][i])).collect(),
            is_dashed: channel.channel == "luminance",
        });
        let least = self.channels.iter().map(|channel| 1.0 - channel.shading_percent / 100.0).fold(1.0, f64::min);
        let chart = LineChart {
            title: "Shading along the diagonal".to_owned(),
            x_label: "share of the diagonal, from the top left".to_owned(),
            y_label: "light, of the brightest block".to_owned(),
            x_range: (0.0, 1.0),
            y_range: (0.95 * least, 1.02),
            series: series.collect(),
            legend: Corner::BottomLeft,
            scale: Scale::Linear,
        };
        vec![("shading".to_owned(), chart)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_light_has_its_shading() {
        // 1 − 0.4 r² of half the diagonal, brightest in the middle; red falls more.
        let falls = |k: f64| {
            Array2::from_shape_fn((300, 450), |(r, c)| {
                let squared =
                    ((r as f64 - 149.5).powi(2) + (c as f64 - 224.5).powi(2)) / (150.0_f64.powi(2) + 225.0_f64.powi(2));
                (0.6 * (1.0 - k * squared)) as f32
            })
        };
        let channel = ShadingChannel::of("Y", &falls(0.4), &|_| true).unwrap();
        // The corner block's middle lies 14/15 out, and its mean is that of its own spread too: a fifteenth squared over 3.
        let corner = 1.0 - 0.4 * ((14.0_f64 / 15.0).powi(2) + (1.0_f64 / 15.0).powi(2) / 3.0);
        let middle = 1.0 - 0.4 * (1.0_f64 / 15.0).powi(2) / 3.0;
        for found in channel.corners {
            assert!((found / (corner / middle) - 1.0).abs() < 1e-3, "{found} {corner}");
        }
        assert!(
            (channel.shading_percent / (100.0 * (1.0 - corner / middle)) - 1.0).abs() < 2e-3,
            "{}",
            channel.shading_percent
        );
        assert!((channel.brightest_px[0] - 224.5).abs() < 1.0 && (channel.brightest_px[1] - 149.5).abs() < 1.0);
        assert!(color_shading_of(&[falls(0.4), falls(0.4), falls(0.4)]) < 1e-3);
        assert!(color_shading_of(&[falls(0.6), falls(0.4), falls(0.4)]) > 5.0);
    }
}
