//! The kernels of a lens at points of the film.

use std::collections::{BTreeMap, BTreeSet};

use dioptric_psf::Kernel;

use crate::{
    convolve::{LANES, add_scaled},
    raster::Level,
    rectangle::Rectangle,
    symmetry::{Mirror, Node, Symmetry},
};

/// The most that a sample gives to each of its neighbors, and the most that all give to those behind them, share of it: together no more than all.
const MOST_MOVES: f32 = 1.0 / 3.0;

/// What a film point gathers, on samples of some width: of sum 1, about that point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NodeKernel {
    /// Where its samples lie: rows below the point and columns to the right of it. A comet lies to one side.
    pub(crate) at: Rectangle,
    pub(crate) samples: Vec<f32>,
}

impl NodeKernel {
    /// Takes a kernel of odd sides, leaves out borders without light, takes what pixels add to its width and scales it to a sum of 1.
    pub(crate) fn new(kernel: &Kernel) -> Self {
        let Kernel { samples, middle_px, .. } = kernel;
        let (rows, columns) = samples.dim();
        let first = |middle: i32, n: usize| i64::from(middle) - (n / 2) as i64;
        let (first_row, first_column) = (first(middle_px.y, rows), first(middle_px.x, columns));
        let samples = samples.as_standard_layout();
        let samples = samples.as_slice().expect("it is in standard order");
        let (by_row, by_column) = sums_of_lines(samples, columns);
        let sum: f64 = by_row.iter().sum();
        if sum <= 0.0 {
            // Nothing is gathered here.
            return Self { at: Rectangle::PIXEL, samples: vec![1.0] };
        }
        let ((above, lit_rows), (left, lit_columns)) = (lit_part(&by_row, sum), lit_part(&by_column, sum));
        let (first_row, first_column) = (first_row + above as i64, first_column + left as i64);
        let at = Rectangle { first_row, first_column, rows: lit_rows, columns: lit_columns };
        let lines = samples.chunks_exact(columns).skip(above).take(lit_rows);
        let mut samples = Vec::with_capacity(at.len());
        // What rounding leaves below 0 is nothing.
        lines.for_each(|line| samples.extend(line[left..][..lit_columns].iter().map(|sample| sample.max(0.0))));
        let mut made = Self { at, samples }.normalized();
        for (axis, excess) in kernel.excess_px2.into_iter().enumerate() {
            if excess != 0.0 {
                made = made.narrowed(axis, excess);
            }
        }
        made.normalized()
    }

    fn normalized(mut self) -> Self {
        let scale = (1.0 / self.samples.iter().map(|&sample| f64::from(sample)).sum::<f64>()) as f32;
        self.samples.iter_mut().for_each(|sample| *sample *= scale);
        // What rounding leaves goes to the brightest sample, so that uniform scenes stay uniform.
        let left = 1.0 - self.samples.iter().map(|&sample| f64::from(sample)).sum::<f64>();
        if let Some(brightest) = self.samples.iter_mut().max_by(|a, b| a.total_cmp(b)) {
            *brightest += left as f32;
        }
        self
    }

    /// Returns the kernel with a variance that is less by so much, samples², down or across: light moves between neighbors, towards the brighter, or, for less than
    /// nothing, to the darker and one sample beyond the last. No sample falls below 0.
    ///
    /// What moves is c times the difference of neighbors in K − 9/80 δ²K, with δ² the second difference: for c = 1/24 that undoes means over samples, of variance
    /// v = 1/12, up to fourth order, 1 − v/2 δ² + 9v/160 δ⁴ (the cell averages of finite volumes).
    fn narrowed(self, axis: usize, excess: f64) -> Self {
        let kernel = if excess < 0.0 { self.with_margin(axis) } else { self };
        let share = 0.5 * excess;
        let less = kernel.variances()[axis] - kernel.moved_inward(axis, share).variances()[axis];
        // Where samples have nothing left to give, the others give more.
        if less * excess > 0.0 { kernel.moved_inward(axis, share * excess / less) } else { kernel }
    }

    /// Returns the kernel after light moved to the brighter of neighbors along an axis, this share of their difference and no more than a third of what the other has; then
    /// a part of all light moves back by one sample, so that its mean stays.
    fn moved_inward(&self, axis: usize, share: f64) -> Self {
        let columns = self.at.columns;
        let step = if axis == 0 { columns } else { 1 };
        let pairs = || (0..self.samples.len() - step).filter(|i| axis == 0 || (i + 1) % columns != 0);
        let mut curved = self.samples.clone();
        for i in pairs() {
            let by = 9.0 / 80.0 * (self.samples[i + step] - self.samples[i]);
            curved[i] -= by;
            curved[i + step] += by;
        }
        let mut samples = self.samples.clone();
        let mut ahead = 0.0;
        for i in pairs() {
            let wanted = share as f32 * (curved[i + step] - curved[i]);
            let moves = wanted.clamp(-MOST_MOVES * self.samples[i + step], MOST_MOVES * self.samples[i]);
            samples[i] -= moves;
            samples[i + step] += moves;
            ahead += f64::from(moves);
        }
        let back = (ahead as f32).clamp(-MOST_MOVES, MOST_MOVES);
        for i in pairs() {
            let moves = if back > 0.0 { back * self.samples[i + step] } else { back * self.samples[i] };
            samples[i] += moves;
            samples[i + step] -= moves;
        }
        Self { at: self.at, samples }
    }

    /// Returns the kernel with a dark sample before and behind its others along an axis.
    fn with_margin(&self, axis: usize) -> Self {
        let mut at = self.at;
        if axis == 0 {
            (at.first_row, at.rows) = (at.first_row - 1, at.rows + 2);
        } else {
            (at.first_column, at.columns) = (at.first_column - 1, at.columns + 2);
        }
        let mut samples = vec![0.0; at.len()];
        self.add_to(&mut samples, &at, 1.0);
        Self { at, samples }
    }

    /// Adds the kernel times a factor to a block about the point that holds all of it.
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
    pub(crate) fn sum_of(terms: &[(&Self, f32)]) -> Self {
        let at = Rectangle::around(terms.iter().map(|(kernel, _)| kernel.at)).unwrap_or(Rectangle::PIXEL);
        let mut samples = vec![0.0; at.len()];
        terms.iter().for_each(|(kernel, factor)| kernel.add_to(&mut samples, &at, *factor));
        Self { at, samples }
    }

    /// Returns the kernel of a canonical node at another.
    fn mirrored(&self, mirror: Mirror) -> Self {
        let at = mirror.window_at_node(&self.at);
        Self { at, samples: mirror.restored(&self.samples, (at.rows, at.columns)) }
    }

    /// Returns what it leaves of fine gratings, along rows or columns: the rms contrast over all that samples hold, the finest counting the most, from 1 for a point to 0.
    pub(crate) fn left_of_detail(&self) -> f64 {
        let (by_row, by_column) = sums_of_lines(&self.samples, self.at.columns);
        // Half the sum of squared differences is the mean over frequencies of squared contrasts times sin² (Parseval).
        let left = |sums: Vec<f64>| {
            let next = sums.iter().skip(1).chain([&0.0]);
            let steps = sums.iter().zip(next).map(|(sum, next)| (sum - next).powi(2));
            (0.5 * (steps.sum::<f64>() + sums[0].powi(2))).sqrt()
        };
        left(by_row).max(left(by_column))
    }

    /// Returns the variances of the light, down and across, in samples².
    pub(crate) fn variances(&self) -> [f64; 2] {
        let (by_row, by_column) = sums_of_lines(&self.samples, self.at.columns);
        [by_row, by_column].map(|sums| {
            let mean = sums.iter().enumerate().map(|(i, sum)| i as f64 * sum).sum::<f64>();
            sums.iter().enumerate().map(|(i, sum)| (i as f64 - mean).powi(2) * sum).sum()
        })
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
            left_out <= Kernel::NEGLIGIBLE * sum
        };
        sums.take_while(is_dark).count()
    };
    let before = dark(&mut sums.iter());
    (before, sums.len() - before - dark(&mut sums[before + 1..].iter().rev()))
}

/// A node and the width of the samples that its kernel is on.
pub(crate) type NodeAt = (Node, Level);

/// The kernels of one layer at one wavelength, at canonical nodes.
#[derive(Clone, Debug)]
pub(crate) struct LayerKernels {
    pub(crate) symmetry: Symmetry,
    by_node: BTreeMap<NodeAt, NodeKernel>,
}

impl LayerKernels {
    pub(crate) fn new(symmetry: Symmetry, by_node: BTreeMap<NodeAt, NodeKernel>) -> Self {
        Self { symmetry, by_node }
    }

    /// The number of kernels.
    pub(crate) fn n_kernels(&self) -> usize {
        self.by_node.len()
    }

    /// The bytes of memory of the kernels' samples.
    pub(crate) fn size_bytes(&self) -> usize {
        self.by_node.values().map(|kernel| size_of_val(kernel.samples.as_slice())).sum()
    }

    /// Returns the kernels between two wavelengths.
    pub(crate) fn mixed(&self, other: &Self, fraction: f32) -> Self {
        let mix = |(node, kernel): (&NodeAt, &NodeKernel)| {
            let terms = [(kernel, 1.0 - fraction), (&other.by_node[node], fraction)];
            (*node, NodeKernel::sum_of(&terms))
        };
        Self { symmetry: self.symmetry, by_node: self.by_node.iter().map(mix).collect() }
    }

    /// Drops the kernels of other nodes than these.
    pub(crate) fn retain(&mut self, nodes: &BTreeSet<NodeAt>) {
        self.by_node.retain(|node, _| nodes.contains(node));
    }

    /// Returns the kernels by their canonical nodes.
    pub(crate) fn into_kernels(self) -> BTreeMap<NodeAt, NodeKernel> {
        self.by_node
    }

    /// Adds kernels of canonical nodes.
    pub(crate) fn extend(&mut self, by_node: BTreeMap<NodeAt, NodeKernel>) {
        self.by_node.extend(by_node);
    }

    /// Whether the kernel at a canonical node is known.
    pub(crate) fn has(&self, node: &NodeAt) -> bool {
        self.by_node.contains_key(node)
    }

    /// Returns where the samples of the kernel at a node lie.
    pub(crate) fn window_at(&self, (node, level): NodeAt) -> Rectangle {
        let canonical = &self.by_node[&(self.symmetry.canonical(node), level)];
        self.symmetry.mirror(node).window_at_node(&canonical.at)
    }

    /// Returns the kernel at a node anywhere on the film: that of its canonical node, mirrored.
    pub(crate) fn at(&self, (node, level): NodeAt) -> NodeKernel {
        self.by_node[&(self.symmetry.canonical(node), level)].mirrored(self.symmetry.mirror(node))
    }
}

/// Returns the largest magnitude of the edge spread functions, along rows and columns, of a kernel.
pub(crate) fn edge_spread_peak(kernel: &[f32], width: usize) -> f64 {
    let (by_row, by_column) = sums_of_lines(kernel, width);
    let peak = |sums: Vec<f64>| {
        let mut edge = 0.0_f64;
        sums.iter().fold(0.0_f64, |peak, sum| {
            edge += sum;
            peak.max(edge.abs())
        })
    };
    peak(by_row).max(peak(by_column))
}
