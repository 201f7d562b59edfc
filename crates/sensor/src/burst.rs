//! Bursts of a camera that moves: frames aligned tile by tile and merged where they agree.
//!
//! After Hasinoff et al., "Burst photography for high dynamic range and low-light imaging on mobile cameras" (ACM
//! Transactions on Graphics 35, 2016): every frame is compared with the first in overlapping tiles of the raw planes, frequency by
//! frequency, and what differs by more than noise is left out. Here the frequencies are those of the cosine transform, frames are moved by
//! fractions of a pixel before, and all filters of a tile are left out together, so that no colored seams arise.

mod align;

use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    Raw, RawPlane, Sensor, SensorError,
    burst::align::{Alignment, Pyramid, align},
    denoise::SampleNoise,
    phases,
    tile_cosine::TileCosine,
};

/// The side of a tile and the distance between tiles, in samples of one filter.
const TILE: usize = 16;
const STEP: usize = TILE / 2;
/// Of two frames that differ by noise alone the squared difference is 1 in its variances, .7 about it for the four planes of a Bayer
/// mosaic: up to here a frequency is merged whole.
const SURELY_NOISE: f32 = 2.0;
/// How many more variances leave half of a frequency out.
const HALF_LEFT_OUT: f32 = 4.0;

type Square = [[f32; TILE]; TILE];

impl Sensor {
    /// Merges a burst of equal exposures into its first frame, wherever camera or subject moved between them.
    ///
    /// The frames are aligned by tiles of 16 pixels of the mosaic's tile, with fractions of it, up to 32 of them (64 pixels of a Bayer
    /// mosaic) away. The merged frame is in units of saturation, without a converter, and is developed like any other. Where
    /// frames do not agree with the first it has more noise than the mean of all that it is taken for.
    ///
    /// # Errors
    /// As [`merge`](Self::merge), and when the exposures differ.
    pub fn merge_moving(&self, frames: &[Raw]) -> Result<Raw, SensorError> {
        self.check_merge(frames)?;
        let first = &frames[0];
        if let Some(other) = frames.iter().find(|frame| frame.exposure != first.exposure) {
            let text = |frame: &Raw| format!("{} s at a gain of {}", frame.exposure.time_s, frame.exposure.analog_gain);
            let (expected, found) = (text(first), text(other));
            return Err(SensorError::Shape { what: "exposure of a frame of a moving burst", expected, found });
        }
        let sheet = self.as_read(&first.exposure)?;
        let noise = Variance::of(&sheet, first);
        let tile = first.tile.as_ref();
        let reference = Planes::new(&sheet, first);
        let mut sum = reference.samples.clone();
        let merger = Merger::new(&reference.samples, noise);
        for frame in &frames[1..] {
            let other = Planes::new(&sheet, frame);
            // Both pictures are noisy by one over the number of planes that were averaged, in units of one sample's noise.
            let alignment = align(&reference.pyramid, &other.pyramid, (reference.samples.len() as f32).recip());
            merger.add(&other.samples, &alignment, &mut sum);
        }
        let share = (frames.len() as f32).recip();
        sum.iter_mut().for_each(|plane| plane.par_mapv_inplace(|v| v * share));
        let planes = phases::join(sum, tile, first.size()).into_iter().map(RawPlane::Volts).collect();
        let merged = frames.iter().enumerate().map(|(shot, frame)| sheet.source_of(frame, shot)).collect();
        Ok(Raw {
            planes,
            levels: sheet.unit_levels(sheet.saturation_e(&first.exposure), &first.exposure),
            merged,
            masked: None,
            ..first.clone()
        })
    }
}

/// The variance of a sample about its mean, in units of saturation.
#[derive(Clone, Copy)]
struct Variance {
    electrons_per_unit: f32,
    floor_e: f32,
    prnu: f32,
}

impl Variance {
    fn of(sensor: &Sensor, raw: &Raw) -> Self {
        Self {
            electrons_per_unit: raw.levels.saturation_e() as f32,
            floor_e: sensor.noise_floor_e(raw) as f32,
            prnu: sensor.prnu_fraction as f32,
        }
    }

    fn at(&self, mean: f32) -> f32 {
        let electrons = mean.max(0.0) * self.electrons_per_unit;
        // A tenth of an electron keeps it above 0 where a sensor without noise sees no light.
        let variance_e = electrons + self.floor_e.powi(2) + (self.prnu * electrons).powi(2) + 0.01;
        variance_e / self.electrons_per_unit.powi(2)
    }
}

/// A frame by the places of its mosaic's tile, and the gray picture that is aligned.
struct Planes {
    samples: Vec<Array2<f32>>,
    pyramid: Pyramid,
}

impl Planes {
    fn new(sensor: &Sensor, raw: &Raw) -> Self {
        let samples = phases::split(&raw.linear(), raw.tile.as_ref());
        let noise =
            SampleNoise::Frame { electrons_per_unit: raw.levels.saturation_e(), floor_e: sensor.noise_floor_e(raw) };
        let mut gray = Array2::<f32>::zeros(samples[0].dim());
        let share = (samples.len() as f32).recip();
        for plane in &samples {
            ndarray::Zip::from(&mut gray).and(plane).par_for_each(|gray, &v| *gray += share * noise.stabilized(v));
        }
        Self { samples, pyramid: Pyramid::new(gray) }
    }
}

/// Adds frames to a reference where they agree with it.
struct Merger<'a> {
    reference: &'a [Array2<f32>],
    noise: Variance,
    cosine: TileCosine<TILE>,
    /// The window before and after the transform: its squares, half a tile apart, sum to 1.
    window: [f32; TILE],
    /// The share of a sample's variance at each frequency along an axis.
    frequency_noise: [f32; TILE],
}

impl<'a> Merger<'a> {
    fn new(reference: &'a [Array2<f32>], noise: Variance) -> Self {
        let window = std::array::from_fn(|i| (std::f32::consts::PI * (i as f32 + 0.5) / TILE as f32).sin());
        let cosine = TileCosine::new();
        let frequency_noise = cosine.windowed_noise(&window);
        Self { reference, noise, cosine, window, frequency_noise }
    }

    /// Adds one frame, moved by its alignment, to the sums.
    fn add(&self, frame: &[Array2<f32>], alignment: &Alignment, sums: &mut [Array2<f32>]) {
        let (rows, columns) = self.reference[0].dim();
        // Tiles begin half a tile before the frame, so that every sample lies under two of them along each axis.
        let strips: Vec<Vec<Vec<f32>>> = (0..rows / STEP + 2)
            .into_par_iter()
            .map(|tile_row| {
                let mut strip = vec![vec![0.0; columns * TILE]; frame.len()];
                for tile_column in 0..columns / STEP + 2 {
                    let corner =
                        ((tile_row * STEP) as isize - STEP as isize, (tile_column * STEP) as isize - STEP as isize);
                    for (plane, tile) in self.merged(frame, alignment, corner).iter().enumerate() {
                        for (r, line) in tile.iter().enumerate() {
                            for (c, value) in line.iter().enumerate() {
                                let column = corner.1 + c as isize;
                                if (0..columns as isize).contains(&column) {
                                    strip[plane][r * columns + column as usize] += value;
                                }
                            }
                        }
                    }
                }
                strip
            })
            .collect();
        for (plane, sum) in sums.iter_mut().enumerate() {
            sum.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut line)| {
                // The rows of a frame lie in the lower half of one strip and in the upper half of the next.
                for (strip, within) in [(row / STEP, STEP + row % STEP), (row / STEP + 1, row % STEP)] {
                    let from = &strips[strip][plane][within * columns..(within + 1) * columns];
                    line.iter_mut().zip(from).for_each(|(sum, value)| *sum += value);
                }
            });
        }
    }

    /// Returns one tile of the frame for each plane, with the frequencies in which it disagrees taken from the reference.
    fn merged(&self, frame: &[Array2<f32>], alignment: &Alignment, corner: (isize, isize)) -> Vec<Square> {
        let middle = |corner: isize, n: usize| (corner + STEP as isize).clamp(0, n as isize - 1) as usize;
        let (rows, columns) = self.reference[0].dim();
        let shift = alignment.at(middle(corner.0, rows), middle(corner.1, columns));
        // The squared difference at each frequency, and what noise makes of it, over all planes.
        let mut squares = [[0.0_f32; TILE]; TILE];
        let mut variance = 0.0;
        let mut tiles: Vec<(Square, Square)> = Vec::with_capacity(frame.len());
        for (ours, theirs) in self.reference.iter().zip(frame) {
            let ours = cut(ours, corner, [0.0; 2]);
            let theirs = cut(theirs, corner, shift);
            let mean = ours.iter().flatten().sum::<f32>() / (TILE * TILE) as f32;
            variance += 2.0 * self.noise.at(mean);
            let mut difference = ours;
            for (line, other) in difference.iter_mut().zip(&theirs) {
                line.iter_mut().zip(other).for_each(|(a, b)| *a -= b);
            }
            let difference = self.cosine.forward(&self.windowed(difference));
            for (line, other) in squares.iter_mut().zip(&difference) {
                line.iter_mut().zip(other).for_each(|(sum, d)| *sum += d * d);
            }
            tiles.push((theirs, difference));
        }
        // What differs by more than noise is taken from the reference.
        let mut kept = [[0.0_f32; TILE]; TILE];
        for (r, line) in kept.iter_mut().enumerate() {
            for (c, kept) in line.iter_mut().enumerate() {
                let expected = variance * self.frequency_noise[r] * self.frequency_noise[c];
                let beyond = (squares[r][c] / expected - SURELY_NOISE).max(0.0);
                *kept = beyond / (beyond + HALF_LEFT_OUT);
            }
        }
        let of_plane = |(theirs, mut difference): (Square, Square)| {
            for (line, kept) in difference.iter_mut().zip(&kept) {
                line.iter_mut().zip(kept).for_each(|(d, kept)| *d *= kept);
            }
            let mut tile = self.windowed(theirs);
            for (line, back) in tile.iter_mut().zip(&self.cosine.inverse(&difference)) {
                line.iter_mut().zip(back).for_each(|(a, b)| *a += b);
            }
            self.windowed(tile)
        };
        tiles.into_iter().map(of_plane).collect()
    }

    fn windowed(&self, mut tile: Square) -> Square {
        for (line, down) in tile.iter_mut().zip(&self.window) {
            line.iter_mut().zip(&self.window).for_each(|(value, across)| *value *= down * across);
        }
        tile
    }
}

/// Taps of an interpolation.
const TAPS: usize = 6;

/// Returns the tile that begins at a corner moved by a shift; beyond the frame its outermost samples go on.
fn cut(plane: &Array2<f32>, corner: (isize, isize), [down, right]: [f32; 2]) -> Square {
    let (rows, columns) = plane.dim();
    let inside = |place: isize, n: usize| place.clamp(0, n as isize - 1) as usize;
    let ((row, below), (column, across)) = (taps(down), taps(right));
    let before = TAPS as isize / 2 - 1;
    let mut lines = [[0.0_f32; TILE]; TILE + TAPS - 1];
    let first = corner.1 + column - before;
    for (r, line) in lines.iter_mut().enumerate() {
        let from = plane.row(inside(corner.0 + row + r as isize - before, rows));
        let samples: [f32; TILE + TAPS - 1] = std::array::from_fn(|c| from[inside(first + c as isize, columns)]);
        *line = std::array::from_fn(|c| across.iter().zip(&samples[c..]).map(|(tap, v)| tap * v).sum());
    }
    std::array::from_fn(|r| {
        let mut line = [0.0; TILE];
        for (tap, from) in below.iter().zip(&lines[r..]) {
            line.iter_mut().zip(from).for_each(|(sum, v)| *sum += tap * v);
        }
        line
    })
}

/// Returns the whole part of a shift and the taps of Lanczos's kernel of three lobes for its fraction, which sum to 1.
fn taps(shift: f32) -> (isize, [f32; TAPS]) {
    let whole = shift.floor();
    let fraction = f64::from(shift - whole);
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) };
    let taps: [f64; TAPS] = std::array::from_fn(|i| {
        let x = i as f64 - (TAPS / 2 - 1) as f64 - fraction;
        if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }
    });
    let sum: f64 = taps.iter().sum();
    (whole as isize, taps.map(|tap| (tap / sum) as f32))
}
