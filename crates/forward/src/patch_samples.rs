//! The samples of a layer in a patch, before and after they are spread.

use crate::{
    patch::{Patch, polynomials},
    rectangle::Rectangle,
    sampler::Sampler,
};

/// A patch and the ideal picture in it.
pub(crate) struct PatchSamples<'a> {
    pub(crate) patch: &'a Patch,
    pub(crate) source: Rectangle,
    pub(crate) places: Places,
    /// Row by row.
    pub(crate) ideal: Vec<f32>,
}

/// The polynomials of a cell at the rows and columns of a rectangle in it.
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Places {
    pub(crate) down: Vec<[f32; 3]>,
    pub(crate) across: Vec<[f32; 3]>,
}

impl Places {
    pub(crate) fn new(patch: &Patch, source: &Rectangle, sampler: &Sampler) -> Self {
        let at = |row: usize, column: usize| {
            let (row, column) = (source.first_row + row as i64, source.first_column + column as i64);
            patch.cell.place_of(&sampler.frame, row, column)
        };
        Self {
            down: (0..source.rows).map(|row| polynomials(at(row, 0).0 as f32)).collect(),
            across: (0..source.columns).map(|column| polynomials(at(0, column).1 as f32)).collect(),
        }
    }
}

/// The blurred light or alpha of a part of the film, which may reach beyond it.
pub(crate) struct BlurredCell {
    pub(crate) at: Rectangle,
    pub(crate) values: Vec<f32>,
}
