//! How much memory imaging may take.

use dioptric_forward::ImagingPlan;
use dioptric_scene::Scene;

use super::film::FilmPlace;
use crate::PipelineError;

/// What the stages after the irradiance take for a pixel of the film, bytes: electrons, volts, codes and colors.
const FILM_BYTES: u64 = 96;

/// What bands in flight and kept kernels take where nobody counts, bytes.
const USUAL_BYTES: u64 = 256 << 20;

/// The memory that imaging may take: the scene, its plan, the bands that are worked on, and what becomes of the film.
///
/// Beside that the program itself, the rays of the lens and, while it is read, the file of a scene take memory of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MemoryBudget {
    pub(crate) bytes: u64,
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
    /// Checks that a scene and its film fit before the lens is traced.
    ///
    /// # Errors
    /// Says the least that would do, as far as that is known.
    pub(crate) fn check(self, scene: &Scene, place: &FilmPlace) -> Result<(), PipelineError> {
        let samples = (scene.rows() * scene.columns()).max(place.rows * place.columns) as u64;
        self.left(fixed_bytes(scene, place), 16 * samples).map(|_| ())
    }

    /// Returns the plan with bands in flight and kept kernels that fit.
    ///
    /// # Errors
    /// Says the least that would do.
    pub(crate) fn fit(self, plan: ImagingPlan, scene: &Scene, place: &FilmPlace) -> Result<ImagingPlan, PipelineError> {
        let shares = self.shares(&plan, scene, place)?;
        let plan = plan.with_kernel_budget(shares.kernels.min(USUAL_BYTES) as usize);
        // Where there is room for what is usual, it stays as usual.
        let is_tight = shares.bands < USUAL_BYTES.max(4 * plan.band_bytes() as u64);
        Ok(if is_tight { plan.with_band_budget(shares.bands as usize) } else { plan })
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

    /// Half of what scene, plan and film leave is for bands in flight, a quarter each for kernels and irradiance; kernels and bands
    /// take no more than is usual.
    fn shares(self, plan: &ImagingPlan, scene: &Scene, place: &FilmPlace) -> Result<Shares, PipelineError> {
        let band = plan.band_bytes() as u64;
        let left = self.left(fixed_bytes(scene, place) + plan.size_bytes() as u64, band)?;
        let bands = (left / 2).clamp(band, USUAL_BYTES.max(4 * band));
        let kernels = ((left - bands) / 2).min(USUAL_BYTES);
        Ok(Shares { bands, kernels, irradiance: left - bands - kernels })
    }

    fn left(self, fixed: u64, band: u64) -> Result<u64, PipelineError> {
        let least_bytes = fixed + band;
        match self.bytes.checked_sub(fixed) {
            Some(left) if left >= band => Ok(left),
            _ => Err(PipelineError::Memory { budget_bytes: self.bytes, least_bytes }),
        }
    }
}

/// Returns what the scene and the film take whatever is done, bytes.
fn fixed_bytes(scene: &Scene, place: &FilmPlace) -> u64 {
    let layers = 1 + u64::from(scene.hidden.is_some());
    let planes = layers * (scene.radiance.grid().len() as u64 + 1);
    4 * planes * (scene.rows() * scene.columns()) as u64 + FILM_BYTES * (place.rows * place.columns) as u64
}
