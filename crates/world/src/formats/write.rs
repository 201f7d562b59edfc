//! Worlds written to files.

#[cfg(feature = "gltf")]
mod gltf;
mod pbrt;

use std::path::Path;

use crate::{WorldBuilder, WorldError};

/// Writes a world as `.glb`, `.gltf` with its numbers in a file beside it, or `.pbrt` (version 4) with its pictures and large meshes in a folder
/// beside it, and returns what the format does not hold, a sentence each.
///
/// A file of glTF holds more in `extras`, from which [`open_world`](crate::open_world) gives back the world as it was: that too is told.
///
/// # Errors
/// When the ending is none of these, the world cannot be built, a file cannot be written, or, `is_strict`, the format does not hold all.
pub fn write_world(builder: &WorldBuilder, path: &Path, is_strict: bool) -> Result<Vec<String>, WorldError> {
    let kind = path.extension().map(|kind| kind.to_string_lossy().to_ascii_lowercase());
    let files = match kind.as_deref() {
        Some("pbrt") => pbrt::written(builder, path)?,
        #[cfg(feature = "gltf")]
        Some(kind @ ("gltf" | "glb")) => gltf::written(builder, path, kind == "glb")?,
        #[cfg(not(feature = "gltf"))]
        Some("gltf" | "glb") => return Err(WorldError::LacksFeature { file: path.to_owned(), feature: "gltf" }),
        _ => return Err(WorldError::UnknownKind { file: path.to_owned() }),
    };
    let Written { files, mut losses } = files;
    let choices = builder.choices();
    if !(choices.animations.is_empty() && choices.variants.is_empty()) {
        losses.push("animations, and variants of materials: what is shown is written".to_owned());
    }
    if is_strict && !losses.is_empty() {
        return Err(WorldError::Unwritable { file: path.to_owned(), reason: losses.join("; ") });
    }
    for (file, bytes) in files {
        let wrong = |reason: String| WorldError::Unwritable { file: file.clone(), reason };
        if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|e| wrong(e.to_string()))?;
        }
        dioptric_files::write(&file, &bytes).map_err(|e| wrong(e.to_string()))?;
    }
    Ok(losses)
}

/// The files of a world, the last the one that is named, and what they don't hold.
struct Written {
    files: Vec<(std::path::PathBuf, Vec<u8>)>,
    losses: Vec<String>,
}
