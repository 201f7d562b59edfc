//! The frames of the sensor: exposure, noise, conversion.

use std::borrow::Cow;

use dioptric_sensor::{ElectronRate, Exposure, Illumination, Moved, Sensor};

use super::{electrons::PixelRates, spec::ShutterInputs};
use crate::{DualPixelSpec, Exposed, FramesSpec, PipelineError, camera::at_rest};

/// What a sensor gives for one picture, and how it was exposed.
#[derive(Clone, Debug)]
pub struct FrameSet {
    /// The exposure, metered or given.
    pub exposure: Exposure,
    /// The electrons, volts and raw frame of the first exposure, and all exposures merged.
    pub exposed: Exposed,
}

/// The irradiance that a rate was collected from, needed where the camera moves between frames.
pub(crate) struct MovedLight<'a> {
    pub(crate) light: Illumination<'a>,
    /// Samples of the irradiance in a pixel of the full film, each way.
    pub(crate) samples_per_px: f64,
}

/// Exposes a sensor.
pub(crate) fn expose(
    inputs: &ShutterInputs,
    sensor: &Sensor,
    rate: &ElectronRate,
    moved: Option<&MovedLight<'_>>,
) -> Result<FrameSet, PipelineError> {
    let exposure = sensor.expose(rate, &inputs.exposure)?;
    let still = at_rest(rate);
    let exposed = match moved.filter(|_| inputs.moves()) {
        None => inputs.frames.expose(sensor, &still, &exposure, &inputs.noise)?,
        Some(MovedLight { light, samples_per_px }) => {
            let moved = |moved_px: [f64; 2]| -> Result<Cow<'_, ElectronRate>, PipelineError> {
                if moved_px == [0.0; 2] {
                    return Ok(Cow::Borrowed(rate));
                }
                let shift_px = moved_px.map(|px| px * samples_per_px);
                let irradiance = Moved { irradiance: light.irradiance, shift_px };
                Ok(Cow::Owned(sensor.electron_rate(&Illumination { irradiance: &irradiance, ..*light })?))
            };
            inputs.frames.expose(sensor, &moved, &exposure, &inputs.noise)?
        }
    };
    Ok(FrameSet { exposure, exposed })
}

/// Exposes a sensor whose photodiodes are read one by one.
pub(crate) fn expose_photodiodes(
    inputs: &ShutterInputs,
    sensor: &Sensor,
    spec: DualPixelSpec,
    rates: &PixelRates,
) -> Result<FrameSet, PipelineError> {
    let exposure = sensor.expose(&rates.whole, &inputs.exposure)?;
    let (frames, noise) = (&inputs.frames, &inputs.noise);
    let exposed = frames.expose_photodiodes(sensor, spec.photodiodes, &rates.photodiodes, &exposure, noise)?;
    Ok(FrameSet { exposure, exposed })
}

impl ShutterInputs {
    /// Whether the camera moves between frames.
    pub(crate) fn moves(&self) -> bool {
        matches!(self.frames, FramesSpec::MovingBurst { .. })
    }
}
