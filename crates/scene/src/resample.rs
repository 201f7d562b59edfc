//! Spectral images on other bands, and reflectances under a light.

use dioptric_spectrum::{Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use ndarray::{Array2, Zip};
use rayon::prelude::*;

use crate::SceneError;

/// Returns an image on other bands, as [`Scene::resampled`](crate::Scene::resampled) does.
///
/// # Errors
/// When the center of a new band lies more than half an old band's width beyond the old centers.
pub fn resampled(image: &SpectralImage, grid: &WavelengthGrid) -> Result<SpectralImage, SceneError> {
    if image.grid() == grid {
        return Ok(image.clone());
    }
    let weights = resampling_weights(image.grid(), grid)?;
    let planes = weights.into_par_iter().map(|row| weighted_sum(image, &row)).collect();
    let mut result = SpectralImage::new(image.quantity(), grid.clone(), planes)?;
    if let Some(pitch_um) = image.pitch_um() {
        result = result.with_pitch_um(pitch_um);
    }
    Ok(result)
}

fn weighted_sum(image: &SpectralImage, weights: &[(usize, f64)]) -> Array2<f32> {
    let mut sum = Array2::<f64>::zeros((image.rows(), image.columns()));
    for &(band, weight) in weights {
        Zip::from(&mut sum).and(&image.planes()[band]).for_each(|s, &v| *s += weight * f64::from(v));
    }
    sum.mapv(|v| v as f32)
}

/// Returns for each new band the old bands that it is made of, with their weights, which sum to 1.
pub(crate) fn resampling_weights(
    from: &WavelengthGrid,
    to: &WavelengthGrid,
) -> Result<Vec<Vec<(usize, f64)>>, SceneError> {
    let ((first, last), n) = (from.range_nm(), from.len());
    let half = |band: usize| 0.5 * from.widths_nm()[band];
    let (least, most) = (first - half(0), last + half(n - 1));
    let (new_first, new_last) = to.range_nm();
    // Edges that are sums of decimals.
    if new_first < least - 1e-6 || new_last > most + 1e-6 {
        return Err(SceneError::Setting {
            what: "the range of the bands",
            value: format!("{new_first}–{new_last} nm"),
            expected: format!(
                "centers of {least}–{most} nm: half a band's width at most beyond {first}–{last} nm, its own bands (--wavelengths-nm asks for others)"
            ),
        });
    }
    let bands = to.centers_nm().iter().zip(to.middles_nm()).zip(to.widths_nm());
    Ok(bands
        .map(|((&center, middle), &width)| {
            let old_width = from.widths_nm()[from.nearest(center)];
            // A new band of about the old width takes the line's value; a wider one its mean over the width.
            let n_points = if width <= 1.5 * old_width { 1 } else { (8.0 * width / old_width).ceil() as usize };
            let place = if n_points == 1 { center } else { middle };
            let mut weights = vec![0.0; n];
            for i in 0..n_points {
                let at = place + width * ((i as f64 + 0.5) / n_points as f64 - 0.5);
                let (band, fraction) = bracket(from, at);
                weights[band] += (1.0 - fraction) / n_points as f64;
                if fraction > 0.0 {
                    weights[band + 1] += fraction / n_points as f64;
                }
            }
            weights.into_iter().enumerate().filter(|&(_, w)| w != 0.0).collect()
        })
        .collect())
}

/// Returns the band below a wavelength and how far it is to the next one; ends are held.
fn bracket(grid: &WavelengthGrid, wavelength_nm: f64) -> (usize, f64) {
    let centers = grid.centers_nm();
    let above = centers.partition_point(|&c| c <= wavelength_nm);
    if above == 0 {
        return (0, 0.0);
    }
    if above == centers.len() {
        return (above - 1, 0.0);
    }
    (above - 1, (wavelength_nm - centers[above - 1]) / (centers[above] - centers[above - 1]))
}

/// Returns the radiance of a reflectance under a light: reflectance × the radiance of a perfect white, a value a band.
///
/// # Errors
/// When the image is no reflectance, or `white_radiance` has not one value a band.
pub fn reflectance_under(reflectance: &SpectralImage, white_radiance: &[f64]) -> Result<SpectralImage, SceneError> {
    if reflectance.quantity() != Quantity::Reflectance {
        return Err(SceneError::Setting {
            what: "the quantity to be lit",
            value: reflectance.quantity().unit().to_owned(),
            expected: "a reflectance".to_owned(),
        });
    }
    if white_radiance.len() != reflectance.grid().len() {
        return Err(SceneError::Spectrum(SpectrumError::Shape {
            what: "bands of the light",
            expected: reflectance.grid().len(),
            found: white_radiance.len(),
        }));
    }
    let planes = reflectance
        .planes()
        .par_iter()
        .zip(white_radiance)
        .map(|(plane, &white)| plane.mapv(|v| (f64::from(v) * white) as f32))
        .collect();
    Ok(SpectralImage::new(Quantity::Radiance, reflectance.grid().clone(), planes)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use dioptric_spectrum::{Illuminant, Observer};

    fn ramp(grid: &WavelengthGrid) -> SpectralImage {
        let planes = grid.centers_nm().iter().map(|&nm| Array2::from_elem((2, 2), nm as f32)).collect();
        SpectralImage::new(Quantity::Reflectance, grid.clone(), planes).unwrap()
    }

    #[test]
    fn a_straight_spectrum_stays_straight_on_finer_and_coarser_bands() {
        let image = ramp(&WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap());
        for (first, last, step) in [(400.0, 700.0, 10.0), (405.0, 695.0, 5.0), (450.0, 650.0, 50.0)] {
            let grid = WavelengthGrid::uniform(first, last, step).unwrap();
            let moved = resampled(&image, &grid).unwrap();
            for (value, &nm) in moved.spectrum_at(1, 1).iter().zip(grid.centers_nm()) {
                // Samples are f32: 2⁻²⁴ of 700.
                assert_abs_diff_eq!(*value, nm, epsilon = 5e-5);
            }
        }
    }

    #[test]
    fn a_wide_band_keeps_the_energy_of_a_line() {
        let fine = WavelengthGrid::uniform(400.0, 700.0, 1.0).unwrap();
        let mut image = SpectralImage::zeros(Quantity::Radiance, fine.clone(), 1, 1);
        image.planes_mut().nth(153).unwrap()[(0, 0)] = 1.0;
        let coarse = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
        let moved = resampled(&image, &coarse).unwrap();
        // The mean of the straight-line spectrum is taken at 160 points a band: the line's triangle, 1 nm in
        // area, is caught to a point's width squared.
        assert_abs_diff_eq!(coarse.integrate(&moved.spectrum_at(0, 0)), 1.0, epsilon = 1e-6);
    }

    #[test]
    fn radiance_is_not_made_up_beyond_the_bands() {
        let image = ramp(&WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap());
        let wider = WavelengthGrid::uniform(380.0, 780.0, 10.0).unwrap();
        let message = resampled(&image, &wider).unwrap_err().to_string();
        assert!(message.contains("380–780 nm") && message.contains("395–705 nm: half"), "{message}");
        let just = WavelengthGrid::uniform(395.0, 705.0, 10.0).unwrap();
        assert_eq!(resampled(&image, &just).unwrap().spectrum_at(0, 0)[0], 400.0);
        let beyond = WavelengthGrid::uniform(394.0, 704.0, 10.0).unwrap();
        assert!(resampled(&image, &beyond).is_err());
    }

    #[test]
    fn white_under_a_thousand_lux_has_318_candela() {
        let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap();
        let planes = vec![Array2::from_elem((1, 1), 1.0); grid.len()];
        let white = SpectralImage::new(Quantity::Reflectance, grid.clone(), planes).unwrap();
        let lit = reflectance_under(&white, &Illuminant::D65.white_radiance(&grid, 1000.0)).unwrap();
        let luminance = Observer::Cie1931.xyz(&grid, &lit.spectrum_at(0, 0)).luminance_cd_m2();
        // The luminance of 1000 lx on a perfect diffuser is 1000/π; 5 nm bands are within 0.1 % of 1 nm ones.
        assert_abs_diff_eq!(luminance, 1000.0 / std::f64::consts::PI, epsilon = 0.3);
        assert!(reflectance_under(&lit, &[1.0; 81]).is_err());
        assert!(reflectance_under(&white, &[1.0; 3]).is_err());
    }
}
