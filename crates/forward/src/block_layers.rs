//! The layers that blocks of pixels may have a part of: most pixels lie in few layers, and a layer is sampled in those alone.

use std::ops::Range;

use ndarray::Array2;

use crate::rectangle::Rectangle;

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

    /// Whether a layer may have anything in a rectangle of pixels.
    pub(crate) fn may_have_any(&self, at: &Rectangle, layer: usize) -> bool {
        let (rows, columns) = self.ranges.dim();
        let block = |pixel: i64, first: i64| (pixel - first).div_euclid(BLOCK as i64);
        let (last_row, last_column) = (at.first_row + at.rows as i64 - 1, at.first_column + at.columns as i64 - 1);
        let is_in = |row: i64, column: i64| {
            let known = usize::try_from(row).ok().zip(usize::try_from(column).ok());
            let range = known.filter(|&(row, column)| row < rows && column < columns).map(|at| self.ranges[at]);
            range.is_none_or(|(first, last)| (usize::from(first)..=usize::from(last)).contains(&layer))
        };
        let mut of_rows = block(at.first_row, self.first.0)..=block(last_row, self.first.0);
        let of_columns = block(at.first_column, self.first.1)..=block(last_column, self.first.1);
        of_rows.any(|row| of_columns.clone().any(|column| is_in(row, column)))
    }

    /// Returns blocks that pass nothing over.
    #[cfg(test)]
    pub(crate) fn of_everything() -> Self {
        Self { first: (1 << 40, 0), ranges: Array2::default((0, 0)) }
    }

    /// Returns about how many pixels of a raster of this size a layer reaches whose points are spread by a radius, pixels.
    pub(crate) fn n_reached(&self, layer: usize, radius_px: f64, (rows, columns): (usize, usize)) -> usize {
        let reach = (radius_px / BLOCK as f64).ceil() as usize;
        let is_in = |&(first, last): &(u16, u16)| (usize::from(first)..=usize::from(last)).contains(&layer);
        let along_rows = dilated(&self.ranges.map(is_in), reach);
        let reached = dilated(&along_rows.reversed_axes(), reach).reversed_axes();
        let on_raster = |first: i64, block: usize, n: usize| {
            let at = first + (BLOCK * block) as i64;
            (at + BLOCK as i64).min(n as i64) - at.max(0)
        };
        let pixels = |((row, column), reached): ((usize, usize), &bool)| {
            let (down, across) = (on_raster(self.first.0, row, rows), on_raster(self.first.1, column, columns));
            if *reached { (down.max(0) * across.max(0)) as usize } else { 0 }
        };
        reached.indexed_iter().map(pixels).sum()
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.ranges.len() * size_of::<(u16, u16)>()
    }
}

/// Returns a plane in which each mark is so many places longer along its row, both ways.
fn dilated(marks: &Array2<bool>, reach: usize) -> Array2<bool> {
    let mut longer = Array2::default(marks.dim());
    for (marks, mut longer) in marks.rows().into_iter().zip(longer.rows_mut()) {
        let n = marks.len();
        let mut end = 0;
        for at in (0..n).filter(|&at| marks[at]) {
            let next_end = (at + reach + 1).min(n);
            (at.saturating_sub(reach).max(end)..next_end).for_each(|at| longer[at] = true);
            end = next_end;
        }
    }
    longer
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Layer 2 is in one block of a raster of 12 × 16 pixels, whose blocks begin 4 pixels above and to the left of it.
    #[test]
    fn layers_reach_as_far_as_they_are_spread() {
        let mut ranges = Array2::from_elem((5, 6), (1, 0));
        ranges[(2, 2)] = (1, 3);
        let blocks = BlockLayers { first: (-4, -4), ranges };
        let reached = |layer, radius_px| blocks.n_reached(layer, radius_px, (12, 16));
        assert_eq!((reached(2, 0.0), reached(4, 0.0)), (16, 0));
        let has = |first_row, first_column, layer| {
            blocks.may_have_any(&Rectangle { first_row, first_column, rows: 2, columns: 3 }, layer)
        };
        // Beside the block and at its first pixels, and beyond all blocks, where nothing is known.
        assert_eq!(
            [(2, 4), (3, 4), (4, 1), (4, 2), (7, 7), (8, 8)].map(|(row, column)| has(row, column, 2)),
            [false, true, false, true, true, false]
        );
        assert!(!has(5, 5, 4) && has(-5, 5, 4));
        // A block more all around, of which all are on the raster; then rows 0 to 12 and columns 0 to 16 of 20.
        assert_eq!((reached(2, 1.0), reached(2, 8.0)), (144, 192));
    }
}
