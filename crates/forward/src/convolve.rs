//! Linear convolution of small blocks: directly, and by Fourier transform.

use std::{cell::RefCell, collections::HashMap, rc::Rc, sync::Arc};

use dioptric_fft::{Complex, ComplexToReal, Fft, Planner, RealToComplex};
use multiversion::multiversion;

/// Rows transformed or turned together, so that the transpose writes whole cache lines.
pub(crate) const BATCH: usize = 8;

/// Returns the smallest size of at least `n` whose transform is fast: a multiple of 4 with the factors 2 and 3, or of 8 with one of 5, 7 and 11 besides. Others are up to
/// four times as slow a sample (docs/notes/2026-11-performance.md).
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
        self.real_forward
            .get_scratch_len()
            .max(self.real_inverse.get_scratch_len())
            .max(self.forward.get_inplace_scratch_len())
            .max(self.inverse.get_inplace_scratch_len())
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

    /// Returns the first rows and columns of the rectangle of a spectrum as [`Fft2::forward`] gives it, times the number of its samples, and leaves the spectrum
    /// in disorder.
    pub(crate) fn inverse(&mut self, spectrum: &mut [Complex<f32>], (rows, columns): (usize, usize)) -> Vec<f32> {
        let (size, n_half) = (self.down.size, self.across.size / 2 + 1);
        let Work { row, half, scratch } = &mut self.work;
        self.down.inverse.process_with_scratch(spectrum, scratch);
        let mut block = Vec::with_capacity(rows * columns);
        for first in (0..rows).step_by(BATCH) {
            let n_rows = BATCH.min(rows - first);
            for (k, column) in spectrum.chunks_exact(size).enumerate() {
                for (i, value) in column[first..][..n_rows].iter().enumerate() {
                    half[i * n_half + k] = *value;
                }
            }
            for half in half.chunks_exact_mut(n_half).take(n_rows) {
                // Real but for rounding: the mean, and the highest frequency of an even number.
                half[0].im = 0.0;
                half[n_half - 1].im = 0.0;
                let transform = &self.across.real_inverse;
                transform.process_with_scratch(half, row, scratch).expect("lengths are those of the plan");
                block.extend_from_slice(&row[..columns]);
            }
        }
        block
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

/// Samples of the output that stay in registers together.
pub(crate) const LANES: usize = 32;

/// Adds a vector times a factor to another.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
pub(crate) fn add_scaled(sum: &mut [f32], factor: f32, values: &[f32]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
}
