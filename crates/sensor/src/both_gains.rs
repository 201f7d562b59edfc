//! Pixels that are read with both of their gains after one exposure: dual conversion gain in one frame, or a capacitor that takes what the
//! photodiode cannot hold (LOFIC).

use crate::{Electrons, Exposure, GainMode, Noise, Raw, Sensor, SensorError, Volts};

/// A read of an exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct GainRead {
    /// The voltages at the pixels' outputs.
    pub volts: Volts,
    /// The frame as the converter gives it.
    pub raw: Raw,
}

impl Sensor {
    /// Returns the electrons of one exposure as both gains read them: the high one, which holds as many as it can, then the low one. Each
    /// read has temporal noise of its own; the electrons with their shot noise and the fixed pattern are the same.
    ///
    /// `electrons` are those that the low gain holds ([`electrons`](Self::electrons) of an exposure in that mode).
    ///
    /// # Errors
    /// When the sensor states no high gain, or the exposure makes no sense.
    pub fn read_both_gains(
        &self,
        electrons: &Electrons,
        exposure: &Exposure,
        noise: &Noise,
    ) -> Result<[GainRead; 2], SensorError> {
        if self.high_gain.is_none() {
            let reason = format!("needs high_gain, which {} does not state", self.name);
            return Err(SensorError::Unsuitable { what: "a read with both gains", reason });
        }
        let read = |electrons: &Electrons, gain_mode: GainMode, noise: &Noise| -> Result<GainRead, SensorError> {
            let exposure = Exposure { gain_mode, ..*exposure };
            let volts = self.volts(electrons, &exposure, noise)?;
            let raw = self.digitize(&volts, &exposure)?;
            Ok(GainRead { volts, raw })
        };
        let well_e = self.full_well_e(GainMode::High) as f32;
        let held =
            Electrons { planes_e: electrons.planes_e.iter().map(|plane| plane.mapv(|e| e.min(well_e))).collect() };
        // An odd constant, far from those that tell frames and photodiodes apart.
        let second = Noise { seed: noise.seed ^ 0x3c6e_f372_fe94_f82b, ..*noise };
        Ok([read(&held, GainMode::High, noise)?, read(electrons, GainMode::Low, &second)?])
    }
}
