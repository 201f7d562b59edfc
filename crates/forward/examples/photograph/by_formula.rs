//! A scene by formula: discs and bars at several depths over a floor, before a chequered wall.

use dioptric_scene::{Scene, View};
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use ndarray::Array2;

/// Tangent of half the horizontal field.
const HALF_WIDTH: f64 = 0.3;

/// Depth in metres, brightness and hue (the wavelength reflected best, nm) of what is seen in a direction.
fn at(tan_x: f64, tan_y: f64) -> (f64, f64, f64) {
    let checks = |size: f64| {
        let odd = (tan_x / size).floor() + (tan_y / size).floor();
        if odd.rem_euclid(2.0) < 1.0 { 1.0 } else { 0.4 }
    };
    for (x, y, radius, depth_m, hue_nm) in
        [(-0.12, 0.02, 0.06, 1.0, 620.0), (0.02, -0.02, 0.05, 1.5, 530.0), (0.15, 0.05, 0.04, 2.2, 460.0)]
    {
        if (tan_x - x).hypot(tan_y - y) < radius {
            return (depth_m, checks(0.008), hue_nm);
        }
    }
    if (tan_x - 0.3 * tan_y - 0.07).abs() < 0.004 || (tan_x + 0.2 * tan_y + 0.22).abs() < 0.001 {
        return (1.2, 0.9, 580.0);
    }
    // A floor half a metre below the lens, and a wall at 4 m.
    let floor_m = if tan_y < 0.0 { -0.3 / tan_y } else { f64::INFINITY };
    if floor_m < 4.0 {
        return (floor_m, checks(0.02), 600.0);
    }
    (4.0, checks(0.015), 500.0)
}

/// Returns the scene on a film's worth of samples.
pub(crate) fn scene(rows: usize, columns: usize, grid: &WavelengthGrid) -> Result<Scene, SpectrumError> {
    let view = View {
        focal_px: 0.5 * columns as f64 / HALF_WIDTH,
        center_x_px: 0.5 * (columns as f64 - 1.0),
        center_y_px: 0.5 * (rows as f64 - 1.0),
    };
    let seen = Array2::from_shape_fn((rows, columns), |(row, column)| {
        let (x, y) = view.tan_at(row as f64, column as f64);
        at(x, y)
    });
    let plane = |&wavelength_nm: &f64| {
        seen.mapv(|(_, bright, hue_nm)| {
            let off = (wavelength_nm - hue_nm) / 60.0;
            (0.1 * bright * (0.2 + (-0.5 * off * off).exp())) as f32
        })
    };
    let planes = grid.centers_nm().iter().map(plane).collect();
    let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?;
    let depth = DepthMap::new(seen.mapv(|(z_m, ..)| z_m as f32))?;
    Ok(Scene { depth: Some(depth), view: Some(view), ..Scene::new("by formula", radiance) })
}
