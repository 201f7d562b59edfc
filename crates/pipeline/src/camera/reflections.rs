//! What becomes of the light that surfaces of the lens reflect.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use crate::PipelineError;

/// What becomes of the light that surfaces of the lens reflect. Pictures lose it either way.
///
/// As a word it is `off` or `ghosts`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum LensReflections {
    /// It is left out.
    #[default]
    Off,
    /// What two surfaces reflect, once each, falls on the film: ghosts of what is bright, and veil.
    Ghosts,
}

impl fmt::Display for LensReflections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "off",
            Self::Ghosts => "ghosts",
        })
    }
}

impl FromStr for LensReflections {
    type Err = PipelineError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "off" => Ok(Self::Off),
            "ghosts" => Ok(Self::Ghosts),
            _ => {
                let reason = format!("found '{text}', expected off or ghosts");
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
        for reflections in [LensReflections::Off, LensReflections::Ghosts] {
            assert_eq!(reflections.to_string().parse::<LensReflections>().unwrap(), reflections);
        }
        assert!("all".parse::<LensReflections>().unwrap_err().to_string().contains("expected off or ghosts"));
    }
}
