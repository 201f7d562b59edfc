//! One layer in one band on one raster: its ideal picture, light or alpha, spread by PSFs that vary over the film.

use std::collections::{BTreeMap, BTreeSet};

use dioptric_fft::Complex;
use dioptric_psf::FilmMap;
use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;

use crate::{
    block_layers::BlockLayers,
    by_knots::{KnotRaster, spread_by_knots},
    convolve::{STRIP_COLUMNS, STRIP_ROWS, Strip, fast_size, multiply_add, with_fft},
    expansion::Expansion,
    knot_kernels::{KnotKernel, LayerKernels},
    level::Level,
    occlusion::BlurredPlane,
    patch::{Knot, Patch, Products, value_of},
    patch_samples::{BlurredCell, PatchSamples, Places},
    rectangle::Rectangle,
    sampler::{Sampler, Surface},
    stopwatch::{Part, Stopwatch},
    uniform_response::{LEAST_RESPONSE, uniform_response},
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
    /// A factor of alpha.
    pub(crate) level: Option<&'a Level>,
    pub(crate) film_rows: usize,
    pub(crate) film_columns: usize,
    /// Length that the weights of knots are smoothed over, pixels.
    pub(crate) smoothing_px: usize,
    /// A term that changes no edge by more than this is left out.
    pub(crate) negligible_edge: f64,
    pub(crate) stopwatch: &'a Stopwatch,
}

/// What becomes of a patch.
enum Spread<'a> {
    /// Nothing of the layer is in it.
    Nothing,
    Done(BlurredCell),
    /// It takes less time together with the patches around it.
    ByKnots(PatchSamples<'a>),
}

/// Blurs a layer into `out`, which must be clear; each patch counts as `patch_units` of work.
pub(crate) fn blur_layer(
    task: &LayerTask<'_>,
    out: &mut BlurredPlane,
    work: &Work<'_>,
    patch_units: u64,
) -> Result<(), Cancelled> {
    let whole = task.patches.iter().filter(|patch| !patch.is_by_knots);
    let mut knots: Vec<Knot> = whole.flat_map(|patch| patch.shares.iter().map(|&(knot, _)| knot)).collect();
    knots.sort_unstable();
    knots.dedup();
    let kernels: BTreeMap<Knot, KnotKernel> = knots.into_par_iter().map(|knot| (knot, task.kernels.at(knot))).collect();
    let mut by_knots = vec![];
    for patches in task.patches.chunks(CELLS_AT_ONCE) {
        let blur = |patch| {
            let spread = blur_patch(task, &kernels, patch, work.cancel());
            work.advance(patch_units);
            spread
        };
        let spreads: Vec<Spread<'_>> = patches.par_iter().map(blur).collect::<Result<_, Cancelled>>()?;
        task.stopwatch.time(Part::Compositing, || {
            for spread in spreads {
                match spread {
                    Spread::Nothing => {}
                    Spread::Done(cell) => add_cell(task, &cell, out),
                    Spread::ByKnots(patch) => by_knots.push(patch),
                }
            }
        });
    }
    let raster = KnotRaster {
        kernels: task.kernels,
        patches: task.patches,
        frame: &task.sampler.frame,
        half_px: task.smoothing_px / 2,
    };
    let responses = task.responses_around(&by_knots);
    raster.level(&mut by_knots, responses.as_ref());
    spread_by_knots(&raster, &by_knots, (task.stopwatch, work.cancel()), &mut |cell| add_cell(task, cell, out))
}

impl LayerTask<'_> {
    /// Whether what the layer covers is blurred, not its light.
    fn is_alpha(&self) -> bool {
        self.surfaces.iter().all(|surface| surface.radiance.is_none())
    }

    /// Multiplies the alpha of a rectangle by what levels it.
    fn level_by(&self, level: &Level, source: &Rectangle, alpha: &mut [f32]) {
        let frame = &self.sampler.frame;
        let ((center_row, center_column), factor) = (frame.center(), frame.factor() as f64);
        for (line, row) in alpha.chunks_exact_mut(source.columns).zip(source.first_row..) {
            let down_px = factor * (row as f64 - center_row);
            for (alpha, column) in line.iter_mut().zip(source.first_column..).filter(|(alpha, _)| **alpha != 0.0) {
                *alpha *= level.at(factor * (column as f64 - center_column), down_px);
            }
        }
    }

    fn response_of(&self, patch: &Patch) -> Products {
        uniform_response(self.kernels, patch, self.sampler.frame.factor())
    }

    /// Returns the responses around samples whose weights are smoothed, by the number of the patch, where they are needed.
    fn responses_around(&self, sampled: &[PatchSamples<'_>]) -> Option<BTreeMap<u32, Products>> {
        let around = sampled.iter().filter_map(|sampled| sampled.patch.around.as_ref());
        let near: BTreeSet<u32> = around.flat_map(|around| around.patches.iter().copied()).collect();
        let of = |number: u32| (number, self.response_of(&self.patches[number as usize]));
        self.is_alpha().then(|| near.into_par_iter().map(of).collect())
    }

    /// Where samples of any kernel of a patch lie.
    fn window_of(&self, patch: &Patch) -> Rectangle {
        let windows = patch.shares.iter().map(|&(knot, _)| self.kernels.window_at(knot));
        Rectangle::around(windows).unwrap_or(Rectangle::PIXEL)
    }
}

fn blur_patch<'a>(
    task: &LayerTask<'a>,
    kernels: &BTreeMap<Knot, KnotKernel>,
    patch: &'a Patch,
    cancel: &Cancel,
) -> Result<Spread<'a>, Cancelled> {
    let cell = &patch.cell;
    let pixels = cell.pixels(&task.sampler.frame);
    let Some(source) = pixels.in_reach_of(task.film_rows, task.film_columns, &task.window_of(patch)) else {
        return Ok(Spread::Nothing);
    };
    let sample = || task.sampler.sample(source, task.map, task.layer, task.surfaces, task.blocks, cancel);
    let Some(mut ideal) = task.stopwatch.time(Part::Sampling, sample)? else { return Ok(Spread::Nothing) };
    let places = Places::new(patch, &source, task.sampler);
    if let (true, Some(level)) = (task.is_alpha(), task.level) {
        task.level_by(level, &source, &mut ideal);
    }
    if task.is_alpha() && patch.around.is_none() {
        // What a surface covers is 1 all over it, however its kernels change.
        let response = task.response_of(patch);
        for (line, down) in ideal.chunks_exact_mut(source.columns).zip(&places.down) {
            let level = |across| value_of(&response, down, across).max(LEAST_RESPONSE);
            line.iter_mut().zip(&places.across).for_each(|(alpha, across)| *alpha /= level(across));
        }
    }
    if patch.is_by_knots {
        return Ok(Spread::ByKnots(PatchSamples { patch, source, places, ideal }));
    }
    let expansion = Expansion::of(patch, kernels, task.negligible_edge, cancel)?;
    let cost = expansion.cost();
    let values = if cost.is_better_direct((source.rows, source.columns)) {
        task.stopwatch.time(Part::Direct, || spread_directly(&ideal, &places, &expansion, cancel))
    } else {
        task.stopwatch.time(Part::Transforms, || spread_by_transform(&ideal, &places, &expansion, cancel))
    };
    Ok(Spread::Done(BlurredCell { at: source.spread_over(&expansion.at), values: values? }))
}

/// Spreads a plane by sums: exactly the kernel of each row, and along a row that of each sample.
fn spread_directly(
    values: &[f32],
    places: &Places,
    expansion: &Expansion,
    cancel: &Cancel,
) -> Result<Vec<f32>, Cancelled> {
    let (rows, columns) = (places.down.len(), places.across.len());
    let kernel_size = (expansion.at.rows, expansion.at.columns);
    let (out_rows, out_columns) = (rows + kernel_size.0 - 1, columns + kernel_size.1 - 1);
    let mut out = vec![0.0; out_rows * out_columns];
    let mut strip = Strip::new(kernel_size, expansion.n_across());
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
    let (rows, columns) = (places.down.len(), places.across.len());
    let (out_rows, out_columns) = (rows + expansion.at.rows - 1, columns + expansion.at.columns - 1);
    with_fft((fast_size(out_rows), fast_size(out_columns)), |fft| {
        let (mut kernel, mut spectrum) = (vec![], vec![]);
        let mut sum = vec![Complex::new(0.0, 0.0); fft.spectrum_len()];
        let mut weighted = vec![0.0; rows * columns];
        for term in &expansion.terms {
            cancel.check()?;
            fft.forward(&term.samples, expansion.at.columns, &mut kernel);
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
        fft.inverse(&mut sum, out_rows, out_columns, &mut out);
        Ok(out)
    })
}

/// Adds what of a blurred cell lies on the film.
fn add_cell(task: &LayerTask<'_>, cell: &BlurredCell, out: &mut BlurredPlane) {
    let Some(on_film) = cell.at.clipped(task.film_rows, task.film_columns) else { return };
    let (skip_rows, skip_columns) =
        ((on_film.first_row - cell.at.first_row) as usize, (on_film.first_column - cell.at.first_column) as usize);
    for row in 0..on_film.rows {
        let first = (row + skip_rows) * cell.at.columns + skip_columns;
        let part = &cell.values[first..first + on_film.columns];
        out.add_row(on_film.first_row as usize + row, on_film.first_column as usize, part);
    }
}
