//! The peak of a point spread function against that of a perfect lens.

use dioptric_optics::{MonoLens, ObjectPoint};
use glam::DVec2;

use super::{PupilGrid, PupilSamples, WaveWindow, WindowCenter};
use crate::DiffractionError;

/// The peak of a point spread function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Where it is on the film, mm, lens frame.
    pub on_film_mm: DVec2,
    /// Its height over that of the same amplitudes all in phase: the Strehl ratio.
    pub strehl: f64,
}

/// Side of the pixels among which the highest is looked for, in λN: a peak is some two of them wide.
const SEARCH_PIXEL: f64 = 0.4;
/// How far beyond the rays the peak is looked for, in λN.
const BESIDE_RAYS: f64 = 1.5;
/// The highest pixels from which the way up is gone.
const SUMMITS: usize = 3;

impl PupilSamples {
    /// Returns the irradiance at a film point over that of the same amplitudes all in phase.
    pub fn strehl_at(&self, on_film_mm: DVec2) -> f64 {
        self.irradiance_per_mm2(on_film_mm) / self.perfect_peak_per_mm2()
    }

    /// Returns the window that holds all rays and a little more, among whose pixels the peak is.
    fn search_window(&self) -> WaveWindow {
        let (unit_mm, centroid_mm) = (self.airy_unit_mm(), self.centroid_mm());
        let beside = centroid_mm - self.reference_mm;
        let places = self.q_x_mm.iter().zip(&self.q_y_mm).map(|(x, y)| DVec2::new(*x, *y) - beside);
        let spot_mm = places.map(DVec2::length).fold(0.0, f64::max);
        let half = ((spot_mm / unit_mm + BESIDE_RAYS) / SEARCH_PIXEL).ceil() as usize;
        let (pitch_um, n) = (1e3 * SEARCH_PIXEL * unit_mm, 2 * half + 1);
        WaveWindow { pitch_um, rows: n, columns: n, center: WindowCenter::At(centroid_mm) }
    }

    /// Finds the highest point of the point spread function on the film, and the Strehl ratio there.
    ///
    /// It is looked for among pixels as far as rays go and a little more, and from the highest of them by parabolas to 1e-4 λN.
    ///
    /// # Errors
    /// When there are too few nodes for a window of that size.
    pub fn peak(&self) -> Result<Peak, DiffractionError> {
        let unit_mm = self.airy_unit_mm();
        let psf = self.psf(&self.search_window(), None)?;
        let mut pixels: Vec<((usize, usize), f64)> = psf.samples.indexed_iter().map(|(place, e)| (place, *e)).collect();
        let n_summits = SUMMITS.min(pixels.len());
        pixels.select_nth_unstable_by(n_summits - 1, |a, b| b.1.total_cmp(&a.1));
        let summit = |&((row, column), _): &((usize, usize), f64)| {
            let on_film_mm = self.climb(psf.pixel_mm(row, column), unit_mm);
            Peak { on_film_mm, strehl: self.strehl_at(on_film_mm) }
        };
        let summits = pixels[..n_summits].iter().map(summit);
        Ok(summits.max_by(|a, b| a.strehl.total_cmp(&b.strehl)).expect("a window has at least one pixel"))
    }

    /// Finds the peak of a point on the film, `film_distance_mm` behind the last vertex, with as many nodes as its blur needs.
    ///
    /// # Errors
    /// When no light gets through, rays within the pupil are lost, or the blur needs more nodes than a wave sum can have.
    pub fn peak_of(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64) -> Result<Peak, DiffractionError> {
        let mut nodes = Self::trace(lens, point, film_distance_mm, PupilGrid::STANDARD, None)?;
        loop {
            let extent_mm = nodes.search_window().check()?;
            match nodes.finer_grid(extent_mm)? {
                Some(grid) => nodes = Self::trace(lens, point, film_distance_mm, grid, None)?,
                None => return nodes.peak(),
            }
        }
    }

    /// Goes from a point near a summit to the summit.
    fn climb(&self, from_mm: DVec2, unit_mm: f64) -> DVec2 {
        let mut at = from_mm;
        let mut step = 0.125 * unit_mm;
        for _ in 0..8 {
            let here = self.irradiance_per_mm2(at);
            let offset = |direction: DVec2| {
                let (plus, minus) =
                    (self.irradiance_per_mm2(at + direction * step), self.irradiance_per_mm2(at - direction * step));
                let bend = plus - 2.0 * here + minus;
                let shift = if bend < 0.0 { 0.5 * (minus - plus) / bend } else { (plus - minus).signum() };
                direction * (shift.clamp(-1.0, 1.0) * step)
            };
            at += offset(DVec2::X) + offset(DVec2::Y);
            step *= 0.5;
        }
        at
    }
}
