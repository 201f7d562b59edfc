//! White balance.

use dioptric_spectrum::{Illuminant, WavelengthGrid};
use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{Sensor, Tile, metering::percentile};

/// How the channels are weighed so that white is neutral.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum WhiteBalance {
    /// Not at all.
    None,
    /// The mean of the picture is taken to be grey.
    GreyWorld,
    /// The brightest parts of the picture, up to this percentile of each channel, are taken to be white.
    WhitePatch {
        /// 0–100 %; 99 leaves highlights out.
        percentile: f64,
    },
    /// The light on the scene is known.
    Illuminant(Illuminant),
    /// A factor a channel.
    Gains(Vec<f64>),
}

/// Returns the factor of each channel; the smallest is 1, so that what is saturated stays so.
pub(crate) fn gains(sensor: &Sensor, planes: &[Array2<f32>], tile: Option<&Tile>, balance: &WhiteBalance) -> Vec<f64> {
    let n_channels = sensor.filters.len();
    let channels = |statistic: &(dyn Fn(Vec<f32>) -> f64 + Sync)| -> Vec<f64> {
        (0..n_channels).into_par_iter().map(|channel| statistic(samples_of(planes, tile, channel))).collect()
    };
    let signals = match balance {
        WhiteBalance::None => return vec![1.0; n_channels],
        WhiteBalance::Gains(gains) => return gains.clone(),
        WhiteBalance::GreyWorld => channels(&|values| {
            let n = values.len().max(1) as f64;
            values.iter().map(|&v| f64::from(v)).sum::<f64>() / n
        }),
        WhiteBalance::WhitePatch { percentile: percent } => {
            channels(&|values| if values.is_empty() { 0.0 } else { percentile(values, *percent) })
        }
        WhiteBalance::Illuminant(light) => white_response(sensor, *light),
    };
    // A channel that sees nothing cannot be balanced: it is left as it is.
    let brightest = signals.iter().copied().fold(0.0, f64::max);
    signals.iter().map(|&signal| if signal > 0.0 { brightest / signal } else { 1.0 }).collect()
}

/// Returns what each channel sees of a perfect white under a light, up to a common factor.
pub(crate) fn white_response(sensor: &Sensor, light: Illuminant) -> Vec<f64> {
    let grid = fine_grid();
    let white = light.spectrum().sample_held(&grid);
    sensor.electron_weights(&grid).iter().map(|w| w.iter().zip(&white).map(|(w, s)| w * s).sum()).collect()
}

/// The grid on which known spectra are integrated.
pub(crate) fn fine_grid() -> WavelengthGrid {
    WavelengthGrid::uniform(360.0, 830.0, 2.0).expect("a valid range")
}

/// Returns the samples of one channel.
fn samples_of(planes: &[Array2<f32>], tile: Option<&Tile>, channel: usize) -> Vec<f32> {
    match tile {
        None => planes[channel].iter().copied().collect(),
        Some(tile) => planes[0]
            .outer_iter()
            .enumerate()
            .flat_map(|(row, values)| {
                let filters = tile.row(row);
                let own = move |(column, &value): (usize, &f32)| {
                    (filters[column % filters.len()] == channel).then_some(value)
                };
                values.to_vec().into_iter().enumerate().filter_map(move |(column, value)| own((column, &value)))
            })
            .collect(),
    }
}
