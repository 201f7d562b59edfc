//! World files, beside what they name, of which changed copies are read.

use std::path::Path;

use dioptric_spectrum::Cancel;
use dioptric_world::{ReadOptions, read_world};

const SEEDS: [(&str, &[u8]); 13] = [
    ("small.pbrt", include_bytes!("../corpus/small.pbrt")),
    ("second.pbrt", include_bytes!("../corpus/second.pbrt")),
    ("square.ply", include_bytes!("../corpus/mesh.ply")),
    ("binary.ply", include_bytes!("../corpus/binary.ply")),
    ("mesh.obj", include_bytes!("../corpus/mesh.obj")),
    ("solid.stl", include_bytes!("../corpus/solid.stl")),
    ("world.gltf", include_bytes!("../corpus/world.gltf")),
    ("world.glb", include_bytes!("../corpus/world.glb")),
    ("curves.pbrt", include_bytes!("../corpus/curves.pbrt")),
    ("faces.ply", include_bytes!("../corpus/faces.ply")),
    ("roof.obj", include_bytes!("../corpus/roof.obj")),
    ("world.packed.glb", include_bytes!("../corpus/packed.glb")),
    ("world.moving.glb", include_bytes!("../corpus/moving.glb")),
];

/// Returns the seeds of the formats that are read here: name and bytes. The name's extension tells the format.
pub(crate) fn seeds() -> impl Iterator<Item = (&'static str, &'static [u8])> {
    SEEDS.into_iter().filter(|(name, _)| cfg!(feature = "gltf") || !name.starts_with("world."))
}

/// What they name.
const BESIDE: [(&str, &[u8]); 5] = [
    ("mesh.ply", include_bytes!("../corpus/mesh.ply")),
    ("none.mtl", include_bytes!("../corpus/none.mtl")),
    ("part.pbrt", include_bytes!("../corpus/part.pbrt")),
    ("roof.mtl", include_bytes!("../corpus/roof.mtl")),
    ("picture.png", include_bytes!("../corpus/picture.png")),
];

/// Puts what the seeds name into a folder.
pub(crate) fn write_beside(folder: &Path) {
    for (name, bytes) in BESIDE {
        std::fs::write(folder.join(name), bytes).expect("a folder that can be written to");
    }
}

/// Reads one changed file in such a folder; returns whether it was still a world.
///
/// # Panics
/// When the sentence of an error has several lines; otherwise a panic or a hang is the failure that this looks for.
pub(crate) fn read(folder: &Path, name: &str, bytes: &[u8]) -> bool {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a folder that can be written to");
    match read_world(&path, &ReadOptions { time_s: Some(0.7), ..ReadOptions::default() }, &Cancel::new()) {
        Ok(_) => true,
        Err(error) => {
            let sentence = error.to_string();
            assert!(!sentence.contains('\n'), "{sentence}");
            false
        }
    }
}
