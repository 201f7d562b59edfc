//! The frame that a sensor hands on, with what is needed to understand it.

use std::{borrow::Cow, sync::Arc};

use ndarray::Array2;
use rayon::prelude::*;

use crate::{Adc, Exposure, Response, Sensor, SensorError, Tile};

/// A frame of digital numbers, or of volts where the sensor has no converter.
#[derive(Clone, Debug, PartialEq)]
pub struct Raw {
    /// One plane for a mosaic, one a filter where they are stacked.
    pub planes: Vec<RawPlane>,
    /// The mosaic from the top left pixel on; `None` where every pixel has all filters.
    pub tile: Option<Tile>,
    /// The names of the filters that the tile counts, or of the planes.
    pub filter_names: Vec<String>,
    /// What the samples stand for.
    pub levels: Levels,
    /// How the frame was exposed.
    pub exposure: Exposure,
    /// The time from one row's readout to the next, µs; row r is exposed r times this later than row 0.
    pub row_time_us: f64,
    /// The frames that were merged into this one; empty for a frame as the converter gave it.
    pub merged: Vec<MergedFrame>,
    /// The frame with the pixels that no light reaches, where it has some and nothing was taken off by them.
    pub masked: Option<MaskedPixels>,
}

/// A frame that was merged with others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergedFrame {
    /// How long it was exposed, s.
    pub time_s: f64,
    /// The electrons at which it saturates.
    pub saturation_e: f64,
    /// Noise that does not depend on the signal, rms electrons.
    pub floor_e: f64,
    /// The exposure that its electrons are of: frames of one are reads of the same, next to each other in the list.
    pub shot: usize,
}

/// The pixels of a frame that no light reaches, together with the others.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskedPixels {
    /// Rows above those that see light.
    pub rows: usize,
    /// Columns to the left of those that see light.
    pub columns: usize,
    /// All pixels: one plane for a mosaic, one a filter where they are stacked.
    pub planes: Vec<RawPlane>,
}

impl MergedFrame {
    /// The rate at which it saturates, electrons a second.
    pub fn saturation_e_per_s(&self) -> f64 {
        self.saturation_e / self.time_s
    }
}

/// The samples of a frame.
#[derive(Clone, Debug, PartialEq)]
pub enum RawPlane {
    /// Digital numbers.
    Dn(Array2<u16>),
    /// Volts after the analog gain.
    Volts(Array2<f32>),
    /// Digital numbers of a file whose black or saturation differs from place to place, shifted and scaled to what
    /// [`Levels`] states for all.
    Evened(Array2<f32>),
}

impl RawPlane {
    /// Returns the digital numbers as they are, or `None` for volts and for evened numbers.
    pub fn dn(&self) -> Option<&Array2<u16>> {
        match self {
            Self::Dn(plane) => Some(plane),
            Self::Volts(_) | Self::Evened(_) => None,
        }
    }

    /// Returns the samples as numbers of any kind.
    pub fn samples(&self) -> Cow<'_, Array2<f32>> {
        match self {
            Self::Dn(plane) => Cow::Owned(plane.mapv(f32::from)),
            Self::Volts(plane) | Self::Evened(plane) => Cow::Borrowed(plane),
        }
    }

    /// Returns one sample, or `None` beyond the frame.
    pub fn sample(&self, row: usize, column: usize) -> Option<f64> {
        match self {
            Self::Dn(plane) => plane.get((row, column)).map(|&dn| f64::from(dn)),
            Self::Volts(plane) | Self::Evened(plane) => plane.get((row, column)).map(|&value| f64::from(value)),
        }
    }

    /// Rows and columns.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Dn(plane) => plane.dim(),
            Self::Volts(plane) | Self::Evened(plane) => plane.dim(),
        }
    }
}

/// How far below saturation a sample counts as saturated, over the range of samples.
const AT_SATURATION: f64 = 0.005;

/// What the samples of a frame stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels {
    /// The sample of no light: digital number, or volts without a converter.
    pub black: f64,
    /// The sample at which a pixel is saturated.
    pub white: f64,
    /// The highest sample there can be: 2^bits − 1, or the swing in volts.
    pub top: f64,
    /// Volts a unit of the samples.
    pub step_v: f64,
    /// Amplified volts an electron.
    pub volts_per_electron: f64,
    response: Response,
    swing_v: f64,
    converter_black: f64,
    black_v: f64,
    white_v: f64,
    /// What each code stands for on the straight scale of a file's levels.
    table: Option<Arc<[u16]>>,
}

impl Levels {
    pub(crate) fn new(sensor: &Sensor, exposure: &Exposure) -> Self {
        let swing_v = sensor.swing_v;
        let step_v = sensor.adc.step_v(swing_v).unwrap_or(1.0);
        let converter_black = match sensor.adc {
            Adc::Analog => 0.0,
            Adc::Bits { black_level_dn, .. } => f64::from(black_level_dn),
        };
        let volts_per_electron = sensor.conversion_gain_v_per_e(exposure.gain_mode) * exposure.analog_gain;
        let black_v = sensor.offset_v * exposure.analog_gain;
        let white_v = black_v + volts_per_electron * sensor.saturation_e(exposure);
        let sample = |v: f64| converter_black + sensor.response.apply(v.abs(), swing_v).copysign(v) / step_v;
        Self {
            black: sample(black_v),
            white: sample(white_v),
            top: sensor.adc.top_dn().map_or(swing_v, f64::from),
            step_v,
            volts_per_electron,
            response: sensor.response.clone(),
            swing_v,
            converter_black,
            black_v,
            white_v,
            table: None,
        }
    }

    /// Returns the levels of samples that so many were taken off, but for the black level: what is full lies as much lower.
    pub(crate) fn lowered(self, samples: f64) -> Self {
        // A frame whose darkness is full has nothing left, of which a thousandth is kept.
        let left = |white: f64, black: f64, less: f64| (white - less).max(black + 1e-3 * (white - black));
        let white = left(self.white, self.black, samples);
        let white_v = left(self.white_v, self.black_v, samples * self.step_v);
        Self { white, white_v, ..self }
    }

    /// Returns the levels of a file: those of its codes, or with a table those of the table's entries.
    ///
    /// A step stands for a volt.
    pub(crate) fn of_file((black, white, top): (f64, f64, f64), saturation_e: f64, table: Option<Arc<[u16]>>) -> Self {
        let code_of = |level: f64| match &table {
            Some(table) => table.partition_point(|&entry| f64::from(entry) < level).min(table.len() - 1) as f64,
            None => level,
        };
        Self {
            black: code_of(black),
            white: code_of(white),
            top,
            step_v: 1.0,
            volts_per_electron: (white - black) / saturation_e,
            response: Response::Linear,
            swing_v: top,
            converter_black: 0.0,
            black_v: black,
            white_v: white,
            table,
        }
    }

    /// Returns the light that a sample stands for: 0 for none, 1 at saturation; the response curve is undone.
    pub fn linear(&self, sample: f64) -> f64 {
        let straight = match &self.table {
            Some(table) => f64::from(table[(sample.max(0.0) as usize).min(table.len() - 1)]),
            None => sample,
        };
        let out_v = (straight - self.converter_black) * self.step_v;
        let v = self.response.inverse(out_v.abs(), self.swing_v).copysign(out_v);
        (v - self.black_v) / (self.white_v - self.black_v)
    }

    /// Whether samples rise with light along a straight line.
    pub(crate) fn is_linear(&self) -> bool {
        self.response == Response::Linear && self.table.is_none()
    }

    /// Returns the electrons at saturation, [`linear`](Self::linear) = 1.
    pub fn saturation_e(&self) -> f64 {
        (self.white_v - self.black_v) / self.volts_per_electron
    }
}

impl Raw {
    /// Returns when the exposure of a row begins, s after that of row 0: later for each row of a rolling shutter.
    pub fn row_start_s(&self, row: usize) -> f64 {
        1e-6 * self.row_time_us * row as f64
    }

    /// Rows and columns.
    pub fn size(&self) -> (usize, usize) {
        self.planes[0].size()
    }

    /// Returns the digital numbers of a mosaic or monochrome frame, or `None` for volts and for stacked filters.
    pub fn dn(&self) -> Option<&Array2<u16>> {
        match self.planes.as_slice() {
            [RawPlane::Dn(plane)] => Some(plane),
            _ => None,
        }
    }

    /// Returns each plane as light: 0 for none, 1 at saturation, the response curve undone.
    pub fn linear(&self) -> Vec<Array2<f32>> {
        let plane = |plane: &RawPlane| match plane {
            RawPlane::Dn(plane) => {
                let table: Vec<f32> =
                    (0..=self.levels.top as u16).map(|dn| self.levels.linear(f64::from(dn)) as f32).collect();
                ndarray::Zip::from(plane).par_map_collect(|&dn| table.get(usize::from(dn)).copied().unwrap_or(1.0))
            }
            RawPlane::Volts(plane) | RawPlane::Evened(plane) => {
                ndarray::Zip::from(plane).par_map_collect(|&v| self.levels.linear(f64::from(v)) as f32)
            }
        };
        self.planes.iter().map(plane).collect()
    }

    /// Returns the share of samples at saturation: less than half a per cent below it, where a full well ends with its noise.
    pub fn saturated_fraction(&self) -> f64 {
        let least: f64 = if self.dn().is_some() { 0.5 } else { 0.0 };
        let white = self.levels.white - least.max(AT_SATURATION * (self.levels.white - self.levels.black));
        let count = |plane: &RawPlane| match plane {
            RawPlane::Dn(plane) => plane.par_iter().filter(|&&dn| f64::from(dn) >= white).count(),
            RawPlane::Volts(plane) | RawPlane::Evened(plane) => {
                plane.par_iter().filter(|&&v| f64::from(v) >= white).count()
            }
        };
        let (rows, columns) = self.size();
        self.planes.iter().map(count).sum::<usize>() as f64 / (rows * columns * self.planes.len()) as f64
    }

    /// Checks that the planes agree in size and are as many as the filters ask for.
    pub(crate) fn check(&self) -> Result<(), SensorError> {
        let expected = if self.tile.is_some() { 1 } else { self.filter_names.len() };
        if self.planes.len() != expected || self.planes.is_empty() {
            let (expected, found) = (expected.to_string(), self.planes.len().to_string());
            return Err(SensorError::Shape { what: "planes of a raw frame", expected, found });
        }
        let text = |(rows, columns): (usize, usize)| format!("{rows} × {columns}");
        match self.planes.iter().find(|plane| plane.size() != self.size()) {
            Some(plane) => {
                let (expected, found) = (text(self.size()), text(plane.size()));
                Err(SensorError::Shape { what: "rows × columns of a raw plane", expected, found })
            }
            None => Ok(()),
        }
    }
}
