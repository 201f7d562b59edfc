//! A layer spread knot by knot: the samples around each, times its weights, with its kernel.

use std::{
    cell::RefCell,
    collections::{BTreeMap, BTreeSet},
};

use dioptric_fft::Complex;
use dioptric_spectrum::{Cancel, Cancelled};
use multiversion::multiversion;
use rayon::prelude::*;

use crate::{
    convolve::{Fft2, fast_size, multiply_by_real, with_fft},
    geometry::FilmFrame,
    knot_kernels::{KnotKernel, LayerKernels, Mirror},
    patch::{Knot, Patch, Products},
    patch_samples::{BlurredCell, PatchSamples},
    rectangle::Rectangle,
    smoothing::Smoother,
    stopwatch::{Part, Stopwatch},
    tiles::SpreadBlocks,
    uniform_response::LEAST_RESPONSE,
};

/// A raster of a layer that is spread by knots.
pub(crate) struct KnotRaster<'a> {
    pub(crate) kernels: &'a LayerKernels,
    /// All of it, those that are spread by themselves too.
    pub(crate) patches: &'a [Patch],
    pub(crate) frame: &'a FilmFrame,
    /// Half the length that weights are smoothed over.
    pub(crate) half_px: usize,
}

/// Where a knot has weight.
#[derive(Default)]
struct Reach<'a> {
    /// Samples of patches, each with the knot's share of the products of polynomials.
    plain: Vec<(&'a PatchSamples<'a>, &'a Products)>,
    /// Those over which its weights are smoothed.
    smooth: Vec<&'a PatchSamples<'a>>,
    /// Its weights around these, before they are smoothed.
    weights: Vec<(&'a Patch, &'a Products)>,
}

/// The knots that have one canonical knot.
type Group<'a> = BTreeMap<Knot, Reach<'a>>;

/// Knots blurred before their results are added up: bounds the memory, and keeps the order of the sums.
const KNOTS_AT_ONCE: usize = 32;

/// About what is spread around knots before it is added up, bytes.
pub(crate) fn spread_bytes(blocks: &SpreadBlocks) -> usize {
    KNOTS_AT_ONCE * size_of::<f32>() * blocks.mean_px2
}

/// What a thread transforms in, bytes: lines, a spectrum and that of a kernel, which it keeps, and for a patch by itself three half spectra, its samples and what
/// becomes of them.
pub(crate) fn buffer_bytes(blocks: &SpreadBlocks) -> usize {
    let n = blocks.largest_px2;
    3 * size_of::<Complex<f32>>() * n + 3 * size_of::<Complex<f32>>() * n / 2 + 2 * size_of::<f32>() * n
}

/// Spreads patches and hands on what they make, in an order that does not depend on the number of threads.
pub(crate) fn spread_by_knots(
    raster: &KnotRaster<'_>,
    sampled: &[PatchSamples<'_>],
    (stopwatch, cancel): (&Stopwatch, &Cancel),
    add: &mut dyn FnMut(&BlurredCell),
) -> Result<(), Cancelled> {
    let groups: Vec<Group<'_>> = raster.groups(sampled).into_values().collect();
    let n_knots: usize = groups.iter().map(Group::len).sum();
    let groups_at_once = (KNOTS_AT_ONCE * groups.len()).div_ceil(n_knots.max(1)).max(1);
    for groups in groups.chunks(groups_at_once) {
        let spread = |group| stopwatch.time(Part::Transforms, || raster.spread_group(group, cancel));
        let cells: Vec<Vec<BlurredCell>> = groups.par_iter().map(spread).collect::<Result<_, Cancelled>>()?;
        stopwatch.time(Part::Compositing, || cells.iter().flatten().for_each(&mut *add));
    }
    Ok(())
}

impl KnotRaster<'_> {
    /// Divides samples by what the smoothed weights of all knots sum to: less than 1 where patches end, or go on with kernels on another raster. For
    /// `responses`, those of a uniform plane by the number of the patch, the division is by them as well, smoothed likewise.
    pub(crate) fn level(&self, sampled: &mut [PatchSamples<'_>], responses: Option<&BTreeMap<u32, Products>>) {
        sampled.par_iter_mut().for_each_init(
            Smoother::default,
            |smoother, PatchSamples { patch, source, ideal, .. }| {
                let Some(around) = &patch.around else { return };
                if around.is_whole && responses.is_none() {
                    return;
                }
                smoother.begin(source, self.half_px);
                for &number in &around.patches {
                    let near = &self.patches[number as usize];
                    let mut products = near.total();
                    if let Some(response) = responses.and_then(|responses| responses.get(&number)) {
                        products.iter_mut().zip(response).for_each(|(product, response)| *product += response);
                        products[0] -= 1.0;
                    }
                    smoother.add(near, self.frame, &products);
                }
                // A plane is 1, give or take what kernels change over a cell.
                ideal.iter_mut().zip(smoother.finish()).for_each(|(value, level)| *value /= level.max(LEAST_RESPONSE));
            },
        );
    }

    /// Finds the knots that have weight in samples, by their canonical knot.
    fn groups<'a>(&'a self, sampled: &'a [PatchSamples<'a>]) -> BTreeMap<Knot, Group<'a>> {
        let symmetry = self.kernels.symmetry;
        let mut groups: BTreeMap<Knot, Group<'_>> = BTreeMap::new();
        let mut near = BTreeSet::new();
        for sampled in sampled {
            let Some(around) = &sampled.patch.around else {
                for (knot, shares) in &sampled.patch.shares {
                    let group = groups.entry(symmetry.canonical(*knot)).or_default();
                    group.entry(*knot).or_default().plain.push((sampled, shares));
                }
                continue;
            };
            near.extend(around.patches.iter().copied());
            let patches = around.patches.iter().map(|&number| &self.patches[number as usize]);
            let reaches = |patch: &&Patch| {
                patch.cell.pixels(self.frame).grown(self.half_px).intersection(&sampled.source).is_some()
            };
            let knots: BTreeSet<Knot> =
                patches.filter(reaches).flat_map(|patch| patch.shares.iter().map(|(knot, _)| *knot)).collect();
            for knot in knots {
                groups.entry(symmetry.canonical(knot)).or_default().entry(knot).or_default().smooth.push(sampled);
            }
        }
        for number in near {
            let patch = &self.patches[number as usize];
            for (knot, shares) in &patch.shares {
                let group = groups.get_mut(&symmetry.canonical(*knot));
                if let Some(reach) = group.and_then(|group| group.get_mut(knot)) {
                    reach.weights.push((patch, shares));
                }
            }
        }
        groups
    }

    /// Spreads what lies around the knots of a group: each is mirrored to the canonical knot, whose kernel is transformed once.
    fn spread_group(&self, group: &Group<'_>, cancel: &Cancel) -> Result<Vec<BlurredCell>, Cancelled> {
        let Some(kernel) = group.keys().next().map(|knot| self.kernels.canonical_at(*knot)) else { return Ok(vec![]) };
        let around: Vec<Surroundings<'_>> =
            group.iter().filter_map(|(knot, reach)| self.around(*knot, reach)).collect();
        let sizes = around.iter().map(|Surroundings { mirror, at, .. }| mirror.size((at.rows, at.columns)));
        let (rows, columns) = sizes.reduce(|a, b| (a.0.max(b.0), a.1.max(b.1))).unwrap_or((1, 1));
        let size = (fast_size(rows + kernel.at.rows - 1), fast_size(columns + kernel.at.columns - 1));
        with_fft(size, |fft| BUFFERS.with_borrow_mut(|buffers| spread_around(&around, (kernel, fft), buffers, cancel)))
    }

    /// Returns what lies around a knot, if anything does.
    fn around<'a>(&'a self, knot: Knot, reach: &'a Reach<'a>) -> Option<Surroundings<'a>> {
        let weights = reach.weights.iter().map(|(patch, _)| patch.cell.pixels(self.frame));
        let has_weight = Rectangle::around(weights).map(|weights| weights.grown(self.half_px));
        let plain = reach.plain.iter().map(|(sampled, _)| sampled.source);
        let smooth = reach.smooth.iter().filter_map(|sampled| sampled.source.intersection(&has_weight?));
        let at = Rectangle::around(plain.chain(smooth))?;
        Some(Surroundings { mirror: self.kernels.symmetry.mirror(knot), at, reach, raster: self })
    }
}

/// What is spread by a kernel: the mirror of a knot, what its samples lie in, and where they are from.
struct Surroundings<'a> {
    mirror: Mirror,
    at: Rectangle,
    reach: &'a Reach<'a>,
    raster: &'a KnotRaster<'a>,
}

impl Surroundings<'_> {
    /// Puts the samples around the knot, times its weights, into `block`.
    fn gather(&self, smoother: &mut Smoother, block: &mut Vec<f32>) {
        let at = &self.at;
        block.clear();
        block.resize(at.rows * at.columns, 0.0);
        for (sampled, shares) in &self.reach.plain {
            let PatchSamples { source, places, ideal, .. } = sampled;
            let block = block[source.offset_in(at)..].chunks_mut(at.columns);
            for ((line, down), block) in ideal.chunks_exact(source.columns).zip(&places.down).zip(block) {
                let along: [f32; 3] = std::array::from_fn(|j| (0..3).map(|i| shares[3 * i + j] * down[i]).sum());
                add_weighted(line, &places.across, along, block);
            }
        }
        if self.reach.smooth.is_empty() {
            return;
        }
        let KnotRaster { frame, half_px, .. } = self.raster;
        smoother.begin(at, *half_px);
        self.reach.weights.iter().for_each(|(patch, shares)| smoother.add(patch, frame, shares));
        let weights = smoother.finish();
        for PatchSamples { source, ideal, .. } in &self.reach.smooth {
            let Some(common) = source.intersection(at) else { continue };
            let lines = ideal[common.offset_in(source)..].chunks(source.columns).take(common.rows);
            let first = common.offset_in(at);
            let sums = block[first..].chunks_mut(at.columns).zip(weights[first..].chunks(at.columns));
            for (line, (sums, weights)) in lines.zip(sums) {
                add_products(&mut sums[..common.columns], line, weights);
            }
        }
    }
}

/// Spreads what lies around knots by their canonical kernel: two at a time, or one that is alone.
fn spread_around(
    around: &[Surroundings<'_>],
    (kernel, fft): (&KnotKernel, &mut Fft2),
    buffers: &mut Buffers,
    cancel: &Cancel,
) -> Result<Vec<BlurredCell>, Cancelled> {
    fft.forward(&kernel.samples, kernel.at.columns, &mut buffers.kernel);
    let mut cells = Vec::with_capacity(around.len());
    for pair in around.chunks(2) {
        cancel.check()?;
        match pair {
            [own] => cells.push(buffers.spread(fft, &kernel.at, own)),
            _ => buffers.spread_pair(fft, &kernel.at, pair, &mut cells),
        }
    }
    Ok(cells)
}

thread_local! {
    // Kept from group to group, for its pages not to be asked for anew.
    static BUFFERS: RefCell<Buffers> = RefCell::default();
}

/// Memory that knots use one after the other.
#[derive(Default)]
struct Buffers {
    block: Vec<f32>,
    mirrored: Vec<f32>,
    lines: Vec<Complex<f32>>,
    spectrum: Vec<Complex<f32>>,
    kernel: Vec<Complex<f32>>,
    smoother: Smoother,
}

const ZERO: Complex<f32> = Complex::new(0.0, 0.0);

/// Returns the first values of a buffer, which grows where it has fewer, whatever they are.
fn first_of(buffer: &mut Vec<Complex<f32>>, n: usize) -> &mut [Complex<f32>] {
    if buffer.len() < n {
        buffer.resize(n, ZERO);
    }
    &mut buffer[..n]
}

impl Buffers {
    /// Spreads the samples around a knot by the canonical kernel, which is transformed and whose samples lie in a rectangle.
    fn spread(&mut self, fft: &mut Fft2, kernel: &Rectangle, around: &Surroundings<'_>) -> BlurredCell {
        let Surroundings { mirror, at, .. } = around;
        around.gather(&mut self.smoother, &mut self.block);
        mirror.applied(&self.block, (at.rows, at.columns), &mut self.mirrored);
        fft.forward(&self.mirrored, mirror.size((at.rows, at.columns)).1, &mut self.spectrum);
        multiply_by_real(&mut self.spectrum, &self.kernel, fft.rows());
        let at = at.spread_over(&mirror.window_at_knot(kernel));
        let (rows, columns) = mirror.size((at.rows, at.columns));
        fft.inverse(&mut self.spectrum, rows, columns, &mut self.mirrored);
        BlurredCell { at, values: mirror.restored(&self.mirrored, (at.rows, at.columns)) }
    }

    /// Spreads the samples around two knots likewise. Those around one are the real parts of the samples of a block, around the other the imaginary ones: a
    /// kernel, which is real, leaves them apart.
    fn spread_pair(
        &mut self,
        fft: &mut Fft2,
        kernel: &Rectangle,
        pair: &[Surroundings<'_>],
        cells: &mut Vec<BlurredCell>,
    ) {
        let (stride, scale) = (fft.columns(), 1.0 / fft.len() as f32);
        let size_of = |part: usize| {
            let Surroundings { mirror, at, .. } = &pair[part];
            mirror.size((at.rows, at.columns))
        };
        let sizes = [size_of(0), size_of(1)];
        let n_rows = sizes[0].0.max(sizes[1].0);
        let lines = first_of(&mut self.lines, n_rows * stride);
        // Samples fill what they lie in, if both blocks are of one size.
        let n_filled = if sizes[0] == sizes[1] { sizes[0].1 } else { 0 };
        lines.chunks_exact_mut(stride).for_each(|line| line[n_filled..].fill(ZERO));
        for (part, around) in pair.iter().enumerate() {
            let Surroundings { mirror, at, .. } = around;
            around.gather(&mut self.smoother, &mut self.block);
            let (block, lines) = (&self.block, (&mut *lines, stride));
            match part {
                0 => mirror.applied_to(block, (at.rows, at.columns), lines, |value, sample| value.re = sample),
                _ => mirror.applied_to(block, (at.rows, at.columns), lines, |value, sample| value.im = sample),
            }
        }
        let spectrum = first_of(&mut self.spectrum, fft.len());
        fft.forward_pair(lines, spectrum);
        multiply_by_real(spectrum, &self.kernel, fft.rows());
        let lines = first_of(&mut self.lines, (n_rows + kernel.rows - 1) * stride);
        fft.inverse_pair(spectrum, lines);
        for (part, Surroundings { mirror, at, .. }) in pair.iter().enumerate() {
            let at = at.spread_over(&mirror.window_at_knot(kernel));
            let (size, lines) = ((at.rows, at.columns), (&*lines, stride));
            let values = match part {
                0 => mirror.restored_from(lines, size, |value| value.re * scale),
                _ => mirror.restored_from(lines, size, |value| value.im * scale),
            };
            cells.push(BlurredCell { at, values });
        }
    }
}

/// Adds samples times their weights to a line: a sum of the polynomials at each, times `along`.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn add_weighted(line: &[f32], across: &[[f32; 3]], along: [f32; 3], sum: &mut [f32]) {
    for ((sum, value), across) in sum.iter_mut().zip(line).zip(across) {
        *sum += value * (along[0] + along[1] * across[1] + along[2] * across[2]);
    }
}

/// Adds samples times their weights to a line.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn add_products(sums: &mut [f32], line: &[f32], weights: &[f32]) {
    sums.iter_mut().zip(line).zip(weights).for_each(|((sum, value), weight)| *sum += value * weight);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Film,
        knot_kernels::Symmetry,
        patch::{Around, Cell, polynomials, value_of},
        patch_samples::Places,
    };

    /// Returns numbers between 0 and 1 without order.
    fn noise(n: usize, seed: u32) -> Vec<f32> {
        let mut state = seed.wrapping_mul(2_654_435_769).wrapping_add(1);
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        (0..n).map(|_| next()).collect()
    }

    /// Eight knots that mirror each other, and one on the axis, all with weight in two patches: as each sample spread by its own kernel.
    #[test]
    fn knots_spread_as_samples_do() {
        let (rows, columns) = (12, 7);
        // To the right of the reference point and above it, as a comet.
        let window = Rectangle { first_row: -4, first_column: -1, rows: 6, columns: 5 };
        let frame = FilmFrame::new(&Film::centered(64, 64, 1.0), 1);
        let ways = [(64, -32), (-64, -32), (64, 32), (32, -64), (-32, 64), (32, 64), (-32, -64), (-64, 32), (0, 0)];
        let knots = ways.map(|(right, down)| Knot { right, down });
        for symmetry in [Symmetry::Octants, Symmetry::None] {
            let canonical = knots.iter().map(|&knot| symmetry.canonical(knot));
            let kernel = |knot: Knot| {
                let seed = (knot.right + 1000 * knot.down).unsigned_abs();
                (knot, KnotKernel { at: window, samples: noise(window.len(), seed) })
            };
            let kernels = LayerKernels::new(symmetry, canonical.map(kernel).collect());
            let patches: Vec<Patch> = [0, 1]
                .map(|across| {
                    let share = |(i, knot): (usize, &Knot)| {
                        let shares = noise(9, 10 * across as u32 + i as u32);
                        (*knot, shares.try_into().expect("nine"))
                    };
                    let cell = Cell { down: 0, across, size: 16 };
                    Patch {
                        cell,
                        is_by_knots: true,
                        around: None,
                        shares: knots.iter().enumerate().map(share).collect(),
                        elsewhere: vec![],
                    }
                })
                .to_vec();
            let places = Places {
                down: (0..rows).map(|row| polynomials(row as f32 / 16.0 - 0.5)).collect(),
                across: (0..columns).map(|column| polynomials(column as f32 / 16.0 - 0.5)).collect(),
            };
            let samples = |(i, patch): (usize, _)| PatchSamples {
                patch,
                source: Rectangle { first_row: -3 - i as i64, first_column: 16 * i as i64, rows, columns },
                places: places.clone(),
                ideal: noise(rows * columns, 77 + i as u32),
            };
            let samples: Vec<PatchSamples<'_>> = patches.iter().enumerate().map(samples).collect();

            let mut spread: BTreeMap<(i64, i64), f64> = BTreeMap::new();
            let mut add = |at: &Rectangle, values: &[f32]| {
                for (i, &value) in values.iter().enumerate() {
                    let place = (at.first_row + (i / at.columns) as i64, at.first_column + (i % at.columns) as i64);
                    *spread.entry(place).or_default() += f64::from(value);
                }
            };
            let observers = (&Stopwatch::default(), &Cancel::new());
            let raster = KnotRaster { kernels: &kernels, patches: &patches, frame: &frame, half_px: 0 };
            spread_by_knots(&raster, &samples, observers, &mut |cell| add(&cell.at, &cell.values)).unwrap();
            for PatchSamples { patch, source, places, ideal } in &samples {
                for (i, value) in ideal.iter().enumerate() {
                    let (row, column) = (i / columns, i % columns);
                    let (first_row, first_column) =
                        (source.first_row + row as i64, source.first_column + column as i64);
                    let pixel = Rectangle { first_row, first_column, ..Rectangle::PIXEL };
                    for (knot, shares) in &patch.shares {
                        let weight: f32 =
                            (0..9).map(|k| shares[k] * places.down[row][k / 3] * places.across[column][k % 3]).sum();
                        let kernel = kernels.at(*knot);
                        let spread: Vec<f32> = kernel.samples.iter().map(|sample| -weight * value * sample).collect();
                        add(&pixel.spread_over(&kernel.at), &spread);
                    }
                }
            }
            // Sums of some hundred products near 1, in single precision.
            let worst = spread.values().fold(0.0, |worst: f64, left| worst.max(left.abs()));
            assert!(worst < 1e-3, "{symmetry:?}: {worst}");
            // What both patches cover, and a kernel around: as it is, or turned all ways.
            let reached = |height: usize, width: usize| (rows + 1 + height - 1) * (16 + columns + width - 1);
            match symmetry {
                Symmetry::None => assert_eq!(spread.len(), reached(window.rows, window.columns)),
                Symmetry::Octants => assert!((reached(6, 6)..=reached(9, 9)).contains(&spread.len())),
            }
        }
    }

    /// Two patches beside each other, of which the left one alone has light: with the means of weights over squares of 8 pixels, and weights that sum to 1 to
    /// the outermost pixel.
    #[test]
    fn weights_are_means_over_squares() {
        let (window, half) = (Rectangle::PIXEL.grown(2), 4);
        let frame = FilmFrame::new(&Film::centered(64, 64, 1.0), 1);
        let knots = [Knot { right: 8, down: 8 }, Knot { right: 24, down: 8 }];
        let kernel = |knot: Knot| (knot, KnotKernel { at: window, samples: noise(window.len(), knot.right as u32) });
        let kernels = LayerKernels::new(Symmetry::None, knots.map(kernel).into_iter().collect());
        // One knot gives way to the other; the second patch has its weight in part elsewhere.
        let shares = [[0.7, -0.2, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.2], [0.3, 0.2, -0.1, -0.1, 0.0, 0.0, 0.0, 0.0, -0.2]];
        let patch = |across: i32, part: f32| Patch {
            cell: Cell { down: 0, across, size: 16 },
            is_by_knots: true,
            around: Some(Around { patches: vec![0, 1], is_whole: false }),
            shares: knots.into_iter().zip(shares.map(|share| share.map(|share| part * share))).collect(),
            elsewhere: if part < 1.0 { vec![(2, vec![])] } else { vec![] },
        };
        let patches = [patch(0, 1.0), patch(1, 0.5)];
        let source = patches[0].cell.pixels(&frame);
        let ideal = noise(16 * 16, 5);
        let places = Places { down: vec![], across: vec![] };
        let mut samples = [PatchSamples { patch: &patches[0], source, places, ideal: ideal.clone() }];
        let raster = KnotRaster { kernels: &kernels, patches: &patches, frame: &frame, half_px: half };
        raster.level(&mut samples, None);
        let mut spread: BTreeMap<(i64, i64), f64> = BTreeMap::new();
        let mut add = |at: &Rectangle, values: &[f32]| {
            for (i, &value) in values.iter().enumerate() {
                let place = (at.first_row + (i / at.columns) as i64, at.first_column + (i % at.columns) as i64);
                *spread.entry(place).or_default() += f64::from(value);
            }
        };
        let observers = (&Stopwatch::default(), &Cancel::new());
        spread_by_knots(&raster, &samples, observers, &mut |cell| add(&cell.at, &cell.values)).unwrap();

        // The weight of a knot at a pixel, counted from the first of the left patch; nothing beyond both.
        let weight_at = |knot: usize, row: i64, column: i64| -> f64 {
            let (patch, column) =
                (&patches[(column >= 16) as usize], column as f32 - if column >= 16 { 16.0 } else { 0.0 });
            let (down, across) = ((row as f32 + 0.5) / 16.0 - 0.5, (column + 0.5) / 16.0 - 0.5);
            f64::from(value_of(&patch.shares[knot].1, &polynomials(down), &polynomials(across)))
        };
        let mean_at = |knot: usize, row: i64, column: i64| -> f64 {
            let (mut sum, half) = (0.0, half as i64);
            for (down, across) in (-half..=half).flat_map(|down| (-half..=half).map(move |across| (down, across))) {
                let (row, column) = (row + down, column + across);
                if (0..16).contains(&row) && (0..32).contains(&column) {
                    let part = |by: i64| if by.abs() == half { 0.5 } else { 1.0 } / (2 * half) as f64;
                    sum += part(down) * part(across) * weight_at(knot, row, column);
                }
            }
            sum
        };
        for (i, &value) in ideal.iter().enumerate() {
            let (row, column) = (i as i64 / 16, i as i64 % 16);
            let means = [0, 1].map(|knot| mean_at(knot, row, column));
            let (first_row, first_column) = (source.first_row + row, source.first_column + column);
            let at = Rectangle { first_row, first_column, ..Rectangle::PIXEL }.spread_over(&window);
            for (knot, mean) in knots.into_iter().zip(means) {
                let weight = -value * (mean / (means[0] + means[1])) as f32;
                let kernel: Vec<f32> = kernels.at(knot).samples.iter().map(|sample| weight * sample).collect();
                add(&at, &kernel);
            }
        }
        let worst = spread.values().fold(0.0, |worst: f64, left| worst.max(left.abs()));
        assert!(worst < 2e-5, "{worst}");
    }
}
