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

/// In how many parts each way a pixel of film is imaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Parts {
    pub(super) n: usize,
    /// As many as would be no wider than the samples of the view.
    pub(super) wanted: usize,
}

impl Parts {
    /// Returns the parts of the pixels of a camera's film: so many that the samples of the view, so many across, which is no
    /// narrower than what the film sees, are no finer than they are, if that is not too many.
    pub(super) fn of(camera: &Camera, columns_of_view: usize) -> Result<Self, PipelineError> {
        let wanted = pixels(camera)?.map_or(1, |(columns, ..)| columns_of_view.div_ceil(columns.max(1)));
        Ok(Self { n: wanted.clamp(*PARTS.start(), *PARTS.end()), wanted })
    }

    /// Returns what is to be known of a view that is finer than the parts.
    pub(super) fn note(&self) -> Option<String> {
        let Self { n, wanted } = self;
        (wanted > n).then(|| {
            format!(
                "the view has {wanted} samples across for a pixel and is imaged on {n} parts: light keeps its place to about a \
                 quarter of a part, which shows where a source is smaller than one"
            )
        })
    }
}

/// Returns columns, rows and pitch, µm, of a camera's film; `None` where its pixels are the samples of the scene.
fn pixels(camera: &Camera) -> Result<Option<(usize, usize, f64)>, PipelineError> {
    Ok(match camera.film {
        FilmSpec::Pixels { columns, rows, pitch_um } => Some((columns, rows, pitch_um)),
        FilmSpec::Sensor => {
            let sensor = camera.sensor.open()?;
            Some((sensor.columns, sensor.rows, sensor.pixel_pitch_um))
        }
        FilmSpec::Scene | FilmSpec::Field => None,
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
        let of = |camera: &Camera, columns: usize| Parts::of(camera, columns).unwrap();
        for (columns, n) in [(1080, 6), (181, 2), (90, 1)] {
            assert_eq!((of(&camera, columns).n, of(&camera, columns).note()), (n, None));
        }
        assert_eq!(of(&camera, 180 * 17), Parts { n: 16, wanted: 17 });
        assert!(of(&camera, 180 * 17).note().unwrap().contains("17 samples"));
        let film = FilmSpec::Pixels { columns: 1080, rows: 720, pitch_um: 176.0 / 6.0 };
        let crop = Crop { x: 60, y: 120, columns: 180, rows: 240 };
        assert_eq!(divided(&camera, 6).unwrap(), (film, Some(crop)));
        // The film has the width that it had.
        assert_eq!(divided(&camera, 1).unwrap(), (camera.film, camera.crop));
        camera.film = FilmSpec::Scene;
        assert_eq!(of(&camera, 1080).n, 1);
    }
}
