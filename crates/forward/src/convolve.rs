//! Linear convolution of small blocks: directly, and by Fourier transform.

use std::{cell::RefCell, collections::HashMap, rc::Rc, sync::Arc};

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner, num_complex::Complex};

/// Rows transformed together, so that the transpose writes whole cache lines.
const BATCH: usize = 8;

/// Returns the smallest even size of at least `n` whose transform is fast (factors 2, 3 and 5).
pub(crate) fn fast_size(n: usize) -> usize {
    let is_fast = |mut m: usize| {
        for factor in [2, 3, 5] {
            while m.is_multiple_of(factor) {
                m /= factor;
            }
        }
        m == 1
    };
    (n.max(2)..).find(|&m| m % 2 == 0 && is_fast(m)).expect("powers of two have no end")
}

/// Transforms of real squares of one size.
///
/// A spectrum is stored column by column: `size / 2 + 1` columns of `size` values.
pub(crate) struct Fft2 {
    size: usize,
    row_forward: Arc<dyn RealToComplex<f32>>,
    row_inverse: Arc<dyn ComplexToReal<f32>>,
    column_forward: Arc<dyn Fft<f32>>,
    column_inverse: Arc<dyn Fft<f32>>,
    work: Work,
}

/// Working memory of the transforms.
struct Work {
    row: Vec<f32>,
    half: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

thread_local! {
    static PLANS: RefCell<HashMap<usize, Rc<RefCell<Fft2>>>> = RefCell::new(HashMap::new());
}

/// Lends the transforms of a size; each thread keeps its own.
pub(crate) fn with_fft<R>(size: usize, body: impl FnOnce(&mut Fft2) -> R) -> R {
    let plan = PLANS.with(|plans| {
        Rc::clone(plans.borrow_mut().entry(size).or_insert_with(|| Rc::new(RefCell::new(Fft2::new(size)))))
    });
    body(&mut plan.borrow_mut())
}

impl Fft2 {
    fn new(size: usize) -> Self {
        let (mut real, mut complex) = (RealFftPlanner::<f32>::new(), FftPlanner::<f32>::new());
        let (row_forward, row_inverse) = (real.plan_fft_forward(size), real.plan_fft_inverse(size));
        let (column_forward, column_inverse) = (complex.plan_fft_forward(size), complex.plan_fft_inverse(size));
        let n_scratch = [
            row_forward.get_scratch_len(),
            row_inverse.get_scratch_len(),
            column_forward.get_inplace_scratch_len(),
            column_inverse.get_inplace_scratch_len(),
        ];
        let n_scratch = n_scratch.into_iter().max().expect("four lengths");
        let zero = Complex::new(0.0, 0.0);
        let work =
            Work { row: vec![0.0; size], half: vec![zero; BATCH * (size / 2 + 1)], scratch: vec![zero; n_scratch] };
        Self { size, row_forward, row_inverse, column_forward, column_inverse, work }
    }

    /// The number of values of a spectrum.
    pub(crate) fn spectrum_len(&self) -> usize {
        self.size * (self.size / 2 + 1)
    }

    /// Puts the spectrum of a block of `columns` samples a row, padded with zeros, into `spectrum`.
    pub(crate) fn forward(&mut self, block: &[f32], columns: usize, spectrum: &mut Vec<Complex<f32>>) {
        let (size, n_half) = (self.size, self.size / 2 + 1);
        spectrum.clear();
        spectrum.resize(self.spectrum_len(), Complex::new(0.0, 0.0));
        let Work { row, half, scratch } = &mut self.work;
        for (batch, rows) in block.chunks(BATCH * columns).enumerate() {
            for (samples, half) in rows.chunks_exact(columns).zip(half.chunks_exact_mut(n_half)) {
                row[..columns].copy_from_slice(samples);
                row[columns..].fill(0.0);
                self.row_forward.process_with_scratch(row, half, scratch).expect("lengths are those of the plan");
            }
            let n_rows = rows.len() / columns;
            for (k, column) in spectrum.chunks_exact_mut(size).enumerate() {
                for (i, value) in column[batch * BATCH..][..n_rows].iter_mut().enumerate() {
                    *value = half[i * n_half + k];
                }
            }
        }
        self.column_forward.process_with_scratch(spectrum, scratch);
    }

    /// Puts the first `rows` rows of the square of a spectrum into `block`, `columns` samples each, and
    /// leaves the spectrum in disorder. The transform is scaled so that it undoes [`Fft2::forward`].
    pub(crate) fn inverse(&mut self, spectrum: &mut [Complex<f32>], rows: usize, columns: usize, block: &mut Vec<f32>) {
        let (size, n_half) = (self.size, self.size / 2 + 1);
        let Work { row, half, scratch } = &mut self.work;
        self.column_inverse.process_with_scratch(spectrum, scratch);
        let scale = 1.0 / (size * size) as f32;
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
                self.row_inverse.process_with_scratch(half, row, scratch).expect("lengths are those of the plan");
                block.extend(row[..columns].iter().map(|value| value * scale));
            }
        }
    }
}

/// Adds the product of two spectra to a third.
pub(crate) fn multiply_add(sum: &mut [Complex<f32>], a: &[Complex<f32>], b: &[Complex<f32>]) {
    for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
        sum.re += a.re * b.re - a.im * b.im;
        sum.im += a.re * b.im + a.im * b.re;
    }
}

/// Samples of the output that stay in registers together.
const LANES: usize = 32;

/// The widest kernel for which direct convolution is used, samples.
pub(crate) const MAX_DIRECT: usize = 25;

/// The block of samples that is convolved directly at once: rows and columns.
pub(crate) const DIRECT_BLOCK: (usize, usize) = (16, 32);

/// Adds the full convolution of a block of [`DIRECT_BLOCK`] size with a square kernel of `width` samples to `out`,
/// which begins at the block's first sample less half a kernel and has `stride` samples a row.
///
/// `padded` holds the block's rows with `width − 1` zeros before each and at least as many behind.
#[multiversion::multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn convolve_padded(padded: &[f32], padded_stride: usize, kernel: &[f32], width: usize, out: &mut [f32], stride: usize) {
    let (n_rows, n_columns) = DIRECT_BLOCK;
    for row in 0..n_rows + width - 1 {
        let kernel_rows = (row + 1).saturating_sub(n_rows)..width.min(row + 1);
        for first in (0..n_columns + width - 1).step_by(LANES) {
            let mut sum = [0.0_f32; LANES];
            for kernel_row in kernel_rows.clone() {
                let samples = &padded[(row - kernel_row) * padded_stride + first..][..LANES + width - 1];
                let weights = &kernel[kernel_row * width..][..width];
                for (j, weight) in weights.iter().rev().enumerate() {
                    for (sum, sample) in sum.iter_mut().zip(&samples[j..j + LANES]) {
                        *sum += weight * sample;
                    }
                }
            }
            let n = LANES.min(n_columns + width - 1 - first);
            for (out, sum) in out[row * stride + first..][..n].iter_mut().zip(&sum) {
                *out += sum;
            }
        }
    }
}

/// Working memory of direct convolution.
#[derive(Default)]
pub(crate) struct Direct {
    padded: Vec<f32>,
}

impl Direct {
    /// Adds the full convolution of `block` (rows of `columns` samples, at most [`DIRECT_BLOCK`]) with a square
    /// kernel of `width` samples to `out`, whose first sample belongs to the block's first less half a kernel.
    pub(crate) fn add(&mut self, block: &[&[f32]], kernel: &[f32], width: usize, out: &mut [f32], stride: usize) {
        let (n_rows, n_columns) = DIRECT_BLOCK;
        let padded_stride = (n_columns + width - 1).next_multiple_of(LANES) + width - 1;
        self.padded.clear();
        self.padded.resize(n_rows * padded_stride, 0.0);
        for (row, samples) in block.iter().enumerate() {
            self.padded[row * padded_stride + width - 1..][..samples.len()].copy_from_slice(samples);
        }
        convolve_padded(&self.padded, padded_stride, kernel, width, out, stride);
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

    fn brute_force(block: &[f32], rows: usize, columns: usize, kernel: &[f32], width: usize) -> Vec<f64> {
        let stride = columns + width - 1;
        let mut out = vec![0.0; (rows + width - 1) * stride];
        for (at, &sample) in block.iter().enumerate() {
            let (row, column) = (at / columns, at % columns);
            for (k, &weight) in kernel.iter().enumerate() {
                out[(row + k / width) * stride + column + k % width] += f64::from(sample) * f64::from(weight);
            }
        }
        out
    }

    #[test]
    fn sizes_are_even_and_have_small_factors() {
        assert_eq!([1, 7, 97, 191, 193, 257].map(fast_size), [2, 8, 100, 192, 200, 270]);
    }

    #[test]
    fn transform_convolves_as_the_sum_does() {
        for (rows, columns, width) in [(5, 9, 3), (40, 64, 33), (128, 128, 63)] {
            let (block, kernel) = (noise(rows * columns, 1), noise(width * width, 2));
            let size = fast_size(rows.max(columns) + width - 1);
            let mut out = Vec::new();
            with_fft(size, |fft| {
                let (mut a, mut b) = (Vec::new(), Vec::new());
                fft.forward(&block, columns, &mut a);
                fft.forward(&kernel, width, &mut b);
                let mut sum = vec![Complex::new(0.0, 0.0); fft.spectrum_len()];
                multiply_add(&mut sum, &a, &b);
                fft.inverse(&mut sum, rows + width - 1, columns + width - 1, &mut out);
            });
            let expected = brute_force(&block, rows, columns, &kernel, width);
            let largest = expected.iter().copied().fold(0.0, f64::max);
            let worst = out.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
            // Single precision: 6e-8 a step, some tens of steps.
            assert!(worst < 2e-6 * largest, "{rows} x {columns} with {width}: {worst} of {largest}");
        }
    }

    #[test]
    fn direct_blocks_convolve_as_the_sum_does() {
        for (rows, columns, width) in [(16, 32, 1), (16, 32, 7), (11, 5, 25), (16, 32, 25)] {
            let (block, kernel) = (noise(rows * columns, 3), noise(width * width, 4));
            let stride = DIRECT_BLOCK.1 + width - 1;
            let mut out = vec![0.0; (DIRECT_BLOCK.0 + width - 1) * stride];
            let lines: Vec<&[f32]> = block.chunks(columns).collect();
            Direct::default().add(&lines, &kernel, width, &mut out, stride);
            let expected = brute_force(&block, rows, columns, &kernel, width);
            for (row, expected) in expected.chunks(columns + width - 1).enumerate() {
                for (a, b) in out[row * stride..].iter().zip(expected) {
                    assert!((f64::from(*a) - b).abs() <= 1e-5 * b.max(1.0), "{a} {b}");
                }
            }
        }
    }
}
