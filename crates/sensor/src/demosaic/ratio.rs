//! Directional interpolation on a logarithmic scale of light.
//!
//! On the scale asinh(v / s) differences of colors are their ratios where light is well above s, and their differences below,
//! where noise and black levels would make ratios wild (Lupton, Gunn & Szalay, "A modified magnitude system that produces
//! well-behaved magnitudes, colors, and errors even for low signal-to-noise ratio measurements", Astronomical Journal 118,
//! 1999). It takes samples below 0 as it does those above.

use ndarray::Array2;

use super::directional::{Mixing, demosaic_mixing};
use crate::Bayer;

/// Where the scale turns from straight to logarithmic, as a share of saturation: above the noise of most frames, and below most
/// of what is seen in a picture.
const SOFTNESS: f32 = 0.01;

/// Ratios change less from pixel to pixel than differences do: short means keep colored threads apart.
const MIXING: Mixing = Mixing { n_averaged: 3, exponent: 3 };

pub(super) fn demosaic(values: &Array2<f32>, bayer: Bayer, n_channels: usize) -> Vec<Array2<f32>> {
    let scaled = ndarray::Zip::from(values).par_map_collect(|&v| scaled(v));
    let mut channels = demosaic_mixing(&scaled, bayer, n_channels, MIXING);
    channels.iter_mut().for_each(|plane| plane.par_mapv_inplace(unscaled));
    channels
}

/// Returns asinh(v / s).
#[inline]
pub(super) fn scaled(v: f32) -> f32 {
    let x = v.abs() / SOFTNESS;
    (x + (x * x + 1.0).sqrt()).ln().copysign(v)
}

/// Returns s sinh(y).
#[inline]
pub(super) fn unscaled(y: f32) -> f32 {
    let e = y.exp();
    0.5 * SOFTNESS * (e - e.recip())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demosaic::directional;

    #[test]
    fn the_scale_leads_back() {
        for v in [-0.05, -1e-4, 0.0, 1e-4, 0.01, 0.3, 1.0, 1.6] {
            // Single precision of values of at most 6.
            assert!((unscaled(scaled(v)) - v).abs() <= 2e-6 * v.abs() + 1e-8, "{v}");
        }
    }

    #[test]
    fn edges_of_one_hue_are_sharper() {
        // Light that is the same but for brightness, in channels that are far from balanced.
        let bayer = Bayer { green: 1, in_even_rows: 0, in_odd_rows: 2, green_first: false };
        // An edge as wide as a good lens makes it.
        let distance_px = |r: usize, c: usize| (2.0 * r as f64 + 5.0 * c as f64 - 200.0) / 29.0_f64.sqrt();
        let brightness = |r: usize, c: usize| (0.1 + 0.8 / (1.0 + (distance_px(r, c) / 0.5).exp())) as f32;
        let levels = [1.0, 0.6, 0.25];
        let channel = |r: usize, c: usize| if bayer.is_green(r, c) { 1 } else { bayer.other_of_row(r) };
        let mosaic = Array2::from_shape_fn((48, 64), |(r, c)| levels[channel(r, c)] * brightness(r, c));
        let rms = |found: Vec<Array2<f32>>| {
            let squares = (0..3).flat_map(|k| {
                let plane = &found[k];
                plane.indexed_iter().map(move |((r, c), &v)| f64::from(v - levels[k] * brightness(r, c)).powi(2))
            });
            (squares.sum::<f64>() / (3.0 * 48.0 * 64.0)).sqrt()
        };
        let (ratios, differences) = (rms(demosaic(&mosaic, bayer, 3)), rms(directional::demosaic(&mosaic, bayer, 3)));
        assert!(ratios < 0.25 * differences, "{ratios} {differences}");
    }
}
