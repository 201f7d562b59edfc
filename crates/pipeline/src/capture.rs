//! Figure 1 of the paper, from top to bottom: scene, lens, irradiance, sensor, picture.

use std::path::Path;

use dioptric_forward::{Coverage, irradiance};
use dioptric_scene::{BandWriter, ExrParts};
use dioptric_sensor::{Developed, ElectronRate, ExitPupil, Exposure, Illumination, Noise, Processing};
use dioptric_spectrum::{Observer, Quantity};
use ndarray::Array2;

use crate::{
    Camera, CameraBank, Exposed, Movements, PipelineError, Progress, Shot, Stage,
    band_stream::band_stream,
    display::{LinearRgb, SpectrumToRgb},
};

/// The name of the file of spectral irradiance.
pub(crate) const IRRADIANCE_FILE: &str = "irradiance.exr";

/// What came of a shot, stage by stage.
#[derive(Clone, Debug)]
pub struct Capture {
    /// The point-spread functions.
    pub bank: CameraBank,
    /// The irradiance on the film, in brief; the cube itself is in the file.
    pub irradiance: IrradianceSummary,
    /// The exposure, metered or given.
    pub exposure: Exposure,
    /// The mean rate of photo-electrons.
    pub rate: ElectronRate,
    /// The electrons, volts and raw frame of the first exposure, and all exposures merged.
    pub exposed: Exposed,
    /// From the raw frame to the picture.
    pub processing: Processing,
    /// The picture.
    pub developed: Developed,
}

/// Spectral irradiance in brief.
#[derive(Clone, Debug)]
pub struct IrradianceSummary {
    /// Mean over the film of each band, W m⁻² nm⁻¹.
    pub mean: Vec<f64>,
    /// Largest sample of each band, W m⁻² nm⁻¹.
    pub max: Vec<f64>,
    /// Mean illuminance, lux.
    pub mean_lux: f64,
    /// A few whole bands, each with its wavelength, nm.
    pub bands: Vec<(f64, Array2<f32>)>,
    /// All bands as an observer sees them, linear sRGB in lux.
    pub(crate) seen: LinearRgb,
}

impl Camera {
    /// Takes the picture: everything in memory but the cube of irradiance, which is streamed to `irradiance.exr` in
    /// `folder` where one is given and the camera asks for it.
    ///
    /// # Errors
    /// When anything that the camera names cannot be opened, or a stage fails.
    pub fn capture(&self, folder: Option<&Path>, progress: &dyn Progress) -> Result<(Shot, Capture), PipelineError> {
        let shot = Shot::open(self, progress)?;
        let capture = shot.capture(folder, progress)?;
        Ok((shot, capture))
    }
}

impl Shot {
    /// Takes the picture; see [`Camera::capture`].
    ///
    /// # Errors
    /// When the lens does not see the scene, or a stage fails.
    pub fn capture(&self, folder: Option<&Path>, progress: &dyn Progress) -> Result<Capture, PipelineError> {
        progress.at(Stage::Lens, 0.0);
        let bank = self.trace_bank()?;

        progress.at(Stage::Irradiance, 0.0);
        let (rate, irradiance) = self.expose_to_scene(&bank, folder, progress)?;

        progress.at(Stage::Sensor, 0.0);
        let noise = Noise { sources: self.camera.noise, ..Noise::all(self.camera.seed) };
        let exposure = self.sensor.expose(&rate, &self.camera.exposure)?;
        let exposed = self.camera.frames.expose(&self.sensor, &rate, &exposure, &noise)?;

        progress.at(Stage::Picture, 0.0);
        let processing = self.camera.processing.under(self.scene.light.as_ref().map(|light| &light.illuminant));
        let developed = self.sensor.develop(exposed.developed_from(), &processing)?;
        progress.at(Stage::Picture, 1.0);
        Ok(Capture { bank, irradiance, exposure, rate, exposed, processing, developed })
    }

    /// Traces the point-spread functions that the scene and the film need.
    fn trace_bank(&self) -> Result<CameraBank, PipelineError> {
        let coverage = Coverage {
            lens: &self.lens,
            film: &self.film,
            film_mm: self.film_mm,
            depth_range_m: self.scene.require_depth()?.range_m(),
            grid: self.grid(),
            diffraction: self.camera.diffraction.into(),
        };
        CameraBank::build(self.camera.bank, &coverage)
    }

    /// Returns where chief rays come from, or `None` where the exit pupil is infinitely far or the sensor minds no angle.
    fn exit_pupil(&self) -> Result<Option<ExitPupil>, PipelineError> {
        let z_mm = self.lens.at(crate::REFERENCE_WAVELENGTH_NM)?.first_order().exit_pupil_z_mm;
        if !z_mm.is_finite() || self.sensor.chief_ray_response.is_empty() {
            return Ok(None);
        }
        // A lens moved up and to the right moves its axis so on the film, which the picture shows turned by 180°. That
        // a tilted axis meets the film elsewhere is left out.
        let Movements { rise_mm, shift_mm, .. } = self.camera.movements;
        Ok(Some(ExitPupil { distance_mm: self.film_mm - z_mm, axis_mm: [-shift_mm, rise_mm] }))
    }

    /// Images the scene band by band; the sensor collects electrons beside it, and the file grows.
    fn expose_to_scene(
        &self,
        bank: &CameraBank,
        folder: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<(ElectronRate, IrradianceSummary), PipelineError> {
        let size = (self.film.rows, self.film.columns);
        let mut file = match folder.filter(|_| self.camera.outputs.irradiance) {
            Some(folder) => {
                let parts = ExrParts { pitch_um: Some(self.film.pitch_um), ..ExrParts::default() };
                let path = folder.join(IRRADIANCE_FILE);
                Some(BandWriter::create(&path, Quantity::Irradiance, self.grid(), size, &parts)?)
            }
            None => None,
        };
        let mut summary = Summing::new(self);
        let (sender, stream) = band_stream(Quantity::Irradiance, self.grid(), size);
        let exit_pupil = self.exit_pupil()?;
        let (imaged, collected) = std::thread::scope(|scope| {
            // The collector owns the stream: when it gives up, sending fails instead of waiting.
            let collecting = scope.spawn(move || {
                let light = Illumination { irradiance: &stream, pitch_um: None, exit_pupil };
                self.sensor.electron_rate(&light)
            });
            let imaged = irradiance(
                &self.scene,
                bank.kernels(),
                &self.film,
                &self.blur,
                &|fraction| progress.at(Stage::Irradiance, fraction),
                &mut |band, plane| {
                    summary.add(band, &plane);
                    if let Some(file) = &mut file {
                        file.write_band(band, &plane)?;
                    }
                    Ok(sender.send(plane)?)
                },
            );
            drop(sender);
            (imaged, collecting.join().expect("collecting electrons does not panic"))
        });
        // The collector fails when the imaging does: the imaging's reason is the one to tell, unless the collector
        // gave up first.
        let rate = match (imaged, collected) {
            (Err(_), Err(collector)) if !is_cut_short(&collector) => return Err(collector.into()),
            (Err(imaging), _) => return Err(imaging.into()),
            (Ok(()), collected) => collected?,
        };
        if let Some(file) = file {
            file.finish()?;
        }
        Ok((rate, summary.finish()))
    }
}

/// Whether the collector of electrons only lacked bands.
fn is_cut_short(error: &dioptric_sensor::SensorError) -> bool {
    error.to_string().contains(crate::band_stream::GAVE_UP)
}

/// Sums up bands as they come.
struct Summing<'a> {
    shot: &'a Shot,
    to_rgb: SpectrumToRgb,
    luminous: Vec<f64>,
    chosen: Vec<usize>,
    summary: IrradianceSummary,
}

impl<'a> Summing<'a> {
    fn new(shot: &'a Shot) -> Self {
        let grid = shot.grid();
        let [_, luminous, _] = Observer::Cie1931.weights(grid);
        let (first, last) = grid.range_nm();
        let mut chosen: Vec<usize> =
            (0..4).map(|i| grid.nearest(first + (last - first) * f64::from(i) / 3.0)).collect();
        chosen.dedup();
        let summary = IrradianceSummary {
            mean: Vec::with_capacity(grid.len()),
            max: Vec::with_capacity(grid.len()),
            mean_lux: 0.0,
            bands: Vec::new(),
            seen: LinearRgb::black(shot.film.rows, shot.film.columns),
        };
        Self { shot, to_rgb: SpectrumToRgb::new(grid), luminous, chosen, summary }
    }

    fn add(&mut self, band: usize, plane: &Array2<f32>) {
        let mean = plane.iter().map(|&e| f64::from(e)).sum::<f64>() / plane.len() as f64;
        self.summary.mean.push(mean);
        self.summary.max.push(plane.iter().copied().fold(0.0, f32::max).into());
        self.summary.mean_lux += self.luminous[band] * mean;
        self.summary.seen.add(plane, self.to_rgb.of_band(band));
        if self.chosen.contains(&band) {
            self.summary.bands.push((self.shot.grid().centers_nm()[band], plane.clone()));
        }
    }

    fn finish(self) -> IrradianceSummary {
        self.summary
    }
}
