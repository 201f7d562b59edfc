//! Scenes as `ISETCam` saves them: a structure `scene`, or the variables of a multispectral file.
//!
//! Photons are s⁻¹ m⁻² sr⁻¹ nm⁻¹. What the fields hold was taken from `sceneFromFile.m`, `vcReadImage.m` and `illuminantGet.m`
//! of `ISETCam`.

use std::path::Path;

use dioptric_spectrum::{Illuminant, Observer, Quantity, SpectralImage, Spectrum, WavelengthGrid};
use ndarray::Array2;

use super::{
    super::{photons::joules_per_photon, unusable::unreadable},
    container::{MatArray, MatFile},
};
use crate::{SceneError, SceneLight};

/// The variables that are read.
const WANTED: [&str; 12] = [
    "scene",
    "mcCOEF",
    "basis",
    "imgMean",
    "photons",
    "data",
    "wave",
    "wavelength",
    "illuminant",
    "fov",
    "dist",
    "depthMap",
];

/// Bands that a linear model may have: what it takes of memory is at most a thousand times its coefficients.
const LIMIT_BANDS: usize = 1000;

/// A scene from a MATLAB file.
#[derive(Clone, Debug, PartialEq)]
pub struct IsetScene {
    /// Spectral radiance, W m⁻² sr⁻¹ nm⁻¹.
    pub image: SpectralImage,
    /// How far each sample is, m: along the axis where all are as far, or else from the camera; 0 or NaN where nothing was
    /// measured.
    pub depth_m: Option<Array2<f32>>,
    /// One distance for the whole scene, m, where the file states it and no depth of samples.
    pub distance_m: Option<f64>,
    /// The horizontal field of view.
    pub horizontal_fov_deg: Option<f64>,
    /// The light on it, where it is the same everywhere.
    pub light: Option<SceneLight>,
    /// Samples that were negative and are 0, as a linear model may leave them.
    pub n_clipped: usize,
}

/// Reads a MATLAB file of version 5 to 7 that holds an `ISETCam` scene.
///
/// Either a structure `scene` (`data.photons`, `spectrum.wave`, and as far as they are there `wAngular`, `depthMap`, `distance`,
/// `illuminant`), or variables: `mcCOEF` and `basis` (the product of coefficients and basis functions, to which `imgMean` is
/// added where it is there), or `photons` or `data`, with `wave` or `wavelength`; besides `illuminant`, `fov` and `dist`. Photons
/// coded as whole numbers between `dmin` and `dmax` are decoded.
///
/// # Errors
/// One sentence with the file's name when it is truncated, of another version, or lacks what makes a scene.
pub fn read_iset_mat(path: &Path) -> Result<IsetScene, SceneError> {
    let file = MatFile::read(path, &WANTED)?;
    let wrong = |reason: String| unreadable(path, reason);
    let Raw { planes, wave_nm, light, depth_m, distance_m, horizontal_fov_deg, n_clipped } =
        Raw::of(&file).map_err(wrong)?;
    let values = |reason| SceneError::Values { file: path.to_owned(), reason };
    let order = ascending(&wave_nm);
    let grid = WavelengthGrid::new(order.iter().map(|&band| wave_nm[band]).collect()).map_err(values)?;
    let mut planes: Vec<Option<Array2<f32>>> = planes.into_iter().map(Some).collect();
    let planes = order.iter().filter_map(|&band| planes[band].take()).collect();
    let image = SpectralImage::new(Quantity::Radiance, grid, planes).map_err(values)?;
    image.check_samples().map_err(values)?;
    let light = light.map(|spectrum| light_of(&spectrum)).transpose().map_err(wrong)?;
    Ok(IsetScene { image, depth_m, distance_m, horizontal_fov_deg, light, n_clipped })
}

/// Returns the places of numbers in ascending order.
fn ascending(numbers: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..numbers.len()).collect();
    order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
    order
}

/// Returns the light whose perfect white has this radiance.
fn light_of(white: &Spectrum) -> Result<SceneLight, String> {
    let illuminant = Illuminant::Spectrum(white.clone());
    illuminant.check().map_err(|error| format!("its illuminant cannot be: {error}"))?;
    let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
    let luminance = Observer::Cie1931.xyz(&fine, &white.sample_held(&fine)).luminance_cd_m2();
    Ok(SceneLight::new(illuminant, std::f64::consts::PI * luminance))
}

/// What the file says, in the order of its bands.
struct Raw {
    planes: Vec<Array2<f32>>,
    wave_nm: Vec<f64>,
    /// The radiance of a perfect white, W m⁻² sr⁻¹ nm⁻¹.
    light: Option<Spectrum>,
    depth_m: Option<Array2<f32>>,
    distance_m: Option<f64>,
    horizontal_fov_deg: Option<f64>,
    n_clipped: usize,
}

impl Raw {
    fn of(file: &MatFile) -> Result<Self, String> {
        if let Some(scene) = file.array("scene")? {
            return Self::of_scene(&scene);
        }
        let list_of = |names: [&str; 2]| -> Result<Option<Vec<f64>>, String> {
            for name in names {
                if let Some(array) = file.array(name)? {
                    return Ok(array.list().filter(|list| !list.is_empty()));
                }
            }
            Ok(None)
        };
        let number = |name: &str| Ok::<_, String>(file.array(name)?.and_then(|array| array.number()));
        let (coefficients, basis) = (file.array("mcCOEF")?, file.array("basis")?);
        let (mut cube, wave_nm) = if let Some(coefficients) = coefficients {
            let basis = basis.ok_or("it has coefficients 'mcCOEF' but no 'basis'")?;
            let wave_nm = basis.field("wave").and_then(MatArray::list).ok_or("its 'basis' has no list 'wave'")?;
            let functions = basis.field("basis").ok_or("its 'basis' has no field 'basis'")?;
            let mean = file.array("imgMean")?.and_then(|array| array.list()).filter(|list| !list.is_empty());
            (of_basis(&coefficients, functions, mean.as_deref(), wave_nm.len())?, wave_nm)
        } else {
            let photons = match file.array("photons")? {
                Some(photons) => Some(photons),
                None => file.array("data")?,
            };
            let photons =
                photons.ok_or("it holds no scene: expected a variable 'scene', 'mcCOEF', 'photons' or 'data'")?;
            let wave_nm = list_of(["wave", "wavelength"])?.ok_or("it has no list 'wave' of its bands, nm")?;
            (Cube::of(&photons, "photons", None, wave_nm.len())?, wave_nm)
        };
        let light = file.array("illuminant")?.and_then(|array| white_of(&array, &wave_nm));
        let n_clipped = cube.clip();
        Ok(Self {
            light,
            depth_m: file.array("depthMap")?.map(|map| plane_of(&map, cube.size())).transpose()?,
            distance_m: number("dist")?,
            horizontal_fov_deg: number("fov")?,
            n_clipped,
            planes: cube.into_watts(&wave_nm)?,
            wave_nm,
        })
    }

    fn of_scene(scene: &MatArray<'_>) -> Result<Self, String> {
        let data = scene.field("data").ok_or("its 'scene' has no field 'data'")?;
        let photons = data.field("photons").ok_or("its 'scene' has no field 'data.photons'")?;
        let wave = scene.field("spectrum").and_then(|spectrum| spectrum.field("wave"));
        let wave_nm = wave.or_else(|| scene.field("wave")).and_then(MatArray::list);
        let wave_nm = wave_nm.ok_or("its 'scene' has no list 'spectrum.wave' of bands, nm")?;
        let number = |name: &str| scene.field(name).and_then(MatArray::number);
        let range = |low: &str, high: &str| Some([data.field(low)?.number()?, data.field(high)?.number()?]);
        let mut cube = Cube::of(photons, "scene.data.photons", range("dmin", "dmax"), wave_nm.len())?;
        let n_clipped = cube.clip();
        Ok(Self {
            light: scene.field("illuminant").and_then(|array| white_of(array, &wave_nm)),
            depth_m: scene.field("depthMap").map(|map| plane_of(map, cube.size())).transpose()?,
            distance_m: number("distance"),
            horizontal_fov_deg: number("wAngular"),
            n_clipped,
            planes: cube.into_watts(&wave_nm)?,
            wave_nm,
        })
    }
}

/// Photons of each band.
struct Cube(Vec<Array2<f32>>);

impl Cube {
    /// Reads rows × columns × bands, of whole numbers between the ends of `range` where they are coded so.
    fn of(array: &MatArray<'_>, name: &str, range: Option<[f64; 2]>, n_bands: usize) -> Result<Self, String> {
        let numbers = array.numbers().map_err(|what| format!("its '{name}' is {what}, expected numbers"))?;
        let (rows, columns) = match array.sides[..] {
            [rows, columns] if n_bands == 1 => (rows, columns),
            [rows, columns, bands] if bands == n_bands => (rows, columns),
            _ => {
                let sides = array.sides.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
                return Err(format!("its '{name}' is {sides}, expected rows × columns × {n_bands}, as many as bands"));
            }
        };
        let [scale, offset] = match (numbers.is_integer, range) {
            (false, _) => [1.0, 0.0],
            (true, Some([low, high])) => [(high - low) / numbers.top(), low],
            (true, None) => {
                return Err(format!("its '{name}' are whole numbers, expected 'dmin' and 'dmax' beside them"));
            }
        };
        let plane = |band: usize| {
            Array2::from_shape_fn((rows, columns), |(row, column)| {
                (scale * numbers.at(row + rows * (column + columns * band)) + offset) as f32
            })
        };
        Ok(Self((0..n_bands).map(plane).collect()))
    }

    fn size(&self) -> (usize, usize) {
        self.0[0].dim()
    }

    /// Makes negative photons none, and returns how many there were.
    fn clip(&mut self) -> usize {
        let mut n_clipped = 0;
        for sample in self.0.iter_mut().flat_map(|plane| plane.iter_mut()).filter(|sample| **sample < 0.0) {
            *sample = 0.0;
            n_clipped += 1;
        }
        n_clipped
    }

    /// Returns the energy of the photons.
    fn into_watts(mut self, wave_nm: &[f64]) -> Result<Vec<Array2<f32>>, String> {
        for (plane, &nm) in self.0.iter_mut().zip(wave_nm) {
            let joules = joules_per_photon(nm);
            if !(joules.is_finite() && joules > 0.0) {
                return Err(format!("a band lies at {nm} nm, expected a length above 0"));
            }
            plane.mapv_inplace(|photons| (f64::from(photons) * joules) as f32);
        }
        Ok(self.0)
    }
}

/// Returns Σ coefficient × basis function, and the mean, of each sample.
fn of_basis(
    coefficients: &MatArray<'_>,
    functions: &MatArray<'_>,
    mean: Option<&[f64]>,
    n_bands: usize,
) -> Result<Cube, String> {
    let weights = functions.numbers().map_err(|what| format!("its 'basis.basis' is {what}, expected numbers"))?;
    let &[n_rows, n_functions] = &functions.sides[..] else {
        return Err("its 'basis.basis' is no table".to_owned());
    };
    // Each sample is but one of the product's bands: a few numbers must not ask for a million times as many.
    if n_bands > LIMIT_BANDS {
        return Err(format!("its 'basis.wave' has {n_bands} bands, expected at most {LIMIT_BANDS}"));
    }
    if n_rows != n_bands || n_functions == 0 {
        return Err(format!("its 'basis.basis' has {n_rows} rows, expected {n_bands}, as many as 'basis.wave'"));
    }
    if mean.is_some_and(|mean| mean.len() != n_bands) {
        return Err(format!("its 'imgMean' has not {n_bands} numbers, as many as 'basis.wave'"));
    }
    let parts = Cube::of(coefficients, "mcCOEF", None, n_functions)?.0;
    let plane = |band: usize| {
        let offset = mean.map_or(0.0, |mean| mean[band]);
        let mut sum = Array2::from_elem(parts[0].dim(), offset);
        for (k, part) in parts.iter().enumerate() {
            let weight = weights.at(band + n_bands * k);
            ndarray::Zip::from(&mut sum).and(part).for_each(|sum, &v| *sum += weight * f64::from(v));
        }
        sum.mapv(|v| v as f32)
    };
    Ok(Cube((0..n_bands).map(plane).collect()))
}

/// Returns a plane of the scene's size.
fn plane_of(array: &MatArray<'_>, (rows, columns): (usize, usize)) -> Result<Array2<f32>, String> {
    let numbers = array.numbers().map_err(|what| format!("its 'depthMap' is {what}, expected numbers"))?;
    if array.sides != [rows, columns] {
        let sides = array.sides.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
        return Err(format!("its 'depthMap' is {sides}, expected {rows} × {columns}, as the photons are"));
    }
    Ok(Array2::from_shape_fn((rows, columns), |(row, column)| numbers.at(row + rows * column) as f32))
}

/// Returns the radiance of a perfect white, W m⁻² sr⁻¹ nm⁻¹: of a modern illuminant from its photons, of an old one from its
/// energy; `None` where it is not the same everywhere, or of another length than its bands.
fn white_of(illuminant: &MatArray<'_>, scene_wave_nm: &[f64]) -> Option<Spectrum> {
    let wave = illuminant.field("spectrum").and_then(|spectrum| spectrum.field("wave"));
    let wave = wave.or_else(|| illuminant.field("wave")).or_else(|| illuminant.field("wavelength"));
    let wave_nm = wave.and_then(MatArray::list).unwrap_or_else(|| scene_wave_nm.to_vec());
    let data = illuminant.field("data")?;
    let watts = match data.field("photons") {
        Some(photons) => {
            let numbers = photons.numbers().ok()?;
            let of = |name: &str| data.field(name).and_then(MatArray::number);
            let [scale, offset] = match (numbers.is_integer, of("min"), of("max")) {
                (false, ..) => [1.0, 0.0],
                (true, Some(low), Some(high)) => [(high - low) / numbers.top(), low],
                _ => return None,
            };
            let list = photons.list()?;
            list.iter().zip(&wave_nm).map(|(n, &nm)| (scale * n + offset) * joules_per_photon(nm)).collect()
        }
        None => data.list()?,
    };
    let n_numbers = data.field("photons").map_or(data.len(), MatArray::len);
    if n_numbers != wave_nm.len() {
        return None;
    }
    let order = ascending(&wave_nm);
    Spectrum::new(order.iter().map(|&i| wave_nm[i]).collect(), order.iter().map(|&i| watts[i]).collect()).ok()
}
