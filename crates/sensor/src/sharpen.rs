//! Capture sharpening: the blur of lens and pixel undone, as far as noise and halos allow.
//!
//! The luminance of balanced channels is filtered by the regularized inverse of a Gaussian blur (Wiener's filter for a constant
//! ratio of noise to signal), the detail that this adds is held against the noise of the frame, and what is left may go a little
//! beyond the range of the neighboring pixels and no farther. All channels are multiplied by the same factor, which keeps their
//! color.

use ndarray::{Array2, ArrayView1};
use rayon::prelude::*;

use crate::{denoise::SampleNoise, plane_rows::plane_rows};

/// The largest gain along one axis; in the corners of the spectrum the gains of both multiply.
const MOST_GAIN: f64 = 2.5;
/// Half the number of taps of the filter.
const REACH: usize = 6;
/// Detail of fewer standard deviations of its noise is left out, and what is left is shrunk as in denoising: d − t² / d.
const DEVIATIONS: f32 = 2.5;
/// How far beyond the range of the pixels about it a pixel may go, as a share of that range; and how far these pixels lie.
const OVERSHOOT: f32 = 0.1;
const ABOUT: usize = 2;
/// The largest factor on a pixel, and one over the smallest.
const MOST_FACTOR: f32 = 4.0;

/// What sharpening knows of the channels.
pub(crate) struct SharpenedChannels<'a> {
    /// The share of each balanced channel in luminance; they sum to 1 where white is balanced.
    pub(crate) luminance: &'a [f64],
    /// The factor by which each channel was balanced.
    pub(crate) balance: &'a [f64],
    /// The noise of samples before that.
    pub(crate) noise: &'a SampleNoise,
}

/// Sharpens channels that were blurred by a Gaussian of this standard deviation.
pub(crate) fn sharpen(channels: &mut [Array2<f32>], blur_px: f64, of: &SharpenedChannels<'_>) {
    let luminance = weighted_sum(channels, of.luminance);
    let taps = inverse_taps(blur_px);
    let sharp = filtered_down(&filtered_across(&luminance, &taps), &taps);
    let noise = NoiseTable::new(of, detail_noise(&taps));
    let (rows, columns) = luminance.dim();
    let ranges = ranges_across(&luminance);
    let mut lines = plane_rows(channels);
    lines.par_iter_mut().enumerate().for_each(|(row, line)| {
        let about = row.saturating_sub(ABOUT)..(row + ABOUT + 1).min(rows);
        let mut ranges_of_row = vec![NOTHING; columns];
        for row in about {
            ranges_of_row.iter_mut().zip(ranges.row(row)).for_each(|(range, beside)| *range = wider(*range, *beside));
        }
        let factors: Vec<f32> = luminance
            .row(row)
            .iter()
            .zip(sharp.row(row))
            .zip(ranges_of_row)
            .map(|((&old, &new), [low, high])| {
                let (detail, threshold) = (new - old, DEVIATIONS * noise.deviation(old));
                let kept = if detail.abs() > threshold { detail - threshold * threshold / detail } else { 0.0 };
                let beyond = OVERSHOOT * (high - low);
                let wanted = (old + kept).clamp(low - beyond, high + beyond);
                if old > 0.0 { (wanted / old).clamp(1.0 / MOST_FACTOR, MOST_FACTOR) } else { 1.0 }
            })
            .collect();
        for plane in line {
            plane.iter_mut().zip(&factors).for_each(|(value, factor)| *value *= factor);
        }
    });
}

fn weighted_sum(planes: &[Array2<f32>], weights: &[f64]) -> Array2<f32> {
    let mut sum = Array2::zeros(planes[0].dim());
    let columns = sum.ncols();
    let lines = sum.as_slice_mut().expect("a new array is contiguous").par_chunks_mut(columns);
    lines.enumerate().for_each(|(row, line)| {
        for (plane, &weight) in planes.iter().zip(weights) {
            line.iter_mut().zip(plane.row(row)).for_each(|(sum, v)| *sum += weight as f32 * v);
        }
    });
    sum
}

const NOTHING: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

fn wider([low, high]: [f32; 2], [other_low, other_high]: [f32; 2]) -> [f32; 2] {
    [low.min(other_low), high.max(other_high)]
}

/// Returns the lowest and the highest value about each place of a row.
fn ranges_across(plane: &Array2<f32>) -> Array2<[f32; 2]> {
    let mut ranges = Array2::from_elem(plane.dim(), NOTHING);
    ranges.outer_iter_mut().into_par_iter().zip(plane.outer_iter()).for_each(|(mut to, from)| {
        let padded = padded(from, ABOUT);
        let windows = padded.windows(2 * ABOUT + 1);
        to.iter_mut().zip(windows).for_each(|(range, about)| {
            *range = about.iter().fold(NOTHING, |range, &v| wider(range, [v, v]));
        });
    });
    ranges
}

/// Returns a row that goes on as at its ends, so many places at each.
fn padded(row: ArrayView1<'_, f32>, reach: usize) -> Vec<f32> {
    let first = std::iter::repeat_n(row[0], reach);
    let last = std::iter::repeat_n(row[row.len() - 1], reach);
    first.chain(row.iter().copied()).chain(last).collect()
}

/// Returns the taps, −[`REACH`] to [`REACH`], of the regularized inverse of a Gaussian blur: H / (H² + k) over its value at 0, k
/// so that no gain is larger than [`MOST_GAIN`].
fn inverse_taps(blur_px: f64) -> Vec<f32> {
    const N: usize = 2048;
    // The largest of H / (H² + k) is 1 / (2 √k), and at 0 it is 1 / (1 + k).
    let g = MOST_GAIN;
    let k = (g - (g * g - 1.0).sqrt()).powi(2);
    let gain = |omega: f64| {
        let h = (-0.5 * (blur_px * omega).powi(2)).exp();
        (1.0 + k) * h / (h * h + k)
    };
    let step = std::f64::consts::PI / N as f64;
    let tap = |x: f64| {
        let sum: f64 = (0..N).map(|i| (i as f64 + 0.5) * step).map(|omega| gain(omega) * (omega * x).cos()).sum();
        // The end of the taps is faded, or it would ring.
        let fade = (0.5 * std::f64::consts::PI * x / (REACH as f64 + 1.0)).cos().powi(2);
        fade * sum / N as f64
    };
    let taps: Vec<f64> = (0..=2 * REACH).map(|i| tap(i as f64 - REACH as f64)).collect();
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|tap| (tap / sum) as f32).collect()
}

/// Returns the standard deviation of the detail in white noise of 1.
fn detail_noise(taps: &[f32]) -> f32 {
    let pairs = taps.iter().enumerate().flat_map(|(i, a)| taps.iter().enumerate().map(move |(j, b)| (i, j, a * b)));
    pairs.map(|(i, j, v)| if i == REACH && j == REACH { v - 1.0 } else { v }).map(|v| v * v).sum::<f32>().sqrt()
}

/// Filters each row; beyond the borders it goes on as at them.
fn filtered_across(plane: &Array2<f32>, taps: &[f32]) -> Array2<f32> {
    let mut filtered = Array2::zeros(plane.dim());
    filtered.outer_iter_mut().into_par_iter().zip(plane.outer_iter()).for_each(|(mut to, from)| {
        let padded = padded(from, REACH);
        // Tap by tap, which is vector code.
        for (i, tap) in taps.iter().enumerate() {
            to.iter_mut().zip(&padded[i..]).for_each(|(to, v)| *to += tap * v);
        }
    });
    filtered
}

/// Filters each column.
fn filtered_down(plane: &Array2<f32>, taps: &[f32]) -> Array2<f32> {
    let rows = plane.nrows();
    let mut filtered = Array2::zeros(plane.dim());
    filtered.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut to)| {
        for (i, &tap) in taps.iter().enumerate() {
            to.scaled_add(tap, &plane.row((row + i).saturating_sub(REACH).min(rows - 1)));
        }
    });
    filtered
}

/// The noise of detail at each luminance, of grays.
struct NoiseTable {
    deviations: Vec<f32>,
}

impl NoiseTable {
    /// Steps from black to a luminance of 1; what is brighter has the noise of 1, which is too little by a square root.
    const STEPS: usize = 1024;

    fn new(of: &SharpenedChannels<'_>, detail_noise: f32) -> Self {
        let deviation = |step: usize| {
            let gray = step as f32 / Self::STEPS as f32;
            let parts = of
                .luminance
                .iter()
                .zip(of.balance)
                .map(|(share, gain)| (share * gain * f64::from(of.noise.deviation(gray / *gain as f32))).powi(2));
            detail_noise * parts.sum::<f64>().sqrt() as f32
        };
        Self { deviations: (0..=Self::STEPS).map(deviation).collect() }
    }

    #[inline]
    fn deviation(&self, luminance: f32) -> f32 {
        let place = (luminance.clamp(0.0, 1.0) * Self::STEPS as f32) as usize;
        self.deviations[place.min(Self::STEPS)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blur::gaussian_blur;
    use crate::noise::Noise;
    use rand_distr::{Distribution, StandardNormal};

    const CLEAN: SampleNoise = SampleNoise::Frame { electrons_per_unit: 1e9, floor_e: 0.0 };

    fn sharpened(plane: &Array2<f32>, blur_px: f64, noise: &SampleNoise) -> Array2<f32> {
        let plane = plane.as_standard_layout().into_owned();
        let mut channels = [plane.clone(), plane.clone(), plane];
        let of = SharpenedChannels { luminance: &[0.2, 0.7, 0.1], balance: &[2.0, 1.0, 1.5], noise };
        sharpen(&mut channels, blur_px, &of);
        channels[0].clone()
    }

    #[test]
    fn waves_come_back_by_the_filter_s_gain() {
        let blur_px = 0.7;
        // Slow waves, of which the samples about a crest hold it almost to its height.
        for period in [16.0_f32, 24.0] {
            let wave =
                Array2::from_shape_fn((40, 96), |(_, c)| 0.4 + 0.2 * (std::f32::consts::TAU * c as f32 / period).sin());
            let blurred = gaussian_blur(&wave, blur_px);
            let amplitude = |plane: &Array2<f32>| {
                let middle = plane.slice(ndarray::s![10..30, 24..72]);
                let mean = middle.mean().unwrap();
                (2.0 * middle.mapv(|v| (v - mean) * (v - mean)).mean().unwrap()).sqrt()
            };
            let (was, is) = (amplitude(&blurred), amplitude(&sharpened(&blurred, blur_px, &CLEAN)));
            assert!(was < 0.197, "{was}");
            // The regularized inverse falls short of the inverse by a hundredth of what it undoes here.
            assert!((is - 0.2).abs() < 0.15 * (0.2 - was), "{period}: {was} {is}");
        }
    }

    #[test]
    fn edges_are_steeper_and_go_little_beyond() {
        let edge = Array2::from_shape_fn((40, 60), |(_, c)| if c < 30 { 0.2 } else { 0.8 });
        let blurred = gaussian_blur(&edge, 0.8);
        let sharp = sharpened(&blurred, 0.8, &CLEAN);
        let slope = |plane: &Array2<f32>| plane[(20, 30)] - plane[(20, 29)];
        assert!(slope(&sharp) > 1.25 * slope(&blurred), "{} {}", slope(&sharp), slope(&blurred));
        let (low, high) = sharp.iter().fold((1.0_f32, 0.0_f32), |(l, h), &v| (l.min(v), h.max(v)));
        // A tenth of the step, and rounding.
        assert!(low > 0.2 - 0.061 && high < 0.8 + 0.061, "{low} {high}");
        // No blur, no change.
        let same = sharpened(&edge, 1e-3, &CLEAN);
        assert!((&same - &edge).iter().all(|d| d.abs() < 1e-4));
    }

    #[test]
    fn noise_stays_as_it_is() {
        let noise = SampleNoise::Frame { electrons_per_unit: 1000.0, floor_e: 5.0 };
        let level = 0.3_f32;
        let mut rng = Noise::all(3).rng(crate::noise::Kind::Read, 0, 0);
        let mut grain = || -> f32 { StandardNormal.sample(&mut rng) };
        // Three channels of a luminance have independent noise; here they share that of their sum.
        let of = SharpenedChannels { luminance: &[0.2, 0.7, 0.1], balance: &[2.0, 1.0, 1.5], noise: &noise };
        let deviation = NoiseTable::new(&of, 1.0).deviation(level);
        let flat = Array2::from_shape_fn((120, 120), |_| level + deviation * grain());
        let rms = |plane: &Array2<f32>| plane.mapv(|v| (v - level).powi(2)).mean().unwrap().sqrt();
        let (was, is) = (rms(&flat), rms(&sharpened(&flat, 0.7, &noise)));
        assert!(is < 1.05 * was, "{was} {is}");
        // Without a word on noise it would be amplified.
        let (was, is) = (rms(&flat), rms(&sharpened(&flat, 0.7, &CLEAN)));
        assert!(is > 1.4 * was, "{was} {is}");
    }
}
