//! One item: the picture of one camera and its files.

use std::{fmt, fs, io, path::Path, sync::Arc};

use dioptric_analysis::{Run, RunOptics, RunReport};
use dioptric_pictures::encode_rgb8_png_in;
use dioptric_pipeline::{
    Camera, Capture, FilmPlace, GivenParts, KeptCamera, PaintingFolder, PipelineError, Progress, ResolvedLens,
    SceneSummary, Stage, write_capture, write_file, write_json,
};
use dioptric_psf::LensImageModel;
use dioptric_spectrum::Cancel;
use serde::{Deserialize, Serialize};

use crate::{
    Keep, SweepError,
    metrics::{Metrics, metrics, part_of_report},
};

/// The name of the camera file.
const CAMERA: &str = "camera.ron";
/// The name of the file with the reason for which a camera was refused.
pub(crate) const REFUSED: &str = "refused.json";
/// The name of the small picture.
pub(crate) const THUMBNAIL: &str = "thumbnail.png";
/// The name of the picture.
pub(crate) const PICTURE: &str = "picture.png";
/// The name of the report.
const REPORT: &str = "report.json";
/// The name of the file of what metrics are read from, of items without a report.
const METRICS: &str = "metrics.json";
/// Widest small picture, pixels.
const THUMBNAIL_PX: usize = 192;

/// Why a camera has no picture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Refusal {
    pub(crate) reason: String,
}

/// What came of taking a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Taken {
    /// It is there.
    Picture,
    /// Its camera was refused; the reason is there.
    Refused,
    /// A file that the camera is made from cannot be read, for this reason.
    Unreadable(String),
}

/// What items have in common, kept from one to the next.
pub(crate) struct Bench {
    camera: Option<KeptCamera>,
    optics: Option<(Shared, RunOptics)>,
    paintings: Option<PaintingFolder>,
    keep: Vec<Keep>,
}

impl fmt::Debug for Bench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bench").field("camera", &self.camera.as_ref().map(KeptCamera::camera)).finish_non_exhaustive()
    }
}

/// What the optics of a report are made from.
#[derive(Clone)]
struct Shared {
    lens: Arc<ResolvedLens>,
    place: Arc<FilmPlace>,
    scene: Arc<SceneSummary>,
    model: Arc<LensImageModel>,
}

impl Shared {
    /// Whether they are the same results, not equal ones: stages with equal inputs hand out one result.
    fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.lens, &other.lens)
            && Arc::ptr_eq(&self.place, &other.place)
            && Arc::ptr_eq(&self.scene, &other.scene)
            && Arc::ptr_eq(&self.model, &other.model)
    }
}

impl Bench {
    /// Returns a bench on which nothing is kept yet; gathered views come from a folder and go there, and these files are kept of each item.
    pub(crate) fn new(paintings: Option<PaintingFolder>, keep: &[Keep]) -> Self {
        Self { camera: None, optics: None, paintings, keep: keep.to_vec() }
    }

    /// Takes the picture of a camera and writes all files of the item into a folder; returns what came of it.
    ///
    /// A camera that cannot be is written with the reason.
    pub(crate) fn make(
        &mut self,
        camera: &Camera,
        folder: &Path,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Taken, SweepError> {
        if self.keep.contains(&Keep::Camera) {
            write_file(&folder.join(CAMERA), (camera.to_ron() + "\n").as_bytes())?;
        }
        match self.take(camera, folder, progress, cancel) {
            Ok(()) => Ok(Taken::Picture),
            Err(error) if error.is_unreadable() => Ok(Taken::Unreadable(error.to_string())),
            Err(error) if !error.is_passing() => {
                leave_camera_alone(folder).map_err(SweepError::writing(folder))?;
                write_json(&folder.join(REFUSED), &Refusal { reason: error.to_string() })?;
                Ok(Taken::Refused)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn take(
        &mut self,
        camera: &Camera,
        folder: &Path,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(), PipelineError> {
        let keep = self.keep.clone();
        let kept = match self.camera.take() {
            Some(kept) => kept.with_camera(camera.clone(), GivenParts::default()),
            None => KeptCamera::new(camera.clone()).with_paintings(self.paintings.clone()),
        };
        let kept = self.camera.insert(kept);
        let capture = kept.capture(progress, cancel)?;
        let model = kept.model(progress, cancel)?;
        let depth = if camera.outputs.depth { Some(kept.depth(progress, cancel)?) } else { None };
        progress.at(Stage::Report, 0.0);
        let run = Run { capture: &capture, model: &model, depth: depth.as_deref() };
        let optics = self.optics_of(&run, model.clone())?;
        let (mut files, _) = write_capture(&capture, depth.as_deref(), folder)?;
        let keeps = |file: Keep| keep.contains(&file);
        if !keeps(Keep::Picture) {
            let picture = folder.join(PICTURE);
            fs::remove_file(&picture).map_err(|e| PipelineError::Write { path: picture, reason: e.to_string() })?;
            files.retain(|file| file != PICTURE);
        }
        let report = RunReport::with_optics(&run, optics, files)?;
        match keeps(Keep::Report) {
            true => write_json(&folder.join(REPORT), &report)?,
            false => {
                let path = folder.join(METRICS);
                let json = serde_json::to_vec(&report).and_then(|report| part_of_report(&report));
                let json = json.map_err(|e| PipelineError::Write { path: path.clone(), reason: e.to_string() })?;
                write_file(&path, &json)?;
            }
        }
        if keeps(Keep::Thumbnail) {
            write_file(&folder.join(THUMBNAIL), &thumbnail(&capture)?)?;
        }
        Ok(())
    }

    /// Returns the report on the lens, from the item before where that shares it.
    fn optics_of(&mut self, run: &Run<'_>, model: Arc<LensImageModel>) -> Result<RunOptics, PipelineError> {
        let Capture { lens, place, scene, .. } = run.capture;
        let own = Shared { lens: lens.clone(), place: place.clone(), scene: scene.clone(), model };
        if let Some((_, optics)) = self.optics.as_ref().filter(|(shared, _)| shared.is(&own)) {
            return Ok(optics.clone());
        }
        let optics = RunOptics::of(run)?;
        self.optics = Some((own, optics.clone()));
        Ok(optics)
    }
}

/// Returns the metrics of an item that has a picture.
pub(crate) fn read_metrics(folder: &Path, keep: &[Keep]) -> Result<Metrics, SweepError> {
    let path = folder.join(if keep.contains(&Keep::Report) { REPORT } else { METRICS });
    let bytes = fs::read(&path).map_err(SweepError::reading(&path))?;
    metrics(&bytes).map_err(|error| SweepError::Pipeline(PipelineError::Read { path, reason: error.to_string() }))
}

/// Removes what was written of a picture before its camera was refused: by a sensor whose frames no DNG can hold.
fn leave_camera_alone(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name() != CAMERA {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Returns the picture made smaller by a whole number, as PNG.
fn thumbnail(capture: &Capture) -> Result<Vec<u8>, PipelineError> {
    let picture = &capture.developed.picture;
    let (columns, rows) = (picture.columns(), picture.rows());
    let (codes, factor) = (picture.to_rgb8(), columns.div_ceil(THUMBNAIL_PX).max(1));
    let (width, height) = (columns.div_ceil(factor), rows.div_ceil(factor));
    let mut small = Vec::with_capacity(3 * width * height);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let (below, right) = ((factor * (y + 1)).min(rows), (factor * (x + 1)).min(columns));
        for channel in 0..3 {
            let samples = (factor * y..below).flat_map(|row| (factor * x..right).map(move |column| (row, column)));
            let codes = samples.map(|(row, column)| u32::from(codes[3 * (row * columns + column) + channel]));
            let (sum, n) = codes.fold((0, 0), |(sum, n), code| (sum + code, n + 1));
            small.push(((sum + n / 2) / n) as u8);
        }
    }
    let space = picture.space.of_file();
    encode_rgb8_png_in(&small, (width, height), space).map_err(|error| PipelineError::Png { reason: error.to_string() })
}
