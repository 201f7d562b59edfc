//! How a scene is blurred.

use std::{fmt, str::FromStr};

use dioptric_psf::Diffraction;
use serde::{Deserialize, Serialize};

use super::check::Checker;
use crate::PipelineError;

/// How the point-spread functions are laid over the scene.
///
/// As a word it is `layered`, `pointwise` or `views:16`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum BlurSpec {
    /// In layers of depth, near ones hiding far ones.
    #[default]
    Layered,
    /// Each sample spread on its own, as in the paper.
    Pointwise,
    /// In layers of depth, through so many parts of the pupil (2 to 256) one after the other: right where what stands in front is narrower than
    /// the pupil, and as many times as slow. Previews have layers.
    Views(usize),
}

impl BlurSpec {
    /// Checks the number of views, and that the rest of the camera allows them.
    pub(crate) fn check(self, diffraction: Diffraction, checker: &Checker<'_>) -> Result<(), PipelineError> {
        let Self::Views(n) = self else { return Ok(()) };
        checker.count("Views", n, 2..=256)?;
        let with_views = |what: &str| format!("{what}, with views through parts of the pupil");
        if diffraction == Diffraction::Wave {
            return checker.wrong("diffraction", "Wave", &with_views("HURB or no diffraction"));
        }
        Ok(())
    }
}

impl fmt::Display for BlurSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Layered => f.write_str("layered"),
            Self::Pointwise => f.write_str("pointwise"),
            Self::Views(n) => write!(f, "views:{n}"),
        }
    }
}

impl FromStr for BlurSpec {
    type Err = PipelineError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let views = |text: &str| text.strip_prefix("views:")?.parse().ok().map(Self::Views);
        match text {
            "layered" => Ok(Self::Layered),
            "pointwise" => Ok(Self::Pointwise),
            _ => views(text).ok_or_else(|| {
                let reason = format!("found '{text}', expected layered, pointwise or views:N, as views:16");
                PipelineError::Unsuitable { what: "blur", reason }
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_they_are_written() {
        for blur in [BlurSpec::Layered, BlurSpec::Pointwise, BlurSpec::Views(16)] {
            assert_eq!(blur.to_string().parse::<BlurSpec>().unwrap(), blur);
        }
        for wrong in ["", "views", "views:", "views:-3", "Views(3)", "layers"] {
            let error = wrong.parse::<BlurSpec>().unwrap_err().to_string();
            assert!(error.contains("views:16"), "{error}");
        }
    }

    #[test]
    fn views_need_rays_of_their_own() {
        let check = |n, diffraction| {
            let checked = BlurSpec::Views(n).check(diffraction, &Checker::of_settings("a camera"));
            checked.map_err(|error| error.to_string())
        };
        let hurb = Diffraction::default();
        assert_eq!(check(2, hurb), Ok(()));
        assert!(check(1, hurb).unwrap_err().contains("2 to 256"));
        assert!(check(16, Diffraction::Wave).unwrap_err().contains("HURB or no diffraction"));
    }
}
