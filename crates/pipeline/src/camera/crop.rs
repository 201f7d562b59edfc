//! A part of the film.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::PipelineError;

/// A part of the film that is simulated in place of the whole: pixels, counted from the top left of the picture.
///
/// Lens, focus and mosaic are those of the whole film, and so is the irradiance; noise and automatic exposure are of the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Crop {
    /// Its first column.
    pub x: usize,
    /// Its first row.
    pub y: usize,
    /// Its columns.
    pub columns: usize,
    /// Its rows.
    pub rows: usize,
}

impl FromStr for Crop {
    type Err = PipelineError;

    /// Reads `x,y,columns,rows`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        let Some([x, y, columns, rows]) = numbers.and_then(|numbers| <[usize; 4]>::try_from(numbers).ok()) else {
            let reason = format!("found '{text}', expected X,Y,W,H in pixels, as 100,80,64,48");
            return Err(PipelineError::Unsuitable { what: "crop", reason });
        };
        Ok(Self { x, y, columns, rows })
    }
}

impl Crop {
    /// Checks that it lies on a film of this size.
    ///
    /// # Errors
    /// When it is empty or reaches beyond.
    pub fn check(self, (rows, columns): (usize, usize)) -> Result<(), PipelineError> {
        let Self { x, y, .. } = self;
        let is_within = |first: usize, n: usize, of: usize| n > 0 && first.checked_add(n).is_some_and(|end| end <= of);
        if is_within(x, self.columns, columns) && is_within(y, self.rows, rows) {
            return Ok(());
        }
        let reason = format!(
            "{} × {} pixels from column {x} and row {y} on are no part of a film of {columns} × {rows} pixels",
            self.columns, self.rows
        );
        Err(PipelineError::Unsuitable { what: "crop", reason })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_lies_on_the_film() {
        let crop: Crop = "100, 80,64,48".parse().unwrap();
        assert_eq!(crop, Crop { x: 100, y: 80, columns: 64, rows: 48 });
        assert!(crop.check((128, 164)).is_ok());
        for size in [(127, 164), (128, 163)] {
            let message = crop.check(size).unwrap_err().to_string();
            assert!(message.contains("64 × 48 pixels from column 100 and row 80 on"), "{message}");
        }
        assert!(Crop { columns: 0, ..crop }.check((500, 500)).is_err());
        assert!(Crop { x: usize::MAX, ..crop }.check((500, 500)).is_err());
        for text in ["1,2,3", "1,2,3,4,5", "a,1,2,3", "-1,2,3,4", ""] {
            assert!(text.parse::<Crop>().is_err(), "{text}");
        }
    }
}
