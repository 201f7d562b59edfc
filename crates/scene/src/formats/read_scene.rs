//! Any file of a scene, by its name.

use std::path::{Path, PathBuf};

use dioptric_spectrum::{DepthMap, Display, Illuminant, Quantity, SpectralImage, Spectrum, WavelengthGrid};
use ndarray::Array2;

use super::{
    camera::view_beside,
    depth_picture::depth_beside,
    mat::read_iset_mat,
    picture::{lifted, picture_size_of, read_picture_of},
    read_band_folder, read_envi,
    spectral_exr::{RawFile, RawImage, axial, read_raw_exr},
    unmeasured::{self, FillDepth},
    unusable::unreadable,
};
use crate::{HiddenLayer, Scene, SceneError, SceneLight, View, reflectance_under, resampled};

/// What a file may leave open.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// The bands wanted; those of the file where `None`, and 400–700 nm every 10 nm for ordinary pictures.
    pub grid: Option<WavelengthGrid>,
    /// The light on a file of reflectances.
    pub light: Illuminant,
    /// Its illuminance, lx.
    pub illuminance_lux: f64,
    /// The luminance of the white of an ordinary picture, cd/m².
    pub picture_white_cd_m2: f64,
    /// The wavelengths of a folder's numbered pictures, where the folder does not list them.
    pub band_wavelengths: Option<WavelengthGrid>,
    /// The number that a perfect white has in an ENVI file that does not tell.
    pub white_level: Option<f64>,
    /// One depth for all samples of a scene that has none, m.
    pub depth_m: Option<f64>,
    /// The horizontal field of view, in place of the file's own camera data.
    pub horizontal_fov_deg: Option<f64>,
    /// How far apart the samples of a picture of one depth may be, as the tangent of the angle between neighbours on the axis: a picture that is finer
    /// is read as means of its pixels.
    pub finest_tangent: Option<f64>,
    /// The depth of places where none was measured; where `None`, those of a depth picture get the farther of the depths beside
    /// them, and a file that has such places is refused.
    pub fill_depth: Option<FillDepth>,
}

impl Default for ReadOptions {
    /// D65 at 1000 lx on reflectances, a picture's white of 100 cd/m², and all else as the file has it.
    fn default() -> Self {
        Self {
            grid: None,
            light: Illuminant::D65,
            illuminance_lux: 1000.0,
            picture_white_cd_m2: 100.0,
            band_wavelengths: None,
            white_level: None,
            depth_m: None,
            horizontal_fov_deg: None,
            finest_tangent: None,
            fill_depth: None,
        }
    }
}

/// Reads a scene from a spectral or ordinary EXR (`.exr`), an ENVI header (`.hdr`), a scene of `ISETCam` (`.mat`), a folder with a
/// picture a band, or an ordinary picture (`.png`, `.jpg`, `.tif`).
///
/// Camera data comes from the options, else from the file, else from a `NAME.camera.json` beside it; depth from the file, else
/// from a gray 16-bit `NAME.depth.png` beside it (millimetres, or what `depth_unit_m` of the camera file says; 0 where it was
/// not measured), else from the options. Depth and view may still be absent afterwards: [`Scene::require_depth_and_view`] reports
/// so. What was filled or resampled is in [`Scene::notes`].
///
/// # Errors
/// One sentence with the file's name when anything in it is wrong, or its bands do not cover those wanted.
pub fn read_scene(path: &Path, options: &ReadOptions) -> Result<Scene, SceneError> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    if let Some(fill) = options.fill_depth {
        fill.check()?;
    }
    finish(path, name, contents_of(path, options)?, options)
}

/// Reads what lies behind the first surface of a scene from a file of its own, of any kind that [`read_scene`] reads: radiance and
/// depth of the same samples, seen from the same place.
///
/// Depth 0 or NaN says that nothing is known there: it becomes that of the first surface.
///
/// # Errors
/// As [`read_scene`], and when the file has no depth, another size, or a depth before the first surface.
pub fn read_hidden_layer(path: &Path, options: &ReadOptions, first: &Scene) -> Result<HiddenLayer, SceneError> {
    let mut contents = contents_of(path, options)?;
    let (rows, columns) = (contents.image.rows(), contents.image.columns());
    if contents.depth.is_none() {
        contents.depth = depth_beside(path, rows, columns)?.map(|(_, values_m)| RawDepth { values_m, is_axial: true });
    }
    let z_m = match (contents.depth, first.view) {
        (Some(RawDepth { values_m, is_axial: true }), _) => values_m,
        (Some(RawDepth { values_m, is_axial: false }), Some(view)) => axial(&values_m, view),
        _ => return Err(unreadable(path, "a hidden layer needs a depth, expected a channel 'Z' or a NAME.depth.png")),
    };
    let grid = Some(first.radiance.grid().clone());
    let radiance = lit(contents.image, &ReadOptions { grid, ..options.clone() })?;
    let hidden = HiddenLayer { radiance, depth: behind(path, z_m, first.depth.as_ref())? };
    Scene { hidden: Some(hidden.clone()), ..first.clone() }.validate()?;
    Ok(hidden)
}

/// Returns the depths of a hidden layer, where nothing is known those of the first surface.
fn behind(file: &Path, mut z_m: Array2<f32>, first: Option<&DepthMap>) -> Result<DepthMap, SceneError> {
    if let Some(first) = first.filter(|first| first.z_m().dim() == z_m.dim()) {
        z_m.zip_mut_with(first.z_m(), |z, first| {
            if *z == 0.0 || z.is_nan() {
                *z = *first;
            }
        });
    }
    DepthMap::new(z_m).map_err(|reason| SceneError::Values { file: file.to_owned(), reason })
}

fn contents_of(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    if path.is_dir() {
        return Ok(Contents::of(read_band_folder(path, options.band_wavelengths.as_ref())?));
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "exr" => of_exr(path, options),
        "hdr" => Ok(Contents::of(read_envi(path)?.into_image(options.white_level)?)),
        "mat" => of_mat(path),
        "jpg" | "jpeg" if cfg!(not(feature = "jpeg")) => {
            Err(SceneError::LacksFeature { file: path.to_owned(), feature: "jpeg" })
        }
        "png" | "jpg" | "jpeg" | "tif" | "tiff" => {
            let display = Display::apple_studio();
            let (size, notes) = picture_size(path, options)?;
            let image = read_picture_of(path, size, &display, &picture_bands(options)?, options.picture_white_cd_m2)?;
            let light = Some(white_of(&display, options.picture_white_cd_m2)?);
            Ok(Contents { light, notes, ..Contents::of(image) })
        }
        _ if !path.exists() => Err(unreadable(path, "there is no such file")),
        _ => Err(SceneError::UnknownKind { file: path.to_owned() }),
    }
}

/// Returns the columns and rows as which a picture is read, and what is to be said of them: its own, or fewer where the options allow that and nothing
/// lies beside it that counts its pixels.
fn picture_size(path: &Path, options: &ReadOptions) -> Result<((usize, usize), Vec<String>), SceneError> {
    let (columns, rows) = picture_size_of(path)?;
    let (Some(finest), Some(fov_deg)) = (options.finest_tangent, options.horizontal_fov_deg) else {
        return Ok(((columns, rows), vec![]));
    };
    let own = 2.0 * (0.5 * fov_deg.to_radians()).tan() / columns as f64;
    // Whole numbers of pixels, of which the last block of a row may have one more.
    let block = ((finest / own) as usize).min(columns).min(rows);
    if block < 2 || depth_beside(path, rows, columns)?.is_some() {
        return Ok(((columns, rows), vec![]));
    }
    let size = (columns / block, rows / block);
    let note = format!(
        "its {columns} × {rows} pixels are read as {} × {} means, finer than those of the film by far",
        size.0, size.1
    );
    Ok((size, vec![note]))
}

fn of_exr(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let RawFile { image, z_m, distance_m, view, hidden } = read_raw_exr(path)?;
    let (image, light) = match image {
        RawImage::Spectral(image) => (image, None),
        RawImage::Rgb(rgb) => {
            let display = Display::apple_studio();
            let image = lifted(&rgb, &display, &picture_bands(options)?, options.picture_white_cd_m2)?;
            (image, Some(white_of(&display, options.picture_white_cd_m2)?))
        }
    };
    let depth = match (z_m, distance_m) {
        (Some(values_m), _) => Some(RawDepth { values_m, is_axial: true }),
        (None, Some(values_m)) => Some(RawDepth { values_m, is_axial: false }),
        (None, None) => None,
    };
    Ok(Contents { depth, view, hidden, light, ..Contents::of(image) })
}

/// Depths that differ are taken as distances from the camera, as renderers leave them; depths that are all alike are those of a
/// plane that faces it.
fn of_mat(path: &Path) -> Result<Contents, SceneError> {
    let scene = read_iset_mat(path)?;
    let (rows, columns) = (scene.image.rows(), scene.image.columns());
    let view = scene.horizontal_fov_deg.map(|fov_deg| View::from_horizontal_fov_deg(fov_deg, columns, rows));
    let is_flat = |map: &Array2<f32>| map.iter().all(|z| *z == map[(0, 0)]);
    let depth = match (scene.depth_m, scene.distance_m) {
        (Some(values_m), _) => Some(RawDepth { is_axial: is_flat(&values_m), values_m }),
        (None, Some(z_m)) => {
            Some(RawDepth { values_m: Array2::from_elem((rows, columns), z_m as f32), is_axial: true })
        }
        (None, None) => None,
    };
    let mut notes = vec![];
    if scene.n_clipped > 0 {
        let n_samples = rows * columns * scene.image.grid().len();
        notes.push(format!("{} of {n_samples} samples of all bands were below 0 and are 0", scene.n_clipped));
    }
    let view = view.transpose().map_err(|error| unreadable(path, error))?;
    Ok(Contents { depth, view, light: scene.light, notes, ..Contents::of(scene.image) })
}

/// Returns the bands of a picture without a spectrum.
fn picture_bands(options: &ReadOptions) -> Result<WavelengthGrid, SceneError> {
    Ok(match &options.grid {
        Some(grid) => grid.clone(),
        None => WavelengthGrid::uniform(400.0, 700.0, 10.0)?,
    })
}

/// What a reader found.
struct Contents {
    image: SpectralImage,
    depth: Option<RawDepth>,
    view: Option<View>,
    hidden: Option<(SpectralImage, Array2<f32>)>,
    light: Option<SceneLight>,
    notes: Vec<String>,
}

/// Depths as they stand in a file, m; 0 or NaN where none was measured.
struct RawDepth {
    values_m: Array2<f32>,
    /// Along the axis, or else from the projection center.
    is_axial: bool,
}

impl Contents {
    fn of(image: SpectralImage) -> Self {
        Self { image, depth: None, view: None, hidden: None, light: None, notes: vec![] }
    }
}

/// Lights a reflectance, moves it to the bands wanted and adds what the options give.
fn finish(path: &Path, name: String, contents: Contents, options: &ReadOptions) -> Result<Scene, SceneError> {
    let (rows, columns) = (contents.image.rows(), contents.image.columns());
    let view = match (view_wanted(options, &contents.image)?, contents.view) {
        (Some(view), _) | (None, Some(view)) => Some(view),
        (None, None) => view_beside(path, rows, columns)?,
    };
    let mut notes = contents.notes;
    let depth = match contents.depth {
        Some(raw) => depth_of(path, raw, view, options.fill_depth, &mut notes)?,
        None => match depth_beside(path, rows, columns)? {
            Some((file, values_m)) => {
                let fill = options.fill_depth.unwrap_or(FillDepth::Beside);
                depth_of(&file, RawDepth { values_m, is_axial: true }, view, Some(fill), &mut notes)?
            }
            None => None,
        },
    };
    notes.extend(resampling_note(contents.image.grid(), options.grid.as_ref()));
    let hidden = match contents.hidden {
        Some((image, z_m)) => {
            Some(HiddenLayer { radiance: lit(image, options)?, depth: behind(path, z_m, depth.as_ref())? })
        }
        None => None,
    };
    let light = match contents.image.quantity() {
        Quantity::Reflectance => Some(SceneLight::new(options.light.clone(), options.illuminance_lux)),
        _ => contents.light,
    };
    let radiance = lit(contents.image, options)?;
    let scene = Scene { name, radiance, depth, view, hidden, light, notes };
    let scene = match options.depth_m {
        Some(depth_m) => scene.or_flat_depth_m(depth_m)?,
        None => scene,
    };
    scene.validate()?;
    Ok(scene)
}

/// Fills depths that were not measured and takes distances from the projection center for depths along the axis; `None` for
/// distances of samples whose directions are not known.
fn depth_of(
    file: &Path,
    raw: RawDepth,
    view: Option<View>,
    fill: Option<FillDepth>,
    notes: &mut Vec<String>,
) -> Result<Option<DepthMap>, SceneError> {
    let values = |reason| SceneError::Values { file: file.to_owned(), reason };
    let values_m = match (raw.is_axial, view) {
        (true, _) => raw.values_m,
        (false, Some(view)) => axial(&raw.values_m, view),
        (false, None) => return Ok(None),
    };
    let n_samples = values_m.len();
    let Some(fill) = fill else {
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

/// Checks that every depth was measured; what is negative is another matter.
fn check_measured(file: &Path, z_m: &Array2<f32>) -> Result<(), SceneError> {
    let is_unmeasured = |z: f32| z == 0.0 || z.is_nan();
    let Some(((row, column), _)) = z_m.indexed_iter().find(|(_, z)| is_unmeasured(**z)) else { return Ok(()) };
    let n_unmeasured = z_m.iter().filter(|z| is_unmeasured(**z)).count();
    Err(SceneError::Unmeasured { file: PathBuf::from(file), row, column, n_unmeasured, n_samples: z_m.len() })
}

/// Returns in a sentence how the bands of a file become those wanted, where they are others.
fn resampling_note(own: &WavelengthGrid, wanted: Option<&WavelengthGrid>) -> Option<String> {
    let wanted = wanted.filter(|wanted| *wanted != own)?;
    let of = |grid: &WavelengthGrid| {
        let (first, last) = grid.range_nm();
        let widths = grid.centers_nm().windows(2).map(|pair| pair[1] - pair[0]);
        let (least, most) =
            widths.fold((f64::INFINITY, 0.0), |(least, most), w| (f64::min(least, w), f64::max(most, w)));
        match grid.len() {
            1 => format!("1 band at {first} nm"),
            n if most - least < 1e-6 => format!("{n} bands of {first}–{last} nm, {} nm apart", short(least)),
            n => format!("{n} bands of {first}–{last} nm, {} to {} nm apart", short(least), short(most)),
        }
    };
    Some(format!(
        "{} become {}: spectra run in straight lines between the centers of bands, and a band wider than those of the file takes \
         the mean over its width",
        of(own),
        of(wanted)
    ))
}

/// Returns a length with the digits that tell.
fn short(nm: f64) -> f64 {
    (100.0 * nm).round() / 100.0
}

/// Returns the light whose perfect white is that of a picture on a display.
fn white_of(display: &Display, white_cd_m2: f64) -> Result<SceneLight, SceneError> {
    let grid = WavelengthGrid::uniform(380.0, 780.0, 1.0)?;
    let [r, g, b] = display.srgb_basis(&grid, 1.0);
    let white = (0..grid.len()).map(|band| (r[band] + g[band] + b[band]).max(0.0)).collect();
    let spectrum = Spectrum::new(grid.centers_nm().to_vec(), white)?;
    Ok(SceneLight::new(Illuminant::Spectrum(spectrum), std::f64::consts::PI * white_cd_m2))
}

fn view_wanted(options: &ReadOptions, image: &SpectralImage) -> Result<Option<View>, SceneError> {
    let view = |fov_deg| View::from_horizontal_fov_deg(fov_deg, image.columns(), image.rows());
    options.horizontal_fov_deg.map(view).transpose()
}

fn lit(image: SpectralImage, options: &ReadOptions) -> Result<SpectralImage, SceneError> {
    let image = match &options.grid {
        Some(grid) => resampled(&image, grid)?,
        None => image,
    };
    if image.quantity() == Quantity::Reflectance {
        return reflectance_under(&image, &options.light.white_radiance(image.grid(), options.illuminance_lux));
    }
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::write_spectral_exr;
    use approx::assert_relative_eq;
    use ndarray::Array2;

    #[test]
    fn a_file_of_reflectances_is_lit_and_given_depth_and_view() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("white.exr");
        let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap();
        let planes = vec![Array2::from_elem((4, 8), 1.0); grid.len()];
        let white = SpectralImage::new(Quantity::Reflectance, grid, planes).unwrap();
        write_spectral_exr(&path, &white, &crate::ExrParts::default()).unwrap();
        let bare = read_scene(&path, &ReadOptions::default()).unwrap();
        assert!(bare.require_depth().unwrap_err().to_string().starts_with("white.exr: "));
        // White under 1000 lx is 1000/π cd/m²; 5 nm bands are within 0.1 % of 1 nm ones.
        assert_relative_eq!(bare.mean_luminance_cd_m2(), 318.31, max_relative = 1e-3);
        let options = ReadOptions { depth_m: Some(2.0), horizontal_fov_deg: Some(30.0), ..ReadOptions::default() };
        let scene = read_scene(&path, &options).unwrap();
        assert_eq!(scene.require_depth().unwrap().range_m(), (2.0, 2.0));
        assert_eq!(scene.light, Some(SceneLight::new(Illuminant::D65, 1000.0)));
        assert_relative_eq!(scene.require_view().unwrap().horizontal_fov_deg(8), 30.0, max_relative = 1e-12);
        let beyond = ReadOptions { grid: Some(WavelengthGrid::uniform(300.0, 700.0, 10.0).unwrap()), ..options };
        assert!(read_scene(&path, &beyond).is_err());
    }

    #[test]
    fn resampled_bands_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("uneven.exr");
        let own = WavelengthGrid::new(vec![400.0, 420.0, 450.0, 500.0, 560.0, 640.0, 700.0]).unwrap();
        let planes = own.centers_nm().iter().map(|&nm| Array2::from_elem((2, 3), nm as f32)).collect();
        let image = SpectralImage::new(Quantity::Radiance, own, planes).unwrap();
        write_spectral_exr(&path, &image, &crate::ExrParts::default()).unwrap();
        let with = |grid| ReadOptions { grid, ..ReadOptions::default() };
        assert!(read_scene(&path, &with(None)).unwrap().notes.is_empty());
        let even = WavelengthGrid::uniform(420.0, 680.0, 20.0).unwrap();
        let scene = read_scene(&path, &with(Some(even.clone()))).unwrap();
        let note = &scene.notes[0];
        assert!(
            note.starts_with("7 bands of 400–700 nm, 20 to 80 nm apart become 14 bands of 420–680 nm, 20 nm"),
            "{note}"
        );
        // A straight spectrum stays straight, whatever the bands.
        for (value, &nm) in scene.radiance.spectrum_at(1, 1).iter().zip(even.centers_nm()) {
            assert_relative_eq!(*value, nm, max_relative = 1e-6);
        }
    }

    #[test]
    fn unmeasured_depth_of_a_picture_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.png");
        dioptric_pictures::save(&image::RgbImage::new(4, 2).into(), &path).unwrap();
        let depth = image::ImageBuffer::from_fn(4, 2, |x, y| {
            image::Luma([if y == 0 && x > 0 { 0 } else { 500_u16 + x as u16 }])
        });
        dioptric_pictures::save(&depth.into(), &folder.path().join("room.depth.png")).unwrap();
        let read = |fill_depth| read_scene(&path, &ReadOptions { fill_depth, ..ReadOptions::default() }).unwrap();
        let usual = read(None);
        assert_eq!(usual.notes.len(), 1);
        assert!(
            usual.notes[0].starts_with("3 of 8 samples (37.50 %) have no depth; they get the farther"),
            "{:?}",
            usual.notes
        );
        assert_eq!(usual.require_depth().unwrap().z_m()[(0, 3)], 0.5);
        assert_eq!(read(Some(FillDepth::Metres(2.0))).require_depth().unwrap().z_m()[(0, 3)], 2.0);
    }

    #[test]
    fn a_name_that_tells_nothing_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.xyz");
        let message = |path: &Path| read_scene(path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message(&path).contains("scene.xyz: cannot be read: there is no such file"));
        std::fs::write(&path, "").unwrap();
        assert!(message(&path).contains("expected a .exr"));
        assert!(message(&folder.path().join("absent.exr")).contains("absent.exr"));
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn the_real_scenes_have_depth_and_camera_data() {
        let Some(folder) = dioptric_golden::shared("data/scenes") else { return };
        let piano = read_scene(&folder.join("piano3d.radiance_depth.exr"), &ReadOptions::default()).unwrap();
        assert_relative_eq!(piano.require_view().unwrap().horizontal_fov_deg(200), 40.0, max_relative = 1e-9);
        // Radiance does not tell what light was on it.
        assert_eq!(piano.light, None);
        let (near, far) = piano.require_depth().unwrap().range_m();
        assert!(near > 0.3 && far < 0.9);
        // The provenance of the file says 99.999 cd/m².
        assert_relative_eq!(piano.mean_luminance_cd_m2(), 99.999, max_relative = 2e-3);
        let motorcycle =
            read_scene(&folder.join("motorcycle_370.radiance_depth.exr"), &ReadOptions::default()).unwrap();
        assert_relative_eq!(motorcycle.require_view().unwrap().focal_px, 994.978 / 2.0, max_relative = 1e-12);
        // Its provenance says 100 cd/m², from a spectrum every 5 nm: of the narrow lines of the display that made it,
        // the 20 nm samples of the file hold 1.37 times as much for white.
        assert_relative_eq!(motorcycle.mean_luminance_cd_m2(), 135.0, max_relative = 0.05);
    }
}
