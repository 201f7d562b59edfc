//! Which view of a world is taken: that of one of its file's cameras, of the whole, or from a place.

use dioptric_backward::{BandSampling, Bands, Camera, Placement};
use dioptric_optics::Lens;
use dioptric_spectrum::{SpectrumError, WavelengthGrid};
use dioptric_world::{
    CameraKind, World, WorldCamera,
    glam::{DAffine3, DMat3, DVec2, DVec3},
};

use crate::{PipelineError, REFERENCE_WAVELENGTH_NM, WorldSpec, WorldView};

/// Columns and rows of views that no file gives a size.
const SIZE: (usize, usize) = (720, 480);
/// The angle across the width of such views, degrees.
const FOV_DEG: f64 = 40.0;
/// How much farther than needed a view of the whole stands.
const MARGIN: f64 = 1.05;
/// From where the whole is seen: so far round from its front, and above the horizon, degrees.
const AROUND_DEG: f64 = 35.0;
const ABOVE_DEG: f64 = 20.0;

/// The one band at which rays of cameras are looked at.
pub(super) fn reference_band() -> Result<Bands, SpectrumError> {
    Ok(Bands { grid: WavelengthGrid::new(vec![REFERENCE_WAVELENGTH_NM])?, sampling: BandSampling::Center })
}

/// Returns the camera of a world that is asked for; of a view that is none of the file's, with this angle across its width.
///
/// # Errors
/// When the file has no such camera, or a view has no direction.
pub fn world_camera(world: &World, spec: &WorldSpec, fov_deg: Option<f64>) -> Result<WorldCamera, PipelineError> {
    let cameras = world.cameras();
    let (columns, rows) = spec.size.unwrap_or(SIZE);
    let wrong = |reason: String| PipelineError::Unsuitable { what: "view", reason };
    let tan_across = (0.5 * fov_deg.unwrap_or(FOV_DEG).to_radians()).tan();
    if !(tan_across > 0.0 && tan_across.is_finite()) {
        let found = fov_deg.unwrap_or(FOV_DEG);
        return Err(wrong(format!("an angle of {found}° across its width, expected more than 0 and less than 180")));
    }
    let tangents = DVec2::new(tan_across, tan_across * rows as f64 / columns as f64);
    let at = |name: &str, world_from_camera: DAffine3| WorldCamera {
        name: name.to_owned(),
        world_from_camera,
        kind: CameraKind::Perspective {
            fov_deg: 2.0 * tangents.min_element().atan().to_degrees(),
            lens_radius_m: 0.0,
            focus_distance_m: 1.0,
            screen_window: None,
        },
        resolution: (columns, rows),
    };
    let whole = || framed(world, tangents).map(|place| at("the whole", place)).map_err(wrong);
    match &spec.view {
        WorldView::OfFile => cameras.first().cloned().map_or_else(whole, Ok),
        WorldView::Camera(which) => {
            let number = which.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            let found = cameras.iter().find(|camera| camera.name == *which).or_else(|| cameras.get(number?));
            found.cloned().ok_or_else(|| {
                let named =
                    cameras.iter().enumerate().map(|(index, camera)| format!("{} '{}'", index + 1, camera.name));
                let known: Vec<String> = named.take(12).collect();
                let known = if known.is_empty() { "which has none".to_owned() } else { known.join(", ") };
                wrong(format!("'{which}' is no camera of {}: {known}", spec.file.display()))
            })
        }
        WorldView::Whole => whole(),
        WorldView::From { eye_m, look_at_m, up } => {
            let point = |(x, y, z): (f64, f64, f64)| DVec3::new(x, y, z);
            let up = up.map_or(world.up(), point);
            let eye_m = point(*eye_m);
            let look_at_m = match look_at_m {
                Some(look_at_m) => point(*look_at_m),
                None => world.bounds().map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high)),
            };
            let place = looking(eye_m, look_at_m - eye_m, up, world.is_left_handed());
            place.map(|place| at("a place", place)).ok_or_else(|| {
                wrong(format!(
                    "from {eye_m} to {look_at_m} with {up} up: expected two places, and an up across the view"
                ))
            })
        }
    }
}

/// Returns where the view that is asked for is taken from, the camera moved as the file says.
///
/// # Errors
/// As [`world_camera`], and when the camera stands outside the room of the still life.
pub(super) fn placement(world: &World, spec: &WorldSpec, fov_deg: Option<f64>) -> Result<Placement, PipelineError> {
    let of_view = world_camera(world, spec, fov_deg)?.world_from_camera;
    let advance = DAffine3::from_translation(1e-3 * DVec3::new(spec.aside_mm.0, spec.aside_mm.1, spec.advance_mm));
    let world_from_camera = of_view * advance;
    let eye_m = world_from_camera.translation;
    let is_inside = |(low, high): (DVec3, DVec3)| low.cmplt(eye_m).all() && eye_m.cmplt(high).all();
    // Of a closed room nothing is seen from outside.
    if spec.is_still_life() && !world.bounds().is_some_and(is_inside) {
        let reason = format!("it stands at {eye_m} m, expected a place within the room of the still life");
        return Err(PipelineError::Unsuitable { what: "the place of the camera", reason });
    }
    Ok(Placement { world_from_camera })
}

/// Returns the angle across the picture of a camera that states one, degrees.
pub(super) fn horizontal_fov_deg(camera: &WorldCamera) -> Option<f64> {
    if !matches!(camera.kind, CameraKind::Perspective { .. }) {
        return None;
    }
    let view = match Camera::from_world(camera, &reference_band().ok()?, &|_| Lens::pinhole(1.0)).ok()? {
        Camera::Pinhole(view) => view,
        Camera::ThinLens(lens) => lens.view,
        Camera::Panorama(_) | Camera::Parallel(_) | Camera::Lens(_) => return None,
    };
    Some(2.0 * view.half_tangents.x.atan().to_degrees())
}

/// Returns the place of a camera that looks along a direction; `None` where that is none, or up lies along it.
pub(super) fn looking(eye_m: DVec3, along: DVec3, up: DVec3, is_left_handed: bool) -> Option<DAffine3> {
    let forward = along.try_normalize()?;
    let right = if is_left_handed { up.cross(forward) } else { forward.cross(up) };
    let right = right.try_normalize().filter(|_| eye_m.is_finite())?;
    let up = if is_left_handed { forward.cross(right) } else { right.cross(forward) };
    Some(DAffine3 { matrix3: DMat3::from_cols(right, up, forward), translation: eye_m })
}

/// Returns the place from which the whole world is seen, a quarter round from its front and from above.
fn framed(world: &World, tangents: DVec2) -> Result<DAffine3, String> {
    let (low, high) = world.bounds().ok_or("the world has no shapes")?;
    let (up, front, is_left_handed) = (world.up(), world.front(), world.is_left_handed());
    let right = if is_left_handed { front.cross(up) } else { up.cross(front) };
    let (around, above) = (AROUND_DEG.to_radians(), ABOVE_DEG.to_radians());
    let towards = above.cos() * (around.cos() * front + around.sin() * right) + above.sin() * up;
    let center = 0.5 * (low + high);
    let place = looking(center, -towards, up, is_left_handed).ok_or("the world has no up")?;
    // As near as all corners of its box allow.
    let mut distance_m: f64 = 0.0;
    for corner in 0..8 {
        let choose = |bit: usize, low: f64, high: f64| if corner >> bit & 1 == 0 { low } else { high };
        let p = DVec3::new(choose(0, low.x, high.x), choose(1, low.y, high.y), choose(2, low.z, high.z));
        let p = place.matrix3.transpose() * (p - center);
        distance_m = distance_m.max(p.x.abs() / tangents.x - p.z).max(p.y.abs() / tangents.y - p.z);
    }
    let distance_m = if distance_m > 0.0 { MARGIN * distance_m } else { 1.0 };
    Ok(DAffine3 { translation: center + distance_m * towards, ..place })
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use dioptric_world::{Material, Shape, SpectralCurve, Texture, TriangleMesh, WorldBuilder, glam::Vec3};

    use super::*;

    fn world(is_left_handed: bool, up: DVec3) -> World {
        let mut builder = WorldBuilder::new();
        builder.set_up(up, is_left_handed);
        let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
        let matte = builder.add_material("gray", Material::Matte { reflectance: gray });
        let block = TriangleMesh::block(Vec3::new(3.0, 1.0, -2.0), Vec3::new(7.0, 2.0, 8.0));
        builder.add_shape(Shape::Mesh(block), DAffine3::IDENTITY, matte, None);
        builder.build().unwrap()
    }

    /// All corners lie within the picture and some within 5 % of its edge, in every kind of frame.
    #[test]
    fn whole_is_framed() {
        for (is_left_handed, up) in [(false, DVec3::Y), (true, DVec3::Y), (false, DVec3::Z), (true, DVec3::Z)] {
            let world = world(is_left_handed, up);
            let spec = WorldSpec { view: WorldView::Whole, ..WorldSpec::of_file(PathBuf::from("a.obj")) };
            let camera = world_camera(&world, &spec, Some(50.0)).unwrap();
            let into = camera.world_from_camera.inverse();
            let tangents = DVec2::new(1.0, 480.0 / 720.0) * 25_f64.to_radians().tan();
            let (low, high) = world.bounds().unwrap();
            let mut largest: f64 = 0.0;
            for corner in 0..8 {
                let p = DVec3::new(
                    if corner & 1 == 0 { low.x } else { high.x },
                    if corner & 2 == 0 { low.y } else { high.y },
                    if corner & 4 == 0 { low.z } else { high.z },
                );
                let p = into.transform_point3(p);
                assert!(p.z > 0.0);
                largest = largest.max((p.truncate() / p.z / tangents).abs().max_element());
            }
            assert!(largest < 1.0 && largest > 0.9, "{largest}");
            assert!((horizontal_fov_deg(&camera).unwrap() - 50.0).abs() < 1e-9);
            // Up is up in the picture, and the frame has the hand of the world's.
            let m = camera.world_from_camera.matrix3;
            assert!(m.y_axis.dot(up) > 0.9 && (m.determinant() > 0.0) == is_left_handed);
        }
    }

    #[test]
    fn cameras_are_chosen_and_places_looked_from() {
        let world = world(false, DVec3::Y);
        let spec = |view: WorldView| WorldSpec { view, ..WorldSpec::of_file(PathBuf::from("a.obj")) };
        let error = world_camera(&world, &spec(WorldView::Camera("left".to_owned())), None).unwrap_err().to_string();
        assert!(error.contains("'left'") && error.contains("a.obj"), "{error}");
        let from = |look_at_m| WorldView::From { eye_m: (5.0, 1.5, 20.0), look_at_m, up: None };
        let camera = world_camera(&world, &spec(from(Some((5.0, 1.5, 0.0)))), None).unwrap();
        let ahead = camera.world_from_camera.transform_vector3(DVec3::Z);
        assert!(ahead.abs_diff_eq(DVec3::NEG_Z, 1e-12));
        // Towards the middle of all.
        let middle = world_camera(&world, &spec(from(None)), None).unwrap();
        assert!(middle.world_from_camera.transform_vector3(DVec3::Z).abs_diff_eq(DVec3::NEG_Z, 1e-6));
        assert!(world_camera(&world, &spec(from(Some((5.0, 9.0, 20.0)))), None).is_err());
    }
}
