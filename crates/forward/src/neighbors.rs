//! Which patches of a raster touch each other.

use std::collections::BTreeMap;

use crate::patch::{Around, Cell, Patch};

/// The numbers of the patches that each patch touches, at its sides and its corners.
pub(crate) struct Neighbors {
    of_patch: Vec<Vec<u32>>,
}

impl Neighbors {
    /// Finds those of patches whose cells halve each other and do not overlap.
    pub(crate) fn of(patches: &[Patch]) -> Self {
        let by_cell: BTreeMap<Cell, u32> =
            patches.iter().zip(0..).map(|(patch, number)| (patch.cell, number)).collect();
        let largest = patches.iter().map(|patch| patch.cell.size).max().unwrap_or(0);
        let mut of_patch = vec![vec![]; patches.len()];
        for (patch, number) in patches.iter().zip(0..) {
            for (down, across) in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)] {
                // Of its own size or larger: smaller ones find it themselves.
                let place = patch.cell.beside(down, across);
                let mut around =
                    std::iter::successors(Some(place), |cell| (cell.size < largest).then(|| cell.parent()));
                if let Some(&other) = around.find_map(|cell| by_cell.get(&cell))
                    && other != number
                {
                    of_patch[number as usize].push(other);
                    of_patch[other as usize].push(number);
                }
            }
        }
        for others in &mut of_patch {
            others.sort_unstable();
            others.dedup();
        }
        Self { of_patch }
    }

    /// The numbers of those that touch a patch.
    pub(crate) fn of_patch(&self, number: usize) -> &[u32] {
        &self.of_patch[number]
    }

    /// Returns what lies around a patch, within `half_px` pixels of the film.
    pub(crate) fn around(&self, patches: &[Patch], number: usize, half_px: usize) -> Around {
        let around: Vec<u32> = self.of_patch(number).iter().copied().chain([number as u32]).collect();
        let sides = |cell: &Cell| {
            let size = cell.size as i64;
            [cell.down, cell.across].map(|place| (i64::from(place) * size, (i64::from(place) + 1) * size))
        };
        let half = half_px as i64;
        let grown = sides(&patches[number].cell).map(|(first, end)| (first - half, end + half));
        let common = |other: u32| -> i64 {
            let ranges = sides(&patches[other as usize].cell).into_iter().zip(grown);
            ranges.map(|(a, b)| (a.1.min(b.1) - a.0.max(b.0)).max(0)).product()
        };
        let covered: i64 = around.iter().copied().map(common).sum();
        let area: i64 = grown.iter().map(|(first, end)| end - first).product();
        let is_whole = covered == area && around.iter().all(|&other| patches[other as usize].elsewhere.is_empty());
        Around { patches: around, is_whole }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patches(cells: &[(i32, i32, usize)]) -> Vec<Patch> {
        let patch = |&(down, across, size): &(i32, i32, usize)| Patch {
            cell: Cell { down, across, size },
            is_by_knots: true,
            around: None,
            shares: vec![],
            elsewhere: vec![],
        };
        cells.iter().map(patch).collect()
    }

    #[test]
    fn patches_of_any_size_find_each_other() {
        // A cell of 32 pixels, one of 16 at its right upper side and one at its right lower corner, and one far off.
        let patches = patches(&[(0, 0, 32), (0, 2, 16), (2, 2, 16), (9, 9, 16)]);
        let neighbors = Neighbors::of(&patches);
        assert_eq!(neighbors.of_patch(0), [1, 2]);
        assert_eq!(neighbors.of_patch(1), [0]);
        assert_eq!(neighbors.of_patch(2), [0]);
        assert!(neighbors.of_patch(3).is_empty());
    }

    #[test]
    fn a_patch_is_surrounded_or_not() {
        let all: Vec<(i32, i32, usize)> =
            (-1..2).flat_map(|down| (-1..2).map(move |across| (down, across, 16))).collect();
        let whole = patches(&all);
        assert!(Neighbors::of(&whole).around(&whole, 4, 4).is_whole);
        assert!(!Neighbors::of(&whole).around(&whole, 0, 4).is_whole);
        let mut partly = patches(&all);
        partly[0].elsewhere.push((2, vec![]));
        assert!(!Neighbors::of(&partly).around(&partly, 4, 4).is_whole);
    }
}
