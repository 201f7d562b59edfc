//! Ghosts in a picture: light of the scene that two surfaces of the lens reflect to the film.
//!
//! Ghosts are linear in the scene, and smooth but for those of what is small and bright. So the scene becomes a list of points: its own points, and
//! cells of its samples that are small where there is much light. The light of each is followed by rays over the front rim, and each ray lights a
//! parallelogram of the film, as wide as its neighbors are apart: caustics, rims and the shape of the iris come of themselves. A point gets rays by its
//! share of the light.

mod canvas;
mod sources;

use dioptric_optics::{GhostBeams, MirrorFilm, MonoLens, ObjectPoint};
use dioptric_spectrum::{Cancel, Cancelled};
use glam::{DVec2, DVec3};
use ndarray::Array2;
use rayon::prelude::*;

use self::{
    canvas::Canvas,
    sources::{Cells, SourcePoint},
};
use crate::{Film, ForwardError, ImagingPlan, Source};

/// How finely ghosts are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GhostDetail {
    /// Cells that the samples of the scene are reduced to.
    pub n_cells: usize,
    /// Rays over the front rim in each band, of all points together: those of one have their share of it, and [`LEAST_RAYS`] at least.
    pub n_rays: usize,
}

/// The fewest rays of a point.
pub const LEAST_RAYS: usize = 96;
/// The most.
const MOST_RAYS: usize = 1 << 16;
/// Points beside a scene that are followed by themselves, the brightest; others are taken together where they are close.
const MOST_POINTS: usize = 64;
/// Rays that are followed at a time.
const RAYS_AT_ONCE: usize = 2048;
/// Canvases on which parts of the light are drawn by themselves, whatever the number of threads, so that sums are the same.
const N_CANVASES: usize = 8;

/// The light of a scene as points that throw ghosts.
#[derive(Clone, Debug)]
pub struct GhostSources {
    points: Vec<SourcePoint>,
    /// Rays of each.
    n_rays: Vec<usize>,
}

/// A lens and a film that ghosts fall on.
#[derive(Clone, Debug)]
pub struct GhostFilm<'a> {
    /// The lens at the wavelength of the band.
    pub lens: &'a MonoLens,
    /// Where the film lies behind it, and what that reflects.
    pub mirror: MirrorFilm,
    /// The film, or the part of it that the picture is of.
    pub film: Film,
}

impl GhostSources {
    /// Returns the light of a scene that a plan was made for: of its first surface, and of the points before that.
    ///
    /// What lies behind the first surface and beyond the scene's edges throws no ghosts.
    ///
    /// # Errors
    /// When a band cannot be read.
    pub fn of_scene(plan: &ImagingPlan, source: &Source<'_>, detail: GhostDetail) -> Result<Self, ForwardError> {
        let cells = Cells::of(source, detail.n_cells)?;
        let beside = SourcePoint::all_beside(plan.points_beside(), source.points, MOST_POINTS);
        Ok(Self::of_points(cells.points.into_iter().chain(beside).collect(), detail))
    }

    /// Returns one point, in the direction of these tangents to the right and upwards at this depth from the projection center, m: in each of so many bands
    /// a star of irradiance 1 where the depth is infinite, else a lamp of intensity 1.
    pub fn of_point(field_tan: DVec2, depth_m: f64, n_bands: usize, n_rays: usize) -> Self {
        let per_cos = (1.0 + field_tan.length_squared()).sqrt();
        let tan2 = if depth_m.is_finite() { per_cos / (depth_m * depth_m) } else { per_cos.powi(3) };
        let point = SourcePoint { field_tan, dioptres: depth_m.recip(), light: vec![tan2; n_bands] };
        Self { points: vec![point], n_rays: vec![n_rays] }
    }

    fn of_points(points: Vec<SourcePoint>, detail: GhostDetail) -> Self {
        let light = |point: &SourcePoint| point.light.iter().sum::<f64>();
        let all: f64 = points.iter().map(light).sum();
        let of_share = |point: &SourcePoint| (detail.n_rays as f64 * light(point) / all).round() as usize;
        let n_rays = points.iter().map(|point| of_share(point).clamp(LEAST_RAYS, MOST_RAYS)).collect();
        Self { points, n_rays }
    }

    /// The number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether nothing shines.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Returns the irradiance that ghosts bring to a film in a band, in the unit of the scene's light, rows × columns.
    ///
    /// # Errors
    /// When the lens is one whose ghosts are not followed, or the work is cancelled.
    pub fn irradiance(&self, band: usize, on: &GhostFilm<'_>, cancel: &Cancel) -> Result<Array2<f32>, ForwardError> {
        let beams = on.lens.ghost_beams(&on.mirror)?;
        let tasks: Vec<Task<'_>> = self
            .points
            .iter()
            .zip(&self.n_rays)
            .filter(|(point, _)| point.light[band] > 0.0)
            .flat_map(|(point, &n_rays)| {
                let of = n_rays.div_ceil(RAYS_AT_ONCE);
                (0..of).map(move |part| Task { point, n_rays, part, of })
            })
            .collect();
        let draw = |first: usize| -> Result<Canvas, Cancelled> {
            let mut canvas = Canvas::new(&on.film);
            for task in tasks.iter().skip(first).step_by(N_CANVASES) {
                cancel.check()?;
                task.draw(band, &beams, &mut canvas);
            }
            Ok(canvas)
        };
        let canvases: Vec<Canvas> =
            (0..N_CANVASES.min(tasks.len())).into_par_iter().map(draw).collect::<Result<_, Cancelled>>()?;
        let mut all = Canvas::new(&on.film);
        canvases.iter().for_each(|canvas| all.add(canvas));
        Ok(all.into_irradiance())
    }
}

/// Part of the rays of a point.
struct Task<'a> {
    point: &'a SourcePoint,
    n_rays: usize,
    part: usize,
    of: usize,
}

impl Task<'_> {
    fn draw(&self, band: usize, beams: &GhostBeams, canvas: &mut Canvas) {
        let SourcePoint { field_tan, dioptres, light } = self.point;
        let per_cos = (1.0 + field_tan.length_squared()).sqrt();
        // Radiance times the area in tangents is the irradiance of a star over cos³, the intensity of a lamp over z² cos.
        let (point, light) = if *dioptres > LEAST_DIOPTRES {
            let z_m = dioptres.recip();
            let center_mm = DVec3::Z * beams.lens().projection_center_z_mm();
            let place_mm = center_mm + 1e3 * z_m * field_tan.extend(-1.0);
            // From sr to mm² before a pixel of so many mm².
            (ObjectPoint::Finite(place_mm), 1e6 * light[band] * z_m * z_m / per_cos)
        } else {
            let direction = DVec3::new(-field_tan.x, -field_tan.y, 1.0) / per_cos;
            (ObjectPoint::Infinite(direction), light[band] / per_cos.powi(3))
        };
        beams.follow(&point, self.n_rays, (self.part, self.of), &mut |_, beam| canvas.draw(beam, light));
    }
}

/// Points farther away than a thousand kilometers are stars.
const LEAST_DIOPTRES: f64 = 1e-6;
