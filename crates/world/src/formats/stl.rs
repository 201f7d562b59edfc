//! Triangle meshes of STL files, text and binary.

use std::{collections::HashMap, path::Path};

use glam::Vec3;

use super::{MAX_BYTES, read_bytes};
use crate::{TriangleMesh, WorldError};

/// Bytes before the number of triangles of a binary file, and of each of these.
const HEADER: usize = 80;
const TRIANGLE: usize = 50;

/// Reads the mesh of an STL file. Its normals are left out: they are those of the triangles.
///
/// # Errors
/// When the file can't be read, or is neither text nor binary STL.
pub fn read_stl(path: &Path) -> Result<TriangleMesh, WorldError> {
    let bytes = read_bytes(path, MAX_BYTES)?;
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let n = bytes.get(HEADER..HEADER + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    // Binary files too may begin with "solid"; they have the length that they say.
    let is_binary = n.is_some_and(|n| n.checked_mul(TRIANGLE).is_some_and(|n| n + HEADER + 4 == bytes.len()));
    let is_text = bytes.trim_ascii_start().starts_with(b"solid");
    let corners = match (is_binary, is_text, n) {
        (true, ..) => binary(&bytes),
        (false, true, _) => text(&String::from_utf8_lossy(&bytes)).map_err(|(line, reason)| {
            let file = path.to_owned();
            WorldError::Line { file, line, reason }
        })?,
        (false, false, Some(n)) => {
            let found = bytes.len().saturating_sub(HEADER + 4) / TRIANGLE;
            if found < n {
                return Err(unreadable(format!("it says {n} triangles and has {found}")));
            }
            binary(&bytes[..HEADER + 4 + n * TRIANGLE])
        }
        (false, false, None) => return Err(unreadable("expected 'solid' or the header of binary STL".to_owned())),
    };
    let mesh = joined(&corners);
    mesh.check().map_err(|e| unreadable(e.to_string()))?;
    Ok(mesh)
}

fn binary(bytes: &[u8]) -> Vec<Vec3> {
    let mut corners = Vec::new();
    for triangle in bytes[HEADER + 4..].chunks_exact(TRIANGLE) {
        let number =
            |at: usize| f32::from_le_bytes([triangle[at], triangle[at + 1], triangle[at + 2], triangle[at + 3]]);
        corners.extend([12, 24, 36].map(|at| Vec3::new(number(at), number(at + 4), number(at + 8))));
    }
    corners
}

fn text(text: &str) -> Result<Vec<Vec3>, (usize, String)> {
    let mut corners = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("vertex") => {
                let numbers: Vec<f32> = words.map_while(|word| word.parse().ok()).collect();
                let &[x, y, z] = numbers.as_slice() else {
                    return Err((
                        index + 1,
                        format!("'{}': expected a vertex of three numbers", line.trim().escape_debug()),
                    ));
                };
                corners.push(Vec3::new(x, y, z));
            }
            Some("endloop") if corners.len() % 3 != 0 => {
                return Err((index + 1, "a loop that hasn't three corners".to_owned()));
            }
            _ => {}
        }
    }
    corners.truncate(corners.len() / 3 * 3);
    Ok(corners)
}

/// Returns triangles that share the vertices at equal places.
fn joined(corners: &[Vec3]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut known: HashMap<[u32; 3], u32> = HashMap::new();
    let mut vertex = |at: Vec3| {
        *known.entry(at.to_array().map(f32::to_bits)).or_insert_with(|| {
            mesh.positions.push(at);
            mesh.positions.len() as u32 - 1
        })
    };
    let triangles = corners.chunks_exact(3).map(|c| [vertex(c[0]), vertex(c[1]), vertex(c[2])]).collect();
    mesh.triangles = triangles;
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\n\
                        facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";

    fn read(bytes: &[u8]) -> Result<TriangleMesh, WorldError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.stl");
        std::fs::write(&path, bytes).unwrap();
        read_stl(&path)
    }

    #[test]
    fn text_and_binary_are_the_same_mesh() {
        let mesh = read(TEXT.as_bytes()).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 2));
        let mut binary = b"solid binary".to_vec();
        binary.resize(HEADER, 0);
        binary.extend(2_u32.to_le_bytes());
        for triangle in 0..2 {
            binary.extend([0; 12]);
            mesh.corners(triangle)
                .iter()
                .for_each(|c| c.to_array().iter().for_each(|v| binary.extend(v.to_le_bytes())));
            binary.extend([0; 2]);
        }
        assert_eq!(read(&binary).unwrap(), mesh);
        binary[..5].copy_from_slice(b"other");
        binary.truncate(binary.len() - 9);
        assert!(read(&binary).unwrap_err().to_string().contains("2 triangles and has 1"));
    }

    #[test]
    fn wrong_files_are_refused() {
        assert!(read(TEXT.replace("1e0", "x").as_bytes()).unwrap_err().to_string().contains("line 6"));
        assert!(read(b"nothing").unwrap_err().to_string().contains("solid"));
    }
}
