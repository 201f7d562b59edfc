//! From a raw frame to a picture.

use dioptric_spectrum::Illuminant;
use ndarray::{Array2, Array3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    Adc, BlackClamp, Brightness, ColorCorrection, ColorMatrix, ColorSpace, Demosaic, Exposure, Highlights,
    LensCorrections, LensShading, LensTables, LocalTone, Perspective, Picture, Raw, Sensor, SensorError, Tile,
    ToneCurve, WhiteBalance,
    balance::gains,
    color::pairs,
    defects, demosaic,
    denoise::{SampleNoise, automatic_strength, denoise, level, noisiness},
    highlights::{Saturated, dimmed, reconstruct},
    lens_tables::warp,
    metering::percentile,
    profile::CameraProfile,
    raw::Levels,
    sharpen::{SharpenedChannels, sharpen},
};

/// What is done to a raw frame, in this order.
///
/// Everything that is left out of a file is as in [`Processing::default`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Processing {
    /// Pixels further than this above or below all their neighbors of the same filter are replaced, as a share of
    /// saturation; left out, none are.
    pub defect_threshold: Option<f64>,
    /// The fall of light towards the corners that is undone; left out, it stays.
    pub shading: Option<LensShading>,
    /// How much noise is taken out of the raw frame: 0 none, 1 what is below three standard deviations; left out, as much as
    /// its own noise asks for. That is none up to a twentieth of the signal at the frame's own level (its median, at most a middle gray of 18 % of
    /// saturation), and 0.5 from a tenth on.
    pub denoise: Option<f64>,
    /// Aberrations of the lens that are undone; left out, they stay.
    pub lens_corrections: LensCorrections,
    /// What is made white.
    #[serde(alias = "white_balance")]
    pub white: WhiteBalance,
    /// What becomes of light beyond saturation.
    pub highlights: Highlights,
    /// How the missing colors are found.
    pub demosaic: Demosaic,
    /// The standard deviation of the blur by lens and pixels that is undone, pixels, as far as noise allows: 0 none, 2 at most.
    pub sharpen_px: f64,
    /// The part of the picture that is stretched to the whole of it; left out, it stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub perspective: Option<Perspective>,
    /// How channels become colors.
    pub color: ColorCorrection,
    /// How bright the picture is made.
    pub brightness: Brightness,
    /// How the contrast between and within parts of the picture is changed; left out, it stays.
    pub local_tone: LocalTone,
    /// The curve from light to codes.
    pub curve: ToneCurve,
    /// The primaries of the picture.
    pub space: ColorSpace,
}

impl Default for Processing {
    /// White by the light on the scene, noisy frames denoised, highlights rebuilt, the best demosaic, as bright as exposed, and
    /// sRGB.
    fn default() -> Self {
        Self {
            defect_threshold: None,
            shading: None,
            denoise: None,
            lens_corrections: LensCorrections::default(),
            white: WhiteBalance::Scene,
            highlights: Highlights::Reconstruct,
            demosaic: Demosaic::DirectionalRatio,
            sharpen_px: 0.0,
            perspective: None,
            color: ColorCorrection::Auto,
            brightness: Brightness::AsExposed,
            local_tone: LocalTone::default(),
            curve: ToneCurve::Srgb,
            space: ColorSpace::Srgb,
        }
    }
}

impl Processing {
    /// Returns the usual processing of a scene under a known light.
    pub fn for_light(light: Illuminant) -> Self {
        Self { white: WhiteBalance::Light(light), ..Self::default() }
    }

    /// Returns the plain chain: noise left as it is, directional interpolation of differences, and channels clipped one by one.
    pub fn plain() -> Self {
        Self { denoise: Some(0.0), highlights: Highlights::Clip, demosaic: Demosaic::Directional, ..Self::default() }
    }

    /// Returns the processing of the paper's Figure 4: bilinear, no balance, no color correction, a power of 0.6.
    pub fn paper() -> Self {
        Self {
            white: WhiteBalance::None,
            demosaic: Demosaic::Bilinear,
            color: ColorCorrection::None,
            curve: ToneCurve::Gamma(0.6),
            ..Self::plain()
        }
    }

    /// Returns the processing under the light on the scene, if that is known: `Scene` and `Auto` become what they stand for.
    #[must_use]
    pub fn under(&self, light: Option<&Illuminant>) -> Self {
        let white = match (&self.white, light) {
            (WhiteBalance::Scene, Some(light)) => WhiteBalance::Light(light.clone()),
            (WhiteBalance::Scene, None) => WhiteBalance::GrayWorld,
            (other, _) => other.clone(),
        };
        let color = match (&self.color, &white, light) {
            (ColorCorrection::Auto | ColorCorrection::Roots, WhiteBalance::None, _) => ColorCorrection::None,
            (ColorCorrection::Auto, WhiteBalance::Light(light), _) | (ColorCorrection::Auto, _, Some(light)) => {
                ColorCorrection::AutoUnder(light.clone())
            }
            (ColorCorrection::Roots, WhiteBalance::Light(light), _) | (ColorCorrection::Roots, _, Some(light)) => {
                ColorCorrection::FittedRoots(light.clone())
            }
            (other, ..) => other.clone(),
        };
        Self { white, color, ..self.clone() }
    }
}

/// Linear light in the primaries of sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPicture {
    /// Light, rows × columns × (red, green, blue); not clipped: colors outside sRGB have negative parts, and rebuilt
    /// highlights parts above 1.
    pub light: Array3<f32>,
    /// What becomes of light above 1 in a picture.
    pub highlights: Highlights,
    /// How the contrast between and within parts is changed in a picture.
    pub local_tone: LocalTone,
    /// The factor on each channel that made white neutral.
    pub balance: Vec<f64>,
    /// The matrix from balanced channels to linear sRGB.
    pub color: ColorMatrix,
}

/// A picture and what was found out while making it.
#[derive(Clone, Debug, PartialEq)]
pub struct Developed {
    /// The picture.
    pub picture: Picture,
    /// The factor on each channel that made white neutral.
    pub balance: Vec<f64>,
    /// The matrix from balanced channels to linear sRGB.
    pub color: ColorMatrix,
    /// The factor on linear light that made the picture as bright as asked.
    pub brightness: f64,
}

impl Sensor {
    /// Returns the picture that a raw frame of this sensor gives.
    ///
    /// # Errors
    /// When the frame is not of this sensor or too small, or a setting makes no sense.
    pub fn develop(&self, raw: &Raw, processing: &Processing) -> Result<Developed, SensorError> {
        self.develop_with(raw, processing, None)
    }

    /// Returns the picture of a raw frame whose lens is known: what [`Processing::lens_corrections`] asks for is undone by its
    /// tables.
    ///
    /// # Errors
    /// As [`develop`](Self::develop), and when corrections are asked for without tables or with those of another frame.
    pub fn develop_with(
        &self,
        raw: &Raw,
        processing: &Processing,
        lens: Option<&LensTables>,
    ) -> Result<Developed, SensorError> {
        let linear = self.develop_linear_with(raw, processing, lens)?;
        Ok(linear.encode(processing.brightness, processing.curve, processing.space))
    }

    /// Returns the linear light of a raw frame, as [`develop`](Self::develop) has it before brightness and tone curve.
    ///
    /// # Errors
    /// As [`develop`](Self::develop).
    pub fn develop_linear(&self, raw: &Raw, processing: &Processing) -> Result<LinearPicture, SensorError> {
        self.develop_linear_with(raw, processing, None)
    }

    /// Returns the linear light of a raw frame whose lens is known.
    ///
    /// # Errors
    /// As [`develop_with`](Self::develop_with).
    pub fn develop_linear_with(
        &self,
        raw: &Raw,
        processing: &Processing,
        lens: Option<&LensTables>,
    ) -> Result<LinearPicture, SensorError> {
        let sheet = self.as_read(&raw.exposure)?;
        let lens = lens.map(|tables| tables.as_read(self, &raw.exposure));
        match Used::of(&sheet, raw) {
            Some(used) => used.develop_linear(&sheet, raw, processing, lens.as_deref()),
            None => develop_linear(&*sheet, raw, processing, lens.as_deref()),
        }
    }

    /// Returns the noise of a frame that does not depend on the signal, rms electrons.
    pub(crate) fn noise_floor_e(&self, raw: &Raw) -> f64 {
        self.floor_e(&raw.levels, &raw.exposure)
    }

    /// Returns the same of samples of these levels and this exposure.
    pub(crate) fn floor_e(&self, levels: &Levels, exposure: &Exposure) -> f64 {
        let is_by_row = self.optical_black.is_some_and(|black| black.clamp == BlackClamp::Row);
        let row_v = if is_by_row { 0.0 } else { self.row_noise_v };
        let volts = self.read_noise_v(exposure.gain_mode).hypot(self.dsnu_v).hypot(row_v);
        let rounding_v = if self.adc == Adc::Analog { 0.0 } else { levels.step_v / 12.0_f64.sqrt() };
        let floor_v = (volts * exposure.analog_gain).hypot(rounding_v);
        let dark_e = self.dark_current.at(exposure.temperature_c) * exposure.time_s;
        let own_e = (floor_v / levels.volts_per_electron).hypot(dark_e.sqrt());
        match self.n_clamped_by() {
            None => own_e,
            // The mean that was taken off has noise, and what is left was rounded once more.
            Some(n) => (own_e * (1.0 + 1.0 / n).sqrt()).hypot(rounding_v / levels.volts_per_electron),
        }
    }
}

/// The filters that stand before pixels of a sensor which has others besides: these see nothing, and must have no part in colors.
struct Used {
    filters: Vec<usize>,
    n_all: usize,
}

impl Used {
    /// Returns them, or `None` where all filters are used.
    fn of(sensor: &Sensor, raw: &Raw) -> Option<Self> {
        let n_all = sensor.filters.len();
        let tile = raw.tile.as_ref()?;
        let is_used = |filter: &usize| (0..tile.rows()).any(|row| tile.row(row).contains(filter));
        let filters: Vec<usize> = (0..n_all).filter(is_used).collect();
        (filters.len() < n_all && !filters.is_empty()).then_some(Self { filters, n_all })
    }

    fn only<T: Clone>(&self, all: &[T]) -> Vec<T> {
        // What has another length is refused by whoever takes it.
        if all.len() == self.n_all {
            self.filters.iter().map(|&filter| all[filter].clone()).collect()
        } else {
            all.to_vec()
        }
    }

    /// Develops a frame as that of a sensor without the other filters, whose factors are then 1 in the balance and 0 in the matrix.
    fn develop_linear(
        &self,
        sensor: &Sensor,
        raw: &Raw,
        processing: &Processing,
        lens: Option<&LensTables>,
    ) -> Result<LinearPicture, SensorError> {
        let sensor = Sensor { filters: self.only(&sensor.filters), ..sensor.clone() };
        let number = |filter: usize| self.filters.iter().position(|used| *used == filter).unwrap_or(0);
        let tile = raw.tile.as_ref().map(|tile| tile.renumbered(number));
        let raw = Raw { tile, filter_names: self.only(&raw.filter_names), ..raw.clone() };
        let white = match &processing.white {
            WhiteBalance::Gains(gains) => WhiteBalance::Gains(self.only(gains)),
            white => white.clone(),
        };
        let color = match &processing.color {
            ColorCorrection::Matrix(rows) => ColorCorrection::Matrix(rows.each_ref().map(|row| self.only(row))),
            color => color.clone(),
        };
        let lens = lens.map(|tables| LensTables {
            size: tables.size,
            distortion_px: tables.distortion_px.clone(),
            lateral_color_px: self.only(&tables.lateral_color_px),
            vignetting: self.only(&tables.vignetting),
        });
        let processing = Processing { white, color, ..processing.clone() };
        let linear = develop_linear(&sensor, &raw, &processing, lens.as_ref())?;
        let mut balance = vec![1.0; self.n_all];
        self.filters.iter().zip(&linear.balance).for_each(|(&filter, gain)| balance[filter] = *gain);
        Ok(LinearPicture { balance, color: self.widened(&linear.color), ..linear })
    }

    /// Returns a matrix with factors of 0 for the filters that are not used, and for roots of their products.
    fn widened(&self, color: &ColorMatrix) -> ColorMatrix {
        let n = self.filters.len();
        let roots: Vec<(usize, usize)> = if color.has_roots { pairs(self.n_all).collect() } else { Vec::new() };
        let rows = color.rows.each_ref().map(|row| {
            let mut wide = vec![0.0; self.n_all + roots.len()];
            for (&filter, factor) in self.filters.iter().zip(row) {
                wide[filter] = *factor;
            }
            for ((i, j), factor) in pairs(n).zip(row.iter().skip(n)).filter(|_| color.has_roots) {
                let pair = (self.filters[i], self.filters[j]);
                if let Some(place) = roots.iter().position(|own| *own == pair) {
                    wide[self.n_all + place] = *factor;
                }
            }
            wide
        });
        ColorMatrix { rows, has_roots: color.has_roots, delta_e: color.delta_e.clone() }
    }
}

/// Returns the linear light of a frame of a camera.
///
/// # Errors
/// When a setting makes no sense, or the frame, the lens and the camera do not fit each other.
pub(crate) fn develop_linear(
    camera: &dyn CameraProfile,
    raw: &Raw,
    processing: &Processing,
    lens: Option<&LensTables>,
) -> Result<LinearPicture, SensorError> {
    raw.check()?;
    check_settings(camera, raw, processing)?;
    let corrections = processing.lens_corrections;
    let n_channels = camera.n_channels();
    let lens = needed_tables(corrections, lens)?;
    lens.map_or(Ok(()), |lens| lens.check(raw.size(), n_channels))?;
    let processing = processing.under(None);
    let tile = raw.tile.as_ref();
    let noise = camera.sample_noise(raw);
    let mut planes = raw.linear();
    let saturated = match processing.highlights {
        Highlights::Clip => None,
        Highlights::Reconstruct => Saturated::find(&planes, tile, n_channels, camera.saturated_from(raw)),
    };
    let level = level(&planes, tile, middle(n_channels));
    clean(&mut planes, tile, &processing, (&noise, level));
    if let Some(lens) = lens.filter(|_| corrections.vignetting) {
        lens.even_out(&mut planes, tile);
    }
    let balance = gains(camera, &planes, tile, &processing.white)?;
    weigh(&mut planes, tile, &balance, processing.highlights);
    // Either way the planes are given up here: frames are large.
    let mut channels = match tile {
        Some(tile) => demosaic(&planes.swap_remove(0), tile, n_channels, processing.demosaic)?,
        None => planes.into_iter().map(|plane| plane.as_standard_layout().into_owned()).collect(),
    };
    if let Some(saturated) = saturated {
        reconstruct(&mut channels, &saturated, &balance);
    }
    channels = camera.corrected(channels, &balance);
    if let Some(lens) = lens.filter(|_| corrections.moves()) {
        let sources: Vec<_> = (0..n_channels).map(|channel| lens.source_px(channel, corrections)).collect();
        channels = warp(&channels, &sources);
    }
    let middle_noise = &noise[middle(noise.len())];
    let roots_weight = 1.0 - noisiness(middle_noise, level);
    let color = camera.color_matrix(&processing.color, &balance, roots_weight)?;
    if processing.sharpen_px > 0.0 {
        let luminance = color.luminance_shares(n_channels);
        let of = SharpenedChannels { luminance: &luminance, balance: &balance, noise: middle_noise };
        sharpen(&mut channels, processing.sharpen_px, &of);
    }
    if let Some(perspective) = processing.perspective {
        channels = perspective.apply(&channels);
    }
    let Processing { highlights, local_tone, .. } = processing;
    Ok(LinearPicture { light: mix(&channels, &color), highlights, local_tone, balance, color })
}

fn check_settings(camera: &dyn CameraProfile, raw: &Raw, processing: &Processing) -> Result<(), SensorError> {
    let shape = |what, expected: usize, found: usize| {
        Err(SensorError::Shape { what, expected: expected.to_string(), found: found.to_string() })
    };
    let n_channels = camera.n_channels();
    processing.check()?;
    processing.shading.as_ref().map_or(Ok(()), |shading| shading.check(n_channels))?;
    if raw.filter_names.len() != n_channels {
        return shape("filters of the raw frame", n_channels, raw.filter_names.len());
    }
    processing.white.check(n_channels)?;
    processing.color.check(n_channels)
}

impl Processing {
    /// Checks every number that makes sense or not whatever the frame is, so that a wrong one is found before there is any.
    ///
    /// # Errors
    /// Names the first number that makes no sense, and what was expected.
    pub fn check(&self) -> Result<(), SensorError> {
        let wrong = |key, value, expected| Err(SensorError::value("the processing", key, value, expected));
        let not_negative =
            [("defect_threshold", self.defect_threshold.unwrap_or(0.0)), ("denoise", self.denoise.unwrap_or(0.0))];
        if let Some((key, value)) = not_negative.into_iter().find(|(_, v)| !(*v >= 0.0 && v.is_finite())) {
            return wrong(key, value, "a number of 0 or more");
        }
        let (key, value, right) = match self.brightness {
            Brightness::AsExposed => ("", 1.0, true),
            Brightness::Factor(factor) => ("brightness.factor", factor, factor > 0.0 && factor.is_finite()),
            Brightness::Percentile { percent, to } if (0.0..=100.0).contains(&percent) => {
                ("brightness.to", to, to > 0.0 && to.is_finite())
            }
            Brightness::Percentile { percent, .. } => ("brightness.percent", percent, false),
        };
        if !right {
            return wrong(key, value, "a number above 0, and at most 100 %");
        }
        if !(0.0..=2.0).contains(&self.sharpen_px) {
            return wrong("sharpen_px", self.sharpen_px, "0 to 2 pixels");
        }
        // Gains are counted where the channels are known.
        if !matches!(self.white, WhiteBalance::Gains(_)) {
            self.white.check(0)?;
        }
        self.perspective.map_or(Ok(()), |perspective| perspective.check())?;
        self.local_tone.check()?;
        self.curve.check()
    }
}

/// Mends defects, undoes a given fall of light and takes out noise, that of each filter.
fn clean(
    planes: &mut [Array2<f32>],
    tile: Option<&Tile>,
    processing: &Processing,
    (noise, level): (&[SampleNoise], f64),
) {
    if let Some(threshold) = processing.defect_threshold {
        defects::correct(planes, tile, threshold as f32);
    }
    if let Some(shading) = &processing.shading {
        shading.correct(planes, tile);
    }
    let strength = processing.denoise.unwrap_or_else(|| automatic_strength(&noise[middle(noise.len())], level));
    if strength > 0.0 {
        denoise(planes, tile, noise, strength);
    }
}

/// Returns which of so many filters stands for all: the second of several, which is green in most files, or the only one.
fn middle(n: usize) -> usize {
    1.min(n - 1)
}

impl LinearPicture {
    /// Returns the light at a brightness, not clipped, rows × columns × (red, green, blue) in the primaries of sRGB.
    pub fn bright(mut self, brightness: Brightness) -> Array3<f32> {
        let factor = factor(&self.light, brightness) as f32;
        self.light.par_mapv_inplace(|v| v * factor);
        self.light
    }

    /// Returns the picture of a brightness, a tone curve and primaries; colors outside these are clipped, but for highlights that
    /// keep their hue.
    pub fn encode(self, brightness: Brightness, curve: ToneCurve, space: ColorSpace) -> Developed {
        let brightness = factor(&self.light, brightness);
        let table = curve.table();
        let keeps_hue = self.highlights == Highlights::Reconstruct;
        let mut codes = self.light;
        let tone = self.local_tone;
        let local = (!tone.is_none()).then(|| tone.factors(codes.view(), brightness as f32));
        let local = local.as_ref().map(|factors| factors.as_slice().expect("a new array is contiguous"));
        let all = codes.as_slice_mut().expect("linear pictures are made contiguous");
        all.par_chunks_exact_mut(3).enumerate().for_each(|(place, pixel)| {
            let factor = brightness as f32 * local.map_or(1.0, |factors| factors[place]);
            let light = space.from_linear_srgb([0, 1, 2].map(|i| pixel[i] * factor));
            let light = if keeps_hue { dimmed(light) } else { light };
            pixel.iter_mut().zip(light).for_each(|(code, light)| *code = table.encode(light));
        });
        Developed { picture: Picture { codes, space }, balance: self.balance, color: self.color, brightness }
    }
}

/// Returns the tables that the corrections need; none where there is nothing to correct.
fn needed_tables(corrections: LensCorrections, lens: Option<&LensTables>) -> Result<Option<&LensTables>, SensorError> {
    if corrections.is_none() || lens.is_some() {
        return Ok(lens.filter(|_| !corrections.is_none()));
    }
    let reason = "need the tables of the lens that made the frame, expected them with it or no corrections".to_owned();
    Err(SensorError::Unsuitable { what: "lens_corrections", reason })
}

/// Multiplies each channel by its factor, and clips it at the saturation of the least sensitive where highlights are clipped.
fn weigh(planes: &mut [Array2<f32>], tile: Option<&Tile>, balance: &[f64], highlights: Highlights) {
    let top = if highlights == Highlights::Clip { 1.0 } else { f32::INFINITY };
    for (number, plane) in planes.iter_mut().enumerate() {
        plane.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut values)| {
            let filters = tile.map_or(std::slice::from_ref(&number), |tile| tile.row(row));
            let gains: Vec<f32> = filters.iter().map(|&filter| balance[filter] as f32).collect();
            let gains = gains.iter().cycle();
            values.iter_mut().zip(gains).for_each(|(value, gain)| *value = (*value * gain).min(top));
        });
    }
}

/// Returns linear sRGB from channels: rows × columns × 3.
fn mix(channels: &[Array2<f32>], color: &ColorMatrix) -> Array3<f32> {
    let (n_rows, n_columns) = channels[0].dim();
    let rows: [Vec<f32>; 3] = color.rows.each_ref().map(|row| row.iter().map(|&m| m as f32).collect());
    let mut linear = Array3::<f32>::zeros((n_rows, n_columns, 3));
    let lines = linear.as_slice_mut().expect("a new array is contiguous").par_chunks_mut(3 * n_columns);
    let n_channels = channels.len();
    lines.enumerate().for_each(|(row, line)| {
        let factors = |term: usize| rows.each_ref().map(|row| row[term]);
        for (channel, plane) in channels.iter().enumerate() {
            add_term(line, factors(channel), plane.row(row).iter().copied());
        }
        for ((i, j), term) in pairs(n_channels).zip(n_channels..).filter(|_| color.has_roots) {
            let products = channels[i].row(row).into_iter().zip(channels[j].row(row));
            add_term(line, factors(term), products.map(|(a, b)| (a.max(0.0) * b.max(0.0)).sqrt()));
        }
    });
    linear
}

/// Adds values times the factors of red, green and blue to a row of pixels.
#[inline]
fn add_term(line: &mut [f32], factors: [f32; 3], values: impl Iterator<Item = f32>) {
    for (pixel, value) in line.chunks_exact_mut(3).zip(values) {
        pixel[0] += factors[0] * value;
        pixel[1] += factors[1] * value;
        pixel[2] += factors[2] * value;
    }
}

/// Returns the factor on linear light that a brightness asks for.
fn factor(linear: &Array3<f32>, brightness: Brightness) -> f64 {
    match brightness {
        Brightness::AsExposed => 1.0,
        Brightness::Factor(factor) => factor,
        Brightness::Percentile { percent, to } => {
            let pixels = linear.as_slice().expect("a new array is contiguous").par_chunks_exact(3);
            // The luminance of linear sRGB (IEC 61966-2-1).
            let luminances = pixels.map(|rgb| 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]).collect();
            let level = percentile(luminances, percent);
            if level > 0.0 { to / level } else { 1.0 }
        }
    }
}
