//! Files of scenes described, and made spectral EXR or files of ISETCam.

use std::path::Path;

use dioptric_scene::{ExrSamples, Scene, SceneLight, View, write_iset_scene, write_preview_png, write_scene_exr};
use dioptric_spectrum::{Observer, WavelengthGrid, Xyz};
use serde::Serialize;

use crate::{Crop, PipelineError, SceneSpec};

/// What is made of a scene before it is described or written.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneRequest {
    /// The file, and what is said of it.
    pub scene: SceneSpec,
    /// The bands wanted, nm; those of the file where `None`.
    pub wavelengths_nm: Option<Vec<f64>>,
    /// The part of its samples that is wanted.
    pub crop: Option<Crop>,
    /// How many samples become one, each way.
    pub bin: usize,
    /// Quarter turns clockwise.
    pub quarter_turns: usize,
}

/// What a file of a scene holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneInfo {
    /// Its name.
    pub name: String,
    /// What was understood of it, in a line.
    pub understood: String,
    /// Columns of samples.
    pub columns: usize,
    /// Rows of samples.
    pub rows: usize,
    /// Centers of its bands, nm.
    pub wavelengths_nm: Vec<f64>,
    /// Mean luminance, cd/m².
    pub mean_luminance_cd_m2: f64,
    /// Mean radiance of each band, W m⁻² sr⁻¹ nm⁻¹.
    pub mean_radiance: Vec<f64>,
    /// The largest radiance of each band.
    pub largest_radiance: Vec<f64>,
    /// The light on it, where that is known.
    pub light: Option<SceneLight>,
    /// Nearest and farthest depth along the axis, m, where it has any; infinity is written as null.
    pub depth_m: Option<[f64; 2]>,
    /// Share of its samples that are infinitely far.
    pub sky_fraction: Option<f64>,
    /// Whether it says what lies behind the first surface.
    pub has_hidden_layer: bool,
    /// Pinhole geometry of the samples, where it is known.
    pub view: Option<View>,
    /// Its horizontal field of view from edge to edge, degrees.
    pub field_of_view_deg: Option<f64>,
    /// What was done to its samples, and what of the file is not used.
    pub notes: Vec<String>,
}

impl SceneRequest {
    /// Returns the scene that is asked for.
    ///
    /// # Errors
    /// When the file cannot be read, or the part reaches beyond it.
    pub fn open(&self) -> Result<Scene, PipelineError> {
        let grid = self.wavelengths_nm.clone().map(WavelengthGrid::new).transpose()?;
        let mut scene = self.scene.look(grid.as_ref())?;
        if let Some(crop) = self.crop {
            let rows = crop.y..crop.y.saturating_add(crop.rows);
            let columns = crop.x..crop.x.saturating_add(crop.columns);
            scene = scene.cropped(rows, columns)?;
        }
        if self.bin != 1 {
            scene = scene.binned(self.bin)?;
        }
        Ok(scene.turned(self.quarter_turns)?)
    }

    /// Returns what the file holds, and writes a picture of it where one is wanted.
    ///
    /// # Errors
    /// As [`open`](Self::open), and when the picture cannot be written.
    pub fn describe(&self, picture: Option<&Path>) -> Result<SceneInfo, PipelineError> {
        let scene = self.open()?;
        if let Some(path) = picture {
            if path.extension().is_some_and(|ending| !ending.eq_ignore_ascii_case("png")) {
                let reason = format!("{}: the picture is written as PNG, expected the ending .png", path.display());
                return Err(PipelineError::Unsuitable { what: "output", reason });
            }
            write_preview_png(path, &scene.radiance, white_of(&scene))?;
        }
        Ok(SceneInfo::of(&scene))
    }

    /// Writes the scene with all that it has, as a scene of `ISETCam` where the name ends in `.mat` and else as spectral EXR, and returns what
    /// it holds.
    ///
    /// # Errors
    /// As [`open`](Self::open), when samples of EXR are asked of another file, and when the file cannot be written; then there is none.
    pub fn convert(&self, output: &Path, samples: Option<ExrSamples>) -> Result<SceneInfo, PipelineError> {
        let is_mat = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mat"));
        if is_mat && samples.is_some() {
            return Err(no_exr_samples(output));
        }
        let is_other = output.extension().is_some_and(|ending| !ending.eq_ignore_ascii_case("exr")) && !is_mat;
        if is_other {
            let reason =
                format!("{}: a scene is written as .exr or .mat, expected one of these endings", output.display());
            return Err(PipelineError::Unsuitable { what: "output", reason });
        }
        let scene = self.open()?;
        if is_mat {
            write_iset_scene(output, &scene)?;
        } else {
            write_scene_exr(output, &scene, samples.unwrap_or_default())?;
        }
        Ok(SceneInfo::of(&scene))
    }
}

pub(crate) fn no_exr_samples(output: &Path) -> PipelineError {
    let reason = format!("{} is no EXR file, expected it without --exr-samples", output.display());
    PipelineError::Unsuitable { what: "samples of an EXR file", reason }
}

impl SceneInfo {
    fn of(scene: &Scene) -> Self {
        let image = &scene.radiance;
        let (understood, notes) = match scene.notes.split_first() {
            Some((first, others)) => (first.clone(), others.to_vec()),
            None => (scene.name.clone(), vec![]),
        };
        let n = (scene.rows() * scene.columns()) as f64;
        let sum = |plane: &ndarray::Array2<f32>| plane.iter().map(|v| f64::from(*v)).sum::<f64>();
        Self {
            name: scene.name.clone(),
            understood,
            columns: scene.columns(),
            rows: scene.rows(),
            wavelengths_nm: image.grid().centers_nm().to_vec(),
            mean_luminance_cd_m2: scene.mean_luminance_cd_m2(),
            mean_radiance: image.planes().iter().map(|plane| sum(plane) / n).collect(),
            largest_radiance: image.planes().iter().map(|p| p.iter().copied().fold(0.0, f32::max).into()).collect(),
            light: scene.light.clone(),
            depth_m: scene.depth.as_ref().map(|depth| {
                let (near, far) = depth.range_m();
                [near, far]
            }),
            sky_fraction: scene
                .depth
                .as_ref()
                .map(|depth| depth.z_m().iter().filter(|z| z.is_infinite()).count() as f64 / n),
            has_hidden_layer: scene.hidden.is_some(),
            view: scene.view,
            field_of_view_deg: scene.view.map(|view| view.horizontal_fov_deg(scene.columns())),
            notes,
        }
    }
}

/// Returns what is white in a picture of a scene: a white under its light, or an even light of which 99 % of the samples are no brighter.
fn white_of(scene: &Scene) -> Xyz {
    let grid = scene.radiance.grid();
    if let Some(light) = &scene.light
        && let Some(lux) = light.illuminance_lux
    {
        let xyz = Observer::Cie1931.xyz(grid, &light.illuminant.white_radiance(grid, lux));
        if xyz.0.iter().all(|v| *v > 0.0) {
            return xyz;
        }
    }
    let [_, weights, _] = Observer::Cie1931.weights(grid);
    let mut luminances = vec![0.0_f32; scene.rows() * scene.columns()];
    for (plane, weight) in scene.radiance.planes().iter().zip(weights) {
        luminances.iter_mut().zip(plane).for_each(|(sum, v)| *sum += weight as f32 * v);
    }
    let at = (luminances.len() - 1) * 99 / 100;
    let (_, white, _) = luminances.select_nth_unstable_by(at, f32::total_cmp);
    let white = f64::from(*white).max(1e-12);
    Xyz(Xyz::D65.0.map(|v| v / Xyz::D65.0[1] * white))
}
