//! The data sheet of a sensor.

use dioptric_spectrum::{Spectrum, WavelengthGrid};
use serde::{Deserialize, Serialize};

use crate::{Adc, Cfa, Exposure, GainMode, PixelStack, QuantumEfficiencyOf, Response, SensorError, Tile};

/// The data sheet of an image sensor.
///
/// Everything that belongs to the chip; what belongs to the shot is in [`Exposure`]. The signal path is
///
/// ```text
/// photons → electrons (quantum efficiency, PRNU, dark current, Poisson, full well)
///         → volts     (conversion gain, read noise, reset noise without CDS, DSNU, column and row noise)
///         → volts out (volts + offset) × analog gain, clipped to 0 … swing; then the response curve
///         → DN        ⌊volts out / LSB + ½⌋ + black level, clipped to 0 … 2^bits − 1
/// ```
///
/// A gain of 2 doubles the signal (ISETCam divides by it). Fields that most sensors do without may be left out
/// of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// What to call it.
    pub name: String,
    /// Where the numbers come from.
    pub source: String,
    /// The rows of pixels.
    pub rows: usize,
    /// The columns of pixels.
    pub columns: usize,
    /// The distance between pixels, µm; pixels are square.
    pub pixel_pitch_um: f64,
    /// The share of the pixel's area that collects light, 0–1. Below 1 the aperture is a centered square.
    pub fill_factor: f64,
    /// Which filter lies on which pixel.
    pub cfa: Cfa,
    /// The color filters, each with the quantum efficiency of a pixel behind it.
    pub filters: Vec<Filter>,
    /// Glass over the whole array: infrared cut, cover glass, anti-alias filter.
    #[serde(default)]
    pub filter_stack: Vec<Layer>,
    /// What lies before the sensor in the camera that its colors are calibrated for: a lens. Its transmittance counts in what is white and
    /// in color matrices, not in the electrons, which are those of the light that comes through.
    #[serde(default)]
    pub calibrated_behind: Option<Layer>,
    /// Volts an electron.
    pub conversion_gain_v_per_e: f64,
    /// The electrons that a pixel holds.
    pub full_well_e: f64,
    /// The electrons that the node holds where charges of several pixels are summed; left out, all that the pixels hold.
    #[serde(default)]
    pub binned_well_e: Option<f64>,
    /// The second readout of a dual-gain pixel.
    #[serde(default)]
    pub high_gain: Option<HighGain>,
    /// The small photodiode of a split pixel, exposed with the other and merged with it.
    #[serde(default)]
    pub split_pixel: Option<SplitPixel>,
    /// The range of the output and of the converter, V.
    pub swing_v: f64,
    /// Read noise, rms V at the pixel's output (before the analog gain); with correlated double sampling where the
    /// sensor has it.
    #[serde(default)]
    pub read_noise_v: f64,
    /// The same in electrons, rms; either this or the volts.
    #[serde(default)]
    pub read_noise_e: Option<f64>,
    /// Reset (kTC) noise, rms V; added only without correlated double sampling.
    #[serde(default)]
    pub reset_noise_v: f64,
    /// Whether correlated double sampling takes the reset noise away.
    #[serde(default = "yes")]
    pub correlated_double_sampling: bool,
    /// Dark current.
    #[serde(default)]
    pub dark_current: DarkCurrent,
    /// Photo-response non-uniformity: the rms share by which pixels differ in sensitivity.
    #[serde(default)]
    pub prnu_fraction: f64,
    /// Dark-signal non-uniformity: the rms of the pixels' fixed offsets, V.
    #[serde(default)]
    pub dsnu_v: f64,
    /// The rms of the columns' fixed offsets, V.
    #[serde(default)]
    pub column_offset_v: f64,
    /// The rms share by which columns differ in gain.
    #[serde(default)]
    pub column_gain_fraction: f64,
    /// The rms of an offset drawn anew for each row of each frame, V.
    #[serde(default)]
    pub row_noise_v: f64,
    /// Pixels that do not work.
    #[serde(default)]
    pub defects: Defects,
    /// Pixels whose source follower has a trap.
    #[serde(default)]
    pub telegraph: TelegraphNoise,
    /// A fixed voltage added before the analog gain, V.
    #[serde(default)]
    pub offset_v: f64,
    /// The curve from the amplified voltage to the converter's input.
    #[serde(default)]
    pub response: Response,
    /// The converter.
    pub adc: Adc,
    /// The ISO speed that the maker calls analog gain 1.
    #[serde(default)]
    pub iso_at_unity_gain: Option<f64>,
    /// The time from one row's readout to the next, µs; 0 for a global shutter.
    #[serde(default)]
    pub row_time_us: f64,
    /// Where the light meant for a pixel goes before the filters: rows × columns about the pixel, summing to at most 1.
    #[serde(default)]
    pub optical_crosstalk: Option<[[f64; 3]; 3]>,
    /// Where the electrons made in a pixel are collected: rows × columns about the pixel, summing to at most 1.
    #[serde(default)]
    pub electrical_crosstalk: Option<[[f64; 3]; 3]>,
    /// Relative sensitivity against the chief-ray angle: pairs of degrees and share, ascending, straight lines between.
    #[serde(default)]
    pub chief_ray_response: Vec<(f64, f64)>,
    /// Photodiode, layers and microlens, from which the sensitivity to the lens's cone of light is worked out; either this or
    /// `chief_ray_response`.
    #[serde(default)]
    pub pixel_stack: Option<PixelStack>,
    /// Rows and columns that no light reaches, and what is taken off the others by them.
    #[serde(default)]
    pub optical_black: Option<OpticalBlack>,
    /// The share of the electrons above the full well that spills into the pixels above and below.
    #[serde(default)]
    pub blooming_fraction: f64,
}

/// A color filter with the pixel behind it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Filter {
    /// The name that the mosaic uses, often one letter.
    pub name: String,
    /// Electrons a photon that falls on the pixel's aperture; 0 beyond the table, but for the rest of a band whose center
    /// the table holds.
    pub quantum_efficiency: Spectrum,
    /// The share of the exposure time for which its pixels collect light, above 0 and at most 1: exposure channel by channel.
    #[serde(default = "whole")]
    pub exposure_fraction: f64,
}

/// A layer over the whole array.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// What it is.
    pub name: String,
    /// The share of light that passes; the ends of the table are held.
    pub transmittance: Spectrum,
}

/// The second, more sensitive readout of a dual-gain pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct HighGain {
    /// Volts an electron.
    pub conversion_gain_v_per_e: f64,
    /// The electrons that can be read in this mode.
    pub full_well_e: f64,
    /// Read noise, rms V.
    pub read_noise_v: f64,
}

/// The small photodiode of a split pixel, as in sensors for cars; the sensor's own numbers are those of the large one.
///
/// Both see the light of the whole pixel's aperture: that the small one stands beside the large one is left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SplitPixel {
    /// The area of the large photodiode over that of the small one, above 1: so much less light and dark current it collects.
    pub area_ratio: f64,
    /// Volts an electron of the small one.
    pub conversion_gain_v_per_e: f64,
    /// The electrons that the small one holds.
    pub full_well_e: f64,
    /// Read noise of the small one, rms electrons.
    pub read_noise_e: f64,
}

/// Dark current and how it grows with temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DarkCurrent {
    /// Electrons a second and pixel at the reference temperature.
    pub e_per_s: f64,
    /// The reference temperature, °C.
    pub at_c: f64,
    /// The step of temperature that doubles it, K.
    pub doubling_k: f64,
}

impl DarkCurrent {
    /// Returns the electrons a second and pixel at a temperature.
    pub fn at(self, temperature_c: f64) -> f64 {
        self.e_per_s * ((temperature_c - self.at_c) / self.doubling_k).exp2()
    }
}

impl Default for DarkCurrent {
    /// None.
    fn default() -> Self {
        Self { e_per_s: 0.0, at_c: 25.0, doubling_k: 7.0 }
    }
}

/// Pixels that do not work, placed by the fixed pattern's seed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Defects {
    /// The share of pixels with an excess dark current.
    pub hot_fraction: f64,
    /// The excess dark current of a hot pixel at the reference temperature, electrons a second.
    pub hot_e_per_s: f64,
    /// The share of pixels that see no light.
    pub dead_fraction: f64,
}

/// Random telegraph noise: some pixels have a trap below the gate of their source follower, whose charge comes and goes.
///
/// A trapped charge lowers the output by an amplitude of the pixel's own. Amplitudes are distributed exponentially over pixels, as the tails of measured
/// histograms are. Traps are full half of the time, and correlated double sampling reads each twice, farther apart than charges stay: the difference is
/// minus the amplitude, nothing, or the amplitude, in a quarter, a half and a quarter of the frames (the three peaks of Wang, Rao, Mierop and Theuwissen,
/// IEDM 2006).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TelegraphNoise {
    /// The share of pixels with a trap.
    pub fraction: f64,
    /// The mean of their amplitudes, electrons.
    pub mean_amplitude_e: f64,
}

impl TelegraphNoise {
    /// Returns the rms over all pixels and frames, electrons: the mean square of amplitudes is twice the square of their mean, and half of it with
    /// correlated double sampling, a quarter without.
    pub fn rms_e(self, correlated_double_sampling: bool) -> f64 {
        let part = if correlated_double_sampling { 1.0 } else { 0.5 };
        self.mean_amplitude_e * (part * self.fraction).sqrt()
    }
}

/// Rows above and columns to the left of the others that no light reaches: optical black.
///
/// They have dark current, its noise, the noise of their reads, the offsets of their columns and the noise of their rows as all pixels have. They come
/// besides the `rows` and `columns` of the sensor, which see light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OpticalBlack {
    /// Rows above, a multiple of the rows after which the mosaic repeats.
    pub rows: usize,
    /// Columns to the left, a multiple of the columns after which the mosaic repeats.
    pub columns: usize,
    /// What is taken off the others.
    #[serde(default)]
    pub clamp: BlackClamp,
}

/// What is taken off the numbers of a frame by its pixels in the dark.
///
/// The mean m of n of them stands for darkness: each number becomes itself − m + the black level, so that the mean dark current is gone. Of the noise σ of
/// darkness of a pixel the mean keeps σ²/n, which is common to all that it is taken off; that of a row has its row's noise in it, which goes too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum BlackClamp {
    /// Nothing: they go with the frame.
    #[default]
    None,
    /// Row by row, the mean of the row's pixels in the dark.
    Row,
    /// The mean of all pixels in the dark.
    Frame,
}

const fn whole() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

/// A table that ends below this share of its peak is taken to have ended with the filter.
const DARK_END: f64 = 0.01;

/// Planck's constant × the speed of light, J m.
const HC_J_M: f64 = 6.626_070_15e-34 * 299_792_458.0;

impl Sensor {
    /// Returns a sensor of the same pixels with another number of them.
    #[must_use]
    pub fn with_size(&self, rows: usize, columns: usize) -> Self {
        Self { rows, columns, ..self.clone() }
    }

    /// Returns a sensor of pixels of another pitch, whose stack is as many times as large: at the same place of a film it takes light from the
    /// same angles.
    #[must_use]
    pub fn with_pitch_um(&self, pixel_pitch_um: f64) -> Self {
        let factor = pixel_pitch_um / self.pixel_pitch_um;
        let pixel_stack =
            self.pixel_stack.as_ref().map(|stack| if factor == 1.0 { stack.clone() } else { stack.scaled(factor) });
        Self { pixel_pitch_um, pixel_stack, ..self.clone() }
    }

    /// The width and the height of the array, mm.
    pub fn size_mm(&self) -> (f64, f64) {
        let pitch_mm = 1e-3 * self.pixel_pitch_um;
        (pitch_mm * self.columns as f64, pitch_mm * self.rows as f64)
    }

    /// The side of the square that collects a pixel's light, µm.
    pub(crate) fn opening_um(&self) -> f64 {
        self.pixel_pitch_um * self.fill_factor.sqrt()
    }

    /// Returns the tile of the mosaic, or `None` where every pixel has all filters.
    ///
    /// # Errors
    /// When the mosaic names an unknown filter or is no rectangle.
    pub fn tile(&self) -> Result<Option<Tile>, SensorError> {
        let names: Vec<&str> = self.filters.iter().map(|f| f.name.as_str()).collect();
        self.cfa.resolve(&self.name, &names)
    }

    /// The number of planes that a frame has: 1 for a mosaic, the number of filters where they are stacked.
    pub fn n_planes(&self) -> usize {
        if self.cfa == Cfa::Stacked { self.filters.len() } else { 1 }
    }

    /// Returns the electrons an incident photon of a wavelength makes behind a filter, with all layers, in collimated light along the axis.
    pub fn quantum_efficiency(&self, filter: usize, wavelength_nm: f64) -> f64 {
        let table = &self.filters[filter].quantum_efficiency;
        self.axial_share() * table.at_or_zero(wavelength_nm) * self.layers_transmittance(wavelength_nm)
    }

    /// Returns the share of collimated light along the axis that quantum efficiencies do not count yet: 1 unless they are those of the photodiode.
    fn axial_share(&self) -> f64 {
        match &self.pixel_stack {
            Some(stack) if stack.quantum_efficiency == QuantumEfficiencyOf::Photodiode => {
                stack.axial_share(self.opening_um())
            }
            _ => 1.0,
        }
    }

    /// Returns, for each filter and band, the electrons a second that an irradiance of 1 W m⁻² nm⁻¹ makes in a pixel.
    ///
    /// Light comes collimated along the axis: [`AngularResponse`](crate::AngularResponse) has the factor of any other.
    /// The second is one of the frame's exposure: a filter that is exposed for a share of it collects that share.
    /// The quantum efficiency × the wavelength is averaged over the width of the band. In a band whose center lies within
    /// a filter's table the end values of the table are held; one whose center lies beyond collects what the table holds
    /// of it, and nothing of the rest: [`bands_beyond_tables`](Self::bands_beyond_tables) lists those.
    pub fn electron_weights(&self, grid: &WavelengthGrid) -> Vec<Vec<f64>> {
        let area_m2 = 1e-12 * self.pixel_pitch_um.powi(2) * self.fill_factor * self.axial_share();
        (0..self.filters.len())
            .map(|filter| {
                let table = &self.filters[filter].quantum_efficiency;
                let collected_m2 = area_m2 * self.filters[filter].exposure_fraction;
                let weight = |(center_nm, &width_nm): (f64, &f64)| {
                    let (first_nm, last_nm) = table.range_nm();
                    let is_within = (first_nm..=last_nm).contains(&center_nm);
                    let in_table = |nm: f64| if is_within { nm.clamp(first_nm, last_nm) } else { nm };
                    let n = (2.0 * width_nm).ceil().max(1.0) as usize;
                    let mean = (0..n)
                        .map(|i| center_nm + width_nm * ((i as f64 + 0.5) / n as f64 - 0.5))
                        .map(|nm| table.at_or_zero(in_table(nm)) * self.layers_transmittance(nm) * 1e-9 * nm)
                        .sum::<f64>()
                        / n as f64;
                    collected_m2 * width_nm * mean / HC_J_M
                };
                grid.middles_nm().into_iter().zip(grid.widths_nm()).map(weight).collect()
            })
            .collect()
    }

    /// Returns, for each filter whose quantum efficiency is not known in some bands, a sentence that names them.
    ///
    /// No electrons are counted there: a table that ends at 0 loses nothing, one that does not ends the filter abruptly,
    /// and only the latter are listed.
    pub fn bands_beyond_tables(&self, grid: &WavelengthGrid) -> Vec<String> {
        let (first_band_nm, last_band_nm) = grid.range_nm();
        let sentence = |filter: &Filter| {
            let table = &filter.quantum_efficiency;
            let (first_nm, last_nm) = table.range_nm();
            let peak = table.values().iter().copied().fold(0.0, f64::max);
            let is_cut = |nm: f64| table.at_held(nm) > DARK_END * peak;
            let is_beyond = first_band_nm < first_nm && is_cut(first_nm) || last_band_nm > last_nm && is_cut(last_nm);
            is_beyond.then(|| {
                format!(
                    "the quantum efficiency of {} of {} is known from {first_nm} to {last_nm} nm, and taken as 0 in the \
                     bands beyond, which reach from {first_band_nm} to {last_band_nm} nm",
                    filter.name, self.name
                )
            })
        };
        self.filters.iter().filter_map(sentence).collect()
    }

    fn layers_transmittance(&self, wavelength_nm: f64) -> f64 {
        self.filter_stack.iter().map(|l| l.transmittance.at_held(wavelength_nm)).product()
    }

    /// Returns the conversion gain of a readout mode, V an electron.
    pub fn conversion_gain_v_per_e(&self, mode: GainMode) -> f64 {
        self.high(mode).map_or(self.conversion_gain_v_per_e, |high| high.conversion_gain_v_per_e)
    }

    /// Returns the electrons that a readout mode holds.
    pub fn full_well_e(&self, mode: GainMode) -> f64 {
        self.high(mode).map_or(self.full_well_e, |high| high.full_well_e)
    }

    /// Returns the read noise of a readout mode, rms V.
    pub fn read_noise_v(&self, mode: GainMode) -> f64 {
        let own_v = self.read_noise_e.map_or(self.read_noise_v, |electrons| electrons * self.conversion_gain_v_per_e);
        self.high(mode).map_or(own_v, |high| high.read_noise_v)
    }

    fn high(&self, mode: GainMode) -> Option<HighGain> {
        self.high_gain.filter(|_| mode == GainMode::High)
    }

    /// Returns the electrons at which a pixel saturates: its well, the swing or the converter, whichever is first.
    pub fn saturation_e(&self, exposure: &Exposure) -> f64 {
        let top_v = self.response.inverse(self.adc.top_v(self.swing_v), self.swing_v);
        let by_swing =
            (top_v / exposure.analog_gain - self.offset_v) / self.conversion_gain_v_per_e(exposure.gain_mode);
        by_swing.min(self.full_well_e(exposure.gain_mode))
    }

    /// Returns the relative sensitivity at a chief-ray angle, degrees.
    pub fn chief_ray_factor(&self, angle_deg: f64) -> f64 {
        let table = &self.chief_ray_response;
        let above = table.partition_point(|&(deg, _)| deg < angle_deg);
        match (above.checked_sub(1).map(|i| table[i]), table.get(above)) {
            (None, None) => 1.0,
            (Some((_, only)), None) | (None, Some(&(_, only))) => only,
            (Some((a0, f0)), Some(&(a1, f1))) => f0 + (f1 - f0) * (angle_deg - a0) / (a1 - a0),
        }
    }
}
