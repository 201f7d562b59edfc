//! How much memory imaging may take.

use dioptric_forward::ImagingPlan;
use dioptric_scene::Scene;

use super::{film::FilmPlace, irradiance::STRIP_BYTES};
use crate::PipelineError;

/// What the program takes before it has a scene: code, tables, the lens and its rays, bytes.
const PROGRAM_BYTES: u64 = 48 << 20;

/// What the image of the lens keeps for a band, bytes: its pupils over the film and its bundles of rays. Measured on 16 bands of
/// the double Gauss: 82 MiB.
const LENS_BAND_BYTES: u64 = 6 << 20;

/// What is summed up of the irradiance while it is imaged, for a pixel of the film, bytes: its colors, kept to the end.
const SEEN_BYTES: u64 = 12;

/// What the stages after the irradiance take for a pixel of a film of one plane, its colors included, bytes: electrons, volts, codes, channels and
/// light; and for each plane more.
const FILM_BYTES: u64 = 62;
const PLANE_BYTES: u64 = 19;

/// What is beside the frames that are merged for a plane, bytes, and for each frame, all planes and one being merged.
const MERGED_BYTES: u64 = 25;
const CODE_BYTES: u64 = 2;
const MERGING_BYTES: u64 = 4;

/// What a picture takes for a sample while it is rendered, bytes: sums of its means and of their squares, and the picture; and for a pixel more.
const RENDERED_BYTES: u64 = 20;
const RENDERED_PIXEL_BYTES: u64 = 8;

/// Rows of all bands that are one block of `irradiance.exr`.
const BLOCK_ROWS: u64 = 32;

/// What bands in flight and kept kernels take where nobody counts, bytes.
const USUAL_BYTES: u64 = 256 << 20;

/// The memory that a capture may take: the program, then scene, plan and bands that are worked on, then the frames of the film and the
/// picture. Scene and plan make room for frames where both do not fit.
///
/// The file of a scene takes memory of its own while it is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MemoryBudget {
    bytes: u64,
    /// What the stages after the irradiance take for a pixel of the film, bytes.
    pixel_bytes: u64,
}

/// How a budget is shared out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shares {
    bands: u64,
    kernels: u64,
    /// For irradiance that stays in memory.
    irradiance: u64,
}

impl MemoryBudget {
    /// Returns the budget of a capture of a single frame of one plane.
    pub(crate) fn new(bytes: u64) -> Self {
        Self { bytes, pixel_bytes: FILM_BYTES }
    }

    /// Returns the budget of a capture of frames that are merged, each of several planes: of stacked filters, or read photodiode by photodiode.
    ///
    /// Measured on 3 megapixels: 32 frames took 212 bytes a pixel, 8 took 68, three planes 100, 16 frames of three planes 215.
    pub(crate) fn with_frames(self, frames: usize, planes: usize) -> Self {
        let (frames, planes) = (frames as u64, planes.max(1) as u64);
        let single = FILM_BYTES + PLANE_BYTES * (planes - 1);
        let merged = MERGED_BYTES * planes + frames * (CODE_BYTES * planes + MERGING_BYTES);
        Self { pixel_bytes: if frames > 1 { single.max(merged) } else { single }, ..self }
    }

    /// Returns what the stages after an irradiance of so many bands take, bytes.
    fn film_bytes(self, place: &FilmPlace, n_bands: usize) -> u64 {
        self.pixel_bytes * (place.rows * place.columns) as u64 + written_bytes(place.columns, n_bands)
    }

    /// Checks that a scene and its film fit before the lens is traced.
    ///
    /// # Errors
    /// Says the least that would do, as far as that is known.
    pub(crate) fn check(self, scene: &Scene, place: &FilmPlace) -> Result<(), PipelineError> {
        let samples = (scene.rows() * scene.columns()).max(place.rows * place.columns) as u64;
        self.left(imaging_bytes(scene, place), 16 * samples, self.film_bytes(place, n_bands(scene))).map(|_| ())
    }

    /// Checks that a world fits that is rendered as so many rows and columns, in some layers one after the other.
    ///
    /// # Errors
    /// Says the least that would do.
    pub(crate) fn check_rendering(
        self,
        (rows, columns): (usize, usize),
        n_bands: usize,
        n_layers: u32,
    ) -> Result<(), PipelineError> {
        let (n_pixels, n_bands) = ((rows * columns) as u64, n_bands as u64);
        let first = u64::from(n_layers.saturating_sub(1)) * 4 * n_bands * n_pixels;
        self.left(first + (RENDERED_BYTES * n_bands + RENDERED_PIXEL_BYTES) * n_pixels, 0, 0).map(|_| ())
    }

    /// As [`check_rendering`](Self::check_rendering), of a picture on a film.
    pub(crate) fn check_rendering_on(self, place: &FilmPlace, n_bands: usize) -> Result<(), PipelineError> {
        self.check_rendering((place.rows, place.columns), n_bands, 1)?;
        self.left(0, 0, self.film_bytes(place, n_bands)).map(|_| ())
    }

    /// Returns the plan with bands in flight and kept kernels that fit.
    ///
    /// # Errors
    /// Says the least that would do.
    pub(crate) fn fit(self, plan: ImagingPlan, scene: &Scene, place: &FilmPlace) -> Result<ImagingPlan, PipelineError> {
        // What is kept by now is computed again where there is room for it.
        let plan = plan.with_kernel_budget(0);
        let shares = self.shares(&plan, scene, place)?;
        let plan = plan.with_kernel_budget(shares.kernels.min(USUAL_BYTES) as usize);
        // Where there is room for what is usual, it stays as usual.
        let is_tight = shares.bands < USUAL_BYTES.max(4 * plan.band_bytes() as u64);
        Ok(if is_tight { plan.with_band_budget(shares.bands as usize) } else { plan })
    }

    /// Whether a plan twice as large would fit too.
    pub(crate) fn would_fit_twice(self, plan: &ImagingPlan, scene: &Scene, place: &FilmPlace) -> bool {
        let band = plan.band_bytes() as u64;
        let fixed = imaging_bytes(scene, place) + 2 * plan.size_bytes() as u64;
        self.left(fixed, 2 * band, self.film_bytes(place, n_bands(scene))).is_ok()
    }

    /// Returns the bytes of irradiance that may stay in memory.
    ///
    /// # Errors
    /// Says the least that would do.
    pub(crate) fn irradiance_bytes(
        self,
        plan: &ImagingPlan,
        scene: &Scene,
        place: &FilmPlace,
    ) -> Result<u64, PipelineError> {
        Ok(self.shares(plan, scene, place)?.irradiance)
    }

    /// Whether so many bytes can stay in memory while frames are taken and developed.
    pub(crate) fn holds(self, bytes: u64, place: &FilmPlace, n_bands: usize) -> bool {
        bytes <= self.left_beside_film(place, n_bands, 0)
    }

    /// Whether so many bytes are a small part, beside which nothing need be counted.
    pub(crate) fn is_ample_for(self, bytes: u64) -> bool {
        4 * bytes <= self.bytes
    }

    /// Returns the bytes that are left beside what becomes of an irradiance, and beside others that are taken.
    pub(crate) fn left_beside_film(self, place: &FilmPlace, n_bands: usize, taken_bytes: u64) -> u64 {
        self.bytes.saturating_sub(PROGRAM_BYTES + taken_bytes + self.film_bytes(place, n_bands))
    }

    /// Half of what scene and plan leave is for bands in flight, a quarter each for kernels and irradiance;
    /// kernels and bands take no more than is usual, and irradiance no more than the stages after it leave. Where the irradiance does not fit and goes
    /// to a file, its quarter is left to the allocator, which holds a tenth more than the many kernels are.
    fn shares(self, plan: &ImagingPlan, scene: &Scene, place: &FilmPlace) -> Result<Shares, PipelineError> {
        let band = plan.band_bytes() as u64;
        let film = self.film_bytes(place, n_bands(scene));
        let left = self.left(imaging_bytes(scene, place) + plan.size_bytes() as u64, band, film)?;
        let bands = (left / 2).clamp(band, USUAL_BYTES.max(4 * band));
        let rest = left - bands;
        let kernels = (rest / 2).min(USUAL_BYTES);
        let beside_film = self.bytes - PROGRAM_BYTES - film;
        Ok(Shares { bands, kernels, irradiance: (rest - kernels).min(beside_film) })
    }

    /// Returns what is left where imaging takes `fixed` bytes and those of a band at least, and what comes after it those of `film`.
    fn left(self, fixed: u64, band: u64, film: u64) -> Result<u64, PipelineError> {
        let least_bytes = PROGRAM_BYTES + (fixed + band).max(film);
        if self.bytes < least_bytes {
            return Err(PipelineError::Memory { budget_bytes: self.bytes, least_bytes });
        }
        Ok(self.bytes - PROGRAM_BYTES - fixed)
    }
}

/// Returns what takes memory while `irradiance.exr` is written, bytes: blocks as they are read and packed, and those that two threads pack.
fn written_bytes(columns: usize, n_bands: usize) -> u64 {
    let block = 4 * BLOCK_ROWS * (columns * n_bands) as u64;
    let n_at_once = (STRIP_BYTES as u64 / block.max(1)).clamp(1, 4 * rayon::current_num_threads() as u64);
    2 * n_at_once * block + 3 * block
}

/// Returns what the scene takes, bytes.
pub(crate) fn scene_bytes(scene: &Scene) -> u64 {
    let layers = 1 + u64::from(scene.hidden.is_some());
    let planes = layers * (n_bands(scene) as u64 + 1);
    4 * planes * (scene.rows() * scene.columns()) as u64
}

/// Returns what imaging takes whatever is done, the plan left out, bytes.
fn imaging_bytes(scene: &Scene, place: &FilmPlace) -> u64 {
    let pixels = (place.rows * place.columns) as u64;
    scene_bytes(scene) + LENS_BAND_BYTES * n_bands(scene) as u64 + SEEN_BYTES * pixels
}

fn n_bands(scene: &Scene) -> usize {
    scene.radiance.grid().len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The figures of single and merged frames that were measured are within what is counted, and by a quarter at most below it.
    #[test]
    fn frames_take_what_was_measured() {
        let counted = |frames, planes| MemoryBudget::new(0).with_frames(frames, planes).pixel_bytes;
        for ((frames, planes), measured) in
            [((1, 1), 62), ((8, 1), 68), ((32, 1), 212), ((1, 3), 100), ((8, 3), 153), ((16, 3), 215)]
        {
            let counted = counted(frames, planes);
            assert!(
                counted >= measured && counted * 3 <= measured * 4,
                "{frames} × {planes}: {counted} for {measured}"
            );
        }
    }
}
