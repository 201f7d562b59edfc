//! A layer spread knot by knot: the samples around each, times its weights, with its kernel.

use std::{cell::RefCell, collections::BTreeMap};

use dioptric_fft::Complex;
use dioptric_spectrum::{Cancel, Cancelled};
use multiversion::multiversion;
use rayon::prelude::*;

use crate::{
    convolve::{Fft2, fast_size, multiply, with_fft},
    knot_kernels::{KnotKernel, LayerKernels, Mirror},
    patch::Knot,
    patch_samples::{BlurredCell, PatchSamples},
    sampler::Rectangle,
    stopwatch::{Part, Stopwatch},
};

/// A patch in which a knot has weight, and its share of the products of polynomials.
type Member<'a> = (&'a PatchSamples<'a>, &'a [f32; 9]);

/// The knots that have one canonical knot.
type Group<'a> = BTreeMap<Knot, Vec<Member<'a>>>;

/// Knots blurred before their results are added up: bounds the memory, and keeps the order of the sums.
const KNOTS_AT_ONCE: usize = 32;

/// Spreads patches and hands on what they make, in an order that does not depend on the number of threads.
pub(crate) fn spread_by_knots(
    kernels: &LayerKernels,
    sampled: &[PatchSamples<'_>],
    (stopwatch, cancel): (&Stopwatch, &Cancel),
    add: &mut dyn FnMut(&BlurredCell),
) -> Result<(), Cancelled> {
    let mut groups: BTreeMap<Knot, Group<'_>> = BTreeMap::new();
    for sampled in sampled {
        for (knot, shares) in &sampled.patch.shares {
            let group = groups.entry(kernels.symmetry.canonical(*knot)).or_default();
            group.entry(*knot).or_default().push((sampled, shares));
        }
    }
    let groups: Vec<Group<'_>> = groups.into_values().collect();
    let n_knots: usize = groups.iter().map(Group::len).sum();
    let groups_at_once = (KNOTS_AT_ONCE * groups.len()).div_ceil(n_knots.max(1)).max(1);
    for groups in groups.chunks(groups_at_once) {
        let spread = |group| stopwatch.time(Part::Transforms, || spread_group(kernels, group, cancel));
        let cells: Vec<Vec<BlurredCell>> = groups.par_iter().map(spread).collect::<Result<_, Cancelled>>()?;
        stopwatch.time(Part::Compositing, || cells.iter().flatten().for_each(&mut *add));
    }
    Ok(())
}

/// Spreads what lies around the knots of a group: each is mirrored to the canonical knot, whose kernel is transformed once.
fn spread_group(kernels: &LayerKernels, group: &Group<'_>, cancel: &Cancel) -> Result<Vec<BlurredCell>, Cancelled> {
    let place = |(knot, members): (&Knot, &'_ Vec<Member<'_>>)| {
        (kernels.symmetry.mirror(*knot), bounds(members.iter().map(|(sampled, _)| sampled.source)))
    };
    let around: Vec<Around<'_>> = group.iter().map(|own| (place(own), own.1)).collect();
    let Some(kernel) = group.keys().next().map(|knot| kernels.canonical_at(*knot)) else { return Ok(vec![]) };
    let largest = around.iter().map(|((_, at), _)| at.rows.max(at.columns)).max().unwrap_or(1);
    let size = fast_size(largest + kernel.width - 1);
    with_fft(size, |fft| BUFFERS.with_borrow_mut(|buffers| spread_around(&around, (kernel, fft), buffers, cancel)))
}

/// What is spread by a kernel: the mirror of a knot, what its samples lie in, and the patches that have them.
type Around<'a> = ((Mirror, Rectangle), &'a Vec<Member<'a>>);

/// Spreads what lies around knots by their canonical kernel: two at a time, or one that is alone.
fn spread_around(
    around: &[Around<'_>],
    (kernel, fft): (&KnotKernel, &mut Fft2),
    buffers: &mut Buffers,
    cancel: &Cancel,
) -> Result<Vec<BlurredCell>, Cancelled> {
    if let [own] = around {
        cancel.check()?;
        return Ok(vec![buffers.spread(fft, kernel, own)]);
    }
    buffers.transform_kernel(fft, kernel);
    let mut cells = Vec::with_capacity(around.len());
    for pair in around.chunks(2) {
        cancel.check()?;
        buffers.spread_pair(fft, kernel.width, pair, &mut cells);
    }
    Ok(cells)
}

/// Returns the rectangle that holds all of these.
fn bounds(rectangles: impl Iterator<Item = Rectangle>) -> Rectangle {
    let (mut top, mut left, mut bottom, mut right) = (i64::MAX, i64::MAX, i64::MIN, i64::MIN);
    for at in rectangles {
        (top, left) = (top.min(at.first_row), left.min(at.first_column));
        (bottom, right) = (bottom.max(at.first_row + at.rows as i64), right.max(at.first_column + at.columns as i64));
    }
    Rectangle { first_row: top, first_column: left, rows: (bottom - top) as usize, columns: (right - left) as usize }
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
}

impl Buffers {
    /// Spreads the samples around a knot by the canonical kernel.
    fn spread(&mut self, fft: &mut Fft2, kernel: &KnotKernel, ((mirror, at), members): &Around<'_>) -> BlurredCell {
        fft.forward(&kernel.samples, kernel.width, &mut self.kernel);
        self.gather(at, members);
        mirror.applied(&self.block, (at.rows, at.columns), &mut self.mirrored);
        fft.forward(&self.mirrored, mirror.size((at.rows, at.columns)).1, &mut self.spectrum);
        multiply(&mut self.spectrum, &self.kernel);
        let at = widened(at, kernel.width);
        let (rows, columns) = mirror.size((at.rows, at.columns));
        fft.inverse(&mut self.spectrum, rows, columns, &mut self.mirrored);
        BlurredCell { at, values: mirror.restored(&self.mirrored, (at.rows, at.columns)) }
    }

    /// Finds what the spectra of pairs are multiplied by to be spread by a kernel, the scale of the transforms included.
    fn transform_kernel(&mut self, fft: &mut Fft2, kernel: &KnotKernel) {
        let (size, width) = (fft.size(), kernel.width);
        let scale = 1.0 / (size * size) as f32;
        self.lines.clear();
        self.lines.resize(width * size, Complex::new(0.0, 0.0));
        for (line, samples) in self.lines.chunks_exact_mut(size).zip(kernel.samples.chunks_exact(width)) {
            line.iter_mut().zip(samples).for_each(|(value, sample)| value.re = sample * scale);
        }
        fft.forward_pair(&mut self.lines, &mut self.kernel);
    }

    /// Spreads the samples around two knots, or around the last of an odd number, by the canonical kernel. Those around one are the real parts of
    /// the samples of a block, around the other the imaginary ones: a kernel, which is real, leaves them apart.
    fn spread_pair(&mut self, fft: &mut Fft2, width: usize, pair: &[Around<'_>], cells: &mut Vec<BlurredCell>) {
        let size = fft.size();
        let rows_of = |((mirror, at), _): &Around<'_>| mirror.size((at.rows, at.columns)).0;
        let n_rows = pair.iter().map(rows_of).max().unwrap_or(0);
        self.lines.clear();
        self.lines.resize(n_rows * size, Complex::new(0.0, 0.0));
        for (part, ((mirror, at), members)) in pair.iter().enumerate() {
            self.gather(at, members);
            let (block, lines) = (&self.block, (&mut self.lines[..], size));
            match part {
                0 => mirror.applied_to(block, (at.rows, at.columns), lines, |value, sample| value.re = sample),
                _ => mirror.applied_to(block, (at.rows, at.columns), lines, |value, sample| value.im = sample),
            }
        }
        fft.forward_pair(&mut self.lines, &mut self.spectrum);
        multiply(&mut self.spectrum, &self.kernel);
        fft.inverse_pair(&mut self.spectrum, n_rows + width - 1, &mut self.lines);
        for (part, ((mirror, at), _)) in pair.iter().enumerate() {
            let at = widened(at, width);
            let (size, lines) = ((at.rows, at.columns), (&self.lines[..], size));
            let values = match part {
                0 => mirror.restored_from(lines, size, |value| value.re),
                _ => mirror.restored_from(lines, size, |value| value.im),
            };
            cells.push(BlurredCell { at, values });
        }
    }

    /// Puts the samples of the patches around a knot, times its weights, into `block`.
    fn gather(&mut self, at: &Rectangle, members: &[Member<'_>]) {
        self.block.clear();
        self.block.resize(at.rows * at.columns, 0.0);
        for (sampled, shares) in members {
            let PatchSamples { source, places, ideal, .. } = sampled;
            let first = (source.first_row - at.first_row) as usize * at.columns
                + (source.first_column - at.first_column) as usize;
            let block = self.block[first..].chunks_mut(at.columns);
            for ((line, down), block) in ideal.chunks_exact(source.columns).zip(&places.down).zip(block) {
                let along: [f32; 3] = std::array::from_fn(|j| (0..3).map(|i| shares[3 * i + j] * down[i]).sum());
                add_weighted(line, &places.across, along, block);
            }
        }
    }
}

/// Returns what light from a rectangle reaches that is spread by a kernel.
fn widened(at: &Rectangle, width: usize) -> Rectangle {
    let half = (width / 2) as i64;
    let (rows, columns) = (at.rows + width - 1, at.columns + width - 1);
    Rectangle { first_row: at.first_row - half, first_column: at.first_column - half, rows, columns }
}

/// Adds samples times their weights to a line: a sum of the polynomials at each, times `along`.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn add_weighted(line: &[f32], across: &[[f32; 3]], along: [f32; 3], sum: &mut [f32]) {
    for ((sum, value), across) in sum.iter_mut().zip(line).zip(across) {
        *sum += value * (along[0] + along[1] * across[1] + along[2] * across[2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        knot_kernels::Symmetry,
        patch::{Cell, Patch, polynomials},
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
        let (rows, columns, width) = (12, 7, 5);
        let ways = [(64, -32), (-64, -32), (64, 32), (32, -64), (-32, 64), (32, 64), (-32, -64), (-64, 32), (0, 0)];
        let knots = ways.map(|(right, down)| Knot { right, down });
        for symmetry in [Symmetry::Octants, Symmetry::None] {
            let canonical = knots.iter().map(|&knot| symmetry.canonical(knot));
            let kernel = |knot: Knot| {
                let seed = (knot.right + 1000 * knot.down).unsigned_abs();
                (knot, KnotKernel { width, samples: noise(width * width, seed) })
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
            spread_by_knots(&kernels, &samples, observers, &mut |cell| add(&cell.at, &cell.values)).unwrap();
            for PatchSamples { patch, source, places, ideal } in &samples {
                for (i, value) in ideal.iter().enumerate() {
                    let (row, column) = (i / columns, i % columns);
                    let at = Rectangle {
                        first_row: source.first_row + row as i64 - 2,
                        first_column: source.first_column + column as i64 - 2,
                        rows: width,
                        columns: width,
                    };
                    let mut kernel = vec![0.0; width * width];
                    for (knot, shares) in &patch.shares {
                        let weight: f32 =
                            (0..9).map(|k| shares[k] * places.down[row][k / 3] * places.across[column][k % 3]).sum();
                        kernels.at(*knot).add_to(&mut kernel, width, -weight * value);
                    }
                    add(&at, &kernel);
                }
            }
            // Sums of some hundred products near 1, in single precision.
            let worst = spread.values().fold(0.0, |worst: f64, left| worst.max(left.abs()));
            assert!(worst < 1e-3, "{symmetry:?}: {worst}");
            // What both patches cover, and half a kernel around.
            assert_eq!(spread.len(), (rows + 1 + width - 1) * (16 + columns + width - 1));
        }
    }
}
