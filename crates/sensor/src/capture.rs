//! All stages of a sensor in one call.

use crate::{ElectronRate, Electrons, Exposure, ExposureControl, Illumination, Noise, Raw, Sensor, SensorError, Volts};

/// The frames of every stage of one shot.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// The mean rate of photo-electrons.
    pub rate: ElectronRate,
    /// The exposure, metered or given.
    pub exposure: Exposure,
    /// The electrons at the end of the exposure.
    pub electrons: Electrons,
    /// The voltages at the pixels' outputs, before the analog gain.
    pub volts: Volts,
    /// The frame as the converter gives it.
    pub raw: Raw,
}

impl Sensor {
    /// Returns the frames of every stage, from light to raw.
    ///
    /// # Errors
    /// As the stages: [`electron_rate`](Self::electron_rate), [`expose`](Self::expose), [`electrons`](Self::electrons),
    /// [`volts`](Self::volts), [`digitize`](Self::digitize).
    pub fn capture(
        &self,
        light: &Illumination<'_>,
        control: &ExposureControl,
        noise: &Noise,
    ) -> Result<Capture, SensorError> {
        let rate = self.electron_rate(light)?;
        let exposure = self.expose(&rate, control)?;
        let electrons = self.electrons(&rate, &exposure, noise)?;
        let volts = self.volts(&electrons, &exposure, noise)?;
        let raw = self.digitize(&volts, &exposure)?;
        let (electrons, volts) = (self.lit_electrons(electrons), self.lit_volts(volts, &exposure)?);
        Ok(Capture { rate, exposure, electrons, volts, raw })
    }
}
