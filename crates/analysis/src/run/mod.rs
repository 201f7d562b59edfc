//! A run of the whole camera in numbers and charts.

mod charts;
mod dng_report;
mod dual_pixel;
mod pixel_optics;
mod statistics;

use dioptric_pipeline::{
    AberrationSummary, Camera, Capture, FilmPart, LensReflections, PipelineError, SceneSource,
    display::LEAST_DARK_FRACTION, number,
};
use dioptric_psf::{Diffraction, LensImageModel};
use dioptric_scene::{Pattern, SceneLight};
use dioptric_spectrum::{ColorTemperature, DepthMap};
use serde::Serialize;

pub use charts::{RunCharts, RunPlaces};
pub use dng_report::DngReport;
pub use dual_pixel::{DisparityData, DualPixelData, MOST_ERROR_PX};
pub use pixel_optics::{PixelOpticsData, PixelOpticsRow, PixelPlace, pixel_optics_rows};
pub use statistics::{ChannelStatistics, LossRow, SensorStatistics};

use crate::LensData;

/// A run that is looked at: what came of it, and the model of the lens's image that it was made with.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// What came of it.
    pub capture: &'a Capture,
    /// The model.
    pub model: &'a LensImageModel,
    /// The depth of the scene's samples, where it is at hand.
    pub depth: Option<&'a DepthMap>,
}

/// Numbers of a run, as `report.json` has them.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// The version that made it.
    pub dioptric: &'static str,
    /// The camera as it was run.
    pub camera: Camera,
    /// The lens, at the reference wavelength and the distance in focus.
    pub lens: LensData,
    /// Notes on it, a sentence each ([`Capture::lens_notes`](dioptric_pipeline::Capture::lens_notes)).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lens_notes: Vec<String>,
    /// Distance of the film behind the last vertex, mm.
    #[serde(rename = "film_mm")]
    pub film_distance_mm: f64,
    /// The film.
    pub film: FilmData,
    /// The scene.
    pub scene: SceneData,
    /// The irradiance on the film.
    pub irradiance: IrradianceData,
    /// What the sensor saw.
    pub sensor: SensorStatistics,
    /// Where the light goes, over the field.
    pub losses: Vec<LossRow>,
    /// Factor on each channel that made white neutral.
    pub white_balance: Vec<f64>,
    /// The matrix from balanced channels to linear sRGB, a row for each of red, green and blue; where roots of their products count, their factors
    /// follow.
    pub color_matrix: [Vec<f64>; 3],
    /// The mean ΔE₀₀ that is left of the 24-patch chart after the matrix; none where it was not fitted.
    pub color_matrix_mean_delta_e: Option<f64>,
    /// How much the corrections of the lens do, where some are asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens_corrections: Option<AberrationSummary>,
    /// What photodiodes that are read one by one tell of the focus.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dual_pixel: Option<DualPixelData>,
    /// The files beside the report.
    pub files: Vec<String>,
}

/// Where the time of a run went, as `timings.json` has it: what the caller measured, for the library reads no clock. Equal runs
/// have equal reports, and other times.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RunTimes {
    /// How long each stage took, s.
    pub stages_s: Vec<(String, f64)>,
    /// Of the imaging, how long each part took, s, summed over threads; nothing where no scene was imaged.
    pub imaging_s: Vec<(String, f64)>,
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
    /// The part of the film that this is, where it is not all of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<FilmPart>,
    /// The share of pixels that get no light: beyond the scene, or beyond what the lens sees.
    pub dark_fraction: f64,
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
    /// What was done to its samples to make it, a sentence each: depths filled, bands resampled.
    pub notes: Vec<String>,
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
    /// The light that surfaces of the lens reflect.
    pub reflections: ReflectionData,
}

/// The light that surfaces of the lens reflect to the film.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ReflectionData {
    /// What became of it.
    pub lens_reflections: LensReflections,
    /// The share of all light on the film that it is, of all bands together; null where it is left out, rays from the film brought it, or an earlier run did some bands.
    pub share: Option<f64>,
    /// About what two surfaces reflect to the film over what the lens images there: for far points of equal brightness in three fields, at three wavelengths. Null where
    /// ghosts of the lens are not followed.
    pub veil: Option<f64>,
}

impl ReflectionData {
    /// Returns it in a few words; nothing where nothing is reflected, or it is not known.
    pub fn in_words(&self) -> Option<String> {
        let percent = |share: f64| format!("{:.2} %", 100.0 * share);
        match (self.lens_reflections, self.share, self.veil) {
            (LensReflections::Ghosts | LensReflections::Film(_), Some(share), _) => {
                Some(format!("ghosts {} of the light", percent(share)))
            }
            (LensReflections::Ghosts | LensReflections::Film(_), None, Some(veil)) => {
                Some(format!("ghosts, about {} of the light", percent(veil)))
            }
            (LensReflections::Off, _, Some(veil)) if veil > 0.0 => {
                Some(format!("ghosts left out, about {} of the light", percent(veil)))
            }
            _ => None,
        }
    }
}

/// The report on the lens before its film: the same for all runs that share lens, film, scene and model, whatever is
/// behind the irradiance.
#[derive(Clone, Debug)]
pub struct RunOptics {
    lens: LensData,
    losses: Vec<LossRow>,
    veil: Option<f64>,
}

impl RunOptics {
    /// Returns the report of a run on its lens; rays are traced for it.
    ///
    /// # Errors
    /// When a glass is not known at the reference wavelength.
    pub fn of(run: &Run<'_>) -> Result<Self, PipelineError> {
        let places = RunPlaces::of(run);
        let fields = [0.0, 0.35, 0.7, 1.0].map(|share| places.field(share));
        Ok(Self {
            lens: statistics::lens_data(run.capture, places.corner_tan())?,
            losses: statistics::losses(run.capture, &fields)?,
            veil: run.capture.veil(),
        })
    }
}

/// States where diffraction is round, though the pupil is not: edges beside the stop throw no spikes beyond kernels (docs/forward.md 2).
fn note_on_round_halos(run: &Run<'_>) -> Option<String> {
    let (camera, lens) = (&run.capture.camera, &run.capture.lens.lens);
    let beside_stop = lens.apertures().iter().any(|aperture| aperture.surface != lens.stop());
    let has_halos = camera.diffraction != Diffraction::None && beside_stop;
    let name = lens.name();
    has_halos.then(|| {
        format!("{name}: diffraction by openings and obscurations beside its stop that lands beyond some 12 λN of a point is spread evenly around it: spikes end there")
    })
}

/// How many pixels apart samples of a scene may be before that is told; a film of the scene's own size has one a pixel, or a little less.
const COARSE_PIXELS: f64 = 1.1;

/// States that the samples of a scene are farther apart than pixels, where that is what limits the sharpness of the picture.
fn note_on_coarse_samples(run: &Run<'_>) -> Option<String> {
    let capture = run.capture;
    let is_computed = match &capture.camera.scene.source {
        SceneSource::World(_) => true,
        SceneSource::Target { pattern, .. } => *pattern == Pattern::Uniform,
        SceneSource::File(_) | SceneSource::StillLife { .. } => false,
    };
    if is_computed {
        return None;
    }
    // Of a preview that has fewer of both, those of the full picture.
    let tangent = capture.scene.sample_tangent? / capture.scene.binning as f64;
    let sample_um = 1e3 * capture.lens.reference.first_order().efl_mm.abs() * tangent;
    let pixels = sample_um / capture.place.pixel_pitch_um();
    (pixels > COARSE_PIXELS && pixels.is_finite()).then(|| {
        format!(
            "{}: its samples are {pixels:.1} pixels apart, which sets how sharp the picture can be: more of them, or a narrower field of view, \
             show what the lens does",
            capture.scene.name
        )
    })
}

/// Returns in a sentence where the picture of a panorama ends, where the film is dark beyond.
fn note_on_panorama(run: &Run<'_>) -> Option<String> {
    let capture = run.capture;
    let dark = capture.irradiance.summary.dark_fraction();
    let understood = capture.scene.notes.first()?;
    let is_panorama = capture.camera.scene.reading.panorama.is_some() || understood.contains(" of a panorama of ");
    let fov_deg = capture.camera.scene.field_of_view_deg?;
    (is_panorama && dark > LEAST_DARK_FRACTION).then(|| {
        format!(
            "{}: what is seen of the panorama ends {} degrees to either side of the axis, and {:.1} % of the film are dark: a larger field of \
             view, below 180 degrees, shows more; a lens that sees behind itself takes it as a sky (dioptric render WORLD --sky FILE)",
            capture.scene.name,
            number(0.5 * fov_deg),
            100.0 * dark
        )
    })
}

impl RunReport {
    /// Returns the numbers of a run.
    ///
    /// `files` are those written beside the report.
    ///
    /// # Errors
    /// When the scene has no depth, or a glass is not known at the reference wavelength.
    pub fn new(run: &Run<'_>, files: Vec<String>) -> Result<Self, PipelineError> {
        Self::with_optics(run, RunOptics::of(run)?, files)
    }

    /// Returns the numbers of a run of which what concerns the lens is known already, from a run that shares lens, film, scene and
    /// model with it.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_optics(run: &Run<'_>, optics: RunOptics, files: Vec<String>) -> Result<Self, PipelineError> {
        let capture = run.capture;
        let (place, scene) = (&capture.place, &capture.scene);
        Ok(Self {
            dioptric: env!("CARGO_PKG_VERSION"),
            camera: capture.camera.clone(),
            lens: optics.lens,
            lens_notes: {
                let without_sums = LensData::note_on_third_order(&capture.lens.lens);
                let of_light = note_on_round_halos(run);
                capture.lens_notes().into_iter().chain(without_sums).chain(of_light).collect()
            },
            film_distance_mm: place.film_distance_mm,
            film: FilmData {
                columns: place.columns,
                rows: place.rows,
                pitch_um: place.pitch_um,
                part: place.part,
                dark_fraction: run.capture.irradiance.summary.dark_fraction(),
            },
            scene: SceneData {
                name: scene.name.clone(),
                columns: scene.columns,
                rows: scene.rows,
                near_m: scene.near_m,
                far_m: scene.far_m,
                mean_luminance_cd_m2: scene.mean_luminance_cd_m2,
                light: scene.light.clone(),
                light_temperature: scene.light.as_ref().map(|light| light.illuminant.color_temperature()),
                notes: {
                    let narrow = capture.irradiance.summary.narrow_surfaces;
                    let narrow =
                        narrow.into_iter().flat_map(|narrow| [narrow.note(), narrow.note_on_unknown()]).flatten();
                    let points = capture.irradiance.summary.unseen_points.and_then(|points| points.note());
                    let notes = scene.notes.iter().cloned().chain(narrow).chain(points);
                    notes.chain(note_on_coarse_samples(run)).chain(note_on_panorama(run)).collect()
                },
            },
            irradiance: IrradianceData {
                wavelengths_nm: capture.grid().centers_nm().to_vec(),
                mean_w_m2_nm: capture.irradiance.summary.mean.clone(),
                max_w_m2_nm: capture.irradiance.summary.max.clone(),
                mean_lux: capture.irradiance.summary.mean_lux,
                reflections: ReflectionData {
                    lens_reflections: capture.camera.lens_reflections,
                    share: capture.irradiance.summary.ghost_share,
                    veil: optics.veil,
                },
            },
            sensor: SensorStatistics::new(&capture.frame_parts())?,
            losses: optics.losses,
            white_balance: capture.developed.balance.clone(),
            color_matrix: capture.developed.color.rows.clone(),
            color_matrix_mean_delta_e: capture.developed.color.mean_delta_e(),
            lens_corrections: capture.aberrations.as_ref().map(|aberrations| aberrations.summary),
            dual_pixel: DualPixelData::of(capture),
            files,
        })
    }
}
