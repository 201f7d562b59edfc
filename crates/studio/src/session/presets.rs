//! Cameras to start from.

use std::path::Path;

use dioptric_pipeline::{Camera, PipelineError};

/// A camera to start from.
#[derive(Clone, Debug, PartialEq)]
pub struct Preset {
    /// What it is called.
    pub name: &'static str,
    /// What it shows.
    pub words: &'static str,
    text: Option<&'static str>,
}

const PRESETS: [Preset; 4] = [
    Preset { name: "Demo", words: "a still life through a 50 mm double Gauss at f/4", text: None },
    Preset {
        name: "View camera",
        words: "the lens swung by 6°: the plane in focus runs across the table",
        text: Some(include_str!("../../data/swing.ron")),
    },
    Preset {
        name: "Phone at night",
        words: "4 lx of a lamp on small pixels: photon and read noise",
        text: Some(include_str!("../../data/night.ron")),
    },
    Preset {
        name: "Slanted edge",
        words: "a target whose sharpness the sensor bench measures",
        text: Some(include_str!("../../data/edge.ron")),
    },
];

/// The cameras to start from.
pub fn presets() -> &'static [Preset] {
    &PRESETS
}

impl Preset {
    /// The camera.
    ///
    /// # Errors
    /// Never; the files are held to by a test.
    pub fn camera(&self) -> Result<Camera, PipelineError> {
        match self.text {
            Some(text) => Camera::parse(text, Path::new("preset.ron")),
            None => Camera::demo(),
        }
    }
}

#[cfg(test)]
mod tests {
    use dioptric_pipeline::{KeptCamera, Quality, Silent};
    use dioptric_spectrum::Cancel;

    use super::*;

    #[test]
    fn every_preset_takes_a_picture() {
        for preset in presets() {
            let kept = KeptCamera::new(preset.camera().unwrap()).with_quality(Quality::Sketch);
            kept.check().unwrap();
            let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
            let codes = &capture.developed.picture.codes;
            assert!(codes.iter().sum::<f32>() > 0.03 * codes.len() as f32, "{} is dark", preset.name);
        }
    }
}
