//! Files of worlds and meshes.

#[cfg(feature = "gltf")]
mod gltf;
mod obj;
mod pbrt;
mod ply;

use std::path::Path;

use dioptric_spectrum::Cancel;
use glam::{DAffine3, DVec3};

pub use self::{obj::read_obj, ply::read_ply};
use crate::{Material, Shape, SpectralCurve, Texture, World, WorldBuilder, WorldError};

/// How a world file is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// How long the file's unit of length is, m. glTF is in metres by its standard; others don't say.
    pub metres_per_unit: f64,
}

impl Default for ReadOptions {
    /// Files in metres.
    fn default() -> Self {
        Self { metres_per_unit: 1.0 }
    }
}

/// Reads a world from a file: `.pbrt` (text of versions 2 to 4), `.gltf` and `.glb`, or a bare mesh as `.obj` or `.ply`.
///
/// A bare mesh is gray (reflectance 0.5) under a sky of radiance 1 W m⁻² sr⁻¹ nm⁻¹. What of a file isn't understood is
/// named in [`World::notes`] with what stands in its place. Reading takes at most 256 times the memory of the bytes read,
/// and pictures at most 2²⁸ samples each.
///
/// # Errors
/// When the file can't be read or is malformed, with its line where it has lines; when it has more than 2³¹ bytes, those
/// that it includes counted in; and when the work was cancelled.
pub fn read_world(path: &Path, options: &ReadOptions, cancel: &Cancel) -> Result<World, WorldError> {
    let unit = options.metres_per_unit;
    if !(unit > 0.0 && unit.is_finite()) {
        let (what, value) = ("the unit of length", unit.to_string());
        return Err(WorldError::Setting { what, value, expected: "a finite number of metres over 0" });
    }
    let scale = DAffine3::from_scale(DVec3::splat(unit));
    let kind = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    let builder = match kind.as_deref() {
        Some("pbrt") => pbrt::read(path, unit, cancel)?,
        #[cfg(feature = "gltf")]
        Some("gltf" | "glb") => gltf::read(path, scale, cancel)?,
        #[cfg(not(feature = "gltf"))]
        Some("gltf" | "glb") => return Err(WorldError::LacksFeature { file: path.to_owned(), feature: "gltf" }),
        Some("obj") => bare(read_obj(path)?.into_iter().map(|(_, mesh)| mesh), scale),
        Some("ply") => bare([read_ply(path)?], scale),
        _ => return Err(WorldError::UnknownKind { file: path.to_owned() }),
    };
    cancel.check()?;
    builder.build()
}

/// Gray meshes under a plain sky.
fn bare(meshes: impl IntoIterator<Item = crate::TriangleMesh>, place: DAffine3) -> WorldBuilder {
    let mut builder = WorldBuilder::new();
    let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
    let matte = builder.add_material("gray", Material::Matte { reflectance: gray });
    for mesh in meshes {
        builder.add_shape(Shape::Mesh(mesh), place, matte, None);
    }
    builder.add_light(crate::Light::Sky { radiance: SpectralCurve::constant(1.0) });
    builder.note("a bare mesh: gray of reflectance 0.5 under a sky of radiance 1 W m⁻² sr⁻¹ nm⁻¹");
    builder
}

/// Reads a file of at most this many bytes into memory.
fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, WorldError> {
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let n_bytes = std::fs::metadata(path).map_err(|e| unreadable(e.to_string()))?.len();
    if n_bytes > limit {
        return Err(unreadable(format!("{n_bytes} bytes, with {limit} left of what is read in all")));
    }
    std::fs::read(path).map_err(|e| unreadable(e.to_string()))
}
