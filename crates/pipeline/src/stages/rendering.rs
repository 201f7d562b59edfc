//! A rendering in numbers and as a picture.

use std::path::{Path, PathBuf};

use dioptric_backward::Rendering;
use dioptric_spectrum::SpectralImage;
use dioptric_world::World;
use image::RgbImage;
use ndarray::Array2;
use serde::Serialize;

use crate::{PipelineError, WorldSpec, display::LinearRgb};

/// A rendering in brief.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RenderingSummary {
    /// Where the world came from.
    pub world: PathBuf,
    /// The unit of its samples.
    pub unit: &'static str,
    /// Columns and rows of pixels.
    pub size: (usize, usize),
    /// Centers of its bands, nm.
    pub wavelengths_nm: Vec<f64>,
    /// The mean of each band.
    pub mean: Vec<f64>,
    /// The rms standard error of a pixel in each band, as a share of the band's mean, both over the pixels that light reaches; none
    /// after a single pass.
    pub relative_standard_error: Option<Vec<f64>>,
    /// Samples a pixel, in the mean.
    pub samples_per_pixel: f64,
    /// The names of its objects, which `object` of `auxiliary.exr` counts from 1.
    pub objects: Vec<String>,
    /// What of the world's file is not supported, and what stands in its place.
    pub notes: Vec<String>,
}

impl RenderingSummary {
    /// Sums up a rendering of a world.
    pub fn of(rendering: &Rendering, world: &World, spec: &WorldSpec) -> Self {
        let picture = &rendering.picture;
        let n = (picture.rows() * picture.columns()) as f64;
        let mean_of =
            |plane: &Array2<f32>, power: i32| plane.iter().map(|&v| f64::from(v).powi(power)).sum::<f64>() / n;
        let mean: Vec<f64> = picture.planes().iter().map(|plane| mean_of(plane, 1)).collect();
        let n_lit = n_lit(picture) as f64;
        let error = |(plane, &mean): (&Array2<f32>, &f64)| match mean > 0.0 {
            true => (mean_of(plane, 2) * n / n_lit).sqrt() / (mean * n / n_lit),
            false => 0.0,
        };
        let errors: Vec<f64> = rendering.standard_error.planes().iter().zip(&mean).map(error).collect();
        Self {
            world: spec.file.clone(),
            unit: picture.quantity().unit(),
            size: (picture.columns(), picture.rows()),
            wavelengths_nm: picture.grid().centers_nm().to_vec(),
            relative_standard_error: errors.iter().any(|&error| error > 0.0).then_some(errors),
            mean,
            samples_per_pixel: rendering.n_samples.iter().map(|&n| f64::from(n)).sum::<f64>() / n,
            objects: world.object_names().to_vec(),
            notes: world.notes().to_vec(),
        }
    }
}

/// How many pixels have light in any band.
fn n_lit(picture: &SpectralImage) -> usize {
    let (rows, columns) = (picture.rows(), picture.columns());
    let is_lit = |pixel: &usize| {
        let place = (pixel / columns, pixel % columns);
        picture.planes().iter().any(|plane| plane[place] > 0.0)
    };
    (0..rows * columns).filter(is_lit).count()
}

/// Writes a picture as the standard observer sees it, its brightest per cent white and each sample so many pixels wide and
/// high.
///
/// # Errors
/// When the file cannot be written.
pub fn write_seen_png(picture: &SpectralImage, magnification: usize, path: &Path) -> Result<(), PipelineError> {
    let seen = LinearRgb::of_image(picture).within_gamut();
    let white = seen.level_at(0.99).max(f64::MIN_POSITIVE);
    let small = seen.to_srgb(white);
    let times = magnification.max(1) as u32;
    let (width, height) = (small.width() * times, small.height() * times);
    let shown = RgbImage::from_fn(width, height, |x, y| *small.get_pixel(x / times, y / times));
    let png = dioptric_pictures::encode_rgb8_png(&shown, (width as usize, height as usize))
        .map_err(|e| PipelineError::Png { reason: e.to_string() })?;
    Ok(dioptric_files::write(path, &png)?)
}
