//! Point spread functions of light of many wavelengths.

use dioptric_optics::{Lens, ObjectPoint};
use glam::DVec2;

use super::{PupilGrid, PupilSamples, WavePsf, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use crate::DiffractionError;

/// Returns the point spread function of light made up of wavelengths (nm) with these weights, which need no
/// particular sum.
///
/// The weights are those of the light on the film: they hold the source, the lens's transmission and the sensor's
/// response, and how much light the pupil takes in at each wavelength ([`PupilSamples::collected`]) if that differs. A
/// window on the centroid is on that of all of it.
///
/// # Errors
/// When there is no weight above 0, or one below, and for what ails a single wavelength.
pub fn polychromatic_psf(
    lens: &Lens,
    point: &ObjectPoint,
    film_distance_mm: f64,
    window: &WaveWindow,
    spectrum: &[(f64, f64)],
    quality: WaveQuality,
) -> Result<WavePsf, DiffractionError> {
    let total: f64 = spectrum.iter().map(|(_, weight)| weight).sum();
    if !(total > 0.0 && total.is_finite()) || spectrum.iter().any(|(_, weight)| *weight < 0.0) {
        return Err(DiffractionError::Weights);
    }
    let mut centroid_mm = DVec2::ZERO;
    for &(wavelength_nm, weight) in spectrum {
        let nodes = PupilSamples::trace(&lens.at(wavelength_nm)?, point, film_distance_mm, PupilGrid::STANDARD, None)?;
        centroid_mm += nodes.centroid_mm() * (weight / total);
    }
    let center_mm = window.center.on_film_mm(|| centroid_mm);
    let window = WaveWindow { center: WindowCenter::At(center_mm), ..*window };
    let mut sum: Option<WavePsf> = None;
    for &(wavelength_nm, weight) in spectrum {
        let mut psf = wave_psf(&lens.at(wavelength_nm)?, point, film_distance_mm, &window, quality)?;
        psf.samples *= weight / total;
        match &mut sum {
            None => sum = Some(psf),
            Some(sum) => {
                sum.samples += &psf.samples;
                sum.n_nodes = sum.n_nodes.max(psf.n_nodes);
                sum.bandwidth = sum.bandwidth.max(psf.bandwidth);
                sum.points_per_pixel = sum.points_per_pixel.max(psf.points_per_pixel);
            }
        }
    }
    let mut sum = sum.ok_or(DiffractionError::Weights)?;
    sum.captured = sum.samples.sum();
    sum.centroid_mm = centroid_mm;
    Ok(sum)
}
