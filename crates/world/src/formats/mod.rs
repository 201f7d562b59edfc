//! Files of worlds and meshes.

#[cfg(feature = "gltf")]
mod gltf;
mod obj;
mod pbrt;
mod ply;
mod stl;
mod write;

use std::path::Path;

use dioptric_spectrum::Cancel;
use glam::{DAffine3, DVec3};

pub use self::{obj::read_obj, ply::read_ply, stl::read_stl, write::write_world};
use crate::{
    Choices, Encoding, Material, MaterialId, Shape, SpectralCurve, Texture, TriangleMesh, UvMapping, World,
    WorldBuilder, WorldError,
};

/// How a world file is read.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// How long the file's unit of length is, m. glTF is in metres by its standard; others don't say.
    pub metres_per_unit: f64,
    /// How far its animations have come, s; without it everything stands as it is written.
    pub time_s: Option<f64>,
    /// Which animation moves it, by name or by number from 1; without it the first, and others that move what none before
    /// them does.
    pub animation: Option<String>,
    /// Which of the variants of its materials is shown, by name; without it the file's own materials.
    pub variant: Option<String>,
}

impl Default for ReadOptions {
    /// Files in metres, as they are written.
    fn default() -> Self {
        Self { metres_per_unit: 1.0, time_s: None, animation: None, variant: None }
    }
}

impl ReadOptions {
    /// Checks that a file has the animation and the variant that are asked for; a time that moves nothing is noted.
    fn check_against(&self, path: &Path, builder: &mut WorldBuilder) -> Result<(), WorldError> {
        let Choices { animations, variants } = builder.choices();
        let wrong = |what: &str, name: &str, known: Vec<&str>| {
            let known = if known.is_empty() { "it has none".to_owned() } else { known.join(", ") };
            let reason = format!("it has no {what} '{name}'; expected one of its own: {known}");
            Err(WorldError::Unreadable { file: path.to_owned(), reason })
        };
        if let Some(name) = self.variant.as_ref().filter(|name| !variants.contains(name)) {
            return wrong("variant", name, variants.iter().map(String::as_str).collect());
        }
        match &self.animation {
            Some(name) if builder.choices().animation(name).is_none() => {
                return wrong("animation", name, animations.iter().map(|of| of.name.as_str()).collect());
            }
            None if self.time_s.is_some() && animations.is_empty() => {
                builder.note("nothing in the file moves: the time changes nothing");
            }
            _ => {}
        }
        Ok(())
    }
}

/// Reads a world from a file: `.pbrt` (text of versions 2 to 4, also packed as `.pbrt.gz`), `.gltf` and `.glb`, or a mesh as
/// `.obj` with its materials, `.ply` or `.stl`.
///
/// What of a file isn't understood is named in [`World::notes`] with what stands in its place. Reading takes at most 256 times
/// the memory of the bytes read, and pictures at most 2²⁸ samples each.
///
/// # Errors
/// When the file can't be read or is malformed, with its line where it has lines; when it has more than 2³¹ bytes, those
/// that it includes counted in; and when the work was cancelled.
pub fn read_world(path: &Path, options: &ReadOptions, cancel: &Cancel) -> Result<World, WorldError> {
    open_world(path, options, cancel)?.build()
}

/// Reads a world as [`read_world`] does, to which more can be added before it is built.
///
/// # Errors
/// As [`read_world`].
pub fn open_world(path: &Path, options: &ReadOptions, cancel: &Cancel) -> Result<WorldBuilder, WorldError> {
    let unit = options.metres_per_unit;
    if !(unit > 0.0 && unit.is_finite()) {
        let (what, value) = ("the unit of length", unit.to_string());
        return Err(WorldError::Setting { what, value, expected: "a finite number of metres over 0" });
    }
    let scale = DAffine3::from_scale(DVec3::splat(unit));
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let name = name.strip_suffix(".gz").filter(|name| name.ends_with(".pbrt")).unwrap_or(&name);
    let mut builder = match name.rsplit_once('.').map(|(_, kind)| kind) {
        Some("pbrt") => pbrt::read(path, unit, cancel)?,
        #[cfg(feature = "gltf")]
        Some("gltf" | "glb") => gltf::read(path, scale, options, cancel)?,
        #[cfg(not(feature = "gltf"))]
        Some("gltf" | "glb") => return Err(WorldError::LacksFeature { file: path.to_owned(), feature: "gltf" }),
        Some("obj") => obj::read(path, unit)?,
        Some("ply") => {
            let ply::Contents { mesh, pictures, left } = ply::read(path)?;
            bare(path, mesh, (scale, DVec3::Y), &pictures, &left)
        }
        Some("stl") => {
            let (mesh, left) = stl::read(path)?;
            bare(path, mesh, (scale, DVec3::Z), &[], &left)
        }
        _ => return Err(WorldError::UnknownKind { file: path.to_owned() }),
    };
    cancel.check()?;
    options.check_against(path, &mut builder)?;
    let most_likely_m = match name.rsplit_once('.').map(|(_, kind)| kind) {
        Some("gltf" | "glb") => f64::INFINITY,
        Some("stl") => MOST_LIKELY_OF_STL_M,
        _ => MOST_LIKELY_M,
    };
    let extent_m = builder.extent_m();
    if unit == 1.0 && extent_m > most_likely_m {
        builder.note(format!(
            "the file says no unit: in metres, as it is taken, all of it is {extent_m:.0} m wide; --unit-m 0.001 takes millimetres"
        ));
    }
    if builder.is_empty() {
        builder.note("nothing in the file has an area: no faces and no other shapes");
    }
    Ok(builder)
}

/// Worlds wider than this are seldom in metres, and what is made for printers.
const MOST_LIKELY_M: f64 = 1000.0;
const MOST_LIKELY_OF_STL_M: f64 = 10.0;

/// A mesh without a material: of the picture that it names, gray or of its own colors; with what of its file isn't read.
fn bare(
    path: &Path,
    mesh: TriangleMesh,
    (place, up): (DAffine3, DVec3),
    pictures: &[String],
    left: &[String],
) -> WorldBuilder {
    let mut builder = WorldBuilder::new();
    builder.set_up(up, false);
    builder.add_source(path);
    left.iter().for_each(|word| builder.note_of("of the file isn't read", word));
    if pictures.len() > 1 {
        builder.note(format!("of {} pictures the first is laid over all of the mesh", pictures.len()));
    }
    let picture = pictures.first().filter(|_| !mesh.uvs.is_empty());
    let picture =
        picture.and_then(|name| obj::picture(&mut builder, &obj::beside(path.parent()?, name), Encoding::Srgb));
    let material = match picture {
        Some(image) => {
            if !mesh.colors.is_empty() {
                builder.note("colors beside a picture: left out");
            }
            let texture = Texture::Image { image, mapping: UvMapping::IDENTITY, scale: 1.0 };
            let reflectance = builder.add_texture(texture);
            builder.add_material("picture", Material::Matte { reflectance })
        }
        None => plain(&mut builder, !mesh.colors.is_empty()),
    };
    builder.name_next(&path.file_stem().unwrap_or_default().to_string_lossy());
    builder.add_shape(Shape::Mesh(mesh), place, material, None);
    builder
}

/// Adds the material of meshes without one: gray of reflectance 0.5, or the colors of their vertices.
fn plain(builder: &mut WorldBuilder, has_colors: bool) -> MaterialId {
    let (name, texture) = match has_colors {
        true => ("colors of the vertices", Texture::VertexColors),
        false => {
            builder.note("meshes without a material: gray of reflectance 0.5");
            ("gray", Texture::Curve(SpectralCurve::constant(0.5)))
        }
    };
    let reflectance = builder.add_texture(texture);
    builder.add_material(name, Material::Matte { reflectance })
}

/// The most bytes that a file may have.
const MAX_BYTES: u64 = 1 << 31;

/// Reads a file of at most this many bytes into memory.
fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, WorldError> {
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let n_bytes = std::fs::metadata(path).map_err(|e| unreadable(e.to_string()))?.len();
    if n_bytes > limit {
        return Err(unreadable(format!("{n_bytes} bytes, with {limit} left of what is read in all")));
    }
    std::fs::read(path).map_err(|e| unreadable(e.to_string()))
}
