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

    /// Returns the mean over each band of a grid, as far as the table goes, and 0 beyond: what bands hold of a spectrum with lines.
    pub fn band_means(&self, grid: &WavelengthGrid) -> Vec<f64> {
        self.means(grid).map(|(_, mean)| mean.unwrap_or(0.0)).collect()
    }

    /// Returns the mean over each band of a grid; beyond the table its end values are held.
    pub fn band_means_held(&self, grid: &WavelengthGrid) -> Vec<f64> {
        self.means(grid).map(|(center_nm, mean)| mean.unwrap_or_else(|| self.at_held(center_nm))).collect()
    }

    fn means(&self, grid: &WavelengthGrid) -> impl Iterator<Item = (f64, Option<f64>)> {
        let bands = grid.centers_nm().iter().zip(grid.middles_nm()).zip(grid.widths_nm());
        bands.map(|((&center_nm, middle_nm), &width_nm)| (center_nm, self.mean_over(center_nm, middle_nm, width_nm)))
    }

    /// Returns the mean over a band, of the lines between the values of the table; `None` beyond it.
    fn mean_over(&self, center_nm: f64, middle_nm: f64, width_nm: f64) -> Option<f64> {
        let (start, end) = (middle_nm - 0.5 * width_nm, middle_nm + 0.5 * width_nm);
        let (first, last) = self.range_nm();
        let (from, to) = (start.max(first), end.min(last));
        if from > to {
            return None;
        }
        let index = |nm: f64| self.wavelengths_nm.partition_point(|&w| w < nm);
        // A table that is no finer than bands has what they hold.
        if index(end) - index(start) <= 1 {
            return Some(self.at_held(center_nm));
        }
        let inner = (index(from)..index(to)).map(|i| (self.wavelengths_nm[i], self.values[i]));
        let [start, end] = [from, to].map(|nm| (nm, self.at_held(nm)));
        let (mut sum, mut before) = (0.0, start);
        for point in inner.chain([end]) {
            sum += 0.5 * (before.1 + point.1) * (point.0 - before.0);
            before = point;
        }
        Some(if to > from { sum / (to - from) } else { start.1 })
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

    /// Lines between the centers of bands, and on them: bands beside each other hold all of a table, whatever their width.
    #[test]
    fn bands_hold_all_light_of_lines() {
        let wavelengths_nm: Vec<f64> = (0..=600).map(|i| 395.0 + 0.5 * f64::from(i)).collect();
        let light = |nm: f64| if [405.5, 450.0, 589.0].contains(&nm) { 20.0 } else { 0.02 };
        let values: Vec<f64> = wavelengths_nm.iter().map(|nm| light(*nm)).collect();
        let table = Spectrum::new(wavelengths_nm, values).unwrap();
        let all: f64 = table.values().windows(2).map(|pair| 0.25 * (pair[0] + pair[1])).sum();
        for step_nm in [2.5, 10.0, 50.0] {
            let (first, last) = (395.0 + 0.5 * step_nm, 695.0 - 0.5 * step_nm);
            let grid = WavelengthGrid::uniform(first, last, step_nm).unwrap();
            for means in [table.band_means(&grid), table.band_means_held(&grid)] {
                let held: f64 = means.iter().map(|mean| mean * step_nm).sum();
                assert!((held / all - 1.0).abs() < 1e-12, "{step_nm}: {held} {all}");
            }
        }
        // A table no finer than bands has what they hold, to its ends.
        let grid = WavelengthGrid::uniform(400.0, 440.0, 10.0).unwrap();
        let coarse = Spectrum::new(vec![410.0, 420.0, 430.0], vec![1.0, 5.0, 2.0]).unwrap();
        assert_eq!(coarse.band_means(&grid), [0.0, 1.0, 5.0, 2.0, 0.0]);
        assert_eq!(coarse.band_means_held(&grid), [1.0, 1.0, 5.0, 2.0, 2.0]);
    }

    #[test]
    fn wrong_tables_are_refused() {
        assert!(Spectrum::new(vec![400.0, 500.0], vec![1.0]).is_err());
        assert!(Spectrum::new(vec![400.0], vec![f64::NAN]).is_err());
        assert!(Spectrum::new(vec![500.0, 400.0], vec![1.0, 1.0]).is_err());
    }
}
