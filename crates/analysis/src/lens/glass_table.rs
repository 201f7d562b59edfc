//! The glass catalogue as tables.

use dioptric_optics::{CatalogueGlass, Glass, GlassCatalogue, GlassRange, OpticsError};
use serde::Serialize;

use dioptric_pipeline::PipelineError;

/// A glass as a row of a list.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GlassRow {
    /// What its maker calls it.
    pub name: String,
    /// Who makes it.
    pub maker: String,
    /// Index at the helium d line.
    pub nd: Option<f64>,
    /// Abbe number.
    pub vd: Option<f64>,
    /// Where its index is known from, nm.
    pub first_nm: Option<f64>,
    /// Where its index is known to, nm.
    pub last_nm: Option<f64>,
}

/// A glass with its index at some wavelengths.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GlassData {
    /// The glass.
    #[serde(flatten)]
    pub glass: GlassRow,
    /// Wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// The index relative to air at each of them.
    pub indices: Vec<f64>,
    /// How far each may be off, where the glass is continued beyond the range in which it is known; 0 within.
    pub possible_errors: Vec<f64>,
    /// The share of light that 10 mm of the glass let through at each of them, reflections apart, where it is known.
    pub transmittances_10_mm: Vec<Option<f64>>,
}

/// Returns the glasses whose name holds `part`, in any case; all for an empty part.
pub fn glass_rows(part: &str) -> Vec<GlassRow> {
    let part = part.to_lowercase();
    let catalogue = GlassCatalogue::built_in();
    catalogue.glasses().iter().filter(|g| g.full_name().to_lowercase().contains(&part)).map(row).collect()
}

/// Returns a glass of the catalogue with its index at these wavelengths, nm, which may be outside the range in which it is known; of a name
/// that several makers have, the glass of the first of `makers` that has it.
///
/// # Errors
/// When the name means no glass or several, or the glass is not known at a wavelength and not to be continued, or cannot be.
pub fn glass_data(
    name: &str,
    makers: &[String],
    wavelengths_nm: &[f64],
    range: GlassRange,
) -> Result<GlassData, PipelineError> {
    let found = GlassCatalogue::built_in().find_among(name, makers)?;
    let at = |&nm: &f64| match range {
        GlassRange::Refuse => Ok((found.glass.index_at(nm)?, 0.0)),
        GlassRange::Extend => found.glass.extended_at(nm).map(|extended| (extended.index, extended.possible_error)),
    };
    let found_at: Vec<(f64, f64)> = wavelengths_nm.iter().map(at).collect::<Result<_, OpticsError>>()?;
    let (indices, possible_errors) = found_at.into_iter().unzip();
    // Of a glass of the catalogue its name is looked up, for its internal absorption is listed by names.
    let named = Glass::Named(found.full_name());
    let transmittances_10_mm = wavelengths_nm.iter().map(|&nm| named.internal_transmittance(nm, 10.0)).collect();
    let wavelengths_nm = wavelengths_nm.to_vec();
    Ok(GlassData { glass: row(found), wavelengths_nm, indices, possible_errors, transmittances_10_mm })
}

fn row(glass: &CatalogueGlass) -> GlassRow {
    let (nd, vd) = glass.glass.nd_vd().unzip();
    let (first_nm, last_nm) = glass.glass.range_nm().unzip();
    GlassRow { name: glass.name.clone(), maker: glass.maker.clone(), nd, vd, first_nm, last_nm }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bk7_is_found_with_its_index() {
        assert!(glass_rows("n-bk7").iter().any(|row| row.name == "N-BK7"));
        assert!(glass_rows("").len() > 1000);
        let data = glass_data("SCHOTT:N-BK7", &[], &[587.5618], GlassRange::Refuse).unwrap();
        // The maker's data sheet: n_d 1.51680.
        assert!((data.indices[0] - 1.5168).abs() < 5e-6);
        let message = glass_data("N-BK7", &[], &[100.0], GlassRange::Refuse).unwrap_err().to_string();
        assert!(message.contains("100 nm"), "{message}");
        assert!(glass_data("no such glass", &[], &[500.0], GlassRange::Extend).is_err());
    }
}
