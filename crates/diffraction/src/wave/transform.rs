//! The sum of plane waves over a grid of places: a matrix product in single precision.
//!
//! A plane wave of amplitude a and frequency (fx, fy) has the value `a cis(fx x) cis(fy y)`. The places are symmetric
//! about 0, so the four sums of `a cos cos`, `a cos sin`, `a sin cos` and `a sin sin` serve four places each: half the
//! work of the plain sum. They are one real matrix product, left factors (complex a times cos or sin along y) by
//! right factors (cos and sin along x), done in tiles of 4 × 16 over blocks of nodes that stay in the nearest cache.
//!
//! Phases are recurrences in double precision, counted in turns, and only their cosines are rounded to single.
//! The code is compiled once for the base instruction set and once for AVX2, chosen at run time; neither uses fused
//! multiply-add, and the order of every sum is fixed, so every machine gives the same bits.

use std::f64::consts::TAU;

use glam::{DMat2, DVec2};
use multiversion::multiversion;
use ndarray::Array2;

use super::{axis::SampleAxis, cis::cis};

/// Plane waves: amplitudes, and frequencies in turns per mm.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlaneWaves {
    pub(crate) re: Vec<f64>,
    pub(crate) im: Vec<f64>,
    pub(crate) turns_x_per_mm: Vec<f64>,
    pub(crate) turns_y_per_mm: Vec<f64>,
}

impl PlaneWaves {
    /// Returns one over the sum of the amplitudes: single precision then works on numbers up to 1.
    pub(crate) fn scale(&self) -> f64 {
        let sum: f64 = self.re.iter().zip(&self.im).map(|(re, im)| (re * re + im * im).sqrt()).sum();
        if sum > 0.0 { 1.0 / sum } else { 1.0 }
    }

    /// Returns |Σ waves|² at a place, mm from where they count from, and its derivatives.
    pub(crate) fn irradiance_at(&self, at_mm: DVec2) -> Irradiance {
        let [u, x, y, xx, xy, yy] = derivatives(self, at_mm);
        // ∂|U|² = 2 Re(U* ∂U), and ∂∂'|U|² = 2 Re(∂U* ∂'U + U* ∂∂'U).
        let of = |a: (f64, f64), b: (f64, f64)| 2.0 * (a.0 * b.0 + a.1 * b.1);
        let mixed = of(x, y) + of(u, xy);
        Irradiance {
            value: 0.5 * of(u, u),
            slope: DVec2::new(of(u, x), of(u, y)),
            bend: DMat2::from_cols(DVec2::new(of(x, x) + of(u, xx), mixed), DVec2::new(mixed, of(y, y) + of(u, yy))),
        }
    }
}

/// |Σ waves|² at a place: its value, its derivatives along x and y, per mm, and its second ones.
#[derive(Clone, Debug)]
pub(crate) struct Irradiance {
    pub(crate) value: f64,
    pub(crate) slope: DVec2,
    pub(crate) bend: DMat2,
}

/// Returns U = Σ waves at a place with its derivatives by x, y, xx, xy and yy: real and imaginary parts.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn derivatives(waves: &PlaneWaves, at_mm: DVec2) -> [(f64, f64); 6] {
    let mut sums = [(0.0, 0.0); 6];
    let (x_turns, y_turns) = (&waves.turns_x_per_mm, &waves.turns_y_per_mm);
    for ((re, im), (x, y)) in waves.re.iter().zip(&waves.im).zip(x_turns.iter().zip(y_turns)) {
        let (c, s) = cis(x * at_mm.x + y * at_mm.y);
        let (re, im) = (re * c - im * s, re * s + im * c);
        let (kx, ky) = (TAU * x, TAU * y);
        // A derivative is a factor i k.
        for (sum, (re, im)) in sums.iter_mut().zip([
            (re, im),
            (-im * kx, re * kx),
            (-im * ky, re * ky),
            (-re * kx * kx, -im * kx * kx),
            (-re * kx * ky, -im * kx * ky),
            (-re * ky * ky, -im * ky * ky),
        ]) {
            *sum = (sum.0 + re, sum.1 + im);
        }
    }
    sums
}

/// Places along x in a tile.
const PLACES: usize = 8;
/// Columns of a tile: a cosine and a sine a place.
const COLUMNS: usize = 2 * PLACES;
/// Rows of a tile, all of one place along y: re and im of a cos, re and im of a sin.
const ROWS: usize = 4;
/// Nodes in a block: 16 KiB of right factors a panel.
const BLOCK: usize = 256;

type Tile = [[f32; COLUMNS]; ROWS];

/// Returns the mean of |Σ waves|² over each pixel: rows along y, columns along x, both ascending.
pub(crate) fn mean_square(waves: &PlaneWaves, x: &SampleAxis, y: &SampleAxis) -> Array2<f64> {
    let (n_panels, n_rows) = (x.n_half().div_ceil(PLACES), y.n_half());
    let mut sums = vec![[[0.0; COLUMNS]; ROWS]; n_panels * n_rows];
    let mut factors = Factors::new(x, y);
    let scale = waves.scale();
    for start in (0..waves.re.len()).step_by(BLOCK) {
        let block = start..(start + BLOCK).min(waves.re.len());
        factors.fill(waves, block, scale, x, y);
        multiply(&factors.left, &factors.right, factors.n_nodes, &mut sums);
    }
    gather(&sums, n_panels, x, y, scale)
}

/// The two factors for one block of nodes.
struct Factors {
    /// For each place along y, then each node: re and im of a cos, re and im of a sin.
    left: Vec<[f32; ROWS]>,
    /// For each panel of places along x, then each node: the cosines, the sines.
    right: Vec<[f32; COLUMNS]>,
    n_nodes: usize,
}

impl Factors {
    fn new(x: &SampleAxis, y: &SampleAxis) -> Self {
        let left = vec![[0.0; ROWS]; y.n_half() * BLOCK];
        let right = vec![[0.0; COLUMNS]; x.n_half().div_ceil(PLACES) * BLOCK];
        Self { left, right, n_nodes: 0 }
    }

    fn fill(&mut self, waves: &PlaneWaves, block: std::ops::Range<usize>, scale: f64, x: &SampleAxis, y: &SampleAxis) {
        let n = block.len();
        self.n_nodes = n;
        let right = &mut self.right;
        phases(&waves.turns_x_per_mm[block.clone()], x, |place, c, s| {
            let panel = &mut right[place / PLACES * n..][..n];
            let lane = place % PLACES;
            for ((row, c), s) in panel.iter_mut().zip(c).zip(s) {
                row[lane] = *c as f32;
                row[PLACES + lane] = *s as f32;
            }
        });
        let left = &mut self.left;
        let (re, im) = (&waves.re[block.clone()], &waves.im[block.clone()]);
        phases(&waves.turns_y_per_mm[block], y, |place, c, s| {
            let rows = &mut left[place * n..][..n];
            for (j, row) in rows.iter_mut().enumerate() {
                let (re, im) = (re[j] * scale, im[j] * scale);
                *row = [(re * c[j]) as f32, (im * c[j]) as f32, (re * s[j]) as f32, (im * s[j]) as f32];
            }
        });
    }
}

/// Calls `put` with the cosines and sines of all nodes at each place at 0 and above, in order.
///
/// The first in each point of a pixel is computed, the following are turned on by the phase of one pixel.
fn phases(turns_per_mm: &[f64], axis: &SampleAxis, mut put: impl FnMut(usize, &[f64], &[f64])) {
    let n = turns_per_mm.len();
    let at = |x_mm: f64| {
        let mut phase = Phases { c: vec![0.0; n], s: vec![0.0; n] };
        start_phases(turns_per_mm, x_mm, &mut phase.c, &mut phase.s);
        phase
    };
    let step = at(axis.pitch_mm);
    let mut points: Vec<Option<Phases>> = vec![None; axis.n_points()];
    for place in 0..axis.n_half() {
        let (_, point) = axis.locate(place);
        match &mut points[point] {
            Some(phase) => turn(&mut phase.c, &mut phase.s, &step.c, &step.s),
            none => *none = Some(at(axis.at_mm(place))),
        }
        if let Some(phase) = &points[point] {
            put(place, &phase.c, &phase.s);
        }
    }
}

/// Cosines and sines of the phases of all nodes at one place.
#[derive(Clone)]
struct Phases {
    c: Vec<f64>,
    s: Vec<f64>,
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn start_phases(turns_per_mm: &[f64], x_mm: f64, c: &mut [f64], s: &mut [f64]) {
    for ((turns, c), s) in turns_per_mm.iter().zip(c).zip(s) {
        (*c, *s) = cis(turns * x_mm);
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn turn(c: &mut [f64], s: &mut [f64], step_c: &[f64], step_s: &[f64]) {
    for (((c, s), dc), ds) in c.iter_mut().zip(s).zip(step_c).zip(step_s) {
        (*c, *s) = (*c * dc - *s * ds, *c * ds + *s * dc);
    }
}

/// Adds left × right of one block to the sums.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn multiply(left: &[[f32; ROWS]], right: &[[f32; COLUMNS]], n_nodes: usize, sums: &mut [Tile]) {
    let n_panels = right.len() / BLOCK;
    for panel in 0..n_panels {
        let right = &right[panel * n_nodes..][..n_nodes];
        for (tiles, left) in sums.chunks_exact_mut(n_panels).zip(left.chunks_exact(n_nodes)) {
            let sum = product(left, right);
            let tile = &mut tiles[panel];
            for row in 0..ROWS {
                for column in 0..COLUMNS {
                    tile[row][column] += sum[row][column];
                }
            }
        }
    }
}

#[inline(always)]
fn product(left: &[[f32; ROWS]], right: &[[f32; COLUMNS]]) -> Tile {
    let mut sum = [[0.0; COLUMNS]; ROWS];
    for (l, r) in left.iter().zip(right) {
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                sum[row][column] += l[row] * r[column];
            }
        }
    }
    sum
}

/// Combines the four sums of each pair of places into the squares at their four mirror images, and averages those
/// over the pixels.
fn gather(sums: &[Tile], n_panels: usize, x: &SampleAxis, y: &SampleAxis, scale: f64) -> Array2<f64> {
    let (nx, ny) = (x.n_pixels, y.n_pixels);
    let mut mean = Array2::zeros((ny, nx));
    let unscale = 1.0 / (scale * scale);
    for row in 0..y.n_half() {
        let (pixel_y, point_y) = y.locate(row);
        let weight_y = y.weight(point_y) * unscale;
        // 0 is its own mirror image, and counts once.
        let only_y = row == 0 && y.has_middle();
        for column in 0..x.n_half() {
            let (pixel_x, point_x) = x.locate(column);
            let weight = weight_y * x.weight(point_x);
            let only_x = column == 0 && x.has_middle();
            let tile = &sums[row * n_panels + column / PLACES];
            let square = squares(tile, column % PLACES);
            mean[(pixel_y, pixel_x)] += weight * square[0];
            if !only_x {
                mean[(pixel_y, nx - 1 - pixel_x)] += weight * square[1];
            }
            if !only_y {
                mean[(ny - 1 - pixel_y, pixel_x)] += weight * square[2];
            }
            if !only_x && !only_y {
                mean[(ny - 1 - pixel_y, nx - 1 - pixel_x)] += weight * square[3];
            }
        }
    }
    mean
}

/// Returns |U|² at (x, y), (−x, y), (x, −y), (−x, −y).
#[inline(always)]
fn squares(tile: &Tile, lane: usize) -> [f64; 4] {
    let at = |row: usize, column: usize| f64::from(tile[row][column]);
    let complex = |row: usize, column: usize| (at(row, column), at(row + 1, column));
    let (cc, cs) = (complex(0, lane), complex(0, PLACES + lane));
    let (sc, ss) = (complex(2, lane), complex(2, PLACES + lane));
    // (cos ± i sin)(cos ± i sin), term by term.
    let square = |x: f64, y: f64| {
        let re = cc.0 - x * cs.1 - y * sc.1 - x * y * ss.0;
        let im = cc.1 + x * cs.0 + y * sc.0 - x * y * ss.1;
        re * re + im * im
    };
    [square(1.0, 1.0), square(-1.0, 1.0), square(1.0, -1.0), square(-1.0, -1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few hundred waves of no particular kind.
    fn waves(n: usize) -> PlaneWaves {
        let mut waves = PlaneWaves::default();
        for i in 0..n {
            let t = i as f64 / n as f64;
            let (re, im) = cis(7.3 * t * t);
            waves.re.push(re * (1.0 + t));
            waves.im.push(im * (1.0 + t));
            let (fx, fy) = cis(31.7 * t);
            waves.turns_x_per_mm.push(fx * t);
            waves.turns_y_per_mm.push(fy * t.sqrt());
        }
        waves
    }

    fn square_at(waves: &PlaneWaves, x: f64, y: f64) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        for j in 0..waves.re.len() {
            let (c, s) = cis(waves.turns_x_per_mm[j] * x + waves.turns_y_per_mm[j] * y);
            re += waves.re[j] * c - waves.im[j] * s;
            im += waves.re[j] * s + waves.im[j] * c;
        }
        re * re + im * im
    }

    #[test]
    fn agrees_with_the_sum_written_out() {
        for (n, nx, ny) in [(300, 30, 7), (1, 1, 1), (700, 13, 26)] {
            let waves = waves(n);
            let (x, y) = (SampleAxis::new(nx, 0.13, 1), SampleAxis::new(ny, 0.11, 1));
            let found = mean_square(&waves, &x, &y);
            let peak = 1.0 / waves.scale().powi(2);
            for ((row, column), value) in found.indexed_iter() {
                let place = |i: usize, n: usize, pitch: f64| (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch;
                let expected = square_at(&waves, place(column, nx, 0.13), place(row, ny, 0.11));
                // Single precision of the largest sum that could be.
                assert!((value - expected).abs() < 1e-6 * peak, "{n} {row} {column}: {value}, {expected}");
            }
        }
    }

    #[test]
    fn product_has_the_bits_of_the_plain_loop_on_any_instruction_set() {
        let (x, y) = (SampleAxis::new(2 * PLACES, 0.13, 1), SampleAxis::new(8, 0.11, 1));
        let mut factors = Factors::new(&x, &y);
        factors.fill(&waves(200), 0..200, 1.0, &x, &y);
        let mut sums = vec![[[0.0; COLUMNS]; ROWS]; y.n_half()];
        multiply(&factors.left, &factors.right, 200, &mut sums);
        for (place, sum) in sums.iter().enumerate() {
            // This call is compiled for the base instruction set, `multiply` chose the best that there is.
            assert_eq!(*sum, product(&factors.left[200 * place..][..200], &factors.right[..200]));
        }
    }

    #[test]
    fn pixels_are_means_over_their_area() {
        let waves = waves(40);
        let fine = mean_square(&waves, &SampleAxis::new(40, 0.01, 2), &SampleAxis::new(30, 0.01, 2));
        let coarse = mean_square(&waves, &SampleAxis::new(4, 0.1, 8), &SampleAxis::new(3, 0.1, 8));
        for ((row, column), value) in coarse.indexed_iter() {
            let part = fine.slice(ndarray::s![10 * row..10 * row + 10, 10 * column..10 * column + 10]);
            assert!((part.mean().unwrap() / value - 1.0).abs() < 1e-5, "{row} {column}");
        }
    }
}
