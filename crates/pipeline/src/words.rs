//! Exposures changed by the words of a command line.

use dioptric_sensor::{AutoExposure, Exposure, ExposureControl};

use crate::camera::automatic;

/// Returns the exposure with its time set by hand; gain and temperature stay.
pub fn with_exposure_s(control: ExposureControl, time_s: f64) -> ExposureControl {
    ExposureControl::Manual(Exposure { time_s, ..*control.shot() })
}

/// Returns the exposure metered: as it was where it was so before, else the usual one, just not saturating; gain and
/// temperature stay.
pub fn with_auto_exposure(control: ExposureControl) -> ExposureControl {
    match (control, automatic()) {
        (ExposureControl::Manual(exposure), ExposureControl::Auto(usual)) => {
            let limit = Exposure { time_s: usual.limit.time_s, ..exposure };
            ExposureControl::Auto(AutoExposure { limit, ..usual })
        }
        (control, _) => control,
    }
}

/// Returns the exposure with another analog gain; time and temperature stay.
pub fn with_analog_gain(control: ExposureControl, analog_gain: f64) -> ExposureControl {
    control.with_shot(|exposure| Exposure { analog_gain, ..exposure })
}
