//! Triangle meshes of PLY files, text and binary.

use std::{
    fs::File,
    io::{BufReader, Cursor, Read},
    path::Path,
};

use dioptric_spectrum::srgb_decode;
use glam::{Vec2, Vec3};
use ply_rs_bw::{
    parser::{Parser, Reader},
    ply::{Property, PropertyAccess, PropertyAccessResult},
};

use crate::{TriangleMesh, WorldError, mesh::polygon};

#[derive(Default)]
struct Vertex {
    position: Vec3,
    normal: Vec3,
    uv: Vec2,
    /// As it is written.
    color: Option<[f32; 4]>,
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
            _ if US.contains(&name) => &mut self.uv.x,
            _ if VS.contains(&name) => &mut self.uv.y,
            _ if COLORS.contains(&name) => return set_channel(&mut self.color, name, &property),
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

/// What is read of vertices and faces.
const PLACES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const US: [&str; 4] = ["u", "s", "texture_u", "texture_s"];
const VS: [&str; 4] = ["v", "t", "texture_v", "texture_t"];
const COLORS: [&str; 11] =
    ["red", "green", "blue", "alpha", "r", "g", "b", "diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"];
const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Takes a channel of a color: whole numbers are codes, a missing alpha is opaque.
fn set_channel(color: &mut Option<[f32; 4]>, name: &str, property: &Property) -> PropertyAccessResult {
    let channel = match name.trim_start_matches("diffuse_").as_bytes().first() {
        Some(b'r') => 0,
        Some(b'g') => 1,
        Some(b'b') => 2,
        _ => 3,
    };
    let most = match property {
        Property::UChar(_) | Property::Char(_) => 255.0,
        Property::UShort(_) | Property::Short(_) => 65535.0,
        _ => 1.0,
    };
    let Some(value) = property.to_f32_lossy() else { return PropertyAccessResult::UnsupportedType };
    color.get_or_insert([0.0, 0.0, 0.0, 1.0])[channel] = value / most;
    PropertyAccessResult::Set
}

/// Returns the light of a color as it is written, which is as it is shown.
fn light([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    let light = |code: f32| srgb_decode(f64::from(code.clamp(0.0, 1.0))) as f32;
    [light(r), light(g), light(b), a]
}

/// The vertices of a polygon; those of larger ones in `more`.
#[derive(Default)]
struct Face {
    n: usize,
    few: [u32; 4],
    more: Vec<u32>,
    own: Option<Box<OfFace>>,
}

/// What a face has of its own: texture coordinates of its corners, u and v in turn, and a color as it is written.
#[derive(Default)]
struct OfFace {
    uvs: Vec<f32>,
    color: Option<[f32; 4]>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match (name, &property) {
            ("texcoord", Property::ListFloat(uvs)) => {
                self.own.get_or_insert_default().uvs.clone_from(uvs);
                return PropertyAccessResult::Set;
            }
            ("texcoord", Property::ListDouble(uvs)) => {
                self.own.get_or_insert_default().uvs = uvs.iter().map(|v| *v as f32).collect();
                return PropertyAccessResult::Set;
            }
            _ if COLORS.contains(&name) => {
                return set_channel(&mut self.own.get_or_insert_default().color, name, &property);
            }
            _ if !INDICES.contains(&name) => return PropertyAccessResult::Ignored,
            _ => {}
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

/// Strips of triangles: vertices, and −1 where one ends.
#[derive(Default)]
struct Strips(Vec<i64>);

impl PropertyAccess for Strips {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !INDICES.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListInt(values) => values.into_iter().map(i64::from).collect(),
            Property::ListShort(values) => values.into_iter().map(i64::from).collect(),
            Property::ListChar(values) => values.into_iter().map(i64::from).collect(),
            property => match property.to_u32_list() {
                Some(values) => values.into_iter().map(i64::from).collect(),
                None => return PropertyAccessResult::UnsupportedType,
            },
        };
        PropertyAccessResult::Set
    }
}

impl Strips {
    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.0.split(|vertex| *vertex < 0).flat_map(|strip| {
            let index = |vertex: i64| u32::try_from(vertex).unwrap_or(u32::MAX);
            strip.windows(3).enumerate().filter(|(_, t)| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).map(
                move |(number, t)| match number % 2 {
                    0 => [index(t[0]), index(t[1]), index(t[2])],
                    _ => [index(t[1]), index(t[0]), index(t[2])],
                },
            )
        })
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

/// Reads the mesh of a PLY file: `vertex` (x, y, z; nx, ny, nz; u, v or s, t; red, green, blue, alpha as they are shown),
/// `face` (polygons, with texture coordinates and colors of their own) and `tristrips`.
///
/// # Errors
/// When the file can't be read, claims more elements than it has bytes, or its mesh isn't sound.
pub fn read_ply(path: &Path) -> Result<TriangleMesh, WorldError> {
    Ok(read(path)?.mesh)
}

/// All of a file.
pub(super) struct Contents {
    pub(super) mesh: TriangleMesh,
    /// The pictures that its comments name.
    pub(super) pictures: Vec<String>,
    /// Elements and properties that aren't read.
    pub(super) left: Vec<String>,
}

/// Reads all of a file.
pub(super) fn read(path: &Path) -> Result<Contents, WorldError> {
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let file = File::open(path).map_err(|e| unreadable(e.to_string()))?;
    let n_bytes = file.metadata().map_err(|e| unreadable(e.to_string()))?.len();
    // Some writers begin with capital letters.
    let mut magic = Vec::with_capacity(3);
    (&file).take(3).read_to_end(&mut magic).map_err(|e| unreadable(e.to_string()))?;
    magic.make_ascii_lowercase();
    let mut reader = Reader::new(BufReader::with_capacity(1 << 20, Cursor::new(magic).chain(file)));
    let header = Parser::<Other>::new().read_header(&mut reader).map_err(|e| malformed(path, &e))?;
    let picture = |comment: &String| Some(comment.trim().strip_prefix("TextureFile")?.trim().to_owned());
    let pictures = header.comments.iter().filter_map(picture).collect();
    let (mut mesh, mut left) = (TriangleMesh::default(), Vec::new());
    // Vertices, and what their triangle's face has of its own.
    let mut of_faces: Vec<([Vec2; 3], Option<[f32; 4]>)> = Vec::new();
    let (mut has_face_uvs, mut has_face_colors) = (false, false);
    for (_, element) in &header.elements {
        if element.count as u64 > n_bytes {
            let (count, name) = (element.count, &element.name);
            return Err(unreadable(format!("{count} elements '{name}' in a file of {n_bytes} bytes")));
        }
        let has = |names: &[&str]| names.iter().any(|name| element.properties.contains_key(*name));
        let is_read = |name: &str| match element.name.as_str() {
            "vertex" => [&PLACES[..], &US, &VS, &COLORS].concat().contains(&name),
            "face" => COLORS.contains(&name) || INDICES.contains(&name) || name == "texcoord",
            "tristrips" => INDICES.contains(&name),
            _ => false,
        };
        let names = element.properties.iter().map(|(name, _)| name).filter(|name| !is_read(name));
        left.extend(names.map(|name| format!("{name} of {}", element.name)));
        match element.name.as_str() {
            "vertex" => {
                let vertices = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                let vertices = vertices.map_err(|e| malformed(path, &e))?;
                if let Some(axis) = ["x", "y", "z"].into_iter().find(|axis| !has(&[axis])) {
                    return Err(unreadable(format!("its vertices have no {axis}")));
                }
                mesh.positions = vertices.iter().map(|v| v.position).collect();
                if has(&["nx"]) {
                    mesh.normals = vertices.iter().map(|v| v.normal).collect();
                }
                if vertices.iter().any(|v| v.color.is_some()) {
                    mesh.colors = vertices.iter().map(|v| light(v.color.unwrap_or([1.0; 4]))).collect();
                }
                if has(&US) {
                    mesh.uvs = vertices.iter().map(|v| v.uv).collect();
                }
            }
            "face" => {
                let faces = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                (has_face_uvs, has_face_colors) = (has(&["texcoord"]), has(&COLORS));
                for face in faces.map_err(|e| malformed(path, &e))? {
                    let corners = face.vertices();
                    let place = |v: &u32| mesh.positions.get(*v as usize).map_or(Vec3::ZERO, |p| *p);
                    let places: Vec<Vec3> = corners.iter().map(place).collect();
                    for triangle in polygon(&places) {
                        mesh.triangles.push(triangle.map(|k| corners[k]));
                        if has_face_uvs || has_face_colors {
                            let own = face.own.as_deref();
                            let uv = |k: usize| {
                                let uvs = own.and_then(|own| own.uvs.get(2 * k..2 * k + 2));
                                uvs.map_or(Vec2::ZERO, Vec2::from_slice)
                            };
                            of_faces.push((triangle.map(uv), own.and_then(|own| own.color)));
                        }
                    }
                }
            }
            "tristrips" => {
                let strips = Parser::<Strips>::new().read_payload_for_element(&mut reader, element, &header);
                for strips in strips.map_err(|e| malformed(path, &e))? {
                    mesh.triangles.extend(strips.triangles());
                }
            }
            _ => {
                let passed = Parser::<Other>::new().read_payload_for_element(&mut reader, element, &header);
                passed.map_err(|e| malformed(path, &e))?;
            }
        }
    }
    mesh.check().map_err(|e| unreadable(e.to_string()))?;
    if has_face_colors && !mesh.colors.is_empty() {
        left.push("colors of faces (vertices have their own)".to_owned());
        has_face_colors = false;
    }
    // Strips have nothing of their own.
    of_faces.resize(mesh.triangles.len(), ([Vec2::ZERO; 3], None));
    if has_face_uvs || has_face_colors {
        mesh = parted(&mesh);
        if has_face_uvs {
            mesh.uvs = of_faces.iter().flat_map(|(uvs, _)| *uvs).collect();
        }
        if has_face_colors {
            mesh.colors = of_faces.iter().flat_map(|(_, color)| [light(color.unwrap_or([1.0; 4])); 3]).collect();
        }
    }
    Ok(Contents { mesh, pictures, left })
}

/// Returns a mesh each of whose triangles has vertices of its own.
fn parted(mesh: &TriangleMesh) -> TriangleMesh {
    fn of<T: Copy>(list: &[T], mesh: &TriangleMesh) -> Vec<T> {
        if list.is_empty() {
            return Vec::new();
        }
        mesh.triangles.iter().flatten().map(|v| list[*v as usize]).collect()
    }
    TriangleMesh {
        positions: of(&mesh.positions, mesh),
        normals: of(&mesh.normals, mesh),
        uvs: of(&mesh.uvs, mesh),
        second_uvs: Vec::new(),
        colors: of(&mesh.colors, mesh),
        triangles: (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
    }
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
        let capital = text.replacen("ply", "PLY", 1);
        let meshes =
            [("a.ply", text.into_bytes()), ("b.ply", binary), ("c.ply", capital.into_bytes())].map(|(name, bytes)| {
                let path = folder.path().join(name);
                File::create(&path).unwrap().write_all(&bytes).unwrap();
                read_ply(&path).unwrap()
            });
        assert_eq!((&meshes[0], &meshes[0]), (&meshes[1], &meshes[2]));
        assert_eq!(meshes[0], TriangleMesh::quad(Vec3::Z * 3.0, Vec3::X, Vec3::Y));
    }

    #[test]
    fn colors_and_strips_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                    property uchar red\nproperty uchar green\nproperty uchar blue\nelement tristrips 1\n\
                    property list int int vertex_indices\nend_header\n\
                    0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n1 1 0 188 188 188\n8 0 1 2 3 -1 2 1 3\n";
        std::fs::write(&path, text).unwrap();
        let mesh = read_ply(&path).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [2, 1, 3]]);
        assert_eq!(mesh.colors[0], [1.0, 0.0, 0.0, 1.0]);
        // A code of 188 is half the light of 255.
        assert!((mesh.colors[3][0] - 0.5).abs() < 0.01, "{:?}", mesh.colors[3]);
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

    /// What `MeshLab` and trimesh write: texture coordinates and colors of faces, and the name of a picture.
    #[test]
    fn faces_have_coordinates_and_colors_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let text = |own: &str, faces: &str| {
            let head = "ply\nformat ascii 1.0\ncomment TextureFile a b.png\nelement vertex 4\nproperty float x\nproperty float y\n\
                        property float z\nelement face 2\nproperty list uchar int vertex_indices\n";
            std::fs::write(&path, format!("{head}{own}end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n{faces}")).unwrap();
            read(&path).unwrap()
        };
        let colored = text(
            "property uchar red\nproperty uchar green\nproperty uchar blue\n",
            "3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n",
        );
        assert_eq!(colored.mesh.colors[..3], [[1.0, 0.0, 0.0, 1.0]; 3]);
        assert_eq!(colored.mesh.colors[3..], [[0.0, 1.0, 0.0, 1.0]; 3]);
        assert_eq!((colored.pictures, colored.left), (vec!["a b.png".to_owned()], Vec::new()));
        let laid = text("property list uchar float texcoord\n", "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0.5 0.5 1 1 0 1\n");
        let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.5], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from_array);
        assert_eq!(laid.mesh.uvs, uvs);
        assert_eq!((laid.mesh.positions.len(), laid.mesh.corners(1)[2]), (6, Vec3::Y));
    }
}
