//! What a command line changes of the sensor's frames and of the picture.

use dioptric_sensor::{Binning, Exposure, ExposureControl, GainMode, Metering, NoiseSources, Processing};

use crate::{PictureOptions, PipelineError, with_analog_gain};

/// Changes to noise, gain and processing as words; what is `None` stays.
#[derive(Clone, Debug, Default)]
pub struct SensorOptions {
    /// Sources of noise, as [`NoiseSources::parse`] has them.
    pub noise: Option<String>,
    /// The factor on the voltage after the pixel.
    pub analog_gain: Option<f64>,
    /// Which readout of a dual-gain pixel, as [`GainMode::parse`] has it.
    pub gain_mode: Option<String>,
    /// Pixels that are read as one, as [`Binning::parse`] has them.
    pub binning: Option<String>,
    /// The temperature of the chip, °C.
    pub temperature_c: Option<f64>,
    /// What an automatic exposure looks at, as [`Metering::parse`] has it.
    pub metering: Option<String>,
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
        if let Some(name) = &self.gain_mode {
            let gain_mode = GainMode::parse(name)?;
            *exposure = exposure.with_shot(|shot| Exposure { gain_mode, ..shot });
        }
        if let Some(word) = &self.binning {
            let binning = Binning::parse(word)?;
            *exposure = exposure.with_shot(|shot| Exposure { binning, ..shot });
        }
        if let Some(temperature_c) = self.temperature_c {
            *exposure = exposure.with_shot(|shot| Exposure { temperature_c, ..shot });
            exposure.check()?;
        }
        if let Some(word) = &self.metering {
            let metering = Metering::parse(word)?;
            match exposure {
                ExposureControl::Auto(auto) => auto.metering = metering,
                ExposureControl::Manual(_) => {
                    let reason = "is of an automatic exposure, but a time is given".to_owned();
                    return Err(PipelineError::Unsuitable { what: "the metering", reason });
                }
            }
        }
        self.picture.apply(processing)
    }
}
