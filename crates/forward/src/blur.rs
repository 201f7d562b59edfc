//! One layer in one band: its ideal picture, spread by PSFs that vary over the film.

use dioptric_psf::FilmMap;
use std::collections::BTreeMap;

use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;
use rustfft::num_complex::Complex;

use crate::{
    convolve::{DIRECT_BLOCK, Direct, MAX_DIRECT, fast_size, multiply_add, with_fft},
    occlusion::BlurredLayer,
    sampler::{IdealLayer, Rectangle, Sampler, Surface},
    tiles::{Cell, Knot, LayerKernels},
    work::Work,
};

/// Cells blurred before their results are added up: bounds the memory, and keeps the order of the sums.
const CELLS_AT_ONCE: usize = 32;

/// What to blur.
pub(crate) struct LayerTask<'a> {
    pub(crate) sampler: &'a Sampler,
    pub(crate) map: &'a FilmMap,
    pub(crate) layer: usize,
    pub(crate) surfaces: &'a [Surface<'a>],
    pub(crate) cells: &'a [Cell],
    pub(crate) kernels: &'a LayerKernels,
    pub(crate) film_rows: usize,
    pub(crate) film_columns: usize,
    /// Whether the blurred cover is wanted beside the light.
    pub(crate) with_cover: bool,
}

/// The kernels of a layer at every knot, turned to its place, in the form in which they are used.
enum Turned {
    Samples(BTreeMap<Knot, Vec<f32>>),
    Spectra { by_knot: BTreeMap<Knot, Spectrum>, size: usize },
}

/// A kernel's spectrum; equal kernels share a `twin` number.
struct Spectrum {
    values: Vec<Complex<f32>>,
    twin: usize,
}

/// The blurred light and cover of a cell.
struct BlurredCell {
    at: Rectangle,
    light: Vec<f32>,
    cover: Option<Vec<f32>>,
}

/// Blurs a layer into `out`, which must be clear; each cell counts as `cell_units` of work.
pub(crate) fn blur_layer(
    task: &LayerTask<'_>,
    out: &mut BlurredLayer,
    work: &Work<'_>,
    cell_units: u64,
) -> Result<(), Cancelled> {
    let turned = turned(task, work.cancel())?;
    for cells in task.cells.chunks(CELLS_AT_ONCE) {
        let blur = |cell| {
            let blurred = blur_cell(task, &turned, cell, work.cancel());
            work.advance(cell_units);
            blurred
        };
        let blurred: Vec<Option<BlurredCell>> = cells.par_iter().map(blur).collect::<Result<_, Cancelled>>()?;
        for cell in blurred.iter().flatten() {
            add_cell(task, cell, out);
        }
    }
    Ok(())
}

fn turned(task: &LayerTask<'_>, cancel: &Cancel) -> Result<Turned, Cancelled> {
    let kernels = task.kernels;
    let mut knots: Vec<Knot> = task.cells.iter().flat_map(Cell::knots).collect();
    knots.sort_unstable();
    knots.dedup();
    let samples: Vec<(Knot, Vec<f32>)> = knots.into_par_iter().map(|knot| (knot, kernels.at(knot))).collect();
    let (smallest, largest) =
        task.cells.iter().fold((usize::MAX, 1), |(low, high), cell| (low.min(cell.size), high.max(cell.size)));
    // Direct blocks take the PSF as constant; where cells had to be halved it varies too fast for that.
    if kernels.width <= MAX_DIRECT && smallest == largest {
        return Ok(Turned::Samples(samples.into_iter().collect()));
    }
    let size = fast_size(largest + kernels.width - 1);
    let mut distinct: Vec<&Vec<f32>> = vec![];
    let mut twins = vec![];
    for (_, kernel) in &samples {
        // Only a lens without field dependence has equal kernels, and then all are; few need to be compared.
        let twin = distinct.iter().take(2).position(|other| *other == kernel);
        twins.push(twin.unwrap_or(distinct.len()));
        if twin.is_none() {
            distinct.push(kernel);
        }
    }
    let by_knot = samples
        .par_iter()
        .zip(twins)
        .map(|((knot, kernel), twin)| {
            cancel.check()?;
            let mut values = vec![];
            with_fft(size, |fft| fft.forward(kernel, kernels.width, &mut values));
            Ok((*knot, Spectrum { values, twin }))
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(Turned::Spectra { by_knot, size })
}

fn blur_cell(
    task: &LayerTask<'_>,
    turned: &Turned,
    cell: &Cell,
    cancel: &Cancel,
) -> Result<Option<BlurredCell>, Cancelled> {
    let half = task.kernels.width / 2;
    let (first_row, first_column) = cell.first_pixel(&task.sampler.frame);
    let whole = Rectangle { first_row, first_column, rows: cell.size, columns: cell.size };
    let Some(source) = whole.clipped(task.film_rows, task.film_columns, half) else { return Ok(None) };
    let mut ideal = IdealLayer::default();
    if !task.sampler.sample(source, task.map, task.layer, task.surfaces, &mut ideal, cancel)? {
        return Ok(None);
    }
    let blend = Blend::new(cell, &source, &task.sampler.frame);
    let spread = |values: &[f32]| match turned {
        Turned::Samples(kernels) => Ok(spread_directly(values, &source, &blend, kernels, task.kernels.width)),
        Turned::Spectra { by_knot, size } => {
            spread_by_transform(values, &source, &blend, (by_knot, *size), task.kernels.width, cancel)
        }
    };
    let light = spread(&ideal.light)?;
    let cover = task.with_cover.then(|| spread(&ideal.cover)).transpose()?;
    let at = Rectangle {
        first_row: source.first_row - half as i64,
        first_column: source.first_column - half as i64,
        rows: source.rows + 2 * half,
        columns: source.columns + 2 * half,
    };
    Ok(Some(BlurredCell { at, light, cover }))
}

/// How the kernels at the four corners of a cell share its pixels: bilinearly.
struct Blend {
    knots: [Knot; 4],
    /// Place of the first pixel's centre from the corner, in parts of the cell: down and across.
    start: (f32, f32),
    step: f32,
}

impl Blend {
    fn new(cell: &Cell, source: &Rectangle, frame: &crate::geometry::FilmFrame) -> Self {
        let (center_row, center_column) = frame.center();
        let step = 1.0 / cell.size as f64;
        let down = (source.first_row as f64 - center_row - f64::from(cell.corner.down)) * step;
        let across = (source.first_column as f64 - center_column - f64::from(cell.corner.right)) * step;
        Self { knots: cell.knots(), start: (down as f32, across as f32), step: step as f32 }
    }

    /// Returns the shares of the four corners at a row and column of the source.
    fn shares(&self, row: f32, column: f32) -> [f32; 4] {
        let (down, across) = (self.start.0 + row * self.step, self.start.1 + column * self.step);
        [(1.0 - down) * (1.0 - across), (1.0 - down) * across, down * (1.0 - across), down * across]
    }
}

fn spread_directly(
    values: &[f32],
    source: &Rectangle,
    blend: &Blend,
    kernels: &BTreeMap<Knot, Vec<f32>>,
    width: usize,
) -> Vec<f32> {
    let corners = blend.knots.map(|knot| kernels[&knot].as_slice());
    let (block_rows, block_columns) = DIRECT_BLOCK;
    let stride = source.columns.next_multiple_of(block_columns) + width - 1;
    let mut out = vec![0.0; (source.rows.next_multiple_of(block_rows) + width - 1) * stride];
    let (mut direct, mut kernel) = (Direct::default(), vec![0.0; width * width]);
    for top in (0..source.rows).step_by(block_rows) {
        for left in (0..source.columns).step_by(block_columns) {
            let (n_rows, n_columns) = (block_rows.min(source.rows - top), block_columns.min(source.columns - left));
            let lines: Vec<&[f32]> =
                (top..top + n_rows).map(|row| &values[row * source.columns + left..][..n_columns]).collect();
            if lines.iter().all(|line| line.iter().all(|&v| v == 0.0)) {
                continue;
            }
            let middle = |first: usize, n: usize| first as f32 + 0.5 * (n as f32 - 1.0);
            let [a, b, c, d] = blend.shares(middle(top, n_rows), middle(left, n_columns));
            for (i, value) in kernel.iter_mut().enumerate() {
                *value = a * corners[0][i] + b * corners[1][i] + c * corners[2][i] + d * corners[3][i];
            }
            direct.add(&lines, &kernel, width, &mut out[top * stride + left..], stride);
        }
    }
    let (rows, columns) = (source.rows + width - 1, source.columns + width - 1);
    out.chunks_exact(stride).take(rows).flat_map(|line| &line[..columns]).copied().collect()
}

fn spread_by_transform(
    values: &[f32],
    source: &Rectangle,
    blend: &Blend,
    (spectra, size): (&BTreeMap<Knot, Spectrum>, usize),
    width: usize,
    cancel: &Cancel,
) -> Result<Vec<f32>, Cancelled> {
    let corners = blend.knots.map(|knot| &spectra[&knot]);
    with_fft(size, |fft| {
        let (mut spectrum, mut out) = (vec![], vec![]);
        let mut sum = vec![Complex::new(0.0, 0.0); fft.spectrum_len()];
        if corners.iter().all(|corner| corner.twin == corners[0].twin) {
            fft.forward(values, source.columns, &mut spectrum);
            multiply_add(&mut sum, &spectrum, &corners[0].values);
        } else {
            let mut windowed = vec![0.0; values.len()];
            for (corner, kernel) in corners.iter().enumerate() {
                cancel.check()?;
                for (row, (windowed, values)) in
                    windowed.chunks_exact_mut(source.columns).zip(values.chunks_exact(source.columns)).enumerate()
                {
                    for (column, (windowed, value)) in windowed.iter_mut().zip(values).enumerate() {
                        *windowed = value * blend.shares(row as f32, column as f32)[corner];
                    }
                }
                fft.forward(&windowed, source.columns, &mut spectrum);
                multiply_add(&mut sum, &spectrum, &kernel.values);
            }
        }
        cancel.check()?;
        fft.inverse(&mut sum, source.rows + width - 1, source.columns + width - 1, &mut out);
        Ok(out)
    })
}

/// Adds what of a blurred cell lies on the film.
fn add_cell(task: &LayerTask<'_>, cell: &BlurredCell, out: &mut BlurredLayer) {
    let Some(on_film) = cell.at.clipped(task.film_rows, task.film_columns, 0) else { return };
    let (skip_rows, skip_columns) =
        ((on_film.first_row - cell.at.first_row) as usize, (on_film.first_column - cell.at.first_column) as usize);
    for row in 0..on_film.rows {
        let first = (row + skip_rows) * cell.at.columns + skip_columns;
        let part = first..first + on_film.columns;
        let cover = cell.cover.as_ref().map(|cover| &cover[part.clone()]);
        out.add_row(on_film.first_row as usize + row, on_film.first_column as usize, &cell.light[part], cover);
    }
}
