//! White balance.

use dioptric_spectrum::Illuminant;
use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{Demosaic, SensorError, Tile, blur::gaussian_blur, demosaic, metering::percentile, profile::CameraProfile};

/// What is made white.
///
/// The statistics leave out samples from 99 % of saturation on, of which the color is not known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum WhiteBalance {
    /// The light on the scene; the mean of the picture where that is not known.
    #[default]
    Scene,
    /// This light.
    #[serde(alias = "Illuminant")]
    Light(Illuminant),
    /// Nothing: channels are shown as they are.
    None,
    /// The mean of the picture is taken to be gray (Buchsbaum 1980).
    #[serde(alias = "GreyWorld")]
    GrayWorld,
    /// The brightest parts of the picture, up to this percentile of each channel, are taken to be white (Land 1977).
    WhitePatch {
        /// 0–100 %; 99 leaves highlights out.
        percentile: f64,
    },
    /// The power mean of the picture is taken to be gray, 1 being the gray world and infinity the white patch
    /// (Finlayson & Trezzi, "Shades of gray and color constancy", Color Imaging Conference 2004, who find 6 best).
    ShadesOfGray {
        /// The exponent, 1 or more.
        exponent: f64,
    },
    /// The power mean of the differences between neighbors is taken to be gray (van de Weijer, Gevers & Gijsenij,
    /// "Edge-based color constancy", IEEE Transactions on Image Processing 16, 2007).
    GrayEdge {
        /// The exponent, 1 or more.
        exponent: f64,
        /// The standard deviation of the Gaussian that smooths the picture before, pixels.
        sigma_px: f64,
    },
    /// This part of the picture is gray.
    Patch {
        /// The first column.
        left: usize,
        /// The first row.
        top: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A factor a channel.
    Gains(Vec<f64>),
}

/// Samples from here on may be saturated.
const UNSATURATED: f32 = 0.99;

impl WhiteBalance {
    /// The words that [`parse`](Self::parse) takes.
    pub const WORDS: &'static str = "scene, none, gray-world, white-patch, shades-of-gray, gray-edge, patch:X,Y,W,H, a light \
                                     (A, D65, FL2 ...), a temperature (3200K) or a chromaticity (0.46,0.414)";

    /// Returns the white of a command line.
    ///
    /// # Errors
    /// When the text is none of [`WORDS`](Self::WORDS).
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        let patch = |numbers: &str| {
            let numbers: Vec<usize> = numbers.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
            let [left, top, width, height] = numbers.try_into().ok()?;
            Some(Self::Patch { left, top, width, height })
        };
        let word = text.to_ascii_lowercase();
        Ok(match (word.as_str(), word.strip_prefix("patch:").and_then(patch)) {
            (_, Some(patch)) => patch,
            ("scene", _) => Self::Scene,
            ("none", _) => Self::None,
            ("gray-world" | "grey-world", _) => Self::GrayWorld,
            ("white-patch", _) => Self::WhitePatch { percentile: 99.0 },
            ("shades-of-gray" | "shades-of-grey", _) => Self::ShadesOfGray { exponent: 6.0 },
            ("gray-edge" | "grey-edge", _) => Self::GrayEdge { exponent: 6.0, sigma_px: 1.0 },
            _ => match Illuminant::parse(text) {
                Ok(light) => Self::Light(light),
                Err(error @ dioptric_spectrum::SpectrumError::Light { .. }) => return Err(error.into()),
                Err(_) => {
                    let expected = Self::WORDS.to_owned();
                    return Err(SensorError::Word { what: "a white", found: text.to_owned(), expected });
                }
            },
        })
    }

    pub(crate) fn check(&self, n_channels: usize) -> Result<(), SensorError> {
        let wrong = |key, value, expected| Err(SensorError::value("the processing", key, value, expected));
        match self {
            Self::Light(light) => Ok(light.check()?),
            Self::Gains(gains) if gains.len() != n_channels => {
                let (expected, found) = (n_channels.to_string(), gains.len().to_string());
                Err(SensorError::Shape { what: "white balance gains", expected, found })
            }
            Self::Gains(gains) => match gains.iter().find(|&&g| !(g > 0.0 && g.is_finite())) {
                Some(&gain) => wrong("white.gains", gain, "a number above 0"),
                None => Ok(()),
            },
            Self::WhitePatch { percentile } if !(0.0..=100.0).contains(percentile) => {
                wrong("white.percentile", *percentile, "a number from 0 to 100")
            }
            Self::ShadesOfGray { exponent } | Self::GrayEdge { exponent, .. } if !(1.0..=1000.0).contains(exponent) => {
                wrong("white.exponent", *exponent, "a number from 1 to 1000")
            }
            Self::GrayEdge { sigma_px, .. } if !(*sigma_px > 0.0 && *sigma_px <= 1000.0) => {
                wrong("white.sigma_px", *sigma_px, "a number above 0, at most 1000")
            }
            _ => Ok(()),
        }
    }
}

/// Returns the factor of each channel; the smallest is 1, so that what is saturated stays so.
///
/// # Errors
/// When a patch lies outside the frame or sees nothing of a channel, or the frame is too small for differences.
pub(crate) fn gains(
    camera: &dyn CameraProfile,
    planes: &[Array2<f32>],
    tile: Option<&Tile>,
    white: &WhiteBalance,
) -> Result<Vec<f64>, SensorError> {
    let n_channels = camera.n_channels();
    let channels = |statistic: &(dyn Fn(Vec<f32>) -> f64 + Sync)| -> Vec<f64> {
        (0..n_channels).into_par_iter().map(|channel| statistic(samples_of(planes, tile, channel))).collect()
    };
    let signals = match white {
        WhiteBalance::None => return Ok(vec![1.0; n_channels]),
        WhiteBalance::Gains(gains) => return Ok(gains.clone()),
        WhiteBalance::Scene | WhiteBalance::GrayWorld => channels(&|values| power_mean(values, 1.0)),
        WhiteBalance::WhitePatch { percentile: percent } => {
            channels(&|values| if values.is_empty() { 0.0 } else { percentile(values, *percent) })
        }
        WhiteBalance::ShadesOfGray { exponent } => channels(&|values| power_mean(values, *exponent)),
        WhiteBalance::GrayEdge { exponent, sigma_px } => {
            let whole = match tile {
                Some(tile) => demosaic(&planes[0], tile, n_channels, Demosaic::Bilinear)?,
                None => planes.to_vec(),
            };
            whole.iter().map(|plane| edge_mean(plane, *exponent, *sigma_px)).collect()
        }
        &WhiteBalance::Patch { left, top, width, height } => {
            let (rows, columns) = planes[0].dim();
            let is_inside = |first: usize, n: usize, all: usize| n > 0 && first < all && n <= all - first;
            if !is_inside(top, height, rows) || !is_inside(left, width, columns) {
                let (expected, found) =
                    (format!("within {columns} × {rows}"), format!("{left},{top} of {width} × {height}"));
                return Err(SensorError::Shape { what: "the patch that is made white", expected, found });
            }
            let means = patch_means(planes, tile, n_channels, (left, top, width, height));
            if let Some(channel) = means.iter().position(|mean| mean.is_nan() || *mean <= 0.0) {
                let reason = format!("sees no unsaturated light through {}", camera.filter_name(channel));
                return Err(SensorError::Unsuitable { what: "the patch that is made white", reason });
            }
            means
        }
        WhiteBalance::Light(light) => camera.white_response(light),
    };
    // A channel that sees nothing cannot be balanced: it is left as it is.
    let brightest = signals.iter().copied().fold(0.0, f64::max);
    Ok(signals.iter().map(|&signal| if signal > 0.0 { brightest / signal } else { 1.0 }).collect())
}

/// Returns the power mean of the samples below saturation, those below 0 counting as 0.
fn power_mean(values: Vec<f32>, exponent: f64) -> f64 {
    let power = |v: f32| if exponent == 1.0 { f64::from(v) } else { f64::from(v.max(0.0)).powf(exponent) };
    let (sum, n) =
        values.iter().filter(|v| **v < UNSATURATED).fold((0.0, 0.0), |(sum, n), &v| (sum + power(v), n + 1.0));
    if n > 0.0 { (sum / n).max(0.0).powf(1.0 / exponent) } else { 0.0 }
}

/// Returns the power mean of the slopes of a smoothed plane, away from what is saturated.
fn edge_mean(plane: &Array2<f32>, exponent: f64, sigma_px: f64) -> f64 {
    let smooth = gaussian_blur(plane, sigma_px);
    let (rows, columns) = smooth.dim();
    let row_sum = |row: usize| -> (f64, f64) {
        (1..columns.saturating_sub(1)).fold((0.0, 0.0), |(sum, n), column| {
            if plane[(row, column)] >= UNSATURATED {
                return (sum, n);
            }
            let across = f64::from(smooth[(row, column + 1)] - smooth[(row, column - 1)]);
            let down = f64::from(smooth[(row + 1, column)] - smooth[(row - 1, column)]);
            (sum + across.hypot(down).powf(exponent), n + 1.0)
        })
    };
    // Rows are summed one by one and then in order, so that the sum is the same for any number of threads.
    let sums: Vec<(f64, f64)> = (1..rows.saturating_sub(1)).into_par_iter().map(row_sum).collect();
    let (sum, n) = sums.iter().fold((0.0, 0.0), |(sum, n), row| (sum + row.0, n + row.1));
    if n > 0.0 { (sum / n).powf(1.0 / exponent) } else { 0.0 }
}

/// Returns the mean of each channel over a part of the frame: left, top, width, height.
fn patch_means(
    planes: &[Array2<f32>],
    tile: Option<&Tile>,
    n_channels: usize,
    (left, top, width, height): (usize, usize, usize, usize),
) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); n_channels];
    for (number, plane) in planes.iter().enumerate() {
        for row in top..top + height {
            for column in left..left + width {
                let value = plane[(row, column)];
                if value < UNSATURATED {
                    let (sum, n) = &mut sums[tile.map_or(number, |tile| tile.filter_at(row, column))];
                    (*sum, *n) = (*sum + f64::from(value), *n + 1.0);
                }
            }
        }
    }
    sums.into_iter().map(|(sum, n)| sum / n).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_name_whites() {
        for (text, white) in [
            ("scene", WhiteBalance::Scene),
            ("Gray-World", WhiteBalance::GrayWorld),
            ("patch:3,4, 5,6", WhiteBalance::Patch { left: 3, top: 4, width: 5, height: 6 }),
            ("fl2", WhiteBalance::Light(Illuminant::Fl2)),
            ("3200K", WhiteBalance::Light(Illuminant::Blackbody(3200.0))),
            ("0.46,0.414", WhiteBalance::Light(Illuminant::Chromaticity { x: 0.46, y: 0.414 })),
        ] {
            assert_eq!(WhiteBalance::parse(text).unwrap(), white, "{text}");
        }
        for (wrong, word) in [("patch:1,2,3", "gray-edge"), ("sunny", "gray-edge"), ("0.9,0.4", "whitish")] {
            assert!(WhiteBalance::parse(wrong).unwrap_err().to_string().contains(word), "{wrong}");
        }
    }
}
