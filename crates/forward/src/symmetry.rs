//! Points of the film whose kernels follow from each other.

use dioptric_psf::LensImage;

use crate::{convolve::BATCH, rectangle::Rectangle};

/// A point of the film at which a lens's kernel is computed: pixels to the right of the film's middle and below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Node {
    pub(crate) right: i32,
    pub(crate) down: i32,
}

/// Which nodes have kernels that follow from each other.
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

    /// Returns the node whose kernel a node's follows from: that of the same distance from the axis in the first octant,
    /// right and up, or itself.
    pub(crate) fn canonical(self, node: Node) -> Node {
        match self {
            Self::Octants => {
                let (a, b) = (node.right.abs(), node.down.abs());
                Node { right: a.max(b), down: -a.min(b) }
            }
            Self::None => node,
        }
    }

    /// Returns what takes the surroundings of a node to those of its canonical one.
    pub(crate) fn mirror(self, node: Node) -> Mirror {
        match self {
            Self::Octants => Mirror {
                flips_rows: node.down > 0,
                flips_columns: node.right < 0,
                swaps: node.down.abs() > node.right.abs(),
            },
            Self::None => Mirror::default(),
        }
    }
}

/// What takes the surroundings of a node to those of its canonical node: rows and columns turned about, then both exchanged.
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
    pub(crate) fn window_at_node(self, canonical: &Rectangle) -> Rectangle {
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
}

impl Mirror {
    /// Returns the distances of rows below a point and of columns to the right of it once they are mirrored.
    pub(crate) fn positions(self, mut down: Vec<f64>, mut across: Vec<f64>) -> (Vec<f64>, Vec<f64>) {
        let turn = |positions: &mut Vec<f64>| {
            positions.reverse();
            positions.iter_mut().for_each(|position| *position = -*position);
        };
        if self.flips_rows {
            turn(&mut down);
        }
        if self.flips_columns {
            turn(&mut across);
        }
        if self.swaps {
            std::mem::swap(&mut down, &mut across);
            turn(&mut down);
            turn(&mut across);
        }
        (down, across)
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
