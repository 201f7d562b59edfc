//! Any file of a scene, by its name and its first bytes.

use std::path::Path;

use dioptric_spectrum::SpectralImage;

use super::{
    camera::{CameraData, CameraFile, Straightened},
    contents::{Contents, Image, straightened, straightened_depth},
    hidden_layer::{Front, hidden_layer, read_hidden},
    lighting::{lit, under},
    panorama::look,
    raw_depth::RawDepth,
    read_contents::contents_of,
    read_options::ReadOptions,
    scene_depth::{depth_of, raw_depth},
    stated::{name_of, note_of},
    understood::{self, Sources, note_of_gaps, resampling_note},
    unusable::{check_made, unreadable},
};
use crate::{Scene, SceneError, View};

/// Reads a scene from a spectral or ordinary EXR (`.exr`), an ENVI header (`.hdr`) or its file of numbers, a MATLAB file (`.mat`), HDF5
/// (`.h5`), an array of `NumPy` (`.npy`, `.npz`), a TIFF of any kind, a folder with a picture a band,
/// a table of reflectances (`.csv`), which becomes a chart, or an ordinary picture (`.png`, `.jpg`, `.webp`, `.bmp`,
/// `.ppm`, `.pfm`, Radiance `.hdr`).
///
/// Camera data comes from the options, else from the file, else from a `NAME.camera.json` beside it; depth from the options, else
/// from the file, else from a `NAME.depth.png` and its like beside it, else one for all from the options. Depth and view may still be
/// absent afterwards: [`Scene::require_depth_and_view`] reports so. The first of [`Scene::notes`] says what was understood, the others
/// what was filled, resampled or not used: nothing that the file states is dropped without being named.
///
/// # Errors
/// One sentence with the file's name when anything in it is wrong, its bands do not cover those wanted, or an option does not apply.
pub fn read_scene(path: &Path, options: &ReadOptions) -> Result<Scene, SceneError> {
    if let Some(fill) = options.fill_depth {
        fill.check()?;
    }
    options.reading.check()?;
    let name = name_of(path);
    let contents = contents_of(path, options)?;
    contents.check_heeds(path, options)?;
    finish(path, name, contents, options)
}

/// Returns the camera data of the image's own samples, and notes what else there was.
fn camera_of(path: &Path, contents: &mut Contents, options: &ReadOptions) -> Result<Option<NamedCamera>, SceneError> {
    let frame = contents.frame();
    let beside = CameraFile::beside(path)?;
    let own = contents.view.take();
    let (name, mut unused) = (name_of(path), vec![]);
    let mut leave = |own: Option<&CameraData>, beside: Option<&CameraFile>| {
        unused.extend(own.map(|_| format!("camera data of {name}")));
        unused.extend(beside.map(|beside| name_of(&beside.file)));
    };
    let of_frame = |data: &CameraFile| -> Result<CameraData, SceneError> {
        Ok(data.of_size(path, frame.rows, frame.columns)?.shifted(frame.x0, frame.y0))
    };
    let found = match (options.horizontal_fov_deg, &options.reading.view) {
        (Some(_), Some(_)) => {
            return Err(SceneError::Setting {
                what: "the view of the scene",
                value: "a field of view and a file of camera data".to_owned(),
                expected: "one of them".to_owned(),
            });
        }
        (Some(fov_deg), None) => {
            leave(own.as_ref(), beside.as_ref());
            let view = View::from_horizontal_fov_deg(fov_deg, frame.columns, frame.rows)?;
            let data = CameraData::of_view(path, view).with_aspect(frame.aspect);
            Some((data.shifted(frame.x0, frame.y0), None))
        }
        (None, Some(file)) => {
            leave(own.as_ref(), beside.as_ref().filter(|beside| beside.file != *file));
            let data = of_frame(&CameraFile::read(file, path)?)?;
            let from = name_of(&data.file);
            Some((data, Some(from)))
        }
        (None, None) => match (own, beside) {
            (Some(own), beside) => {
                leave(None, beside.as_ref());
                Some((own.with_aspect(frame.aspect), Some(name.clone())))
            }
            (None, Some(beside)) => {
                let data = of_frame(&beside)?;
                let from = name_of(&data.file);
                Some((data, Some(from)))
            }
            (None, None) => None,
        },
    };
    contents.notes.extend(found.iter().flat_map(|(data, _)| data.notes.clone()));
    // What the camera file says of the depth is used all the same.
    contents.notes.extend(note_of(path, "view", &unused));
    Ok(found)
}

/// Lights a reflectance, moves it to the bands wanted and adds what the options give.
fn finish(path: &Path, name: String, mut contents: Contents, options: &ReadOptions) -> Result<Scene, SceneError> {
    if let Some(file) = &options.hidden {
        let own = contents.hidden.take().map(|_| "hidden".to_owned());
        contents.notes.extend(note_of(path, "layer", own.as_slice()));
        contents.hidden = Some(Box::new(read_hidden(file, path, contents.frame(), options)?));
    }
    let frame = contents.frame();
    contents.depth = raw_depth(path, &mut contents, frame, options)?;
    if let Some(kind) = options.reading.panorama.or(contents.panorama) {
        look(path, &mut contents, kind, options)?;
    }
    let camera = camera_of(path, &mut contents, options)?;
    contents.notes.extend(note_of_turned(path, &contents, camera.as_ref()));
    let mut sources = Sources { what: what_of(&contents, options), ..Sources::default() };
    let camera = padded(path, &mut contents, camera)?;
    sources.view = camera.as_ref().and_then(|(_, from)| from.clone());
    let (view, straight) = straight_view(path, &mut contents, camera)?;
    let mut notes = std::mem::take(&mut contents.notes);
    let raw = contents.depth.take();
    sources.depth = raw.as_ref().map(RawDepth::describe);
    let depth = match raw {
        Some(raw) => depth_of(raw, view, options.fill_depth, &mut notes)?,
        None => None,
    };
    let own_grid = contents.own_grid();
    notes.extend(own_grid.as_ref().and_then(|own| resampling_note(&name, own, options.grid.as_ref())));
    sources.bands = own_grid;
    let hidden = contents.hidden.take();
    notes.extend(understood::doubt_of_reflectances(&name, &contents.image));
    let (is_part_already, is_lit) = (contents.part.is_some(), contents.is_reflectance(options));
    let (mut radiance, light) = lit(path, contents, options, &mut notes)?;
    notes.extend(note_of_gaps(&name, radiance.grid()));
    if let Some(light) = light.as_ref().filter(|_| is_lit) {
        sources.what += &under(light);
    }
    let hidden = match hidden {
        Some(_) if straight.is_some() => {
            return Err(unreadable(path, "its samples are not square or straight, which a hidden layer must be"));
        }
        Some(hidden) => {
            let front = Front { view, depth: depth.as_ref(), grid: radiance.grid(), light: light.as_ref() };
            Some(hidden_layer(*hidden, front, options, &mut notes)?)
        }
        None => None,
    };
    if let Some(how) = &straight {
        let (quantity, grid) = (radiance.quantity(), radiance.grid().clone());
        let planes = radiance.planes().iter().map(|plane| straightened(plane, how)).collect();
        radiance = SpectralImage::new(quantity, grid, planes)?;
    }
    let scene = Scene { name, radiance, depth, view, hidden, points: vec![], light, notes };
    let mut scene = match options.depth_m {
        Some(depth_m) => scene.or_flat_depth_m(depth_m)?,
        None => scene,
    };
    if let Some(part) = options.part.filter(|_| !is_part_already) {
        scene = part.of(scene)?;
    }
    scene.validate()?;
    understood::tell(&mut scene, &sources);
    Ok(scene)
}

/// Returns what the samples are, for the line of what was understood, and which part of a picture.
fn what_of(contents: &Contents, options: &ReadOptions) -> String {
    let (frame, (rows, columns)) = (contents.frame(), contents.size());
    let mut what = match (&contents.image, options.reading.quantity) {
        (Image::Spectral(_), _) | (_, None) => contents.what.clone(),
        (_, Some(_)) => format!("{}, its colors taken for those of reflectances", contents.what),
    };
    if !frame.is_whole(rows, columns) {
        let bin = contents.part.map_or(1, |part| part.bin as i64);
        what += &format!(
            ", samples {}–{} × {}–{} of {} × {}",
            frame.x0,
            frame.x0 + bin * columns as i64 - 1,
            frame.y0,
            frame.y0 + bin * rows as i64 - 1,
            frame.columns,
            frame.rows
        );
    }
    what
}

/// Camera data, and the name of its file where it has one.
type NamedCamera = (CameraData, Option<String>);

/// Makes what a file has no samples of black, but where a part was asked for, and returns the camera data of all.
fn padded(
    path: &Path,
    contents: &mut Contents,
    camera: Option<NamedCamera>,
) -> Result<Option<NamedCamera>, SceneError> {
    let (rows, columns) = contents.size();
    let Some(place) = contents.frame().place_of(rows, columns).filter(|_| contents.part.is_none()) else {
        return Ok(camera);
    };
    let n_bands = contents.own_grid().map_or(3, |grid| grid.len()) as u64;
    check_made(path, (4 * n_bands).saturating_mul(place.rows as u64).saturating_mul(place.columns as u64))?;
    contents.notes.push(format!("{}: what it has no samples of is black", name_of(path)));
    contents.pad(place)?;
    Ok(camera.map(|(data, from)| (data.shifted(-(place.left as i64), -(place.top as i64)), from)))
}

/// Returns the view, and how samples become straight and square, which depths are then already.
fn straight_view(
    path: &Path,
    contents: &mut Contents,
    camera: Option<NamedCamera>,
) -> Result<(Option<View>, Option<Straightened>), SceneError> {
    let (rows, columns) = contents.size();
    let aspect = contents.frame.map_or(1.0, |frame| frame.aspect);
    if camera.is_none() && (aspect - 1.0).abs() > 1e-6 {
        let what = "times as wide as high, which counts with a field of view or camera data alone";
        contents.notes.push(format!("{}: its samples are {aspect} {what}", name_of(path)));
    }
    let straight = match &camera {
        Some((camera, _)) => camera.straightened(rows, columns)?,
        None => None,
    };
    if let Some((how, _)) = &straight {
        let n_bands = contents.own_grid().map_or(3, |grid| grid.len()) as u64;
        check_made(path, (4 * n_bands).saturating_mul((how.rows * how.columns) as u64))?;
    }
    let mut view = camera.map(|(camera, _)| camera.view());
    let straight = straight.map(|(how, note)| {
        view = Some(how.view);
        contents.notes.push(note);
        if let Some(depth) = &mut contents.depth {
            depth.values = straightened_depth(&depth.values, &how);
        }
        how
    });
    if let Some(part) = contents.part {
        view = view.map(|view| view.binned(part.bin));
    }
    if let Some(view) = view {
        view.check().map_err(|error| unreadable(path, error))?;
    }
    Ok((view, straight))
}

/// Returns what is said of a picture that was turned upright with what is counted along its sides from other files.
fn note_of_turned(path: &Path, contents: &Contents, camera: Option<&NamedCamera>) -> Option<String> {
    let depth = contents.depth.as_ref();
    let of_depth = depth.filter(|depth| depth.file != path).map(|depth| name_of(&depth.file));
    let of_camera = camera.and_then(|(_, from)| from.clone()).filter(|from| *from != name_of(path));
    let others: Vec<String> = of_depth.into_iter().chain(of_camera).collect();
    (contents.is_turned && !others.is_empty()).then(|| {
        format!(
            "{}: it was turned upright, and {} is taken for that of the upright picture",
            name_of(path),
            others.join(", ")
        )
    })
}

#[cfg(test)]
#[path = "read_scene_tests.rs"]
mod tests;
