//! From irradiance to the mean rate of photo-electrons, a few bands at a time.

use std::borrow::Cow;

use dioptric_spectrum::{Bands, Quantity, SpectrumError};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    ElectronRate, ExitPupil, Sensor, SensorError, Tile,
    sampling::{Overlaps, average, spread},
};

/// How many bands are held at once: enough that the frame is not read and written for each.
const BANDS_AT_ONCE: usize = 4;

/// The light on a sensor.
#[derive(Clone, Copy)]
pub struct Illumination<'a> {
    /// Spectral irradiance, W m⁻² nm⁻¹; a few bands are asked for at a time.
    pub irradiance: &'a dyn Bands,
    /// The distance between the irradiance's samples on the film, µm, both centered on the axis: pixels then average
    /// over their apertures, and the frame has the sensor's rows and columns. `None` when there is one sample
    /// (already averaged) a pixel: the frame then has the size of the irradiance, from the tile's first pixel on.
    pub pitch_um: Option<f64>,
    /// Where the light of each pixel comes from, from which its chief ray and its cone of light follow; `None` for
    /// collimated light along the axis everywhere.
    pub exit_pupil: Option<ExitPupil>,
}

impl<'a> Illumination<'a> {
    /// Returns light given by one sample a pixel.
    pub fn on_pixels(irradiance: &'a dyn Bands) -> Self {
        Self { irradiance, pitch_um: None, exit_pupil: None }
    }

    /// Returns light sampled at a pitch of its own.
    pub fn with_pitch_um(irradiance: &'a dyn Bands, pitch_um: f64) -> Self {
        Self { irradiance, pitch_um: Some(pitch_um), exit_pupil: None }
    }
}

impl Sensor {
    /// Returns the mean rate of photo-electrons in each pixel.
    ///
    /// Bands are asked for a few at a time, in order, each once: the cube is never needed as a whole.
    ///
    /// # Errors
    /// When the sensor makes no sense, the image is not an irradiance, a band cannot be read or a sample is negative
    /// or not finite.
    pub fn electron_rate(&self, light: &Illumination<'_>) -> Result<ElectronRate, SensorError> {
        self.check()?;
        let irradiance = light.irradiance;
        if irradiance.quantity() != Quantity::Irradiance {
            return Err(SensorError::NotIrradiance { found: irradiance.quantity().unit() });
        }
        let optics = PixelOptics::new(self, light)?;
        let tile = self.tile()?;
        let weights = self.electron_weights(irradiance.grid());
        let mut planes = vec![Array2::<f32>::zeros(optics.size); self.n_planes()];
        for first in (0..weights[0].len()).step_by(BANDS_AT_ONCE) {
            let bands = first..(first + BANDS_AT_ONCE).min(weights[0].len());
            let group: Vec<_> = bands.clone().map(|band| optics.band(irradiance, band)).collect::<Result<_, _>>()?;
            for (plane_number, plane) in planes.iter_mut().enumerate() {
                let of_filter = |filter: usize| bands.clone().map(|band| weights[filter][band] as f32).collect();
                match &tile {
                    Some(tile) => add_mosaic(plane, &group, tile, &of_filter),
                    None => add_mosaic(plane, &group, &Tile::single(plane_number), &of_filter),
                }
            }
        }
        Ok(after_filters(self, optics.exit_pupil, planes))
    }
}

/// Adds bands to a frame, each pixel with the weights of its filter.
fn add_mosaic(
    plane: &mut Array2<f32>,
    bands: &[Cow<'_, Array2<f32>>],
    tile: &Tile,
    weights: &dyn Fn(usize) -> Vec<f32>,
) {
    let n_columns = plane.ncols();
    // One row of weights a band for each row of the tile, so that the inner loop has no choice to make.
    let tiled: Vec<Vec<Vec<f32>>> = (0..tile.rows())
        .map(|row| {
            let of_filters: Vec<Vec<f32>> = tile.row(row).iter().map(|&filter| weights(filter)).collect();
            (0..bands.len()).map(|b| (0..n_columns).map(|c| of_filters[c % of_filters.len()][b]).collect()).collect()
        })
        .collect();
    let rows = plane.as_slice_mut().expect("frames are contiguous").par_chunks_mut(n_columns);
    rows.enumerate().for_each(|(row, sums)| {
        for (band, weights) in bands.iter().zip(&tiled[row % tile.rows()]) {
            let samples = band.row(row);
            let samples = samples.as_slice().expect("bands are in standard layout");
            for ((sum, &weight), &sample) in sums.iter_mut().zip(weights).zip(samples) {
                *sum += weight * sample;
            }
        }
    });
}

/// What light goes through before and after the filters.
struct PixelOptics {
    /// Rows and columns of the frame.
    size: (usize, usize),
    overlaps: Option<(Overlaps, Overlaps)>,
    optical_crosstalk: Option<[[f64; 3]; 3]>,
    exit_pupil: Option<ExitPupil>,
}

impl PixelOptics {
    fn new(sensor: &Sensor, light: &Illumination<'_>) -> Result<Self, SensorError> {
        if let Some(pitch_um) = light.pitch_um.filter(|&v| !(v > 0.0 && v.is_finite())) {
            return Err(SensorError::value("the illumination", "pitch_um", pitch_um, "a number above 0"));
        }
        light.exit_pupil.map_or(Ok(()), |pupil| pupil.check())?;
        let (n_rows, n_columns) = light.irradiance.size();
        let side_um = sensor.opening_um();
        let overlaps = |n_samples, pitch_um, n_pixels| {
            Overlaps::new(n_samples, pitch_um, n_pixels, sensor.pixel_pitch_um, side_um)
        };
        let axes = |pitch| (overlaps(n_rows, pitch, sensor.rows), overlaps(n_columns, pitch, sensor.columns));
        Ok(Self {
            size: if light.pitch_um.is_some() { (sensor.rows, sensor.columns) } else { (n_rows, n_columns) },
            overlaps: light.pitch_um.map(axes),
            optical_crosstalk: sensor.optical_crosstalk,
            exit_pupil: light.exit_pupil,
        })
    }

    /// Returns a band on the pixels, before the filters.
    fn band<'a>(&self, irradiance: &'a dyn Bands, band: usize) -> Result<Cow<'a, Array2<f32>>, SensorError> {
        let samples = irradiance.band(band)?;
        check_samples(&samples, irradiance.size(), irradiance.grid().centers_nm()[band])?;
        let on_pixels = match &self.overlaps {
            Some((rows, columns)) => Cow::Owned(average(&samples, rows, columns)),
            None if samples.is_standard_layout() => samples,
            None => Cow::Owned(samples.as_standard_layout().into_owned()),
        };
        Ok(match &self.optical_crosstalk {
            Some(kernel) => Cow::Owned(spread(&on_pixels, kernel)),
            None => on_pixels,
        })
    }
}

/// Returns rates after the response to angles and the spread of electrons.
pub(crate) fn after_filters(
    sensor: &Sensor,
    exit_pupil: Option<ExitPupil>,
    mut planes: Vec<Array2<f32>>,
) -> ElectronRate {
    sensor.response_to(exit_pupil).apply(&mut planes);
    let spread = |plane: Array2<f32>| match &sensor.electrical_crosstalk {
        Some(kernel) => spread(&plane, kernel),
        None => plane,
    };
    ElectronRate { planes_e_per_s: planes.into_iter().map(spread).collect() }
}

/// Checks that a band has the size it should and that every sample is finite and not negative.
fn check_samples(samples: &Array2<f32>, size: (usize, usize), wavelength_nm: f64) -> Result<(), SensorError> {
    if samples.dim() != size {
        let text = |(rows, columns): (usize, usize)| format!("{rows} × {columns}");
        let (expected, found) = (text(size), text(samples.dim()));
        return Err(SensorError::Shape { what: "rows × columns of a band", expected, found });
    }
    let is_right = |value: &f32| *value >= 0.0 && *value < f32::INFINITY;
    let wrong = samples.outer_iter().into_par_iter().enumerate().find_map_first(|(row, values)| {
        // The sum of flags has no early exit, so that it runs many samples at a time.
        let n_wrong = values.iter().map(|v| u32::from(!is_right(v))).sum::<u32>();
        let column = values.iter().position(|v| n_wrong > 0 && !is_right(v))?;
        Some(SpectrumError::Sample { wavelength_nm, row, column, value: values[column] })
    });
    wrong.map_or(Ok(()), |error| Err(error.into()))
}
