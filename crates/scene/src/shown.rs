//! A picture on a display, as the scene that it is.

use std::path::Path;

use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::{Array2, Array3};
use rayon::prelude::*;

use crate::{
    DisplayModel, Scene, SceneError, View,
    formats::{check_made, decode_picture},
};

/// What a pixel takes as codes, of 16 bits and as single floats, bytes.
const CODES_BYTES: u64 = 18;

impl DisplayModel {
    /// Returns the scene that a PNG, JPEG or TIFF file is on this display at a distance, m: radiance, depth and view.
    ///
    /// # Errors
    /// When the file is no such picture, or as [`show`](Self::show).
    pub fn show_file(&self, path: &Path, grid: &WavelengthGrid, distance_m: f64) -> Result<Scene, SceneError> {
        let n = self.pixels.samples() as u64;
        let picture = decode_picture(path, CODES_BYTES + n * n * 4 * grid.len() as u64)?.into_rgb16();
        let (columns, rows) = (picture.width() as usize, picture.height() as usize);
        let codes = picture.into_raw().into_iter().map(|code| f32::from(code) / 65535.0).collect();
        let codes = Array3::from_shape_vec((rows, columns, 3), codes).expect("three codes a pixel");
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        self.show(&name, &codes, grid, distance_m)
    }

    /// Returns the scene that codes, rows × columns × (red, green, blue) of 0–1, are on this display at a distance, m.
    ///
    /// Pixels of stripes are three samples wide and high. The display stands upright before the camera, its middle on the axis; it
    /// sends the same radiance to all sides.
    ///
    /// # Errors
    /// When the display's numbers make no sense, its bands do not tell the primaries apart, the distance is not above 0, or the scene
    /// would be larger than memory allows.
    pub fn show(
        &self,
        name: &str,
        codes: &Array3<f32>,
        grid: &WavelengthGrid,
        distance_m: f64,
    ) -> Result<Scene, SceneError> {
        self.check()?;
        if !(distance_m > 0.0 && distance_m.is_finite()) {
            return Err(SceneError::Setting {
                what: "the distance of the display",
                value: format!("{distance_m} m"),
                expected: "a finite number above 0".to_owned(),
            });
        }
        let n = self.pixels.samples();
        let (rows, columns) = (n * codes.dim().0, n * codes.dim().1);
        if rows * columns == 0 {
            return Err(SceneError::Setting {
                what: "the samples of a shown picture",
                value: format!("{columns} × {rows}"),
                expected: "some".to_owned(),
            });
        }
        check_made(Path::new(name), (rows as u64 * columns as u64).saturating_mul(4 * grid.len() as u64))?;
        let primaries = self.primaries_on(grid)?;
        let drive = self.drives(codes);
        let plane = |band: usize| {
            let of = [0, 1, 2].map(|p| primaries[p][band]);
            Array2::from_shape_fn((rows, columns), |(row, column)| {
                let pixel = [0, 1, 2].map(|p| f64::from(drive[(row / n, column / n, p)]));
                (0..3).map(|p| of[p] * pixel[p] * self.pixels.share(column % n, p)).sum::<f64>() as f32
            })
        };
        let planes = (0..grid.len()).into_par_iter().map(plane).collect();
        let mut scene = Scene::new(name, SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?);
        scene.depth = Some(DepthMap::new(Array2::from_elem((rows, columns), distance_m as f32))?);
        scene.view = Some(View {
            focal_px: distance_m / (1e-6 * self.pixel_pitch_um) * n as f64,
            center_x_px: 0.5 * (columns as f64 - 1.0),
            center_y_px: 0.5 * (rows as f64 - 1.0),
        });
        scene.validate()?;
        Ok(scene)
    }

    /// Returns codes as an eye sees them that takes the display's white for white: linear sRGB, not clipped.
    pub fn seen(&self, codes: &Array3<f32>) -> Array3<f32> {
        let matrix = self.srgb_from_drive();
        let mut seen = self.drives(codes);
        let pixels = seen.as_slice_mut().expect("a new array is contiguous").par_chunks_exact_mut(3);
        pixels.for_each(|pixel| {
            let drive = [0, 1, 2].map(|i| f64::from(pixel[i]));
            let rgb = matrix.map(|row| row.iter().zip(drive).map(|(m, v)| m * v).sum::<f64>());
            pixel.iter_mut().zip(rgb).for_each(|(value, light)| *value = light as f32);
        });
        seen
    }

    /// Returns the share of full drive of codes.
    fn drives(&self, codes: &Array3<f32>) -> Array3<f32> {
        let mut drives = codes.as_standard_layout().into_owned();
        let pixels = drives.as_slice_mut().expect("an array in standard layout is contiguous").par_chunks_exact_mut(3);
        pixels.for_each(|pixel| {
            let drive = self.drive([0, 1, 2].map(|i| f64::from(pixel[i])));
            pixel.iter_mut().zip(drive).for_each(|(value, drive)| *value = drive as f32);
        });
        drives
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DisplayCurve, PixelLayout};

    fn codes() -> Array3<f32> {
        Array3::from_shape_fn((2, 3, 3), |(row, column, channel)| 0.1 * (1 + row + 2 * column + channel) as f32)
    }

    #[test]
    fn white_has_the_luminance_of_the_display_and_grays_follow_its_curve() {
        let display = DisplayModel::built_in("rec2020").unwrap();
        let grid = WavelengthGrid::uniform(400.0, 700.0, 5.0).unwrap();
        for code in [1.0, 0.5] {
            let scene = display.show("gray", &Array3::from_elem((2, 2, 3), code), &grid, 0.5).unwrap();
            let wanted = 100.0 * f64::from(code).powf(2.4);
            // What narrow bands would need of negative light.
            assert!((scene.mean_luminance_cd_m2() / wanted - 1.0).abs() < 0.01, "{}", scene.mean_luminance_cd_m2());
        }
    }

    #[test]
    fn the_scene_is_where_the_display_is() {
        let display = DisplayModel { pixel_pitch_um: 250.0, ..DisplayModel::built_in("srgb").unwrap() };
        let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
        let scene = display.show("test", &codes(), &grid, 0.5).unwrap();
        assert_eq!((scene.rows(), scene.columns()), (2, 3));
        assert_eq!(scene.depth.as_ref().unwrap().range_m(), (0.5, 0.5));
        // The middles of the outer pixels of three are .25 mm from the axis.
        let (right, up) = scene.view.unwrap().tan_at(0.5, 2.0);
        assert!((right - 0.25e-3 / 0.5).abs() < 1e-12 && up == 0.0);
    }

    #[test]
    fn stripes_send_the_light_of_even_pixels() {
        let even = DisplayModel::built_in("apple-studio").unwrap();
        let striped = DisplayModel { pixels: PixelLayout::Stripes, ..even.clone() };
        let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
        let [even, striped] = [even, striped].map(|display| display.show("test", &codes(), &grid, 1.0).unwrap());
        assert_eq!((striped.rows(), striped.columns()), (6, 9));
        assert!((striped.view.unwrap().focal_px / even.view.unwrap().focal_px - 3.0).abs() < 1e-12);
        let binned = striped.binned(3).unwrap();
        for band in 0..grid.len() {
            for (a, b) in binned.radiance.planes()[band].iter().zip(&even.radiance.planes()[band]) {
                assert!((a - b).abs() <= 1e-5 * b.abs(), "{a} {b}");
            }
        }
    }

    #[test]
    fn what_cannot_be_shown_is_refused() {
        let display = DisplayModel::built_in("srgb").unwrap();
        let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
        for distance_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(display.show("test", &codes(), &grid, distance_m).is_err());
        }
        let wrong = DisplayModel { curve: DisplayCurve::Gamma(0.0), ..display };
        assert!(wrong.show("test", &codes(), &grid, 1.0).is_err());
    }
}
