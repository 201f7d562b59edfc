//! A sensor exposed to an irradiance image from a file.

use std::path::Path;

use dioptric_sensor::{
    Developed, ElectronRate, ExitPupil, ExposureControl, Illumination, Noise, NoiseSources, OpticalFilter, Processing,
    Sensor,
};
use dioptric_spectrum::{Bands, Illuminant, WavelengthGrid};

use crate::{
    FilterSpec, FrameSet, Frames, FramesSpec, Irradiance, Outputs, PipelineError, SensorSpec, number,
    stages::{MovedLight, ShutterInputs, expose},
};

/// How a sensor is exposed to an irradiance image.
#[derive(Clone, Debug, PartialEq)]
pub struct SenseRequest {
    /// The sensor; where the image has another pitch or size, its pixels are laid over the image's middle.
    pub sensor: SensorSpec,
    /// Filters before the lens.
    pub filters: Vec<FilterSpec>,
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
    /// The light that white balance goes by, in place of the one that the file states; the mean of the picture where neither is known.
    pub illuminant: Option<Illuminant>,
    /// The distance of the exit pupil from the sensor, mm, from which each pixel's chief ray follows; `None` for chief rays along the
    /// axis everywhere.
    pub exit_pupil_mm: Option<f64>,
    /// The f-number of the cone of light on the sensor, for pixels of a stack; `None` for collimated light.
    pub f_number: Option<f64>,
    /// The seed of all noise.
    pub seed: u64,
    /// The seed of what stays with the chip.
    pub chip_seed: u64,
    /// What is written besides the picture and the report; of irradiance and depth there is nothing to write.
    pub outputs: Outputs,
}

/// What a sensor made of an irradiance image.
#[derive(Clone, Debug)]
pub struct Sensed {
    /// The sensor, of the size that the image covers.
    pub sensor: Sensor,
    /// The filters before the lens.
    pub filters: Vec<OpticalFilter>,
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
    /// Where the light comes from, where that is stated.
    pub exit_pupil: Option<ExitPupil>,
    /// What a user should know of how the image was laid over the pixels, a sentence each.
    pub notes: Vec<String>,
}

impl Sensed {
    /// What is written of the frames.
    pub fn frame_parts(&self) -> Frames<'_> {
        Frames {
            sensor: &self.sensor,
            pitch_um: self.sensor.pixel_pitch_um,
            filters: &self.filters,
            exposure: &self.frames.exposure,
            rate: &self.rate,
            exposed: &self.frames.exposed,
            processing: &self.processing,
            lens: None,
            optics: None,
            light: self.light.clone(),
            grid: &self.grid,
            exit_pupil: self.exit_pupil,
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
    /// When the image cannot be read or is no irradiance, the sensor is unknown, an exposure cannot be metered, or the picture of a
    /// lens is to be corrected, which is not known here.
    pub fn sense(&self, image: &Path) -> Result<Sensed, PipelineError> {
        if !self.processing.lens_corrections.is_none() {
            let reason = "need the lens, which a file of irradiance does not hold, expected `dioptric run`, with --from and its \
                          folder for a picture that is there";
            return Err(PipelineError::Unsuitable { what: "lens_corrections", reason: reason.to_owned() });
        }
        let sensor = self.sensor.open()?;
        let filters = FilterSpec::open_all(&self.filters)?;
        let sensor = match self.pixel_um {
            Some(pixel_pitch_um) => sensor.with_pitch_um(pixel_pitch_um),
            None => sensor,
        };
        // One that states no distance between its samples has one a pixel.
        let (irradiance, stated, mut notes) = Irradiance::read(image, Some(sensor.pixel_pitch_um))?;
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
        let illuminant = self.illuminant.clone().or(stated.light);
        let sensor = Sensor { calibrated_behind: sensor.calibrated_behind.or(stated.lens), ..sensor };
        if !(0.5..=2.0).contains(&(sample_um / pixel_um)) {
            notes.push(format!(
                "the image has a sample every {} µm and the sensor a pixel every {} µm: samples are laid over pixels by area",
                number(sample_um),
                number(pixel_um)
            ));
        }
        let exit_pupil = self.exit_pupil(&sensor, &mut notes);
        let light = Illumination { exit_pupil, ..light };
        let exposed = sensor.behind(&filters);
        let rate = exposed.electron_rate(&light)?;
        let shutter = ShutterInputs {
            exposure: self.exposure,
            frames: self.frames.clone(),
            noise: Noise { sources: self.noise, fixed_pattern_seed: self.chip_seed, ..Noise::all(self.seed) },
        };
        let samples_per_px = light.pitch_um.map_or(1.0, |sample_um| sensor.pixel_pitch_um / sample_um);
        let frames = expose(&shutter, &exposed, &rate, Some(&MovedLight { light, samples_per_px }))?;
        let processing = self.processing.under(illuminant.as_ref());
        let developed = sensor.develop(frames.exposed.developed_from(), &processing)?;
        Ok(Sensed {
            sensor,
            filters,
            rate,
            frames,
            processing,
            developed,
            light: illuminant.unwrap_or(Illuminant::D65),
            grid: irradiance.grid().clone(),
            exit_pupil,
            notes,
        })
    }

    /// Returns the pupil that the light comes from, if one is stated.
    fn exit_pupil(&self, sensor: &Sensor, notes: &mut Vec<String>) -> Option<ExitPupil> {
        let Self { exit_pupil_mm, f_number, .. } = *self;
        match (&sensor.pixel_stack, f_number) {
            (Some(_), None) => notes.push(format!(
                "the pixels of {} are of a stack, whose share of light depends on the f-number: none is stated, so the light is taken as collimated",
                sensor.name
            )),
            (None, Some(_)) => notes.push(format!("{} states no pixel_stack, so the f-number changes nothing", sensor.name)),
            _ => {}
        }
        let distance_mm = match (exit_pupil_mm, f_number) {
            (None, None) => return None,
            (None, Some(_)) => f64::INFINITY,
            (Some(distance_mm), _) => distance_mm,
        };
        Some(ExitPupil { f_number: f_number.unwrap_or(f64::INFINITY), ..ExitPupil::centered(distance_mm) })
    }
}
