//! A view imaged on parts of pixels, whose mean is what falls on a pixel.
//!
//! `forward` takes what a pixel sees for spread evenly over it: on pixels much wider than the samples of a view, light keeps its
//! place to about a quarter of a pixel, which shows where a source is small and hardly blurred.

use std::ops::RangeInclusive;

use dioptric_pipeline::{Camera, Crop, FilmSpec, Irradiance, PipelineError};
use dioptric_spectrum::{Bands, SpectralImage};
use ndarray::Array2;

/// Parts of a pixel each way; where more were needed the film has hardly any pixels.
const PARTS: RangeInclusive<usize> = 1..=16;

/// Returns in how many parts each way a pixel of a camera's film is imaged: so many that the samples of the view, so many
/// across, which is no narrower than what the film sees, are no finer than they are.
pub(super) fn parts_of_pixels(camera: &Camera, columns_of_view: usize) -> Result<usize, PipelineError> {
    let Some((columns, ..)) = pixels(camera)? else { return Ok(1) };
    Ok(columns_of_view.div_ceil(columns.max(1)).clamp(*PARTS.start(), *PARTS.end()))
}

/// Returns columns, rows and pitch, µm, of a camera's film; `None` where its pixels are the samples of the scene.
fn pixels(camera: &Camera) -> Result<Option<(usize, usize, f64)>, PipelineError> {
    Ok(match camera.film {
        FilmSpec::Pixels { columns, rows, pitch_um } => Some((columns, rows, pitch_um)),
        FilmSpec::Sensor => {
            let sensor = camera.sensor.open()?;
            Some((sensor.columns, sensor.rows, sensor.pixel_pitch_um))
        }
        FilmSpec::Scene => None,
    })
}

/// Returns a camera's film, and the part of it that is simulated, with pixels divided in so many each way.
pub(super) fn divided(camera: &Camera, parts: usize) -> Result<(FilmSpec, Option<Crop>), PipelineError> {
    let Some((columns, rows, pitch_um)) = pixels(camera)?.filter(|_| parts > 1) else {
        return Ok((camera.film, camera.crop));
    };
    let film = FilmSpec::Pixels { columns: parts * columns, rows: parts * rows, pitch_um: pitch_um / parts as f64 };
    let finer = |Crop { x, y, columns, rows }: Crop| Crop {
        x: parts * x,
        y: parts * y,
        columns: parts * columns,
        rows: parts * rows,
    };
    Ok((film, camera.crop.map(finer)))
}

/// Returns the means over pixels of so many parts each way.
pub(super) fn means_over_pixels(of_parts: &Irradiance, parts: usize) -> Result<SpectralImage, PipelineError> {
    let (grid, n) = (of_parts.grid().clone(), (parts * parts) as f64);
    let mean = |band: usize| -> Result<Array2<f32>, PipelineError> {
        let plane = of_parts.band(band)?;
        let pixels = plane.exact_chunks((parts, parts));
        let size = (plane.nrows() / parts, plane.ncols() / parts);
        let means = pixels.into_iter().map(|pixel| (pixel.iter().map(|&v| f64::from(v)).sum::<f64>() / n) as f32);
        Ok(Array2::from_shape_vec(size, means.collect()).expect("a mean for each pixel"))
    };
    let planes = (0..grid.len()).map(mean).collect::<Result<Vec<_>, _>>()?;
    Ok(SpectralImage::new(of_parts.quantity(), grid, planes)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_no_wider_than_samples_of_the_view() {
        let mut camera = Camera::demo().unwrap();
        camera.film = FilmSpec::Pixels { columns: 180, rows: 120, pitch_um: 176.0 };
        camera.crop = Some(Crop { x: 10, y: 20, columns: 30, rows: 40 });
        assert_eq!(parts_of_pixels(&camera, 1080).unwrap(), 6);
        assert_eq!(parts_of_pixels(&camera, 181).unwrap(), 2);
        assert_eq!(parts_of_pixels(&camera, 90).unwrap(), 1);
        let film = FilmSpec::Pixels { columns: 1080, rows: 720, pitch_um: 176.0 / 6.0 };
        let crop = Crop { x: 60, y: 120, columns: 180, rows: 240 };
        assert_eq!(divided(&camera, 6).unwrap(), (film, Some(crop)));
        // The film has the width that it had.
        assert_eq!(divided(&camera, 1).unwrap(), (camera.film, camera.crop));
        camera.film = FilmSpec::Scene;
        assert_eq!(parts_of_pixels(&camera, 1080).unwrap(), 1);
    }
}
