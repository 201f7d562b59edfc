//! Noise as EMVA standard 1288 tells it: photon transfer from flat and dark frames, simulated or from files.

use std::{
    fs,
    path::{Path, PathBuf},
};

use dioptric_sensor::{
    Bench, BenchSettings, Binning, DarkCurrentEstimate, Exposure, FlatPoint, FrameStack, NonUniformity, Parts,
    PhotonTransfer, Raw, Sensor, Spectrogram,
};
use dioptric_spectrum::Illuminant;
use ndarray::Array2;
use serde::Serialize;

use super::frames::{DESCRIPTOR_FILE, FileSeries, descriptor, find_series, read_frame};
use dioptric_pipeline::PipelineError;

/// The light for which ISO speeds are given.
const ISO_LIGHT: Illuminant = Illuminant::D55;
/// Signal-to-noise ratios of ISO 12232's noise-based speeds: excellent and acceptable.
const ISO_SNR: [f64; 2] = [40.0, 10.0];
/// How far exposure times of flat frames may lie apart.
const SAME_TIME: f64 = 1e-6;

/// A sensor to be put on the simulated bench.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchRequest {
    /// The sensor.
    pub sensor: Sensor,
    /// The filter; the one that sees the light best where it is not given.
    pub filter: Option<String>,
    /// The side of the square of pixels; 512 where it is not given.
    pub side: Option<usize>,
    /// Levels of light, two frames each; 40 where it is not given.
    pub n_levels: Option<usize>,
    /// Frames of each stack that shows the non-uniformities; 64 where it is not given.
    pub n_stacked: Option<usize>,
    /// The wavelength of the light, nm; 550 where it is not given.
    pub wavelength_nm: Option<f64>,
    /// The exposure time, s; 0.01 where it is not given.
    pub time_s: Option<f64>,
    /// The factor on the voltage; 1 where it is not given.
    pub analog_gain: Option<f64>,
    /// Pixels that are read as one.
    pub binning: Option<Binning>,
    /// The temperature of the chip, °C; 25 where it is not given.
    pub temperature_c: Option<f64>,
    /// The seed of all noise.
    pub seed: u64,
}

impl BenchRequest {
    fn settings(&self) -> BenchSettings {
        let standard = BenchSettings::default();
        BenchSettings {
            side: self.side.unwrap_or(standard.side),
            n_levels: self.n_levels.unwrap_or(standard.n_levels),
            n_stacked: self.n_stacked.unwrap_or(standard.n_stacked),
            wavelength_nm: self.wavelength_nm.unwrap_or(standard.wavelength_nm),
            exposure: Exposure {
                time_s: self.time_s.unwrap_or(standard.exposure.time_s),
                analog_gain: self.analog_gain.unwrap_or(standard.exposure.analog_gain),
                temperature_c: self.temperature_c.unwrap_or(standard.exposure.temperature_c),
                binning: self.binning,
                ..standard.exposure
            },
            seed: self.seed,
        }
    }
}

/// Parameters of EMVA standard 1288, release 4.0 (linear model).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseData {
    /// The sensor, or the file or folder of frames.
    pub source: String,
    /// The filter in front of the pixels, where it is known.
    pub filter: Option<String>,
    /// Rows of pixels.
    pub rows: usize,
    /// Columns of pixels.
    pub columns: usize,
    /// The number of frames.
    pub n_frames: usize,
    /// The system gain K, DN an electron.
    pub gain_dn_per_e: f64,
    /// DN a photon; none where photons were not counted.
    pub responsivity_dn_per_photon: Option<f64>,
    /// Electrons a photon on the whole area of a pixel.
    pub quantum_efficiency: Option<f64>,
    /// The temporal dark noise σd without that of rounding, electrons; none where dark frames are cut off at the lowest code.
    pub dark_noise_e: Option<f64>,
    /// Whether rounding hides it, so that it is less than this.
    pub dark_noise_is_limit: bool,
    /// The mean deviation of the signal from a straight line, from 5 to 95 % of saturation, percent; none with fewer than three points there.
    pub linearity_error_percent: Option<f64>,
    /// The largest deviation, percent.
    pub largest_linearity_error_percent: Option<f64>,
    /// The electrons at which the variance is largest; none where the series ends before it falls.
    pub saturation_e: Option<f64>,
    /// The photons at which it is.
    pub saturation_photons: Option<f64>,
    /// The electrons at which signal and noise are equal; none without the dark noise.
    pub threshold_e: Option<f64>,
    /// The photons at which they are.
    pub threshold_photons: Option<f64>,
    /// Saturation over threshold, dB.
    pub dynamic_range_db: Option<f64>,
    /// The same in powers of two.
    pub dynamic_range_stops: Option<f64>,
    /// The largest signal-to-noise ratio, dB; none where the series ends before saturation.
    pub max_snr_db: Option<f64>,
    /// Dark-signal non-uniformity, rms electrons; none without stacks of three frames or more, and where rounding or the lowest code hides it.
    pub dsnu_e: Option<f64>,
    /// One standard error of it.
    pub dsnu_error_e: Option<f64>,
    /// Photo-response non-uniformity, rms percent.
    pub prnu_percent: Option<f64>,
    /// One standard error of it.
    pub prnu_error_percent: Option<f64>,
    /// What of the first is of rows, columns and single pixels, rms electrons.
    pub dsnu_parts_e: Option<Parts>,
    /// What of the second, rms percent.
    pub prnu_parts_percent: Option<Parts>,
    /// How the mean frames of the stacks differ over the chip; none without stacks.
    pub patterns: Option<SpatialPatterns>,
    /// The dark current from the rise of the mean, electrons a second; none without dark frames of several times.
    pub dark_current_by_mean_e_per_s: Option<f64>,
    /// The dark current from the rise of the variance.
    pub dark_current_by_variance_e_per_s: Option<f64>,
    /// By how much the bench raised the black level, DN, so that it does not cut off the noise of darkness; 0 for frames from files.
    pub raised_black_dn: u16,
    /// What of this is not measured or only a limit, and why, a sentence each.
    pub notes: Vec<String>,
    /// What the sensor's data sheet says of the same; none for frames from files.
    pub data_sheet: Option<NoiseDataSheet>,
    /// The points of the photon transfer, darkness first.
    pub points: Vec<NoisePoint>,
}

/// How the mean dark frame, and that about half saturation, differ from pixel to pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpatialPatterns {
    /// Frequencies along rows, cycles a pixel.
    pub horizontal_cycles_per_pixel: Vec<f64>,
    /// The root of the power of dark patterns at each, electrons.
    pub horizontal_dsnu_e: Vec<f64>,
    /// The root of the power of bright patterns, percent of the signal.
    pub horizontal_prnu_percent: Vec<f64>,
    /// Frequencies along columns.
    pub vertical_cycles_per_pixel: Vec<f64>,
    /// The same of dark patterns along columns.
    pub vertical_dsnu_e: Vec<f64>,
    /// The same of bright ones.
    pub vertical_prnu_percent: Vec<f64>,
    /// The variance of dark patterns over that of white ones of the median of the spectrum along rows, and along columns: 1 of white noise.
    /// None where rounding or the lowest code hides them.
    pub dsnu_nonwhiteness: Option<[f64; 2]>,
    /// The same of bright ones.
    pub prnu_nonwhiteness: [f64; 2],
    /// Shares of all pixels, in powers of a half from 1/2 on, and by how many electrons these or fewer pixels are off in the dark.
    pub dsnu_accumulated_e: Vec<(f64, f64)>,
    /// The same of the response, percent of the signal.
    pub prnu_accumulated_percent: Vec<(f64, f64)>,
}

impl SpatialPatterns {
    /// Whether dark patterns are measured is said by who measures them.
    fn of((dark, dark_is_measured): (&FrameStack, bool), bright: &FrameStack, gain_dn_per_e: f64) -> Self {
        let (to_e, to_percent) = (1.0 / gain_dn_per_e, 100.0 / (bright.mean() - dark.mean()));
        let scaled = |spectrogram: &Spectrogram, by: f64| spectrogram.amplitude_dn.iter().map(|v| v * by).collect();
        let along = [true, false].map(|rows| (dark.spectrogram(rows), bright.spectrogram(rows)));
        let variance = |stack: &FrameStack| {
            stack.deviations_dn().iter().map(|v| v * v).sum::<f64>() / stack.deviations_dn().len() as f64
        };
        let nonwhite = |stack: &FrameStack, of: &Spectrogram| variance(stack) / of.white_dn().powi(2);
        let [(dark_along_rows, bright_along_rows), (dark_along_columns, bright_along_columns)] = &along;
        Self {
            horizontal_cycles_per_pixel: dark_along_rows.frequencies.clone(),
            horizontal_dsnu_e: scaled(dark_along_rows, to_e),
            horizontal_prnu_percent: scaled(bright_along_rows, to_percent),
            vertical_cycles_per_pixel: dark_along_columns.frequencies.clone(),
            vertical_dsnu_e: scaled(dark_along_columns, to_e),
            vertical_prnu_percent: scaled(bright_along_columns, to_percent),
            dsnu_nonwhiteness: dark_is_measured
                .then(|| [nonwhite(dark, dark_along_rows), nonwhite(dark, dark_along_columns)]),
            prnu_nonwhiteness: [nonwhite(bright, bright_along_rows), nonwhite(bright, bright_along_columns)],
            dsnu_accumulated_e: accumulated(dark.deviations_dn(), to_e),
            prnu_accumulated_percent: accumulated(bright.deviations_dn(), to_percent),
        }
    }
}

/// Returns by how much halves, quarters, eighths … of the pixels are off at least: defects are at its end.
fn accumulated(deviations_dn: Vec<f64>, scale: f64) -> Vec<(f64, f64)> {
    let mut off: Vec<f64> = deviations_dn.into_iter().map(f64::abs).collect();
    off.sort_unstable_by(|a, b| b.total_cmp(a));
    let n = off.len();
    let mut shares = Vec::new();
    let mut count = n / 2;
    while count >= 1 {
        shares.push((count as f64 / n as f64, scale * off[count - 1]));
        count /= 2;
    }
    shares
}

/// What a sensor's data sheet says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseDataSheet {
    /// The system gain, DN an electron.
    pub gain_dn_per_e: f64,
    /// Electrons a photon on the whole area of a pixel.
    pub quantum_efficiency: f64,
    /// Read noise and the shot noise of the dark current, electrons.
    pub dark_noise_e: f64,
    /// The electrons at which a pixel saturates.
    pub saturation_e: f64,
    /// DSNU and the columns' offsets, rms electrons.
    pub dsnu_e: f64,
    /// PRNU and the columns' gains, rms percent.
    pub prnu_percent: f64,
    /// The dark current, electrons a second.
    pub dark_current_e_per_s: f64,
    /// The saturation-based ISO speed in daylight (D55).
    pub iso_by_saturation: f64,
    /// The noise-based ISO speed at a signal-to-noise ratio of 40; none where PRNU never lets it.
    pub iso_by_noise_40: Option<f64>,
    /// The noise-based ISO speed at a ratio of 10.
    pub iso_by_noise_10: Option<f64>,
}

/// A point of the photon transfer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoisePoint {
    /// The photons that fell on a pixel, where they were counted.
    pub photons: Option<f64>,
    /// The mean of both frames, DN.
    pub mean_dn: f64,
    /// The temporal variance, DN².
    pub variance_dn2: f64,
    /// The electrons that the mean stands for.
    pub electrons: f64,
    /// The signal-to-noise ratio; none in the dark.
    pub snr: Option<f64>,
    /// The ratio that the linear model gives for as many electrons.
    pub model_snr: Option<f64>,
    /// The same of one frame with what differs from pixel to pixel; none without stacks.
    pub total_snr: Option<f64>,
}

/// Puts a sensor on the simulated bench; its frames are kept as 16-bit PNG with a descriptor where a folder is given.
///
/// # Errors
/// When the sensor cannot be opened, a setting makes no sense or a frame cannot be written.
pub fn measure_bench(request: &BenchRequest, frames_folder: Option<&Path>) -> Result<NoiseData, PipelineError> {
    let sensor = &request.sensor;
    let bench = Bench::new(sensor, request.settings(), request.filter.as_deref())?;
    let mut collected = Collected::default();
    let mut kept = Vec::new();
    let mut number = 0;
    for (index, series) in bench.series().iter().enumerate() {
        let mut files = Vec::new();
        let mut taken = Taken::new(Some(series.time_s), Some(series.photons));
        for shot in 0..series.n_frames {
            let raw = bench.frame(series, number)?;
            number += 1;
            if let Some(folder) = frames_folder {
                let kind = if series.photons > 0.0 { "flat" } else { "dark" };
                let name = format!("{kind}-{index:03}-{shot:03}.png");
                raw.write(&folder.join(&name))?;
                files.push(PathBuf::from(name));
            }
            taken.add(numbers_of(&raw))?;
        }
        kept.push(FileSeries { time_s: Some(series.time_s), photons: Some(series.photons), files });
        collected.add(taken)?;
    }
    if let Some(folder) = frames_folder {
        let bits = u32::from(bench.sheet().adc.top_dn().unwrap_or(u16::MAX)).count_ones();
        let path = folder.join(DESCRIPTOR_FILE);
        let text = descriptor(bits, bench.settings().side, &kept);
        fs::write(&path, text).map_err(|e| PipelineError::Write { path, reason: e.to_string() })?;
    }
    let data = collected.analyze(sensor.name.clone())?;
    let (filter, raised_black_dn) = (Some(bench.filter().to_owned()), bench.raised_black_dn());
    Ok(NoiseData { filter, raised_black_dn, data_sheet: Some(data_sheet(&bench)), ..data })
}

/// Measures the frames that a descriptor file lists, or of a folder.
///
/// A folder holds `descriptor.txt`, or PNG or TIFF files named `dark…` and `flat…`; frames under equal light differ in
/// name after the last `-` or `_` only, and their photons are then not known.
///
/// # Errors
/// When a file cannot be read or is no gray picture of whole numbers, frames differ in size, or there are too few.
pub fn measure_frames(path: &Path) -> Result<NoiseData, PipelineError> {
    let in_file = |error: PipelineError| match error {
        PipelineError::Sensor(error) => PipelineError::Read { path: path.to_owned(), reason: error.to_string() },
        PipelineError::Unsuitable { what, reason } => {
            PipelineError::Read { path: path.to_owned(), reason: format!("{what} {reason}") }
        }
        other => other,
    };
    let (mut collected, mut told) = (Collected::default(), vec![]);
    for series in find_series(path)? {
        let mut taken = Taken::new(series.time_s, series.photons);
        for file in &series.files {
            let mut own = vec![];
            let frame = read_frame(file)?.told_in(&mut own);
            // What all frames of a camera say is told of the first.
            if told.is_empty() {
                told = own;
            }
            taken.add(frame).map_err(|e| PipelineError::Read { path: file.clone(), reason: e.to_string() })?;
        }
        collected.add(taken).map_err(in_file)?;
    }
    let mut data = collected.analyze(path.display().to_string()).map_err(in_file)?;
    data.notes.append(&mut told);
    Ok(data)
}

/// Frames under equal light that a program holds.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameSeries {
    /// The exposure time, s, where it is known.
    pub time_s: Option<f64>,
    /// The photons that fell on a pixel: 0 for dark frames, `None` where they were not counted.
    pub photons: Option<f64>,
    /// Two frames or more of digital numbers, of one size.
    pub frames: Vec<Array2<f32>>,
}

/// Measures frames that a program holds; `name` is what they are called.
///
/// # Errors
/// When frames differ in size, hold a number that is not finite, or there are too few.
pub fn measure_series(name: &str, series: Vec<FrameSeries>) -> Result<NoiseData, PipelineError> {
    let mut collected = Collected::default();
    for FrameSeries { time_s, photons, frames } in series {
        let mut taken = Taken::new(time_s, photons);
        for frame in frames {
            if frame.iter().any(|dn| !dn.is_finite()) {
                return Err(too_few("hold a number that is not finite".to_owned()));
            }
            taken.add(frame)?;
        }
        collected.add(taken)?;
    }
    collected.analyze(name.to_owned())
}

fn numbers_of(raw: &Raw) -> Array2<f32> {
    raw.planes[0].samples().into_owned()
}

fn data_sheet(bench: &Bench) -> NoiseDataSheet {
    let (sensor, exposure) = (bench.sheet(), bench.settings().exposure);
    let gain_v_per_e = sensor.conversion_gain_v_per_e(exposure.gain_mode);
    let step_v = sensor.adc.step_v(sensor.swing_v).unwrap_or(1.0);
    let dark_e_per_s = sensor.dark_current.at(exposure.temperature_c);
    let read_e = sensor.read_noise_v(exposure.gain_mode).hypot(sensor.row_noise_v) / gain_v_per_e;
    let read_e = read_e.hypot(sensor.telegraph.rms_e(sensor.correlated_double_sampling));
    let [iso_40, iso_10] = ISO_SNR.map(|snr| sensor.iso_by_noise(&ISO_LIGHT, &exposure, snr));
    NoiseDataSheet {
        gain_dn_per_e: gain_v_per_e * exposure.analog_gain / step_v,
        quantum_efficiency: bench.quantum_efficiency(),
        dark_noise_e: read_e.hypot((dark_e_per_s * exposure.time_s).sqrt()),
        saturation_e: sensor.saturation_e(&exposure),
        dsnu_e: sensor.dsnu_v.hypot(sensor.column_offset_v) / gain_v_per_e,
        prnu_percent: 100.0 * sensor.prnu_fraction.hypot(sensor.column_gain_fraction),
        dark_current_e_per_s: dark_e_per_s,
        iso_by_saturation: sensor.iso_by_saturation(&ISO_LIGHT, &exposure),
        iso_by_noise_40: iso_40,
        iso_by_noise_10: iso_10,
    }
}

/// The frames of one series: the first two make a point, three and more a stack.
struct Taken {
    time_s: Option<f64>,
    photons: Option<f64>,
    first: Vec<Array2<f32>>,
    stack: FrameStack,
}

impl Taken {
    fn new(time_s: Option<f64>, photons: Option<f64>) -> Self {
        Self { time_s, photons, first: Vec::new(), stack: FrameStack::default() }
    }

    fn add(&mut self, frame: Array2<f32>) -> Result<(), PipelineError> {
        self.stack.add(&frame)?;
        if self.first.len() < 2 {
            self.first.push(frame);
        }
        Ok(())
    }
}

/// A series when its frames are gone.
struct Measured {
    time_s: Option<f64>,
    photons: Option<f64>,
    point: FlatPoint,
    stack: Option<FrameStack>,
    /// Whether its frames are dark and cut off at the lowest code.
    is_cut_off: bool,
}

impl Measured {
    fn is_dark(&self) -> bool {
        self.photons == Some(0.0)
    }
}

/// All series of a bench.
#[derive(Default)]
struct Collected {
    series: Vec<Measured>,
    size: Option<(usize, usize)>,
    n_frames: usize,
}

impl Collected {
    fn add(&mut self, taken: Taken) -> Result<(), PipelineError> {
        let Taken { time_s, photons, first, stack } = taken;
        let [a, b] = first.as_slice() else {
            return Err(too_few(format!("a series has {} frames, expected 2 or more", first.len())));
        };
        if let Some((rows, columns)) = self.size.filter(|size| *size != a.dim()) {
            let found = format!("{} × {}", a.nrows(), a.ncols());
            return Err(too_few(format!("have {rows} × {columns} and {found} pixels, expected frames of one size")));
        }
        self.size = Some(a.dim());
        self.n_frames += stack.n_frames();
        let point = FlatPoint::measure(photons.unwrap_or(0.0), a, b)?;
        let is_cut_off = photons == Some(0.0) && is_cut_off(&first, point.variance_dn2);
        self.series.push(Measured {
            time_s,
            photons,
            point,
            stack: (stack.n_frames() > 2).then_some(stack),
            is_cut_off,
        });
        Ok(())
    }

    fn analyze(&self, source: String) -> Result<NoiseData, PipelineError> {
        let flats: Vec<&Measured> = self.series.iter().filter(|s| !s.is_dark()).collect();
        let times: Vec<f64> = flats.iter().filter_map(|s| s.time_s).collect();
        let time_s = times.first().copied();
        if times.iter().any(|t| (t / times[0] - 1.0).abs() > SAME_TIME) {
            let reason = "differ in exposure time, expected one time and light of several levels".to_owned();
            return Err(PipelineError::Unsuitable { what: "the flat frames", reason });
        }
        // The dark frames of the flat frames' own time, or the nearest to it.
        let distance = |s: &Measured| (s.time_s.unwrap_or(0.0) - time_s.unwrap_or(0.0)).abs();
        let dark = self.series.iter().filter(|s| s.is_dark()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let dark = dark.ok_or_else(|| too_few("have no dark series among them".to_owned()))?;
        let are_counted = flats.iter().all(|s| s.photons.is_some());
        // Where photons were not counted the signal stands for them: only ratios to it then have a meaning.
        let points: Vec<FlatPoint> = flats
            .iter()
            .map(|s| FlatPoint { photons: s.photons.unwrap_or(s.point.mean_dn - dark.point.mean_dn), ..s.point })
            .collect();
        let transfer = PhotonTransfer::fit(dark.point, &points)?;
        let uniformity = self.uniformity(&transfer)?;
        let current = self.dark_current(&transfer);
        let (rows, columns) = self.size.unwrap_or_default();
        let counted = |value: f64| are_counted.then_some(value);
        let dark_is_whole = !self.series.iter().any(|s| s.is_cut_off);
        let threshold_e = dark_is_whole.then_some(transfer.threshold_photons * transfer.quantum_efficiency);
        let saturation_e = transfer.is_saturated.then_some(transfer.saturation_e);
        let range = saturation_e.zip(threshold_e).map(|(most, least)| most / least);
        let dark_pattern = uniformity.filter(|u| dark_is_whole && !u.dsnu_is_hidden);
        let response = uniformity.filter(|u| !u.prnu_is_hidden);
        Ok(NoiseData {
            source,
            filter: None,
            rows,
            columns,
            n_frames: self.n_frames,
            gain_dn_per_e: transfer.gain_dn_per_e,
            responsivity_dn_per_photon: counted(transfer.responsivity_dn_per_photon),
            quantum_efficiency: counted(transfer.quantum_efficiency),
            dark_noise_e: dark_is_whole.then_some(transfer.dark_noise_e),
            dark_noise_is_limit: transfer.dark_noise_is_limit,
            linearity_error_percent: transfer.linearity.as_ref().map(|linearity| 100.0 * linearity.mean_error),
            largest_linearity_error_percent: transfer
                .linearity
                .as_ref()
                .map(|linearity| 100.0 * linearity.largest_error),
            saturation_e,
            saturation_photons: saturation_e.and_then(|e| counted(e / transfer.quantum_efficiency)),
            threshold_e,
            threshold_photons: threshold_e.and_then(|e| counted(e / transfer.quantum_efficiency)),
            dynamic_range_db: range.map(|range| 20.0 * range.log10()),
            dynamic_range_stops: range.map(f64::log2),
            max_snr_db: saturation_e.map(|_| 20.0 * transfer.max_snr().log10()),
            dsnu_e: dark_pattern.map(|u| u.dsnu_e),
            dsnu_error_e: dark_pattern.map(|u| u.dsnu_error_e),
            prnu_percent: response.map(|u| 100.0 * u.prnu_fraction),
            prnu_error_percent: response.map(|u| 100.0 * u.prnu_error_fraction),
            dsnu_parts_e: dark_pattern.map(|u| u.dsnu_parts_e),
            prnu_parts_percent: response.map(|u| percent(u.prnu_parts_fraction)),
            patterns: self.stacks(&transfer).map(|(dark, bright)| {
                SpatialPatterns::of((dark, dark_pattern.is_some()), bright, transfer.gain_dn_per_e)
            }),
            dark_current_by_mean_e_per_s: current.map(|c| c.by_mean_e_per_s),
            dark_current_by_variance_e_per_s: current.map(|c| c.by_variance_e_per_s),
            raised_black_dn: 0,
            notes: notes(&transfer, uniformity.as_ref(), dark_is_whole),
            data_sheet: None,
            points: noise_points(&transfer, uniformity.as_ref(), are_counted),
        })
    }

    /// Returns the non-uniformities, where there are stacks of dark frames and of frames about half saturation.
    fn uniformity(&self, transfer: &PhotonTransfer) -> Result<Option<NonUniformity>, PipelineError> {
        let measured =
            self.stacks(transfer).map(|(dark, bright)| NonUniformity::measure(dark, bright, transfer.gain_dn_per_e));
        Ok(measured.transpose()?)
    }

    /// Returns the stacks of dark frames and of frames about half saturation.
    fn stacks(&self, transfer: &PhotonTransfer) -> Option<(&FrameStack, &FrameStack)> {
        let dark_dn = transfer.dark.mean_dn;
        let from_half =
            |s: &Measured| ((s.point.mean_dn - dark_dn) / transfer.gain_dn_per_e / transfer.saturation_e - 0.5).abs();
        let stacked = |is_dark: bool| self.series.iter().filter(move |s| s.is_dark() == is_dark && s.stack.is_some());
        let bright = stacked(false).min_by(|a, b| from_half(a).total_cmp(&from_half(b)));
        stacked(true).next()?.stack.as_ref().zip(bright?.stack.as_ref())
    }

    /// Returns the dark current, where dark frames were taken at three times or more.
    fn dark_current(&self, transfer: &PhotonTransfer) -> Option<DarkCurrentEstimate> {
        let mut points: Vec<(f64, FlatPoint)> = self
            .series
            .iter()
            .filter(|s| s.is_dark() && s.stack.is_none())
            .filter_map(|s| Some((s.time_s?, s.point)))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| (a.0 - b.0).abs() <= SAME_TIME * b.0);
        (points.len() >= 3).then(|| DarkCurrentEstimate::fit(&points, transfer.gain_dn_per_e))
    }
}

/// The share of dark samples at the lowest code from which on their noise is cut off there (EMVA 1288, 6.5: 0.5 %).
const CUT_OFF_SHARE: f64 = 0.005;

/// Returns whether dark frames of some temporal variance, DN², lie at the end of the codes: at 0, or piled up at another lowest code.
fn is_cut_off(frames: &[Array2<f32>], variance_dn2: f64) -> bool {
    let all = || frames.iter().flat_map(|frame| frame.iter().copied());
    let least = all().fold(f32::INFINITY, f32::min);
    let count = |code: f32| all().filter(|v| *v == code).count() as f64;
    let (at_least, next) = (count(least), count(least + 1.0));
    let n = frames.iter().map(Array2::len).sum::<usize>().max(1) as f64;
    // Rounding alone piles up quiet frames too, but for 0 that is no end of the codes.
    let is_end = least <= 0.0 || (variance_dn2 > 0.24 && at_least > 2.0 * next);
    is_end && at_least / n > CUT_OFF_SHARE
}

/// Returns what is not measured or only a limit.
fn notes(transfer: &PhotonTransfer, uniformity: Option<&NonUniformity>, dark_is_whole: bool) -> Vec<String> {
    let mut notes = Vec::new();
    let mut note = |is_said: bool, text: String| is_said.then(|| notes.push(text));
    note(
        !dark_is_whole,
        "dark samples are cut off at the lowest code: dark noise, DSNU, threshold and dynamic range are not measured, and signals \
         count from a mean that is too high; raise the black level"
            .to_owned(),
    );
    note(
        !transfer.is_saturated,
        format!(
            "the series ends at {:.0} e, before the variance falls: saturation, dynamic range and largest SNR are not measured, and \
             gain and linearity are those of shares of this range",
            transfer.saturation_e
        ),
    );
    note(
        dark_is_whole && transfer.dark_noise_is_limit,
        "rounding hides the dark noise: it is less than what is stated".to_owned(),
    );
    let Some(u) = uniformity else {
        note(
            true,
            "DSNU and PRNU need three or more dark frames and as many under one light: they are not measured"
                .to_owned(),
        );
        return notes;
    };
    note(
        dark_is_whole && u.dsnu_is_hidden,
        "rounding hides the DSNU, since neither noise nor pattern reaches a step of the codes: it is not measured"
            .to_owned(),
    );
    note(
        u.prnu_is_hidden,
        "rounding hides the PRNU, as it does where noise is below half a code: it is not measured".to_owned(),
    );
    note(
        dark_is_whole && !u.dsnu_is_hidden && u.dsnu_e < 2.0 * u.dsnu_error_e,
        format!("the DSNU is not told from noise: it is less than {:.3} e", u.dsnu_e + 2.0 * u.dsnu_error_e),
    );
    note(
        !u.prnu_is_hidden && u.prnu_fraction < 2.0 * u.prnu_error_fraction,
        format!(
            "the PRNU is not told from noise: it is less than {:.3} %",
            100.0 * (u.prnu_fraction + 2.0 * u.prnu_error_fraction)
        ),
    );
    notes
}

fn percent(Parts { row, column, pixel }: Parts) -> Parts {
    Parts { row: 100.0 * row, column: 100.0 * column, pixel: 100.0 * pixel }
}

fn noise_points(transfer: &PhotonTransfer, uniformity: Option<&NonUniformity>, are_counted: bool) -> Vec<NoisePoint> {
    [transfer.dark]
        .iter()
        .chain(&transfer.points)
        .enumerate()
        .map(|(index, point)| {
            let electrons = (point.mean_dn - transfer.dark.mean_dn) / transfer.gain_dn_per_e;
            let is_lit = index > 0 && point.variance_dn2 > 0.0;
            NoisePoint {
                photons: (are_counted || index == 0).then_some(point.photons),
                mean_dn: point.mean_dn,
                variance_dn2: point.variance_dn2,
                electrons,
                snr: is_lit.then(|| transfer.snr(point)),
                model_snr: (index > 0).then(|| transfer.model_snr(electrons)),
                total_snr: uniformity.filter(|_| index > 0).map(|u| u.total_snr(transfer, electrons)),
            }
        })
        .collect()
}

fn too_few(reason: String) -> PipelineError {
    PipelineError::Unsuitable { what: "the frames", reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera of 0.5 DN an electron in front of rising light.
    struct Made {
        black_dn: f64,
        dark_noise_e: f64,
        dsnu_e: f64,
        prnu: f64,
        top_e: f64,
    }

    const SIDE: usize = 96;
    const GAIN: f64 = 0.5;
    const FULL_DN: f64 = 4095.0;

    fn normal(state: &mut u64) -> f64 {
        let mut uniform = || {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    impl Made {
        fn measured(&self) -> NoiseData {
            let mut fixed = 17_u64;
            let patterns: Vec<(f64, f64)> = (0..SIDE * SIDE)
                .map(|_| (self.dsnu_e * normal(&mut fixed), 1.0 + self.prnu * normal(&mut fixed)))
                .collect();
            let mut state = 91_u64;
            let mut frame = |e: f64| {
                let sample = |(offset, gain): &(f64, f64)| {
                    // Shot noise of many electrons is normal.
                    let signal = e * gain + (e * gain).max(0.0).sqrt() * normal(&mut state);
                    let dn = self.black_dn + GAIN * (signal + offset + self.dark_noise_e * normal(&mut state));
                    dn.round().clamp(0.0, FULL_DN) as f32
                };
                Array2::from_shape_vec((SIDE, SIDE), patterns.iter().map(sample).collect()).unwrap()
            };
            let mut collected = Collected::default();
            let levels = (1..=16).map(|i| (self.top_e * f64::from(i) / 16.0, 2));
            for (e, n) in [(0.0, 16)].into_iter().chain(levels).chain([(0.45 * self.top_e, 16)]) {
                let mut taken = Taken::new(Some(0.01), Some(e / 0.6));
                (0..n).for_each(|_| taken.add(frame(e)).unwrap());
                collected.add(taken).unwrap();
            }
            collected.analyze("made".to_owned()).unwrap()
        }
    }

    const WHOLE: Made = Made { black_dn: 100.0, dark_noise_e: 5.0, dsnu_e: 2.0, prnu: 0.01, top_e: 8400.0 };

    #[test]
    fn what_is_put_in_comes_back_within_its_error() {
        let data = WHOLE.measured();
        assert!(data.notes.is_empty(), "{:?}", data.notes);
        let within = |value: Option<f64>, wanted: f64, error: f64| {
            let value = value.unwrap();
            assert!((value - wanted).abs() < error, "{value}, not {wanted} ± {error}");
        };
        within(Some(data.gain_dn_per_e), GAIN, 0.01);
        within(data.dark_noise_e, 5.0, 0.15);
        within(data.dsnu_e, 2.0, 4.0 * data.dsnu_error_e.unwrap());
        within(data.prnu_percent, 1.0, 4.0 * data.prnu_error_percent.unwrap());
        assert!(data.dsnu_error_e.unwrap() < 0.05 && data.saturation_e.is_some() && data.dynamic_range_db.is_some());
    }

    #[test]
    fn what_cannot_be_measured_is_told() {
        let told = |made: Made, words: &str| {
            let data = made.measured();
            assert!(data.notes.iter().any(|note| note.contains(words)), "{words}: {:?}", data.notes);
            data
        };
        let cut = told(Made { black_dn: 0.0, ..WHOLE }, "cut off at the lowest code");
        assert_eq!((cut.dark_noise_e, cut.dsnu_e, cut.threshold_e, cut.dynamic_range_db), (None, None, None, None));
        assert!(cut.saturation_e.is_some() && cut.prnu_percent.is_some());
        let short = told(Made { top_e: 4000.0, ..WHOLE }, "before the variance falls");
        assert_eq!((short.saturation_e, short.dynamic_range_db, short.max_snr_db), (None, None, None));
        let coarse = told(Made { dark_noise_e: 0.4, dsnu_e: 0.2, ..WHOLE }, "rounding hides the DSNU");
        assert!(coarse.dsnu_e.is_none() && coarse.dark_noise_is_limit);
        let even = told(Made { dsnu_e: 0.0, prnu: 0.0, ..WHOLE }, "the PRNU is not told from noise");
        assert!(even.notes.iter().any(|note| note.contains("the DSNU is not told")), "{:?}", even.notes);
    }
}
