//! What a run tells of itself: `report.json` and a self-contained `report.html`.

mod charts;
mod page;
mod statistics;

use std::{fs, path::Path};

use dioptric_scene::{SceneLight, write_planes_exr};
use dioptric_spectrum::{ColorTemperature, Illuminant};
use serde::Serialize;

pub use statistics::{ChannelStatistics, LossRow, SensorStatistics};

use crate::{
    BankData, Camera, Capture, LensData, PipelineError, Shot,
    capture::IRRADIANCE_FILE,
    frame_files::{Frames, write_frames},
    report::charts::{Charts, Places},
};

/// Numbers of a run, as `report.json` has them.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The version that made it.
    pub dioptric: &'static str,
    /// The camera as it was run.
    pub camera: Camera,
    /// The lens, at the reference wavelength and the distance in focus.
    pub lens: LensData,
    /// Distance of the film behind the last vertex, mm.
    pub film_mm: f64,
    /// The film.
    pub film: FilmData,
    /// The scene.
    pub scene: SceneData,
    /// How the point-spread functions were sampled, and the error of what lies between.
    pub psf_bank: Option<BankData>,
    /// The irradiance on the film.
    pub irradiance: IrradianceData,
    /// What the sensor saw.
    pub sensor: SensorStatistics,
    /// Where the light goes, over the field.
    pub losses: Vec<LossRow>,
    /// Factor on each channel that made white neutral.
    pub white_balance: Vec<f64>,
    /// The matrix from balanced channels to linear sRGB, a row for each of red, green and blue.
    pub color_matrix: [Vec<f64>; 3],
    /// The mean ΔE₀₀ that is left of the 24-patch chart after the matrix; none where it was not fitted.
    pub color_matrix_mean_delta_e: Option<f64>,
    /// How long each stage took, s.
    pub timings_s: Vec<(String, f64)>,
    /// The files beside the report.
    pub files: Vec<String>,
}

/// The film of a run.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct FilmData {
    /// Columns of pixels.
    pub columns: usize,
    /// Rows of pixels.
    pub rows: usize,
    /// Distance between pixels, µm.
    pub pitch_um: f64,
}

/// The scene of a run.
#[derive(Clone, Debug, Serialize)]
pub struct SceneData {
    /// Where it came from.
    pub name: String,
    /// Columns of samples.
    pub columns: usize,
    /// Rows of samples.
    pub rows: usize,
    /// Nearest depth, m.
    pub near_m: f64,
    /// Farthest depth, m.
    pub far_m: f64,
    /// Mean luminance, cd/m².
    pub mean_luminance_cd_m2: f64,
    /// The light on it, where that is known.
    pub light: Option<SceneLight>,
    /// Its correlated color temperature.
    pub light_temperature: Option<ColorTemperature>,
}

/// The irradiance of a run.
#[derive(Clone, Debug, Serialize)]
pub struct IrradianceData {
    /// Bands, nm.
    pub wavelengths_nm: Vec<f64>,
    /// Mean over the film, W m⁻² nm⁻¹.
    pub mean_w_m2_nm: Vec<f64>,
    /// Largest sample, W m⁻² nm⁻¹.
    pub max_w_m2_nm: Vec<f64>,
    /// Mean illuminance, lux.
    pub mean_lux: f64,
}

impl Capture {
    /// Writes everything but the irradiance, which was streamed, into a folder, and returns the report.
    ///
    /// `timings_s` is what the caller measured of each stage; the library reads no clock.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, shot: &Shot, folder: &Path, timings_s: &[(String, f64)]) -> Result<Report, PipelineError> {
        let outputs = &shot.camera.outputs;
        let mut files = Vec::new();
        if outputs.irradiance {
            files.push(IRRADIANCE_FILE.to_owned());
        }
        if outputs.depth {
            let depth = shot.scene.require_depth()?;
            write_planes_exr(&folder.join("depth.exr"), &[("Z", depth.z_m())], true)?;
            files.push("depth.exr".to_owned());
        }
        let (frame_files, png) = write_frames(&self.frames(shot), &self.developed.picture, outputs, folder)?;
        files.extend(frame_files);

        let report = self.report(shot, timings_s, files)?;
        write_json(&folder.join("report.json"), &report)?;
        let places = Places::of(shot, self);
        let charts = Charts::of(shot, self, &places, &report.sensor);
        let html = page::render(&page::Page {
            shot,
            capture: self,
            report: &report,
            places: &places,
            charts: &charts,
            picture_png: &png,
        })?;
        write_file(&folder.join("report.html"), html.as_bytes())?;
        Ok(report)
    }

    fn report(&self, shot: &Shot, timings_s: &[(String, f64)], files: Vec<String>) -> Result<Report, PipelineError> {
        let places = Places::of(shot, self);
        let fields = [0.0, 0.35, 0.7, 1.0].map(|share| places.field(share));
        let (near_m, far_m) = shot.scene.require_depth()?.range_m();
        Ok(Report {
            dioptric: env!("CARGO_PKG_VERSION"),
            camera: shot.camera.clone(),
            lens: statistics::lens_data(shot, places.corner_tan())?,
            film_mm: shot.film_mm,
            film: FilmData { columns: shot.film.columns, rows: shot.film.rows, pitch_um: shot.film.pitch_um },
            scene: SceneData {
                name: shot.scene.name.clone(),
                columns: shot.scene.columns(),
                rows: shot.scene.rows(),
                near_m,
                far_m,
                mean_luminance_cd_m2: shot.scene.mean_luminance_cd_m2(),
                light: shot.scene.light.clone(),
                light_temperature: shot.scene.light.as_ref().map(|light| light.illuminant.color_temperature()),
            },
            psf_bank: BankData::of_camera(&self.bank),
            irradiance: IrradianceData {
                wavelengths_nm: shot.grid().centers_nm().to_vec(),
                mean_w_m2_nm: self.irradiance.mean.clone(),
                max_w_m2_nm: self.irradiance.max.clone(),
                mean_lux: self.irradiance.mean_lux,
            },
            sensor: SensorStatistics::new(&self.frames(shot))?,
            losses: statistics::losses(shot, &fields)?,
            white_balance: self.developed.balance.clone(),
            color_matrix: self.developed.color.rows.clone(),
            color_matrix_mean_delta_e: self.developed.color.mean_delta_e(),
            timings_s: timings_s.to_vec(),
            files,
        })
    }

    fn frames<'a>(&'a self, shot: &'a Shot) -> Frames<'a> {
        Frames {
            sensor: &shot.sensor,
            exposure: &self.exposure,
            rate: &self.rate,
            exposed: &self.exposed,
            processing: &self.processing,
            grid: shot.grid(),
            light: shot.scene.light.as_ref().map_or(Illuminant::D65, |light| light.illuminant.clone()),
        }
    }
}

/// Writes a value as JSON.
pub(crate) fn write_json(path: &Path, value: &(impl Serialize + ?Sized)) -> Result<(), PipelineError> {
    let json = serde_json::to_vec_pretty(value)
        .map_err(|e| PipelineError::Write { path: path.to_owned(), reason: e.to_string() })?;
    write_file(path, &json)
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    fs::write(path, bytes).map_err(|e| PipelineError::Write { path: path.to_owned(), reason: e.to_string() })
}
