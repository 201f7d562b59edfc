//! Triangle meshes of Wavefront OBJ files.

use std::{fs::File, io::BufReader, path::Path};

use glam::{Vec2, Vec3};

use crate::{TriangleMesh, WorldError};

/// Reads the meshes of an OBJ file, one an object and material, with its name. Materials aren't read, and points and lines, which have no
/// area, are left out.
///
/// # Errors
/// When the file can't be read, or a mesh isn't sound.
pub fn read_obj(path: &Path) -> Result<Vec<(String, TriangleMesh)>, WorldError> {
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let file = File::open(path).map_err(|e| unreadable(e.to_string()))?;
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut BufReader::with_capacity(1 << 20, file), &options, no_materials)
        .map_err(|e| unreadable(e.to_string()))?;
    models
        .into_iter()
        .map(|model| {
            let threes = |values: &[f32]| values.chunks_exact(3).map(Vec3::from_slice).collect::<Vec<_>>();
            let mesh = TriangleMesh {
                positions: threes(&model.mesh.positions),
                normals: threes(&model.mesh.normals),
                uvs: model.mesh.texcoords.chunks_exact(2).map(Vec2::from_slice).collect(),
                triangles: model.mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
                ..TriangleMesh::default()
            };
            mesh.check().map_err(|e| unreadable(e.to_string()))?;
            Ok((model.name, mesh))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_read_with_normals_and_textures() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("two.obj");
        let text = "o first\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n\
                    o second\nf 1 2 3\n";
        std::fs::write(&path, text).unwrap();
        let meshes = read_obj(&path).unwrap();
        assert_eq!(meshes.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["first", "second"]);
        assert_eq!((meshes[0].1.triangles.len(), meshes[1].1.triangles.len()), (2, 1));
        assert!(meshes[0].1.normals.iter().all(|n| *n == Vec3::Z) && meshes[1].1.normals.is_empty());
        // Lines between vertices have no normals of their own.
        std::fs::write(&path, text.replace("o second", "l 1 2\np 3\no second")).unwrap();
        assert_eq!(read_obj(&path).unwrap(), meshes);
        std::fs::write(&path, "v 0 0\nf 1 2 3\n").unwrap();
        assert!(read_obj(&path).unwrap_err().to_string().contains("two.obj"));
    }
}
