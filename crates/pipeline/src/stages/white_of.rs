//! What is white in an irradiance on a film: by which light, and through which lens.

use std::path::Path;

use dioptric_scene::read_exr_text;
use dioptric_sensor::Layer;
use dioptric_spectrum::Illuminant;
use serde::{Serialize, de::DeserializeOwned};

use crate::PipelineError;

/// The attributes of a file of irradiance.
const LIGHT: &str = "illuminant";
const LENS: &str = "lens";

/// What a perfect white in the scene is on the film: what whoever develops a picture makes neutral.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WhiteOf {
    /// The light on the scene; `None` where it is not known.
    pub light: Option<Illuminant>,
    /// The lens before the film and the share of light on its axis that it lets through; `None` of one that loses none, or that is not known.
    pub lens: Option<Layer>,
}

impl WhiteOf {
    /// Returns it as attributes of text: name and RON.
    pub(super) fn texts(&self) -> Vec<(&'static str, String)> {
        let light = self.light.as_ref().and_then(|light| ron::to_string(light).ok()).map(|text| (LIGHT, text));
        let lens = self.lens.as_ref().and_then(|lens| ron::to_string(lens).ok()).map(|text| (LENS, text));
        light.into_iter().chain(lens).collect()
    }

    /// Reads it from the header of a spectral EXR, as those of a run state it.
    ///
    /// # Errors
    /// When the file cannot be read, or states a light or a lens that makes no sense.
    pub(super) fn read(path: &Path) -> Result<Self, PipelineError> {
        let (light, lens): (Option<Illuminant>, Option<Layer>) = (stated(path, LIGHT)?, stated(path, LENS)?);
        let wrong = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
        if let Some(light) = &light {
            light.check().map_err(|error| wrong(error.to_string()))?;
        }
        let shares = lens.iter().flat_map(|lens| lens.transmittance.values());
        match shares.copied().find(|share| !(0.0..=1.0).contains(share)) {
            Some(share) => {
                Err(wrong(format!("its lens lets {share} of the light through, expected shares from 0 to 1")))
            }
            None => Ok(Self { light, lens }),
        }
    }
}

fn stated<T: Serialize + DeserializeOwned>(path: &Path, name: &str) -> Result<Option<T>, PipelineError> {
    let Some(text) = read_exr_text(path, name)? else { return Ok(None) };
    let wrong = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
    ron::from_str(&text).map(Some).map_err(|error| wrong(format!("its {name}, '{text}', cannot be read: {error}")))
}
