//! Filters before the lens as people name them.

use std::{
    fmt,
    path::{Path, PathBuf},
    str::FromStr,
};

use dioptric_optics::{Glass, GlassCatalogue};
use dioptric_sensor::OpticalFilter;
use serde::{Deserialize, Serialize};

use super::lens::is_path;
use crate::PipelineError;

/// The wavelengths of a plate of glass, nm: as far as both its index and its absorption are known.
const PLATE_NM: (f64, f64, f64) = (250.0, 2500.0, 2.0);

/// A filter before the lens.
///
/// As a word it is `wratten-25`, `mine.ron`, `nd:0.9`, `polarizer`, `polarizers:60`, `longpass:590nm`, `shortpass:650nm`, `bandpass:550nm:40nm` or
/// `glass:N-BK7:3mm`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum FilterSpec {
    /// A built-in filter by name.
    BuiltIn(String),
    /// A filter file.
    File(PathBuf),
    /// A neutral filter of an optical density D: 10^−D of the light passes.
    NeutralDensity(f64),
    /// An ideal polarizer, which passes half of the light: light has no polarization here.
    Polarizer,
    /// Two ideal polarizers whose axes are so many degrees apart.
    Polarizers(f64),
    /// An ideal edge that passes longer wavelengths than this, nm.
    LongPass(f64),
    /// An ideal edge that passes shorter wavelengths than this, nm.
    ShortPass(f64),
    /// An ideal band.
    BandPass {
        /// Its middle, nm.
        center_nm: f64,
        /// Its width, nm.
        width_nm: f64,
    },
    /// A plane plate of a glass of the catalogue: its absorption, and reflection at both surfaces.
    Glass {
        /// The glass, with its maker where the name alone is not enough: "SCHOTT:N-BK7".
        glass: String,
        /// How thick it is, mm.
        thickness_mm: f64,
    },
}

impl FilterSpec {
    /// How a filter is named by numbers.
    pub const PATTERNS: &str = "nd:DENSITY, polarizer, polarizers:DEGREES, longpass:NMnm, shortpass:NMnm, bandpass:CENTERnm:WIDTHnm, \
                                glass:NAME:THICKNESSmm";

    /// Returns the filter.
    ///
    /// # Errors
    /// When there is none of that name, its file cannot be read, a number makes no sense, or the absorption of a glass is not known.
    pub fn open(&self) -> Result<OpticalFilter, PipelineError> {
        Ok(match self {
            Self::BuiltIn(name) => OpticalFilter::built_in(name)?,
            Self::File(path) => OpticalFilter::read(path)?,
            Self::NeutralDensity(density) => OpticalFilter::neutral_density(*density)?,
            Self::Polarizer => OpticalFilter::polarizer(),
            Self::Polarizers(angle_deg) => OpticalFilter::polarizers(*angle_deg)?,
            Self::LongPass(edge_nm) => OpticalFilter::long_pass(*edge_nm)?,
            Self::ShortPass(edge_nm) => OpticalFilter::short_pass(*edge_nm)?,
            Self::BandPass { center_nm, width_nm } => OpticalFilter::band_pass(*center_nm, *width_nm)?,
            Self::Glass { glass, thickness_mm } => plate(glass, *thickness_mm)?,
        })
    }

    /// Returns the filters of a camera, opened.
    pub(crate) fn open_all(specs: &[Self]) -> Result<Vec<OpticalFilter>, PipelineError> {
        specs.iter().map(Self::open).collect()
    }

    /// The file that it is read from, to be named otherwise.
    pub fn file_mut(&mut self) -> Option<&mut PathBuf> {
        if let Self::File(path) = self { Some(path) } else { None }
    }
}

impl FromStr for FilterSpec {
    type Err = PipelineError;

    /// Reads a filter as it is named on the command line: by numbers, as a path where it looks like one or is one, else as a built-in name.
    fn from_str(text: &str) -> Result<Self, PipelineError> {
        let wrong = || PipelineError::Value {
            origin: "the command line".to_owned(),
            key: "--filter",
            found: format!("'{text}'"),
            expected: format!("the name of a built-in filter, a filter file, or {}", Self::PATTERNS),
        };
        let number = |part: &str, unit: &str| -> Result<f64, PipelineError> {
            part.strip_suffix(unit).and_then(|digits| digits.trim().parse().ok()).ok_or_else(wrong)
        };
        let parts: Vec<&str> = text.split(':').collect();
        Ok(match *parts.as_slice() {
            ["polarizer"] => Self::Polarizer,
            ["nd", density] => Self::NeutralDensity(number(density, "")?),
            ["polarizers", angle] => Self::Polarizers(number(angle, "")?),
            ["longpass", edge] => Self::LongPass(number(edge, "nm")?),
            ["shortpass", edge] => Self::ShortPass(number(edge, "nm")?),
            ["bandpass", center, width] => {
                Self::BandPass { center_nm: number(center, "nm")?, width_nm: number(width, "nm")? }
            }
            ["glass", .., thickness] if parts.len() > 2 => {
                Self::Glass { glass: parts[1..parts.len() - 1].join(":"), thickness_mm: number(thickness, "mm")? }
            }
            ["nd" | "polarizers" | "longpass" | "shortpass" | "bandpass" | "glass", ..] => return Err(wrong()),
            _ if is_path(text) => Self::File(PathBuf::from(text)),
            _ => Self::BuiltIn(text.to_owned()),
        })
    }
}

impl fmt::Display for FilterSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BuiltIn(name) => f.write_str(name),
            Self::File(path) => write!(f, "{}", path.display()),
            Self::NeutralDensity(density) => write!(f, "nd:{density}"),
            Self::Polarizer => f.write_str("polarizer"),
            Self::Polarizers(angle_deg) => write!(f, "polarizers:{angle_deg}"),
            Self::LongPass(edge_nm) => write!(f, "longpass:{edge_nm}nm"),
            Self::ShortPass(edge_nm) => write!(f, "shortpass:{edge_nm}nm"),
            Self::BandPass { center_nm, width_nm } => write!(f, "bandpass:{center_nm}nm:{width_nm}nm"),
            Self::Glass { glass, thickness_mm } => write!(f, "glass:{glass}:{thickness_mm}mm"),
        }
    }
}

/// Returns a plate of a glass of the catalogue at the wavelengths where all of it is known.
fn plate(glass: &str, thickness_mm: f64) -> Result<OpticalFilter, PipelineError> {
    let wrong = |key, found: String, expected: &str| PipelineError::Value {
        origin: "the filter".to_owned(),
        key,
        found,
        expected: expected.to_owned(),
    };
    if !(thickness_mm > 0.0 && thickness_mm.is_finite()) {
        return Err(wrong("thickness_mm", thickness_mm.to_string(), "a number above 0"));
    }
    let found = GlassCatalogue::built_in().find(glass)?;
    let named = Glass::Named(found.full_name());
    let (first_nm, last_nm, step_nm) = PLATE_NM;
    let n = ((last_nm - first_nm) / step_nm) as usize;
    let row = |i: usize| {
        let nm = first_nm + step_nm * i as f64;
        Some([nm, found.glass.index_at(nm).ok()?, named.internal_transmittance(nm, thickness_mm)?])
    };
    let rows: Vec<[f64; 3]> = (0..=n).filter_map(row).collect();
    if rows.is_empty() {
        return Err(wrong("glass", format!("'{glass}'"), "a glass whose absorption is in the catalogue"));
    }
    let name = format!("{thickness_mm} mm of {}", found.full_name());
    let source = "index and absorption of the glass catalogue, Fresnel's reflection at both surfaces".to_owned();
    Ok(OpticalFilter::plate(name, source, &rows)?)
}

/// Takes the paths of filters as relative to a folder; absolute ones stay.
pub(super) fn resolve_paths(filters: &mut [FilterSpec], folder: &Path) {
    for path in filters.iter_mut().filter_map(FilterSpec::file_mut) {
        *path = folder.join(&*path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_read_back() {
        for word in [
            "wratten-25",
            "nd:0.9",
            "polarizer",
            "polarizers:60",
            "longpass:590nm",
            "shortpass:650nm",
            "bandpass:550nm:40nm",
            "glass:SCHOTT:N-BK7:3mm",
            "glass:N-BK7:3mm",
            "folder/mine.ron",
        ] {
            assert_eq!(word.parse::<FilterSpec>().unwrap().to_string(), word);
        }
        assert_eq!("mine.ron".parse::<FilterSpec>().unwrap(), FilterSpec::File(PathBuf::from("mine.ron")));
        for wrong in ["nd", "nd:dark", "longpass:590", "bandpass:550nm", "glass:N-BK7", "glass:N-BK7:3"] {
            let message = wrong.parse::<FilterSpec>().unwrap_err().to_string();
            assert!(message.contains(wrong) && message.contains("bandpass:CENTERnm:WIDTHnm"), "{message}");
        }
    }

    #[test]
    fn plates_absorb_and_reflect() {
        let open = |word: &str| word.parse::<FilterSpec>().unwrap().open();
        let filter = open("glass:SCHOTT:N-BK7:10mm").unwrap();
        // N-BK7 at the d line: 2n / (n² + 1) = .919 of what 10 mm let through, .998 (the maker's data sheet at 580 nm).
        let found = filter.transmittance.at_held(587.5618);
        assert!((found - 0.919 * 0.998).abs() < 2e-3, "{found}");
        // A dense flint takes the violet: the absorption of twice the thickness is that of the single one squared.
        let [once, twice] = ["glass:N-SF6:10mm", "glass:N-SF6:20mm"].map(|word| {
            let index = Glass::Named("SCHOTT:N-SF6".to_owned()).index_at(400.0).unwrap();
            let (passed, r) =
                (open(word).unwrap().transmittance.at_held(400.0), ((index - 1.0) / (index + 1.0)).powi(2));
            // (1 − R)² τ / (1 − R² τ²) = T, solved for τ.
            let b = (1.0 - r).powi(2) / passed;
            (-b + (b * b + 4.0 * r * r).sqrt()) / (2.0 * r * r)
        });
        assert!(once < 0.9 && (twice / (once * once) - 1.0).abs() < 1e-9, "{once} {twice}");
        assert!(open("glass:N-BK7:-1mm").unwrap_err().to_string().contains("thickness_mm"));
        assert!(open("glass:unobtainium:1mm").unwrap_err().to_string().contains("unobtainium"));
    }
}
