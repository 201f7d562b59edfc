//! Numbers of a capture: what the sensor saw and what the lens lost.

use dioptric_optics::{MonoLens, ObjectPoint, Vignetting, glam::DVec2, rays_over_front};
use dioptric_sensor::{Binning, BinningKind, Tile};
use serde::Serialize;

use super::pixel_optics::PixelOpticsData;
use crate::psf::spot::pupil_share;
use crate::{LensData, LensInfoRequest};
use dioptric_pipeline::{Capture, Frames, PipelineError, REFERENCE_WAVELENGTH_NM, number};

/// Bins of a histogram of digital numbers.
const BINS: usize = 128;
/// Rays along the side of the grid that counts losses.
const LOSS_RAYS: usize = 101;

/// What the sensor saw.
#[derive(Clone, Debug, Serialize)]
pub struct SensorStatistics {
    /// The sensor.
    pub sensor: String,
    /// Exposure time, s.
    pub exposure_time_s: f64,
    /// Factor on the voltage.
    pub analog_gain: f64,
    /// Electrons at which a pixel saturates.
    pub saturation_e: f64,
    /// The share of samples at saturation.
    pub saturated_fraction: f64,
    /// Read noise, electrons.
    pub read_noise_e: f64,
    /// The time from one row's readout to the next, µs; 0 for a global shutter.
    pub row_time_us: f64,
    /// How much later the last row is exposed than the first, ms.
    pub last_row_later_ms: f64,
    /// What the optics of its pixels let through, where the data sheet states their stack.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_optics: Option<PixelOpticsData>,
    /// What the data sheet leaves open, a sentence each.
    pub notes: Vec<String>,
    /// A row a filter.
    pub channels: Vec<ChannelStatistics>,
}

/// What the pixels behind one filter saw.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelStatistics {
    /// The filter.
    pub filter: String,
    /// Mean electrons.
    pub mean_e: f64,
    /// Largest mean electrons of a pixel.
    pub max_e: f64,
    /// Signal-to-noise ratio at the mean, dB (shot and read noise).
    pub snr_db: f64,
    /// Mean sample of the raw frame: digital number, or volts.
    pub mean_raw: f64,
    /// The share of pixels in each bin of digital numbers from 0 to the top.
    #[serde(skip)]
    pub histogram: Vec<f64>,
}

/// Where the light of a field goes: shares of what enters the front rim's disc.
#[derive(Clone, Debug, Serialize)]
pub struct LossRow {
    /// Field angle, degrees.
    pub field_deg: f64,
    /// The share that reaches the film.
    pub reaches_film: f64,
    /// The share that the stop ends.
    pub ended_by_stop: f64,
    /// The share that other rims end.
    pub ended_by_rims: f64,
    /// The share that misses a surface or is totally reflected.
    pub missed_or_reflected: f64,
    /// The area of the pupil that reaches the film over that of the axial pupil: relative illumination without the
    /// cosines.
    pub vignetting: f64,
}

impl SensorStatistics {
    /// Returns the numbers of one exposure.
    ///
    /// # Errors
    /// When the filters of the sensor do not tile.
    pub fn new(frames: &Frames<'_>) -> Result<Self, PipelineError> {
        let Frames { sensor, exposure, exposed, .. } = frames;
        let raw = &exposed.raw;
        let (tile, sheet) = (sensor.tile()?, sensor.as_read(exposure)?);
        let read_noise_e = sheet.read_noise_v(exposure.gain_mode) / sheet.conversion_gain_v_per_e(exposure.gain_mode);
        let channels =
            (0..sensor.filters.len()).map(|filter| channel(frames, tile.as_ref(), filter, read_noise_e)).collect();
        let as_one = exposure.binning.map(|binning| {
            let ((rows, columns), pitch_um) = (raw.size(), frames.pitch_um);
            let volts = if binning.kind == BinningKind::Digital { ("", ", volts") } else { (", volts", "") };
            format!(
                "{binning}: {columns} × {rows} pixels of {} µm are read from {} × {} of {} µm; picture{} and raw frame are of the former, \
                 irradiance, depth, electrons{} of the latter",
                number(binning.pixels as f64 * pitch_um),
                sensor.columns,
                sensor.rows,
                number(pitch_um),
                volts.0,
                volts.1
            )
        });
        Ok(Self {
            sensor: sensor.name.clone(),
            exposure_time_s: exposure.time_s,
            analog_gain: exposure.analog_gain,
            saturation_e: sheet.saturation_e(exposure),
            saturated_fraction: raw.saturated_fraction(),
            read_noise_e,
            row_time_us: raw.row_time_us,
            last_row_later_ms: 1e3 * raw.row_start_s(raw.size().0 - 1),
            pixel_optics: PixelOpticsData::of(frames)?,
            notes: sensor
                .bands_beyond_tables(frames.grid)
                .into_iter()
                .chain(as_one)
                .chain(frames.filters.iter().filter_map(|filter| filter.note_beyond_table(frames.grid)))
                .collect(),
            channels,
        })
    }
}

fn channel(frames: &Frames<'_>, tile: Option<&Tile>, filter: usize, read_noise_e: f64) -> ChannelStatistics {
    let Frames { sensor, exposure, rate, exposed, .. } = frames;
    let raw = &exposed.raw;
    let plane = if tile.is_some() { 0 } else { filter };
    let (mut sum_e, mut max_e, mut n_e) = (0.0, 0.0_f64, 0_usize);
    // Of all pixels that are read as one.
    let n_as_one = exposure.binning.map_or(1, Binning::n) as f64;
    for at in places_of_filter(rate.planes_e_per_s[plane].dim(), tile, filter) {
        let electrons = n_as_one * (f64::from(rate.planes_e_per_s[plane][at]) * exposure.time_s);
        sum_e += electrons;
        max_e = max_e.max(electrons);
        n_e += 1;
    }
    let (mut sum_raw, mut counts) = (0.0, vec![0_usize; BINS]);
    for at in places_of_filter(raw.size(), raw.tile.as_ref(), filter) {
        let sample = raw.planes[plane].sample(at.0, at.1).unwrap_or_default();
        sum_raw += sample;
        counts[((sample / raw.levels.top * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    let n_pixels = counts.iter().sum::<usize>().max(1) as f64;
    let mean_e = sum_e / n_e.max(1) as f64;
    ChannelStatistics {
        filter: sensor.filters[filter].name.clone(),
        mean_e,
        max_e,
        snr_db: 20.0 * (mean_e / (mean_e + read_noise_e.powi(2)).sqrt()).log10(),
        mean_raw: sum_raw / n_pixels,
        histogram: counts.into_iter().map(|count| count as f64 / n_pixels).collect(),
    }
}

/// Returns the rows and columns of the pixels behind a filter: all of them where filters are stacked.
fn places_of_filter(
    (rows, columns): (usize, usize),
    tile: Option<&Tile>,
    filter: usize,
) -> impl Iterator<Item = (usize, usize)> {
    let places = (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)));
    places.filter(move |&(row, column)| tile.is_none_or(|tile| tile.filter_at(row, column) == filter))
}

/// Returns where the light of a few fields goes, at the reference wavelength and the depth in focus.
pub(super) fn losses(capture: &Capture, field_tans: &[DVec2]) -> Result<Vec<LossRow>, PipelineError> {
    let mono = &capture.lens.reference;
    let beside_focus = 1.0 / capture.scene.near_m;
    let focus_mm = capture.place.focus_distance_mm;
    let dioptres = focus_mm.map_or(beside_focus, |mm| 1e3 / (mm + mono.projection_center_z_mm()));
    Ok(field_tans.iter().map(|&field_tan| loss_row(mono, field_tan, dioptres)).collect())
}

fn loss_row(mono: &MonoLens, field_tan: DVec2, dioptres: f64) -> LossRow {
    let axial = ObjectPoint::from_field(mono, DVec2::ZERO, dioptres);
    let point = ObjectPoint::from_field(mono, field_tan, dioptres);
    let mut rays = rays_over_front(mono, &point, LOSS_RAYS);
    mono.trace(&mut rays, Vignetting::On);
    let losses = rays.losses();
    let share = |n: usize| n as f64 / rays.len() as f64;
    let (mut by_stop, mut by_rims, mut otherwise) = (0, 0, 0);
    for (surface, row) in losses.by_surface.iter().enumerate() {
        if surface == mono.stop() {
            by_stop += row.n_vignetted;
        } else {
            by_rims += row.n_vignetted;
        }
        otherwise += row.n_missed + row.n_totally_reflected;
    }
    LossRow {
        field_deg: field_tan.length().atan().to_degrees(),
        reaches_film: share(losses.n_in_flight),
        ended_by_stop: share(by_stop),
        ended_by_rims: share(by_rims),
        missed_or_reflected: share(otherwise),
        vignetting: pupil_share(mono, &point, &axial),
    }
}

/// The lens as it was used.
pub(super) fn lens_data(capture: &Capture, corner_tan: f64) -> Result<LensData, PipelineError> {
    let question = LensInfoRequest {
        wavelength_nm: REFERENCE_WAVELENGTH_NM,
        distance_mm: capture.place.focus_distance_mm,
        field_deg: corner_tan.atan().to_degrees(),
        colors_nm: None,
        blur_um: None,
    };
    LensData::new(&capture.lens.lens, &question)
}
