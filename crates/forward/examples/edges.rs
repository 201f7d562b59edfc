//! Draws depth edges, layered and pointwise: `edges OUT_DIR` writes two pictures side by side for three focuses.

use std::path::PathBuf;

use dioptric_forward::{BlurMode, DiscLens, Film, Settings, Source, render};
use dioptric_scene::View;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid, srgb_encode};
use image::{Rgb, RgbImage};
use ndarray::Array2;

const ROWS: usize = 400;
const COLUMNS: usize = 480;

/// Red, green and blue of what stands at a place, and how many dioptres away it is.
fn at(row: usize, column: usize) -> ([f32; 3], f32) {
    let (y, x) = (row as f32, column as f32);
    let checks = |size: usize| if (row / size + column / size).is_multiple_of(2) { 1.0 } else { 0.4 };
    if (x - 130.0).hypot(y - 150.0) < 80.0 {
        return ([0.8, 0.25 * checks(10), 0.15], 34.0);
    }
    if (x - y / 4.0 - 250.0).abs() < 7.0 || (x - 0.3 * y - 330.0).abs() < 1.5 {
        return ([0.2, 0.6, 0.3], 30.0);
    }
    if (x - 380.0).abs() < 60.0 && (y - 260.0).abs() < 60.0 {
        return ([0.25, 0.35 * checks(15), 0.8], 22.0);
    }
    if y > 300.0 {
        // A floor that rises towards the wall.
        let dioptres = 10.0 + 24.0 * (y - 300.0) / 100.0;
        return ([0.6 * checks(20), 0.5 * checks(20), 0.4], dioptres);
    }
    ([0.9 * checks(16), 0.9 * checks(16), 0.8 * checks(16)], 10.0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out: PathBuf = std::env::args().nth(1).ok_or("usage: edges OUT_DIR")?.into();
    std::fs::create_dir_all(&out)?;
    let plane = |band: usize| Array2::from_shape_fn((ROWS, COLUMNS), |(r, c)| at(r, c).0[2 - band]);
    let grid = WavelengthGrid::new(vec![450.0, 550.0, 630.0])?;
    let radiance = SpectralImage::new(Quantity::Radiance, grid, (0..3).map(plane).collect())?;
    let depth = DepthMap::new(Array2::from_shape_fn((ROWS, COLUMNS), |(r, c)| 1.0 / at(r, c).1))?;
    let view = View { focal_px: 1000.0, center_x_px: 239.5, center_y_px: 199.5 };
    let film = Film::centered(ROWS, COLUMNS, 1.0);
    for (name, focus_dioptres) in [("near", 34.0), ("middle", 22.0), ("far", 10.0)] {
        let mut picture = RgbImage::new(2 * COLUMNS as u32, ROWS as u32);
        for (half, mode) in [BlurMode::Pointwise, BlurMode::Layered].into_iter().enumerate() {
            let lens = DiscLens { focus_dioptres, growth: 1.0, ..DiscLens::default() };
            let settings = Settings { mode, ..Settings::default() };
            let source = Source { radiance: &radiance, depth: &depth, view, occluded: None, points: &[] };
            render(&source, &lens, &film, &settings, &|_| {}, &mut |band, irradiance| {
                for ((row, column), &value) in irradiance.indexed_iter() {
                    let Rgb(pixel) = picture.get_pixel_mut((half * COLUMNS + column) as u32, row as u32);
                    pixel[2 - band] = (255.0 * srgb_encode(f64::from(value)).clamp(0.0, 1.0)).round() as u8;
                }
                Ok(())
            })?;
        }
        dioptric_pictures::save(&picture.into(), &out.join(format!("edges_{name}.png")))?;
    }
    Ok(())
}
