//! The built-in lenses.

use crate::{Lens, LensFile, OpticsError, SchematicEye, formats::lens_from_ron};

/// Names the lenses whose files lie in `data/lenses`.
macro_rules! lenses {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../data/lenses/", $name, ".ron")))),*]
    };
}

const LENSES: &[(&str, &str)] = lenses![
    "paper-2el",
    "dgauss-50mm",
    "dgauss-50mm-schott",
    "canon-50mm",
    "tessar-50mm",
    "cooke-50mm",
    "singlet-50mm",
    "achromat-100mm",
    "asphere-15mm",
    "wide-100deg",
    "wide-6mm",
    "fisheye-12.5mm",
    "telephoto-127mm",
    "telephoto-250mm",
    "microscope-20x",
    "relay-1to1",
];

/// A lens that is named by its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IdealLens {
    /// An ideal thin lens, which is its own stop.
    Thin {
        /// Focal length, mm.
        focal_length_mm: f64,
        /// Diameter of its rim, mm.
        diameter_mm: f64,
    },
    /// A hole in a thin plane.
    Pinhole {
        /// Its diameter, mm.
        diameter_mm: f64,
    },
}

impl IdealLens {
    /// How these lenses are named.
    pub const PATTERNS: &str = "thin:FOCALmm:fN (thin:50mm:f2), thin:FOCALmm:DIAMETERmm (thin:50mm:25mm), \
                                pinhole:DIAMETERmm (pinhole:0.1mm)";

    /// Returns the lens of such a name; `None` for names of other kinds.
    ///
    /// # Errors
    /// When the name begins as these do and goes on otherwise.
    pub fn named(name: &str) -> Option<Result<Self, OpticsError>> {
        let (kind, numbers) = name.split_once(':').unwrap_or((name, ""));
        let millimetres = |text: &str| text.trim().strip_suffix("mm")?.trim_end().parse::<f64>().ok();
        let thin = || {
            let (focal, opening) = numbers.split_once(':')?;
            let focal_length_mm = millimetres(focal)?;
            let by_f_number = opening.trim().strip_prefix(['f', 'F']).map(|n| n.trim_start_matches('/').parse::<f64>());
            let diameter_mm = match by_f_number {
                Some(n) => focal_length_mm.abs() / n.ok()?,
                None => millimetres(opening)?,
            };
            Some(Self::Thin { focal_length_mm, diameter_mm })
        };
        let found = match kind {
            "thin" => thin(),
            "pinhole" => millimetres(numbers).map(|diameter_mm| Self::Pinhole { diameter_mm }),
            _ => return None,
        };
        let unknown = || {
            let known = format!("ideal lenses are named {}", Self::PATTERNS);
            OpticsError::Unknown { kind: "lens", name: name.to_owned(), known }
        };
        Some(found.ok_or_else(unknown))
    }

    fn lens(self) -> Result<Lens, OpticsError> {
        match self {
            Self::Thin { focal_length_mm, diameter_mm } => Lens::thin(focal_length_mm, diameter_mm),
            Self::Pinhole { diameter_mm } => Lens::pinhole(diameter_mm),
        }
    }
}

impl Lens {
    /// Returns the built-in lens of this name; [`built_in_names`](Self::built_in_names) lists those of glass,
    /// [`IdealLens::PATTERNS`] has those that are named by their numbers and [`SchematicEye::PATTERNS`] eyes.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn built_in(name: &str) -> Result<Self, OpticsError> {
        built_in(name)
    }

    /// The names of the built-in lenses.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        names()
    }
}

impl LensFile {
    /// Returns the built-in lens of this name, and how it is used: an eye with its retina for a film.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn built_in(name: &str) -> Result<Self, OpticsError> {
        match SchematicEye::named(name) {
            Some(eye) => eye?.file(),
            None => Ok(Self::from(built_in(name)?)),
        }
    }
}

fn names() -> impl Iterator<Item = &'static str> {
    LENSES.iter().map(|(name, _)| *name)
}

fn built_in(name: &str) -> Result<Lens, OpticsError> {
    if let Some(ideal) = IdealLens::named(name) {
        return ideal?.lens();
    }
    if let Some(eye) = SchematicEye::named(name) {
        return Ok(eye?.file()?.lens);
    }
    let Some((_, text)) = LENSES.iter().find(|(known, _)| *known == name) else {
        let names = names().collect::<Vec<_>>().join(", ");
        let known = format!("built in are {names}, {}, {}", IdealLens::PATTERNS, SchematicEye::PATTERNS);
        return Err(OpticsError::Unknown { kind: "lens", name: name.to_owned(), known });
    };
    lens_from_ron(text).map_err(|error| OpticsError::File {
        path: format!("built-in lens {name}").into(),
        line: error.line,
        reason: error.reason,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_lens_opens_under_its_name_and_focuses() {
        for name in names() {
            let lens = built_in(name).unwrap();
            assert_eq!(lens.name(), name);
            assert!(!lens.source().is_empty());
            let mono = lens.at(550.0).unwrap();
            assert!(mono.first_order().efl_mm > 0.0, "{name}");
        }
    }

    #[test]
    fn ideal_lenses_are_named_by_their_numbers() {
        let thin = |diameter_mm| IdealLens::Thin { focal_length_mm: 50.0, diameter_mm };
        for (name, ideal) in [
            ("thin:50mm:f2", thin(25.0)),
            ("thin:50mm:f/2.5", thin(20.0)),
            ("thin:50mm:12.5mm", thin(12.5)),
            ("pinhole:0.1mm", IdealLens::Pinhole { diameter_mm: 0.1 }),
        ] {
            assert_eq!(IdealLens::named(name).unwrap().unwrap(), ideal, "{name}");
        }
        let lens = built_in("thin:50mm:f2").unwrap().at(550.0).unwrap();
        assert!((lens.first_order().efl_mm - 50.0).abs() < 1e-12);
        assert!((lens.working_f_number(f64::INFINITY) - 2.0).abs() < 1e-9);
        for wrong in ["thin", "thin:50mm", "thin:50:f2", "thin:50mm:2", "pinhole:", "pinhole:1", "pinhole:1mm:2mm"] {
            let message = built_in(wrong).unwrap_err().to_string();
            assert!(message.contains("thin:50mm:f2") && message.contains("pinhole:0.1mm"), "{wrong}: {message}");
        }
        for wrong in ["thin:50mm:f0", "thin:50mm:-1mm", "pinhole:0mm", "thin:0mm:f2", "thin:infmm:f2", "thin:NaNmm:1mm"]
        {
            assert!(built_in(wrong).is_err(), "{wrong}");
        }
        assert!(IdealLens::named("thinner").is_none());
    }

    #[test]
    fn unknown_name_lists_the_known_ones() {
        let message = built_in("none").unwrap_err().to_string();
        assert!(message.starts_with("no lens is named 'none'; built in are paper-2el"), "{message}");
    }
}
