//! A sensor exposed to an irradiance image from a file.

use std::path::Path;

use dioptric_scene::read_spectral_exr;
use dioptric_sensor::{
    AutoExposure, ExitPupil, Exposure, ExposureControl, Illumination, Noise, NoiseSources, Processing, WhiteBalance,
};
use dioptric_spectrum::{Illuminant, Quantity, Spectrum};

use crate::{
    FramesChoice, Outputs, PipelineError, SensorChoice, SensorStatistics,
    frame_files::{Frames, write_frames},
};

/// How a sensor is exposed to an irradiance image.
#[derive(Clone, Debug, PartialEq)]
pub struct SenseRequest {
    /// The sensor; where the image has another pitch or size, its pixels are laid over the image's middle.
    pub sensor: SensorChoice,
    /// The exposure.
    pub exposure: ExposureControl,
    /// How many frames the picture is made of.
    pub frames: FramesChoice,
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

/// Exposes a sensor to a spectral irradiance and writes volts, raw frame, picture and `report.json` into a folder.
///
/// An image that states the distance between its samples is averaged over the sensor's pixels, as many as it covers; one
/// that does not has one sample a pixel.
///
/// # Errors
/// When the image cannot be read or is no irradiance, the sensor is unknown, or a file cannot be written.
pub fn sense_irradiance(
    image: &Path,
    request: &SenseRequest,
    folder: &Path,
) -> Result<SensorStatistics, PipelineError> {
    let sensor = request.sensor.open()?;
    let irradiance = read_spectral_exr(image)?.image;
    let in_file = |reason: String| PipelineError::Read { path: image.to_owned(), reason };
    if irradiance.quantity() != Quantity::Irradiance {
        let unit = irradiance.quantity().unit();
        return Err(in_file(format!("its unit is {unit}, expected an irradiance, {}", Quantity::Irradiance.unit())));
    }
    irradiance.check_samples().map_err(|e| in_file(e.to_string()))?;
    let light = match irradiance.pitch_um() {
        // The image lies on these very pixels.
        Some(pitch_um) if (pitch_um / sensor.pixel_pitch_um - 1.0).abs() < 1e-6 => Illumination::on_pixels(&irradiance),
        Some(pitch_um) => Illumination::with_pitch_um(&irradiance, pitch_um),
        None => Illumination::on_pixels(&irradiance),
    };
    let sensor = match light.pitch_um {
        Some(pitch_um) => {
            let covered = |n_samples: usize| (n_samples as f64 * pitch_um / sensor.pixel_pitch_um).round() as usize;
            let (rows, columns) = (covered(irradiance.rows()), covered(irradiance.columns()));
            sensor.with_size(rows.clamp(1, sensor.rows), columns.clamp(1, sensor.columns))
        }
        None => sensor,
    };
    let light = Illumination { exit_pupil: request.exit_pupil_mm.map(ExitPupil::centered), ..light };
    let rate = sensor.electron_rate(&light)?;
    let (rows, columns) = rate.planes_e_per_s[0].dim();
    let sensor = sensor.with_size(rows, columns);
    let noise = Noise { sources: request.noise, ..Noise::all(request.seed) };
    let exposure = sensor.expose(&rate, &request.exposure)?;
    let exposed = request.frames.expose(&sensor, &rate, &exposure, &noise)?;
    let processing = request.processing.under(request.illuminant.as_ref());
    let developed = sensor.develop(exposed.developed_from(), &processing)?;
    let frames = Frames {
        sensor: &sensor,
        exposure: &exposure,
        rate: &rate,
        exposed: &exposed,
        processing: &processing,
        grid: irradiance.grid(),
        light: request.illuminant.clone().unwrap_or(Illuminant::D65),
    };
    let statistics = SensorStatistics::new(&frames)?;
    write_frames(&frames, &developed.picture, &request.outputs, folder)?;
    crate::report::write_json(&folder.join("report.json"), &statistics)?;
    Ok(statistics)
}

/// Returns the exposure with its time set by hand; gain and temperature stay.
pub fn with_exposure_s(control: ExposureControl, time_s: f64) -> ExposureControl {
    ExposureControl::Manual(match control {
        ExposureControl::Manual(exposure) => Exposure { time_s, ..exposure },
        ExposureControl::Auto(auto) => Exposure { time_s, ..auto.limit },
    })
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
