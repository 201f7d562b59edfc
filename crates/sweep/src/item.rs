//! One item: the picture of one camera and its files.

use std::{fs, io, path::Path};

use dioptric_analysis::{Run, RunReport};
use dioptric_pictures::encode_rgb8_png;
use dioptric_pipeline::{
    Camera, Capture, GivenParts, KeptCamera, PipelineError, Progress, Stage, write_capture, write_file, write_json,
};
use dioptric_spectrum::Cancel;
use serde::{Deserialize, Serialize};

use crate::SweepError;

/// The name of the camera file.
const CAMERA: &str = "camera.ron";
/// The name of the file that says why a camera was refused.
pub(crate) const REFUSED: &str = "refused.json";
/// The name of the small picture.
pub(crate) const THUMBNAIL: &str = "thumbnail.png";
/// Widest small picture, pixels.
const THUMBNAIL_PX: usize = 192;

/// Why a camera has no picture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Refusal {
    pub(crate) reason: String,
}

/// Takes the picture of a camera and writes all files of the item into a folder; returns whether there is a picture.
///
/// `kept` has the results of the camera before, and gets those of this one. A camera that cannot be is written with the
/// reason.
pub(crate) fn make(
    kept: &mut Option<KeptCamera>,
    camera: &Camera,
    folder: &Path,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<bool, SweepError> {
    write_file(&folder.join(CAMERA), (camera.to_ron() + "\n").as_bytes())?;
    let own = match kept.take() {
        Some(kept) => kept.with_camera(camera.clone(), GivenParts::default()),
        None => KeptCamera::new(camera.clone()),
    };
    let taken = take(kept.insert(own), folder, progress, cancel);
    match taken {
        Ok(()) => Ok(true),
        Err(error) if !error.is_passing() => {
            leave_camera_alone(folder).map_err(SweepError::writing(folder))?;
            write_json(&folder.join(REFUSED), &Refusal { reason: error.to_string() })?;
            Ok(false)
        }
        Err(error) => Err(error.into()),
    }
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

fn take(kept: &KeptCamera, folder: &Path, progress: &dyn Progress, cancel: &Cancel) -> Result<(), PipelineError> {
    let capture = kept.capture(progress, cancel)?;
    let model = kept.model(progress, cancel)?;
    let depth = if capture.camera.outputs.depth { Some(kept.depth(progress, cancel)?) } else { None };
    progress.at(Stage::Report, 0.0);
    let run = Run { capture: &capture, model: &model, depth: depth.as_deref() };
    let mut report = RunReport::new(&run, Vec::new())?;
    (report.files, _) = write_capture(&capture, depth.as_deref(), folder)?;
    write_json(&folder.join("report.json"), &report)?;
    write_file(&folder.join(THUMBNAIL), &thumbnail(&capture)?)
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
    encode_rgb8_png(&small, (width, height)).map_err(|error| PipelineError::Png { reason: error.to_string() })
}
