//! Triangle meshes of PLY files, text and binary.

use std::{fs::File, io::BufReader, path::Path};

use glam::{Vec2, Vec3};
use ply_rs_bw::{
    parser::{Parser, Reader},
    ply::{Property, PropertyAccess, PropertyAccessResult},
};

use crate::{TriangleMesh, WorldError};

#[derive(Default)]
struct Vertex {
    position: Vec3,
    normal: Vec3,
    uv: Vec2,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let place = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "u" | "s" | "texture_u" | "texture_s" => &mut self.uv.x,
            "v" | "t" | "texture_v" | "texture_t" => &mut self.uv.y,
            _ => return PropertyAccessResult::Ignored,
        };
        match property.to_f32_lossy() {
            Some(value) => {
                *place = value;
                PropertyAccessResult::Set
            }
            None => PropertyAccessResult::UnsupportedType,
        }
    }
}

/// The vertices of a polygon; those of larger ones in `more`.
#[derive(Default)]
struct Face {
    n: usize,
    few: [u32; 4],
    more: Vec<u32>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if name != "vertex_indices" && name != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        let Some(vertices) = property.to_u32_list() else { return PropertyAccessResult::UnsupportedType };
        self.n = vertices.len();
        match self.few.get_mut(..self.n) {
            Some(few) => few.copy_from_slice(&vertices),
            None => self.more = vertices,
        }
        PropertyAccessResult::Set
    }
}

impl Face {
    fn vertices(&self) -> &[u32] {
        self.few.get(..self.n).unwrap_or(&self.more)
    }
}

/// Anything else, which is passed over.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// Returns what is wrong in a file in one sentence, with its line where the parser knows it.
fn malformed(file: &Path, error: &dyn std::fmt::Display) -> WorldError {
    let message = error.to_string();
    let numbered = message.strip_prefix("Line ").and_then(|rest| {
        let (line, rest) = rest.split_once(": ")?;
        Some((line.parse().ok()?, rest))
    });
    // The first line says what is wrong and another which words; the rest is the parser's grammar.
    let mut lines = numbered.map_or(message.as_str(), |(_, rest)| rest).lines().map(str::trim);
    let what = lines.next().unwrap_or_default().trim_end_matches('.');
    let words = lines.find_map(|line| line.strip_prefix("String: ")).map(|words| words.trim_matches('\''));
    let reason = match words {
        Some(words) => format!("{what}: '{}'", words.escape_debug()),
        None => what.escape_debug().to_string(),
    };
    match numbered {
        Some((line, _)) => WorldError::Line { file: file.to_owned(), line, reason },
        None => WorldError::Unreadable { file: file.to_owned(), reason },
    }
}

/// Reads the mesh of a PLY file: `vertex` (x, y, z; nx, ny, nz; u, v or s, t) and `face` (polygons become fans).
///
/// # Errors
/// When the file can't be read, claims more elements than it has bytes, or its mesh isn't sound.
pub fn read_ply(path: &Path) -> Result<TriangleMesh, WorldError> {
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let file = File::open(path).map_err(|e| unreadable(e.to_string()))?;
    let n_bytes = file.metadata().map_err(|e| unreadable(e.to_string()))?.len();
    let mut reader = Reader::new(BufReader::with_capacity(1 << 20, file));
    let header = Parser::<Other>::new().read_header(&mut reader).map_err(|e| malformed(path, &e))?;
    let mut mesh = TriangleMesh::default();
    for (_, element) in &header.elements {
        if element.count as u64 > n_bytes {
            let (count, name) = (element.count, &element.name);
            return Err(unreadable(format!("{count} elements '{name}' in a file of {n_bytes} bytes")));
        }
        let has = |names: &[&str]| names.iter().any(|name| element.properties.contains_key(*name));
        match element.name.as_str() {
            "vertex" => {
                let vertices = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                let vertices = vertices.map_err(|e| malformed(path, &e))?;
                mesh.positions = vertices.iter().map(|v| v.position).collect();
                if has(&["nx"]) {
                    mesh.normals = vertices.iter().map(|v| v.normal).collect();
                }
                if has(&["u", "s", "texture_u", "texture_s"]) {
                    mesh.uvs = vertices.iter().map(|v| v.uv).collect();
                }
            }
            "face" => {
                let faces = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                for face in faces.map_err(|e| malformed(path, &e))? {
                    let fan = face.vertices();
                    mesh.triangles.extend(fan.windows(2).skip(1).map(|pair| [fan[0], pair[0], pair[1]]));
                }
            }
            _ => {
                let passed = Parser::<Other>::new().read_payload_for_element(&mut reader, element, &header);
                passed.map_err(|e| malformed(path, &e))?;
            }
        }
    }
    mesh.check().map_err(|e| unreadable(e.to_string()))?;
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty double y\nproperty float z\n\
                          property float u\nproperty float v\nelement face 1\nproperty list uchar int vertex_indices\n\
                          end_header\n";

    #[test]
    fn text_and_binary_are_the_same_mesh() {
        let folder = tempfile::tempdir().unwrap();
        let corners = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let mut text = HEADER.to_owned();
        let mut binary = HEADER.replace("ascii", "binary_little_endian").into_bytes();
        for [x, y] in corners {
            text += &format!("{x} {y} 3 {x} {y}\n");
            binary.extend(x.to_le_bytes());
            binary.extend(f64::from(y).to_le_bytes());
            [3.0, x, y].iter().for_each(|v: &f32| binary.extend(v.to_le_bytes()));
        }
        text += "4 0 1 2 3\n";
        binary.push(4);
        (0..4_i32).for_each(|v| binary.extend(v.to_le_bytes()));
        let meshes = [("a.ply", text.into_bytes()), ("b.ply", binary)].map(|(name, bytes)| {
            let path = folder.path().join(name);
            File::create(&path).unwrap().write_all(&bytes).unwrap();
            read_ply(&path).unwrap()
        });
        assert_eq!(meshes[0], meshes[1]);
        assert_eq!(meshes[0], TriangleMesh::quad(Vec3::Z * 3.0, Vec3::X, Vec3::Y));
    }

    #[test]
    fn wrong_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |text: &str| {
            let path = folder.path().join("wrong.ply");
            std::fs::write(&path, text).unwrap();
            let error = read_ply(&path).unwrap_err().to_string();
            assert!(error.contains("wrong.ply"), "{error}");
            error
        };
        // With its line, and in one: the parser's own message has its grammar in further lines.
        let error = refused(&HEADER.replace("element face", "elephant face"));
        assert!(error.contains("line 9") && error.contains("'elephant face 1") && !error.contains('\n'), "{error}");
        assert!(!refused("nothing of the kind").contains('\n'));
        refused(HEADER);
        assert!(refused(&HEADER.replace("vertex 4", "vertex 4000000000")).contains("4000000000"));
        let vertices = "0 0 0 0 0\n".repeat(4);
        assert!(refused(&format!("{HEADER}{vertices}3 0 1 9\n")).contains("[0, 1, 9]"));
    }
}
