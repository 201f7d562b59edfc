//! A run of the whole camera in numbers and charts.

mod charts;
mod statistics;

use dioptric_pipeline::{BankData, Camera, Capture, PipelineError, Shot};
use dioptric_spectrum::Illuminant;
use serde::Serialize;

pub use charts::{RunCharts, RunPlaces};
pub use statistics::{ChannelStatistics, LossRow, SensorStatistics};

use crate::LensData;

/// Numbers of a run, as `report.json` has them.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
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
    pub light: Option<Illuminant>,
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

impl RunReport {
    /// Returns the numbers of a run.
    ///
    /// `timings_s` is what the caller measured of each stage, and `files` what was written; the library reads no clock.
    ///
    /// # Errors
    /// When the scene has no depth, or a glass is not known at the reference wavelength.
    pub fn new(
        shot: &Shot,
        capture: &Capture,
        timings_s: &[(String, f64)],
        files: Vec<String>,
    ) -> Result<Self, PipelineError> {
        let places = RunPlaces::of(shot, capture);
        let fields = [0.0, 0.35, 0.7, 1.0].map(|share| places.field(share));
        let (near_m, far_m) = shot.scene.require_depth()?.range_m();
        Ok(Self {
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
                light: shot.scene.light,
            },
            psf_bank: BankData::of_camera(&capture.bank),
            irradiance: IrradianceData {
                wavelengths_nm: shot.grid().centers_nm().to_vec(),
                mean_w_m2_nm: capture.irradiance.mean.clone(),
                max_w_m2_nm: capture.irradiance.max.clone(),
                mean_lux: capture.irradiance.mean_lux,
            },
            sensor: SensorStatistics::new(&capture.frames(shot))?,
            losses: statistics::losses(shot, &fields)?,
            white_balance: capture.developed.balance.clone(),
            color_matrix: capture.developed.color.rows.clone(),
            color_matrix_mean_delta_e: capture.developed.color.mean_delta_e(),
            timings_s: timings_s.to_vec(),
            files,
        })
    }
}
