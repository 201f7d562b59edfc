//! What the channels of a sensor see of white light, and what light they saw.

use dioptric_spectrum::{Illuminant, WavelengthGrid};

use crate::Sensor;

/// Returns what each channel sees of a perfect white under a light, up to a common factor.
pub(crate) fn white_response(sensor: &Sensor, light: &Illuminant) -> Vec<f64> {
    let grid = fine_grid();
    let white = light.on_bands(&grid);
    color_weights(sensor, &grid).iter().map(|w| w.iter().zip(&white).map(|(w, s)| w * s).sum()).collect()
}

/// Returns, for each filter, the electrons of light before the lens that the colors are calibrated for, up to a factor common to all.
pub(crate) fn color_weights(sensor: &Sensor, grid: &WavelengthGrid) -> Vec<Vec<f64>> {
    let mut weights = sensor.electron_weights(grid);
    if let Some(lens) = &sensor.calibrated_behind {
        let transmittance = lens.transmittance.sample_held(grid);
        for list in &mut weights {
            list.iter_mut().zip(&transmittance).for_each(|(weight, share)| *weight *= share);
        }
    }
    weights
}

/// Returns the black body or daylight whose white the gains come nearest to making neutral, from 1800 to 15 000 K; D65 for
/// sensors of fewer than three channels.
pub(crate) fn light_of_gains(sensor: &Sensor, gains: &[f64]) -> Illuminant {
    if gains.len() < 3 {
        return Illuminant::D65;
    }
    let grid = fine_grid();
    let weights = color_weights(sensor, &grid);
    // How far from equal the balanced channels of a light are: the variance of their logarithms.
    let unevenness = |light: &Illuminant| {
        let white = light.on_bands(&grid);
        let signal = |w: &Vec<f64>| w.iter().zip(&white).map(|(w, s)| w * s).sum::<f64>();
        let logs: Vec<f64> = weights.iter().zip(gains).map(|(w, gain)| (signal(w) * gain).ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>()
    };
    // Steps of 5 mired, a little more than an eye tells apart.
    let lights = (14..=111).map(|i| Illuminant::of_temperature(1e6 / (5.0 * f64::from(i))));
    let scored = lights.map(|light| (unevenness(&light), light)).filter(|(score, _)| score.is_finite());
    scored.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(Illuminant::D65, |(_, light)| light)
}

/// The grid on which known spectra are integrated.
pub(crate) fn fine_grid() -> WavelengthGrid {
    WavelengthGrid::uniform(360.0, 830.0, 2.0).expect("a valid range")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layer;

    #[test]
    fn what_is_before_a_calibrated_sensor_is_part_of_white() {
        let sensor = Sensor::built_in("imx363").unwrap();
        let filter = crate::OpticalFilter::built_in("wratten-81a").unwrap();
        let lens = Layer { name: "lens".to_owned(), transmittance: filter.transmittance.clone() };
        let calibrated = Sensor { calibrated_behind: Some(lens), ..sensor.clone() };
        let grid = fine_grid();
        assert_eq!(calibrated.electron_weights(&grid), sensor.electron_weights(&grid));
        // As of the sensor whose light goes through the filter, to the finer steps in which its bands are averaged.
        let [found, behind] =
            [calibrated, sensor.behind(&[filter])].map(|sensor| white_response(&sensor, &Illuminant::D65));
        for (found, behind) in found.iter().zip(&behind) {
            assert!((found / behind - 1.0).abs() < 1e-4, "{found} {behind}");
        }
    }

    #[test]
    fn gains_tell_the_light_they_balance() {
        let sensor = Sensor::built_in("imx363").unwrap();
        for kelvin in [2500.0, 4000.0, 6500.0, 10_000.0] {
            let white = white_response(&sensor, &Illuminant::of_temperature(kelvin));
            let gains: Vec<f64> = white.iter().map(|signal| 1.0 / signal).collect();
            let found = light_of_gains(&sensor, &gains).color_temperature().kelvin;
            // Steps of 5 mired.
            assert!((1e6 / found - 1e6 / kelvin).abs() < 3.0, "{kelvin} K: {found} K");
        }
    }
}
