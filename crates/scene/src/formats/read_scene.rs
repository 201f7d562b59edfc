//! Any file of a scene, by its name and its first bytes.

use std::path::Path;

use dioptric_spectrum::{Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use ndarray::Array2;

use super::{
    band_folder::band_folder,
    camera::CameraData,
    chart_table::read_chart,
    contents::{Contents, Cube, Heeds, Image, is_of, pad_spectral, straightened, straightened_depth},
    cube_folder::CubeFolder,
    depth::depth_beside,
    envi::{contents_of_envi, header_of},
    lighting::lit,
    mat::{MatScene, read_mat},
    no_data::mend,
    npy::read_npy,
    npz::read_npz,
    panorama::look,
    pfm::read_pfm,
    picture::{Oriented, oriented, picture_size_of},
    picture_parts::unknown_parts,
    primaries::into_srgb,
    radiance_header::RadianceHeader,
    raw_depth::RawDepth,
    read_options::ReadOptions,
    reading::{DepthKind, FileQuantity, FileReading, Frame, light_unit},
    reduced::reduced_size,
    scene_depth::{behind, depth_of, raw_depth, words},
    spectral_exr::{RawFile, RawImage, read_raw_exr},
    stated::{name_of, note_of},
    tiff_file::{TiffFile, read_tiff},
    understood::{self, Sources, bands},
    unusable::{starts_with, unreadable},
};
use crate::{HiddenLayer, Scene, SceneError, View};

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

/// Reads what lies behind the first surface of a scene from a file of its own, of any kind that [`read_scene`] reads: radiance and
/// depth of the same samples, seen from the same place.
///
/// Depth 0 or NaN says that nothing is known there: it becomes that of the first surface.
///
/// # Errors
/// As [`read_scene`], and when the file has no depth, another size, or a depth before the first surface.
pub fn read_hidden_layer(path: &Path, options: &ReadOptions, first: &Scene) -> Result<HiddenLayer, SceneError> {
    let options = &ReadOptions {
        grid: Some(first.radiance.grid().clone()),
        reading: FileReading { depth: None, view: None, ..options.reading.clone() },
        ..options.clone()
    };
    let mut contents = contents_of(path, options)?;
    let (rows, columns) = contents.size();
    if contents.depth.is_none() {
        contents.depth = depth_beside(path, words(path, options)?)?;
    }
    let lacks = || unreadable(path, "a hidden layer needs a depth, expected a channel 'Z' or a NAME.depth.png");
    let depth = contents.depth.take().ok_or_else(lacks)?.resized(rows, columns)?;
    let z_m = depth.axial_m(first.view)?.ok_or_else(lacks)?;
    let (radiance, _) = lit(path, contents, options, &mut vec![])?;
    let hidden = HiddenLayer { radiance, depth: behind(path, z_m, first.depth.as_ref())? };
    Scene { hidden: Some(hidden.clone()), ..first.clone() }.validate()?;
    Ok(hidden)
}

fn contents_of(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    if path.is_dir() {
        if let Some(cube) = CubeFolder::find(path) {
            return cube.read(path, |face| contents_of(face, options));
        }
        if let Some(missing) = CubeFolder::missing(path) {
            let reason =
                format!("it has some faces of a cube, but of its six faces {} are missing", missing.join(", "));
            return Err(unreadable(path, reason));
        }
        return band_folder(path, options.reading.wavelengths_nm.as_deref())?.into_contents(path, options);
    }
    if !path.exists() {
        return Err(unreadable(path, "there is no such file"));
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "exr" => of_exr(path, options),
        "hdr" if !starts_with(path, b"#?")? => contents_of_envi(path, options),
        "mat" | "h5" | "hdf5" => of_mat(path, options),
        "npy" => of_npy(path, options),
        "npz" => read_npz(path, options)?.into_contents(path, options),
        "csv" => read_chart(path)?.into_contents(path, options),
        "pfm" => of_pfm(path),
        "tif" | "tiff" => of_tiff(path, options),
        "jpg" | "jpeg" if cfg!(not(feature = "jpeg")) => {
            Err(SceneError::LacksFeature { file: path.to_owned(), feature: "jpeg" })
        }
        "png" | "jpg" | "jpeg" | "webp" | "bmp" | "ppm" | "pgm" | "pnm" | "hdr" => of_picture(path, options, vec![]),
        _ => match header_of(path) {
            Some(header) => contents_of_envi(&header, options),
            None => Err(SceneError::UnknownKind { file: path.to_owned() }),
        },
    }
}

/// An ordinary picture: what a display shows, or linear colors where it has floats.
fn of_picture(path: &Path, options: &ReadOptions, mut notes: Vec<String>) -> Result<Contents, SceneError> {
    let (columns, rows) = picture_size_of(path)?;
    let bands = options.grid.as_ref().map_or(31, WavelengthGrid::len);
    let reduced = reduced_size(path, options, (rows, columns), 4 * bands as u64);
    let Oriented { picture, colors, is_turned, notes: more } =
        oriented(path, reduced.as_ref().map(|reduced| (reduced.columns, reduced.rows)))?;
    notes.extend(more);
    notes.extend(reduced.map(|reduced| reduced.note));
    notes.extend(note_of(path, "part", &unknown_parts(path)?));
    let what = format!("a picture as a display shows it ({})", super::picture::kind_of(&picture, colors.as_ref()));
    let image = match picture {
        dioptric_pictures::DynamicImage::ImageRgb32F(_) | dioptric_pictures::DynamicImage::ImageRgba32F(_) => {
            let (columns, rows) = (picture.width() as usize, picture.height() as usize);
            let samples = picture.into_rgb32f().into_raw();
            let plane = |k: usize| {
                let values = samples.iter().skip(k).step_by(3).copied().collect();
                Array2::from_shape_vec((rows, columns), values).expect("three samples a pixel")
            };
            let mut planes = [plane(0), plane(1), plane(2)];
            if let Some(colors) = &colors {
                into_srgb(&mut planes, &colors.to_srgb);
            }
            if is_of(path, &["hdr"]) {
                notes.extend(RadianceHeader::read(path)?.apply(path, &mut planes)?);
            }
            return Ok(linear(planes, None, notes));
        }
        picture => Image::Codes(picture, colors),
    };
    Ok(Contents { is_turned, notes, heeds: Heeds::Nothing, ..Contents::of(image, what) })
}

fn linear(planes: [Array2<f32>; 3], white_cd_m2: Option<f64>, notes: Vec<String>) -> Contents {
    let what = "linear colors as a display shows them";
    Contents { notes, heeds: Heeds::Scale, ..Contents::of(Image::Linear { planes, white_cd_m2 }, what) }
}

fn of_pfm(path: &Path) -> Result<Contents, SceneError> {
    let (planes, note) = read_pfm(path)?;
    let (mut planes, notes) = (planes.into_iter(), note.into_iter().collect());
    Ok(match (planes.next(), planes.next(), planes.next()) {
        (Some(r), Some(g), Some(b)) => linear([r, g, b], None, notes),
        (Some(gray), ..) => linear([gray.clone(), gray.clone(), gray], None, notes),
        _ => return Err(unreadable(path, "it has no samples")),
    })
}

fn of_tiff(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    match read_tiff(path)? {
        TiffFile::Picture(mut page) => {
            let no_data = page.no_data.map(|none| none.to_string());
            page.notes.extend(note_of(path, "number for no data (GDAL)", no_data.as_slice()));
            of_picture(path, options, page.notes)
        }
        TiffFile::Linear(mut planes, page) => {
            planes.iter_mut().for_each(|plane| page.ignore(plane));
            Ok(linear(planes, None, page.notes))
        }
        TiffFile::Stack(mut stack) => {
            stack.planes.iter_mut().for_each(|plane| stack.page.ignore(plane));
            let cube = Cube {
                planes: stack.planes,
                top: stack.top,
                wavelengths_nm: stack.wavelengths_nm,
                quantity: None,
                unit: None,
                notes: stack.page.notes,
            };
            cube.into_contents(path, options)
        }
    }
}

fn of_npy(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let array = read_npy(path)?;
    let told = options.reading.wavelengths_nm.as_ref().map(Vec::len);
    let n_bands = told.or_else(|| options.grid.as_ref().map(WavelengthGrid::len));
    let at = |index: usize| array.values[index];
    let planes = super::axes::planes(&array.sides, options.reading.axes.as_deref(), n_bands, true, at)
        .map_err(|reason| unreadable(path, reason))?;
    let note = super::axes::note(&array.sides, options.reading.axes.as_deref(), n_bands);
    let notes = note.map(|note| format!("{}: {note}", name_of(path))).into_iter().collect();
    Cube { planes, top: array.top, wavelengths_nm: None, quantity: None, unit: None, notes }
        .into_contents(path, options)
}

fn of_exr(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let reading = &options.reading;
    let told_depth = reading.depth_variable.as_deref().filter(|_| reading.depth.is_none());
    let RawFile { image, depth, view, frame, panorama, light, hidden, mut notes } = read_raw_exr(path, told_depth)?;
    let choice = reading.no_data.unwrap_or_default();
    let view = view.map(|view| CameraData::of_view(path, view));
    let (image, what, heeds) = match image {
        RawImage::Spectral { image, is_unit_stated } => {
            let is_light = image.quantity() != Quantity::Reflectance;
            let says_other = match reading.quantity {
                Some(FileQuantity::Reflectance) => is_light,
                Some(_) => !is_light,
                None => false,
            };
            let is_unit_open = is_light && !is_unit_stated;
            if says_other || (reading.unit.is_some() && !is_unit_open) {
                let what = if is_light { "light, whose unit it states" } else { "reflectances" };
                let reason = format!("it holds {what}, and --quantity or --unit says something else");
                return Err(SceneError::Units { file: path.to_owned(), reason });
            }
            let told = reading.unit.as_deref().map(light_unit).transpose()?;
            let unit = told.or_else(|| reading.quantity.and_then(FileQuantity::light_unit)).filter(|_| is_unit_open);
            let scale = reading.scale.unwrap_or(1.0);
            let (quantity, grid) = (image.quantity(), image.grid().clone());
            let mut planes = image.into_planes();
            for (plane, &nm) in planes.iter_mut().zip(grid.centers_nm()) {
                let factor = scale * unit.map_or(1.0, |unit| unit.factor_at(nm));
                if factor != 1.0 {
                    plane.mapv_inplace(|v| (f64::from(v) * factor) as f32);
                }
            }
            notes.extend(mend(path, &grid, &mut planes, choice)?.note(path, choice));
            let values = |reason: SpectrumError| SceneError::Values { file: path.to_owned(), reason };
            let image = SpectralImage::new(quantity, grid, planes).map_err(values)?;
            let what = match (is_light, is_unit_stated) {
                (false, _) => "reflectance".to_owned(),
                (true, true) => "radiance".to_owned(),
                (true, false) => {
                    format!("radiance, taken for {}", reading.unit.as_deref().unwrap_or("W/m^2/sr/nm"))
                }
            };
            (Image::Spectral(image), what, if is_unit_open { Heeds::Unit } else { Heeds::Scale })
        }
        RawImage::Rgb { planes, white_cd_m2 } => {
            let what = "linear colors as a display shows them".to_owned();
            (Image::Linear { planes, white_cd_m2 }, what, Heeds::Scale)
        }
    };
    Ok(Contents { depth, view, frame: Some(frame), panorama, light, hidden, notes, heeds, ..Contents::of(image, what) })
}

/// Depths that differ are taken as distances from the camera, as renderers leave them; depths that are all alike are those of a
/// plane that faces it.
fn of_mat(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let scene = match read_mat(path, &options.reading)? {
        MatScene::Cube(cube) => return cube.into_contents(path, options),
        MatScene::Linear(planes, notes) => return Ok(linear(planes, None, notes)),
        MatScene::Iset(scene) => scene,
    };
    let (rows, columns) = (scene.image.rows(), scene.image.columns());
    let view = scene.horizontal_fov_deg.map(|fov_deg| View::from_horizontal_fov_deg(fov_deg, columns, rows));
    let is_flat = |map: &Array2<f32>| map.iter().all(|z| *z == map[(0, 0)]);
    let depth = match (scene.depth_m, scene.distance_m) {
        (Some(values), _) => {
            let kind = if is_flat(&values) { DepthKind::Axial } else { DepthKind::Radial };
            Some(RawDepth::in_file(path, "its depth map".to_owned(), values, kind))
        }
        (None, Some(z_m)) => {
            let values = Array2::from_elem((rows, columns), z_m as f32);
            Some(RawDepth::in_file(path, "its distance".to_owned(), values, DepthKind::Axial))
        }
        (None, None) => None,
    };
    let mut notes = scene.notes;
    let view = view.transpose().map_err(|error| unreadable(path, error))?.map(|view| CameraData::of_view(path, view));
    let choice = options.reading.no_data.unwrap_or_default();
    let grid = scene.image.grid().clone();
    let mut planes = scene.image.into_planes();
    notes.extend(mend(path, &grid, &mut planes, choice)?.note(path, choice));
    let image = SpectralImage::new(Quantity::Radiance, grid, planes)?;
    let contents = Contents::of(Image::Spectral(image), "radiance of its photons");
    Ok(Contents { depth, view, light: scene.light, notes, heeds: Heeds::Nothing, ..contents })
}

/// Returns the camera data of the image's own samples, and notes what else there was.
fn camera_of(
    path: &Path,
    contents: &mut Contents,
    frame: Frame,
    options: &ReadOptions,
) -> Result<Option<(CameraData, Option<String>)>, SceneError> {
    let beside = CameraData::beside(path)?;
    let own = contents.view.take();
    let (name, mut unused) = (name_of(path), vec![]);
    let mut leave = |own: Option<&CameraData>, beside: Option<&CameraData>| {
        unused.extend(own.map(|_| format!("camera data of {name}")));
        unused.extend(beside.map(|beside| name_of(&beside.file)));
    };
    let of_frame = |data: &CameraData| -> Result<CameraData, SceneError> {
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
            let data = of_frame(&CameraData::read(file)?)?;
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
    contents.notes.extend(found.iter().filter_map(|(data, _)| data.note.clone()));
    // What the camera file says of the depth is used all the same.
    contents.notes.extend(note_of(path, "view", &unused));
    Ok(found)
}

/// Lights a reflectance, moves it to the bands wanted and adds what the options give.
fn finish(path: &Path, name: String, mut contents: Contents, options: &ReadOptions) -> Result<Scene, SceneError> {
    let whole = |contents: &Contents| {
        let (rows, columns) = contents.size();
        contents.frame.unwrap_or_else(|| Frame::whole(rows, columns))
    };
    let frame = whole(&contents);
    let mut depth = raw_depth(path, &mut contents, frame, options)?;
    if let Some(kind) = options.reading.panorama.or(contents.panorama) {
        look(path, &mut contents, &mut depth, kind, options)?;
    }
    let frame = whole(&contents);
    let (rows, columns) = contents.size();
    let mut camera = camera_of(path, &mut contents, frame, options)?;
    contents.notes.extend(note_of_turned(path, &contents, depth.as_ref(), camera.as_ref()));
    let what = match (&contents.image, options.reading.quantity) {
        (Image::Spectral(_), _) | (_, None) => contents.what.clone(),
        (_, Some(_)) => format!("{}, its colors taken for those of reflectances", contents.what),
    };
    let mut sources = Sources { what, ..Sources::default() };
    if !frame.is_whole(rows, columns) {
        let bin = contents.part.map_or(1, |part| part.bin as i64);
        sources.what += &format!(
            ", samples {}–{} × {}–{} of {} × {}",
            frame.x0,
            frame.x0 + bin * columns as i64 - 1,
            frame.y0,
            frame.y0 + bin * rows as i64 - 1,
            frame.columns,
            frame.rows
        );
    }
    // Of a picture that is larger than its samples the rest is black, but where a part of it was asked for.
    if let Some(place) = frame.place_of(rows, columns).filter(|_| contents.part.is_none()) {
        let is_black = format!("{}: what it has no samples of is black", name_of(path));
        contents.notes.push(is_black);
        contents.image.pad(place)?;
        if let Some((image, z_m)) = &mut contents.hidden {
            pad_spectral(image, place)?;
            *z_m = place.pad_depth(z_m);
        }
        if let Some(depth) = &mut depth {
            depth.values = place.pad_depth(&depth.values);
        }
        camera = camera.map(|(data, from)| (data.shifted(-(place.left as i64), -(place.top as i64)), from));
    }
    let (rows, columns) = contents.size();
    sources.view = camera.as_ref().and_then(|(_, from)| from.clone());
    if camera.is_none() && (frame.aspect - 1.0).abs() > 1e-6 {
        let what = "times as wide as high, which counts with a field of view or camera data alone";
        contents.notes.push(format!("{}: its samples are {} {what}", name_of(path), frame.aspect));
    }
    let straight = camera.as_ref().and_then(|(camera, _)| camera.straightened(rows, columns));
    let mut view = camera.map(|(camera, _)| camera.view());
    if let Some((how, note)) = &straight {
        view = Some(how.view);
        contents.notes.push(note.clone());
        if let Some(depth) = &mut depth {
            depth.values = straightened_depth(&depth.values, how);
        }
    }
    if let Some(part) = contents.part {
        view = view.map(|view| view.binned(part.bin));
    }
    if let Some(view) = view {
        view.check().map_err(|error| unreadable(path, error))?;
    }
    let mut notes = std::mem::take(&mut contents.notes);
    sources.depth = depth.as_ref().map(RawDepth::describe);
    let depth = match depth {
        Some(raw) => depth_of(raw, view, options.fill_depth, &mut notes)?,
        None => None,
    };
    let own_grid = match (&contents.own_grid, &contents.image) {
        (Some(own), _) => Some(own.clone()),
        (None, Image::Spectral(image)) => Some(image.grid().clone()),
        (None, _) => None,
    };
    notes.extend(own_grid.as_ref().and_then(|own| resampling_note(own, options.grid.as_ref())));
    sources.bands = own_grid;
    let hidden = match contents.hidden.take() {
        Some((image, z_m)) => {
            let image = Contents::of(Image::Spectral(image), "");
            let (radiance, _) = lit(path, image, options, &mut vec![])?;
            Some(HiddenLayer { radiance, depth: behind(path, z_m, depth.as_ref())? })
        }
        None => None,
    };
    notes.extend(understood::doubt_of_reflectances(&name, &contents.image));
    let (part, is_part_already) = (options.part, contents.part.is_some());
    let (mut radiance, light) = lit(path, contents, options, &mut notes)?;
    if let Some((how, _)) = &straight {
        if hidden.is_some() {
            return Err(unreadable(path, "its samples are not square or straight, which a hidden layer must be"));
        }
        let (quantity, grid) = (radiance.quantity(), radiance.grid().clone());
        let planes = radiance.planes().iter().map(|plane| straightened(plane, how)).collect();
        radiance = SpectralImage::new(quantity, grid, planes)?;
    }
    let scene = Scene { name, radiance, depth, view, hidden, points: vec![], light, notes };
    let mut scene = match options.depth_m {
        Some(depth_m) => scene.or_flat_depth_m(depth_m)?,
        None => scene,
    };
    if let Some(part) = part.filter(|_| !is_part_already) {
        scene = part.of(scene)?;
    }
    scene.validate()?;
    understood::tell(&mut scene, &sources);
    Ok(scene)
}

/// Returns what is said of a picture that was turned upright with what is counted along its sides from other files.
fn note_of_turned(
    path: &Path,
    contents: &Contents,
    depth: Option<&RawDepth>,
    camera: Option<&(CameraData, Option<String>)>,
) -> Option<String> {
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

/// Returns in a sentence how the bands of a file become those wanted, where they are others.
fn resampling_note(own: &WavelengthGrid, wanted: Option<&WavelengthGrid>) -> Option<String> {
    let wanted = wanted.filter(|wanted| *wanted != own)?;
    Some(format!(
        "{} become {}: spectra run in straight lines between the centers of bands, and a band wider than those of the file takes \
         the mean over its width",
        bands(own),
        bands(wanted)
    ))
}

#[cfg(test)]
#[path = "read_scene_tests.rs"]
mod tests;
