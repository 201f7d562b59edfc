//! The sum of plane waves over an evenly spaced grid of places, by spreading and a fast Fourier transform.
//!
//! Each wave is spread over 8 × 8 points of a grid of frequencies with the window `exp(β (√(1 − t²) − 1))`, the grid is
//! transformed, and the window's own transform is divided out (Barnett, Magland and af Klinteberg, SIAM J. Sci.
//! Comput. 41, 2019). The error is a few 1e-6 of the largest sum that could be. The cost grows with the number of waves
//! plus that of the places, not with their product: where both are many, [`super::transform`] is far slower.

use std::{cell::RefCell, collections::HashMap, f64::consts::PI, sync::LazyLock};

use dioptric_fft::{Complex, Planner};
use dioptric_optics::quadrature::gauss_legendre_on;
use glam::DVec2;
use multiversion::multiversion;
use ndarray::Array2;

use super::{
    cis::cis,
    pixel_mean::{PixelMean, Room},
    transform::PlaneWaves,
};

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
const SPREAD_NS: f64 = 40.0;
const PLACE_NS: f64 = 15.0;

/// A window of pixels about the reference of the waves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub(crate) n_rows: usize,
    pub(crate) n_columns: usize,
    pub(crate) pitch_mm: f64,
    mean: PixelMean,
}

impl Grid {
    /// Returns a window for waves whose λN is `unit_mm`: their irradiance has no frequencies beyond 1/λN.
    pub(crate) fn new(n_rows: usize, n_columns: usize, pitch_mm: f64, unit_mm: f64) -> Self {
        Self { n_rows, n_columns, pitch_mm, mean: PixelMean::new(pitch_mm / unit_mm) }
    }

    /// Whether this way is quicker than the matrix product of so many waves at so many points along the side of a
    /// pixel; by measured costs, in ns.
    pub(crate) fn is_cheaper(self, n_waves: usize, points_per_pixel: usize) -> bool {
        let (n_points, n_waves) = (points_per_pixel as f64, n_waves as f64);
        let product = n_waves * (self.n_rows * self.n_columns) as f64 * n_points * n_points * PRODUCT_NS;
        let (n_x, n_y) = self.n_places();
        let n_places = (n_x * n_y) as f64;
        n_waves * SPREAD_NS + n_places * PLACE_NS < product
    }

    /// Returns the place, from the middle of the window, that the waves have to be counted from: the first of the middle
    /// two where the middle lies between two places.
    pub(crate) fn origin_mm(self) -> DVec2 {
        let (n_x, n_y) = self.n_places();
        let aside = |n: usize| if n.is_multiple_of(2) { 0.5 * self.step_mm() } else { 0.0 };
        DVec2::new(aside(n_x), aside(n_y))
    }

    /// The numbers of places along x and y.
    fn n_places(self) -> (usize, usize) {
        (self.mean.n_samples(self.n_columns), self.mean.n_samples(self.n_rows))
    }

    fn step_mm(self) -> f64 {
        self.pitch_mm / self.mean.samples_per_pixel() as f64
    }
}

/// Returns the mean of |Σ waves|² over each pixel, for waves counted from [`Grid::origin_mm`] that `fill` puts in an
/// old list: rows along y, columns along x, both ascending.
pub(crate) fn mean_square(fill: impl FnOnce(&mut PlaneWaves), grid: Grid) -> Array2<f64> {
    let (n_x, n_y) = grid.n_places();
    SPACE.with_borrow_mut(|space| {
        fill(&mut space.waves);
        let waves = std::mem::take(&mut space.waves);
        space.resize(grid_size(n_x), grid_size(n_y));
        let scale = waves.scale();
        spread(space, &waves, grid.step_mm(), scale);
        space.waves = waves;
        space.transform(n_x, n_y, 1.0 / (scale * scale));
        grid.mean.over(&space.squares, grid.n_rows, grid.n_columns, &mut space.room)
    })
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

thread_local! {
    /// One for each thread: asking for memory and giving it back took a tenth of the time.
    static SPACE: RefCell<Space> = RefCell::new(Space::new());
}

/// Amplitudes on a periodic grid of frequencies, with margins that stand for its far side, and room to transform them.
struct Space {
    size_x: usize,
    size_y: usize,
    re: Vec<f32>,
    im: Vec<f32>,
    /// Which rows hold anything; the others are 0.
    is_used: Vec<bool>,
    lines: Vec<Complex<f32>>,
    columns: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
    /// Of the last sum, in lines along y.
    squares: Vec<f64>,
    waves: PlaneWaves,
    room: Room,
    planner: Planner,
    /// By the numbers of places and of points.
    fades: HashMap<(usize, usize), Vec<f64>>,
}

impl Space {
    fn new() -> Self {
        Self {
            size_x: 0,
            size_y: 0,
            re: vec![],
            im: vec![],
            is_used: vec![],
            lines: vec![],
            columns: vec![],
            scratch: vec![],
            squares: vec![],
            waves: PlaneWaves::default(),
            room: Room::default(),
            planner: Planner::new(),
            fades: HashMap::new(),
        }
    }

    /// Prepares an empty grid; grids are empty whenever they have been transformed.
    fn resize(&mut self, size_x: usize, size_y: usize) {
        (self.size_x, self.size_y) = (size_x, size_y);
        let n = (size_x + WIDTH) * (size_y + WIDTH);
        self.re.clear();
        self.re.resize(n, 0.0);
        self.im.clear();
        self.im.resize(n, 0.0);
        self.is_used.clear();
        self.is_used.resize(size_y + WIDTH, false);
    }

    /// Spreads a wave of these frequencies (turns a place) and this amplitude.
    #[inline(always)]
    fn add(&mut self, turns: (f64, f64), (amplitude_re, amplitude_im): (f32, f32)) {
        let ((column, across), (row, along)) = (start(turns.0, self.size_x), start(turns.1, self.size_y));
        let stride = self.size_x + WIDTH;
        self.is_used[row..row + WIDTH].fill(true);
        let (re, im) = (across.map(|w| w * amplitude_re), across.map(|w| w * amplitude_im));
        for (i, weight) in along.into_iter().enumerate() {
            let from = (row + i) * stride + column;
            for (sum, value) in self.re[from..from + WIDTH].iter_mut().zip(&re) {
                *sum += weight * value;
            }
            for (sum, value) in self.im[from..from + WIDTH].iter_mut().zip(&im) {
                *sum += weight * value;
            }
        }
    }

    /// Computes the squares of the waves at `n_x` × `n_y` places about the middle.
    fn transform(&mut self, n_x: usize, n_y: usize, unscale: f64) {
        let (along_x, along_y) = (self.planner.inverse(self.size_x), self.planner.inverse(self.size_y));
        let n_scratch = along_x.get_inplace_scratch_len().max(along_y.get_inplace_scratch_len());
        self.scratch.resize(n_scratch.max(self.scratch.len()), Complex::ZERO);
        self.gather();
        along_x.process_with_scratch(&mut self.lines, &mut self.scratch[..along_x.get_inplace_scratch_len()]);
        self.turn(n_x);
        along_y.process_with_scratch(&mut self.columns, &mut self.scratch[..along_y.get_inplace_scratch_len()]);
        for (n, size) in [(n_x, self.size_x), (n_y, self.size_y)] {
            self.fades.entry((n, size)).or_insert_with(|| fades(n, size));
        }
        let (fade_x, fade_y) = (&self.fades[&(n_x, self.size_x)], &self.fades[&(n_y, self.size_y)]);
        self.squares.resize(n_x * n_y, 0.0);
        let lines = self.squares.chunks_exact_mut(n_y).zip(self.columns.chunks_exact(self.size_y)).zip(fade_x);
        for ((line, column), fade) in lines {
            // Places below the middle are at the column's end.
            let (below, above) = line.split_at_mut(n_y / 2);
            let (fade_below, fade_above) = fade_y.split_at(n_y / 2);
            square(&column[self.size_y - n_y / 2..], unscale * fade, fade_below, below);
            square(column, unscale * fade, fade_above, above);
        }
    }

    /// Puts the rows that hold anything one after the other as complex numbers.
    fn gather(&mut self) {
        let (stride, size_x) = (self.size_x + WIDTH, self.size_x);
        self.lines.clear();
        for row in (0..self.is_used.len()).filter(|row| self.is_used[*row]) {
            let (re, im) = (&self.re[row * stride..][..stride], &self.im[row * stride..][..stride]);
            let first = self.lines.len();
            self.lines.extend(re[..size_x].iter().zip(im).map(|(re, im)| Complex::new(*re, *im)));
            // What was spread beyond an end belongs to the other.
            for (i, value) in self.lines[first..first + WIDTH].iter_mut().enumerate() {
                *value += Complex::new(re[size_x + i], im[size_x + i]);
            }
        }
    }

    /// Turns transformed rows into columns, of the places that are asked for.
    fn turn(&mut self, n_x: usize) {
        let (size_x, size_y) = (self.size_x, self.size_y);
        self.columns.clear();
        self.columns.resize(n_x * size_y, Complex::ZERO);
        let rows = (0..self.is_used.len()).filter(|row| self.is_used[*row]);
        for (row, line) in rows.zip(self.lines.chunks_exact(size_x)) {
            let row = if row < size_y { row } else { row - size_y };
            let places = line[size_x - n_x / 2..].iter().chain(line);
            for (place, value) in self.columns[row..].iter_mut().step_by(size_y).zip(places) {
                *place += value;
            }
        }
    }
}

/// Sets each square to that of a value, times its fade and another factor.
fn square(values: &[Complex<f32>], factor: f64, fades: &[f64], squares: &mut [f64]) {
    for ((square, value), fade) in squares.iter_mut().zip(values).zip(fades) {
        let (re, im) = (f64::from(value.re), f64::from(value.im));
        *square = (re * re + im * im) * (factor * fade);
    }
}

/// Returns the first grid point that a frequency is spread over, and the window's values there and after it.
#[inline(always)]
fn start(turns: f64, size: usize) -> (usize, [f32; WIDTH]) {
    // In 32 bits: conversions of longer numbers take several steps.
    let n = size as i32;
    let at = (turns - turns.floor()) * f64::from(n);
    let first = (at - 0.5 * WIDTH as f64).ceil();
    let index = first as i32;
    let index = if index < 0 { index + n } else { index };
    let index = if index < n { index } else { index - n };
    (index as usize, window((first - at + 0.5 * WIDTH as f64) as f32))
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn spread(space: &mut Space, waves: &PlaneWaves, step_mm: f64, scale: f64) {
    let amplitudes = waves.re.iter().zip(&waves.im);
    for ((x, y), (re, im)) in waves.turns_x_per_mm.iter().zip(&waves.turns_y_per_mm).zip(amplitudes) {
        space.add((x * step_mm, y * step_mm), ((re * scale) as f32, (im * scale) as f32));
    }
}

/// The window at `t` from its middle, in units of grid points.
fn shape(t: f64) -> f64 {
    let u = 2.0 * t / WIDTH as f64;
    if u.abs() <= 1.0 { (BETA * ((1.0 - u * u).sqrt() - 1.0)).exp() } else { 0.0 }
}

/// The window between neighboring grid points: polynomials in `2 t − 1`, the highest power first.
static PIECES: LazyLock<[[f32; WIDTH]; TERMS]> = LazyLock::new(|| {
    let mut terms = [[0.0_f32; WIDTH]; TERMS];
    for piece in 0..WIDTH {
        let of = |u: f64| shape(piece as f64 + 0.5 * (u + 1.0) - 0.5 * WIDTH as f64);
        for (term, value) in terms.iter_mut().zip(chebyshev_fit(of)) {
            term[piece] = value as f32;
        }
    }
    terms
});

/// Returns the coefficients, the highest first, of the polynomial that meets a function at Chebyshev's places in [−1, 1].
fn chebyshev_fit(of: impl Fn(f64) -> f64) -> [f64; TERMS] {
    let angle = |i: usize| PI * (i as f64 + 0.5) / TERMS as f64;
    let values: [f64; TERMS] = std::array::from_fn(|i| of(angle(i).cos()));
    // Chebyshev's polynomials by their recurrence, as lists of coefficients from the lowest.
    let (mut before, mut here) = ([0.0; TERMS], [0.0; TERMS]);
    here[0] = 1.0;
    let mut sum = [0.0; TERMS];
    for k in 0..TERMS {
        let share = if k == 0 { 1.0 } else { 2.0 } / TERMS as f64;
        let coefficient = share * values.iter().enumerate().map(|(i, v)| v * (k as f64 * angle(i)).cos()).sum::<f64>();
        for (power, c) in here.iter().enumerate() {
            sum[TERMS - 1 - power] += coefficient * c;
        }
        let mut next = before.map(|c: f64| -c);
        for power in 1..TERMS {
            next[power] += if k == 0 { here[power - 1] } else { 2.0 * here[power - 1] };
        }
        (before, here) = (here, next);
    }
    sum
}

/// Returns the window's values at all grid points that it reaches, the first of which lies `t` (0 to 1) within it.
#[inline(always)]
fn window(t: f32) -> [f32; WIDTH] {
    let pieces = &*PIECES;
    let u = 2.0 * t - 1.0;
    let mut values = pieces[0];
    for terms in &pieces[1..] {
        for (value, term) in values.iter_mut().zip(terms) {
            *value = *value * u + term;
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
    fn waves(n: usize, reach_per_mm: f64, turns: f64, origin_mm: DVec2) -> PlaneWaves {
        let mut waves = PlaneWaves::default();
        for i in 0..n {
            let t = (i as f64 + 0.5) / n as f64;
            let (c, s) = cis(0.381_966_011_250_105 * i as f64);
            let per_mm = DVec2::new(c * t.sqrt() + 0.1, s * t.sqrt()) * reach_per_mm;
            let (re, im) = cis(turns * t + per_mm.dot(origin_mm));
            waves.re.push(re);
            waves.im.push(im);
            waves.turns_x_per_mm.push(per_mm.x);
            waves.turns_y_per_mm.push(per_mm.y);
        }
        waves
    }

    #[test]
    fn agrees_with_the_matrix_product() {
        // The spread of frequencies is 1/λN: a reach of 50 per mm is λN = 10 µm.
        for (n, n_rows, n_columns, pitch_mm, turns) in [
            (3000, 24, 31, 0.004, 0.0),
            (5000, 40, 40, 0.0047, 3.0),
            (5000, 40, 40, 0.0095, 0.0),
            (400, 9, 16, 0.002, 0.5),
            (5000, 11, 12, 0.03, 2.0),
        ] {
            let grid = Grid::new(n_rows, n_columns, pitch_mm, 0.01);
            let found = mean_square(|list| *list = waves(n, 50.0, turns, grid.origin_mm()), grid);
            let n_points = (2.0 * pitch_mm / 0.01_f64).ceil() as usize + 4;
            let axis = |n_pixels| SampleAxis::new(n_pixels, pitch_mm, n_points);
            let waves = waves(n, 50.0, turns, DVec2::ZERO);
            let expected = transform::mean_square(&waves, &axis(n_columns), &axis(n_rows));
            let difference = (&found - &expected).mapv(f64::abs).sum() / expected.sum();
            // Means over pixels of an irradiance whose band ends at up to 0.48 turns a sample: 6e-5 of the whole.
            println!("{n} {n_rows} {n_columns} {pitch_mm} {turns}: {difference:e}");
            assert!(difference < 1e-4, "{n} {pitch_mm}: {difference:e}");
        }
    }

    #[test]
    fn a_single_wave_is_even() {
        let wave =
            PlaneWaves { re: vec![2.0], im: vec![0.0], turns_x_per_mm: vec![-37.0], turns_y_per_mm: vec![412.0] };
        let grid = Grid::new(20, 33, 0.01, 0.01);
        for value in mean_square(|list| *list = wave, grid) {
            // Single precision and the window's own error, on an amplitude of 2.
            assert!((value - 4.0).abs() < 2e-5, "{value}");
        }
    }
}
