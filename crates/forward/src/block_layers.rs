//! The layers that blocks of pixels may have a part of: most pixels lie in few layers, and a layer is sampled in those alone.

use std::ops::Range;

use ndarray::Array2;

/// Pixels along a side of a block.
pub(crate) const BLOCK: usize = 4;

/// First and last layer that any sample of each block of a raster's pixels may have weight in; the first is above the last where
/// there is none.
pub(crate) struct BlockLayers {
    /// Row and column of the first pixel.
    pub(crate) first: (i64, i64),
    /// In standard layout.
    pub(crate) ranges: Array2<(u16, u16)>,
}

impl BlockLayers {
    /// Returns the blocks that a row of pixels passes, or `None` beyond the cells.
    pub(crate) fn of_row(&self, row: i64) -> Option<RowBlocks<'_>> {
        let block = usize::try_from(row - self.first.0).ok()? / BLOCK;
        let ranges = (block < self.ranges.nrows()).then(|| self.ranges.row(block))?;
        Some(RowBlocks { first_column: self.first.1, ranges: ranges.to_slice()? })
    }

    /// Returns blocks that pass nothing over.
    #[cfg(test)]
    pub(crate) fn of_everything() -> Self {
        Self { first: (1 << 40, 0), ranges: Array2::default((0, 0)) }
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.ranges.len() * size_of::<(u16, u16)>()
    }
}

/// The layers of the blocks along a row of pixels.
#[derive(Clone, Copy)]
pub(crate) struct RowBlocks<'a> {
    first_column: i64,
    ranges: &'a [(u16, u16)],
}

impl RowBlocks<'_> {
    /// Whether a pixel may have a part of a layer.
    #[inline]
    pub(crate) fn may_have(&self, column: i64, layer: usize) -> bool {
        let block = usize::try_from(column - self.first_column).ok().and_then(|at| self.ranges.get(at / BLOCK));
        block.is_none_or(|&(first, last)| (usize::from(first)..=usize::from(last)).contains(&layer))
    }

    /// Returns the first run of pixels that may have a part of a layer, of a range of them counted from a column; an empty one at
    /// the end of the range if there is none.
    pub(crate) fn next_run(&self, first_column: i64, range: Range<usize>, layer: usize) -> Range<usize> {
        let next_where = |start: usize, wanted: bool| {
            let mut at = start;
            while at < range.end && self.may_have(first_column + at as i64, layer) != wanted {
                // All pixels of a block are alike.
                let within = (first_column + at as i64 - self.first_column).rem_euclid(BLOCK as i64) as usize;
                at += BLOCK - within;
            }
            at.min(range.end)
        };
        let start = next_where(range.start, true);
        start..next_where(start, false)
    }
}
