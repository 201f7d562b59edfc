//! Light from beyond a world, as a camera file or the command line says it.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use serde::{Deserialize, Serialize};

use crate::{PipelineError, parse_numbers};

/// Light from beyond a world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WorldSky {
    /// This radiance from all sides, W m⁻² sr⁻¹ nm⁻¹.
    Even(f64),
    /// A clear day: sun and sky.
    Day {
        /// How high the sun stands above the horizon, degrees.
        elevation_deg: f64,
        /// How far round it stands from the front of the world, to the right as seen from above, degrees.
        #[serde(default = "usual_azimuth")]
        azimuth_deg: f64,
        /// How hazy the air is: 2 very clear, 3 clear, 6 hazy.
        #[serde(default = "usual_turbidity")]
        turbidity: f64,
    },
    /// A picture of all directions, its columns by azimuth and its rows by height (EXR, HDR, PNG, JPEG, TIFF); linear sRGB of 1 is as bright
    /// as an even sky of 1.
    Picture(PathBuf),
}

impl FromStr for WorldSky {
    type Err = PipelineError;

    /// Reads `even:RADIANCE`, `day:ELEVATION,AZIMUTH,TURBIDITY`, of which the end may be left out, or the path of a picture.
    fn from_str(text: &str) -> Result<Self, PipelineError> {
        let wrong = || PipelineError::Value {
            origin: "the command line".to_owned(),
            key: "--sky",
            found: format!("'{text}'"),
            expected: "even:RADIANCE, day:ELEVATION,AZIMUTH,TURBIDITY or a picture".to_owned(),
        };
        let (word, rest) = text.split_once(':').unwrap_or((text, ""));
        let numbers = || if rest.is_empty() { Ok(Vec::new()) } else { parse_numbers("a sky", rest) };
        match word {
            "even" => match numbers()?.as_slice() {
                [] => Ok(Self::Even(1.0)),
                &[radiance] => Ok(Self::Even(radiance)),
                _ => Err(wrong()),
            },
            "day" => {
                let n = numbers()?;
                if n.len() > 3 {
                    return Err(wrong());
                }
                let at = |place: usize, usual: f64| n.get(place).copied().unwrap_or(usual);
                let (azimuth_deg, turbidity) = (at(1, usual_azimuth()), at(2, usual_turbidity()));
                Ok(Self::Day { elevation_deg: at(0, 45.0), azimuth_deg, turbidity })
            }
            _ if Path::new(text).extension().is_some() => Ok(Self::Picture(PathBuf::from(text))),
            _ => Err(wrong()),
        }
    }
}

fn usual_azimuth() -> f64 {
    30.0
}

fn usual_turbidity() -> f64 {
    3.0
}
