//! The sum of plane waves over an evenly spaced grid of places, by spreading and a fast Fourier transform.
//!
//! Each wave is spread over 8 × 8 points of a grid of frequencies with the window `exp(β (√(1 − t²) − 1))`, the grid is
//! transformed, and the window's own transform is divided out (Barnett, Magland and af Klinteberg, SIAM J. Sci.
//! Comput. 41, 2019). The error is a few 1e-6 of the largest sum that could be. The cost grows with the number of waves
//! plus that of the places, not with their product: where both are many, [`super::transform`] is far slower.

use std::{cell::RefCell, f64::consts::PI, sync::LazyLock};

use multiversion::multiversion;
use ndarray::{Array2, Axis};
use rustfft::{FftPlanner, num_complex::Complex};

use super::{cis::cis, pixel_mean::PixelMean, transform::PlaneWaves};
use crate::quadrature::gauss_legendre_on;

/// Points of the grid that a wave is spread over, each way.
const WIDTH: usize = 8;
/// How many times more points the grid has than places are asked for, at least.
const OVERSAMPLING: f64 = 1.5;
/// The window's shape: the value that suits this oversampling.
const BETA: f64 = 0.97 * PI * WIDTH as f64 * (1.0 - 0.5 / OVERSAMPLING);
/// Terms of the polynomials that stand for the window in each of its pieces.
const TERMS: usize = 11;

/// Time of a wave at a place in the matrix product, of spreading a wave, and of a place on the grid, ns.
const PRODUCT_NS: f64 = 0.1;
const SPREAD_NS: f64 = 60.0;
const PLACE_NS: f64 = 25.0;

/// A window of pixels, and at how many evenly spaced places each is sampled along its side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub(crate) n_rows: usize,
    pub(crate) n_columns: usize,
    pub(crate) pitch_mm: f64,
    pub(crate) samples_per_pixel: usize,
}

impl Grid {
    /// Whether this way is quicker than the matrix product for so many waves; by measured costs, in ns.
    pub(crate) fn is_cheaper(self, n_waves: usize) -> bool {
        let n_samples = (self.n_rows * self.samples_per_pixel * self.n_columns * self.samples_per_pixel) as f64;
        let product = n_waves as f64 * n_samples * PRODUCT_NS;
        let gridded = n_waves as f64 * SPREAD_NS + n_samples * PLACE_NS;
        gridded < product
    }
}

/// Returns the mean of |Σ waves|² over each pixel: rows along y, columns along x, both ascending.
pub(crate) fn mean_square(waves: &PlaneWaves, grid: Grid) -> Array2<f64> {
    let mean = PixelMean::new(grid.samples_per_pixel);
    let step_mm = grid.pitch_mm / grid.samples_per_pixel as f64;
    let (n_x, n_y) = (mean.n_samples(grid.n_columns), mean.n_samples(grid.n_rows));
    let (size_x, size_y) = (grid_size(n_x), grid_size(n_y));
    let mut spectrum = Spectrum::new(size_x, size_y);
    let scale = waves.scale();
    // Half a step aside where the middle lies between two places.
    let aside = |n: usize| if n.is_multiple_of(2) { 0.5 } else { 0.0 };
    spread(&mut spectrum, waves, Lattice { step_mm, aside: (aside(n_x), aside(n_y)), scale });
    let squares = spectrum.squares(n_x, n_y, 1.0 / (scale * scale));
    mean.over(&squares, grid.n_rows, grid.n_columns)
}

/// Returns a grid size that transforms quickly.
fn grid_size(n_places: usize) -> usize {
    let least = ((n_places as f64 * OVERSAMPLING).ceil() as usize).max(2 * WIDTH);
    let is_smooth = |n: &usize| {
        let mut rest = *n;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        rest == 1
    };
    (least..).find(|n| n.is_multiple_of(2) && is_smooth(n)).unwrap_or(least)
}

/// Amplitudes on a periodic grid of frequencies, with margins that stand for its far side.
struct Spectrum {
    size_x: usize,
    size_y: usize,
    re: Vec<f32>,
    im: Vec<f32>,
    /// Which rows hold anything.
    is_used: Vec<bool>,
}

impl Spectrum {
    fn new(size_x: usize, size_y: usize) -> Self {
        let n = (size_x + WIDTH) * (size_y + WIDTH);
        Self { size_x, size_y, re: vec![0.0; n], im: vec![0.0; n], is_used: vec![false; size_y + WIDTH] }
    }

    /// Spreads a wave of these frequencies (turns a place) and this amplitude.
    #[inline(always)]
    fn add(&mut self, turns: (f64, f64), (amplitude_re, amplitude_im): (f32, f32)) {
        let ((column, across), (row, along)) = (start(turns.0, self.size_x), start(turns.1, self.size_y));
        let stride = self.size_x + WIDTH;
        self.is_used[row..row + WIDTH].fill(true);
        for (i, weight) in along.into_iter().enumerate() {
            let (wr, wi) = (weight * amplitude_re, weight * amplitude_im);
            let from = (row + i) * stride + column;
            for (sum, across) in self.re[from..from + WIDTH].iter_mut().zip(&across) {
                *sum += wr * across;
            }
            for (sum, across) in self.im[from..from + WIDTH].iter_mut().zip(&across) {
                *sum += wi * across;
            }
        }
    }

    /// Returns the squares of the waves at `n_x` × `n_y` places about the middle, lines along y.
    fn squares(mut self, n_x: usize, n_y: usize, unscale: f64) -> Array2<f64> {
        let stride = self.size_x + WIDTH;
        // What was spread beyond an end belongs to the other.
        for row in 0..self.size_y + WIDTH {
            for column in 0..WIDTH {
                let (from, to) = (row * stride + self.size_x + column, row * stride + column);
                self.re[to] += self.re[from];
                self.im[to] += self.im[from];
            }
        }
        let mut columns = vec![Complex::new(0.0_f32, 0.0); n_x * self.size_y];
        PLANNER.with_borrow_mut(|planner| {
            let along_x = planner.plan_fft_inverse(self.size_x);
            let along_y = planner.plan_fft_inverse(self.size_y);
            let n_scratch = along_x.get_inplace_scratch_len().max(along_y.get_inplace_scratch_len());
            let mut scratch = vec![Complex::new(0.0_f32, 0.0); n_scratch];
            let mut line = vec![Complex::new(0.0_f32, 0.0); self.size_x];
            for row in (0..self.size_y + WIDTH).filter(|row| self.is_used[*row]) {
                for (column, value) in line.iter_mut().enumerate() {
                    *value = Complex::new(self.re[row * stride + column], self.im[row * stride + column]);
                }
                along_x.process_with_scratch(&mut line, &mut scratch);
                let row = row % self.size_y;
                let places = line[self.size_x - n_x / 2..].iter().chain(&line);
                for (place, value) in columns.chunks_exact_mut(self.size_y).zip(places) {
                    place[row] += value;
                }
            }
            along_y.process_with_scratch(&mut columns, &mut scratch);
        });
        let (fade_x, fade_y) = (fades(n_x, self.size_x), fades(n_y, self.size_y));
        let mut squares = Array2::zeros((n_x, n_y));
        let lines = squares.axis_iter_mut(Axis(0)).zip(columns.chunks_exact(self.size_y)).zip(fade_x);
        for ((mut line, column), fade) in lines {
            let values = column[self.size_y - n_y / 2..].iter().chain(column);
            for ((square, value), fade_y) in line.iter_mut().zip(values).zip(&fade_y) {
                let (re, im) = (f64::from(value.re), f64::from(value.im));
                *square = (re * re + im * im) * (unscale * fade * fade_y);
            }
        }
        squares
    }
}

thread_local! {
    static PLANNER: RefCell<FftPlanner<f32>> = RefCell::new(FftPlanner::new());
}

/// Returns the first grid point that a frequency is spread over, and the window's values there and after it.
#[inline(always)]
fn start(turns: f64, size: usize) -> (usize, [f32; WIDTH]) {
    let at = (turns - turns.floor()) * size as f64;
    let first = (at - 0.5 * WIDTH as f64).ceil();
    let index = if first < 0.0 { first + size as f64 } else { first };
    (index as usize % size, window((first - at + 0.5 * WIDTH as f64) as f32))
}

/// The places of a sum: their distance, how far the first of the middle two is from the middle in steps, and a factor
/// for all amplitudes.
#[derive(Clone, Copy)]
struct Lattice {
    step_mm: f64,
    aside: (f64, f64),
    scale: f64,
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn spread(spectrum: &mut Spectrum, waves: &PlaneWaves, lattice: Lattice) {
    let Lattice { step_mm, aside, scale } = lattice;
    for j in 0..waves.re.len() {
        let (x, y) = (waves.turns_x_per_mm[j] * step_mm, waves.turns_y_per_mm[j] * step_mm);
        let (c, s) = cis(x * aside.0 + y * aside.1);
        let (re, im) = (waves.re[j] * scale, waves.im[j] * scale);
        spectrum.add((x, y), ((re * c - im * s) as f32, (re * s + im * c) as f32));
    }
}

/// The window at `t` from its middle, in units of grid points.
fn shape(t: f64) -> f64 {
    let u = 2.0 * t / WIDTH as f64;
    if u.abs() <= 1.0 { (BETA * ((1.0 - u * u).sqrt() - 1.0)).exp() } else { 0.0 }
}

/// The window between neighbouring grid points, as polynomials in Newton's form.
struct Pieces {
    places: [f32; TERMS],
    terms: [[f32; WIDTH]; TERMS],
}

static PIECES: LazyLock<Pieces> = LazyLock::new(|| {
    // Chebyshev's places in [0, 1], far from their neighbours in the list so that Newton's form is stable.
    let place = |i: usize| 0.5 - 0.5 * (PI * (i as f64 + 0.5) / TERMS as f64).cos();
    let places: [f64; TERMS] = std::array::from_fn(|i| place(4 * i % TERMS));
    let mut terms = [[0.0_f32; WIDTH]; TERMS];
    for piece in 0..WIDTH {
        let mut values: Vec<f64> = places.iter().map(|t| shape((piece as f64 + t) - 0.5 * WIDTH as f64)).collect();
        for level in 1..TERMS {
            for i in (level..TERMS).rev() {
                values[i] = (values[i] - values[i - 1]) / (places[i] - places[i - level]);
            }
        }
        for (term, value) in terms.iter_mut().zip(&values) {
            term[piece] = *value as f32;
        }
    }
    Pieces { places: places.map(|t| t as f32), terms }
});

/// Returns the window's values at all grid points that it reaches, the first of which lies `t` (0 to 1) within it.
#[inline(always)]
fn window(t: f32) -> [f32; WIDTH] {
    let pieces = &*PIECES;
    let mut values = pieces.terms[TERMS - 1];
    for level in (0..TERMS - 1).rev() {
        let from = t - pieces.places[level];
        for (value, term) in values.iter_mut().zip(&pieces.terms[level]) {
            *value = *value * from + term;
        }
    }
    values
}

/// Half the window's places and its values there times the weights of their integral.
static HALF_WINDOW: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
    gauss_legendre_on(24, 0.0, 0.5 * WIDTH as f64).into_iter().map(|(t, w)| (t, 2.0 * w * shape(t))).collect()
});

/// Returns one over the square of the window's transform at each place.
fn fades(n: usize, size: usize) -> Vec<f64> {
    let fade = |from_middle: usize| {
        let at = from_middle as f64 / size as f64;
        let transform: f64 = HALF_WINDOW.iter().map(|(t, w)| w * cis(at * t).0).sum();
        1.0 / (transform * transform)
    };
    let half: Vec<f64> = (0..=n / 2).map(fade).collect();
    (0..n).map(|i| half[i.abs_diff(n / 2)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wave::{axis::SampleAxis, transform};

    /// Waves of a defocused pupil: within a disc of frequencies, the phase growing with their square.
    fn waves(n: usize, reach_per_mm: f64, turns: f64) -> PlaneWaves {
        let mut waves = PlaneWaves::default();
        for i in 0..n {
            let t = (i as f64 + 0.5) / n as f64;
            let (c, s) = cis(0.381_966_011_250_105 * i as f64);
            let (re, im) = cis(turns * t);
            waves.re.push(re);
            waves.im.push(im);
            waves.turns_x_per_mm.push(reach_per_mm * (c * t.sqrt() + 0.1));
            waves.turns_y_per_mm.push(reach_per_mm * s * t.sqrt());
        }
        waves
    }

    #[test]
    fn agrees_with_the_matrix_product() {
        // The spread of frequencies is 1/λN: a reach of 50 per mm is λN = 10 µm.
        for (n, n_rows, n_columns, pitch_mm, turns) in [
            (3000, 24, 31, 0.004, 0.0),
            (5000, 40, 40, 0.004, 3.0),
            (400, 9, 16, 0.002, 0.5),
            (5000, 11, 12, 0.03, 2.0),
        ] {
            let waves = waves(n, 50.0, turns);
            let samples_per_pixel = (2.0 * pitch_mm / 0.01_f64).ceil() as usize + 1;
            let grid = Grid { n_rows, n_columns, pitch_mm, samples_per_pixel };
            let found = mean_square(&waves, grid);
            let axis = |n_pixels| SampleAxis::new(n_pixels, pitch_mm, samples_per_pixel + 2);
            let expected = transform::mean_square(&waves, &axis(n_columns), &axis(n_rows));
            let difference = (&found - &expected).mapv(f64::abs).sum() / expected.sum();
            // Means over pixels from samples a quarter of a period or more apart: some 1e-4 of the whole.
            println!("{n} {n_rows} {n_columns} {pitch_mm} {turns}: {difference:e}");
            assert!(difference < 2e-4, "{n} {pitch_mm}: {difference:e}");
        }
    }

    #[test]
    fn a_single_wave_is_even() {
        let waves =
            PlaneWaves { re: vec![2.0], im: vec![0.0], turns_x_per_mm: vec![-37.0], turns_y_per_mm: vec![412.0] };
        let grid = Grid { n_rows: 20, n_columns: 33, pitch_mm: 0.01, samples_per_pixel: 3 };
        for value in mean_square(&waves, grid) {
            // Single precision and the window's own error, on an amplitude of 2.
            assert!((value - 4.0).abs() < 2e-5, "{value}");
        }
    }
}
