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

/// Wavelengths where none are asked for, nm.
const USUAL_NM: [f64; 7] = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0];

/// Returns a glass of the catalogue with its index at these wavelengths, nm, which may be outside the range in which it is known; without any, at
/// usual ones at which it is, or over its range. Of a name that several makers have it is the glass of the first of `makers` that has it.
///
/// # Errors
/// When the name means no glass or several, a maker is none, or the glass is not known at a wavelength and not to be continued, or cannot be.
pub fn glass_data(
    name: &str,
    makers: &[String],
    wavelengths_nm: Option<Vec<f64>>,
    range: GlassRange,
) -> Result<GlassData, PipelineError> {
    let catalogue = GlassCatalogue::built_in();
    let known = catalogue.makers();
    if let Some(unknown) = makers.iter().find(|maker| !known.iter().any(|known| known.eq_ignore_ascii_case(maker))) {
        let (origin, expected) = ("the glasses".to_owned(), format!("a maker: {}", known.join(", ")));
        return Err(PipelineError::Value { origin, key: "catalog", found: unknown.clone(), expected });
    }
    let found = catalogue.find_among(name, makers)?;
    let named = Glass::Named(found.full_name());
    let wavelengths_nm = wavelengths_nm.unwrap_or_else(|| usual_nm(found.glass.range_nm()));
    let at = |&nm: &f64| match range {
        GlassRange::Refuse => Ok((named.index_at(nm)?, 0.0)),
        GlassRange::Extend => named.extended_at(nm).map(|extended| (extended.index, extended.possible_error)),
    };
    let found_at: Vec<(f64, f64)> = wavelengths_nm.iter().map(at).collect::<Result<_, OpticsError>>()?;
    let (indices, possible_errors) = found_at.into_iter().unzip();
    let transmittances_10_mm = wavelengths_nm.iter().map(|&nm| named.internal_transmittance(nm, 10.0)).collect();
    Ok(GlassData { glass: row(found), wavelengths_nm, indices, possible_errors, transmittances_10_mm })
}

/// Returns the usual wavelengths at which a glass of this range is known, or where they are less than two as many over the range.
fn usual_nm(range_nm: Option<(f64, f64)>) -> Vec<f64> {
    let Some((first_nm, last_nm)) = range_nm else { return USUAL_NM.to_vec() };
    let known: Vec<f64> = USUAL_NM.into_iter().filter(|nm| (first_nm..=last_nm).contains(nm)).collect();
    if known.len() >= 2 {
        return known;
    }
    let last = USUAL_NM.len() - 1;
    let share = |i: usize| i as f64 / last as f64;
    (0..=last).map(|i| first_nm * (1.0 - share(i)) + last_nm * share(i)).collect()
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
        let data = glass_data("SCHOTT:N-BK7", &[], Some(vec![587.5618]), GlassRange::Refuse).unwrap();
        // The maker's data sheet: n_d 1.51680.
        assert!((data.indices[0] - 1.5168).abs() < 5e-6);
        let message = glass_data("N-BK7", &[], Some(vec![100.0]), GlassRange::Refuse).unwrap_err().to_string();
        assert!(message.contains("SCHOTT:N-BK7") && message.contains("100 nm"), "{message}");
        assert!(glass_data("no such glass", &[], None, GlassRange::Extend).is_err());
        let message = glass_data("N-BK7", &["NOSUCH".to_owned()], None, GlassRange::Refuse).unwrap_err().to_string();
        assert!(message.contains("NOSUCH") && message.contains("SCHOTT"), "{message}");
    }

    #[test]
    fn every_glass_is_shown_where_it_is_known() {
        for CatalogueGlass { name, maker, glass } in GlassCatalogue::built_in().glasses() {
            let data = glass_data(&format!("{maker}:{name}"), &[], None, GlassRange::Refuse).unwrap();
            assert!(data.wavelengths_nm.len() >= 2, "{maker}:{name}");
            assert!(
                glass
                    .range_nm()
                    .is_none_or(|(first, last)| data.wavelengths_nm.iter().all(|nm| (first..=last).contains(nm)))
            );
        }
    }
}
