//! What lies beyond the edges of a scene.

use std::{fmt, str::FromStr};

use dioptric_forward::Border;
use serde::{Deserialize, Serialize};

use crate::PipelineError;

/// What lies beyond the edges of a scene, for the blur of what the film sees near them. Points of the film that look beyond the scene stay dark.
///
/// As a word it is `hold`, `mirror` or `black`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum BorderSpec {
    /// The outermost samples go on.
    #[default]
    Hold,
    /// The scene is mirrored at its edges.
    Mirror,
    /// Darkness, which blur brings into the picture.
    Black,
}

impl From<BorderSpec> for Border {
    fn from(spec: BorderSpec) -> Self {
        match spec {
            BorderSpec::Hold => Self::Hold,
            BorderSpec::Mirror => Self::Mirror,
            BorderSpec::Black => Self::Black,
        }
    }
}

impl fmt::Display for BorderSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Hold => "hold",
            Self::Mirror => "mirror",
            Self::Black => "black",
        })
    }
}

impl FromStr for BorderSpec {
    type Err = PipelineError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "hold" => Ok(Self::Hold),
            "mirror" => Ok(Self::Mirror),
            "black" => Ok(Self::Black),
            _ => {
                let reason = format!("found '{text}', expected hold, mirror or black");
                Err(PipelineError::Unsuitable { what: "border", reason })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_they_are_written() {
        for border in [BorderSpec::Hold, BorderSpec::Mirror, BorderSpec::Black] {
            assert_eq!(border.to_string().parse::<BorderSpec>().unwrap(), border);
        }
        assert!("dark".parse::<BorderSpec>().unwrap_err().to_string().contains("hold, mirror or black"));
    }
}
