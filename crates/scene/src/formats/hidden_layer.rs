//! What lies behind the first surface of a scene.

use std::path::Path;

use dioptric_spectrum::{DepthMap, WavelengthGrid};

use super::{
    camera::CameraFile,
    contents::{Contents, Hidden, Image},
    depth::depth_beside,
    lighting::{lit, under},
    raw_depth::DepthWords,
    read_contents::contents_of,
    read_options::ReadOptions,
    reading::{FileReading, Frame},
    scene_depth::{behind, words},
    stated::name_of,
    understood::{bands, brightness, range, resampling_note},
    unusable::unreadable,
};
use crate::{HiddenLayer, SceneError, SceneLight, View};

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
    let mut contents = contents_behind(file, options)?;
    if contents.panorama.is_some() || contents.frame() != frame {
        let reason = format!("its samples are others than those of {}, behind which they lie", name_of(first));
        return Err(unreadable(file, reason));
    }
    let (words, _) = words(file, options)?;
    contents.depth = match contents.depth.take() {
        Some(own) => Some(own.told(DepthWords { unit_m: None, ..words })?),
        None => depth_beside(file, words)?,
    };
    let mut unused: Vec<String> = contents.hidden.take().map(|_| "layer 'hidden'".to_owned()).into_iter().collect();
    unused.extend(contents.view.take().map(|_| "camera data".to_owned()));
    let beside = CameraFile::beside(file)?.map(|camera| camera.file);
    let of_first = CameraFile::beside(first)?.map(|camera| camera.file);
    unused.extend(beside.filter(|beside| Some(beside) != of_first.as_ref()).map(|beside| name_of(&beside)));
    contents.notes.extend(
        (!unused.is_empty()).then(|| {
            format!("{}: its {} is not used, but that of {}", name_of(file), unused.join(", "), name_of(first))
        }),
    );
    Ok(Hidden { file: file.to_owned(), contents })
}

/// Reads a file under what is said of the numbers of the first surface, where it says not itself what its own are.
fn contents_behind(file: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let of = |options: &ReadOptions| {
        let contents = contents_of(file, options)?;
        // Codes have no samples without data; those of the first surface may.
        let no_data = options.reading.no_data.filter(|_| !matches!(contents.image, Image::Codes(..)));
        let reading = FileReading { no_data, ..options.reading.clone() };
        contents.check_heeds(file, &ReadOptions { reading, ..options.clone() })?;
        Ok(contents)
    };
    let Some(told) = told_words(options) else { return of(options) };
    let noted = |contents: Contents, words: &str| {
        let note = format!("{}: what was said of the first surface ({told}) {words}", name_of(file));
        Contents { notes: contents.notes.into_iter().chain([note]).collect(), ..contents }
    };
    match of(options) {
        Ok(contents) => Ok(noted(contents, "counts for it too")),
        Err(error @ (SceneError::DoesNotApply { .. } | SceneError::Units { .. })) => {
            let FileReading { depth, depth_unit, depth_kind, depth_variable, no_data, .. } = options.reading.clone();
            let reading =
                FileReading { depth, depth_unit, depth_kind, depth_variable, no_data, ..FileReading::default() };
            let own = of(&ReadOptions { reading, white_level: None, ..options.clone() }).map_err(|_| error)?;
            Ok(noted(own, "does not count for it, which says itself what it is"))
        }
        Err(error) => Err(error),
    }
}

/// Returns the names of what is said of the numbers of the first surface, where anything is.
fn told_words(options: &ReadOptions) -> Option<String> {
    let reading = &options.reading;
    let given = [
        ("--quantity", reading.quantity.is_some()),
        ("--unit", reading.unit.is_some()),
        ("--scale", reading.scale.is_some()),
        ("--white-level", options.white_level.is_some()),
        ("--scene-wavelengths-nm", reading.wavelengths_nm.is_some()),
        ("--variable", reading.variable.is_some()),
        ("--axes", reading.axes.is_some()),
    ];
    let names: Vec<&str> = given.into_iter().filter(|(_, is_given)| *is_given).map(|(name, _)| name).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// Returns radiance and depth of what lies behind a first surface of this view and depth, on the bands wanted; reflectances are under the light on
/// the first surface where that is known and no other is asked for.
pub(super) fn hidden_layer(
    hidden: Hidden,
    front: Front<'_>,
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
    let z_m = depth.axial_m(front.view).ok_or_else(needs_view)?;
    let n_known = z_m.iter().filter(|z| **z > 0.0).count();
    if n_known == 0 {
        return Err(unreadable(&file, "its depth is nowhere a number above 0, so that nothing would lie behind"));
    }
    let options = options_behind(&contents, &front, options);
    if contents.light.as_ref().is_some_and(|own| Some(own) != front.light) {
        notes.push(format!(
            "{}: the light that it states is not used: what is done to light counts for both layers",
            name_of(&file)
        ));
    }
    let own = contents.own_grid();
    notes.extend(own.as_ref().and_then(|own| resampling_note(&name_of(&file), own, options.grid.as_ref())));
    let (mut what, is_lit) = (contents.what.clone(), contents.is_reflectance(&options));
    let (radiance, light) = lit(&file, contents, &options, notes)?;
    if let Some(light) = light.filter(|_| is_lit) {
        what += &under(&light);
    }
    let layer = HiddenLayer { radiance, depth: behind(&file, z_m, front.depth)? };
    let grid = own.unwrap_or_else(|| layer.radiance.grid().clone());
    notes.push(format!(
        "{}: behind the first surface, {what}, {}{}; depth {} {}, known of {n_known} of {} samples",
        name_of(&file),
        bands(&grid),
        brightness(&layer.radiance),
        range(&layer.depth),
        depth.describe(),
        rows * columns
    ));
    Ok(layer)
}

/// The first surface, behind which a layer lies.
pub(super) struct Front<'a> {
    pub(super) view: Option<View>,
    pub(super) depth: Option<&'a DepthMap>,
    pub(super) grid: &'a WavelengthGrid,
    pub(super) light: Option<&'a SceneLight>,
}

/// Returns the options for what lies behind: the bands of the first surface, and the light on it for what reflects.
fn options_behind(contents: &Contents, front: &Front<'_>, options: &ReadOptions) -> ReadOptions {
    let mut options = ReadOptions { grid: Some(front.grid.clone()), ..options.clone() };
    if let Some(light) = front.light.filter(|_| contents.is_reflectance(&options)) {
        options.light = options.light.or_else(|| Some(light.illuminant.clone()));
        options.illuminance_lux = options.illuminance_lux.or(light.illuminance_lux);
    }
    options
}
