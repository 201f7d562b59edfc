//! The plan of the imaging: all of it that does not depend on the light in the scene.

use std::sync::Arc;

use dioptric_forward::{BlurMode, ImagingPlan, ImagingSpec, Settings, Source};
use dioptric_psf::LensImage;
use dioptric_scene::Scene;

use super::{Watch, film::FilmPlace, memory::MemoryBudget, spec::PlanInputs};
use crate::{BlurSpec, PipelineError, Quality, Stage};

pub(super) fn plan(
    inputs: &PlanInputs,
    lens: Arc<dyn LensImage + Send>,
    place: &FilmPlace,
    scene: &Scene,
    budget: Option<MemoryBudget>,
    watch: &Watch<'_>,
) -> Result<ImagingPlan, PipelineError> {
    let quality = inputs.bank.film.geometry.quality;
    let mode = match (inputs.blur, quality) {
        (BlurSpec::Views(n), Quality::Full | Quality::Draft) => BlurMode::Views(n),
        (BlurSpec::Layered | BlurSpec::Views(_), _) => BlurMode::Layered,
        (BlurSpec::Pointwise, _) => BlurMode::Pointwise,
    };
    let border = inputs.border.into();
    let settings = match quality {
        Quality::Full | Quality::Draft => Settings { mode, border, ..Settings::default() },
        // The pixels are several of the full film's: what a step costs is a part of what the pixels cost.
        Quality::Preview | Quality::Sketch => Settings {
            mode,
            border,
            layer_step_px: 4.0,
            chromatic_step_px: 4.0,
            max_edge_error: 0.03,
            widest_blur_px: 8.0,
            subpixels: false,
            ..Settings::default()
        },
    };
    let spec = ImagingSpec { film: place.film(), grid: scene.radiance.grid().clone(), settings };
    let progress = |fraction| watch.progress.at(Stage::Plan, fraction);
    let plan = ImagingPlan::new(lens, &Source::of_scene(scene)?.geometry(), spec, &progress, watch.cancel)?;
    let plan = match budget {
        Some(budget) => budget.fit(plan, scene, place)?,
        None => plan,
    };
    Ok(match watch.progress.clock() {
        Some(clock) => plan.with_clock(clock),
        None => plan,
    })
}
