//! What becomes of the light that surfaces of the lens reflect.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use crate::PipelineError;

/// What becomes of the light that surfaces of the lens reflect. Pictures lose it either way.
///
/// As a word it is `off`, `ghosts` or `film:0.1`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum LensReflections {
    /// It is left out.
    #[default]
    Off,
    /// What two surfaces reflect, once each, falls on the film: ghosts of what is bright, and veil.
    Ghosts,
    /// That, and the film reflects this share of its light back to the lens, as a mirror does.
    Film(f64),
}

impl LensReflections {
    /// Returns the share that the film reflects, where light that surfaces reflect falls on it.
    pub fn film_reflectance(self) -> Option<f64> {
        match self {
            Self::Off => None,
            Self::Ghosts => Some(0.0),
            Self::Film(reflectance) => Some(reflectance),
        }
    }
}

impl fmt::Display for LensReflections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str("off"),
            Self::Ghosts => f.write_str("ghosts"),
            Self::Film(reflectance) => write!(f, "film:{reflectance}"),
        }
    }
}

impl FromStr for LensReflections {
    type Err = PipelineError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let reflectance = text.strip_prefix("film:").and_then(|share| share.parse().ok());
        match (text, reflectance) {
            ("off", _) => Ok(Self::Off),
            ("ghosts", _) => Ok(Self::Ghosts),
            (_, Some(reflectance)) if (0.0..=1.0).contains(&reflectance) => Ok(Self::Film(reflectance)),
            _ => {
                let reason = format!("found '{text}', expected off, ghosts or film:R, with R from 0 to 1");
                Err(PipelineError::Unsuitable { what: "lens_reflections", reason })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_they_are_written() {
        for reflections in [LensReflections::Off, LensReflections::Ghosts, LensReflections::Film(0.12)] {
            assert_eq!(reflections.to_string().parse::<LensReflections>().unwrap(), reflections);
        }
        for wrong in ["all", "film", "film:", "film:1.2", "film:nan"] {
            let message = wrong.parse::<LensReflections>().unwrap_err().to_string();
            assert!(message.contains("expected off, ghosts or film:R"), "{message}");
        }
    }
}
