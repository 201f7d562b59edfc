//! Automatic exposure.

use rayon::prelude::*;

use crate::{AutoExposure, Binning, ElectronRate, Exposure, ExposureControl, Metering, Sensor, SensorError};

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
        let metered_e_per_s = match auto.metering {
            Metering::EachFilter(percent) => self.metered_by_filter(rate, percent)?,
            metering => rate.metered(metering)?,
        };
        // Of a pixel, where several are read as one.
        let n = exposure.binning.map_or(1, Binning::n) as f64;
        let saturation_e = self.as_read(&exposure)?.saturation_e(&exposure) / n;
        let time_s = auto.target_fraction * saturation_e / metered_e_per_s;
        match time_s.min(auto.limit.time_s) {
            time_s if time_s.is_finite() => Ok(Exposure { time_s, ..exposure }),
            _ => Err(SensorError::Unsuitable {
                what: "the automatic exposure",
                reason: "finds no light to meter, and limit.time_s sets none".to_owned(),
            }),
        }
    }
}

impl Sensor {
    /// Returns the largest rate of those that a share of each filter's pixels do not exceed, electrons a second.
    fn metered_by_filter(&self, rate: &ElectronRate, percent: f64) -> Result<f64, SensorError> {
        let names: Vec<&str> = self.filters.iter().map(|filter| filter.name.as_str()).collect();
        let Some(tile) = self.cfa.resolve(&self.name, &names)? else {
            return rate.metered(Metering::EachFilter(percent));
        };
        Metering::EachFilter(percent).check()?;
        let plane = &rate.planes_e_per_s[0];
        let of_filter = |filter: usize| {
            let own = plane.indexed_iter().filter(|((row, column), _)| tile.filter_at(*row, *column) == filter);
            let values: Vec<f32> = own.map(|(_, v)| *v).collect();
            if values.is_empty() { 0.0 } else { percentile(values, percent) }
        };
        Ok((0..names.len()).map(of_filter).fold(0.0, f64::max))
    }
}

impl ElectronRate {
    /// Returns the metered rate, electrons a second; each plane counts as a filter.
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
            Metering::EachFilter(percent) => {
                planes.iter().map(|plane| percentile(plane.iter().copied().collect(), percent)).fold(0.0, f64::max)
            }
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

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::Cfa;

    #[test]
    fn the_brightest_filter_decides_where_each_is_metered() {
        // One pixel in sixteen is of a filter that gets four times as much as the others.
        let mut sensor = Sensor::built_in("imx363").unwrap().with_size(40, 40);
        let row = |letters: &str| letters.chars().map(|letter| letter.to_string()).collect();
        sensor.cfa = Cfa::Mosaic(["BGGG", "GGGG", "GGGG", "GGGR"].map(row).to_vec());
        let plane = Array2::from_shape_fn((40, 40), |(r, c)| if r % 4 == 0 && c % 4 == 0 { 4000.0 } else { 1000.0 });
        let rate = ElectronRate { planes_e_per_s: vec![plane] };
        let time = |metering| {
            let control = ExposureControl::Auto(AutoExposure::new(metering, 0.9));
            sensor.expose(&rate, &control).unwrap().time_s
        };
        let by_all = time(Metering::Percentile(90.0));
        assert!((by_all / time(Metering::EachFilter(90.0)) - 4.0).abs() < 1e-6);
        for (word, metering) in [
            ("mean", Metering::Mean),
            ("Center", Metering::CenterWeighted),
            ("percentile:98.5", Metering::Percentile(98.5)),
            ("filters", Metering::EachFilter(99.0)),
        ] {
            assert_eq!(Metering::parse(word).unwrap(), metering);
        }
        for wrong in ["spot", "filters:x", "filters:101", "percentile:-1"] {
            assert!(Metering::parse(wrong).is_err(), "{wrong}");
        }
    }
}
