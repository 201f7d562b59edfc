//! Kernels at knots of the film.

use std::{collections::BTreeMap, sync::OnceLock};

use dioptric_psf::{Kernel, LensImage};
use glam::DVec2;

use crate::{convolve::add_scaled, patch::Knot, rectangle::Rectangle};

/// Which knots have kernels that follow from each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Symmetry {
    /// Those that mirror each other about the axes and their diagonals.
    Octants,
    /// None.
    None,
}

impl Symmetry {
    pub(crate) fn of(lens: &dyn LensImage) -> Self {
        if lens.is_symmetric() { Self::Octants } else { Self::None }
    }

    /// Returns the knot whose kernel a knot's follows from: that of the same distance from the axis in the first octant,
    /// right and up, or itself.
    pub(crate) fn canonical(self, knot: Knot) -> Knot {
        match self {
            Self::Octants => {
                let (a, b) = (knot.right.abs(), knot.down.abs());
                Knot { right: a.max(b), down: -a.min(b) }
            }
            Self::None => knot,
        }
    }

    /// Returns what takes the surroundings of a knot to those of its canonical one.
    pub(crate) fn mirror(self, knot: Knot) -> Mirror {
        match self {
            Self::Octants => Mirror {
                flips_rows: knot.down > 0,
                flips_columns: knot.right < 0,
                swaps: knot.down.abs() > knot.right.abs(),
            },
            Self::None => Mirror::default(),
        }
    }
}

/// Kernels of up to so many samples along a side get no border before they are moved where they are about their centroid: most are one sample.
const SMALL: usize = 9;

/// The share of a kernel's light that is left out on each side of it.
const LEFT_OUT: f64 = 1e-7;

/// A kernel whose samples sum to 1, about the reference point of a lens.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct KnotKernel {
    /// Where its samples lie: rows below the reference point's and columns to the right of it. A comet lies to one side of it.
    pub(crate) at: Rectangle,
    pub(crate) samples: Vec<f32>,
}

impl KnotKernel {
    /// Takes a kernel of odd sides, scales it to a sum of 1, leaves out the borders without light and moves the centroid of its samples to its own.
    pub(crate) fn new(kernel: &Kernel) -> Self {
        let Kernel { samples, middle_px, centroid_px, .. } = kernel;
        let (rows, columns) = samples.dim();
        let first = |middle: i32, n: usize| i64::from(middle) - (n / 2) as i64;
        let (first_row, first_column) = (first(middle_px.y, rows), first(middle_px.x, columns));
        let whole = Rectangle { first_row, first_column, rows, columns };
        let samples = samples.as_standard_layout();
        let samples = samples.as_slice().expect("it is in standard order");
        let (by_row, by_column) = sums_of_lines(samples, columns);
        let sum: f64 = by_row.iter().sum();
        if sum <= 0.0 {
            // No light is spread by it.
            return Self { at: Rectangle::PIXEL, samples: vec![1.0] };
        }
        let (above, lit_rows) = lit_part(&by_row, sum);
        let (left, lit_columns) = lit_part(&by_column, sum);
        let (first_row, first_column) = (first_row + above as i64, first_column + left as i64);
        let lit = Rectangle { first_row, first_column, rows: lit_rows, columns: lit_columns };
        // Light that is moved from the outermost samples needs a place: a rim may lie in them.
        let border = usize::from(*centroid_px != DVec2::ZERO || rows.max(columns) > SMALL);
        let at = lit.grown(1).intersection(&whole.grown(border)).unwrap_or(lit);
        let mut bordered = Bordered::new(at);
        let (skipped_rows, margin) =
            ((lit.first_row - at.first_row) as usize, (lit.first_column - at.first_column) as usize);
        let lines = samples.chunks_exact(columns).skip(above).take(lit_rows);
        for (line, samples) in bordered.rows_mut().skip(skipped_rows).zip(lines) {
            let line = line[margin..].iter_mut().zip(&samples[left..][..lit_columns]);
            line.for_each(|(scaled, &sample)| *scaled = f64::from(sample) / sum);
        }
        Self { at, samples: centered(bordered, middle_px.as_dvec2() + *centroid_px) }.without_dark_border()
    }

    /// Returns the kernel without those of the outermost rows and columns to which next to no light was moved.
    fn without_dark_border(self) -> Self {
        /// Left out of 2,000 samples a side it moves the centroid by less than it is off.
        const DARK: f32 = 1e-10;
        let Rectangle { first_row, first_column, rows, columns } = self.at;
        let row = |row: usize| self.samples[row * columns..][..columns].iter().sum::<f32>();
        let column = |column: usize| self.samples[column..].iter().step_by(columns).sum::<f32>();
        let is_dark = |n: usize, light: f32| usize::from(n > 2 && light < DARK);
        let (above, below) = (is_dark(rows, row(0)), is_dark(rows, row(rows - 1)));
        let (left, right) = (is_dark(columns, column(0)), is_dark(columns, column(columns - 1)));
        if above + below + left + right == 0 {
            return self;
        }
        let at = Rectangle {
            first_row: first_row + above as i64,
            first_column: first_column + left as i64,
            rows: rows - above - below,
            columns: columns - left - right,
        };
        // Kernels are many: none takes more memory than it has samples.
        let mut samples = Vec::with_capacity(at.len());
        let lines = self.samples[at.offset_in(&self.at)..].chunks(columns).take(at.rows);
        lines.for_each(|line| samples.extend_from_slice(&line[..at.columns]));
        Self { at, samples }
    }

    /// Adds the kernel times a factor to a block about the reference point that holds all of it.
    #[inline(never)]
    pub(crate) fn add_to(&self, sum: &mut [f32], block: &Rectangle, factor: f32) {
        if *block == self.at {
            return add_scaled(sum, factor, &self.samples);
        }
        let lines = sum[self.at.offset_in(block)..].chunks_mut(block.columns);
        for (line, samples) in lines.zip(self.samples.chunks_exact(self.at.columns)) {
            line.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += factor * sample);
        }
    }

    /// Returns the sum of kernels times factors.
    #[inline(never)]
    pub(crate) fn sum_of(terms: &[(&Self, f32)]) -> Self {
        let at = Rectangle::around(terms.iter().map(|(kernel, _)| kernel.at)).unwrap_or(Rectangle::PIXEL);
        let mut samples = vec![0.0; at.len()];
        terms.iter().for_each(|(kernel, factor)| kernel.add_to(&mut samples, &at, *factor));
        Self { at, samples }
    }

    fn mixed(&self, other: &Self, fraction: f32) -> Self {
        Self::sum_of(&[(self, 1.0 - fraction), (other, fraction)])
    }

    /// Returns the kernel of a canonical knot at another.
    fn mirrored(&self, mirror: Mirror) -> Self {
        let at = mirror.window_at_knot(&self.at);
        Self { at, samples: mirror.restored(&self.samples, (at.rows, at.columns)) }
    }

    /// Returns the place of the centroid: pixels below the reference point and to the right of it.
    pub(crate) fn first_moments(&self) -> [f64; 2] {
        let mut moments = [0.0; 2];
        self.for_each(|down, across, sample| {
            moments[0] += sample * down;
            moments[1] += sample * across;
        });
        moments
    }

    /// Returns the second moments about the reference point: down twice, down and across, across twice; square pixels.
    pub(crate) fn second_moments(&self) -> [f64; 3] {
        let mut moments = [0.0; 3];
        self.for_each(|down, across, sample| {
            moments[0] += sample * down * down;
            moments[1] += sample * down * across;
            moments[2] += sample * across * across;
        });
        moments
    }

    /// Calls a function for each sample: with its row and its column, counted from the reference point's, and its value.
    #[inline]
    pub(crate) fn for_each(&self, mut function: impl FnMut(f64, f64, f64)) {
        let Rectangle { first_row, first_column, columns, .. } = self.at;
        for (row, line) in (first_row..).zip(self.samples.chunks_exact(columns)) {
            for (column, &sample) in (first_column..).zip(line) {
                function(row as f64, column as f64, f64::from(sample));
            }
        }
    }
}

/// Returns the sums of the rows and of the columns of a block of samples.
fn sums_of_lines(samples: &[f32], columns: usize) -> (Vec<f64>, Vec<f64>) {
    let mut by_row = Vec::with_capacity(samples.len() / columns);
    let mut by_column = vec![0.0; columns];
    for line in samples.chunks_exact(columns) {
        let mut lanes = [0.0; LANES];
        let (whole, rest) = line.as_chunks::<LANES>();
        for samples in whole {
            (0..LANES).for_each(|k| lanes[k] += f64::from(samples[k]));
        }
        by_row.push(lanes.iter().sum::<f64>() + rest.iter().map(|&v| f64::from(v)).sum::<f64>());
        by_column.iter_mut().zip(line).for_each(|(sum, &value)| *sum += f64::from(value));
    }
    (by_row, by_column)
}

/// Returns the first of some lines of a kernel that hold all but a negligible share of its light on each side, and their number.
fn lit_part(sums: &[f64], sum: f64) -> (usize, usize) {
    let dark = |sums: &mut dyn Iterator<Item = &f64>| {
        let mut left_out = 0.0;
        let is_dark = |part: &&f64| {
            left_out += **part;
            left_out <= LEFT_OUT * sum
        };
        sums.take_while(is_dark).count()
    };
    let before = dark(&mut sums.iter());
    (before, sums.len() - before - dark(&mut sums[before + 1..].iter().rev()))
}

/// What takes the surroundings of a knot to those of its canonical knot: rows and columns turned about, then both exchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mirror {
    flips_rows: bool,
    flips_columns: bool,
    /// About the diagonal from lower left to upper right.
    swaps: bool,
}

impl Mirror {
    /// Returns the rows and columns of a block once it is mirrored.
    pub(crate) fn size(self, (rows, columns): (usize, usize)) -> (usize, usize) {
        if self.swaps { (columns, rows) } else { (rows, columns) }
    }

    /// Returns the block of so many rows and columns of which this is the mirrored one.
    pub(crate) fn restored(self, mirrored: &[f32], (rows, columns): (usize, usize)) -> Vec<f32> {
        self.restored_from((mirrored, self.size((rows, columns)).1), (rows, columns), |sample| sample)
    }

    /// Returns the block of so many rows and columns whose mirrored one a number of each value is; lines begin so many values apart.
    pub(crate) fn restored_from<T: Copy>(
        self,
        (mirrored, stride): (&[T], usize),
        (rows, columns): (usize, usize),
        sample: impl Fn(T) -> f32,
    ) -> Vec<f32> {
        if !self.swaps {
            let mut block = Vec::with_capacity(rows * columns);
            for row in 0..rows {
                let row = if self.flips_rows { rows - 1 - row } else { row };
                let line = mirrored[row * stride..][..columns].iter().map(|&value| sample(value));
                if self.flips_columns { block.extend(line.rev()) } else { block.extend(line) }
            }
            return block;
        }
        let mut block = vec![0.0; rows * columns];
        // Rows and columns exchanged as `applied_to` has it, seen from the mirrored block.
        let turned = Turned { flips_rows: !self.flips_columns, flips_columns: !self.flips_rows, swaps: true };
        turned
            .copy((mirrored, stride), self.size((rows, columns)), (&mut block, columns), |to, from| *to = sample(from));
        block
    }

    /// Puts the mirrored block of one of so many rows and columns into `mirrored`.
    pub(crate) fn applied(self, block: &[f32], (rows, columns): (usize, usize), mirrored: &mut Vec<f32>) {
        mirrored.resize(rows * columns, 0.0);
        let stride = self.size((rows, columns)).1;
        self.applied_to(block, (rows, columns), (mirrored, stride), |to, from| *to = from);
    }

    /// Puts the samples of the mirrored block of one of so many rows and columns into lines that begin so many values apart.
    pub(crate) fn applied_to<T>(
        self,
        block: &[f32],
        (rows, columns): (usize, usize),
        lines: (&mut [T], usize),
        put: impl Fn(&mut T, f32),
    ) {
        // About the diagonal from lower left to upper right both are turned about once more.
        let (flips_rows, flips_columns) = (self.flips_rows != self.swaps, self.flips_columns != self.swaps);
        let turned = Turned { flips_rows, flips_columns, swaps: self.swaps };
        turned.copy((block, columns), (rows, columns), lines, put);
    }

    /// Returns where the samples of a kernel lie of which the canonical ones are known.
    pub(crate) fn window_at_knot(self, canonical: &Rectangle) -> Rectangle {
        let Rectangle { first_row, first_column, rows, columns } = *canonical;
        let turned_about = |first: i64, n: usize| 1 - first - n as i64;
        let (below, right) = (turned_about(first_row, rows), turned_about(first_column, columns));
        let (first_row, first_column) = if self.swaps { (right, below) } else { (first_row, first_column) };
        let (rows, columns) = self.size((rows, columns));
        Rectangle {
            first_row: if self.flips_rows { turned_about(first_row, rows) } else { first_row },
            first_column: if self.flips_columns { turned_about(first_column, columns) } else { first_column },
            rows,
            columns,
        }
    }

    /// Returns the first moments of a kernel of which the canonical ones are known.
    fn first_moments_at_knot(self, [down, across]: [f64; 2]) -> [f64; 2] {
        let [down, across] = if self.swaps { [-across, -down] } else { [down, across] };
        [if self.flips_rows { -down } else { down }, if self.flips_columns { -across } else { across }]
    }

    /// Returns the second moments of a kernel of which the canonical ones are known.
    fn second_moments_at_knot(self, [down, mixed, across]: [f64; 3]) -> [f64; 3] {
        let mixed = if self.flips_rows == self.flips_columns { mixed } else { -mixed };
        if self.swaps { [across, mixed, down] } else { [down, mixed, across] }
    }
}

/// How a block is turned: the order of its rows, of its columns, and then both exchanged.
#[derive(Clone, Copy)]
struct Turned {
    flips_rows: bool,
    flips_columns: bool,
    swaps: bool,
}

impl Turned {
    /// Copies a block of so many rows and columns, turned. Lines of both begin so many values apart.
    fn copy<A: Copy, B>(
        self,
        (from, from_stride): (&[A], usize),
        (rows, columns): (usize, usize),
        (to, to_stride): (&mut [B], usize),
        put: impl Fn(&mut B, A),
    ) {
        /// Rows that become columns together.
        const BATCH: usize = 8;
        let row_at = |row: usize| &from[if self.flips_rows { rows - 1 - row } else { row } * from_stride..][..columns];
        if !self.swaps {
            for (row, to) in to.chunks_mut(to_stride).take(rows).enumerate() {
                let (to, from) = (to[..columns].iter_mut(), row_at(row).iter());
                if self.flips_columns {
                    to.zip(from.rev()).for_each(|(to, from)| put(to, *from));
                } else {
                    to.zip(from).for_each(|(to, from)| put(to, *from));
                }
            }
            return;
        }
        for first in (0..rows).step_by(BATCH) {
            let n_rows = BATCH.min(rows - first);
            let lines: [&[A]; BATCH] = std::array::from_fn(|i| row_at(first + i.min(n_rows - 1)));
            for (column, to) in to.chunks_mut(to_stride).take(columns).enumerate() {
                let column = if self.flips_columns { columns - 1 - column } else { column };
                let values = lines.map(|line| line[column]);
                to[first..first + n_rows].iter_mut().zip(values).for_each(|(to, from)| put(to, from));
            }
        }
    }
}

/// The kernels of one layer at one wavelength, at the canonical knots, each on the raster of its knot.
#[derive(Clone, Debug)]
pub(crate) struct LayerKernels {
    pub(crate) symmetry: Symmetry,
    by_knot: BTreeMap<Knot, Known>,
}

/// A kernel, and its moments once something has asked for them: each knot has weight in nine patches or more.
#[derive(Clone, Debug)]
struct Known {
    kernel: KnotKernel,
    moments: OnceLock<Moments>,
}

impl From<KnotKernel> for Known {
    fn from(kernel: KnotKernel) -> Self {
        Self { kernel, moments: OnceLock::new() }
    }
}

/// Moments of a kernel about its middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments {
    /// Down and across, pixels.
    pub(crate) first: [f64; 2],
    /// Down twice, down and across, across twice; square pixels.
    pub(crate) second: [f64; 3],
}

impl LayerKernels {
    pub(crate) fn new(symmetry: Symmetry, by_knot: BTreeMap<Knot, KnotKernel>) -> Self {
        Self { symmetry, by_knot: known(by_knot) }
    }

    /// The number of kernels.
    pub(crate) fn n_kernels(&self) -> usize {
        self.by_knot.len()
    }

    /// The bytes of memory of the kernels' samples.
    pub(crate) fn size_bytes(&self) -> usize {
        self.by_knot.values().map(|known| size_of_val(known.kernel.samples.as_slice())).sum()
    }

    /// Returns the kernels between two wavelengths.
    pub(crate) fn mixed(&self, other: &Self, fraction: f32) -> Self {
        let mix = |(knot, known): (&Knot, &Known)| {
            (*knot, Known::from(known.kernel.mixed(&other.by_knot[knot].kernel, fraction)))
        };
        Self { symmetry: self.symmetry, by_knot: self.by_knot.iter().map(mix).collect() }
    }

    /// Adds kernels of canonical knots.
    pub(crate) fn extend(&mut self, by_knot: BTreeMap<Knot, KnotKernel>) {
        self.by_knot.extend(known(by_knot));
    }

    /// Returns the kernel at a knot anywhere on the film: that of its canonical knot, mirrored.
    pub(crate) fn at(&self, knot: Knot) -> KnotKernel {
        self.canonical_at(knot).mirrored(self.symmetry.mirror(knot))
    }

    /// Whether the kernel at a knot is known.
    pub(crate) fn has(&self, knot: Knot) -> bool {
        self.by_knot.contains_key(&self.symmetry.canonical(knot))
    }

    /// Returns where the samples of the kernel at a knot lie.
    #[inline(never)]
    pub(crate) fn window_at(&self, knot: Knot) -> Rectangle {
        self.symmetry.mirror(knot).window_at_knot(&self.canonical_at(knot).at)
    }

    /// Returns the kernel of the canonical knot of a knot.
    pub(crate) fn canonical_at(&self, knot: Knot) -> &KnotKernel {
        &self.by_knot[&self.symmetry.canonical(knot)].kernel
    }

    /// Returns the moments of the kernel at a knot anywhere on the film.
    pub(crate) fn moments_at(&self, knot: Knot) -> Moments {
        let Known { kernel, moments } = &self.by_knot[&self.symmetry.canonical(knot)];
        let of_kernel = || Moments { first: kernel.first_moments(), second: kernel.second_moments() };
        let (mirror, Moments { first, second }) = (self.symmetry.mirror(knot), *moments.get_or_init(of_kernel));
        Moments { first: mirror.first_moments_at_knot(first), second: mirror.second_moments_at_knot(second) }
    }
}

fn known(by_knot: BTreeMap<Knot, KnotKernel>) -> BTreeMap<Knot, Known> {
    by_knot.into_iter().map(|(knot, kernel)| (knot, kernel.into())).collect()
}

/// Returns the largest magnitude of the edge spread functions, along rows and columns, of a kernel.
pub(crate) fn edge_spread_peak(kernel: &[f32], width: usize) -> f64 {
    let mut by_column = vec![0.0_f64; width];
    let (mut down, mut peak) = (0.0_f64, 0.0_f64);
    for line in kernel.chunks_exact(width) {
        for (sum, &value) in by_column.iter_mut().zip(line) {
            *sum += f64::from(value);
        }
        down += line.iter().map(|&value| f64::from(value)).sum::<f64>();
        peak = peak.max(down.abs());
    }
    let mut right = 0.0;
    for sum in by_column {
        right += sum;
        peak = peak.max(right.abs());
    }
    peak
}

/// Returns the largest magnitude of the corner spread function of a kernel, what it makes of a quadrant of the plane: at least that of its edge spread
/// functions, and more where its rows and columns sum to nothing.
pub(crate) fn corner_spread_peak(kernel: &[f32], width: usize) -> f64 {
    corner_spread_peaks(kernel, width).fold(0.0, f64::max)
}

/// Returns whether the corner spread function of a kernel has a magnitude above a limit.
pub(crate) fn corner_spread_exceeds(kernel: &[f32], width: usize, limit: f64) -> bool {
    // Corner spreads are sums of samples.
    let most: f64 =
        kernel.chunks_exact(width).map(|line| f64::from(line.iter().map(|value| value.abs()).sum::<f32>())).sum();
    most > limit && corner_spread_peaks(kernel, width).any(|peak| peak > limit)
}

/// The largest magnitudes of the corner spread function of a kernel, in eight lines after the other: sums along them do not wait for each other.
fn corner_spread_peaks(kernel: &[f32], width: usize) -> impl Iterator<Item = f64> {
    const LINES: usize = 8;
    let mut above = vec![0.0_f64; width];
    kernel.chunks(LINES * width).map(move |lines| {
        // Where there are fewer the last one stands for those that lack, and is not counted.
        let n_lines = lines.len() / width;
        let line_at = |i: usize| &lines[i.min(n_lines - 1) * width..][..width];
        let line: [&[f32]; LINES] = std::array::from_fn(line_at);
        let (mut left, mut peak) = ([0.0; LINES], 0.0_f64);
        for (column, corner) in above.iter_mut().enumerate() {
            left.iter_mut().zip(line).for_each(|(left, line)| *left += f64::from(line[column]));
            for left in &left[..n_lines] {
                *corner += left;
                peak = peak.max(corner.abs());
            }
        }
        peak
    })
}

/// The share of a kernel's light in a sample that changes no picture.
const NOTHING: f64 = 1e-15;

/// Distance of a kernel's centroid from where it belongs that changes no picture, pixels.
const CENTERED_PX: f64 = 1e-7;

/// Moves the centroid of a kernel to a place (pixels to the right of the reference point and below it), without blurring it and without negative samples,
/// and returns its samples, of sum 1.
///
/// What falls on the pixels of a spread has its own centroid elsewhere where the spread is small: the part within a pixel counts as its
/// middle. Such a shift changes over the film, and a change of shift is light that is drawn together or apart: half a per cent of a
/// uniform plane in focus. Rounds move light across the edges between samples ([`crossing`]), which brings thin lines and cusps as far as the rest.
fn centered(mut kernel: Bordered, centroid_px: DVec2) -> Vec<f32> {
    const ROUNDS: usize = 40;
    let mut sums = kernel.sums();
    for _ in 0..ROUNDS {
        let off_px = sums.centroid_px(&kernel.at) - centroid_px;
        if off_px.abs().max_element() < CENTERED_PX {
            break;
        }
        sums = kernel.moved(off_px);
    }
    let scale = 1.0 / sums.all;
    let mut samples = Vec::with_capacity(kernel.at.len());
    // What rounds move on and on is soon below the least of normal numbers, which take many times as long.
    let settled = |sample: f64| if sample < NOTHING { 0.0 } else { sample as f32 };
    for row in kernel.rows() {
        samples.extend(row.iter().map(|sample| settled(sample * scale)));
    }
    samples
}

/// Sums over a block of samples: of all, and times column and row, counted from 0.
#[derive(Clone, Copy, Default)]
struct Sums {
    all: f64,
    across: f64,
    down: f64,
}

impl Sums {
    /// Returns how far right of the reference point and below it the centroid lies; `at` is where the samples lie.
    fn centroid_px(&self, at: &Rectangle) -> DVec2 {
        DVec2::new(self.across, self.down) / self.all + DVec2::new(at.first_column as f64, at.first_row as f64)
    }
}

/// A block of samples with a border of zeros all around.
struct Bordered {
    at: Rectangle,
    samples: Vec<f64>,
    next: Vec<f64>,
    /// Room for what crosses the edges of a line.
    edges: Vec<f64>,
}

impl Bordered {
    fn new(at: Rectangle) -> Self {
        Self { at, samples: vec![0.0; at.grown(1).len()], next: vec![], edges: vec![] }
    }

    fn rows_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        let Rectangle { rows, columns, .. } = self.at;
        self.samples.chunks_exact_mut(columns + 2).skip(1).take(rows).map(move |row| &mut row[1..=columns])
    }

    fn rows(&self) -> impl Iterator<Item = &[f64]> {
        let Rectangle { rows, columns, .. } = self.at;
        self.samples.chunks_exact(columns + 2).skip(1).take(rows).map(move |row| &row[1..=columns])
    }

    fn sums(&self) -> Sums {
        let mut sums = Sums::default();
        for (row, line) in self.rows().enumerate() {
            add_sums(line, row, &mut sums);
        }
        sums
    }

    /// Moves the samples back by a part of a pixel to first order; none below 0, and nothing beyond the outermost.
    fn moved(&mut self, off_px: DVec2) -> Sums {
        self.next.resize(self.samples.len(), 0.0);
        let Rectangle { rows, columns, .. } = self.at;
        self.edges.clear();
        self.edges.resize(3 * columns + 1, 0.0);
        let sums = move_back(&self.samples, (rows, columns), off_px, &mut self.edges, &mut self.next);
        std::mem::swap(&mut self.samples, &mut self.next);
        sums
    }
}

/// Lines are summed in so many lanes: vectors, and an order of the sum that does not depend on the machine.
const LANES: usize = 8;

#[inline(always)]
fn add_sums(line: &[f64], row: usize, sums: &mut Sums) {
    let (mut all, mut across) = ([0.0; LANES], [0.0; LANES]);
    let (whole, rest) = line.as_chunks::<LANES>();
    let mut column = 0.0;
    for lanes in whole {
        for k in 0..LANES {
            all[k] += lanes[k];
            across[k] += lanes[k] * (column + k as f64);
        }
        column += LANES as f64;
    }
    for (k, sample) in rest.iter().enumerate() {
        all[k] += sample;
        across[k] += sample * (column + k as f64);
    }
    let all: f64 = all.iter().sum();
    sums.all += all;
    sums.across += across.iter().sum::<f64>();
    sums.down += all * row as f64;
}

/// Puts samples moved back by a part of a pixel into `moved`; both have a border of zeros. `edges` has zeros for one edge more than three lines have samples.
#[multiversion::multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn move_back(
    samples: &[f64],
    (rows, width): (usize, usize),
    off_px: DVec2,
    edges: &mut [f64],
    moved: &mut [f64],
) -> Sums {
    let stride = width + 2;
    let [across_px, down_px] = [off_px.x, off_px.y].map(|off_px| off_px.abs().min(MOST_PX));
    let (to_left, to_above) = (off_px.x.signum(), off_px.y.signum());
    // Nothing crosses the edges of the block.
    let (between_columns, lines) = edges.split_at_mut(width + 1);
    let (mut above, mut below) = lines.split_at_mut(width);
    let mut sums = Sums::default();
    for row in 0..rows {
        let first = (row + 1) * stride + 1;
        let along_row = |offset: usize| &samples[first + offset - 1..][..width - 1];
        let (behind, from, to) = if off_px.x > 0.0 { (3, 2, 1) } else { (0, 1, 2) };
        crossing(across_px, along_row(behind), along_row(from), along_row(to), &mut between_columns[1..width]);
        if row + 1 < rows {
            let line = |offset: usize| &samples[first + offset * stride - stride..][..width];
            let (behind, from, to) = if off_px.y > 0.0 { (3, 2, 1) } else { (0, 1, 2) };
            crossing(down_px, line(behind), line(from), line(to), below);
        } else {
            below.fill(0.0);
        }
        let (own, line) = (&samples[first..][..width], &mut moved[first..][..width]);
        let (left, right) = (&between_columns[..width], &between_columns[1..]);
        for i in 0..width {
            line[i] = own[i] + to_left * (right[i] - left[i]) + to_above * (below[i] - above[i]);
        }
        add_sums(line, row, &mut sums);
        std::mem::swap(&mut above, &mut below);
    }
    sums
}

/// How far light is moved at once at most, pixels: less than half, so that samples have light for the next.
const MOST_PX: f64 = 0.25;

/// Puts into `crossing` what crosses the edges between samples `from` and `to` if light is moved by a part of a pixel, at most half of what is in `from`.
///
/// Central differences take half of a sample's move from the sample behind it and put half into the next, which leaves second moments as they are. What the sample behind
/// does not have the next gets more: each sample's own light is moved as far.
#[inline(always)]
fn crossing(part_px: f64, behind: &[f64], from: &[f64], to: &[f64], crossing: &mut [f64]) {
    let most = 0.5 - part_px;
    let n = crossing.len();
    let (behind, from, to) = (&behind[..n], &from[..n], &to[..n]);
    for i in 0..n {
        let taken_behind = f64::min(0.5 * part_px * from[i], most * behind[i]);
        let taken_here = f64::min(0.5 * part_px * to[i], most * from[i]);
        crossing[i] = part_px * from[i] - taken_behind + taken_here;
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn knot_kernel(samples: Array2<f32>, centroid_px: DVec2) -> KnotKernel {
        KnotKernel::new(&Kernel { centroid_px, ..Kernel::centered(samples, 1.0) })
    }

    fn even(rows: usize, columns: usize) -> KnotKernel {
        knot_kernel(Array2::ones((rows, columns)), DVec2::ZERO)
    }

    /// A spread whose flare leaves the pixel of its core on one side: pixels count it as farther out than it is.
    #[test]
    fn kernels_are_centered_and_as_wide_as_before() {
        let lopsided = Array2::from_shape_vec((3, 3), vec![0.0, 0.01, 0.02, 0.0, 0.82, 0.12, 0.0, 0.01, 0.02]).unwrap();
        let kernel = knot_kernel(lopsided.clone(), DVec2::ZERO);
        let moment = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            let samples = kernel.samples.iter().enumerate();
            samples.map(|(i, &s)| f64::from(s) * of((i % 3) as f64 - 1.0, (i / 3) as f64 - 1.0)).sum()
        };
        assert!((moment(&|_, _| 1.0) - 1.0).abs() < 1e-6);
        assert!(moment(&|x, _| x).abs() < 1e-6 && moment(&|_, y| y).abs() < 1e-6);
        // .16 and .06 before: what would have left the window is cut off.
        assert!((moment(&|x, _| x * x) - 0.16).abs() < 0.03, "{}", moment(&|x, _| x * x));
        assert!((moment(&|_, y| y * y) - 0.06).abs() < 0.01, "{}", moment(&|_, y| y * y));
        assert!(kernel.samples.iter().all(|&sample| sample >= 0.0));
        let aside = knot_kernel(lopsided, DVec2::new(0.2, -0.1));
        let [down, across] = aside.first_moments();
        assert!((across - 0.2).abs() < 1e-6 && (down + 0.1).abs() < 1e-6, "{down} {across}");
        let point = even(1, 1);
        assert_eq!((point.at, point.samples), (Rectangle::PIXEL, vec![1.0]));
        // A point aside is shared by two pixels.
        let [down, across] = knot_kernel(Array2::ones((1, 1)), DVec2::new(0.03, -0.3)).first_moments();
        assert!((across - 0.03).abs() < 1e-5 && (down + 0.3).abs() < 1e-3, "{down} {across}");
    }

    /// Samples are kept where there is light, wherever the reference point is, and where it is moved: to the left, from where others were.
    #[test]
    fn borders_without_light_are_left_out() {
        let mut samples = Array2::zeros((21, 21));
        (samples[(3, 12)], samples[(5, 18)], samples[(5, 19)]) = (0.5, 0.25, 0.25);
        samples[(20, 0)] = 5e-8;
        let kernel = knot_kernel(samples, DVec2::new(5.2, -6.0));
        assert_eq!(kernel.at, Rectangle { first_row: -7, first_column: 1, rows: 3, columns: 9 });
        let [down, across] = kernel.first_moments();
        assert!((down + 6.0).abs() < 1e-5 && (across - 5.2).abs() < 1e-5, "{down} {across}");
        // One sample of light in a corner, and none at all.
        let mut corner = Array2::zeros((5, 3));
        corner[(4, 2)] = 2.0;
        let at = Rectangle { first_row: 2, first_column: 1, ..Rectangle::PIXEL };
        assert_eq!(knot_kernel(corner, DVec2::new(1.0, 2.0)).at, at);
        assert_eq!(knot_kernel(Array2::zeros((5, 3)), DVec2::ZERO), even(1, 1));
    }

    /// A comet with its cusp in the corner of its window: central differences would take light away beyond the cusp, where there is none.
    #[test]
    fn comets_are_moved_off_their_cusps() {
        for brightness in [1.0, 100.0, 1000.0] {
            let mut comet = Array2::from_elem((81, 81), 0.1_f32);
            comet[(80, 80)] = brightness;
            comet.row_mut(80).fill(brightness / 10.0);
            let sum = f64::from(comet.sum());
            let drawn = comet.indexed_iter().fold(DVec2::ZERO, |drawn, ((row, column), &sample)| {
                drawn + f64::from(sample) * DVec2::new(column as f64, row as f64)
            });
            let drawn_px = drawn / sum - 40.0;
            let variance_px2 = comet.indexed_iter().fold(DVec2::ZERO, |variance, ((row, column), &sample)| {
                let from_px = DVec2::new(column as f64, row as f64) - 40.0 - drawn_px;
                variance + f64::from(sample) / sum * from_px * from_px
            });
            for (across_px, down_px) in [(-0.1, -0.2), (-0.02, 0.003), (0.1, -0.2), (0.3, 0.3)] {
                let place_px = drawn_px + DVec2::new(across_px, down_px);
                let kernel = knot_kernel(comet.clone(), place_px);
                let [down, across] = kernel.first_moments();
                let off_px = DVec2::new(across, down) - place_px;
                assert!(off_px.abs().max_element() < 1e-5, "{brightness} at {place_px}: {off_px}");
                assert!(kernel.samples.iter().all(|sample| *sample >= 0.0), "{brightness} at {place_px}");
                let [down, _, across] = kernel.second_moments();
                let grown_px2 = DVec2::new(across, down) - place_px * place_px - variance_px2;
                // Light moved by a part of a pixel is in two: at most a half each.
                assert!(grown_px2.abs().max_element() < 0.25, "{brightness} at {place_px}: {grown_px2}");
            }
        }
    }

    /// Sums of products with numbers below the least of normal ones take many times as long.
    #[test]
    fn samples_are_nothing_or_normal() {
        let mut samples = Array2::from_elem((3, 5), 1e-20_f32);
        samples[(1, 2)] = 1.0;
        samples.column_mut(1).fill(1e-6);
        for across_px in [0.0, 0.2] {
            let kernel = knot_kernel(samples.clone(), DVec2::new(across_px, 0.0));
            assert!(kernel.samples.iter().all(|&sample| sample == 0.0 || sample > 1e-16), "{kernel:?}");
        }
    }

    /// A comet pointing away from the axis at (tan 2, 1): right and up.
    fn comet(x: f64, y: f64) -> KnotKernel {
        let mut kernel = Array2::zeros((5, 5));
        kernel[((2.0 - y) as usize, (2.0 + x) as usize)] = 1.0;
        knot_kernel(kernel, DVec2::new(x, -y))
    }

    #[test]
    fn kernels_are_mirrored_with_their_knots() {
        let one = BTreeMap::from([(Knot { right: 64, down: -32 }, comet(2.0, 1.0))]);
        let kernels = LayerKernels::new(Symmetry::Octants, one);
        for (right, down, x, y) in [
            (64, -32, 2.0, 1.0),
            (-64, -32, -2.0, 1.0),
            (64, 32, 2.0, -1.0),
            (32, -64, 1.0, 2.0),
            (-32, 64, -1.0, -2.0),
            (32, 64, 1.0, -2.0),
            (-32, -64, -1.0, 2.0),
        ] {
            let knot = Knot { right, down };
            assert_eq!(kernels.at(knot), comet(x, y), "at {right}, {down}");
            assert_eq!(kernels.window_at(knot), comet(x, y).at, "at {right}, {down}");
            assert_eq!(kernels.moments_at(knot).first, [-y, x], "at {right}, {down}");
        }
        let both = [(64, comet(2.0, 1.0)), (-64, comet(1.0, 0.0))].map(|(right, k)| (Knot { right, down: 9 }, k));
        let kernels = LayerKernels::new(Symmetry::None, BTreeMap::from(both.clone()));
        for (knot, comet) in both {
            assert_eq!(kernels.at(knot), comet);
        }
    }

    #[test]
    fn mixed_kernels_keep_their_sum() {
        let (small, large) = (even(3, 3), even(7, 5));
        let mixed = small.mixed(&large, 0.25);
        assert_eq!(mixed.at, Rectangle { first_row: -3, first_column: -2, rows: 7, columns: 5 });
        assert!((mixed.samples.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((mixed.samples[3 * 5 + 2] - (0.75 / 9.0 + 0.25 / 35.0)).abs() < 1e-6);
    }

    #[test]
    fn edge_spread_of_a_shift_is_its_share() {
        // A tenth of the light moved by one column changes an edge by a tenth.
        let difference = [0.0, 0.0, 0.0, 0.0, -0.1, 0.1, 0.0, 0.0, 0.0];
        assert!((edge_spread_peak(&difference, 3) - 0.1).abs() < 1e-7);
    }

    /// Light that moves between four pixels of a square, whose rows and columns stay what they are: no edge shows it, a corner does.
    #[test]
    fn corners_show_what_edges_do_not() {
        let mut difference = vec![0.0; 9];
        (difference[0], difference[1], difference[3], difference[4]) = (0.25, -0.25, -0.25, 0.25);
        assert_eq!(edge_spread_peak(&difference, 3), 0.0);
        assert_eq!(corner_spread_peak(&difference, 3), 0.25);
        assert!(corner_spread_exceeds(&difference, 3, 0.24) && !corner_spread_exceeds(&difference, 3, 0.26));
        // What is beside an edge is a corner far down.
        let edge = [0.0, 0.125, 0.0, 0.0, 0.25, 0.0, 0.0, -0.125, 0.0];
        assert_eq!((edge_spread_peak(&edge, 3), corner_spread_peak(&edge, 3)), (0.375, 0.375));
    }
}
