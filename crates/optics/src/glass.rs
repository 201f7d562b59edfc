//! Media and their refractive index as a function of wavelength.

mod catalogue;
mod extend;
mod formula;

use serde::{Deserialize, Serialize};

use crate::{Air, OpticsError};

pub use self::catalogue::{CatalogueGlass, GlassCatalogue};
pub use self::extend::{ExtendedIndex, GlassRange};
use self::formula::formula_index;

/// The helium d line, at which catalogues state the main index, nm.
pub const D_LINE_NM: f64 = 587.5618;
/// The hydrogen F line, nm.
pub const F_LINE_NM: f64 = 486.1327;
/// The hydrogen C line, nm.
pub const C_LINE_NM: f64 = 656.2725;

/// Where an index and an Abbe number are held to say something of a glass, nm: within the windows of optical glasses. Beyond them
/// Cauchy's law through two numbers is no index of anything.
const ND_VD_RANGE_NM: (f64, f64) = (300.0, 2500.0);

/// A medium: its refractive index, relative to air, as a function of wavelength.
///
/// Air is that of the catalogues, [`Air::CATALOGUE`], which has index 1 here; so a lens stands in such air. What else
/// its light passes, as vacuum or warm air, is relative to that as well ([`Glass::AirAt`]). How the index of a glass
/// itself changes with its temperature is not taken into account.
///
/// The formulas take vacuum wavelengths. A range, where one is stated, is where the index is known; asking beyond
/// it is an error, unless one asks for a continuation ([`Glass::extended_at`]).
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Glass {
    /// Air, of index 1 exactly: catalogue indices are relative to it.
    #[default]
    Air,
    /// Air in another state than that of the catalogues, or vacuum.
    AirAt(Air),
    /// A glass of the built-in [`GlassCatalogue`], by a name that means it alone, as `SCHOTT:N-BK7`.
    Named(String),
    /// A medium without dispersion.
    Constant {
        /// The index.
        index: f64,
    },
    /// The straight line `n = index + slope · (λ − reference)`, the law of the paper's figures.
    Linear {
        /// Index at the reference wavelength.
        index: f64,
        /// The reference wavelength, nm.
        reference_nm: f64,
        /// Change of index a nanometre; negative for an ordinary glass.
        slope_per_nm: f64,
    },
    /// Cauchy's law `n = a + b / λ²`, λ in µm.
    Cauchy {
        /// The index at very long wavelengths.
        a: f64,
        /// The dispersion, µm².
        b_um2: f64,
    },
    /// Cauchy's law through a given index and Abbe number.
    NdVd {
        /// Index at the d line.
        nd: f64,
        /// Abbe number `(n_d − 1)/(n_F − n_C)`.
        vd: f64,
    },
    /// Sellmeier's law `n² = 1 + Σ b λ² / (λ² − c)`, λ in µm.
    Sellmeier {
        /// The strengths.
        b: Vec<f64>,
        /// The squared resonance wavelengths, µm².
        c_um2: Vec<f64>,
        /// Where the law holds, nm.
        range_nm: Option<(f64, f64)>,
    },
    /// One of the nine dispersion formulas of refractiveindex.info, with its coefficients in the order used there.
    Formula {
        /// Number of the formula, 1 to 9.
        formula: u8,
        /// The coefficients, as many as given: the rest are 0.
        coefficients: Vec<f64>,
        /// Where the formula holds, nm.
        range_nm: Option<(f64, f64)>,
    },
    /// A table with straight lines between its points.
    Tabulated {
        /// Ascending wavelengths, nm.
        wavelengths_nm: Vec<f64>,
        /// The index at each.
        indices: Vec<f64>,
    },
    /// A medium whose extinction coefficient is known too, by a table with straight lines between its points.
    Absorbing {
        /// The law of the index: any of the others.
        law: Box<Self>,
        /// Ascending wavelengths of the table, nm.
        wavelengths_nm: Vec<f64>,
        /// The extinction coefficient k at each.
        extinctions: Vec<f64>,
    },
}

impl Glass {
    /// Returns Cauchy's law through an index at the d line and an Abbe number.
    ///
    /// # Errors
    /// When the index is not above 0 or the Abbe number not positive.
    pub fn cauchy_from_nd_vd(nd: f64, vd: f64) -> Result<Self, OpticsError> {
        Self::NdVd { nd, vd }.check()?;
        let (a, b_um2) = cauchy_coefficients(nd, vd);
        Ok(Self::Cauchy { a, b_um2 })
    }

    /// Returns the index at a wavelength.
    ///
    /// # Errors
    /// Outside the range in which the glass is known, or where its formula gives no positive index.
    pub fn index_at(&self, wavelength_nm: f64) -> Result<f64, OpticsError> {
        if !(wavelength_nm > 0.0 && wavelength_nm.is_finite()) {
            return Err(OpticsError::Wavelength { wavelength_nm });
        }
        if let Some((first_nm, last_nm)) = self.range_nm()
            && !(first_nm..=last_nm).contains(&wavelength_nm)
        {
            return Err(OpticsError::WavelengthOutsideGlass {
                glass: self.describe(),
                wavelength_nm,
                first_nm,
                last_nm,
                remedy: self.remedy(),
            });
        }
        let found = self.index_unchecked(wavelength_nm);
        if found > 0.0 && found.is_finite() {
            Ok(found)
        } else {
            Err(OpticsError::Index { glass: self.describe(), wavelength_nm, found })
        }
    }

    /// Returns the index relative to vacuum at a (vacuum) wavelength: that relative to air times the index of the air of
    /// the catalogues.
    ///
    /// The few fluids whose source states the index relative to vacuum ([`GlassCatalogue::built_in`]) must not be
    /// converted.
    ///
    /// # Errors
    /// As [`index_at`](Self::index_at).
    pub fn absolute_index_at(&self, wavelength_nm: f64) -> Result<f64, OpticsError> {
        Ok(self.index_at(wavelength_nm)? * Air::CATALOGUE.index_at(wavelength_nm))
    }

    /// Where the index is known, nm; `None` for a law without stated ends.
    pub fn range_nm(&self) -> Option<(f64, f64)> {
        match self {
            Self::Named(name) => named(name)?.range_nm(),
            Self::Absorbing { law, .. } => law.range_nm(),
            Self::Sellmeier { range_nm, .. } | Self::Formula { range_nm, .. } => *range_nm,
            Self::Tabulated { wavelengths_nm, .. } => Some((*wavelengths_nm.first()?, *wavelengths_nm.last()?)),
            Self::NdVd { .. } => Some(ND_VD_RANGE_NM),
            _ => None,
        }
    }

    /// Returns the index at the d line and the Abbe number, where the glass is known at the three lines.
    ///
    /// The Abbe number of a medium without dispersion is infinite.
    pub fn nd_vd(&self) -> Option<(f64, f64)> {
        let [nd, nf, nc] = [D_LINE_NM, F_LINE_NM, C_LINE_NM].map(|w| self.index_at(w).ok());
        Some((nd?, (nd? - 1.0) / (nf? - nc?)))
    }

    /// Returns a short description for messages and drawings.
    pub fn describe(&self) -> String {
        match self {
            Self::Air => "air".to_owned(),
            Self::AirAt(Air { pressure_pa: 0.0, .. }) => "vacuum".to_owned(),
            Self::AirAt(air) => format!("air of {} °C and {} Pa", air.temperature_c, air.pressure_pa),
            Self::Named(name) => format!("the glass {name}"),
            Self::Constant { index } => format!("the medium of constant index {index}"),
            Self::Linear { index, reference_nm, .. } => {
                format!("the medium of index {index} at {reference_nm} nm with a linear law")
            }
            Self::Cauchy { a, b_um2 } => format!("the Cauchy glass {a} + {b_um2}/λ²"),
            Self::NdVd { nd, vd } => format!("the glass of n_d {nd}, V_d {vd}"),
            Self::Sellmeier { b, .. } => format!("a Sellmeier glass of {} terms", b.len()),
            Self::Formula { formula, .. } => format!("a glass by dispersion formula {formula}"),
            Self::Tabulated { wavelengths_nm, .. } => format!("a glass tabulated at {} points", wavelengths_nm.len()),
            Self::Absorbing { law, .. } => law.describe(),
        }
    }

    /// Checks that the numbers make sense.
    ///
    /// # Errors
    /// Names the first number that does not.
    pub fn check(&self) -> Result<(), OpticsError> {
        let finite = |key, found: f64| match found.is_finite() {
            true => Ok(()),
            false => Err(OpticsError::Glass { key, found, expected: "a finite number" }),
        };
        let positive = |key, found: f64| match found.is_finite() && found > 0.0 {
            true => Ok(()),
            false => Err(OpticsError::Glass { key, found, expected: "a finite number above 0" }),
        };
        let same_length = |key, found: usize, wanted: usize| match found == wanted && wanted > 0 {
            true => Ok(()),
            false => {
                Err(OpticsError::Glass { key, found: found as f64, expected: "two lists of one length, not empty" })
            }
        };
        match self {
            Self::Air => Ok(()),
            Self::AirAt(air) => air.check(),
            Self::Named(name) => GlassCatalogue::built_in().find(name).map(|_| ()),
            Self::Constant { index } => positive("index", *index),
            Self::Linear { index, reference_nm, slope_per_nm } => {
                positive("index", *index)?;
                positive("reference_nm", *reference_nm)?;
                finite("slope_per_nm", *slope_per_nm)
            }
            Self::Cauchy { a, b_um2 } => {
                positive("a", *a)?;
                finite("b_um2", *b_um2)
            }
            Self::NdVd { nd, vd } => {
                positive("nd", *nd)?;
                positive("vd", *vd)
            }
            Self::Sellmeier { b, c_um2, range_nm } => {
                same_length("number of terms", b.len(), c_um2.len())?;
                b.iter().chain(c_um2).try_for_each(|&v| finite("coefficient", v))?;
                check_range(*range_nm)
            }
            Self::Formula { formula, coefficients, range_nm } => {
                if !(1..=9).contains(formula) {
                    let found = f64::from(*formula);
                    return Err(OpticsError::Glass { key: "formula", found, expected: "1 to 9" });
                }
                coefficients.iter().try_for_each(|&v| finite("coefficient", v))?;
                check_range(*range_nm)
            }
            Self::Tabulated { wavelengths_nm, indices } => {
                same_length("number of points", indices.len(), wavelengths_nm.len())?;
                indices.iter().try_for_each(|&v| positive("index", v))?;
                check_ascending(wavelengths_nm)
            }
            Self::Absorbing { law, wavelengths_nm, extinctions } => {
                let fault = |key, found, expected| Err(OpticsError::Glass { key, found, expected });
                if matches!(**law, Self::Absorbing { .. }) {
                    return fault("number of tables of extinction", 2.0, "one");
                }
                law.check()?;
                same_length("number of points", extinctions.len(), wavelengths_nm.len())?;
                if let Some(&found) = extinctions.iter().find(|k| !(k.is_finite() && **k >= 0.0)) {
                    return fault("extinction", found, "a finite number of at least 0");
                }
                check_ascending(wavelengths_nm)
            }
        }
    }

    fn index_unchecked(&self, wavelength_nm: f64) -> f64 {
        let um = 1e-3 * wavelength_nm;
        match self {
            Self::Air => 1.0,
            Self::AirAt(air) => air.index_at(wavelength_nm) / Air::CATALOGUE.index_at(wavelength_nm),
            Self::Named(name) => named(name).map_or(f64::NAN, |glass| glass.index_unchecked(wavelength_nm)),
            Self::Constant { index } => *index,
            Self::Linear { index, reference_nm, slope_per_nm } => index + slope_per_nm * (wavelength_nm - reference_nm),
            Self::Cauchy { a, b_um2 } => a + b_um2 / (um * um),
            Self::NdVd { nd, vd } => {
                let (a, b_um2) = cauchy_coefficients(*nd, *vd);
                a + b_um2 / (um * um)
            }
            Self::Sellmeier { b, c_um2, .. } => {
                let w2 = um * um;
                b.iter().zip(c_um2).fold(1.0, |n2, (b, c)| n2 + b * w2 / (w2 - c)).sqrt()
            }
            Self::Formula { formula, coefficients, .. } => formula_index(*formula, coefficients, um),
            Self::Tabulated { wavelengths_nm, indices } => interpolate(wavelengths_nm, indices, wavelength_nm),
            Self::Absorbing { law, .. } => law.index_unchecked(wavelength_nm),
        }
    }
}

fn named(name: &str) -> Option<&'static Glass> {
    GlassCatalogue::built_in().find(name).ok().map(|found| &found.glass)
}

fn check_range(range_nm: Option<(f64, f64)>) -> Result<(), OpticsError> {
    match range_nm {
        Some((first, last)) if !(first > 0.0 && last > first && last.is_finite()) => {
            Err(OpticsError::Glass { key: "range_nm", found: first, expected: "two ascending positive wavelengths" })
        }
        _ => Ok(()),
    }
}

fn check_ascending(wavelengths_nm: &[f64]) -> Result<(), OpticsError> {
    let mut previous = 0.0;
    for &found in wavelengths_nm {
        if !(found > previous && found.is_finite()) {
            let expected = "ascending positive wavelengths";
            return Err(OpticsError::Glass { key: "wavelengths_nm", found, expected });
        }
        previous = found;
    }
    Ok(())
}

fn cauchy_coefficients(nd: f64, vd: f64) -> (f64, f64) {
    let inverse_square = |nm: f64| 1.0 / (1e-6 * nm * nm);
    let b_um2 = (nd - 1.0) / vd / (inverse_square(F_LINE_NM) - inverse_square(C_LINE_NM));
    (nd - b_um2 * inverse_square(D_LINE_NM), b_um2)
}

pub(crate) fn interpolate(at: &[f64], values: &[f64], x: f64) -> f64 {
    let above = at.partition_point(|&w| w < x).clamp(1, at.len().max(2) - 1);
    match (at.get(above - 1), at.get(above)) {
        (Some(&w0), Some(&w1)) => {
            let fraction = (x - w0) / (w1 - w0);
            values[above - 1] * (1.0 - fraction) + values[above] * fraction
        }
        _ => values[0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(glass: &Glass, wavelength_nm: f64, expected: f64) {
        let found = glass.index_at(wavelength_nm).unwrap();
        assert!((found - expected).abs() < 5e-6, "{}: {found}, expected {expected}", glass.describe());
    }

    #[test]
    fn bk7_has_its_catalogue_index() {
        let b = vec![1.03961212, 0.231792344, 1.01046945];
        let c_um2 = vec![0.00600069867, 0.0200179144, 103.560653];
        let bk7 = Glass::Sellmeier { b, c_um2, range_nm: Some((300.0, 2500.0)) };
        // The maker's data sheet gives five decimals.
        check(&bk7, D_LINE_NM, 1.51680);
        check(&bk7, F_LINE_NM, 1.52238);
        let (_, vd) = bk7.nd_vd().unwrap();
        assert!((vd - 64.17).abs() < 0.005, "V_d {vd}");
    }

    #[test]
    fn cauchy_goes_through_its_index_and_abbe_number() {
        let glass = Glass::cauchy_from_nd_vd(1.628, 57.0).unwrap();
        let Glass::Cauchy { a, b_um2 } = glass else { panic!("{glass:?}") };
        assert!((a - 1.6112879519220324).abs() < 1e-15 && (b_um2 - 0.005769481453609457).abs() < 1e-16);
        let (nd, vd) = glass.nd_vd().unwrap();
        assert!((nd - 1.628).abs() < 1e-14 && (vd - 57.0).abs() < 1e-10);
    }

    #[test]
    fn vacuum_and_absolute_indices_are_those_of_the_catalogue_times_air() {
        let bk7 = Glass::Named("SCHOTT:N-BK7".to_owned());
        let air = Air::CATALOGUE.index_at(D_LINE_NM);
        let (relative, absolute) = (bk7.index_at(D_LINE_NM).unwrap(), bk7.absolute_index_at(D_LINE_NM).unwrap());
        // Air of 20 °C has 1.000272 at the d line, so that the absolute index is larger by 4.1e-4.
        assert!((absolute / relative - air).abs() < 1e-15 && (air - 1.000_272).abs() < 1e-6, "{air}");
        let vacuum = Glass::AirAt(Air::VACUUM);
        assert!((vacuum.absolute_index_at(D_LINE_NM).unwrap() - 1.0).abs() < 1e-15);
        assert_eq!(Glass::AirAt(Air::CATALOGUE).index_at(500.0), Ok(1.0));
        assert_eq!(vacuum.describe(), "vacuum");
        let wrong = Glass::AirAt(Air { humidity: 1.5, ..Air::CATALOGUE });
        assert_eq!(wrong.check().unwrap_err().to_string(), "glass: humidity is 1.5, expected 0 to 1");
    }

    #[test]
    fn paper_law_falls_by_a_step_in_300_nm() {
        let glass = Glass::Linear { index: 1.65, reference_nm: 550.0, slope_per_nm: -0.04 / 300.0 };
        check(&glass, 400.0, 1.67);
        check(&glass, 700.0, 1.63);
    }

    #[test]
    fn table_is_linear_and_ends_where_it_ends() {
        let table = Glass::Tabulated { wavelengths_nm: vec![400.0, 500.0, 700.0], indices: vec![1.6, 1.5, 1.4] };
        check(&table, 450.0, 1.55);
        check(&table, 400.0, 1.6);
        check(&table, 700.0, 1.4);
        let message = table.index_at(399.0).unwrap_err().to_string();
        assert!(message.contains("from 400 to 700 nm, not at 399 nm"), "{message}");
        let point = Glass::Tabulated { wavelengths_nm: vec![550.0], indices: vec![1.6] };
        check(&point, 550.0, 1.6);
    }

    #[test]
    fn formulas_agree_where_they_say_the_same() {
        let sellmeier = Glass::Formula { formula: 2, coefficients: vec![0.0, 1.2, 0.01], range_nm: None };
        let squared = Glass::Formula { formula: 1, coefficients: vec![0.0, 1.2, 0.1], range_nm: None };
        let polynomial = Glass::Formula { formula: 3, coefficients: vec![2.25, 0.02, -2.0], range_nm: None };
        let cauchy = Glass::Formula { formula: 5, coefficients: vec![1.5, 0.005, -2.0], range_nm: None };
        check(&sellmeier, 550.0, squared.index_at(550.0).unwrap());
        check(&polynomial, 500.0, (2.25_f64 + 0.08).sqrt());
        check(&cauchy, 500.0, 1.52);
    }

    #[test]
    fn named_glass_is_that_of_the_catalogue() {
        let bk7 = Glass::Named("SCHOTT:N-BK7".to_owned());
        check(&bk7, D_LINE_NM, 1.51680);
        assert_eq!(bk7.range_nm(), Some((300.0, 2500.0)));
        let message = bk7.index_at(200.0).unwrap_err().to_string();
        assert!(message.starts_with("the glass SCHOTT:N-BK7 is known from 300"), "{message}");
        assert!(Glass::Named("F2".to_owned()).check().unwrap_err().to_string().contains("SCHOTT:F2"));
        assert!(Glass::Named("F2".to_owned()).index_at(550.0).is_err());
    }

    #[test]
    fn nonsense_is_refused() {
        let wrong = [
            Glass::Constant { index: f64::NAN },
            Glass::NdVd { nd: 1.5, vd: 0.0 },
            Glass::Formula { formula: 10, coefficients: vec![], range_nm: None },
            Glass::Sellmeier { b: vec![1.0], c_um2: vec![], range_nm: None },
            Glass::Tabulated { wavelengths_nm: vec![500.0, 400.0], indices: vec![1.5, 1.5] },
            Glass::Tabulated { wavelengths_nm: vec![], indices: vec![] },
        ];
        for glass in wrong {
            assert!(glass.check().is_err(), "{glass:?}");
        }
        assert!(Glass::Air.index_at(f64::NAN).is_err());
        assert!(Glass::Cauchy { a: 0.1, b_um2: -10.0 }.index_at(400.0).is_err());
    }
}
