//! What a command line changes of the way from the raw frame to the picture.

use dioptric_sensor::{
    Brightness, ColorCorrection, ColorSpace, Demosaic, Highlights, LensCorrections, LocalTone, Perspective, Processing,
    ToneCurve,
};

use crate::{PipelineError, parse_white};

/// Changes to the processing as words; what is `None` stays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureOptions {
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
    /// The part that is stretched to the whole picture, as [`Perspective::parse`] has it.
    pub perspective: Option<String>,
    /// How bright the picture is made, as [`Brightness::parse`] has it.
    pub brightness: Option<String>,
    /// The curve from light to codes, as [`ToneCurve::parse`] has it.
    pub curve: Option<String>,
    /// The primaries of the picture, as [`ColorSpace::parse`] has them.
    pub space: Option<String>,
    /// How far a lone pixel is off before it is replaced, a share of saturation.
    pub defect_threshold: Option<f64>,
}

impl PictureOptions {
    /// Changes what is asked for.
    ///
    /// # Errors
    /// Names the word that is not known, and those that are.
    pub fn apply(&self, processing: &mut Processing) -> Result<(), PipelineError> {
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
        if let Some(corners) = &self.perspective {
            processing.perspective = Some(Perspective::parse(corners)?);
        }
        if let Some(text) = &self.brightness {
            processing.brightness = Brightness::parse(text)?;
        }
        if let Some(text) = &self.curve {
            processing.curve = ToneCurve::parse(text)?;
        }
        if let Some(name) = &self.space {
            processing.space = ColorSpace::parse(name)?;
        }
        if self.defect_threshold.is_some() {
            processing.defect_threshold = self.defect_threshold;
        }
        Ok(())
    }
}
