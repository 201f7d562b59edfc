//! Scenes as `ISETCam` reads them: a structure `scene` of photons, in a file of version 5.

use std::path::Path;

use dioptric_files::write;
use dioptric_spectrum::{Illuminant, SpectralImage, WavelengthGrid};

use super::{
    super::{photons::joules_per_photon, unusable::unwritable},
    elements,
};
use crate::{Scene, SceneError};

/// Writes a scene as a structure `scene` of `ISETCam`: photons s⁻¹ m⁻² sr⁻¹ nm⁻¹, the horizontal field of view, distances from the camera,
/// and the light on it as the photons of a perfect white.
///
/// # Errors
/// When the file cannot be written, or would hold what such a file cannot: a hidden layer, an axis that is not in the middle, 4 GiB.
pub fn write_iset_scene(path: &Path, scene: &Scene) -> Result<(), SceneError> {
    scene.validate()?;
    if scene.hidden.is_some() {
        return Err(unwritable(path, "a file of ISETCam has no layer behind the first: expected .exr"));
    }
    let (rows, columns) = (scene.rows(), scene.columns());
    if let Some(view) = scene.view {
        let off = [view.center_x_px - 0.5 * (columns as f64 - 1.0), view.center_y_px - 0.5 * (rows as f64 - 1.0)];
        if off.iter().any(|off| off.abs() > 1e-3) {
            let reason =
                "a scene of ISETCam has its axis in the middle, and this one has not: expected .exr, or another crop";
            return Err(unwritable(path, reason));
        }
    }
    let bytes = content(scene)
        .ok_or_else(|| unwritable(path, "it takes 4 GiB or more, which such a file cannot hold: expected .exr"))?;
    Ok(write(path, &bytes)?)
}

fn content(scene: &Scene) -> Option<Vec<u8>> {
    let (rows, columns) = (scene.rows(), scene.columns());
    let wave_nm = scene.radiance.grid().centers_nm();
    let mut fields = vec![
        named("type", elements::text("", "scene")?),
        named("name", elements::text("", &scene.name)?),
        named("metadata", elements::doubles("", &[0, 0], &[])?),
        named("spectrum", spectrum(wave_nm)?),
        named("data", data(&scene.radiance, "luminance")?),
        named("magnification", elements::doubles("", &[1, 1], &[1.0])?),
    ];
    if let Some(view) = scene.view {
        fields.push(named("wAngular", elements::doubles("", &[1, 1], &[view.horizontal_fov_deg(columns)])?));
    }
    if let Some(depth) = &scene.depth {
        let (near, far) = depth.range_m();
        let along = |row: usize, column: usize| match scene.view {
            Some(view) if near < far => view.distance_per_depth(row as f64, column as f64),
            _ => 1.0,
        };
        let z_m = depth.z_m();
        let distances: Vec<f64> = (0..rows * columns)
            .map(|i| (i % rows, i / rows))
            .map(|(row, column)| f64::from(z_m[(row, column)]) * along(row, column))
            .collect();
        let mean = distances.iter().filter(|v| v.is_finite()).sum::<f64>()
            / distances.iter().filter(|v| v.is_finite()).count().max(1) as f64;
        fields.push(named("distance", elements::doubles("", &[1, 1], &[mean])?));
        fields.push(named("depthMap", elements::doubles("", &[rows, columns], &distances)?));
    }
    if let Some((light, lux)) = scene.light.as_ref().and_then(|light| Some((light, light.illuminance_lux?))) {
        fields.push(named("illuminant", illuminant(&light.illuminant, lux, scene.radiance.grid())?));
    }
    let scene = elements::structure("scene", &fields)?;
    Some([elements::file_head(), elements::variable(&scene)?].concat())
}

/// Returns a field of a structure.
pub(super) fn named(name: &str, content: Vec<u8>) -> (String, Vec<u8>) {
    (name.to_owned(), content)
}

/// Returns the structure `spectrum` of bands.
pub(super) fn spectrum(wave_nm: &[f64]) -> Option<Vec<u8>> {
    elements::structure("", &[named("wave", elements::doubles("", &[wave_nm.len(), 1], wave_nm)?)])
}

/// Returns the structure `data`: the photons of an image, and an empty field that `ISETCam` fills itself.
pub(super) fn data(image: &SpectralImage, summary: &str) -> Option<Vec<u8>> {
    let (rows, columns, wave_nm) = (image.rows(), image.columns(), image.grid().centers_nm());
    let photons = image.planes().iter().zip(wave_nm).flat_map(|(plane, nm)| {
        let joules = joules_per_photon(*nm);
        // The first index, that of rows, is the fastest.
        (0..rows * columns).map(move |i| (f64::from(plane[(i % rows, i / rows)]) / joules) as f32)
    });
    let photons = elements::singles("", &[rows, columns, wave_nm.len()], photons)?;
    elements::structure("", &[named("photons", photons), named(summary, elements::doubles("", &[0, 0], &[])?)])
}

/// Returns the structure `illuminant`: the photons of a perfect white under a light.
fn illuminant(light: &Illuminant, lux: f64, grid: &WavelengthGrid) -> Option<Vec<u8>> {
    let (white, wave_nm) = (light.white_radiance(grid, lux), grid.centers_nm());
    let photons: Vec<f64> = white.iter().zip(wave_nm).map(|(watts, nm)| watts / joules_per_photon(*nm)).collect();
    let photons = elements::doubles("", &[photons.len(), 1], &photons)?;
    elements::structure(
        "",
        &[
            named("type", elements::text("", "illuminant")?),
            named("name", elements::text("", "light of the scene")?),
            named("spectrum", spectrum(wave_nm)?),
            named("data", elements::structure("", &[named("photons", photons)])?),
        ],
    )
}
