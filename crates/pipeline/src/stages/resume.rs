//! A run continued from its folder: what it imaged is taken from there as long as nothing before it changed.

use std::{fs, io, path::Path};

use dioptric_scene::{ExrSamples, read_planes_exr};
use dioptric_spectrum::{DepthMap, SpectralImage};
use serde::{Deserialize, Serialize};

use super::{
    capture::Capture,
    film::FilmPlace,
    irradiance::{IRRADIANCE_FILE, Irradiance, photodiode_irradiance_file},
    kept::KeptCamera,
    narrow_surfaces::NarrowSurfaces,
    scene::SceneSummary,
    spec::FileStamp,
    unseen_points::UnseenPoints,
};
use crate::{Camera, PipelineError, Quality, write_file};

/// The name of the file from which a run is continued.
pub const RESUME_FILE: &str = "kept.ron";

/// What the file holds: the camera as it was, and what the stages after the imaging need.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    camera: Camera,
    files: Vec<FileStamp>,
    scene: SceneSummary,
    place: FilmPlace,
    #[serde(default)]
    narrow_surfaces: Option<NarrowSurfaces>,
    #[serde(default)]
    unseen_points: Option<UnseenPoints>,
    #[serde(default)]
    ghost_share: Option<f64>,
}

/// What the stages behind the imaging of a scene need of it beside the irradiance, so that another process takes the picture again
/// without imaging the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Imaged {
    scene: SceneSummary,
    place: FilmPlace,
    narrow_surfaces: Option<NarrowSurfaces>,
    unseen_points: Option<UnseenPoints>,
    #[serde(default)]
    ghost_share: Option<f64>,
}

impl Imaged {
    /// Returns what a capture has of it.
    pub fn of(capture: &Capture) -> Self {
        Self {
            scene: (*capture.scene).clone(),
            place: (*capture.place).clone(),
            narrow_surfaces: capture.irradiance.summary.narrow_surfaces,
            unseen_points: capture.irradiance.summary.unseen_points,
            ghost_share: capture.irradiance.summary.ghost_share,
        }
    }

    /// Returns the irradiance of spectral images on the film: one, or one a photodiode that is read by itself.
    ///
    /// # Errors
    /// When one has another size than the film or other bands than the scene, or their number is not that of the photodiodes.
    fn irradiance(&self, pictures: Vec<SpectralImage>, n_photodiodes: usize) -> Result<Irradiance, PipelineError> {
        let wrong = |reason: String| PipelineError::Unsuitable { what: "the irradiance", reason };
        if pictures.len() != n_photodiodes {
            return Err(wrong(format!("has {} pictures, expected {n_photodiodes}", pictures.len())));
        }
        let of_picture = |picture: SpectralImage| {
            let (found, expected) = ((picture.rows(), picture.columns()), (self.place.rows, self.place.columns));
            let is_of_scene = picture.grid().centers_nm() == self.scene.wavelengths_nm;
            if found != expected || !is_of_scene {
                return Err(wrong("is not that of the film and the bands that it was taken on".to_owned()));
            }
            Ok(Irradiance::of_image(picture, self.place.pitch_um))
        };
        let mut parts = pictures.into_iter().map(of_picture).collect::<Result<Vec<_>, _>>()?;
        let irradiance = match parts.len() {
            1 => parts.swap_remove(0),
            _ => Irradiance::of_photodiodes(parts, u64::MAX)?,
        };
        let irradiance = irradiance.with_narrow_surfaces(self.narrow_surfaces).with_unseen_points(self.unseen_points);
        Ok(irradiance.with_ghost_share(self.ghost_share))
    }
}

/// A camera that continues a run.
#[derive(Clone, Debug)]
pub struct Resumed {
    /// The camera of the run, with what the run left.
    pub camera: KeptCamera,
    /// What differs from the run: files that changed since, for which the scene is imaged anew, or an irradiance in half floats.
    pub notes: Vec<String>,
}

impl KeptCamera {
    /// Writes what is needed to continue from a folder that holds the irradiance of this capture.
    ///
    /// # Errors
    /// When the file cannot be written, or a part of the camera was made in a program, which no file could name.
    pub fn write_resume_file(&self, capture: &Capture, folder: &Path) -> Result<(), PipelineError> {
        let unknown =
            |e: std::io::Error| PipelineError::Write { path: folder.join(RESUME_FILE), reason: e.to_string() };
        self.given().check_none()?;
        // The run may be continued from another folder.
        let here = std::env::current_dir().map_err(unknown)?;
        let camera = self.with(|camera| camera.resolve_paths(&here));
        let inputs = camera.irradiance_inputs()?;
        let kept = Kept {
            camera: camera.camera().clone(),
            files: inputs.files().cloned().collect(),
            scene: (*capture.scene).clone(),
            place: (*capture.place).clone(),
            narrow_surfaces: capture.irradiance.summary.narrow_surfaces,
            unseen_points: capture.irradiance.summary.unseen_points,
            ghost_share: capture.irradiance.summary.ghost_share,
        };
        let text = ron::ser::to_string_pretty(&kept, ron::ser::PrettyConfig::new())
            .map_err(|e| PipelineError::Write { path: folder.join(RESUME_FILE), reason: e.to_string() })?;
        write_file(&folder.join(RESUME_FILE), text.as_bytes())
    }

    /// Keeps what was imaged by this camera in another process, so that a capture starts behind it.
    ///
    /// # Errors
    /// When the pictures are no irradiance of this camera.
    pub fn keep_imaged(&self, imaged: Imaged, pictures: Vec<SpectralImage>) -> Result<(), PipelineError> {
        let n_photodiodes = self.camera().dual_pixel.map_or(1, |spec| spec.photodiodes.names().len());
        let irradiance = imaged.irradiance(pictures, n_photodiodes)?;
        let (inputs, results) = (self.irradiance_inputs()?, self.results());
        results.film.put(inputs.plan.bank.film.clone(), imaged.place);
        results.summary.put(inputs.scene.clone(), imaged.scene);
        results.irradiance.put(inputs, irradiance);
        Ok(())
    }

    /// Returns the camera of a run with the irradiance that it left in its folder.
    ///
    /// Changes of exposure, sensor, noise and processing start there; any other change images the scene anew, as does a
    /// file that is no longer what it was.
    ///
    /// # Errors
    /// When the folder holds no run at full quality that wrote its irradiance, or a file of it cannot be read.
    pub fn resume(folder: &Path) -> Result<Resumed, PipelineError> {
        let path = folder.join(RESUME_FILE);
        let unreadable = |reason: String| PipelineError::Read { path: path.clone(), reason };
        let text = fs::read_to_string(&path).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => {
                unreadable("expected the folder of a run of full quality that wrote its irradiance".to_owned())
            }
            _ => unreadable(e.to_string()),
        })?;
        let kept: Kept = dioptric_files::ron::from_text(&text).map_err(|error| PipelineError::syntax(&path, error))?;
        let camera = Self::new(kept.camera.clone()).with_quality(Quality::Full);
        let inputs = camera.irradiance_inputs()?;
        let mut notes: Vec<String> = inputs
            .files()
            .filter(|now| !kept.files.contains(now))
            .map(|now| format!("{} is not what it was in the run", now.path().display()))
            .collect();
        if !notes.is_empty() {
            return Ok(Resumed { camera, notes });
        }
        let read = |file: &str| -> Result<Irradiance, PipelineError> {
            let irradiance = Irradiance::read_exr(&folder.join(file), Some(kept.place.pitch_um))?.of_own_file();
            kept.check(&irradiance, file).map_err(unreadable)?;
            Ok(irradiance.stored_in(&folder.join(file), kept.camera.outputs.exr_samples))
        };
        let irradiance = match kept.camera.dual_pixel {
            None => read(IRRADIANCE_FILE)?,
            Some(spec) => {
                let names = spec.photodiodes.names().iter();
                let photodiodes =
                    names.map(|name| read(&photodiode_irradiance_file(name))).collect::<Result<_, _>>()?;
                Irradiance::of_photodiodes(photodiodes, u64::MAX)?
            }
        };
        let irradiance = irradiance.with_narrow_surfaces(kept.narrow_surfaces).with_unseen_points(kept.unseen_points);
        let irradiance = irradiance.with_ghost_share(kept.ghost_share);
        if kept.camera.outputs.exr_samples == ExrSamples::Half {
            notes.push(format!("{IRRADIANCE_FILE} has half floats: its samples are those of the run to .05 %"));
        }
        let results = camera.results();
        if let Some(depth) = read_depth(&folder.join("depth.exr"), (kept.scene.rows, kept.scene.columns)) {
            results.depth.put(inputs.scene.geometry.clone(), depth);
        }
        results.film.put(inputs.plan.bank.film.clone(), kept.place);
        results.summary.put(inputs.scene.clone(), kept.scene);
        results.irradiance.put(inputs, irradiance);
        Ok(Resumed { camera, notes })
    }
}

impl Kept {
    /// Returns why an irradiance cannot be that of the run.
    fn check(&self, irradiance: &Irradiance, file: &str) -> Result<(), String> {
        use dioptric_spectrum::Bands;
        let (found, expected) = (irradiance.size(), (self.place.rows, self.place.columns));
        if found != expected {
            return Err(format!(
                "{file} has {} × {} samples, expected {} × {}",
                found.1, found.0, expected.1, expected.0
            ));
        }
        let (found, expected) = (irradiance.grid().len(), self.scene.wavelengths_nm.len());
        if found != expected {
            return Err(format!("{file} has {found} bands, expected {expected}"));
        }
        Ok(())
    }
}

/// Returns the depth that a run wrote, if it did and it is of the scene's size.
fn read_depth(path: &Path, size: (usize, usize)) -> Option<DepthMap> {
    let planes = read_planes_exr(path).ok()?.of_own_file();
    let (_, z_m) = planes.into_iter().find(|(name, _)| name == "Z")?;
    (z_m.dim() == size).then(|| DepthMap::new(z_m).ok()).flatten()
}
