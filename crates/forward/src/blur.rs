//! One layer in one band: its ideal picture, light or alpha, spread by PSFs that vary over the film.

use std::collections::BTreeMap;

use dioptric_fft::Complex;
use dioptric_psf::FilmMap;
use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;

use crate::{
    block_layers::BlockLayers,
    convolve::{STRIP_COLUMNS, STRIP_ROWS, Strip, fast_size, multiply_add, with_fft},
    knot_kernels::{KnotKernel, LayerKernels, edge_spread_peak},
    occlusion::BlurredPlane,
    sampler::{Rectangle, Sampler, Surface},
    stopwatch::{Part, Stopwatch},
    tiles::{Knot, LARGEST, Patch, polynomials},
    work::Work,
};

/// Cells blurred before their results are added up: bounds the memory, and keeps the order of the sums.
const CELLS_AT_ONCE: usize = 32;

/// What to blur.
pub(crate) struct LayerTask<'a> {
    pub(crate) sampler: &'a Sampler,
    pub(crate) map: &'a FilmMap,
    pub(crate) layer: usize,
    /// Their light is blurred where they have radiance, their alpha where not.
    pub(crate) surfaces: &'a [Surface<'a>],
    /// Those of the surfaces.
    pub(crate) blocks: &'a BlockLayers,
    pub(crate) patches: &'a [Patch],
    pub(crate) kernels: &'a LayerKernels,
    pub(crate) film_rows: usize,
    pub(crate) film_columns: usize,
    /// A term that changes no edge by more than this is left out.
    pub(crate) negligible_edge: f64,
    pub(crate) stopwatch: &'a Stopwatch,
}

/// The blurred light or alpha of a cell.
struct BlurredCell {
    at: Rectangle,
    values: Vec<f32>,
}

/// Blurs a layer into `out`, which must be clear; each patch counts as `patch_units` of work.
pub(crate) fn blur_layer(
    task: &LayerTask<'_>,
    out: &mut BlurredPlane,
    work: &Work<'_>,
    patch_units: u64,
) -> Result<(), Cancelled> {
    let mut knots: Vec<Knot> =
        task.patches.iter().flat_map(|patch| patch.shares.iter().map(|&(knot, _)| knot)).collect();
    knots.sort_unstable();
    knots.dedup();
    let kernels: BTreeMap<Knot, KnotKernel> = knots.into_par_iter().map(|knot| (knot, task.kernels.at(knot))).collect();
    for patches in task.patches.chunks(CELLS_AT_ONCE) {
        let blur = |patch| {
            let blurred = blur_patch(task, &kernels, patch, work.cancel());
            work.advance(patch_units);
            blurred
        };
        let blurred: Vec<Option<BlurredCell>> = patches.par_iter().map(blur).collect::<Result<_, Cancelled>>()?;
        task.stopwatch.time(Part::Compositing, || {
            blurred.iter().flatten().for_each(|cell| add_cell(task, cell, out));
        });
    }
    Ok(())
}

fn blur_patch(
    task: &LayerTask<'_>,
    kernels: &BTreeMap<Knot, KnotKernel>,
    patch: &Patch,
    cancel: &Cancel,
) -> Result<Option<BlurredCell>, Cancelled> {
    let cell = &patch.cell;
    let width = patch.shares.iter().map(|(knot, _)| kernels[knot].width).max().unwrap_or(1);
    let half = width / 2;
    let (first_row, first_column) = cell.first_pixel(&task.sampler.frame);
    let whole = Rectangle { first_row, first_column, rows: cell.size, columns: cell.size };
    let Some(source) = whole.clipped(task.film_rows, task.film_columns, half) else { return Ok(None) };
    let sample = || task.sampler.sample(source, task.map, task.layer, task.surfaces, task.blocks, cancel);
    let Some(mut ideal) = task.stopwatch.time(Part::Sampling, sample)? else { return Ok(None) };
    let expansion = Expansion::of(patch, kernels, (width, task.negligible_edge), cancel)?;
    if task.surfaces.iter().all(|surface| surface.radiance.is_none()) {
        // What a surface covers is 1 all over it, however its kernels change.
        let share = (1.0 / expansion.uniform_response(cell.size)) as f32;
        ideal.iter_mut().for_each(|alpha| *alpha *= share);
    }
    let places = Places::new(patch, &source, task.sampler);
    let values = if expansion.is_better_direct(&source) {
        task.stopwatch.time(Part::Direct, || spread_directly(&ideal, &places, &expansion, cancel))
    } else {
        task.stopwatch.time(Part::Transforms, || spread_by_transform(&ideal, &places, &expansion, cancel))
    };
    let at = Rectangle {
        first_row: source.first_row - half as i64,
        first_column: source.first_column - half as i64,
        rows: source.rows + 2 * half,
        columns: source.columns + 2 * half,
    };
    Ok(Some(BlurredCell { at, values: values? }))
}

/// The kernel over a cell: a sum of squares of samples, each times a polynomial down and one across the cell.
struct Expansion {
    width: usize,
    terms: Vec<Term>,
}

struct Term {
    /// Numbers of the polynomials.
    down: usize,
    across: usize,
    samples: Vec<f32>,
}

/// Multiplications that take about as long as the transform of a sample.
const COST_OF_TRANSFORM: usize = 64;

impl Expansion {
    fn of(
        patch: &Patch,
        kernels: &BTreeMap<Knot, KnotKernel>,
        (width, negligible_edge): (usize, f64),
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        let mut terms = vec![];
        for product in 0..9 {
            cancel.check()?;
            let (down, across) = (product / 3, product % 3);
            let mut samples = vec![0.0; width * width];
            for (knot, shares) in patch.shares.iter().filter(|(_, shares)| shares[product] != 0.0) {
                kernels[knot].add_to(&mut samples, width, shares[product]);
            }
            let largest = LARGEST[down] * LARGEST[across];
            if product == 0 || largest * edge_spread_peak(&samples, width) > negligible_edge {
                terms.push(Term { down, across, samples });
            }
        }
        Ok(Self { width, terms })
    }

    /// Returns what these kernels make of a uniform plane of 1, to the second moments (docs/forward.md, eq. 2).
    fn uniform_response(&self, cell_size: usize) -> f64 {
        let middle = (self.width / 2) as f64;
        let moment = |term: &Term| -> f64 {
            let of = |(i, sample): (usize, &f32)| {
                let (down, across) = ((i / self.width) as f64 - middle, (i % self.width) as f64 - middle);
                f64::from(*sample) * down.powi(term.down as i32) * across.powi(term.across as i32)
            };
            term.samples.iter().enumerate().map(of).sum()
        };
        let second = self.terms.iter().filter(|term| term.down + term.across == 2);
        let excess = second.map(moment).sum::<f64>() / (cell_size * cell_size) as f64;
        // The expansion holds while it is small.
        1.0 + excess.clamp(-0.2, 0.2)
    }

    /// The number of polynomials across the cell.
    fn n_across(&self) -> usize {
        1 + self.terms.iter().map(|term| term.across).max().unwrap_or(0)
    }

    /// The side of the transforms of a rectangle.
    fn transform_size(&self, source: &Rectangle) -> usize {
        fast_size(source.rows.max(source.columns) + self.width - 1)
    }

    /// Whether a sum takes less time than transforms.
    fn is_better_direct(&self, source: &Rectangle) -> bool {
        let lanes = source.rows * (source.columns + self.width - 1);
        let direct = self.n_across() * self.width * self.width * lanes;
        let n_transforms = 2 * self.terms.len() + 1;
        direct <= n_transforms * self.transform_size(source).pow(2) * COST_OF_TRANSFORM
    }

    /// Returns the kernel at a place down the cell, for each polynomial across it.
    fn at_row(&self, down: &[f32; 3], kernels: &mut [f32]) {
        kernels.fill(0.0);
        let n = self.width * self.width;
        for term in &self.terms {
            let factor = down[term.down];
            let kernel = &mut kernels[term.across * n..][..n];
            kernel.iter_mut().zip(&term.samples).for_each(|(kernel, sample)| *kernel += factor * sample);
        }
    }
}

/// The polynomials of a cell at the rows and columns of a rectangle in it.
struct Places {
    down: Vec<[f32; 3]>,
    across: Vec<[f32; 3]>,
}

impl Places {
    fn new(patch: &Patch, source: &Rectangle, sampler: &Sampler) -> Self {
        let at = |row: usize, column: usize| {
            let (row, column) = (source.first_row + row as i64, source.first_column + column as i64);
            patch.cell.place_of(&sampler.frame, row, column)
        };
        Self {
            down: (0..source.rows).map(|row| polynomials(at(row, 0).0 as f32)).collect(),
            across: (0..source.columns).map(|column| polynomials(at(0, column).1 as f32)).collect(),
        }
    }
}

/// Spreads a plane by sums: exactly the kernel of each row, and along a row that of each sample.
fn spread_directly(
    values: &[f32],
    places: &Places,
    expansion: &Expansion,
    cancel: &Cancel,
) -> Result<Vec<f32>, Cancelled> {
    let (rows, columns) = (places.down.len(), places.across.len());
    let (width, n_across) = (expansion.width, expansion.n_across());
    let (out_rows, out_columns) = (rows + width - 1, columns + width - 1);
    let mut out = vec![0.0; out_rows * out_columns];
    let mut strip = Strip::new(width, n_across);
    for top in (0..rows).step_by(STRIP_ROWS) {
        let n_rows = STRIP_ROWS.min(rows - top);
        for (row, down) in places.down[top..top + n_rows].iter().enumerate() {
            cancel.check()?;
            expansion.at_row(down, strip.kernels_of_row(row));
        }
        for left in (0..columns).step_by(STRIP_COLUMNS) {
            let across = &places.across[left..(left + STRIP_COLUMNS).min(columns)];
            cancel.check()?;
            let lines = (top..top + n_rows).map(|row| &values[row * columns + left..][..across.len()]);
            if strip.load(lines, across) {
                strip.add_to(&mut out[top * out_columns + left..], out_columns);
            }
        }
    }
    Ok(out)
}

/// Spreads a plane by transforms: the sum over the terms of what each does to the plane times its polynomials.
fn spread_by_transform(
    values: &[f32],
    places: &Places,
    expansion: &Expansion,
    cancel: &Cancel,
) -> Result<Vec<f32>, Cancelled> {
    let (rows, columns, width) = (places.down.len(), places.across.len(), expansion.width);
    let size = fast_size(rows.max(columns) + width - 1);
    with_fft(size, |fft| {
        let (mut kernel, mut spectrum) = (vec![], vec![]);
        let mut sum = vec![Complex::new(0.0, 0.0); fft.spectrum_len()];
        let mut weighted = vec![0.0; rows * columns];
        for term in &expansion.terms {
            cancel.check()?;
            fft.forward(&term.samples, width, &mut kernel);
            cancel.check()?;
            let lines = weighted.chunks_exact_mut(columns).zip(values.chunks_exact(columns));
            for ((weighted, values), down) in lines.zip(&places.down) {
                let down = down[term.down];
                for ((weighted, value), across) in weighted.iter_mut().zip(values).zip(&places.across) {
                    *weighted = value * (down * across[term.across]);
                }
            }
            fft.forward(&weighted, columns, &mut spectrum);
            multiply_add(&mut sum, &spectrum, &kernel);
        }
        cancel.check()?;
        let mut out = vec![];
        fft.inverse(&mut sum, rows + width - 1, columns + width - 1, &mut out);
        Ok(out)
    })
}

/// Adds what of a blurred cell lies on the film.
fn add_cell(task: &LayerTask<'_>, cell: &BlurredCell, out: &mut BlurredPlane) {
    let Some(on_film) = cell.at.clipped(task.film_rows, task.film_columns, 0) else { return };
    let (skip_rows, skip_columns) =
        ((on_film.first_row - cell.at.first_row) as usize, (on_film.first_column - cell.at.first_column) as usize);
    for row in 0..on_film.rows {
        let first = (row + skip_rows) * cell.at.columns + skip_columns;
        let part = &cell.values[first..first + on_film.columns];
        out.add_row(on_film.first_row as usize + row, on_film.first_column as usize, part);
    }
}
