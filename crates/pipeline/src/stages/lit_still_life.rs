//! The built-in still life as a world that rays from the film meet.

use dioptric_backward::{Placement, RadiantPoint, RadiantScene, Sampler, Subject, distance_ahead_m};
use dioptric_scene::{LitStillLife, StillLife};
use dioptric_world::{Ray, glam::DVec3};

use super::{
    Watch,
    painting::Paintings,
    scene::ResolvedScene,
    spec::{GeometryInputs, SceneInputs},
};
use crate::{PipelineError, RenderMethod, Stage, WorldSpec};

/// The picture that the arrangement is made for: columns and rows.
const SIZE: (usize, usize) = (1080, 720);

/// The most columns of a view that is no more than the summary of a picture.
const SUMMARY_COLUMNS: usize = 270;

/// The still life with its light, for rays of a camera.
#[derive(Debug)]
pub(crate) struct RadiantStillLife(LitStillLife);

/// Returns the usual picture of the still life from where a camera stands in it.
pub(super) fn picture_at(spec: &WorldSpec) -> StillLife {
    let moved_m = [spec.aside_mm.0, spec.aside_mm.1, spec.advance_mm].map(|mm| 1e-3 * mm);
    StillLife { moved_m, ..StillLife::new(SIZE.0, SIZE.1) }
}

/// Returns the picture of the still life that a camera's place in it has, and how many samples of it were made one.
pub(super) fn picture_of(geometry: &GeometryInputs, spec: &WorldSpec) -> (StillLife, usize) {
    let (columns, rows) = spec.size.unwrap_or(SIZE);
    let binning = geometry.quality.scene_binning(columns);
    let usual = picture_at(spec);
    let life = StillLife {
        columns: (columns / binning).max(1),
        rows: (rows / binning).max(1),
        horizontal_fov_deg: geometry.field_of_view_deg.unwrap_or(usual.horizontal_fov_deg),
        with_hidden: spec.method == RenderMethod::Forward && spec.layers > 1,
        ..usual
    };
    (life, binning)
}

/// Paints the view from the middle of the entrance pupil: radiance and depth; where it is but the summary of a picture, coarsely.
pub(super) fn view(
    inputs: &SceneInputs,
    spec: &WorldSpec,
    paintings: Paintings<'_>,
    watch: &Watch<'_>,
) -> Result<ResolvedScene, PipelineError> {
    let geometry = &inputs.geometry;
    let (mut life, mut binning) = picture_of(geometry, spec);
    if geometry.is_summary {
        let fewer = life.columns.div_ceil(SUMMARY_COLUMNS);
        life = StillLife { columns: (life.columns / fewer).max(1), rows: (life.rows / fewer).max(1), ..life };
        binning *= fewer;
    }
    let wanted = geometry.wavelengths.of_world()?;
    let scene = paintings.scene(&life, &geometry.quality.bands_of(&wanted)?, geometry.viewing(), watch)?;
    Ok(ResolvedScene { scene, binning })
}

impl RadiantStillLife {
    /// Lights the still life as this picture of it shows it.
    pub(super) fn new(life: &StillLife, watch: &Watch<'_>) -> Result<Self, PipelineError> {
        let report = |part| watch.progress.at(Stage::Scene, part);
        let (cancel, life) = (watch.cancel.clone(), *life);
        watch.run_reporting(&report, move |progress| Ok(Self(life.lit(progress, &cancel)?)))
    }

    /// Returns the still life at once, light being gathered for each ray.
    pub(super) fn unlit(life: &StillLife) -> Result<Self, PipelineError> {
        Ok(Self(life.unlit()?))
    }

    /// Where the middle of the entrance pupil stands, and how it looks.
    pub(super) fn placement(&self) -> Placement {
        Placement { world_from_camera: self.0.world_from_eye() }
    }

    /// Returns how far along the axis the first thing is that stands before the middle of the picture, m.
    pub(super) fn distance_ahead_m(&self) -> Option<f64> {
        distance_ahead_m(Subject::Radiant(self), &self.placement())
    }

    /// What is pictured, in words.
    pub(super) fn identity(&self) -> String {
        format!("{:?}", self.0.picture())
    }
}

fn line(ray: &Ray) -> (DVec3, DVec3) {
    (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize())
}

impl RadiantScene for RadiantStillLife {
    fn add_radiance(&self, ray: &Ray, wavelengths_nm: &[f32], random: &Sampler, radiance: &mut [f32]) {
        self.0.add_radiance(line(ray), wavelengths_nm, &|number| random.pair(FIRST_PAIR + number), radiance);
    }

    fn look(&self, ray: &Ray, wavelengths_nm: &[f32]) -> Option<RadiantPoint> {
        let (origin_m, direction) = line(ray);
        let seen = self.0.look(origin_m, direction, wavelengths_nm)?;
        Some(RadiantPoint {
            point: seen.point_m.as_vec3(),
            normal: seen.normal.as_vec3(),
            material: seen.material,
            instance: Some(seen.thing),
            shape: seen.object,
            albedo: seen.albedo,
        })
    }
}

/// The first pair of random numbers; those before it are the camera's.
const FIRST_PAIR: u32 = 8;
