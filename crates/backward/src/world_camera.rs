//! Cameras that a world file names.

use dioptric_diffraction::Hurb;
use dioptric_optics::{Lens, OpticsError, glam::DVec2};
use dioptric_world::{CameraKind, World, WorldCamera, glam::DVec3};

use crate::{
    BackwardError, Bands, Camera, LensCamera, LensCameraSettings, LensOrigin, Panorama, Parallel, Pinhole, PixelGrid,
    Placement, ThinLens, camera::world_ray,
};

/// The paper's stand-in for dispersion: a straight line through each index at 550 nm, per nm.
const PAPER_SLOPE_PER_NM: f64 = -0.04 / 300.0;
/// The wavelength at which a lens of a file is focused, nm.
const FOCUS_NM: f64 = 550.0;

impl Camera {
    /// Returns the camera that a world file describes; `read_lens` reads the lens files that it names.
    ///
    /// # Errors
    /// When the lens cannot be had, a number makes no sense, or the camera is of a kind that is not rendered.
    pub fn from_world(
        camera: &WorldCamera,
        bands: &Bands,
        read_lens: &dyn Fn(&str) -> Result<Lens, OpticsError>,
    ) -> Result<Self, BackwardError> {
        let placement = Placement { world_from_camera: camera.world_from_camera };
        let (columns, rows) = camera.resolution;
        let pixels = PixelGrid::new(columns, rows);
        match &camera.kind {
            CameraKind::Perspective { fov_deg, lens_radius_m, focus_distance_m, screen_window } => {
                let half_tangents = half_tangents(*fov_deg, pixels, *screen_window)?;
                let view = Pinhole { placement, pixels, half_tangents, layer: 0 };
                Ok(match *lens_radius_m > 0.0 {
                    true => {
                        let (radius_m, focus_distance_m) = (*lens_radius_m, *focus_distance_m);
                        Self::ThinLens(ThinLens { view, radius_m, focus_distance_m })
                    }
                    false => Self::Pinhole(view),
                })
            }
            CameraKind::Orthographic { screen_window } => {
                Ok(Self::Parallel(Parallel { placement, pixels, window_m: *screen_window }))
            }
            CameraKind::Panorama { mapping } => Ok(Self::Panorama(Panorama { placement, pixels, mapping: *mapping })),
            CameraKind::Other { kind } => Err(BackwardError::setting(
                "the camera of the world",
                format!("'{kind}', which isn't supported"),
                "another view of the world, such as --frame",
            )),
            CameraKind::Lens {
                file,
                focal_length_mm,
                film_distance_mm,
                focus_distance_m,
                aperture_diameter_mm,
                film_diagonal_mm,
                has_diffraction,
                has_dispersion,
            } => {
                let is_ideal = focal_length_mm.is_some() && file.is_empty();
                let lens = match focal_length_mm {
                    Some(focal_length_mm) if file.is_empty() => Lens::thin(*focal_length_mm, *aperture_diameter_mm)?,
                    _ => {
                        let lens = read_lens(file)?;
                        let full_mm = 2.0 * lens.stop_semi_aperture_mm();
                        lens.with_stop_diameter_mm(aperture_diameter_mm.min(full_mm))?
                    }
                };
                let lens =
                    if *has_dispersion { lens.with_linear_dispersion(PAPER_SLOPE_PER_NM, FOCUS_NM)? } else { lens };
                let film_distance_mm = match (film_distance_mm, focus_distance_m) {
                    (Some(film_distance_mm), _) => *film_distance_mm,
                    (None, Some(focus_m)) => film_distance_for(&lens, *focus_m)?,
                    (None, None) => lens.at(FOCUS_NM)?.film_distance_mm_for(f64::INFINITY)?,
                };
                let size = DVec2::new(columns as f64, rows as f64);
                let settings = LensCameraSettings {
                    film_distance_mm,
                    film_size_mm: size * (film_diagonal_mm / size.length()),
                    pixels,
                    placement,
                    // The paper's `idealDiffraction` camera has its lens at the origin, pbrt's `realistic` its film.
                    origin: if is_ideal { LensOrigin::EntrancePupil } else { LensOrigin::Film },
                    diffraction: has_diffraction.then_some(Hurb::PAPER),
                    micro_array: None,
                };
                Ok(Self::Lens(Box::new(LensCamera::new(&lens, bands, settings)?)))
            }
        }
    }
}

/// Returns the distance along its axis, m, of what a camera sees in the middle of its picture; none where that is nothing.
pub fn distance_ahead_m(world: &World, placement: &Placement) -> Option<f64> {
    let ray = world_ray(placement, DVec3::ZERO, DVec3::Z);
    world.intersect(&ray, f32::INFINITY).map(|hit| f64::from((hit.point - ray.origin).dot(ray.direction)))
}

/// Returns the tangents of half the angles of a picture, from the angle across its shorter side.
fn half_tangents(fov_deg: f64, pixels: PixelGrid, window: Option<[f64; 4]>) -> Result<DVec2, BackwardError> {
    if !(fov_deg > 0.0 && fov_deg < 180.0) {
        return Err(BackwardError::setting("the angle of view in degrees", fov_deg, "0 to 180, both excluded"));
    }
    let aspect = pixels.columns as f64 / pixels.rows as f64;
    let [left, right, bottom, top] =
        window.unwrap_or([-aspect.max(1.0), aspect.max(1.0), -(1.0 / aspect).max(1.0), (1.0 / aspect).max(1.0)]);
    let size = DVec2::new(right - left, top - bottom);
    let off = DVec2::new(right + left, top + bottom).abs();
    if off.max_element() > 1e-6 * size.max_element() || size.min_element() <= 0.0 {
        let found = format!("{left} to {right}, {bottom} to {top}");
        return Err(BackwardError::setting(
            "the window of the camera",
            found,
            "one that the axis goes through the middle of",
        ));
    }
    Ok(0.5 * size * (0.5 * fov_deg.to_radians()).tan())
}

/// Returns the film's distance for a plane so far from the film, as files count it: by steps, since the film moves the
/// plane.
fn film_distance_for(lens: &Lens, focus_m: f64) -> Result<f64, BackwardError> {
    let mono = lens.at(FOCUS_NM)?;
    let mut film_distance_mm = mono.film_distance_mm_for(f64::INFINITY)?;
    for _ in 0..FOCUS_STEPS {
        film_distance_mm = mono.film_distance_mm_for(1e3 * focus_m - mono.last_vertex_z_mm() - film_distance_mm)?;
    }
    Ok(film_distance_mm)
}

/// Steps of focusing: each is off by the square of the magnification of the one before.
const FOCUS_STEPS: usize = 20;

#[cfg(test)]
mod tests {
    use dioptric_spectrum::WavelengthGrid;
    use dioptric_world::glam::DAffine3;

    use super::*;

    fn of(kind: CameraKind) -> WorldCamera {
        WorldCamera { name: "test".to_owned(), world_from_camera: DAffine3::IDENTITY, kind, resolution: (200, 100) }
    }

    fn bands() -> Bands {
        Bands { grid: WavelengthGrid::new(vec![550.0]).unwrap(), sampling: crate::BandSampling::Center }
    }

    fn perspective(screen_window: Option<[f64; 4]>) -> CameraKind {
        CameraKind::Perspective { fov_deg: 90.0, lens_radius_m: 0.0, focus_distance_m: 1.0, screen_window }
    }

    #[test]
    fn angle_is_across_the_shorter_side() {
        let read = |_: &str| Lens::built_in("dgauss-50mm");
        let Ok(Camera::Pinhole(view)) = Camera::from_world(&of(perspective(None)), &bands(), &read) else { panic!() };
        assert!((view.half_tangents - DVec2::new(2.0, 1.0)).length() < 1e-12);
        let window = Some([-0.5, 0.5, -0.25, 0.25]);
        let Ok(Camera::Pinhole(view)) = Camera::from_world(&of(perspective(window)), &bands(), &read) else { panic!() };
        assert!((view.half_tangents - DVec2::new(0.5, 0.25)).length() < 1e-12);
        let aside = Camera::from_world(&of(perspective(Some([0.0, 1.0, -1.0, 1.0]))), &bands(), &read);
        assert!(aside.unwrap_err().to_string().contains("the axis goes through the middle"));
    }

    #[test]
    fn ideal_lens_stands_at_the_origin() {
        let ideal = |film_distance_mm| CameraKind::Lens {
            file: String::new(),
            focal_length_mm: Some(50.0),
            film_distance_mm: Some(film_distance_mm),
            focus_distance_m: None,
            aperture_diameter_mm: 10.0,
            film_diagonal_mm: 70.0,
            has_diffraction: false,
            has_dispersion: false,
        };
        let read = |_: &str| Lens::built_in("dgauss-50mm");
        let Ok(Camera::Lens(camera)) = Camera::from_world(&of(ideal(137.0)), &bands(), &read) else { panic!() };
        // The center of its entrance pupil, which is the lens, and not the film 137 mm behind it.
        assert_eq!(camera.projection_center().0, DVec3::ZERO);
    }

    #[test]
    fn lens_is_focused_from_its_film() {
        let lens = |focus_distance_m| CameraKind::Lens {
            file: "a lens".to_owned(),
            focal_length_mm: None,
            film_distance_mm: None,
            focus_distance_m,
            aperture_diameter_mm: 5.0,
            film_diagonal_mm: 10.0,
            has_diffraction: false,
            has_dispersion: false,
        };
        let read = |_: &str| Lens::built_in("dgauss-50mm");
        let Ok(Camera::Lens(camera)) = Camera::from_world(&of(lens(Some(1.0))), &bands(), &read) else { panic!() };
        let mono = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let film_distance_mm = camera.settings().film_distance_mm;
        let object_mm = mono.object_distance_mm_for(film_distance_mm).unwrap();
        assert!((object_mm + mono.last_vertex_z_mm() + film_distance_mm - 1_000.0).abs() < 1e-6);
        assert!((camera.settings().film_size_mm - DVec2::new(8.944_271_9, 4.472_136)).length() < 1e-6);
    }
}
