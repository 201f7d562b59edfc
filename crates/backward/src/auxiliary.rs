//! What a camera sees besides light: depth, normals, materials, one value a pixel and never a mean over an edge.

use dioptric_spectrum::{Cancel, Quantity, SpectralImage, WavelengthGrid};
use dioptric_world::{
    Hit, Ray, World,
    glam::{DVec3, Vec3},
};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{BackwardError, Camera, FilmLine, LensCamera, Panorama, Parallel, Pinhole, Placement, peeling::Surfaces};

/// Pictures of what each pixel's middle sees through the middle of the pupil.
#[derive(Clone, Debug)]
pub struct Auxiliary {
    /// Depth along the axis from the center of the entrance pupil, m; infinite where nothing is met.
    pub z_m: Array2<f32>,
    /// Distance from there, m; infinite where nothing is met.
    pub distance_m: Array2<f32>,
    /// x, y and z of the shading normal in the world, turned to the camera; 0 where nothing is met.
    pub normal: [Array2<f32>; 3],
    /// The number of the material plus 1; 0 where nothing is met.
    pub material: Array2<f32>,
    /// The number of the instance plus 1; 0 outside any.
    pub instance: Array2<f32>,
    /// The number of the shape plus 1; 0 where nothing is met.
    pub shape: Array2<f32>,
    /// The number of the object plus 1, as [`World::object_names`] has them; 0 where nothing is met.
    pub object: Array2<f32>,
    /// The share of light that the surface gives back, band by band.
    pub albedo: SpectralImage,
}

/// One pixel of it.
#[derive(Clone)]
struct Seen {
    z_m: f32,
    distance_m: f32,
    normal: Vec3,
    ids: [f32; 4],
    albedo: Vec<f32>,
}

/// Looks once through the middle of each pixel and of the pupil.
///
/// # Errors
/// When it was cancelled.
pub fn auxiliary(
    world: &World,
    camera: &Camera,
    grid: &WavelengthGrid,
    cancel: &Cancel,
) -> Result<Auxiliary, BackwardError> {
    camera.check()?;
    let (rows, columns) = camera.pixels().size();
    let (center_m, axis) = projection_center(camera);
    let row = |row: usize| {
        cancel.check()?;
        let pixels: Vec<usize> = (row * columns..(row + 1) * columns).collect();
        let rays: Vec<Option<Ray>> = match camera {
            Camera::Pinhole(view) => pixels.iter().map(|&pixel| Some(view.ray(pixel, [0.5; 2]))).collect(),
            Camera::ThinLens(lens) => pixels.iter().map(|&pixel| Some(lens.view.ray(pixel, [0.5; 2]))).collect(),
            Camera::Panorama(all) => pixels.iter().map(|&pixel| Some(all.ray(pixel, [0.5; 2]))).collect(),
            Camera::Parallel(window) => pixels.iter().map(|&pixel| Some(window.ray(pixel, [0.5; 2]))).collect(),
            Camera::Lens(lens) => lens.chief_rays(&pixels),
        };
        let look = |ray: Option<Ray>| Seen::along(world, ray, (center_m, axis), grid);
        Ok(rays.into_iter().map(look).collect::<Vec<Seen>>())
    };
    let seen: Vec<Seen> =
        (0..rows).into_par_iter().map(row).collect::<Result<Vec<_>, BackwardError>>()?.into_iter().flatten().collect();
    let plane =
        |value: &dyn Fn(&Seen) -> f32| Array2::from_shape_fn((rows, columns), |(r, c)| value(&seen[r * columns + c]));
    let albedo = (0..grid.len()).map(|band| plane(&|seen| seen.albedo[band])).collect();
    Ok(Auxiliary {
        z_m: plane(&|seen| seen.z_m),
        distance_m: plane(&|seen| seen.distance_m),
        normal: [plane(&|seen| seen.normal.x), plane(&|seen| seen.normal.y), plane(&|seen| seen.normal.z)],
        material: plane(&|seen| seen.ids[0]),
        instance: plane(&|seen| seen.ids[1]),
        shape: plane(&|seen| seen.ids[2]),
        object: plane(&|seen| seen.ids[3]),
        albedo: SpectralImage::new(Quantity::Reflectance, grid.clone(), albedo)?,
    })
}

/// Returns the depth along the axis from the center of the entrance pupil, m, of what is met along each line from the film through
/// the array before it; infinite where nothing is met, NaN where the lens lets no ray through.
///
/// # Errors
/// When it was cancelled.
pub fn depth_along(
    world: &World,
    camera: &LensCamera,
    lines_mm: &[FilmLine],
    cancel: &Cancel,
) -> Result<Vec<f32>, BackwardError> {
    let (center_m, axis) = camera.projection_center();
    let of_chunk = |lines_mm: &[FilmLine]| {
        cancel.check()?;
        let depth_m = |ray: Option<Ray>| {
            let Some(ray) = ray else { return f32::NAN };
            let hit = world.intersect(&ray, f32::INFINITY);
            hit.map_or(f32::INFINITY, |hit| (hit.point.as_dvec3() - center_m).dot(axis) as f32)
        };
        Ok(camera.rays_along(lines_mm).into_iter().map(depth_m).collect())
    };
    let chunks: Vec<Vec<f32>> = lines_mm.par_chunks(LINES).map(of_chunk).collect::<Result<_, BackwardError>>()?;
    Ok(chunks.into_iter().flatten().collect())
}

/// Lines that are traced together.
const LINES: usize = 1024;

/// Returns the depth along the axis, m, of the first surfaces that a pinhole sees through the middle of each pixel, one
/// after another: the first map what is seen, the second what that hides, and so on; infinite where there is no more.
///
/// The back of a closed shape is none of them: its front hides what lies behind both. A shape that is open and folded is taken for closed.
///
/// # Errors
/// When it was cancelled.
pub fn layered_depth(
    world: &World,
    view: &Pinhole,
    n_layers: usize,
    cancel: &Cancel,
) -> Result<Vec<Array2<f32>>, BackwardError> {
    view.pixels.check()?;
    let (rows, columns) = view.pixels.size();
    let (center_m, axis) = projection_center(&Camera::Pinhole(*view));
    let depths_of = |row: usize| {
        cancel.check()?;
        let mut depths = vec![f32::INFINITY; columns * n_layers];
        for (column, depths) in depths.chunks_exact_mut(n_layers.max(1)).enumerate() {
            let surfaces = Surfaces::along(world, view.ray(row * columns + column, [0.5; 2]));
            let depth_m = |hit: Hit| (hit.point.as_dvec3() - center_m).dot(axis) as f32;
            depths.iter_mut().zip(surfaces).for_each(|(depth, hit)| *depth = depth_m(hit));
        }
        Ok(depths)
    };
    let by_row: Vec<Vec<f32>> = (0..rows).into_par_iter().map(depths_of).collect::<Result<_, BackwardError>>()?;
    let layer = |layer: usize| Array2::from_shape_fn((rows, columns), |(r, c)| by_row[r][c * n_layers + layer]);
    Ok((0..n_layers).map(layer).collect())
}

/// Returns the point that depth counts from, and the direction of the axis, in the world.
fn projection_center(camera: &Camera) -> (DVec3, DVec3) {
    let view = match camera {
        Camera::Pinhole(view) => view,
        Camera::ThinLens(lens) => &lens.view,
        Camera::Panorama(Panorama { placement, .. }) | Camera::Parallel(Parallel { placement, .. }) => {
            return center_and_axis(placement);
        }
        Camera::Lens(lens) => return lens.projection_center(),
    };
    center_and_axis(&view.placement)
}

fn center_and_axis(placement: &Placement) -> (DVec3, DVec3) {
    let place = placement.world_from_camera;
    (place.translation, place.transform_vector3(DVec3::Z).normalize())
}

impl Seen {
    fn nothing(n_bands: usize) -> Self {
        let albedo = vec![0.0; n_bands];
        Self { z_m: f32::INFINITY, distance_m: f32::INFINITY, normal: Vec3::ZERO, ids: [0.0; 4], albedo }
    }

    fn along(world: &World, ray: Option<Ray>, place: (DVec3, DVec3), grid: &WavelengthGrid) -> Self {
        let found = ray.and_then(|ray| Some((ray, world.intersect(&ray, f32::INFINITY)?)));
        found.map_or_else(|| Self::nothing(grid.len()), |(ray, hit)| Self::of_hit(world, &ray, &hit, place, grid))
    }

    fn of_hit(world: &World, ray: &Ray, hit: &Hit, (center_m, axis): (DVec3, DVec3), grid: &WavelengthGrid) -> Self {
        let albedo_at = |nm: &f64| world.bsdf(hit, -ray.direction, &[*nm as f32]).albedo()[0];
        let normal = world.bsdf(hit, -ray.direction, &[550.0]).normal();
        let from_center_m = hit.point.as_dvec3() - center_m;
        // Numbers from 1 on; up to 2²⁴ they are exact in single precision.
        let number = |id: u32| (id + 1) as f32;
        Self {
            z_m: from_center_m.dot(axis) as f32,
            distance_m: from_center_m.length() as f32,
            normal: if normal.dot(ray.direction) > 0.0 { -normal } else { normal },
            ids: [
                number(hit.material.0),
                hit.instance.map_or(0.0, |instance| number(instance.0)),
                number(hit.shape.0),
                number(world.object_of(hit) as u32),
            ],
            albedo: grid.centers_nm().iter().map(albedo_at).collect(),
        }
    }
}
