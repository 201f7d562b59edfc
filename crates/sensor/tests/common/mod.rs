//! Spectral reflectances of the shared reference data, lit.

use dioptric_spectrum::{Illuminant, Quantity, SpectralImage, WavelengthGrid, color_checker_reflectances};
use exr::prelude::{ReadChannels, ReadLayers};
use ndarray::Array2;

/// Reads the reflectances of a spectral EXR and returns the irradiance that an ideal lens of f/4 makes of them under D65.
pub(crate) fn lit_by_d65(path: &std::path::Path) -> SpectralImage {
    let file = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .unwrap();
    let (columns, rows) = (file.layer_data.size.0, file.layer_data.size.1);
    let mut bands: Vec<(f64, Array2<f32>)> = file
        .layer_data
        .channel_data
        .list
        .iter()
        .filter_map(|channel| {
            let name = channel.name.to_string();
            let nm = name.strip_prefix("T.")?.strip_suffix("nm")?.replace(',', ".").parse().ok()?;
            let values = channel.sample_data.values_as_f32().collect();
            Some((nm, Array2::from_shape_vec((rows, columns), values).unwrap()))
        })
        .collect();
    bands.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (centers_nm, planes): (Vec<f64>, Vec<Array2<f32>>) = bands.into_iter().unzip();
    lit(WavelengthGrid::new(centers_nm).unwrap(), planes)
}

/// Returns the irradiance of reflectances, one plane a band, in 1000 lx of D65 behind an ideal lens of f/4.
pub(crate) fn lit(grid: WavelengthGrid, reflectances: Vec<Array2<f32>>) -> SpectralImage {
    // E = π L / (4 N²).
    let white = Illuminant::D65.white_radiance(&grid, 1000.0);
    let planes = reflectances.into_iter().zip(&white).map(|(plane, &radiance)| {
        let factor = (radiance * std::f64::consts::PI / 64.0) as f32;
        plane.mapv(|reflectance| reflectance.max(0.0) * factor)
    });
    SpectralImage::new(Quantity::Irradiance, grid, planes.collect()).unwrap()
}

/// The side of a patch of the chart, pixels.
pub(crate) const PATCH: usize = 24;

/// Returns the 24 patches in 4 rows of 6, lit.
pub(crate) fn chart() -> SpectralImage {
    let grid = WavelengthGrid::uniform(380.0, 730.0, 10.0).unwrap();
    let patches: Vec<Vec<f64>> = color_checker_reflectances().iter().map(|(_, s)| s.sample_held(&grid)).collect();
    let plane = |band: usize| {
        Array2::from_shape_fn((4 * PATCH, 6 * PATCH), |(r, c)| patches[6 * (r / PATCH) + c / PATCH][band] as f32)
    };
    let planes = (0..grid.len()).map(plane).collect();
    lit(grid, planes)
}
