//! What of the light of a point lies beyond the window of its kernel, and how it falls there.

use std::f64::consts::PI;

use dioptric_psf::{FilmQuery, LensImage};
use glam::DVec2;

/// The least width of the cells of the kernel of a point, pixels.
pub(crate) const LEAST_CELL_PX: f64 = 0.125;
/// Points along each side of a pixel at which the halo is looked up.
pub(crate) const POINTS: usize = 8;

/// What lies beyond the windows of kernels in a band.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Beyond {
    /// Share of the light.
    pub(crate) share: f64,
    /// The radii between which the samples of the window fade out, pixels.
    pub(crate) fade_px: [f64; 2],
    /// The part of the share that falls faster than what edges bend.
    steep: f64,
    /// λN, pixels.
    pub(crate) lambda_n_px: f64,
}

impl Beyond {
    /// Of the sharpest of some depths, on the axis. Where windows are wider, off the axis or out of focus, halos are the same from some distance on, and what
    /// is spread within those is less than a hundredth of a blur.
    pub(crate) fn of(
        (lens, wavelength_nm): (&dyn LensImage, f64),
        depths_dioptres: &[f64],
        (pitch_um, widest_px): (f64, f64),
    ) -> Self {
        let radius_px =
            |dioptres: f64| 1e3 * lens.blur_radius_mm(DVec2::ZERO, dioptres, wavelength_nm).abs() / pitch_um;
        let depths = depths_dioptres.iter().map(|dioptres| (radius_px(*dioptres), *dioptres));
        let Some((radius_px, dioptres)) = depths.min_by(|a, b| a.0.total_cmp(&b.0)) else { return Self::default() };
        // On cells as narrow as those of points that shine, whose windows it goes on from.
        let cell_px = LEAST_CELL_PX * (radius_px / widest_px).log2().ceil().max(0.0).exp2();
        let query = FilmQuery { place_mm: DVec2::ZERO, dioptres, wavelength_nm, pitch_um: cell_px * pitch_um };
        let kernel = lens.kernel(query);
        if kernel.lambda_n_px == 0.0 {
            // It holds all that there is, whatever it is scaled by.
            return Self { fade_px: [1.0; 2], ..Self::default() };
        }
        let lambda_n_px = cell_px * kernel.lambda_n_px;
        let [start_px, edge_px] = kernel.fade_px().map(|cells| cell_px * cells);
        let fade_px = [start_px, edge_px].map(|px| px.max(LEAST_RADIUS));
        // An edge bends 2 / π² λN over its radius beyond a circle.
        let bent = 2.0 / (PI * PI) * lambda_n_px * Fade(fade_px).inverse();
        let beyond = 1.0 - kernel.kept_share;
        // What lies between a window within a pixel and the pixel's rim stays there.
        let share = if edge_px < LEAST_RADIUS { beyond.min(bent) } else { beyond };
        Self { share, fade_px, steep: (1.0 - bent / share).clamp(0.0, 1.0), lambda_n_px }
    }

    /// Returns a share of the light that begins at a distance, pixels, all of it bent by edges.
    #[cfg(test)]
    pub(crate) fn from_step(share: f64, start_px: f64, lambda_n_px: f64) -> Self {
        Self { share, fade_px: [start_px; 2], steep: 0.0, lambda_n_px }
    }

    /// Returns the light of a point of light 1 that lies at a distance from it, for a pixel of the film, were the pupil round and nothing else seen.
    pub(crate) fn density(&self) -> impl Fn(f64) -> f64 + use<> {
        let (fade, steep) = (Fade(self.fade_px), self.steep);
        let (bent, steep) = ((1.0 - steep) / (2.0 * PI * fade.inverse()), steep / (2.0 * PI * fade.inverse_cube()));
        move |r: f64| {
            let part = fade.at(r);
            if part > 0.0 { part * (bent * r.powi(-3) + steep * r.powi(-5)) } else { 0.0 }
        }
    }
}

/// The least radius at which a window may begin to fade, pixels: the law of the tail has no middle.
const LEAST_RADIUS: f64 = 0.5;

/// A linear rise from 0 to 1 between two radii: what windows leave to the halo.
#[derive(Clone, Copy)]
struct Fade([f64; 2]);

impl Fade {
    fn at(self, radius: f64) -> f64 {
        let Self([start, end]) = self;
        if end > start { ((radius - start) / (end - start)).clamp(0.0, 1.0) } else { f64::from(radius >= end) }
    }

    /// The integral of the rise over r² by r: 1 / r of a step.
    fn inverse(self) -> f64 {
        let Self([start, end]) = self;
        if end > start * 1.0001 { (end / start).ln() / (end - start) } else { 1.0 / end }
    }

    /// The integral of the rise over r⁴ by r: 1 / 3 r³ of a step.
    fn inverse_cube(self) -> f64 {
        let Self([start, end]) = self;
        if end > start * 1.0001 {
            let (square, cube) = (start.powi(-2) - end.powi(-2), start.powi(-3) - end.powi(-3));
            (0.5 * square - start * cube / 3.0) / (end - start) + end.powi(-3) / 3.0
        } else {
            end.powi(-3) / 3.0
        }
    }
}
