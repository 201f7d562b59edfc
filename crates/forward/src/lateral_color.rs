//! How far the bands of a lens lie from each other on the film.

use dioptric_psf::LensImage;
use dioptric_spectrum::WavelengthGrid;
use glam::DVec2;
use rayon::prelude::*;

use crate::Film;

/// How far the bands of a lens lie from each other on the film.
pub(crate) struct LateralColor<'a> {
    pub(crate) lens: &'a dyn LensImage,
    pub(crate) film: &'a Film,
    pub(crate) grid: &'a WavelengthGrid,
    pub(crate) extent_mm: f64,
}

impl LateralColor<'_> {
    /// Returns bands, `kernel_bands` among them, between which every point of the film moves by at most `step_px`, and by a
    /// fixed share of that at most off an even motion.
    pub(crate) fn knots(&self, kernel_bands: &[usize], dioptres: (f64, f64), step_px: f64) -> Vec<usize> {
        let fields = |&nm: &f64| self.fields_tan(nm, dioptres);
        let fields: Vec<Vec<DVec2>> = self.grid.centers_nm().par_iter().map(fields).collect();
        let step_tan = step_px * self.tan_per_px(dioptres.0);
        let mut knots = vec![0];
        for band in 1..fields.len() {
            let last = knots[knots.len() - 1];
            let is_kernel_band = kernel_bands.binary_search(&(band - 1)).is_ok();
            if band - last > 1 && (is_kernel_band || !is_even(&fields[last..=band], step_tan)) {
                knots.push(band - 1);
            }
        }
        if fields.len() > 1 {
            knots.push(fields.len() - 1);
        }
        knots
    }

    fn tan_per_px(&self, dioptres: f64) -> f64 {
        let (pitch_mm, nm) = (1e-3 * self.film.pitch_um, self.grid.centers_nm()[self.grid.len() / 2]);
        self.lens.film_map(dioptres, nm, self.extent_mm).tan_per_mm(pitch_mm) * pitch_mm
    }

    /// The fields that places all over the film see at a wavelength, at the ends of a range of depths.
    fn fields_tan(&self, wavelength_nm: f64, dioptres: (f64, f64)) -> Vec<DVec2> {
        let half_mm = 0.5e-3 * self.film.pitch_um * DVec2::new(self.film.columns as f64, self.film.rows as f64);
        let parts = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let of = |dioptres: f64| {
            let map = self.lens.film_map(dioptres, wavelength_nm, self.extent_mm);
            let place = move |down: f64| parts.map(|across| DVec2::new(across, down) * half_mm);
            parts.into_iter().flat_map(place).map(move |place_mm| map.field_tan(place_mm)).collect::<Vec<_>>()
        };
        [of(dioptres.0), of(dioptres.1)].concat()
    }
}

/// The largest distance from an even motion, as a share of the largest motion.
const UNEVEN: f64 = 0.04;

/// Whether points, band by band, move by at most a step, and evenly.
fn is_even(bands: &[Vec<DVec2>], step: f64) -> bool {
    let last = bands.len() - 1;
    let (start, end) = (&bands[0], &bands[last]);
    (1..=last).all(|band| {
        let fraction = band as f64 / last as f64;
        (0..start.len()).all(|i| {
            let even = start[i].lerp(end[i], fraction);
            bands[band][i].distance(start[i]) <= step && bands[band][i].distance(even) <= UNEVEN * step
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_kept_where_points_turn_back() {
        let points = |x: f64| vec![DVec2::ZERO, DVec2::new(x, 0.0)];
        let motion = |xs: &[f64]| xs.iter().map(|&x| points(x)).collect::<Vec<_>>();
        assert!(is_even(&motion(&[0.0, 0.1, 0.2]), 0.25));
        assert!(is_even(&motion(&[0.0, 0.109, 0.2]), 0.25));
        assert!(!is_even(&motion(&[0.0, 0.111, 0.2]), 0.25), "uneven");
        assert!(!is_even(&motion(&[0.0, 0.15, 0.3]), 0.25), "far");
        assert!(!is_even(&motion(&[0.0, 0.1, 0.0]), 0.25), "there and back");
        assert!(!is_even(&motion(&[0.0, 0.1]), 0.0));
    }
}
