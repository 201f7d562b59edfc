//! What a command line changes of the sensor's frames and of the picture.

use dioptric_sensor::{
    ColorCorrection, Demosaic, ExposureControl, Highlights, LensCorrections, LocalTone, NoiseSources, Processing,
};

use crate::{PipelineError, parse_white, with_analog_gain};

/// Changes to noise, gain and processing as words; what is `None` stays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorOptions {
    /// Sources of noise, as [`NoiseSources::parse`] has them.
    pub noise: Option<String>,
    /// The factor on the voltage after the pixel.
    pub analog_gain: Option<f64>,
    /// A white, as [`parse_white`](crate::parse_white) has it.
    pub white: Option<String>,
    /// A demosaic, as [`Demosaic::parse`] has it.
    pub demosaic: Option<String>,
    /// How much noise is taken out, 0 or more.
    pub denoise: Option<f64>,
    /// What becomes of highlights, as [`Highlights::parse`] has it.
    pub highlights: Option<String>,
    /// Aberrations of the lens that are undone, as [`LensCorrections::parse`] has them.
    pub lens_corrections: Option<String>,
    /// How channels become colors, as [`ColorCorrection::parse`] has it.
    pub color: Option<String>,
    /// The blur that is undone, pixels.
    pub sharpen_px: Option<f64>,
    /// Contrast between and within parts, as [`LocalTone::parse`] has it.
    pub local_tone: Option<String>,
}

impl SensorOptions {
    /// Changes what is asked for.
    ///
    /// # Errors
    /// Names the word that is not known, and those that are.
    pub fn apply(
        &self,
        noise: &mut NoiseSources,
        exposure: &mut ExposureControl,
        processing: &mut Processing,
    ) -> Result<(), PipelineError> {
        if let Some(list) = &self.noise {
            *noise = NoiseSources::parse(list)?;
        }
        if let Some(gain) = self.analog_gain {
            *exposure = with_analog_gain(*exposure, gain);
            exposure.check()?;
        }
        if let Some(white) = &self.white {
            processing.white = parse_white(white)?;
        }
        if let Some(method) = &self.demosaic {
            processing.demosaic = Demosaic::parse(method)?;
        }
        if self.denoise.is_some() {
            processing.denoise = self.denoise;
        }
        if let Some(kind) = &self.highlights {
            processing.highlights = Highlights::parse(kind)?;
        }
        if let Some(list) = &self.lens_corrections {
            processing.lens_corrections = LensCorrections::parse(list)?;
        }
        if let Some(kind) = &self.color {
            processing.color = ColorCorrection::parse(kind)?;
        }
        processing.sharpen_px = self.sharpen_px.unwrap_or(processing.sharpen_px);
        if let Some(tone) = &self.local_tone {
            processing.local_tone = LocalTone::parse(tone)?;
        }
        Ok(())
    }
}
