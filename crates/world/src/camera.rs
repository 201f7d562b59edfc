//! Cameras that a world file names.

use glam::DAffine3;
use serde::{Deserialize, Serialize};

use crate::SkyMapping;

/// A camera that came with a world, for `dioptric-backward` to build.
///
/// In its own frame it looks along +z with x to the right and y up, as pbrt's do (a left-handed frame unless the
/// transform mirrors).
#[derive(Clone, Debug, PartialEq)]
pub struct WorldCamera {
    /// Its name, or the kind of camera where the file gives none.
    pub name: String,
    /// Puts the camera into the world, m.
    pub world_from_camera: DAffine3,
    /// How it makes a picture.
    pub kind: CameraKind,
    /// Columns and rows of the picture.
    pub resolution: (usize, usize),
}

/// How a camera of a file makes its picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum CameraKind {
    /// A pinhole, or a thin lens where `lens_radius_m` is over 0.
    Perspective {
        /// Angle across the shorter side of the picture, degrees.
        fov_deg: f64,
        /// Radius of the lens, m; 0 for a pinhole.
        lens_radius_m: f64,
        /// Where a thin lens is focused, m, along the axis.
        focus_distance_m: f64,
        /// Part of the picture plane that is seen, `[x min, x max, y min, y max]`; the shorter side is −1 to 1.
        screen_window: Option<[f64; 4]>,
    },
    /// A parallel projection of part of a plane.
    Orthographic {
        /// Part of the plane that is seen, `[x min, x max, y min, y max]`, m.
        screen_window: [f64; 4],
    },
    /// All directions from a point: as pbrt has it, y is the axis of a picture by angles and the poles lie above and below.
    Panorama {
        /// Which direction is where in the picture.
        mapping: SkyMapping,
    },
    /// A camera that is not supported.
    Other {
        /// What the file calls it.
        kind: String,
    },
    /// A lens of a file, or the ideal lens of the paper's `idealDiffraction` camera.
    Lens {
        /// The lens file, as written; empty for an ideal thin lens.
        file: String,
        /// Focal length of an ideal thin lens, mm.
        focal_length_mm: Option<f64>,
        /// From the rear vertex to the film, mm, where given.
        film_distance_mm: Option<f64>,
        /// Where the lens is focused, m, where given.
        focus_distance_m: Option<f64>,
        /// Diameter of the stop, mm.
        aperture_diameter_mm: f64,
        /// Diagonal of the film, mm.
        film_diagonal_mm: f64,
        /// Whether diffraction (HURB) is asked for.
        has_diffraction: bool,
        /// Whether the paper's stand-in for dispersion is asked for.
        has_dispersion: bool,
    },
}
