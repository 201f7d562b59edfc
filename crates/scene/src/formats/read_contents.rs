//! What is in a file of a scene of any kind.

use std::path::Path;

use dioptric_pictures::StatedColors;
use dioptric_spectrum::{Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use ndarray::Array2;

use super::{
    band_folder::band_folder,
    belonging::notes_of_companions,
    camera::CameraData,
    chart_table::read_chart,
    contents::{Contents, Cube, Heeds, Hidden, Image, MATLAB_OR_HDF5, is_of},
    cube_folder::CubeFolder,
    depth::read_depth,
    envi::{contents_of_envi, header_of},
    light_unit::LightUnit,
    mat::{MatScene, UnitOf, read_mat},
    no_data::mend,
    npy::read_npy,
    npz::read_npz,
    pfm::read_pfm,
    picture::{Oriented, oriented, picture_size_of},
    picture_parts::notes_on_parts,
    primaries::into_srgb,
    radiance_header::RadianceHeader,
    raw_depth::{DepthWords, RawDepth},
    read_options::ReadOptions,
    reading::{DepthKind, FileQuantity, FileReading, Panorama, light_unit},
    reduced::reduced_size,
    spectral_exr::{AskedChannels, RawFile, RawHidden, RawImage, read_raw_exr},
    stated::{name_of, note_of},
    tiff_directory::is_tiff,
    tiff_file::{RAW, TiffAs, TiffFile, TiffStack, has_depth_map, read_tiff},
    unusable::{check_whole, starts_with, unreadable},
};
use crate::{SceneError, View};

/// Endings of raw photographs: DNG, and those of makers.
const RAW_ENDINGS: &[&str] =
    &["dng", "cr2", "cr3", "nef", "nrw", "arw", "raf", "orf", "rw2", "pef", "srw", "3fr", "iiq"];

/// Endings of worlds.
const WORLD_ENDINGS: &[&str] = &["pbrt", "gltf", "glb", "obj", "ply", "stl"];

/// Reads what is in a file of a scene, by its name and its first bytes; what GDAL puts beside it is named.
pub(super) fn contents_of(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let mut contents = contents_of_file(path, options)?;
    contents.notes.extend(notes_of_companions(path));
    Ok(contents)
}

fn contents_of_file(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    if path.is_dir() {
        if let Some(cube) = CubeFolder::find(path) {
            return cube.read(path, |face| contents_of(face, options));
        }
        if let Some(missing) = CubeFolder::missing(path) {
            let reason =
                format!("it has some faces of a cube, but of its six faces {} are missing", missing.join(", "));
            return Err(unreadable(path, reason));
        }
        if matches!(options.reading.panorama, Some(Panorama::Cube { .. })) {
            let reason = "it has no six faces of a cube: expected faces called right, left, up, down, front and back, or px, nx, py, ny, pz and nz";
            return Err(unreadable(path, reason));
        }
        return band_folder(path, options)?.into_contents(path, options);
    }
    if !path.exists() {
        return Err(unreadable(path, "there is no such file"));
    }
    check_whole(path)?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "exr" => of_exr(path, options),
        "hdr" if !starts_with(path, b"#?")? => contents_of_envi(path, options),
        _ if is_of(path, MATLAB_OR_HDF5) => of_mat(path, options),
        "npy" => of_npy(path, options),
        "npz" => read_npz(path, options)?.into_contents(path, options),
        "csv" => read_chart(path)?.into_contents(path, options),
        "pfm" => of_pfm(path),
        "tif" | "tiff" => of_tiff(path, options),
        "jpg" | "jpeg" if cfg!(not(feature = "jpeg")) => {
            Err(SceneError::LacksFeature { file: path.to_owned(), feature: "jpeg" })
        }
        // Whatever its name says, a stack of pages is no picture.
        "png" | "jpg" | "jpeg" | "webp" | "bmp" | "ppm" | "pgm" | "pnm" if is_tiff(path) => of_tiff(path, options),
        "png" | "jpg" | "jpeg" | "webp" | "bmp" | "ppm" | "pgm" | "pnm" | "hdr" => of_picture(path, options, vec![]),
        _ if is_of(path, RAW_ENDINGS) => Err(unreadable(path, RAW)),
        _ if is_of(path, WORLD_ENDINGS) => {
            Err(unreadable(path, "it is a world, of which `dioptric render` makes a picture"))
        }
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
    notes.extend(notes_on_parts(path)?);
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
    let mut notes = vec![];
    let mut planes = read_pfm(path)?.told_in(&mut notes).into_iter();
    Ok(match (planes.next(), planes.next(), planes.next()) {
        (Some(r), Some(g), Some(b)) => linear([r, g, b], None, notes),
        (Some(gray), ..) => linear([gray.clone(), gray.clone(), gray], None, notes),
        _ => return Err(unreadable(path, "it has no samples")),
    })
}

fn of_tiff(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let mut contents = pages_of_tiff(path, options)?;
    let reading = &options.reading;
    match &reading.depth {
        _ if !has_depth_map(path) => {}
        Some(file) => {
            let note = (file != path).then(|| format!("{}: its depth map is not used", name_of(path)));
            contents.notes.extend(note);
        }
        None => {
            let (kind, unit, variable) =
                (reading.depth_kind, reading.depth_unit.as_deref(), reading.depth_variable.as_deref());
            let depth = read_depth(path, DepthWords { kind, unit, variable, unit_m: None })?;
            contents.depth = Some(RawDepth { from: "its depth map".to_owned(), ..depth });
        }
    }
    Ok(contents)
}

/// The picture, or the bands, of a TIFF file.
fn pages_of_tiff(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    // Bands that are told make a cube of what would be a picture.
    let n_told = options.reading.wavelengths_nm.as_ref().map(Vec::len);
    let wanted = n_told.map_or(TiffAs::Marked, |n| TiffAs::Planes(Some(n)));
    let mut notes = vec![];
    match read_tiff(path, wanted)?.told_in(&mut notes) {
        TiffFile::Picture(_) => of_picture(path, options, notes),
        TiffFile::Linear(mut planes, page) => {
            for plane in &mut planes {
                page.ignore(plane);
                page.count_from_black(plane, None);
            }
            if let Some(colors) = StatedColors::of_floats(path).map_err(|reason| unreadable(path, reason))? {
                for (channel, plane) in planes.iter_mut().enumerate() {
                    plane.as_slice_mut().into_iter().for_each(|samples| colors.make_light(channel, samples));
                }
                into_srgb(&mut planes, &colors.to_srgb);
                let what = "its numbers are converted to light of sRGB's primaries by what it states";
                notes.push(format!("{}: {what}, {}", name_of(path), colors.name));
            }
            Ok(linear(planes, None, notes))
        }
        TiffFile::Stack(mut stack) => {
            for plane in &mut stack.planes {
                stack.page.ignore(plane);
                stack.page.count_from_black(plane, stack.top);
            }
            notes.extend(stack.page.notes_of_description(path));
            let TiffStack { mut planes, wavelengths_nm, mut top, page } = stack;
            let (mut quantity, mut unit, mut packed) = (None, None, page.packed);
            match UnitOf::read(page.unit.as_deref()) {
                UnitOf::Light(own, words) => unit = Some((own, words)),
                UnitOf::Reflectance => quantity = Some(FileQuantity::Reflectance),
                UnitOf::Percent => {
                    planes.iter_mut().for_each(|plane| plane.mapv_inplace(|v| 0.01 * v));
                    (quantity, top) = (Some(FileQuantity::Reflectance), None);
                    packed = Some(0.01 * packed.unwrap_or(1.0));
                }
                UnitOf::Unknown => notes.extend(page.note_of_unit(path)),
            }
            Cube { planes, top, wavelengths_nm, quantity, unit, called: None, packed, notes }
                .into_contents(path, options)
        }
    }
}

fn of_npy(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let mut notes = vec![];
    let array = read_npy(path)?.told_in(&mut notes);
    let told = options.reading.wavelengths_nm.as_ref().map(Vec::len);
    let n_bands = told.or_else(|| options.grid.as_ref().map(WavelengthGrid::len));
    let at = |index: usize| array.values[index];
    let planes = super::axes::planes(&array.sides, options.reading.axes.as_deref(), n_bands, true, at)
        .map_err(|reason| unreadable(path, reason))?;
    let note = super::axes::note(&array.sides, options.reading.axes.as_deref(), n_bands, true);
    notes.extend(note.map(|note| format!("{}: {note}", name_of(path))));
    Cube { planes, top: array.top, wavelengths_nm: None, quantity: None, unit: None, called: None, packed: None, notes }
        .into_contents(path, options)
}

fn of_exr(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let reading = &options.reading;
    let depth = reading.depth_variable.as_deref().filter(|_| reading.depth.is_none());
    let asked = AskedChannels { depth, layer: reading.variable.as_deref(), texts: &[] };
    let RawFile { image, depth, view, frame, panorama, light, hidden, mut notes } = read_raw_exr(path, asked)?;
    let view = view.map(|view| CameraData::of_view(path, view));
    let (image, what, heeds) = match image {
        RawImage::Spectral { image, unit: stated } => {
            // Of a film, which a scene is none.
            let pitch = image.pitch_um().map(|_| "samplePitchUm".to_owned());
            notes.extend(note_of(path, "attribute", pitch.as_slice()));
            let unit = told_unit(path, &image, stated.is_some(), reading)?;
            let contents = of_bands(path, image, stated.as_deref(), (unit, reading))?;
            notes.extend(contents.notes);
            (contents.image, contents.what, contents.heeds)
        }
        RawImage::Rgb { planes, white_cd_m2 } => {
            let Contents { image, what, heeds, .. } = linear(planes, white_cd_m2, vec![]);
            (image, what, heeds)
        }
    };
    let hidden = hidden.map(|hidden| layer_behind(path, hidden, options).map(Box::new));
    let hidden = hidden.transpose()?;
    Ok(Contents { depth, view, frame: Some(frame), panorama, light, hidden, notes, heeds, ..Contents::of(image, what) })
}

/// Returns the unit that is told of bands of which none is stated.
fn told_unit(
    path: &Path,
    image: &SpectralImage,
    is_unit_stated: bool,
    reading: &FileReading,
) -> Result<Option<LightUnit>, SceneError> {
    if image.quantity() == Quantity::Irradiance {
        let reason = "it holds the irradiance on a film, which is no scene: `dioptric sense` exposes a sensor to it";
        return Err(SceneError::Units { file: path.to_owned(), reason: reason.to_owned() });
    }
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
    if let Some(told) = told {
        reading.check_quantity(path, told)?;
    }
    Ok(told.or_else(|| reading.quantity.and_then(FileQuantity::light_unit)).filter(|_| is_unit_open))
}

/// Returns bands of an EXR file in the unit and by the factor that are told.
fn of_bands(
    path: &Path,
    image: SpectralImage,
    stated: Option<&str>,
    (unit, reading): (Option<LightUnit>, &FileReading),
) -> Result<Contents, SceneError> {
    let (quantity, grid) = (image.quantity(), image.grid().clone());
    let is_light = quantity != Quantity::Reflectance;
    let (scale, choice) = (reading.scale.unwrap_or(1.0), reading.no_data.unwrap_or_default());
    let mut planes = image.into_planes();
    for (plane, &nm) in planes.iter_mut().zip(grid.centers_nm()) {
        let factor = scale * unit.map_or(1.0, |unit| unit.factor_at(nm));
        if factor != 1.0 {
            plane.mapv_inplace(|v| (f64::from(v) * factor) as f32);
        }
    }
    let notes: Vec<String> = mend(path, &grid, &mut planes, choice)?.note(path, choice).into_iter().collect();
    let values = |reason: SpectrumError| SceneError::Values { file: path.to_owned(), reason };
    let image = SpectralImage::new(quantity, grid, planes).map_err(values)?;
    let what = match (is_light, stated) {
        (false, _) => "reflectance".to_owned(),
        (true, Some(stated)) => format!("radiance in {stated}"),
        (true, None) => format!("radiance, taken for {}", reading.unit.as_deref().unwrap_or("W/m^2/sr/nm")),
    };
    let heeds = if is_light && stated.is_none() { Heeds::Unit } else { Heeds::Scale };
    Ok(Contents { notes, heeds, ..Contents::of(Image::Spectral(image), what) })
}

/// Returns what lies behind the first surface in a layer of its file, under what is said of that where the layer does not say itself what it is.
fn layer_behind(path: &Path, hidden: RawHidden, options: &ReadOptions) -> Result<Hidden, SceneError> {
    let RawHidden { image, depth } = hidden;
    let told = &options.reading;
    let (mut contents, words) = match image {
        RawImage::Rgb { planes, white_cd_m2 } => (linear(planes, white_cd_m2, vec![]), "counts for it too"),
        RawImage::Spectral { image, unit: stated } => {
            let own = FileReading { quantity: None, unit: None, scale: None, ..told.clone() };
            let (unit, reading, words) = match told_unit(path, &image, stated.is_some(), told) {
                Ok(unit) => (unit, told, "counts for it too"),
                Err(error @ SceneError::Units { .. }) => {
                    let unit = told_unit(path, &image, stated.is_some(), &own).map_err(|_| error)?;
                    (unit, &own, "does not count for it, which says itself what it is")
                }
                Err(error) => return Err(error),
            };
            (of_bands(path, image, stated.as_deref(), (unit, reading))?, words)
        }
    };
    let is_picture = matches!(contents.image, Image::Linear { .. });
    let given = [
        ("--quantity", told.quantity.is_some(), !is_picture || told.quantity == Some(FileQuantity::Reflectance)),
        ("--unit", told.unit.is_some(), !is_picture),
        ("--scale", told.scale.is_some(), true),
    ];
    for (applies, words) in [(true, words), (false, "does not count for it, whose colors have none")] {
        let own = given.iter().filter(|(_, is_given, own)| *is_given && *own == applies);
        let names: Vec<&str> = own.map(|(name, ..)| *name).collect();
        let note = (!names.is_empty()).then(|| {
            let told = names.join(", ");
            format!("{}, layer 'hidden': what was said of the first surface ({told}) {words}", name_of(path))
        });
        contents.notes.extend(note);
    }
    // What is told of a file of depth is told of that of the first surface.
    let depth = match told.depth {
        Some(_) => depth,
        None => depth.told(DepthWords {
            kind: told.depth_kind,
            unit: told.depth_unit.as_deref(),
            ..DepthWords::default()
        })?,
    };
    Ok(Hidden { file: path.to_owned(), contents: Contents { depth: Some(depth), ..contents } })
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
