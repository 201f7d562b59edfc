//! Lights and whites from the words of a command line.

use std::path::Path;

use dioptric_scene::{is_light_file, read_light};
use dioptric_sensor::WhiteBalance;
use dioptric_spectrum::Illuminant;

use crate::PipelineError;

/// Returns the light of a name (in any case), a temperature (`3200K`), a chromaticity (`0.46,0.414`) or a file: a table, whatever its name ends in,
/// whose two columns are wavelengths in nm and spectral power, or a light of `ISETCam` (`.mat`).
///
/// # Errors
/// When the text is none of these, or there can be no such light.
pub fn parse_illuminant(text: &str) -> Result<Illuminant, PipelineError> {
    let path = Path::new(text);
    if is_light_file(path) {
        return Ok(read_light(path)?);
    }
    Ok(Illuminant::parse(text)?)
}

/// Returns the white of a command line: a word of [`WhiteBalance::parse`], or the file of a light's spectrum.
///
/// # Errors
/// As [`WhiteBalance::parse`] and [`parse_illuminant`].
pub fn parse_white(text: &str) -> Result<WhiteBalance, PipelineError> {
    let path = Path::new(text);
    if is_light_file(path) {
        return Ok(WhiteBalance::Light(read_light(path)?));
    }
    Ok(WhiteBalance::parse(text)?)
}
