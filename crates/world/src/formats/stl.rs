//! Triangle meshes of STL files, text and binary.

use std::{collections::HashMap, path::Path};

use dioptric_spectrum::srgb_decode;
use glam::Vec3;

use super::{MAX_BYTES, read_bytes};
use crate::{TriangleMesh, WorldError};

/// Bytes before the number of triangles of a binary file, and of each of these.
const HEADER: usize = 80;
const TRIANGLE: usize = 50;

/// Reads the mesh of an STL file, with the colors that `VisCAM`'s and Magics' binary files have. Its normals are left out: they are those
/// of the triangles.
///
/// # Errors
/// When the file can't be read, or is neither text nor binary STL.
pub fn read_stl(path: &Path) -> Result<TriangleMesh, WorldError> {
    Ok(read(path)?.0)
}

/// Corners, a color a triangle as it is shown or none, and what isn't read.
#[derive(Default)]
struct Contents {
    corners: Vec<Vec3>,
    colors: Vec<[f32; 3]>,
    left: Vec<String>,
}

/// Reads a mesh, and what of its file isn't known.
pub(super) fn read(path: &Path) -> Result<(TriangleMesh, Vec<String>), WorldError> {
    let bytes = read_bytes(path, MAX_BYTES)?;
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let n = bytes.get(HEADER..HEADER + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    // Binary files too may begin with "solid"; they have the length that they say.
    let is_binary = n.is_some_and(|n| n.checked_mul(TRIANGLE).is_some_and(|n| n + HEADER + 4 == bytes.len()));
    let is_text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let contents = match (is_binary, is_text, n) {
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
    let mut mesh = joined(&contents.corners, !contents.colors.is_empty());
    let light = |color: &[f32; 3]| {
        let [r, g, b] = color.map(|code| srgb_decode(f64::from(code)) as f32);
        [[r, g, b, 1.0]; 3]
    };
    mesh.colors = contents.colors.iter().flat_map(light).collect();
    mesh.check().map_err(|e| unreadable(e.to_string()))?;
    Ok((mesh, contents.left))
}

fn binary(bytes: &[u8]) -> Contents {
    let mut corners = Vec::new();
    let mut codes = Vec::new();
    for triangle in bytes[HEADER + 4..].chunks_exact(TRIANGLE) {
        codes.push(u16::from_le_bytes([triangle[48], triangle[49]]));
        let number =
            |at: usize| f32::from_le_bytes([triangle[at], triangle[at + 1], triangle[at + 2], triangle[at + 3]]);
        corners.extend([12, 24, 36].map(|at| Vec3::new(number(at), number(at + 4), number(at + 8))));
    }
    let (colors, left) = colors(&bytes[..HEADER], &codes);
    Contents { corners, colors, left }
}

/// Returns a color a triangle from the two bytes behind each, or none, and what isn't known of them. Magics' header has the color of the
/// whole, which triangles with the highest bit have; `VisCAM`'s highest bit says that there is a color.
fn colors(header: &[u8], codes: &[u16]) -> (Vec<[f32; 3]>, Vec<String>) {
    if codes.iter().all(|code| *code == 0) && !header.windows(6).any(|word| word == b"COLOR=") {
        return (Vec::new(), Vec::new());
    }
    let part = |code: u16, shift: u16| f32::from(code >> shift & 31) / 31.0;
    let of_whole = header.windows(9).find_map(|word| word.strip_prefix(b"COLOR="));
    let color = |code: &u16| match (of_whole, code >> 15) {
        (Some(_), 0) => Some([part(*code, 0), part(*code, 5), part(*code, 10)]),
        (Some(whole), _) => Some([0, 1, 2].map(|k| f32::from(whole[k]) / 255.0)),
        (None, 1) => Some([part(*code, 10), part(*code, 5), part(*code, 0)]),
        (None, _) => None,
    };
    if codes.iter().all(|code| color(code).is_none()) {
        return (Vec::new(), vec!["the two bytes behind each triangle, which are no color".to_owned()]);
    }
    // Gray of the reflectance 0.5 where there is none.
    (codes.iter().map(|code| color(code).unwrap_or([0.735; 3])).collect(), Vec::new())
}

fn text(text: &str) -> Result<Contents, (usize, String)> {
    let mut corners = Vec::new();
    let mut left: Vec<String> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        let word = words.next().unwrap_or("").to_ascii_lowercase();
        match word.as_str() {
            "vertex" => {
                let numbers: Vec<f32> = words.map_while(|word| word.parse().ok()).collect();
                let &[x, y, z] = numbers.as_slice() else {
                    return Err((
                        index + 1,
                        format!("'{}': expected a vertex of three numbers", line.trim().escape_debug()),
                    ));
                };
                corners.push(Vec3::new(x, y, z));
            }
            "endloop" if corners.len() % 3 != 0 => {
                return Err((index + 1, "a loop that hasn't three corners".to_owned()));
            }
            "" | "solid" | "facet" | "outer" | "endloop" | "endfacet" | "endsolid" => {}
            other if left.len() < 1000 => left.push(other.chars().take(40).collect()),
            _ => {}
        }
    }
    corners.truncate(corners.len() / 3 * 3);
    Ok(Contents { corners, colors: Vec::new(), left })
}

/// Returns triangles that share the vertices at equal places, or have their own each.
fn joined(corners: &[Vec3], is_parted: bool) -> TriangleMesh {
    if is_parted {
        let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        return TriangleMesh { positions: corners.to_vec(), triangles, ..TriangleMesh::default() };
    }
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

    /// The two bytes behind a triangle: red by `VisCAM`, blue by Magics, whose whole is green; and no color at all.
    #[test]
    fn colors_are_those_of_either_program() {
        let with = |header: &[u8], codes: [u16; 2]| {
            let mut bytes = header.to_vec();
            bytes.resize(HEADER, 0);
            bytes.extend(2_u32.to_le_bytes());
            for (at, code) in codes.into_iter().enumerate() {
                let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, at as f32];
                bytes.extend([0.0; 3].into_iter().chain(corners).flat_map(f32::to_le_bytes));
                bytes.extend(code.to_le_bytes());
            }
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.stl");
            std::fs::write(&path, bytes).unwrap();
            super::read(&path).unwrap()
        };
        let (mesh, _) = with(b"VisCAM", [0x8000 | 31 << 10, 0]);
        assert_eq!(mesh.colors[0], [1.0, 0.0, 0.0, 1.0]);
        assert!((mesh.colors[3][0] - 0.5).abs() < 0.01, "{:?}", mesh.colors);
        let (mesh, _) = with(b"COLOR=\x00\xff\x00\xff", [31 << 10, 0x8000]);
        assert_eq!((mesh.colors[0], mesh.colors[3]), ([0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 1.0]));
        let (mesh, left) = with(b"other", [7, 0]);
        assert!(mesh.colors.is_empty() && left.len() == 1, "{left:?}");
    }
}
