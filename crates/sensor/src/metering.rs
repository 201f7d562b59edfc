//! Automatic exposure.

use rayon::prelude::*;

use crate::{AutoExposure, ElectronRate, Exposure, ExposureControl, Metering, Sensor, SensorError};

impl Sensor {
    /// Returns the exposure that a control asks for, given the light.
    ///
    /// # Errors
    /// When a setting makes no sense, or there is no light to meter and no longest time to fall back on.
    pub fn expose(&self, rate: &ElectronRate, control: &ExposureControl) -> Result<Exposure, SensorError> {
        control.check()?;
        let exposure = match control {
            ExposureControl::Manual(exposure) => *exposure,
            ExposureControl::Auto(auto) => self.meter(rate, auto)?,
        };
        exposure.check().map(|()| exposure)
    }

    fn meter(&self, rate: &ElectronRate, auto: &AutoExposure) -> Result<Exposure, SensorError> {
        let exposure = Exposure { time_s: 0.0, ..auto.limit };
        let metered_e_per_s = rate.metered(auto.metering)?;
        let time_s = auto.target_fraction * self.saturation_e(&exposure) / metered_e_per_s;
        match time_s.min(auto.limit.time_s) {
            time_s if time_s.is_finite() => Ok(Exposure { time_s, ..exposure }),
            _ => Err(SensorError::Unsuitable {
                what: "the automatic exposure",
                reason: "finds no light to meter, and limit.time_s sets none".to_owned(),
            }),
        }
    }
}

impl ElectronRate {
    /// Returns the metered rate, electrons a second.
    ///
    /// # Errors
    /// When a percentile is not a number from 0 to 100.
    pub fn metered(&self, metering: Metering) -> Result<f64, SensorError> {
        metering.check()?;
        let planes = &self.planes_e_per_s;
        let n_pixels = planes.iter().map(|plane| plane.len()).sum::<usize>() as f64;
        Ok(match metering {
            // Rows are summed one by one and then in order, so that the sum is the same for any number of threads.
            Metering::Mean => planes.iter().map(|plane| weighted_sum(plane, |_, _| 1.0)).sum::<f64>() / n_pixels,
            Metering::CenterWeighted => {
                let (rows, columns) = planes[0].dim();
                let bell = |i: usize, n: usize| {
                    let x = ((i as f64 + 0.5) / n as f64 - 0.5) / 0.25;
                    (-0.5 * x * x).exp()
                };
                let total = |n: usize| (0..n).map(|i| bell(i, n)).sum::<f64>();
                let weight = total(rows) * total(columns) * planes.len() as f64;
                let weighted = |plane| weighted_sum(plane, |row, column| bell(row, rows) * bell(column, columns));
                planes.iter().map(weighted).sum::<f64>() / weight
            }
            Metering::Peak => f64::from(planes.iter().flatten().fold(0.0_f32, |peak, &v| peak.max(v))),
            Metering::Percentile(percent) => percentile(planes.iter().flatten().copied().collect(), percent),
        })
    }
}

fn weighted_sum(plane: &ndarray::Array2<f32>, weight: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
    let row_sum = |(row, values): (usize, ndarray::ArrayView1<'_, f32>)| -> f64 {
        values.iter().enumerate().map(|(column, &v)| f64::from(v) * weight(row, column)).sum()
    };
    let sums: Vec<f64> = plane.outer_iter().into_par_iter().enumerate().map(row_sum).collect();
    sums.iter().sum()
}

/// Returns the value that `percent` of all values do not exceed.
pub(crate) fn percentile(mut values: Vec<f32>, percent: f64) -> f64 {
    let last = values.len() - 1;
    let place = ((percent / 100.0 * last as f64).round() as usize).min(last);
    let (_, value, _) = values.select_nth_unstable_by(place, f32::total_cmp);
    f64::from(*value)
}
