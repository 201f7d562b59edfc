//! What lies behind the first surface of a scene.

use std::path::Path;

use dioptric_spectrum::DepthMap;

use super::{
    camera::CameraData,
    contents::Hidden,
    depth::depth_beside,
    lighting::lit,
    raw_depth::DepthWords,
    read_contents::contents_of,
    read_options::ReadOptions,
    reading::{FileReading, Frame},
    scene_depth::{behind, words},
    stated::name_of,
    unusable::unreadable,
};
use crate::{HiddenLayer, SceneError, View};

/// Reads what lies behind the first surface from a file of its own, of any kind that a scene is read from: radiance and depth of the same
/// samples, seen from the same place.
pub(super) fn read_hidden(
    file: &Path,
    first: &Path,
    frame: Frame,
    options: &ReadOptions,
) -> Result<Hidden, SceneError> {
    let reading = &options.reading;
    let mut reading = FileReading { view: None, ..reading.clone() };
    if reading.depth.take().is_some() {
        // What is told of a file of depth is told of that of the first surface.
        reading = FileReading { depth_variable: None, depth_unit: None, depth_kind: None, ..reading };
    }
    let options = &ReadOptions { hidden: None, reading, ..options.clone() };
    let mut contents = contents_of(file, options)?;
    contents.check_heeds(file, options)?;
    if contents.panorama.is_some() || contents.frame() != frame {
        let reason = format!("its samples are others than those of {}, behind which they lie", name_of(first));
        return Err(unreadable(file, reason));
    }
    let words = words(file, options)?;
    contents.depth = match contents.depth.take() {
        Some(own) => Some(own.told(DepthWords { unit_m: None, ..words })?),
        None => depth_beside(file, words)?,
    };
    let mut unused: Vec<String> = contents.hidden.take().map(|_| "layer 'hidden'".to_owned()).into_iter().collect();
    unused.extend(contents.view.take().map(|_| "camera data".to_owned()));
    let beside = CameraData::beside(file)?.map(|camera| camera.file);
    let of_first = CameraData::beside(first)?.map(|camera| camera.file);
    unused.extend(beside.filter(|beside| Some(beside) != of_first.as_ref()).map(|beside| name_of(&beside)));
    contents.notes.extend(
        (!unused.is_empty()).then(|| {
            format!("{}: its {} is not used, but that of {}", name_of(file), unused.join(", "), name_of(first))
        }),
    );
    Ok(Hidden { file: file.to_owned(), contents })
}

/// Returns radiance and depth of what lies behind a first surface of this view and depth, on the bands wanted.
pub(super) fn hidden_layer(
    hidden: Hidden,
    (view, first): (Option<View>, Option<&DepthMap>),
    options: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<HiddenLayer, SceneError> {
    let Hidden { file, mut contents } = hidden;
    let (rows, columns) = contents.size();
    let lacks = || unreadable(&file, "a hidden layer needs a depth, expected a channel 'Z' or a NAME.depth.png");
    let depth = contents.depth.take().ok_or_else(lacks)?.resized(rows, columns)?;
    notes.append(&mut contents.notes);
    notes.extend(depth.notes.iter().cloned());
    let needs_view = || unreadable(&file, "the depth of its hidden layer needs a field of view (--fov-deg)");
    let z_m = depth.axial_m(view)?.ok_or_else(needs_view)?;
    let (radiance, _) = lit(&file, contents, options, notes)?;
    Ok(HiddenLayer { radiance, depth: behind(&file, z_m, first)? })
}
