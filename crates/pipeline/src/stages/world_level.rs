//! The mean luminance of what is seen of a world, by paths.

use std::sync::Arc;

use dioptric_backward::{Bands, Camera, Pinhole, PixelGrid};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_scene::View;
use dioptric_spectrum::{Observer, WavelengthGrid};
use dioptric_world::{CameraKind, World};

use super::{
    Watch,
    spec::{LevelInputs, WorldInputs},
    world::{self, WorldRender},
    world_view::{horizontal_fov_deg, placement, world_camera},
};
use crate::PipelineError;

/// The most columns of the view whose mean is taken.
const COLUMNS: usize = 120;
/// The mean is known when its standard error is this share of it, or after so many passes.
const RELATIVE_ERROR: f64 = 0.003;
const MOST_PASSES: u32 = 256;
const SAMPLES_PER_PASS: u32 = 8;

/// Returns a world as it is read, with what is seen brought to the mean luminance that is asked for.
pub(super) fn read_at_level(inputs: &WorldInputs, watch: &Watch<'_>) -> Result<World, PipelineError> {
    let world = world::read(inputs, watch)?;
    match &inputs.level {
        Some(level) => bring_to(world, level, watch),
        None => Ok(world),
    }
}

/// Makes all light of a world so many times as strong that the mean luminance of what is seen of it is what is asked for.
///
/// The mean is that over the view from the middle of the entrance pupil, from 400 to 700 nm, to three thousandths; the samples that it is
/// taken from are always the same.
///
/// # Errors
/// When nothing that is seen gives light, or the view has no angle.
fn bring_to(world: World, inputs: &LevelInputs, watch: &Watch<'_>) -> Result<World, PipelineError> {
    let world = Arc::new(world);
    let own_cd_m2 = mean_luminance_cd_m2(&world, inputs, watch)?;
    let mut world = Arc::try_unwrap(world).expect("the rendering is over");
    let wanted_cd_m2 = inputs.mean_luminance_cd_m2;
    let factor = wanted_cd_m2 / own_cd_m2;
    if !(factor.is_finite() && factor > 0.0 && (factor as f32).is_normal()) {
        let reason = format!(
            "is to be {wanted_cd_m2} cd/m², but what is seen of the world has {own_cd_m2} cd/m²: expected a view of something that is lit"
        );
        return Err(PipelineError::Unsuitable { what: "mean_luminance_cd_m2", reason });
    }
    let note = format!(
        "all of its lights are multiplied by {factor:.4e}: what is seen has {own_cd_m2:.4} cd/m² on average, and {wanted_cd_m2} cd/m² is asked for"
    );
    world.brighten(factor as f32, note);
    Ok(world)
}

fn mean_luminance_cd_m2(world: &Arc<World>, inputs: &LevelInputs, watch: &Watch<'_>) -> Result<f64, PipelineError> {
    let LevelInputs { spec, fov_deg, .. } = inputs;
    let of_view = world_camera(world, spec, *fov_deg)?;
    let (columns, rows) = spec.size.unwrap_or(of_view.resolution);
    let fewer = columns.div_ceil(COLUMNS).max(1);
    let (columns, rows) = ((columns / fewer).max(1), (rows / fewer).max(1));
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0)?;
    let bands = Bands { grid: grid.clone(), sampling: spec.bands };
    let camera = match of_view.kind {
        CameraKind::Panorama { .. } | CameraKind::Orthographic { .. } => {
            let of_view = dioptric_world::WorldCamera { resolution: (columns, rows), ..of_view };
            Camera::from_world(&of_view, &bands, &|_| Lens::pinhole(1.0))?
        }
        _ => {
            let fov_deg = fov_deg.or_else(|| horizontal_fov_deg(&of_view)).ok_or_else(|| {
                let reason = "missing, and the world's camera states no angle; expected degrees".to_owned();
                PipelineError::Unsuitable { what: "field_of_view_deg", reason }
            })?;
            let view = View::from_horizontal_fov_deg(fov_deg, columns, rows)?;
            Camera::Pinhole(Pinhole {
                placement: placement(world, spec, Some(fov_deg))?,
                pixels: PixelGrid::new(columns, rows),
                half_tangents: 0.5 * DVec2::new(columns as f64, rows as f64) / view.focal_px,
                layer: 0,
            })
        }
    };
    let render = WorldRender::bare(world.clone(), camera, bands, (spec.paths, SAMPLES_PER_PASS));
    let mut renderer = render.renderer()?;
    let n = (columns * rows) as f64;
    loop {
        renderer.pass(watch.cancel, &|_| {})?;
        let rendering = renderer.rendering();
        let luminance = |values: &[f64]| Observer::Cie1931.xyz(&grid, values).luminance_cd_m2();
        let mean: Vec<f64> = rendering.picture.planes().iter().map(|plane| plane.mapv(f64::from).sum() / n).collect();
        let mean_cd_m2 = luminance(&mean);
        // Bands of one pixel share their paths: their errors add up.
        let error: Vec<f64> = rendering
            .standard_error
            .planes()
            .iter()
            .map(|plane| plane.iter().map(|&e| f64::from(e).powi(2)).sum::<f64>().sqrt() / n)
            .collect();
        let is_known = renderer.n_passes() >= 4 && luminance(&error) <= RELATIVE_ERROR * mean_cd_m2;
        if is_known || renderer.n_passes() >= MOST_PASSES {
            return Ok(mean_cd_m2);
        }
    }
}
