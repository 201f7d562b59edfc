//! A layer spread knot by knot: the samples around each, times its weights, with its kernel.

use std::collections::BTreeMap;

use dioptric_fft::Complex;
use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;

use crate::{
    convolve::{Fft2, fast_size, multiply, with_fft},
    knot_kernels::{LayerKernels, Mirror},
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
    let around: Vec<(Knot, Rectangle)> = group
        .iter()
        .map(|(knot, members)| (*knot, bounds(members.iter().map(|(sampled, _)| sampled.source))))
        .collect();
    let Some(kernel) = around.first().map(|(knot, _)| kernels.canonical_at(*knot)) else { return Ok(vec![]) };
    let largest = around.iter().map(|(_, at)| at.rows.max(at.columns)).max().unwrap_or(1);
    with_fft(fast_size(largest + kernel.width - 1), |fft| {
        let mut spectrum = vec![];
        fft.forward(&kernel.samples, kernel.width, &mut spectrum);
        let mut buffers = Buffers::default();
        let spread = |((knot, at), members): ((Knot, Rectangle), &Vec<Member<'_>>)| {
            cancel.check()?;
            let mirror = kernels.symmetry.mirror(knot);
            Ok(buffers.spread(fft, (&spectrum, kernel.width), (mirror, at), members))
        };
        around.into_iter().zip(group.values()).map(spread).collect()
    })
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

/// Memory that knots of a group use one after the other.
#[derive(Default)]
struct Buffers {
    block: Vec<f32>,
    weighted: Vec<f32>,
    spectrum: Vec<Complex<f32>>,
    spread: Vec<f32>,
}

impl Buffers {
    /// Spreads the samples around a knot by the canonical kernel.
    fn spread(
        &mut self,
        fft: &mut Fft2,
        (kernel, width): (&[Complex<f32>], usize),
        (mirror, at): (Mirror, Rectangle),
        members: &[Member<'_>],
    ) -> BlurredCell {
        self.block.clear();
        self.block.resize(at.rows * at.columns, 0.0);
        for member in members {
            add_weighted(member, (mirror, &at), &mut self.block, &mut self.weighted);
        }
        fft.forward(&self.block, mirror.size((at.rows, at.columns)).1, &mut self.spectrum);
        multiply(&mut self.spectrum, kernel);
        let size = (at.rows + width - 1, at.columns + width - 1);
        let (rows, columns) = mirror.size(size);
        fft.inverse(&mut self.spectrum, rows, columns, &mut self.spread);
        let half = (width / 2) as i64;
        let (first_row, first_column) = (at.first_row - half, at.first_column - half);
        let at = Rectangle { first_row, first_column, rows: size.0, columns: size.1 };
        BlurredCell { at, values: mirror.restored(&self.spread, size) }
    }
}

/// Adds the samples of a patch, times the weights of a knot, to the mirrored block around the knot.
fn add_weighted(
    (sampled, shares): &Member<'_>,
    (mirror, at): (Mirror, &Rectangle),
    block: &mut [f32],
    weighted: &mut Vec<f32>,
) {
    let PatchSamples { source, places, ideal, .. } = sampled;
    let skip_rows = (source.first_row - at.first_row) as usize;
    let skip_columns = (source.first_column - at.first_column) as isize;
    for (row, (line, down)) in ideal.chunks_exact(source.columns).zip(&places.down).enumerate() {
        let along: [f32; 3] = std::array::from_fn(|j| (0..3).map(|i| shares[3 * i + j] * down[i]).sum());
        weighted.clear();
        let along = |across: &[f32; 3]| along[0] + along[1] * across[1] + along[2] * across[2];
        weighted.extend(line.iter().zip(&places.across).map(|(value, across)| value * along(across)));
        let (first, step) = mirror.line(skip_rows + row, (at.rows, at.columns));
        let first = first as isize + skip_columns * step;
        if step == 1 {
            let block = &mut block[first as usize..][..weighted.len()];
            block.iter_mut().zip(&*weighted).for_each(|(sum, value)| *sum += value);
        } else {
            let places = (0..).map(|column: isize| (first + column * step) as usize);
            places.zip(&*weighted).for_each(|(place, value)| block[place] += value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        knot_kernels::{KnotKernel, Symmetry},
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
