//! Cameras of pbrt files.

use glam::{DAffine3, DVec3};

use super::params::Params;
use crate::{CameraKind, SkyMapping, WorldCamera};

/// Returns the distance from the rear vertex to the film, mm; none for 0, which leaves it to the focus.
///
/// The cameras of ISET for pbrt's 2nd version count it in millimetres, all others of ISET in metres.
fn film_distance_mm(kind: &str, params: &Params<'_>) -> Option<f64> {
    let unit_mm = if matches!(kind, "realisticDiffraction" | "idealDiffraction") { 1.0 } else { 1e3 };
    params.number("filmdistance").filter(|distance| *distance != 0.0).map(|distance| unit_mm * distance)
}

/// What a file has said of its camera so far.
#[derive(Debug, Default)]
pub(super) struct CameraWords {
    kind: String,
    camera_from_world: DAffine3,
    fov_deg: Option<f64>,
    screen_window: Option<[f64; 4]>,
    lens_radius: f64,
    focus_distance: Option<f64>,
    lens_file: String,
    focal_length_mm: Option<f64>,
    film_distance_mm: Option<f64>,
    is_equirectangular: bool,
    aperture_diameter_mm: Option<f64>,
    film_diagonal_mm: Option<f64>,
    has_diffraction: bool,
    has_dispersion: bool,
    resolution: Option<(f64, f64)>,
}

impl CameraWords {
    pub(super) fn set_camera(&mut self, kind: &str, params: &Params<'_>, camera_from_world: DAffine3) {
        let is_set = |name: &str| params.number(name).is_some_and(|n| n != 0.0) || params.flag(name) == Some(true);
        let fov = params.within("fov", [1e-3, 179.99]);
        *self = Self {
            kind: kind.to_owned(),
            camera_from_world,
            fov_deg: fov.or_else(|| Some(2.0 * params.within("halffov", [1e-3, 89.99])?)),
            screen_window: params.exactly("screenwindow").or_else(|| {
                let aspect = params.within("frameaspectratio", [1e-3, 1e3])?;
                let (x, y) = if aspect > 1.0 { (aspect, 1.0) } else { (1.0, 1.0 / aspect) };
                Some([-x, x, -y, y])
            }),
            lens_radius: params.within("lensradius", [0.0, f64::MAX]).unwrap_or(0.0),
            focus_distance: ["focaldistance", "focusdistance"]
                .iter()
                .find_map(|name| params.within(name, [0.0, f64::MAX])),
            lens_file: params.text("lensfile").or_else(|| params.text("specfile")).unwrap_or("").to_owned(),
            focal_length_mm: params.number("focal_length"),
            film_distance_mm: film_distance_mm(kind, params),
            is_equirectangular: params.choice("mapping", &["equalarea", "equirectangular"]) == Some(1),
            aperture_diameter_mm: params.number_of(&["aperturediameter", "aperture_diameter"]),
            film_diagonal_mm: params.number("filmdiag").or(self.film_diagonal_mm),
            has_diffraction: is_set("diffractionEnabled"),
            has_dispersion: is_set("chromaticAberrationEnabled"),
            resolution: self.resolution,
        };
    }

    /// Takes the parameters of the film; returns whether they ask for a part of the picture.
    pub(super) fn set_film(&mut self, params: &Params<'_>) -> bool {
        let pixels = |name: &str| params.within(name, [1.0, 65536.0]);
        if let (Some(x), Some(y)) = (pixels("xresolution"), pixels("yresolution")) {
            self.resolution = Some((x, y));
        }
        self.film_diagonal_mm = self.film_diagonal_mm.or_else(|| params.number("diagonal"));
        let (x, y) = self.resolution.unwrap_or((0.0, 0.0));
        let is_part = |name: &str, whole: [f64; 4]| params.numbers(name).is_some_and(|n| n != whole);
        is_part("pixelbounds", [0.0, x, 0.0, y]) | is_part("cropwindow", [0.0, 1.0, 0.0, 1.0])
    }

    /// Returns the camera, or `None` where the file has none.
    pub(super) fn finish(&self, metres_per_unit: f64) -> Result<Option<WorldCamera>, String> {
        if self.kind.is_empty() {
            return Ok(None);
        }
        let inverse = self.camera_from_world.inverse();
        if !inverse.is_finite() {
            return Err("the camera's transform flattens the world".to_owned());
        }
        let to_metres = DAffine3::from_scale(DVec3::splat(metres_per_unit));
        let pixels = |n: f64, fallback: usize| if (1.0..=65536.0).contains(&n) { n as usize } else { fallback };
        let (x, y) = self.resolution.unwrap_or((640.0, 480.0));
        let kind = match self.kind.as_str() {
            "orthographic" => CameraKind::Orthographic {
                screen_window: self.screen_window.unwrap_or([-1.0, 1.0, -1.0, 1.0]).map(|v| v * metres_per_unit),
            },
            "environment" => CameraKind::Panorama { mapping: SkyMapping::LatLong },
            "spherical" if self.is_equirectangular => CameraKind::Panorama { mapping: SkyMapping::LatLong },
            "spherical" => CameraKind::Panorama { mapping: SkyMapping::EqualArea },
            kind @ ("realisticEye" | "humaneye" | "raytransfer" | "lightfield") => {
                CameraKind::Other { kind: kind.to_owned() }
            }
            _ if !self.lens_file.is_empty() || self.focal_length_mm.is_some() => CameraKind::Lens {
                file: self.lens_file.clone(),
                focal_length_mm: self.focal_length_mm,
                film_distance_mm: self.film_distance_mm,
                focus_distance_m: self.focus_distance.map(|d| d * metres_per_unit),
                aperture_diameter_mm: self.aperture_diameter_mm.unwrap_or(1.0),
                film_diagonal_mm: self.film_diagonal_mm.unwrap_or(35.0),
                has_diffraction: self.has_diffraction,
                has_dispersion: self.has_dispersion,
            },
            kind if !matches!(kind, "perspective" | "pinhole" | "realistic" | "omni" | "thinlens") => {
                CameraKind::Other { kind: kind.to_owned() }
            }
            _ => CameraKind::Perspective {
                fov_deg: self.fov_deg.unwrap_or(90.0),
                lens_radius_m: self.lens_radius * metres_per_unit,
                focus_distance_m: self.focus_distance.unwrap_or(1e6) * metres_per_unit,
                screen_window: self.screen_window,
            },
        };
        Ok(Some(WorldCamera {
            name: self.kind.clone(),
            world_from_camera: to_metres * inverse * to_metres.inverse(),
            kind,
            resolution: (pixels(x, 640), pixels(y, 480)),
        }))
    }
}
