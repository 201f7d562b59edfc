//! The frames of the sensor: exposure, noise, conversion.

use dioptric_sensor::{ElectronRate, Exposure, Sensor};

use super::spec::ShutterInputs;
use crate::{Exposed, PipelineError};

/// What a sensor gives for one picture, and how it was exposed.
#[derive(Clone, Debug)]
pub struct FrameSet {
    /// The exposure, metered or given.
    pub exposure: Exposure,
    /// The electrons, volts and raw frame of the first exposure, and all exposures merged.
    pub exposed: Exposed,
}

pub(crate) fn expose(inputs: &ShutterInputs, sensor: &Sensor, rate: &ElectronRate) -> Result<FrameSet, PipelineError> {
    let exposure = sensor.expose(rate, &inputs.exposure)?;
    let exposed = inputs.frames.expose(sensor, rate, &exposure, &inputs.noise)?;
    Ok(FrameSet { exposure, exposed })
}
