//! A world in numbers and words: what a file holds, and what of it isn't understood.

use std::path::PathBuf;

use dioptric_world::{Animation, CameraKind, World, WorldCamera};
use serde::Serialize;

use super::world_view::horizontal_fov_deg;
use crate::WorldSpec;

/// What the file of a world holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorldSummary {
    /// The file.
    pub file: PathBuf,
    /// The length of its unit as it was read, m.
    pub unit_m: f64,
    /// The corners of an upright box around everything, m; none of a world without shapes.
    pub bounds_m: Option<[[f64; 3]; 2]>,
    /// Which way is up.
    pub up: [f64; 3],
    /// Triangles and other shapes, each once however often it is placed.
    pub n_primitives: u64,
    /// Lights, glowing shapes included.
    pub n_lights: usize,
    /// The names of its objects, lights among them.
    pub objects: Vec<String>,
    /// The names of its materials, as often as they are made.
    pub materials: Vec<String>,
    /// Its cameras, in the order in which `--camera N` counts them from 1.
    pub cameras: Vec<CameraSummary>,
    /// Its animations, in the order in which `--animation N` counts them from 1.
    pub animations: Vec<AnimationSummary>,
    /// The variants of its materials.
    pub variants: Vec<String>,
    /// The files that it was read from, pictures included.
    pub sources: Vec<PathBuf>,
    /// What of it isn't understood, and what stands in its place.
    pub notes: Vec<String>,
}

/// A camera that came with a world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraSummary {
    /// Its name, or what kind of camera it is.
    pub name: String,
    /// How it makes its picture: perspective, orthographic, panorama, lens, or what the file calls a kind that isn't supported.
    pub kind: String,
    /// The angle across its picture, degrees, where it states one.
    pub horizontal_fov_deg: Option<f64>,
    /// Columns and rows of its picture.
    pub size: (usize, usize),
    /// Where it stands, m.
    pub eye_m: [f64; 3],
    /// Where it looks, of length 1.
    pub forward: [f64; 3],
}

/// How things of a file move.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AnimationSummary {
    /// Its name, or its number where the file gives none.
    pub name: String,
    /// When it ends, s.
    pub end_s: f64,
}

impl WorldSummary {
    /// Sums up a world that was read.
    pub fn of(world: &World, spec: &WorldSpec) -> Self {
        let mut materials: Vec<String> = world.material_names().map(str::to_owned).collect();
        materials.sort();
        materials.dedup();
        Self {
            file: spec.file.clone(),
            unit_m: spec.unit_m,
            bounds_m: world.bounds().map(|(low, high)| [low.to_array(), high.to_array()]),
            up: world.up().to_array(),
            n_primitives: world.n_primitives(),
            n_lights: world.n_lights(),
            objects: world.object_names().to_vec(),
            materials,
            cameras: world.cameras().iter().map(CameraSummary::of).collect(),
            animations: world.choices().animations.iter().map(AnimationSummary::of).collect(),
            variants: world.choices().variants.clone(),
            sources: world.sources().to_vec(),
            notes: world.notes().to_vec(),
        }
    }
}

impl AnimationSummary {
    fn of(Animation { name, end_s }: &Animation) -> Self {
        Self { name: name.clone(), end_s: *end_s }
    }
}

impl CameraSummary {
    fn of(camera: &WorldCamera) -> Self {
        let kind = match &camera.kind {
            CameraKind::Perspective { .. } => "perspective",
            CameraKind::Orthographic { .. } => "orthographic",
            CameraKind::Panorama { .. } => "panorama",
            CameraKind::Lens { .. } => "lens",
            CameraKind::Other { kind } => kind,
        };
        let forward = camera.world_from_camera.matrix3.z_axis.normalize_or_zero();
        Self {
            name: camera.name.clone(),
            kind: kind.to_owned(),
            horizontal_fov_deg: horizontal_fov_deg(camera),
            size: camera.resolution,
            eye_m: camera.world_from_camera.translation.to_array(),
            forward: forward.to_array(),
        }
    }
}
