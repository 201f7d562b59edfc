//! The wavelengths at which spectral images are sampled.

use serde::{Deserialize, Serialize};

use crate::SpectrumError;

/// A list of ascending band centers, each with the width that it stands for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct WavelengthGrid {
    // Invariants: centers ascend and are finite and positive; as many widths, all positive.
    centers_nm: Vec<f64>,
    widths_nm: Vec<f64>,
}

impl WavelengthGrid {
    /// Returns a grid on these band centers; each band reaches half-way to its neighbors.
    ///
    /// The first and the last band are symmetric about their center; a single band is 1 nm wide.
    ///
    /// # Errors
    /// When the list is empty, not ascending, or not finite and positive.
    pub fn new(centers_nm: Vec<f64>) -> Result<Self, SpectrumError> {
        check_ascending(&centers_nm)?;
        let n = centers_nm.len();
        let widths_nm = match n {
            1 => vec![1.0],
            _ => (0..n)
                .map(|i| match i {
                    0 => centers_nm[1] - centers_nm[0],
                    _ if i == n - 1 => centers_nm[i] - centers_nm[i - 1],
                    _ => 0.5 * (centers_nm[i + 1] - centers_nm[i - 1]),
                })
                .collect(),
        };
        Ok(Self { centers_nm, widths_nm })
    }

    /// Returns the grid `first, first + step, …` up to and including `last` where it falls on a step.
    ///
    /// # Errors
    /// When the step is not positive, the range is reversed or the grid would have over 10 000 bands.
    pub fn uniform(first_nm: f64, last_nm: f64, step_nm: f64) -> Result<Self, SpectrumError> {
        let range_error = SpectrumError::Range { first_nm, last_nm, step_nm };
        let n_steps = ((last_nm - first_nm) / step_nm + 1e-9).floor();
        if !(step_nm > 0.0 && first_nm > 0.0 && (0.0..10_000.0).contains(&n_steps)) {
            return Err(range_error);
        }
        let centers_nm: Vec<f64> = (0..=n_steps as usize).map(|i| first_nm + step_nm * i as f64).collect();
        let widths_nm = vec![step_nm; centers_nm.len()];
        Ok(Self { centers_nm, widths_nm })
    }

    /// The band centers, nm.
    pub fn centers_nm(&self) -> &[f64] {
        &self.centers_nm
    }

    /// The band widths, nm.
    pub fn widths_nm(&self) -> &[f64] {
        &self.widths_nm
    }

    /// The middles of the bands, nm: their centers where neighbors are as far on both sides.
    ///
    /// What a band stands for lies half its width on both sides of its middle, so that bands neither overlap nor leave gaps.
    pub fn middles_nm(&self) -> Vec<f64> {
        let c = &self.centers_nm;
        let step = |i: usize| c[i + 1] - c[i];
        let shift = |i: usize| if i == 0 || i + 1 == c.len() { 0.0 } else { 0.25 * (step(i) - step(i - 1)) };
        c.iter().enumerate().map(|(i, center)| center + shift(i)).collect()
    }

    /// The number of bands, at least 1.
    #[expect(clippy::len_without_is_empty, reason = "a grid is never empty")]
    pub fn len(&self) -> usize {
        self.centers_nm.len()
    }

    /// The first and the last band center, nm.
    pub fn range_nm(&self) -> (f64, f64) {
        (self.centers_nm[0], self.centers_nm[self.len() - 1])
    }

    /// Returns the band whose center is nearest.
    pub fn nearest(&self, wavelength_nm: f64) -> usize {
        let above = self.centers_nm.partition_point(|&c| c < wavelength_nm).min(self.len() - 1);
        let below = above.saturating_sub(1);
        if (wavelength_nm - self.centers_nm[below]).abs() <= (self.centers_nm[above] - wavelength_nm).abs() {
            below
        } else {
            above
        }
    }

    /// Returns Σ value × width: the integral over wavelength of one value a band.
    pub fn integrate(&self, values: &[f64]) -> f64 {
        assert_eq!(values.len(), self.len(), "one value a band");
        values.iter().zip(&self.widths_nm).map(|(v, w)| v * w).sum()
    }
}

impl TryFrom<Vec<f64>> for WavelengthGrid {
    type Error = SpectrumError;
    fn try_from(centers_nm: Vec<f64>) -> Result<Self, SpectrumError> {
        Self::new(centers_nm)
    }
}

impl From<WavelengthGrid> for Vec<f64> {
    fn from(grid: WavelengthGrid) -> Self {
        grid.centers_nm
    }
}

/// Checks that wavelengths are there, finite, positive and ascending.
pub(crate) fn check_ascending(wavelengths_nm: &[f64]) -> Result<(), SpectrumError> {
    if wavelengths_nm.is_empty() {
        return Err(SpectrumError::Wavelengths { index: 0, value: f64::NAN });
    }
    let mut previous = 0.0;
    for (index, &value) in wavelengths_nm.iter().enumerate() {
        if !(value.is_finite() && value > previous) {
            return Err(SpectrumError::Wavelengths { index, value });
        }
        previous = value;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_one_bands_cover_400_to_700() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        assert_eq!(grid.len(), 31);
        assert_eq!(grid.range_nm(), (400.0, 700.0));
        assert_eq!(grid.integrate(&[1.0; 31]), 310.0);
    }

    #[test]
    fn widths_reach_half_way_to_the_neighbors() {
        let grid = WavelengthGrid::new(vec![400.0, 410.0, 440.0]).unwrap();
        assert_eq!(grid.widths_nm(), [10.0, 20.0, 30.0]);
        // From 405 nm to 425 nm.
        assert_eq!(grid.middles_nm(), [400.0, 415.0, 440.0]);
        let even = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        assert_eq!(even.middles_nm(), even.centers_nm());
    }

    #[test]
    fn nearest_band_is_found_inside_and_outside() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 100.0).unwrap();
        assert_eq!([300.0, 449.0, 451.0, 700.0, 900.0].map(|w| grid.nearest(w)), [0, 0, 1, 3, 3]);
    }

    #[test]
    fn wrong_lists_are_refused() {
        for wrong in [vec![], vec![0.0], vec![500.0, 500.0], vec![400.0, f64::NAN], vec![f64::INFINITY]] {
            assert!(WavelengthGrid::new(wrong).is_err());
        }
        assert!(WavelengthGrid::uniform(400.0, 700.0, 0.0).is_err());
        assert!(WavelengthGrid::uniform(400.0, 700.0, f64::NAN).is_err());
        assert!(WavelengthGrid::uniform(700.0, 400.0, 10.0).is_err());
        assert!(WavelengthGrid::uniform(400.0, 700.0, 1e-9).is_err());
    }
}
