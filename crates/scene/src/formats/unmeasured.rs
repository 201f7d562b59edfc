//! Depth where none was measured.

use std::str::FromStr;

use dioptric_spectrum::DepthMap;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::SceneError;

/// The depth of places where nothing was measured: code 0 of a depth picture, what is no number above 0 of a file of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum FillDepth {
    /// The farther of the depths beside them in their row, as what a depth camera does not see mostly lies behind an edge.
    Beside,
    /// The farthest depth of the scene.
    Far,
    /// So far, m; `inf` for the sky.
    Metres(f64),
}

impl FillDepth {
    /// Checks that it is a depth.
    ///
    /// # Errors
    /// When a number of metres is not above 0.
    pub fn check(self) -> Result<(), SceneError> {
        match self {
            Self::Metres(z_m) if z_m.is_nan() || z_m <= 0.0 => Err(SceneError::Setting {
                what: "the depth where none was measured",
                value: format!("{z_m} m"),
                expected: "a number above 0".to_owned(),
            }),
            _ => Ok(()),
        }
    }
}

impl FromStr for FillDepth {
    type Err = SceneError;

    /// Reads `beside`, `far` or a number of metres.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        let fill = match text.trim() {
            "beside" => Self::Beside,
            "far" => Self::Far,
            number => Self::Metres(number.parse().map_err(|_| SceneError::Setting {
                what: "the depth where none was measured",
                value: format!("'{text}'"),
                expected: "beside, far, or a number of metres".to_owned(),
            })?),
        };
        fill.check()?;
        Ok(fill)
    }
}

/// Returns a map of depths, with those that are no number above 0 filled where that is asked for, and what was done in a sentence.
///
/// # Errors
/// When a depth is not above 0 and no filling is asked for, or none was measured at all.
pub fn filled_depth(
    name: &str,
    z_m: Array2<f32>,
    fill: Option<FillDepth>,
) -> Result<(DepthMap, Option<String>), SceneError> {
    let n_samples = z_m.len();
    let Some(fill) = fill else { return Ok((DepthMap::new(z_m)?, None)) };
    let Some((z_m, n_unmeasured)) = filled(z_m, fill) else {
        return Err(SceneError::MissingDepth { name: name.to_owned() });
    };
    let note = (n_unmeasured > 0).then(|| note(n_unmeasured, n_samples, fill));
    Ok((DepthMap::new(z_m)?, note))
}

/// Returns the depths with those that are no number above 0 filled, and how many there were; `None` where no depth was measured at
/// all. Below 0 are what programs put where they measured none, as −∞ of what was too near.
pub(super) fn filled(mut z_m: Array2<f32>, fill: FillDepth) -> Option<(Array2<f32>, usize)> {
    let n_unmeasured = z_m.iter().filter(|&&z| !is_measured(z)).count();
    if n_unmeasured == 0 {
        return Some((z_m, 0));
    }
    z_m.mapv_inplace(|z| if is_measured(z) { z } else { 0.0 });
    let farthest = z_m.iter().copied().fold(0.0, f32::max);
    match fill {
        FillDepth::Metres(metres) => z_m.mapv_inplace(|z| if z == 0.0 { metres as f32 } else { z }),
        _ if !is_measured(farthest) => return None,
        FillDepth::Far => z_m.mapv_inplace(|z| if z == 0.0 { farthest } else { z }),
        FillDepth::Beside => fill_from_beside(&mut z_m),
    }
    Some((z_m, n_unmeasured))
}

/// Whether a number is a depth, the sky's included.
pub(super) fn is_measured(z_m: f32) -> bool {
    z_m > 0.0
}

/// Returns in a sentence how many depths were filled, and with what.
pub(super) fn note(n_unmeasured: usize, n_samples: usize, fill: FillDepth) -> String {
    let percent = 100.0 * n_unmeasured as f64 / n_samples as f64;
    let with = match fill {
        FillDepth::Beside => "the farther of the depths beside them in their row".to_owned(),
        FillDepth::Far => "the farthest depth of the scene".to_owned(),
        FillDepth::Metres(metres) => format!("{metres} m"),
    };
    format!("{n_unmeasured} of {n_samples} samples ({percent:.2} %) have no depth; they get {with}")
}

/// Gives places of depth 0 the farther of the depths next to them in their row, and rows without any the row above or, at the
/// top, below.
fn fill_from_beside(z_m: &mut Array2<f32>) {
    for mut row in z_m.rows_mut() {
        let measured: Vec<f32> = row.to_vec();
        let last_before = |end: usize| measured[..end].iter().rev().copied().find(|&z| z > 0.0).unwrap_or(0.0);
        let mut column = 0;
        while column < measured.len() {
            if measured[column] != 0.0 {
                column += 1;
                continue;
            }
            let length = measured[column..].iter().take_while(|&&z| z == 0.0).count();
            let after = measured.get(column + length).copied().unwrap_or(0.0);
            row.slice_mut(ndarray::s![column..column + length]).fill(last_before(column).max(after));
            column += length;
        }
    }
    let is_known = |z_m: &Array2<f32>, row: usize| z_m[(row, 0)] != 0.0;
    let n_rows = z_m.nrows();
    let fill = |z_m: &mut Array2<f32>, row: usize, from: usize| {
        if !is_known(z_m, row) && is_known(z_m, from) {
            let copy = z_m.row(from).to_owned();
            z_m.row_mut(row).assign(&copy);
        }
    };
    (1..n_rows).for_each(|row| fill(z_m, row, row - 1));
    (1..n_rows).rev().for_each(|row| fill(z_m, row - 1, row));
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::arr2;

    #[test]
    fn unmeasured_depths_get_what_was_chosen() {
        let map = arr2(&[[0.5, 0.0, f32::NAN, 1.5], [0.0, 0.7, 0.0, 0.0], [0.0; 4]]);
        let check = |fill, expected: [[f32; 4]; 3]| {
            assert_eq!(filled(map.clone(), fill), Some((arr2(&expected), 9)), "{fill:?}");
        };
        check(FillDepth::Beside, [[0.5, 1.5, 1.5, 1.5], [0.7; 4], [0.7; 4]]);
        check(FillDepth::Far, [[0.5, 1.5, 1.5, 1.5], [1.5, 0.7, 1.5, 1.5], [1.5; 4]]);
        check(FillDepth::Metres(9.0), [[0.5, 9.0, 9.0, 1.5], [9.0, 0.7, 9.0, 9.0], [9.0; 4]]);
        let sky = filled(map, FillDepth::Metres(f64::INFINITY)).unwrap().0;
        assert_eq!((sky[(0, 1)], sky[(0, 0)]), (f32::INFINITY, 0.5));
    }

    #[test]
    fn what_is_below_0_was_not_measured() {
        let (map, n) =
            filled(arr2(&[[-0.5, f32::NEG_INFINITY, f32::MIN, 2.0, f32::INFINITY]]), FillDepth::Metres(3.0)).unwrap();
        assert_eq!((map, n), (arr2(&[[3.0, 3.0, 3.0, 2.0, f32::INFINITY]]), 3));
    }

    #[test]
    fn without_any_depth_only_metres_help() {
        let empty = Array2::zeros((2, 2));
        assert_eq!(filled(empty.clone(), FillDepth::Far), None);
        assert_eq!(filled(empty.clone(), FillDepth::Beside), None);
        assert_eq!(filled(empty, FillDepth::Metres(3.0)), Some((Array2::from_elem((2, 2), 3.0), 4)));
    }

    #[test]
    fn words_and_metres_are_read() {
        let read = |text: &str| text.parse::<FillDepth>();
        assert_eq!(read("far"), Ok(FillDepth::Far));
        assert_eq!(read("beside"), Ok(FillDepth::Beside));
        assert_eq!((read("2.5"), read("inf")), (Ok(FillDepth::Metres(2.5)), Ok(FillDepth::Metres(f64::INFINITY))));
        for (wrong, word) in [("near", "near"), ("-1", "-1"), ("0", "above 0"), ("NaN", "NaN")] {
            assert!(read(wrong).unwrap_err().to_string().contains(word), "{wrong}");
        }
        let note = note(3, 400, FillDepth::Metres(2.0));
        assert_eq!(note, "3 of 400 samples (0.75 %) have no depth; they get 2 m");
    }
}
