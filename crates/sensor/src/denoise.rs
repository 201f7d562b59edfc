//! Noise taken out of a raw frame, by wavelets.
//!
//! The variance of shot and read noise is known, so a square root makes it 1 everywhere (Anscombe, Biometrika 35, 1948,
//! with read noise). The pixels of a tile are turned into their mean and differences by a cosine transform, which
//! keeps white noise white. An undecimated wavelet transform with the B₃ spline (Starck & Murtagh, "Image restoration
//! with noise suppression using the wavelet transform", Astronomy & Astrophysics 288, 1994) parts each of these planes by
//! scale, and what is not above a few standard deviations is taken out.

use ndarray::Array2;
use rayon::prelude::*;

use crate::{Tile, phases};

/// The standard deviation that white noise of 1 has at each scale of the B₃ spline transform (Starck & Murtagh, table 1).
const NOISE_AT_SCALE: [f32; 4] = [0.889, 0.200, 0.0859, 0.0413];
/// The threshold in standard deviations at a strength of 1.
const THRESHOLD: f32 = 3.0;

/// The noise of a filter's samples.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SampleNoise {
    /// That of one frame: shot noise and a floor.
    Frame {
        /// Electrons a unit of the samples.
        electrons_per_unit: f64,
        /// Noise that does not depend on the signal, rms electrons.
        floor_e: f64,
    },
    /// Any.
    Table(NoiseTable),
}

impl SampleNoise {
    /// Returns the sample on a scale on which noise is 1.
    pub(crate) fn stabilized(&self, sample: f32) -> f32 {
        match self {
            Self::Frame { electrons_per_unit, floor_e } => {
                let electrons = f64::from(sample) * electrons_per_unit;
                (2.0 * (electrons + 0.375 + floor_e.powi(2)).max(0.0).sqrt()) as f32
            }
            Self::Table(table) => table.stabilized(f64::from(sample)) as f32,
        }
    }

    /// Returns the standard deviation of a sample.
    pub(crate) fn deviation(&self, sample: f32) -> f32 {
        const BY: f32 = 1e-3;
        2.0 * BY / (self.stabilized(sample + BY) - self.stabilized(sample - BY)).max(f32::MIN_POSITIVE)
    }

    /// Returns the sample of a value on that scale; the mean comes out unbiased above a few electrons.
    fn unstabilized(&self, value: f32) -> f32 {
        match self {
            Self::Frame { electrons_per_unit, floor_e } => {
                let half = 0.5 * f64::from(value.max(0.0));
                ((half * half - 0.125 - floor_e.powi(2)) / electrons_per_unit) as f32
            }
            Self::Table(table) => table.sample_of(f64::from(value)) as f32,
        }
    }
}

/// The level of a frame at which its noise is judged: the median of its samples, but no more than a middle gray and no less than a few thousandths of
/// saturation, where a picture is black. The shares of it that noise must reach for any, and for all, of the automatic strength.
const LEVELS: [f64; 2] = [0.005, 0.18];
/// Samples that tell the median.
const LEVEL_SAMPLES: usize = 1 << 16;
const NOISE_SHARES: [f64; 2] = [0.05, 0.1];
/// The strength at which a noisy photograph comes nearest to a clean one (docs/sensor.md).
const AUTOMATIC_STRENGTH: f64 = 0.5;

/// Returns the level at which the noise of a frame is judged, by the samples of one channel.
pub(crate) fn level(planes: &[Array2<f32>], tile: Option<&Tile>, channel: usize) -> f64 {
    let (rows, columns) = planes[0].dim();
    // A lattice of tiles, so that all filters have their part.
    let period = tile.map_or((1, 1), |tile| (tile.rows(), tile.columns()));
    let stride = ((rows * columns / LEVEL_SAMPLES) as f64).sqrt().floor().max(1.0) as usize;
    let mut samples: Vec<f32> = Vec::new();
    for row in (0..rows).filter(|row| (row / period.0).is_multiple_of(stride)) {
        for column in (0..columns).filter(|column| (column / period.1).is_multiple_of(stride)) {
            match tile {
                Some(tile) if tile.filter_at(row, column) == channel => samples.push(planes[0][(row, column)]),
                Some(_) => {}
                None => samples.push(planes[channel.min(planes.len() - 1)][(row, column)]),
            }
        }
    }
    if samples.is_empty() {
        return LEVELS[1];
    }
    let middle = samples.len() / 2;
    let (_, median, _) = samples.select_nth_unstable_by(middle, f32::total_cmp);
    f64::from(*median).clamp(LEVELS[0], LEVELS[1])
}

/// Returns the strength that a frame's noise asks for at a level of it.
pub(crate) fn automatic_strength(noise: &SampleNoise, level: f64) -> f64 {
    AUTOMATIC_STRENGTH * noisiness(noise, level)
}

/// Returns how much noise a frame has: 0 where its level stands 20 times above it or more, 1 where it stands ten times above it or less,
/// which ISO 12232 takes to be just acceptable.
pub(crate) fn noisiness(noise: &SampleNoise, level: f64) -> f64 {
    // The slope of the scale on which noise is 1 is one over the noise.
    let (below, above) = (0.98 * level, 1.02 * level);
    let slope = f64::from(noise.stabilized(above as f32) - noise.stabilized(below as f32)) / (above - below);
    let [least, most] = NOISE_SHARES;
    let share = 1.0 / (slope * level);
    ((share - least) / (most - least)).clamp(0.0, 1.0)
}

/// A scale on which noise is 1, for a noise that changes with the sample in any way: the integral of 1 / deviation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NoiseTable {
    /// The value of the scale at samples that grow by squares; its first is at 0.
    values: Vec<f64>,
    /// The slope of the scale at 0, with which it goes on below.
    slope_at_zero: f64,
}

/// Steps of the table, and the sample at its end.
const TABLE_STEPS: usize = 4096;
const TABLE_END: f64 = 1.5;

impl NoiseTable {
    /// Returns the scale of a standard deviation at each sample.
    pub(crate) fn new(deviation: &dyn Fn(f64) -> f64) -> Self {
        let mut values = vec![0.0; TABLE_STEPS + 1];
        for k in 1..=TABLE_STEPS {
            let (from, to) = (Self::sample_at(k as f64 - 1.0), Self::sample_at(k as f64));
            values[k] = values[k - 1] + (to - from) / deviation(0.5 * (from + to));
        }
        Self { values, slope_at_zero: 1.0 / deviation(0.0) }
    }

    fn sample_at(place: f64) -> f64 {
        TABLE_END * (place / TABLE_STEPS as f64).powi(2)
    }

    fn stabilized(&self, sample: f64) -> f64 {
        if sample <= 0.0 {
            return sample * self.slope_at_zero;
        }
        let place = (sample / TABLE_END).sqrt() * TABLE_STEPS as f64;
        let below = (place as usize).min(TABLE_STEPS - 1);
        let (from, to) = (Self::sample_at(below as f64), Self::sample_at(below as f64 + 1.0));
        self.values[below] + (self.values[below + 1] - self.values[below]) * (sample - from) / (to - from)
    }

    fn sample_of(&self, value: f64) -> f64 {
        if value <= 0.0 {
            return value / self.slope_at_zero;
        }
        let above = self.values.partition_point(|v| *v < value).clamp(1, TABLE_STEPS);
        let (low, high) = (self.values[above - 1], self.values[above]);
        let (from, to) = (Self::sample_at(above as f64 - 1.0), Self::sample_at(above as f64));
        from + (to - from) * (value - low) / (high - low)
    }
}

/// Takes noise out of the planes of a frame; `noise` is that of each filter.
pub(crate) fn denoise(planes: &mut [Array2<f32>], tile: Option<&Tile>, noise: &[SampleNoise], strength: f64) {
    match tile {
        Some(tile) => denoise_mosaic(&mut planes[0], tile, noise, strength as f32),
        None => {
            for (number, plane) in planes.iter_mut().enumerate() {
                denoise_mosaic(plane, &Tile::single(number), noise, strength as f32);
            }
        }
    }
}

fn denoise_mosaic(plane: &mut Array2<f32>, tile: &Tile, noise: &[SampleNoise], strength: f32) {
    let filters: Vec<usize> = (0..tile.rows()).flat_map(|row| tile.row(row).to_vec()).collect();
    let mut phases = phases::split(std::slice::from_ref(plane), Some(tile));
    let of_filters = || filters.iter().map(|&filter| &noise[filter]);
    phases.iter_mut().zip(of_filters()).for_each(|(phase, noise)| phase.par_mapv_inplace(|v| noise.stabilized(v)));
    let cosines = cosines(tile.rows(), tile.columns());
    let denoised: Vec<Array2<f32>> =
        cosines.par_iter().map(|row| shrink(&weighted_sum(&phases, row), strength)).collect();
    drop(phases);
    let back = (0..filters.len()).into_par_iter().zip(of_filters().collect::<Vec<_>>()).map(|(phase, noise)| {
        let mut sum = weighted_sum(&denoised, &cosines.iter().map(|row| row[phase]).collect::<Vec<_>>());
        sum.mapv_inplace(|v| noise.unstabilized(v));
        sum
    });
    let size = plane.dim();
    *plane = phases::join(back.collect(), Some(tile), size).swap_remove(0);
}

/// Returns the orthonormal cosine transform of a tile: a row a frequency, a column a phase.
fn cosines(rows: usize, columns: usize) -> Vec<Vec<f32>> {
    let one = |k: usize, i: usize, n: usize| {
        let norm = if k == 0 { 1.0 / n as f64 } else { 2.0 / n as f64 }.sqrt();
        norm * (std::f64::consts::PI * k as f64 * (i as f64 + 0.5) / n as f64).cos()
    };
    let phases = || (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c)));
    let row = |(kr, kc)| phases().map(|(r, c)| (one(kr, r, rows) * one(kc, c, columns)) as f32).collect();
    phases().map(row).collect()
}

fn weighted_sum(planes: &[Array2<f32>], weights: &[f32]) -> Array2<f32> {
    let mut sum = Array2::zeros(planes[0].dim());
    planes.iter().zip(weights).for_each(|(plane, &weight)| sum.scaled_add(weight, plane));
    sum
}

/// Returns the plane without what noise of 1 explains.
fn shrink(plane: &Array2<f32>, strength: f32) -> Array2<f32> {
    let mut smooth = plane.clone();
    let mut kept = Array2::zeros(plane.dim());
    for (scale, noise) in NOISE_AT_SCALE.iter().enumerate() {
        let smoother = smoothed(&smooth, 1 << scale);
        let threshold = strength * THRESHOLD * noise;
        ndarray::Zip::from(&mut kept).and(&smooth).and(&smoother).for_each(|kept: &mut f32, &fine, &coarse| {
            let detail = fine - coarse;
            // Between a hard and a soft threshold: what is far above it stays nearly as it is.
            if detail.abs() > threshold {
                *kept += detail - threshold * threshold / detail;
            }
        });
        smooth = smoother;
    }
    kept + smooth
}

/// The taps of the B₃ spline.
const TAPS: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

/// Returns where the taps about a place lie, `hole` apart; the border is mirrored.
fn tapped(place: usize, hole: usize, n: usize) -> [usize; 5] {
    [-2_isize, -1, 0, 1, 2].map(|tap| {
        let last = n as isize - 1;
        let place = (place as isize + tap * hole as isize).abs();
        // One reflection is enough unless the plane is smaller than the filter.
        (if place > last { (2 * last - place).max(0) } else { place }) as usize
    })
}

/// Returns the plane smoothed by the B₃ spline with `hole` pixels between its taps; the border is mirrored.
fn smoothed(plane: &Array2<f32>, hole: usize) -> Array2<f32> {
    let (n_rows, n_columns) = plane.dim();
    let mut along = Array2::zeros((n_rows, n_columns));
    for (from, mut to) in plane.outer_iter().zip(along.outer_iter_mut()) {
        let to = to.as_slice_mut().expect("a new array is contiguous");
        smooth_row(from.as_slice().expect("planes of phases are contiguous"), to, hole);
    }
    let mut both = Array2::zeros((n_rows, n_columns));
    let lines = along.as_slice().expect("a new array is contiguous");
    for (row, mut to) in both.outer_iter_mut().enumerate() {
        let to = to.as_slice_mut().expect("a new array is contiguous");
        sum_taps(to, tapped(row, hole, n_rows).map(|r| &lines[r * n_columns..][..n_columns]));
    }
    both
}

fn smooth_row(from: &[f32], to: &mut [f32], hole: usize) {
    let (n, reach) = (from.len(), 2 * hole);
    let at_border = |column: usize| tapped(column, hole, n).iter().zip(TAPS).map(|(&c, tap)| tap * from[c]).sum();
    if n <= 2 * reach {
        to.iter_mut().enumerate().for_each(|(column, value)| *value = at_border(column));
        return;
    }
    (0..reach).chain(n - reach..n).for_each(|column| to[column] = at_border(column));
    let inner = n - 2 * reach;
    sum_taps(&mut to[reach..][..inner], [0, 1, 2, 3, 4].map(|tap| &from[tap * hole..][..inner]));
}

/// Sums five rows by the taps: in one loop over slices of one length, which is vector code.
fn sum_taps(to: &mut [f32], [a, b, c, d, e]: [&[f32]; 5]) {
    let outer = a.iter().zip(b).zip(c).zip(d).zip(e);
    for (value, ((((a, b), c), d), e)) in to.iter_mut().zip(outer) {
        *value = TAPS[0] * a + TAPS[1] * b + TAPS[2] * c + TAPS[3] * d + TAPS[4] * e;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn the_cosine_transform_keeps_lengths() {
        for (rows, columns) in [(2, 2), (4, 4), (1, 3)] {
            let rows_of = cosines(rows, columns);
            for (i, a) in rows_of.iter().enumerate() {
                for (j, b) in rows_of.iter().enumerate() {
                    let product: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                    assert!((product - f32::from(u8::from(i == j))).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn white_noise_has_the_tabled_size_at_each_scale_and_is_taken_out() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let noise = Array2::from_shape_simple_fn((256, 256), || StandardNormal.sample(&mut rng));
        let rms = |plane: &Array2<f32>| (plane.iter().map(|v| v * v).sum::<f32>() / plane.len() as f32).sqrt();
        let mut smooth = noise.clone();
        for (scale, expected) in NOISE_AT_SCALE.iter().enumerate() {
            let smoother = smoothed(&smooth, 1 << scale);
            // The coarser the scale, the fewer independent samples there are.
            assert!((rms(&(&smooth - &smoother)) / expected - 1.0).abs() < 0.05, "scale {scale}");
            smooth = smoother;
        }
        assert!(rms(&shrink(&noise, 1.0)) < 0.1);
    }

    #[test]
    fn stabilizing_and_back_is_the_same_but_for_the_known_eighth() {
        let noise = SampleNoise::Frame { electrons_per_unit: 6000.0, floor_e: 3.0 };
        for sample in [0.0, 0.01, 0.5, 1.0] {
            let back = noise.unstabilized(noise.stabilized(sample));
            assert!((back - sample - 0.25 / 6000.0).abs() < 1e-6, "{sample} {back}");
        }
    }

    #[test]
    fn noise_asks_for_denoising() {
        let strength = |electrons_per_unit: f64, floor_e: f64| {
            automatic_strength(&SampleNoise::Frame { electrons_per_unit, floor_e }, LEVELS[1])
        };
        // A middle gray of n electrons has √(n + floor²) of noise: a twentieth of 400, a tenth of 100.
        assert_eq!(strength(33_000.0, 10.0), 0.0);
        assert_eq!(strength(404.0 / 0.18, 0.0), 0.0);
        assert_eq!(strength(98.0 / 0.18, 0.0), 0.5);
        let n = 200.0_f64;
        let expected = 0.5 * ((n + 25.0).sqrt() / n - 0.05) / 0.05;
        assert!((strength(n / 0.18, 5.0) - expected).abs() < 1e-3, "{} {expected}", strength(n / 0.18, 5.0));
    }

    #[test]
    fn a_dark_frame_is_judged_by_its_own_level() {
        let tile = crate::Cfa::two_by_two("RGGB").unwrap().resolve("test", &["R", "G", "B"]).unwrap().unwrap();
        let frame =
            |green: f32| Array2::from_shape_fn((40, 60), |(r, c)| if tile.filter_at(r, c) == 1 { green } else { 0.9 });
        let level_of = |green: f32| level(&[frame(green)], Some(&tile), 1);
        for (green, wanted) in [(0.05, 0.05), (0.6, 0.18), (0.001, 0.005)] {
            assert!((level_of(green) - wanted).abs() < 1e-6, "{green}: {}", level_of(green));
        }
        // A well of 5000 electrons: 900 of a middle gray stand 30 times above their noise, 50 of a night scene 7 times.
        let noise = SampleNoise::Frame { electrons_per_unit: 5000.0, floor_e: 2.0 };
        assert_eq!([0.18, 0.01].map(|level| automatic_strength(&noise, level)), [0.0, 0.5]);
    }

    #[test]
    fn a_table_of_shot_noise_is_the_square_root() {
        let deviation = |sample: f64| (sample.max(0.0) * 6000.0 + 9.0).sqrt() / 6000.0;
        let table = NoiseTable::new(&deviation);
        for sample in [-0.001, 0.0, 1e-4, 0.01, 0.5, 1.2] {
            assert!((table.sample_of(table.stabilized(sample)) - sample).abs() < 1e-12, "{sample}");
            // ∫ ds / σ(s) = 2 (√(n + 9) − 3).
            let exact = 2.0 * ((sample.max(0.0) * 6000.0 + 9.0).sqrt() - 3.0) + sample.min(0.0) * 2000.0;
            assert!((table.stabilized(sample) - exact).abs() < 1e-3, "{sample}");
        }
    }
}
