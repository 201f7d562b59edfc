//! The depth of a scene: of the file that is told, its own, or one beside it, filled and along the axis.

use std::path::{Path, PathBuf};

use dioptric_spectrum::DepthMap;
use ndarray::Array2;

use super::{
    camera::CameraFile,
    contents::{Contents, MATLAB_OR_HDF5, is_of},
    depth::{depth_beside, files_beside, likely_beside, read_depth},
    raw_depth::{DepthWords, RawDepth},
    read_options::ReadOptions,
    reading::{DepthUnit, Frame},
    stated::{name_of, note_of},
    unmeasured::{self, FillDepth, is_measured},
    unusable::unreadable,
};
use crate::{SceneError, View};

/// What nerfstudio takes 1 of a depth for, m, where nothing says otherwise.
const NERFSTUDIO_UNIT_M: f64 = 1e-3;

/// Returns what is said of a depth, and by the camera file of the picture, and that file.
pub(super) fn words<'a>(
    path: &Path,
    options: &'a ReadOptions,
) -> Result<(DepthWords<'a>, Option<CameraFile>), SceneError> {
    let reading = &options.reading;
    let camera = match &reading.view {
        Some(file) => Some(CameraFile::read(file, path)?),
        None => CameraFile::beside(path)?,
    };
    let unit_m = camera.as_ref().and_then(|camera| camera.depth_unit_m);
    let (kind, variable) = (reading.depth_kind, reading.depth_variable.as_deref());
    Ok((DepthWords { kind, unit: reading.depth_unit.as_deref(), variable, unit_m }, camera))
}

/// Reads the depth that a picture's frame of nerfstudio names.
fn depth_of_frame(file: &Path, camera: &Path, words: DepthWords<'_>) -> Result<RawDepth, SceneError> {
    if !file.is_file() {
        let reason =
            format!("its depth_file_path names '{}', which is no file: --depth FILE names another", file.display());
        return Err(unreadable(camera, reason));
    }
    let usual = words.unit_m.unwrap_or(NERFSTUDIO_UNIT_M);
    let mut depth = read_depth(file, DepthWords { unit_m: Some(usual), ..words })?;
    if depth.top.is_none() && words.unit_m.is_none() && depth.unit == DepthUnit::Metres(usual) {
        depth.notes.push(format!(
            "{}: its floats are taken for millimetres, as nerfstudio takes them where {} states no depth_unit_scale_factor",
            name_of(file),
            name_of(camera)
        ));
    }
    Ok(depth)
}

/// Returns the depth as it stands in its file, on the image's samples, and notes what else there was.
pub(super) fn raw_depth(
    path: &Path,
    contents: &mut Contents,
    frame: Frame,
    options: &ReadOptions,
) -> Result<Option<RawDepth>, SceneError> {
    let (words, camera) = words(path, options)?;
    let (rows, columns) = contents.size();
    let own = contents.depth.take();
    let of_frame = camera.and_then(|camera| Some((camera.depth_file?, camera.file)));
    let beside = || {
        let framed = of_frame.iter().map(|(file, _)| file.clone());
        let mut names: Vec<String> = framed.chain(files_beside(path)).map(|file| name_of(&file)).collect();
        names.dedup();
        names
    };
    let mut unused = vec![];
    let depth = match (&options.reading.depth, own) {
        (Some(file), own) => {
            unused.extend(own.map(|own| own.from));
            unused.extend(beside().into_iter().filter(|name| *name != name_of(file)));
            Some(read_depth(file, words)?)
        }
        (None, own) if words.variable.is_some() && (is_of(path, MATLAB_OR_HDF5) || is_of(path, &["npz"])) => {
            unused = beside();
            unused.extend(own.map(|own| own.from));
            let mut depth = read_depth(path, words)?;
            // The other arrays are the scene's, which names those that are not used.
            let others = format!("{}: its array", name_of(path));
            depth.notes.retain(|note| !note.starts_with(&others));
            Some(depth)
        }
        (None, Some(own)) => {
            unused = beside();
            Some(own.told(DepthWords { unit_m: None, ..words })?)
        }
        (None, None) => match &of_frame {
            Some((file, camera)) => {
                unused.extend(beside().into_iter().filter(|name| *name != name_of(file)));
                Some(depth_of_frame(file, camera, words)?)
            }
            None => depth_beside(path, words)?,
        },
    };
    let is_told = words.kind.is_some() || words.unit.is_some() || words.variable.is_some();
    let Some(depth) = depth else {
        let likely = likely_beside(path);
        let hint = likely.first().map_or_else(String::new, |name| format!(", as {name}"));
        if is_told {
            let reason = format!("it has no depth that a unit or a kind could be said of: expected --depth FILE{hint}");
            return Err(unreadable(path, reason));
        }
        if options.fill_depth.is_some() {
            let reason =
                format!("it has no depth with gaps that could be filled (--fill-depth): expected --depth FILE{hint}");
            return Err(unreadable(path, reason));
        }
        let note = note_of(path, "likely depth file", &likely);
        contents.notes.extend(note.map(|note| note + ": --depth FILE names one"));
        return Ok(None);
    };
    if let Some(unit_m) = words.unit_m.filter(|unit_m| depth.unit != DepthUnit::Metres(*unit_m)) {
        let name = name_of(path);
        contents.notes.push(format!(
            "{name}: the depth_unit_m of its camera data, {unit_m}, is not used: something else says what its depths are"
        ));
    }
    contents.notes.extend(note_of(path, "depth", &unused));
    if options.depth_m.is_some() {
        contents.notes.push(format!("{}: --depth-m is not used, since it has {}", name_of(path), depth.from));
    }
    let depth = depth.laid_on(frame, (rows, columns));
    let mut depth = depth.resized(rows, columns)?;
    contents.notes.append(&mut depth.notes);
    Ok(Some(depth))
}

/// Fills depths that were not measured and takes distances from the projection center for depths along the axis; `None` for
/// distances of samples whose directions are not known.
pub(super) fn depth_of(
    raw: RawDepth,
    view: Option<View>,
    fill: Option<FillDepth>,
    notes: &mut Vec<String>,
) -> Result<Option<DepthMap>, SceneError> {
    let file = &raw.file;
    let values = |reason| SceneError::Values { file: file.clone(), reason };
    let Some(values_m) = raw.axial_m(view) else {
        notes.push(format!("{}: its depth {} needs the field of view and is not used", name_of(file), raw.describe()));
        return Ok(None);
    };
    check_sign(file, &values_m)?;
    let n_samples = values_m.len();
    let Some(fill) = fill.or(raw.is_picture.then_some(FillDepth::Beside)) else {
        check_measured(file, &values_m)?;
        return Ok(Some(DepthMap::new(values_m).map_err(values)?));
    };
    let Some((z_m, n_unmeasured)) = unmeasured::filled(values_m, fill) else {
        return Err(unreadable(file, "no sample of it has a depth"));
    };
    if n_unmeasured > 0 {
        notes.push(unmeasured::note(n_unmeasured, n_samples, fill));
    }
    Ok(Some(DepthMap::new(z_m).map_err(values)?))
}

/// Checks that depths do not count along an axis that points to the camera: a few below 0 were not measured.
fn check_sign(file: &Path, z_m: &Array2<f32>) -> Result<(), SceneError> {
    // What programs put for none.
    const LEAST_M: f32 = -1e9;
    let n_below = z_m.iter().filter(|z| (LEAST_M..0.0).contains(*z)).count();
    if n_below <= z_m.iter().filter(|z| is_measured(**z)).count() {
        return Ok(());
    }
    let reason = format!(
        "{n_below} of its {} depths are below 0, as along an axis that points to the camera (OpenGL, Houdini): expected them with the \
         other sign",
        z_m.len()
    );
    Err(unreadable(file, reason))
}

/// Checks that every depth was measured.
fn check_measured(file: &Path, z_m: &Array2<f32>) -> Result<(), SceneError> {
    let Some(((row, column), _)) = z_m.indexed_iter().find(|(_, z)| !is_measured(**z)) else { return Ok(()) };
    let n_unmeasured = z_m.iter().filter(|z| !is_measured(**z)).count();
    Err(SceneError::Unmeasured { file: PathBuf::from(file), row, column, n_unmeasured, n_samples: z_m.len() })
}

/// Returns the depths of a hidden layer, where nothing is known those of the first surface.
pub(super) fn behind(file: &Path, mut z_m: Array2<f32>, first: Option<&DepthMap>) -> Result<DepthMap, SceneError> {
    if let Some(first) = first.filter(|first| first.z_m().dim() == z_m.dim()) {
        z_m.zip_mut_with(first.z_m(), |z, first| {
            if !is_measured(*z) {
                *z = *first;
            }
        });
    }
    DepthMap::new(z_m).map_err(|reason| SceneError::Values { file: file.to_owned(), reason })
}
