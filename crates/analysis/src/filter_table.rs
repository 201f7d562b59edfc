//! The built-in filters in brief.

use dioptric_pipeline::PipelineError;
use dioptric_sensor::OpticalFilter;
use dioptric_spectrum::Illuminant;
use serde::Serialize;

/// A built-in filter in brief.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilterRow {
    /// Its name on the command line and in camera files.
    pub name: String,
    /// What it is.
    pub title: String,
    /// The first wavelength of its table, nm.
    pub first_nm: f64,
    /// The last wavelength of its table, nm.
    pub last_nm: f64,
    /// The share of light of D65 that passes, as an eye sees it.
    pub luminous_d65: f64,
    /// The share of light of A that passes, as an eye sees it.
    pub luminous_a: f64,
    /// Where the numbers come from.
    pub source: String,
}

/// Returns the built-in filters.
///
/// # Errors
/// Never; the built-in filters are held to by tests.
pub fn built_in_filters() -> Result<Vec<FilterRow>, PipelineError> {
    OpticalFilter::built_in_names()
        .map(|name| {
            let filter = OpticalFilter::built_in(name)?;
            let (first_nm, last_nm) = filter.transmittance.range_nm();
            Ok(FilterRow {
                name: name.to_owned(),
                first_nm,
                last_nm,
                luminous_d65: filter.luminous_transmittance(&Illuminant::D65),
                luminous_a: filter.luminous_transmittance(&Illuminant::A),
                title: filter.name,
                source: filter.source,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn red_filters_pass_more_of_lamps_than_of_daylight() {
        let rows = built_in_filters().unwrap();
        let row = |name: &str| rows.iter().find(|row| row.name == name).unwrap();
        let (red, blue) = (row("wratten-25"), row("wratten-47"));
        assert!(red.luminous_a > red.luminous_d65 && blue.luminous_a < blue.luminous_d65);
        assert!(rows.iter().all(|row| (0.0..=1.0).contains(&row.luminous_d65) && row.first_nm < row.last_nm));
    }
}
