//! The full picture of a world by rays from the film, shown while it gathers samples.

use dioptric_pipeline::{Camera, KeptCamera, PipelineError, Progress, RenderEffort, SceneSource};
use dioptric_spectrum::Cancel;

use super::{Product, Rung};

/// Renders a world pass by pass and hands over the picture whenever twice as many passes are done as at the last; in the end the camera keeps
/// the rendering, so that its picture starts there. Nothing is done for a camera before no world, or with a blurred view of one.
///
/// The bits are those of [`KeptCamera::capture`].
///
/// # Errors
/// As [`KeptCamera::capture`].
pub(super) fn refine(
    kept: &KeptCamera,
    camera: &Camera,
    progress: &dyn Progress,
    cancel: &Cancel,
    show: &mut dyn FnMut(Product),
) -> Result<(), PipelineError> {
    let SceneSource::World(spec) = &camera.scene.source else { return Ok(()) };
    let kept = kept.with(|own| own.clone_from(camera));
    if spec.method != dioptric_pipeline::RenderMethod::Backward || kept.has_irradiance()? {
        return Ok(());
    }
    let render = kept.world_render(progress, cancel)?;
    let mut renderer = render.renderer()?;
    let mut next = 1;
    render.refine(&mut renderer, spec.effort, progress, cancel, &mut |renderer| {
        if renderer.n_passes() < next || is_last(renderer.n_passes(), renderer.settings().samples_per_pass, spec.effort)
        {
            return Ok(true);
        }
        next = 2 * renderer.n_passes();
        let n_samples = renderer.n_passes() * renderer.settings().samples_per_pass;
        let partial = with_samples(camera, n_samples);
        let on_its_way = kept.with(|own| *own = partial);
        on_its_way.keep_irradiance(renderer.picture())?;
        let mut product = Product::make(&on_its_way, on_its_way.camera(), Rung::Refining, progress, cancel)?;
        product.take_camera(camera, n_samples);
        show(product);
        Ok(true)
    })?;
    kept.keep_irradiance(renderer.picture())
}

/// Whether as many passes are the whole rendering.
fn is_last(n_passes: u32, samples_per_pass: u32, effort: RenderEffort) -> bool {
    match effort {
        RenderEffort::Samples(n) => n_passes >= n.div_ceil(samples_per_pass),
        RenderEffort::Noise(_) => false,
    }
}

/// Returns the camera with a rendering of so many samples.
fn with_samples(camera: &Camera, n_samples: u32) -> Camera {
    let mut partial = camera.clone();
    if let SceneSource::World(world) = &mut partial.scene.source {
        world.effort = RenderEffort::Samples(n_samples);
    }
    partial
}
