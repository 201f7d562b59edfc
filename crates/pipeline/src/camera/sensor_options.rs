//! What a command line changes of the sensor's frames and of the picture.

use dioptric_sensor::{ExposureControl, NoiseSources, Processing};

use crate::{PictureOptions, PipelineError, with_analog_gain};

/// Changes to noise, gain and processing as words; what is `None` stays.
#[derive(Clone, Debug, Default)]
pub struct SensorOptions {
    /// Sources of noise, as [`NoiseSources::parse`] has them.
    pub noise: Option<String>,
    /// The factor on the voltage after the pixel.
    pub analog_gain: Option<f64>,
    /// Changes to the way from the raw frame to the picture.
    pub picture: PictureOptions,
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
        self.picture.apply(processing)
    }
}
