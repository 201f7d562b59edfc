//! A sensor exposed to an irradiance image from a file.

use std::path::Path;

use dioptric_scene::read_spectral_exr;
use dioptric_sensor::{Developed, ElectronRate, Exposure, ExposureControl, Illumination, Noise, Processing, Sensor};
use dioptric_spectrum::{Illuminant, Quantity};

use crate::{Exposed, Frames, FramesChoice, Outputs, PipelineError, ProcessingChoice, SensorChoice};

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
    pub processing: ProcessingChoice,
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
    /// The exposure, metered or given.
    pub exposure: Exposure,
    /// The mean rate of photo-electrons.
    pub rate: ElectronRate,
    /// The frames.
    pub exposed: Exposed,
    /// From the raw frame to the picture.
    pub processing: Processing,
    /// The picture.
    pub developed: Developed,
    /// The light on the scene; D65 where it is not known.
    pub light: Illuminant,
}

impl Sensed {
    /// What is written of the frames.
    pub fn frames(&self) -> Frames<'_> {
        Frames {
            sensor: &self.sensor,
            exposure: &self.exposure,
            rate: &self.rate,
            exposed: &self.exposed,
            processing: &self.processing,
            light: self.light,
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
        let irradiance = read_spectral_exr(image)?.image;
        let in_file = |reason: String| PipelineError::Read { path: image.to_owned(), reason };
        if irradiance.quantity() != Quantity::Irradiance {
            let unit = irradiance.quantity().unit();
            return Err(in_file(format!(
                "its unit is {unit}, expected an irradiance, {}",
                Quantity::Irradiance.unit()
            )));
        }
        irradiance.check_samples().map_err(|e| in_file(e.to_string()))?;
        let light = match irradiance.pitch_um() {
            // The image lies on these very pixels.
            Some(pitch_um) if (pitch_um / sensor.pixel_pitch_um - 1.0).abs() < 1e-6 => {
                Illumination::on_pixels(&irradiance)
            }
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
        let light = Illumination { exit_pupil_distance_mm: self.exit_pupil_mm, ..light };
        let rate = sensor.electron_rate(&light)?;
        let (rows, columns) = rate.planes_e_per_s[0].dim();
        let sensor = sensor.with_size(rows, columns);
        let noise = Noise::all(self.seed);
        let exposure = sensor.expose(&rate, &self.exposure)?;
        let exposed = self.frames.expose(&sensor, &rate, &exposure, &noise)?;
        let processing = self.processing.under(self.illuminant);
        let developed = sensor.develop(exposed.developed_from(), &processing)?;
        Ok(Sensed {
            sensor,
            exposure,
            rate,
            exposed,
            processing,
            developed,
            light: self.illuminant.unwrap_or(Illuminant::D65),
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

/// Returns the light of a name, in any case.
///
/// # Errors
/// When no light has that name.
pub fn parse_illuminant(name: &str) -> Result<Illuminant, PipelineError> {
    Ok(Illuminant::named(name)?)
}
