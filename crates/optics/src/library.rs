//! The built-in lenses.

use crate::{Lens, OpticsError, prescription::lens_from_ron};

const LENSES: &[(&str, &str)] = &[
    ("paper-2el", include_str!("../data/lenses/paper-2el.ron")),
    ("dgauss-50mm", include_str!("../data/lenses/dgauss-50mm.ron")),
];

pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    LENSES.iter().map(|(name, _)| *name)
}

pub(crate) fn built_in(name: &str) -> Result<Lens, OpticsError> {
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
