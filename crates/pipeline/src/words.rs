//! Exposures changed by the words of a command line.

use dioptric_sensor::{AutoExposure, Exposure, ExposureControl};

use crate::camera::automatic;

/// Returns the exposure with its time set by hand; gain and temperature stay.
pub fn with_exposure_s(control: ExposureControl, time_s: f64) -> ExposureControl {
    ExposureControl::Manual(match control {
        ExposureControl::Manual(exposure) => Exposure { time_s, ..exposure },
        ExposureControl::Auto(auto) => Exposure { time_s, ..auto.limit },
    })
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
    with_shot(control, |exposure| Exposure { analog_gain, ..exposure })
}

/// Returns an exposure whose shot is changed; its time stays that of the hand or the longest.
pub(crate) fn with_shot(control: ExposureControl, change: impl FnOnce(Exposure) -> Exposure) -> ExposureControl {
    match control {
        ExposureControl::Manual(exposure) => ExposureControl::Manual(change(exposure)),
        ExposureControl::Auto(auto) => ExposureControl::Auto(AutoExposure { limit: change(auto.limit), ..auto }),
    }
}
