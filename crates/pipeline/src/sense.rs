//! A sensor exposed to an irradiance image from a file.

use std::path::Path;

use dioptric_sensor::{
    AutoExposure, Developed, ElectronRate, ExitPupil, Exposure, ExposureControl, Illumination, Noise, NoiseSources,
    Processing, Sensor, WhiteBalance,
};
use dioptric_spectrum::{Bands, Cancel, Illuminant, Spectrum, WavelengthGrid};

use crate::{
    FrameSet, Frames, FramesSpec, Irradiance, Outputs, PipelineError, SensorSpec, Silent,
    camera::automatic,
    number,
    stages::{ShutterInputs, Watch, expose},
};

/// How a sensor is exposed to an irradiance image.
#[derive(Clone, Debug, PartialEq)]
pub struct SenseRequest {
    /// The sensor; where the image has another pitch or size, its pixels are laid over the image's middle.
    pub sensor: SensorSpec,
    /// The distance between the sensor's pixels, µm, where it is not the sensor's own: that of the samples of an image gives
    /// one pixel a sample, as in the run that made it.
    pub pixel_um: Option<f64>,
    /// The exposure.
    pub exposure: ExposureControl,
    /// How many frames the picture is made of.
    pub frames: FramesSpec,
    /// From the raw frame to the picture.
    pub processing: Processing,
    /// Which sources of noise are on.
    pub noise: NoiseSources,
    /// The light that white balance goes by; the mean of the picture where it is not known.
    pub illuminant: Option<Illuminant>,
    /// The distance of the exit pupil from the sensor, mm, from which each pixel's chief-ray angle follows; `None` for
    /// light along the axis everywhere.
    pub exit_pupil_mm: Option<f64>,
    /// The seed of all noise.
    pub seed: u64,
    /// What is written besides the picture and the report; of irradiance and depth there is nothing to write.
    pub outputs: Outputs,
}

/// What a sensor made of an irradiance image.
#[derive(Clone, Debug)]
pub struct Sensed {
    /// The sensor, of the size that the image covers.
    pub sensor: Sensor,
    /// The mean rate of photo-electrons.
    pub rate: ElectronRate,
    /// The exposure and the frames.
    pub frames: FrameSet,
    /// From the raw frame to the picture.
    pub processing: Processing,
    /// The picture.
    pub developed: Developed,
    /// The light on the scene; D65 where it is not known.
    pub light: Illuminant,
    /// The bands of the image.
    pub grid: WavelengthGrid,
    /// What a user should know of how the image was laid over the pixels, a sentence each.
    pub notes: Vec<String>,
}

impl Sensed {
    /// What is written of the frames.
    pub fn frame_parts(&self) -> Frames<'_> {
        Frames {
            sensor: &self.sensor,
            exposure: &self.frames.exposure,
            rate: &self.rate,
            exposed: &self.frames.exposed,
            processing: &self.processing,
            light: self.light.clone(),
            grid: &self.grid,
        }
    }
}

impl SenseRequest {
    /// Exposes the sensor to a spectral irradiance and develops the picture.
    ///
    /// An image that states the distance between its samples is averaged over the sensor's pixels, as many as it covers; one
    /// that does not has one sample a pixel.
    ///
    /// # Errors
    /// When the image cannot be read or is no irradiance, the sensor is unknown, or an exposure cannot be metered.
    pub fn sense(&self, image: &Path) -> Result<Sensed, PipelineError> {
        let sensor = self.sensor.open()?;
        let sensor = match self.pixel_um {
            Some(pixel_pitch_um) => Sensor { pixel_pitch_um, ..sensor },
            None => sensor,
        };
        // One that states no distance between its samples has one a pixel.
        let irradiance = Irradiance::read_exr(image, Some(sensor.pixel_pitch_um))?;
        let (sample_um, pixel_um) = (irradiance.pitch_um(), sensor.pixel_pitch_um);
        let (rows, columns) = irradiance.size();
        let (light, sensor) = if (sample_um / pixel_um - 1.0).abs() < 1e-6 {
            (Illumination::on_pixels(&irradiance), sensor.with_size(rows, columns))
        } else {
            let covered = |n_samples: usize, most: usize| {
                ((n_samples as f64 * sample_um / pixel_um).round() as usize).clamp(1, most)
            };
            let covering = sensor.with_size(covered(rows, sensor.rows), covered(columns, sensor.columns));
            (Illumination::with_pitch_um(&irradiance, sample_um), covering)
        };
        let mut notes = Vec::new();
        if !(0.5..=2.0).contains(&(sample_um / pixel_um)) {
            notes.push(format!(
                "the image has a sample every {} µm and the sensor a pixel every {} µm: samples are laid over pixels by area",
                number(sample_um),
                number(pixel_um)
            ));
        }
        let light = Illumination { exit_pupil: self.exit_pupil_mm.map(ExitPupil::centered), ..light };
        let rate = sensor.electron_rate(&light)?;
        let shutter = ShutterInputs {
            exposure: self.exposure,
            frames: self.frames.clone(),
            noise: Noise { sources: self.noise, ..Noise::all(self.seed) },
        };
        let watch = Watch { progress: &Silent, cancel: &Cancel::new() };
        let frames = expose(&shutter, &sensor, &rate, &watch)?;
        let processing = self.processing.under(self.illuminant.as_ref());
        let developed = sensor.develop(frames.exposed.developed_from(), &processing)?;
        Ok(Sensed {
            sensor,
            rate,
            frames,
            processing,
            developed,
            light: self.illuminant.clone().unwrap_or(Illuminant::D65),
            grid: irradiance.grid().clone(),
            notes,
        })
    }
}

/// Returns the exposure with its time set by hand; gain and temperature stay.
pub fn with_exposure_s(control: ExposureControl, time_s: f64) -> ExposureControl {
    ExposureControl::Manual(match control {
        ExposureControl::Manual(exposure) => Exposure { time_s, ..exposure },
        ExposureControl::Auto(auto) => Exposure { time_s, ..auto.limit },
    })
}

/// Returns the exposure metered: as it was where it was so before, else the usual one, just not saturating; gain and
/// temperature stay.
pub fn with_auto_exposure(control: ExposureControl) -> ExposureControl {
    match (control, automatic()) {
        (ExposureControl::Manual(exposure), ExposureControl::Auto(usual)) => {
            let limit = Exposure { time_s: usual.limit.time_s, ..exposure };
            ExposureControl::Auto(AutoExposure { limit, ..usual })
        }
        (control, _) => control,
    }
}

/// Returns the exposure with another analog gain; time and temperature stay.
pub fn with_analog_gain(control: ExposureControl, analog_gain: f64) -> ExposureControl {
    match control {
        ExposureControl::Manual(exposure) => ExposureControl::Manual(Exposure { analog_gain, ..exposure }),
        ExposureControl::Auto(auto) => {
            ExposureControl::Auto(AutoExposure { limit: Exposure { analog_gain, ..auto.limit }, ..auto })
        }
    }
}

/// Returns the light of a name (in any case), a temperature (`3200K`), a chromaticity (`0.46,0.414`) or a CSV file whose first
/// two columns are wavelengths in nm and spectral power.
///
/// # Errors
/// When the text is none of these, or there can be no such light.
pub fn parse_illuminant(text: &str) -> Result<Illuminant, PipelineError> {
    let path = Path::new(text);
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return read_light(path);
    }
    Ok(Illuminant::parse(text)?)
}

/// Returns the white of a command line: a word of [`WhiteBalance::parse`], or the CSV file of a light's spectrum.
///
/// # Errors
/// As [`WhiteBalance::parse`] and [`parse_illuminant`].
pub fn parse_white(text: &str) -> Result<WhiteBalance, PipelineError> {
    let path = Path::new(text);
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return Ok(WhiteBalance::Light(read_light(path)?));
    }
    Ok(WhiteBalance::parse(text)?)
}

fn read_light(path: &Path) -> Result<Illuminant, PipelineError> {
    let unreadable = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|e| unreadable(e.to_string()))?;
    let (mut wavelengths_nm, mut values) = (Vec::new(), Vec::new());
    for (number, record) in reader.records().enumerate() {
        let record = record.map_err(|e| unreadable(e.to_string()))?;
        let line = record.position().map_or(number as u64 + 1, csv::Position::line);
        let number_at = |column: usize| record.get(column).and_then(|text| text.parse::<f64>().ok());
        match (number_at(0), number_at(1)) {
            (Some(nm), Some(value)) => {
                wavelengths_nm.push(nm);
                values.push(value);
            }
            // Names of the columns.
            _ if number == 0 => {}
            _ => return Err(unreadable(format!("line {line} is not a wavelength in nm and a power"))),
        }
    }
    let light = Spectrum::new(wavelengths_nm, values).map(Illuminant::Spectrum);
    let checked = light.and_then(|light| light.check().map(|()| light));
    checked.map_err(|e| unreadable(e.to_string()))
}
