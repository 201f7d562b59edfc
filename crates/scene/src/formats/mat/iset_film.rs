//! Irradiance as `ISETCam` has it: a structure `oi` or `opticalimage` of photons s⁻¹ m⁻² nm⁻¹.
//!
//! What the fields hold was taken from `oiGet.m` and `opticsGet.m` of `ISETCam`: the film lies a focal length behind the lens and is as wide as
//! the field of view makes it there.

use std::path::Path;

use dioptric_files::write;
use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};

use super::{
    super::{
        stated::{name_of, note_of},
        unusable::{unreadable, unwritable},
    },
    container::{MatArray, MatFile},
    elements,
    iset_kinds::{self, OPTICAL_IMAGES, structure_of},
    iset_write::{data, named, spectrum},
    isetcam::{Cube, ascending, light_of, white_of},
};
use crate::{SceneError, SceneLight};

/// Fields that change nothing of what the irradiance is, beside those of all objects: how it was made.
const HARMLESS: [&str; 10] =
    ["diffuser", "optics", "hfov", "fov", "illuminant", "computeMethod", "psf", "wvf", "rotate", "wave"];

/// The irradiance of a file of `ISETCam`.
#[derive(Clone, Debug, PartialEq)]
pub struct IsetIrradiance {
    /// Spectral irradiance, W m⁻² nm⁻¹, with the distance between samples where the file tells it.
    pub image: SpectralImage,
    /// The light on the scene, where the file states it.
    pub light: Option<SceneLight>,
    /// What was understood and what of the file is not used, a sentence each.
    pub notes: Vec<String>,
}

/// Whether a MATLAB file holds an optical image of `ISETCam`, of the name told or without a scene beside it; not where it cannot be read.
pub fn holds_iset_irradiance(path: &Path, told: Option<&str>) -> bool {
    let Ok(file) = MatFile::read(path, &|_| false) else { return false };
    let has = |name: &str| file.listed.iter().any(|own| !own.is_numeric && own.name == name);
    match told {
        Some(told) => OPTICAL_IMAGES.contains(&told) && has(told),
        None => OPTICAL_IMAGES.into_iter().any(has) && !has("scene"),
    }
}

/// Reads an optical image of `ISETCam`.
///
/// # Errors
/// When the file is no MATLAB file, holds none, or one that lacks its photons or bands.
pub fn read_iset_irradiance(path: &Path) -> Result<IsetIrradiance, SceneError> {
    let wrong = |reason: String| unreadable(path, reason);
    let file = MatFile::read(path, &|own| OPTICAL_IMAGES.contains(&own.name.as_str()))?;
    let oi = structure_of(&file, &OPTICAL_IMAGES).map_err(wrong)?;
    let oi =
        oi.ok_or_else(|| wrong("it has no optical image, expected a structure 'oi' or 'opticalimage'".to_owned()))?;
    let name = OPTICAL_IMAGES.into_iter().find(|name| file.listed.iter().any(|own| own.name == *name)).unwrap_or("oi");
    let lacks = |field: &str| wrong(format!("its '{name}' has no field '{field}'"));
    let own = oi.field("data").ok_or_else(|| lacks("data"))?;
    let photons = own.field("photons").ok_or_else(|| lacks("data.photons"))?;
    let wave = oi.field("spectrum").and_then(|spectrum| spectrum.field("wave")).or_else(|| oi.field("wave"));
    let wave_nm = wave.and_then(MatArray::list).ok_or_else(|| lacks("spectrum.wave"))?;
    let range = (own.field("dmin").and_then(MatArray::number), own.field("dmax").and_then(MatArray::number));
    let range = if let (Some(low), Some(high)) = range { Some([low, high]) } else { None };
    let cube = Cube::of(photons, &format!("{name}.data.photons"), range, wave_nm.len()).map_err(wrong)?;
    let mut planes: Vec<_> = cube.into_watts(&wave_nm).map_err(wrong)?.into_iter().map(Some).collect();
    let order = ascending(&wave_nm);
    let values = |reason| SceneError::Values { file: path.to_owned(), reason };
    let grid = WavelengthGrid::new(order.iter().map(|&band| wave_nm[band]).collect()).map_err(values)?;
    let planes = order.iter().filter_map(|&band| planes[band].take()).collect();
    let image = SpectralImage::new(Quantity::Irradiance, grid, planes).map_err(values)?;
    image.check_samples().map_err(values)?;
    let light = oi.field("illuminant").and_then(|array| white_of(array, &wave_nm));
    let light = light.map(|white| light_of(&white)).transpose().map_err(wrong)?;

    let focal_length_m = oi.field("optics").and_then(|optics| optics.field("focalLength")).and_then(MatArray::number);
    let fov_deg = oi.field("wAngular").and_then(MatArray::number);
    let (image, from) = match (focal_length_m, fov_deg) {
        (Some(f_m), Some(fov_deg)) if f_m > 0.0 && fov_deg > 0.0 && fov_deg < 180.0 => {
            let width_um = 2e6 * f_m * (0.5 * fov_deg).to_radians().tan();
            let pitch_um = width_um / image.columns() as f64;
            let from = format!("{pitch_um:.4} µm apart, by its focal length of {} mm and {fov_deg}°", 1e3 * f_m);
            (image.with_pitch_um(pitch_um), from)
        }
        _ => (image, "a pixel apart, since it states no focal length and field of view".to_owned()),
    };
    let understood = format!(
        "{}: irradiance of the photons of '{name}', {} × {} samples {from}",
        name_of(path),
        image.columns(),
        image.rows()
    );
    let others: Vec<String> = file.listed.iter().map(|own| own.name.clone()).filter(|own| own != name).collect();
    let mut notes = vec![understood];
    notes.extend(note_of(path, "variable", &others));
    notes.extend(note_of(path, "field", &iset_kinds::left_of(&oi, name, &HARMLESS)));
    Ok(IsetIrradiance { image, light, notes })
}

/// Writes irradiance as a structure `oi` of `ISETCam`. Its focal length is as long as the film is wide, and its field of view what belongs to
/// that, from which `ISETCam` finds the distance between samples.
///
/// # Errors
/// When the image is no irradiance or states no distance between its samples, takes 4 GiB or more, or the file cannot be written.
pub fn write_iset_irradiance(path: &Path, image: &SpectralImage, name: &str) -> Result<(), SceneError> {
    if image.quantity() != Quantity::Irradiance {
        return Err(unwritable(path, "an optical image of ISETCam is of irradiance"));
    }
    image.check_samples()?;
    let Some(pitch_um) = image.pitch_um() else {
        return Err(unwritable(
            path,
            "it states no distance between its samples, which an optical image of ISETCam has",
        ));
    };
    let bytes = content(image, pitch_um, name)
        .ok_or_else(|| unwritable(path, "it takes 4 GiB or more, which such a file cannot hold: expected .exr"))?;
    Ok(write(path, &bytes)?)
}

fn content(image: &SpectralImage, pitch_um: f64, name: &str) -> Option<Vec<u8>> {
    let width_m = 1e-6 * pitch_um * image.columns() as f64;
    let number = |value: f64| elements::doubles("", &[1, 1], &[value]);
    let optics = [
        named("type", elements::text("", "optics")?),
        named("name", elements::text("", "film alone")?),
        named("focalLength", number(width_m)?),
    ];
    let fields = [
        named("type", elements::text("", "opticalimage")?),
        named("name", elements::text("", name)?),
        named("metadata", elements::doubles("", &[0, 0], &[])?),
        named("spectrum", spectrum(image.grid().centers_nm())?),
        named("data", data(image, "illuminance")?),
        named("optics", elements::structure("", &optics)?),
        named("wAngular", number(2.0 * 0.5_f64.atan().to_degrees())?),
    ];
    let oi = elements::structure("oi", &fields)?;
    Some([elements::file_head(), elements::variable(&oi)?].concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ndarray::Array2;

    #[test]
    fn irradiance_comes_back_with_its_pitch() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("oi.mat");
        let grid = WavelengthGrid::new(vec![450.0, 550.0, 650.0]).unwrap();
        let planes = (0..3).map(|b| Array2::from_shape_fn((4, 6), |(y, x)| 1e-3 * (1 + 10 * b + y + 2 * x) as f32));
        let image = SpectralImage::new(Quantity::Irradiance, grid, planes.collect()).unwrap().with_pitch_um(3.45);
        write_iset_irradiance(&path, &image, "test").unwrap();
        let read = read_iset_irradiance(&path).unwrap();
        assert_relative_eq!(read.image.pitch_um().unwrap(), 3.45, max_relative = 1e-9);
        for (found, own) in read.image.planes().iter().zip(image.planes()) {
            for (found, own) in found.iter().zip(own) {
                // To photons and back in single precision.
                assert_relative_eq!(*found, *own, max_relative = 3e-7);
            }
        }
        assert_eq!(read.notes.len(), 1, "{:?}", read.notes);
        // As a scene it is refused with the way on.
        let message = crate::read_scene(&path, &crate::ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains("oi.mat") && message.contains("dioptric sense"), "{message}");
    }
}
