//! Any file of a scene, by its name.

use std::path::Path;

use dioptric_spectrum::{Display, Illuminant, Quantity, SpectralImage, Spectrum, WavelengthGrid};

use super::{
    camera::view_beside, depth_picture::depth_beside, read_band_folder, read_envi, read_picture, read_spectral_exr,
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
        }
    }
}

/// Reads a scene from a spectral EXR (`.exr`), an ENVI header (`.hdr`), a folder with a picture a band, or an
/// ordinary picture (`.png`, `.jpg`, `.tif`).
///
/// Camera data comes from the options, else from the file, else from a `NAME.camera.json` beside it; depth from the file, else
/// from a gray 16-bit `NAME.depth.png` beside it (millimetres, or what `depth_unit_m` of the camera file says; 0 where it was
/// not measured), else from the options. Depth and view may still be absent afterwards: [`Scene::require_depth_and_view`] says
/// so.
///
/// # Errors
/// One sentence with the file's name when anything in it is wrong, or its bands do not cover those wanted.
pub fn read_scene(path: &Path, options: &ReadOptions) -> Result<Scene, SceneError> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if path.is_dir() {
        let image = read_band_folder(path, options.band_wavelengths.as_ref())?;
        return finish(path, name, Contents::of(image), options);
    }
    match extension.as_str() {
        "exr" => {
            let file = read_spectral_exr(path)?;
            let view = match file.view {
                Some(view) => Some(view),
                None => view_beside(path, file.image.rows(), file.image.columns())?,
            };
            let in_file = |error| match error {
                SceneError::Spectrum(reason) => SceneError::Values { file: path.to_owned(), reason },
                other => other,
            };
            let depth = file.depth_with(view_wanted(options, &file.image)?.or(view)).map_err(in_file)?;
            let contents = Contents { depth, view, hidden: file.hidden, ..Contents::of(file.image) };
            finish(path, name, contents, options)
        }
        "hdr" => finish(path, name, Contents::of(read_envi(path)?.into_image(options.white_level)?), options),
        "jpg" | "jpeg" if cfg!(not(feature = "jpeg")) => {
            Err(SceneError::LacksFeature { file: path.to_owned(), feature: "jpeg" })
        }
        "png" | "jpg" | "jpeg" | "tif" | "tiff" => {
            let grid = match &options.grid {
                Some(grid) => grid.clone(),
                None => WavelengthGrid::uniform(400.0, 700.0, 10.0)?,
            };
            let display = Display::apple_studio();
            let image = read_picture(path, &display, &grid, options.picture_white_cd_m2)?;
            let light = Some(white_of(&display, options.picture_white_cd_m2)?);
            finish(path, name, Contents { light, ..Contents::of(image) }, options)
        }
        _ if !path.exists() => Err(super::beside::unreadable(path, "there is no such file")),
        _ => Err(SceneError::UnknownKind { file: path.to_owned() }),
    }
}

/// What a reader found.
struct Contents {
    image: SpectralImage,
    depth: Option<dioptric_spectrum::DepthMap>,
    view: Option<View>,
    hidden: Option<HiddenLayer>,
    light: Option<SceneLight>,
}

impl Contents {
    fn of(image: SpectralImage) -> Self {
        Self { image, depth: None, view: None, hidden: None, light: None }
    }
}

/// Lights a reflectance, moves it to the bands wanted and adds what the options give.
fn finish(path: &Path, name: String, contents: Contents, options: &ReadOptions) -> Result<Scene, SceneError> {
    let view = match (view_wanted(options, &contents.image)?, contents.view) {
        (Some(view), _) | (None, Some(view)) => Some(view),
        (None, None) => view_beside(path, contents.image.rows(), contents.image.columns())?,
    };
    let hidden = match contents.hidden {
        Some(layer) => Some(HiddenLayer { radiance: lit(layer.radiance, options)?, ..layer }),
        None => None,
    };
    let light = match contents.image.quantity() {
        Quantity::Reflectance => Some(SceneLight::new(options.light.clone(), options.illuminance_lux)),
        _ => contents.light,
    };
    let depth = match contents.depth {
        Some(depth) => Some(depth),
        None => depth_beside(path, contents.image.rows(), contents.image.columns())?,
    };
    let radiance = lit(contents.image, options)?;
    let scene = Scene { name, radiance, depth, view, hidden, light };
    let scene = match options.depth_m {
        Some(depth_m) => scene.or_flat_depth_m(depth_m)?,
        None => scene,
    };
    scene.validate()?;
    Ok(scene)
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
    fn a_name_that_tells_nothing_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.xyz");
        let message = |path: &Path| read_scene(path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message(&path).contains("scene.xyz: cannot be read: there is no such file"));
        std::fs::write(&path, "").unwrap();
        assert!(message(&path).contains("expected a .exr"));
        assert!(message(&folder.path().join("absent.exr")).contains("absent.exr"));
    }

    #[test]
    #[dioptric_golden::needs_shared]
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
