//! The built-in lenses.

use crate::{Lens, OpticsError, formats::lens_from_ron};

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

impl Lens {
    /// Returns the built-in lens of this name; [`built_in_names`](Self::built_in_names) lists them.
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

fn names() -> impl Iterator<Item = &'static str> {
    LENSES.iter().map(|(name, _)| *name)
}

fn built_in(name: &str) -> Result<Lens, OpticsError> {
    let Some((_, text)) = LENSES.iter().find(|(known, _)| *known == name) else {
        let known = format!("built in are {}", names().collect::<Vec<_>>().join(", "));
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
    fn unknown_name_lists_the_known_ones() {
        let message = built_in("none").unwrap_err().to_string();
        assert!(message.starts_with("no lens is named 'none'; built in are paper-2el"), "{message}");
    }
}
