//! Frames whose rows are exposed for a long and a short time, or read with a high and a low gain, in turn, and their merge.

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    ElectronRate, Electrons, Exposure, Levels, MergedFrame, Noise, Raw, RawPlane, Sensor, SensorError, Tile, Volts,
    hdr::USABLE_BELOW,
};

/// Rows of two exposures in turn: some rows of the time and gain of the exposure, then as many of a part of one, or of both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Interleaved {
    /// The time of the long rows, which is that of the exposure, over the time of the short ones; 1 or more.
    pub ratio: f64,
    /// How many neighboring rows share a time; a multiple of the rows after which the mosaic repeats.
    pub period_rows: usize,
    /// The analog gain of the long rows, which is that of the exposure, over the gain of the short ones; 1 or more, and above 1 where
    /// the times are equal.
    #[serde(default = "same_gain")]
    pub gain_ratio: f64,
}

fn same_gain() -> f64 {
    1.0
}

impl Interleaved {
    /// Whether a row has the whole time and gain; row 0 has.
    pub fn is_long(&self, row: usize) -> bool {
        (row / self.period_rows).is_multiple_of(2)
    }

    /// Returns the exposure of the short rows.
    pub fn short(&self, long: &Exposure) -> Exposure {
        let (time_s, analog_gain) = (long.time_s / self.ratio, long.analog_gain / self.gain_ratio);
        Exposure { time_s, analog_gain, ..*long }
    }

    /// Checks that the numbers make sense for a mosaic.
    ///
    /// # Errors
    /// When the ratios are below 1 or both 1, or some filter would be found in rows of one kind alone.
    pub fn check(&self, tile: Option<&Tile>) -> Result<(), SensorError> {
        let wrong = |key, value, expected| Err(SensorError::value("the interleaved rows", key, value, expected));
        if !(self.gain_ratio >= 1.0 && self.gain_ratio.is_finite()) {
            return wrong("gain_ratio", self.gain_ratio, "1 or more");
        }
        if !(self.ratio >= 1.0 && self.ratio.is_finite()) || self.ratio * self.gain_ratio <= 1.0 {
            return wrong("ratio", self.ratio, "a number above 1, or 1 where gain_ratio is above it");
        }
        if self.period_rows == 0 || !self.period_rows.is_multiple_of(tile.map_or(1, Tile::rows)) {
            let expected = "a multiple, 1 or more, of the rows after which the mosaic repeats";
            return wrong("period_rows", self.period_rows as f64, expected);
        }
        Ok(())
    }

    /// Returns the nearest rows of the other time and the same filters, above and below.
    fn neighbors(&self, row: usize, tile_rows: usize, n_rows: usize) -> [Option<usize>; 2] {
        let is_other = |other: &usize| self.is_long(*other) != self.is_long(row);
        let steps = || (1..=self.period_rows / tile_rows).map(|step| step * tile_rows);
        let above = steps().filter_map(|step| row.checked_sub(step)).find(is_other);
        let below = steps().map(|step| row + step).filter(|&other| other < n_rows).find(is_other);
        [above, below]
    }
}

impl Sensor {
    /// Returns the electrons of a frame whose rows have two times in turn.
    ///
    /// # Errors
    /// When the exposure or the rows make no sense.
    pub fn electrons_interleaved(
        &self,
        rate: &ElectronRate,
        exposure: &Exposure,
        rows: &Interleaved,
        noise: &Noise,
    ) -> Result<Electrons, SensorError> {
        exposure.check_single("rows of two exposures")?;
        self.check_all_lit("rows of two exposures")?;
        rows.check(self.tile()?.as_ref())?;
        self.electrons_by_row(rate, &[*exposure, rows.short(exposure)], &|row| usize::from(!rows.is_long(row)), noise)
    }

    /// Returns the frame as the converter gives it where rows have two gains in turn. Its levels are those of the long rows.
    ///
    /// # Errors
    /// When the sensor, the exposure or the rows make no sense.
    pub fn digitize_interleaved(
        &self,
        volts: &Volts,
        exposure: &Exposure,
        rows: &Interleaved,
    ) -> Result<Raw, SensorError> {
        exposure.check_single("rows of two exposures")?;
        rows.check(self.tile()?.as_ref())?;
        self.digitize_by_row(volts, &[*exposure, rows.short(exposure)], &|row| usize::from(!rows.is_long(row)))
    }

    /// Merges the rows of two times into one frame of more range, in units of the short rows' saturation.
    ///
    /// Each pixel has a sample of its own, and one of the other time between the nearest rows of its filter above and below, in a
    /// straight line. Both count by the inverse of their variance: that of shot and read noise, and for the sample between rows
    /// also what these differ beyond their noise, (a − b)² / 4, so that it counts where light is even. Where the own long sample
    /// is saturated it counts only as the least that the light can be.
    ///
    /// # Errors
    /// When the frame was not exposed, is itself merged, or has not rows of both times.
    pub fn merge_interleaved(&self, raw: &Raw, rows: &Interleaved) -> Result<Raw, SensorError> {
        rows.check(raw.tile.as_ref())?;
        self.check_merge(std::slice::from_ref(raw))?;
        let tile_rows = raw.tile.as_ref().map_or(1, Tile::rows);
        let n_rows = raw.size().0;
        if (0..n_rows).any(|row| rows.neighbors(row, tile_rows, n_rows) == [None; 2]) {
            let expected = "enough of them for each filter to be found in rows of both times".to_owned();
            return Err(SensorError::Shape {
                what: "rows of an interleaved frame",
                expected,
                found: n_rows.to_string(),
            });
        }
        let exposure = rows.short(&raw.exposure);
        let short_levels = if rows.gain_ratio > 1.0 { Levels::new(self, &exposure) } else { raw.levels.clone() };
        let source = |shot: usize, exposure: &Exposure, levels: &Levels| MergedFrame {
            time_s: exposure.time_s,
            saturation_e: levels.saturation_e(),
            floor_e: self.floor_e(levels, exposure),
            shot,
        };
        let (long, short) = (source(0, &raw.exposure, &raw.levels), source(1, &exposure, &short_levels));
        let merge = RowMerge { rows, tile_rows, long, short };
        // Codes of short rows stand for more light where their gain is lower.
        let mut linear = raw.linear();
        let of_short = Raw { levels: short_levels, ..raw.clone() }.linear();
        for (plane, of_short) in linear.iter_mut().zip(&of_short) {
            for row in (0..n_rows).filter(|&row| !rows.is_long(row)) {
                plane.row_mut(row).assign(&of_short.row(row));
            }
        }
        let planes = linear.iter().map(|plane| RawPlane::Volts(merge.plane(plane))).collect();
        let levels = self.unit_levels(merge.short.saturation_e, &exposure);
        Ok(Raw { planes, levels, exposure, merged: vec![merge.long, merge.short], ..raw.clone() })
    }
}

/// What is known of the light on a pixel.
#[derive(Clone, Copy)]
struct Estimate<'a> {
    e_per_s: f64,
    source: &'a MergedFrame,
    /// The variance of its noise over that of one sample.
    noise_share: f64,
    /// What else it may be wrong by, (electrons a second)².
    unevenness: f64,
    is_saturated: bool,
}

impl Estimate<'_> {
    /// Returns its variance in light of a rate, (electrons a second)².
    fn variance(&self, e_per_s: f64) -> f64 {
        self.noise_share * sample_variance(self.source, e_per_s) + self.unevenness
    }
}

/// Returns the variance of one sample in light of a rate, (electrons a second)².
fn sample_variance(source: &MergedFrame, e_per_s: f64) -> f64 {
    // One electron keeps a noiseless dark pixel's weight finite.
    (e_per_s.max(0.0) * source.time_s + source.floor_e.powi(2) + 1.0) / source.time_s.powi(2)
}

/// How the rows of a frame are merged.
struct RowMerge<'a> {
    rows: &'a Interleaved,
    tile_rows: usize,
    long: MergedFrame,
    short: MergedFrame,
}

impl RowMerge<'_> {
    fn source(&self, is_long: bool) -> &MergedFrame {
        if is_long { &self.long } else { &self.short }
    }

    /// Returns a plane of shares of the short rows' saturation.
    fn plane(&self, linear: &Array2<f32>) -> Array2<f32> {
        let (n_rows, scale) = (linear.nrows(), self.short.saturation_e_per_s());
        let mut merged = linear.clone();
        merged.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut values)| {
            let is_long = self.rows.is_long(row);
            let neighbors = self.rows.neighbors(row, self.tile_rows, n_rows);
            for (column, value) in values.iter_mut().enumerate() {
                let own = estimate(*value, self.source(is_long));
                let beside = neighbors.map(|other| other.map(|other| (row.abs_diff(other), linear[(other, column)])));
                let other = between(beside, self.source(!is_long));
                *value = (merged_e_per_s(own, other, is_long) / scale) as f32;
            }
        });
        merged
    }
}

/// Returns what one sample tells.
fn estimate(sample: f32, source: &MergedFrame) -> Estimate<'_> {
    Estimate {
        e_per_s: f64::from(sample) * source.saturation_e_per_s(),
        source,
        noise_share: 1.0,
        unevenness: 0.0,
        is_saturated: sample >= USABLE_BELOW,
    }
}

/// Returns what the samples above and below tell of the place between them, each with its distance.
fn between(beside: [Option<(usize, f32)>; 2], source: &MergedFrame) -> Estimate<'_> {
    let of = |(_, sample): (usize, f32)| estimate(sample, source);
    let (above, below) = match beside {
        [Some(above), Some(below)] => (above, below),
        [one, other] => return of(one.or(other).expect("a checked frame has rows of both times")),
    };
    let share = above.0 as f64 / (above.0 + below.0) as f64;
    let (a, b) = (of(above), of(below));
    let noise_of_difference = 2.0 * sample_variance(source, 0.5 * (a.e_per_s + b.e_per_s));
    Estimate {
        e_per_s: (1.0 - share) * a.e_per_s + share * b.e_per_s,
        source,
        noise_share: (1.0 - share).powi(2) + share.powi(2),
        unevenness: 0.25 * ((a.e_per_s - b.e_per_s).powi(2) - noise_of_difference).max(0.0),
        is_saturated: a.is_saturated || b.is_saturated,
    }
}

/// Returns the rate of a pixel from its own sample and the one of the other time.
fn merged_e_per_s(own: Estimate<'_>, other: Estimate<'_>, is_long: bool) -> f64 {
    match (own.is_saturated, other.is_saturated) {
        (true, _) if is_long => other.e_per_s.max(own.e_per_s),
        (true, _) | (false, true) => own.e_per_s,
        (false, false) => {
            // The signal in both variances is that of both samples, so that the weights do not lean on the noise of one.
            let time_s = own.source.time_s + other.source.time_s;
            let rough = (own.e_per_s * own.source.time_s + other.e_per_s * other.source.time_s) / time_s;
            let weights = [own, other].map(|estimate| estimate.variance(rough).recip());
            (weights[0] * own.e_per_s + weights[1] * other.e_per_s) / (weights[0] + weights[1])
        }
    }
}
