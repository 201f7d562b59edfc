//! A function of wavelength given by a table.

use serde::{Deserialize, Serialize};

use crate::{SpectrumError, WavelengthGrid, grid::check_ascending};

/// A function of wavelength: points of a table with straight lines between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(try_from = "Table", into = "Table")]
pub struct Spectrum {
    // Invariants: wavelengths ascend; as many values, all finite.
    wavelengths_nm: Vec<f64>,
    values: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Table {
    wavelengths_nm: Vec<f64>,
    values: Vec<f64>,
}

impl Spectrum {
    /// Returns the spectrum through these points.
    ///
    /// # Errors
    /// When the lists differ in length, wavelengths do not ascend or a value is not finite.
    pub fn new(wavelengths_nm: Vec<f64>, values: Vec<f64>) -> Result<Self, SpectrumError> {
        check_ascending(&wavelengths_nm)?;
        if values.len() != wavelengths_nm.len() {
            return Err(SpectrumError::Shape {
                what: "values of a spectrum",
                expected: wavelengths_nm.len(),
                found: values.len(),
            });
        }
        match values.iter().position(|v| !v.is_finite()) {
            Some(index) => Err(SpectrumError::Value { index, value: values[index] }),
            None => Ok(Self { wavelengths_nm, values }),
        }
    }

    /// Returns the spectrum that is `value` at every wavelength when held beyond its ends.
    pub fn constant(value: f64) -> Self {
        assert!(value.is_finite(), "a spectrum's values are finite");
        Self { wavelengths_nm: vec![550.0], values: vec![value] }
    }

    /// The wavelengths of the table, nm.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// The first and the last wavelength of the table, nm.
    pub fn range_nm(&self) -> (f64, f64) {
        (self.wavelengths_nm[0], self.wavelengths_nm[self.wavelengths_nm.len() - 1])
    }

    /// The values of the table.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns the value at a wavelength; beyond the table its end values are held.
    pub fn at_held(&self, wavelength_nm: f64) -> f64 {
        let above = self.wavelengths_nm.partition_point(|&w| w < wavelength_nm);
        if above == 0 {
            return self.values[0];
        }
        if above == self.values.len() {
            return self.values[above - 1];
        }
        let (w0, w1) = (self.wavelengths_nm[above - 1], self.wavelengths_nm[above]);
        let (v0, v1) = (self.values[above - 1], self.values[above]);
        v0 + (v1 - v0) * (wavelength_nm - w0) / (w1 - w0)
    }

    /// Returns the value at a wavelength; beyond the table it is 0.
    pub fn at_or_zero(&self, wavelength_nm: f64) -> f64 {
        let (first, last) = self.range_nm();
        if wavelength_nm < first || wavelength_nm > last { 0.0 } else { self.at_held(wavelength_nm) }
    }

    /// Returns the mean over each band of a grid, 0 outside its range: what bands hold of a spectrum with lines.
    pub fn band_means(&self, grid: &WavelengthGrid) -> Vec<f64> {
        let mean = |(&center, &width): (&f64, &f64)| {
            let n = (2.0 * width).ceil().max(1.0) as usize;
            let at = |i: usize| self.at_or_zero(center + width * ((i as f64 + 0.5) / n as f64 - 0.5));
            (0..n).map(at).sum::<f64>() / n as f64
        };
        grid.centers_nm().iter().zip(grid.widths_nm()).map(mean).collect()
    }

    /// Returns [`at_held`](Self::at_held) at each band center.
    pub fn sample_held(&self, grid: &WavelengthGrid) -> Vec<f64> {
        grid.centers_nm().iter().map(|&w| self.at_held(w)).collect()
    }

    /// Returns [`at_or_zero`](Self::at_or_zero) at each band center.
    pub fn sample_or_zero(&self, grid: &WavelengthGrid) -> Vec<f64> {
        grid.centers_nm().iter().map(|&w| self.at_or_zero(w)).collect()
    }

    /// Returns the spectrum with every value multiplied.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { wavelengths_nm: self.wavelengths_nm.clone(), values: self.values.iter().map(|v| v * factor).collect() }
    }

    /// Reads one column of a table in CSV text whose first column is the wavelength in nm.
    ///
    /// Rows where the column is empty are left out.
    pub(crate) fn from_embedded_csv(text: &str, column: &str) -> Option<Self> {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let column = reader.headers().ok()?.iter().position(|h| h == column)?;
        let (mut wavelengths_nm, mut values) = (Vec::new(), Vec::new());
        for record in reader.records() {
            let record = record.ok()?;
            if let Ok(value) = record.get(column)?.parse() {
                wavelengths_nm.push(record.get(0)?.parse().ok()?);
                values.push(value);
            }
        }
        Self::new(wavelengths_nm, values).ok()
    }
}

impl TryFrom<Table> for Spectrum {
    type Error = SpectrumError;
    fn try_from(table: Table) -> Result<Self, SpectrumError> {
        Self::new(table.wavelengths_nm, table.values)
    }
}

impl From<Spectrum> for Table {
    fn from(spectrum: Spectrum) -> Self {
        Self { wavelengths_nm: spectrum.wavelengths_nm, values: spectrum.values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_between_points_and_both_rules_beyond() {
        let s = Spectrum::new(vec![400.0, 500.0, 600.0], vec![1.0, 3.0, 2.0]).unwrap();
        assert_eq!([450.0, 500.0, 575.0].map(|w| s.at_held(w)), [2.0, 3.0, 2.25]);
        assert_eq!([s.at_held(300.0), s.at_held(700.0)], [1.0, 2.0]);
        assert_eq!([s.at_or_zero(399.9), s.at_or_zero(600.1), s.at_or_zero(600.0)], [0.0, 0.0, 2.0]);
    }

    #[test]
    fn wrong_tables_are_refused() {
        assert!(Spectrum::new(vec![400.0, 500.0], vec![1.0]).is_err());
        assert!(Spectrum::new(vec![400.0], vec![f64::NAN]).is_err());
        assert!(Spectrum::new(vec![500.0, 400.0], vec![1.0, 1.0]).is_err());
    }
}
