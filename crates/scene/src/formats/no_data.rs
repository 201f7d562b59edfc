//! Samples that are no light.

use std::path::Path;

use dioptric_spectrum::WavelengthGrid;
use ndarray::Array2;

use super::{reading::NoData, stated::name_of, unusable::unreadable};
use crate::SceneError;

/// Counts of what was mended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Mended {
    pub(super) n_missing: usize,
    pub(super) n_negative: usize,
    pub(super) n_samples: usize,
}

impl Mended {
    /// Adds what was mended of another part.
    pub(super) fn add(&mut self, other: Self) {
        self.n_missing += other.n_missing;
        self.n_negative += other.n_negative;
        self.n_samples += other.n_samples;
    }

    /// Checks that some sample has a number.
    pub(super) fn checked(self, file: &Path) -> Result<Self, SceneError> {
        if self.n_missing == self.n_samples {
            return Err(unreadable(file, "none of its samples has a number"));
        }
        Ok(self)
    }

    /// Returns what was done, in a sentence; `None` where nothing was.
    pub(super) fn note(self, file: &Path, choice: NoData) -> Option<String> {
        let mut parts = vec![];
        if self.n_missing > 0 {
            let become_ = match choice {
                NoData::Fill => "get the nearest of their row",
                NoData::Black | NoData::Refuse => "are black",
            };
            parts.push(format!("{} without data {become_}", self.n_missing));
        }
        if self.n_negative > 0 {
            parts.push(format!("{} below 0 are 0", self.n_negative));
        }
        let what = format!("{}: of {} samples of all bands ", name_of(file), self.n_samples);
        (!parts.is_empty()).then(|| what + &parts.join(", ") + " (--no-data black, fill or refuse)")
    }
}

/// Puts light in the place of what is none: samples that are no finite numbers, and negative ones, which become 0.
///
/// # Errors
/// When such samples are to be refused, or none has a number.
pub(super) fn mend(
    file: &Path,
    grid: &WavelengthGrid,
    planes: &mut [Array2<f32>],
    choice: NoData,
) -> Result<Mended, SceneError> {
    mend_rows(file, grid, planes, choice, 0)?.checked(file)
}

/// As [`mend`] for some of the rows, the first of which is so far down.
pub(super) fn mend_rows(
    file: &Path,
    grid: &WavelengthGrid,
    planes: &mut [Array2<f32>],
    choice: NoData,
    first_row: usize,
) -> Result<Mended, SceneError> {
    let mut mended = Mended::default();
    for (plane, &wavelength_nm) in planes.iter_mut().zip(grid.centers_nm()) {
        mended.n_samples += plane.len();
        let is_light = |value: f32| value.is_finite() && value >= 0.0;
        if plane.iter().fold(true, |are_light, &value| are_light & is_light(value)) {
            continue;
        }
        if choice == NoData::Refuse
            && let Some(((row, column), &value)) = plane.indexed_iter().find(|(_, value)| !is_light(**value))
        {
            let row = first_row + row;
            let value = match value.is_nan() {
                true => "no number (NaN, or what the file says to ignore)".to_owned(),
                false => value.to_string(),
            };
            let reason = format!(
                "its {wavelength_nm} nm band holds {value} at row {row}, column {column}, which --no-data refuse does not take: expected a \
                 finite number, 0 or more"
            );
            return Err(unreadable(file, reason));
        }
        let negative = plane.iter_mut().filter(|value| value.is_finite() && **value < 0.0);
        mended.n_negative += negative.map(|value| *value = 0.0).count();
        let n_missing = plane.iter().filter(|value| !value.is_finite()).count();
        mended.n_missing += n_missing;
        if choice == NoData::Fill && n_missing < plane.len() {
            fill(plane);
        }
        plane.mapv_inplace(|value| if value.is_finite() { value } else { 0.0 });
    }
    Ok(mended)
}

/// Gives samples without a number the nearest of their row, and rows without any the nearest row.
fn fill(plane: &mut Array2<f32>) {
    let mut whole = vec![];
    for (index, mut row) in plane.rows_mut().into_iter().enumerate() {
        let own: Vec<(usize, f32)> = row.iter().copied().enumerate().filter(|(_, value)| value.is_finite()).collect();
        if own.is_empty() {
            continue;
        }
        whole.push(index);
        for (column, value) in row.iter_mut().enumerate().filter(|(_, value)| !value.is_finite()) {
            let after = own.partition_point(|(at, _)| *at < column);
            let near = [after.checked_sub(1), (after < own.len()).then_some(after)];
            let nearest = near.into_iter().flatten().min_by_key(|&i| own[i].0.abs_diff(column));
            *value = nearest.map_or(0.0, |i| own[i].1);
        }
    }
    for row in 0..plane.nrows() {
        let Some(&nearest) = whole.iter().min_by_key(|at| at.abs_diff(row)) else { return };
        if nearest != row {
            let copy = plane.row(nearest).to_owned();
            plane.row_mut(row).assign(&copy);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::arr2;

    const NAN: f32 = f32::NAN;

    fn mended(choice: NoData) -> Result<(Array2<f32>, Mended), SceneError> {
        let mut planes = [arr2(&[[1.0, NAN, NAN, 4.0], [NAN; 4], [-1e-6, 2.0, f32::INFINITY, 3.0]])];
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        let counts = mend(Path::new("a.hdr"), &grid, &mut planes, choice)?;
        let [plane] = planes;
        Ok((plane, counts))
    }

    #[test]
    fn missing_samples_get_what_was_chosen() {
        let counts = Mended { n_missing: 7, n_negative: 1, n_samples: 12 };
        let black = arr2(&[[1.0, 0.0, 0.0, 4.0], [0.0; 4], [0.0, 2.0, 0.0, 3.0]]);
        assert_eq!(mended(NoData::Black).unwrap(), (black, counts));
        let filled = arr2(&[[1.0, 1.0, 4.0, 4.0], [1.0, 1.0, 4.0, 4.0], [0.0, 2.0, 2.0, 3.0]]);
        assert_eq!(mended(NoData::Fill).unwrap(), (filled, counts));
        let message = mended(NoData::Refuse).unwrap_err().to_string();
        assert!(message.contains("a.hdr") && message.contains("row 0, column 1"), "{message}");
        let note = counts.note(Path::new("a.hdr"), NoData::Black).unwrap();
        assert!(
            note.starts_with("a.hdr: of 12 samples of all bands 7 without data are black, 1 below 0 are 0"),
            "{note}"
        );
        assert_eq!(Mended::default().note(Path::new("a.hdr"), NoData::Fill), None);
    }

    #[test]
    fn scene_of_no_numbers_is_refused() {
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        let mut planes = [arr2(&[[NAN, NAN]])];
        assert!(mend(Path::new("a"), &grid, &mut planes, NoData::Fill).is_err());
    }
}
