//! Linear convolution of small blocks: directly, and by Fourier transform.

use std::{cell::RefCell, collections::HashMap, ops::Range, rc::Rc, sync::Arc};

use dioptric_fft::{Complex, ComplexToReal, Fft, Planner, RealToComplex};
use multiversion::multiversion;

/// Rows transformed together, so that the transpose writes whole cache lines.
const BATCH: usize = 8;

/// Returns the smallest size of at least `n` whose transform is fast: a multiple of 4 with the factors 2 and 3, or of 8 with one of 5, 7 and 11 besides. Others are up to
/// four times as slow a sample (docs/PERFORMANCE.md).
pub(crate) fn fast_size(n: usize) -> usize {
    let without = |mut m: usize, factor: usize| {
        while m.is_multiple_of(factor) {
            m /= factor;
        }
        m
    };
    let is_fast = |m: usize| match without(without(m, 2), 3) {
        1 => m.is_multiple_of(4),
        5 | 7 | 11 => m.is_multiple_of(8),
        _ => false,
    };
    (n..).find(|&m| m > 0 && is_fast(m)).expect("powers of two have no end")
}

/// Transforms of lines of one size.
struct Plans {
    size: usize,
    real_forward: Arc<dyn RealToComplex<f32>>,
    real_inverse: Arc<dyn ComplexToReal<f32>>,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

impl Plans {
    fn new(size: usize, planner: &mut Planner) -> Self {
        Self {
            size,
            real_forward: planner.real_forward(size),
            real_inverse: planner.real_inverse(size),
            forward: planner.forward(size),
            inverse: planner.inverse(size),
        }
    }

    fn scratch_len(&self) -> usize {
        let of_real = self.real_forward.get_scratch_len().max(self.real_inverse.get_scratch_len());
        of_real.max(self.forward.get_inplace_scratch_len()).max(self.inverse.get_inplace_scratch_len())
    }
}

/// Transforms of real rectangles of one size.
///
/// A spectrum is stored column by column: half as many as the rectangle has and one more, as long as its own.
pub(crate) struct Fft2 {
    down: Rc<Plans>,
    across: Rc<Plans>,
    work: Work,
}

/// Working memory of the transforms.
#[derive(Default)]
struct Work {
    row: Vec<f32>,
    half: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

/// What a thread transforms with.
#[derive(Default)]
struct Transforms {
    planner: Planner,
    by_size: HashMap<usize, Rc<Plans>>,
    work: Work,
}

impl Transforms {
    fn plans(&mut self, size: usize) -> Rc<Plans> {
        self.by_size.entry(size).or_insert_with(|| Rc::new(Plans::new(size, &mut self.planner))).clone()
    }
}

thread_local! {
    static TRANSFORMS: RefCell<Transforms> = RefCell::default();
}

/// Lends the transforms of rectangles of so many rows and columns; each thread keeps its own.
pub(crate) fn with_fft<R>((rows, columns): (usize, usize), body: impl FnOnce(&mut Fft2) -> R) -> R {
    let mut fft = TRANSFORMS.with_borrow_mut(|transforms| {
        let (down, across) = (transforms.plans(rows), transforms.plans(columns));
        Fft2::new(down, across, std::mem::take(&mut transforms.work))
    });
    let result = body(&mut fft);
    TRANSFORMS.with_borrow_mut(|transforms| transforms.work = fft.work);
    result
}

impl Fft2 {
    fn new(down: Rc<Plans>, across: Rc<Plans>, mut work: Work) -> Self {
        let zero = Complex::new(0.0, 0.0);
        work.row.resize(across.size, 0.0);
        work.half.resize(BATCH * (across.size / 2 + 1), zero);
        work.scratch.resize(down.scratch_len().max(across.scratch_len()), zero);
        Self { down, across, work }
    }

    /// The number of values of a spectrum.
    pub(crate) fn spectrum_len(&self) -> usize {
        self.down.size * (self.across.size / 2 + 1)
    }

    /// Samples along a column of the rectangles.
    pub(crate) fn rows(&self) -> usize {
        self.down.size
    }

    /// Samples along a row of the rectangles.
    pub(crate) fn columns(&self) -> usize {
        self.across.size
    }

    /// Samples of a rectangle.
    pub(crate) fn len(&self) -> usize {
        self.down.size * self.across.size
    }

    /// Puts the spectrum of two blocks, one as the real and one as the imaginary part of some whole rows, padded with zeros below, into `spectrum`: column by
    /// column, as many as a row has samples. Leaves the rows in disorder.
    pub(crate) fn forward_pair(&mut self, lines: &mut [Complex<f32>], spectrum: &mut [Complex<f32>]) {
        let (rows, columns, scratch) = (self.down.size, self.across.size, &mut self.work.scratch);
        self.across.forward.process_with_scratch(lines, scratch);
        transpose(lines, columns, spectrum, rows);
        // Below the rows there may be those of another block.
        let n_rows = lines.len() / columns;
        spectrum.chunks_exact_mut(rows).for_each(|column| column[n_rows..].fill(Complex::new(0.0, 0.0)));
        self.down.forward.process_with_scratch(spectrum, scratch);
    }

    /// Fills `lines` with as many first rows of the rectangle of the spectrum of a pair, and leaves the spectrum in disorder. What [`Fft2::forward_pair`]
    /// was given comes back times the number of samples of the rectangle.
    pub(crate) fn inverse_pair(&mut self, spectrum: &mut [Complex<f32>], lines: &mut [Complex<f32>]) {
        let (rows, columns, scratch) = (self.down.size, self.across.size, &mut self.work.scratch);
        self.down.inverse.process_with_scratch(spectrum, scratch);
        transpose(spectrum, rows, lines, columns);
        self.across.inverse.process_with_scratch(lines, scratch);
    }

    /// Puts the spectrum of a block of `columns` samples a row, padded with zeros, into `spectrum`.
    pub(crate) fn forward(&mut self, block: &[f32], columns: usize, spectrum: &mut Vec<Complex<f32>>) {
        let (size, n_half) = (self.down.size, self.across.size / 2 + 1);
        spectrum.clear();
        spectrum.resize(self.spectrum_len(), Complex::new(0.0, 0.0));
        let Work { row, half, scratch } = &mut self.work;
        for (batch, rows) in block.chunks(BATCH * columns).enumerate() {
            for (samples, half) in rows.chunks_exact(columns).zip(half.chunks_exact_mut(n_half)) {
                row[..columns].copy_from_slice(samples);
                row[columns..].fill(0.0);
                let transform = &self.across.real_forward;
                transform.process_with_scratch(row, half, scratch).expect("lengths are those of the plan");
            }
            let n_rows = rows.len() / columns;
            for (k, column) in spectrum.chunks_exact_mut(size).enumerate() {
                for (i, value) in column[batch * BATCH..][..n_rows].iter_mut().enumerate() {
                    *value = half[i * n_half + k];
                }
            }
        }
        self.down.forward.process_with_scratch(spectrum, scratch);
    }

    /// Puts the first `rows` rows of the rectangle of a spectrum into `block`, `columns` samples each, and
    /// leaves the spectrum in disorder. The transform is scaled so that it undoes [`Fft2::forward`].
    pub(crate) fn inverse(&mut self, spectrum: &mut [Complex<f32>], rows: usize, columns: usize, block: &mut Vec<f32>) {
        let (size, n_half, scale) = (self.down.size, self.across.size / 2 + 1, 1.0 / self.len() as f32);
        let Work { row, half, scratch } = &mut self.work;
        self.down.inverse.process_with_scratch(spectrum, scratch);
        block.clear();
        block.reserve(rows * columns);
        for first in (0..rows).step_by(BATCH) {
            let n_rows = BATCH.min(rows - first);
            for (k, column) in spectrum.chunks_exact(size).enumerate() {
                for (i, value) in column[first..][..n_rows].iter().enumerate() {
                    half[i * n_half + k] = *value;
                }
            }
            for half in half.chunks_exact_mut(n_half).take(n_rows) {
                // A real row has real first and last coefficients; rounding leaves a trace that the plan refuses.
                half[0].im = 0.0;
                half[n_half - 1].im = 0.0;
                let transform = &self.across.real_inverse;
                transform.process_with_scratch(half, row, scratch).expect("lengths are those of the plan");
                block.extend(row[..columns].iter().map(|value| value * scale));
            }
        }
    }
}

/// Puts the transpose of lines of `from_len` values, one after the other, into lines of `to_len`: as many as there are of these, and of each no more than
/// there are lines.
fn transpose(from: &[Complex<f32>], from_len: usize, to: &mut [Complex<f32>], to_len: usize) {
    let (n_from, n_to) = ((from.len() / from_len).min(to_len), (to.len() / to_len).min(from_len));
    // Squares of as many values a side as fill a line of the cache.
    let (whole_from, whole_to) = (n_from - n_from % BATCH, n_to - n_to % BATCH);
    for row in (0..whole_from).step_by(BATCH) {
        for column in (0..whole_to).step_by(BATCH) {
            let mut square = [[Complex::new(0.0, 0.0); BATCH]; BATCH];
            for (line, from) in square.iter_mut().zip(from[row * from_len + column..].chunks(from_len)) {
                line.copy_from_slice(&from[..BATCH]);
            }
            for (i, to) in to[column * to_len + row..].chunks_mut(to_len).take(BATCH).enumerate() {
                to[..BATCH].iter_mut().zip(&square).for_each(|(to, line)| *to = line[i]);
            }
        }
    }
    for row in 0..n_from {
        let from = &from[row * from_len..][..n_to];
        let first = if row < whole_from { whole_to } else { 0 };
        for (column, value) in (first..).zip(&from[first..]) {
            to[column * to_len + row] = *value;
        }
    }
}

/// Adds the product of two spectra to a third.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
pub(crate) fn multiply_add(sum: &mut [Complex<f32>], a: &[Complex<f32>], b: &[Complex<f32>]) {
    for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
        sum.re += a.re * b.re - a.im * b.im;
        sum.im += a.re * b.im + a.im * b.re;
    }
}

/// Multiplies the spectrum of a block or a pair, columns of so many values, by that of a real block, of which there are half the columns: the others are
/// their complex conjugates, turned about.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
pub(crate) fn multiply_by_real(spectrum: &mut [Complex<f32>], half: &[Complex<f32>], rows: usize) {
    let (columns, n_half) = (spectrum.len() / rows, half.len() / rows);
    for (k, column) in spectrum.chunks_exact_mut(rows).enumerate() {
        if k < n_half {
            column.iter_mut().zip(&half[k * rows..][..rows]).for_each(|(value, factor)| *value *= factor);
            continue;
        }
        let mirrored = &half[(columns - k) * rows..][..rows];
        column[0] *= mirrored[0].conj();
        let turned_about = mirrored[1..].iter().rev();
        column[1..].iter_mut().zip(turned_about).for_each(|(value, factor)| *value *= factor.conj());
    }
}

/// Samples of the output that stay in registers together, or half as many.
pub(crate) const LANES: usize = 32;

/// Rows of samples that are convolved directly at once.
pub(crate) const STRIP_ROWS: usize = 16;

/// Columns of samples that are convolved directly at once, at most.
pub(crate) const STRIP_COLUMNS: usize = 128;

/// Adds a vector times a factor to another.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
pub(crate) fn add_scaled(sum: &mut [f32], factor: f32, values: &[f32]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
}

/// The full convolution of a strip of samples, which has planes of samples, each with a kernel of its own for every row.
struct PaddedStrip<'a> {
    /// The rows of the planes with one zero less than kernels have columns before each and at least as many behind.
    padded: &'a [f32],
    padded_stride: usize,
    kernels: &'a [f32],
    /// Rows and columns of kernels.
    kernel_size: (usize, usize),
    n_columns: usize,
    /// Of each row, the columns that hold more than zeros.
    lit: &'a [Range<usize>],
}

impl PaddedStrip<'_> {
    /// Adds the convolution to `out`, which begins with what a kernel's first sample makes of the strip's first and has `stride` samples a row.
    #[inline(always)]
    fn add_to<const PLANES: usize>(&self, out: &mut [f32], stride: usize) {
        let (height, width) = self.kernel_size;
        let n_out = self.n_columns + width - 1;
        for (row, out) in out.chunks_mut(stride).take(self.lit.len() + height - 1).enumerate() {
            let mut first = 0;
            while first < n_out {
                if n_out - first > LANES {
                    self.add_part::<PLANES, { 2 * LANES }>(row, first, &mut out[..n_out]);
                    first += 2 * LANES;
                } else {
                    self.add_part::<PLANES, LANES>(row, first, &mut out[..n_out]);
                    first += LANES;
                }
            }
        }
    }

    /// Adds `N` samples of a row, from one on, to it.
    #[inline(always)]
    fn add_part<const PLANES: usize, const N: usize>(&self, row: usize, first: usize, out: &mut [f32]) {
        let (height, width) = self.kernel_size;
        // Planes are summed apart, so that no sum waits for the one before it.
        let mut sums = [[0.0_f32; N]; PLANES];
        for source in ((row + 1).saturating_sub(height)..self.lit.len().min(row + 1)).rev() {
            let lit = &self.lit[source];
            if lit.end <= first || lit.start >= first + N + width - 1 {
                continue;
            }
            for (plane, sums) in sums.iter_mut().enumerate() {
                let mut sum = *sums;
                let line = source * PLANES + plane;
                let samples = &self.padded[line * self.padded_stride + first..][..N + width - 1];
                let kernel = &self.kernels[(line * height + row - source) * width..][..width];
                for (weight, samples) in kernel.iter().rev().zip(samples.windows(N)) {
                    sum.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += weight * sample);
                }
                *sums = sum;
            }
        }
        let (total, others) = sums.split_first_mut().expect("there is a plane");
        for other in others {
            total.iter_mut().zip(other).for_each(|(sum, other)| *sum += *other);
        }
        out[first..].iter_mut().zip(total).for_each(|(out, sum)| *out += *sum);
    }
}

/// Adds the full convolution of a strip to `out`; see [`PaddedStrip::add_to`].
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2", "aarch64+neon"))]
fn convolve_padded(strip: &PaddedStrip<'_>, n_planes: usize, (out, stride): (&mut [f32], usize)) {
    match n_planes {
        1 => strip.add_to::<1>(out, stride),
        2 => strip.add_to::<2>(out, stride),
        _ => strip.add_to::<3>(out, stride),
    }
}

/// A strip of samples and the kernels of its rows, which change along a row as polynomials.
pub(crate) struct Strip {
    /// Rows and columns of kernels.
    kernel_size: (usize, usize),
    n_polynomials: usize,
    n_columns: usize,
    padded_stride: usize,
    padded: Vec<f32>,
    /// Of each row, the columns of `padded` that may not be zero.
    lit: Vec<Range<usize>>,
    kernels: Vec<f32>,
}

impl Strip {
    /// Returns an empty strip for kernels of so many rows and columns.
    pub(crate) fn new(kernel_size: (usize, usize), n_polynomials: usize) -> Self {
        let kernels = vec![0.0; STRIP_ROWS * n_polynomials * kernel_size.0 * kernel_size.1];
        Self { kernel_size, n_polynomials, n_columns: 0, padded_stride: 0, padded: vec![], lit: vec![], kernels }
    }

    /// The kernels of a row, one for each polynomial.
    pub(crate) fn kernels_of_row(&mut self, row: usize) -> &mut [f32] {
        let n = self.n_polynomials * self.kernel_size.0 * self.kernel_size.1;
        &mut self.kernels[row * n..][..n]
    }

    /// Takes rows of samples, at most [`STRIP_ROWS`] × [`STRIP_COLUMNS`], and the polynomials at their columns; returns whether
    /// there is anything but zeros.
    pub(crate) fn load<'a>(&mut self, lines: impl Iterator<Item = &'a [f32]>, polynomials: &[[f32; 3]]) -> bool {
        let width = self.kernel_size.1;
        self.n_columns = polynomials.len();
        self.padded_stride = (self.n_columns + width - 1).next_multiple_of(LANES) + width - 1;
        self.padded.clear();
        self.lit.clear();
        for line in lines {
            let first = line.iter().position(|sample| *sample != 0.0).unwrap_or(line.len());
            let end = line.iter().rposition(|sample| *sample != 0.0).map_or(first, |last| last + 1);
            self.lit.push(width - 1 + first..width - 1 + end);
            for plane in 0..self.n_polynomials {
                let start = self.padded.len();
                self.padded.resize(start + self.padded_stride, 0.0);
                let padded = &mut self.padded[start + width - 1..];
                for ((padded, sample), polynomials) in padded.iter_mut().zip(line).zip(polynomials) {
                    *padded = sample * polynomials[plane];
                }
            }
        }
        self.lit.iter().any(|lit| !lit.is_empty())
    }

    /// Adds the full convolution of the strip to `out`, which begins with what a kernel's first sample makes of the strip's first.
    pub(crate) fn add_to(&self, out: &mut [f32], stride: usize) {
        let strip = PaddedStrip {
            padded: &self.padded,
            padded_stride: self.padded_stride,
            kernels: &self.kernels,
            kernel_size: self.kernel_size,
            n_columns: self.n_columns,
            lit: &self.lit,
        };
        convolve_padded(&strip, self.n_polynomials, (out, stride));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: usize, seed: u32) -> Vec<f32> {
        let mut state = seed;
        let next = move |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        (0..n).map(next).collect()
    }

    fn brute_force(block: &[f32], (rows, columns): (usize, usize), kernel: &[f32], width: usize) -> Vec<f64> {
        let stride = columns + width - 1;
        let mut out = vec![0.0; (rows + kernel.len() / width - 1) * stride];
        for (at, &sample) in block.iter().enumerate() {
            let (row, column) = (at / columns, at % columns);
            for (k, &weight) in kernel.iter().enumerate() {
                out[(row + k / width) * stride + column + k % width] += f64::from(sample) * f64::from(weight);
            }
        }
        out
    }

    #[test]
    fn sizes_have_few_factors() {
        assert_eq!([0, 1, 7, 97, 191, 193, 241, 257, 265].map(fast_size), [4, 4, 8, 108, 192, 216, 256, 264, 288]);
    }

    #[test]
    fn transform_convolves_as_the_sum_does() {
        for (rows, columns, height, width) in [(5, 9, 3, 3), (40, 64, 33, 17), (128, 128, 63, 63), (70, 9, 1, 40)] {
            let (block, kernel) = (noise(rows * columns, 1), noise(height * width, 2));
            let size = (fast_size(rows + height - 1), fast_size(columns + width - 1));
            let mut out = Vec::new();
            with_fft(size, |fft| {
                let (mut a, mut b) = (Vec::new(), Vec::new());
                fft.forward(&block, columns, &mut a);
                fft.forward(&kernel, width, &mut b);
                let mut sum = vec![Complex::new(0.0, 0.0); fft.spectrum_len()];
                multiply_add(&mut sum, &a, &b);
                fft.inverse(&mut sum, rows + height - 1, columns + width - 1, &mut out);
            });
            let expected = brute_force(&block, (rows, columns), &kernel, width);
            let largest = expected.iter().copied().fold(0.0, f64::max);
            let worst = out.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
            // Single precision: 6e-8 a step, some tens of steps.
            assert!(worst < 2e-6 * largest, "{rows} x {columns} with {height} x {width}: {worst} of {largest}");
        }
    }

    #[test]
    fn strips_convolve_as_the_sum_does() {
        for (rows, columns, height, width) in [(16, 32, 1, 1), (16, 32, 7, 7), (11, 5, 3, 25), (16, 128, 25, 14)] {
            let block = noise(rows * columns, 3);
            // Three kernels for each row, and three polynomials along it.
            let kernels: Vec<Vec<f32>> = (0..3 * rows as u32).map(|i| noise(height * width, 4 + i)).collect();
            let polynomials: Vec<[f32; 3]> =
                (0..columns).map(|column| [1.0, 0.01 * column as f32, 1e-4 * (column * column) as f32]).collect();
            let stride = columns + width - 1;
            let mut strip = Strip::new((height, width), 3);
            for row in 0..rows {
                strip.kernels_of_row(row).copy_from_slice(&kernels[3 * row..3 * row + 3].concat());
            }
            let mut out = vec![0.0; (rows + height - 1) * stride];
            assert!(strip.load(block.chunks(columns), &polynomials));
            strip.add_to(&mut out, stride);
            let mut expected = vec![0.0; out.len()];
            for (row, line) in block.chunks(columns).enumerate() {
                for plane in 0..3 {
                    let weighted: Vec<f32> = line.iter().zip(&polynomials).map(|(v, p)| v * p[plane]).collect();
                    let spread = brute_force(&weighted, (1, columns), &kernels[3 * row + plane], width);
                    expected[row * stride..].iter_mut().zip(spread).for_each(|(sum, v)| *sum += v);
                }
            }
            for (a, b) in out.iter().zip(&expected) {
                assert!((f64::from(*a) - b).abs() <= 1e-5 * b.max(1.0), "{a} {b}");
            }
            assert!(!strip.load(vec![0.0; columns].chunks(columns), &polynomials));
        }
    }
}
