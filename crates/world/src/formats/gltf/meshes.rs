//! Meshes of glTF files: morphed, skinned and placed.

use std::collections::HashMap;

use glam::{DAffine3, DMat4, DVec3, Vec2, Vec3};
use serde_json::Value;

use super::{
    MOST_COPIES, Reader,
    accessors::{self, Rows},
    draco,
    json::{extension, index, list},
    numbers_of,
    own::OwnPrimitive,
};
use crate::{GroupId, Shape, TriangleMesh, WorldError};

/// What a packed mesh may become at most, a byte.
const MOST_EXPANSION: u64 = 128;

/// A mesh's primitive as it is written.
struct Vertices {
    mesh: TriangleMesh,
    joints: Vec<Rows>,
    weights: Vec<Rows>,
}

impl Reader<'_> {
    /// Adds the mesh of a node.
    pub(super) fn mesh(&mut self, node: &Value, number: usize, place: DAffine3) -> Result<(), WorldError> {
        let meshes = list(self.root, "meshes");
        let found = meshes.get(number);
        let mesh = found.ok_or_else(|| self.fault(format!("mesh {number}, of which there are {}", meshes.len())))?;
        let weights = if node.get("weights").is_some() { list(node, "weights") } else { list(mesh, "weights") };
        let weights: Vec<f64> = weights.iter().filter_map(Value::as_f64).collect();
        let skin = index(node, "skin");
        let is_placed_often = self.uses.get(&number).is_some_and(|n| *n > MOST_COPIES) && node.get("weights").is_none();
        if skin.is_some() || !is_placed_often {
            let joints = skin.map(|skin| self.joints(skin)).transpose()?;
            for primitive in list(mesh, "primitives") {
                self.primitive(primitive, &weights, (GroupId::ROOT, place), joints.as_deref())?;
            }
            return Ok(());
        }
        if !is_whole(&place) {
            self.builder.note("meshes that a node flattens, left out");
            return Ok(());
        }
        let group = match self.groups.get(&number) {
            Some(group) => *group,
            None => {
                let group = self.builder.add_group();
                for primitive in list(mesh, "primitives") {
                    self.primitive(primitive, &weights, (group, DAffine3::IDENTITY), None)?;
                }
                self.groups.insert(number, group);
                group
            }
        };
        self.builder.add_instance(group, place);
        Ok(())
    }

    /// Returns where each joint of a skin takes the vertices: from the frame in which they are written into the world.
    fn joints(&self, skin: usize) -> Result<Vec<DAffine3>, WorldError> {
        let skins = list(self.root, "skins");
        let skin =
            skins.get(skin).ok_or_else(|| self.fault(format!("skin {skin}, of which there are {}", skins.len())))?;
        let inverse = index(skin, "inverseBindMatrices").map(|accessor| self.rows(accessor)).transpose()?;
        let inverse = |joint: usize| {
            let row = inverse.as_ref()?.rows().nth(joint)?;
            let m: [f64; 16] = row.try_into().ok()?;
            Some(DAffine3::from_mat4(DMat4::from_cols_array(&m)))
        };
        let joints = numbers_of(skin, "joints").into_iter().enumerate().map(|(number, node)| {
            let stands = self.globals.get(&node).copied().unwrap_or(DAffine3::IDENTITY);
            stands * inverse(number).unwrap_or(DAffine3::IDENTITY)
        });
        Ok(joints.collect())
    }

    fn primitive(
        &mut self,
        primitive: &Value,
        morphs: &[f64],
        (group, place): (GroupId, DAffine3),
        joints: Option<&[DAffine3]>,
    ) -> Result<(), WorldError> {
        let mode = primitive.get("mode").and_then(Value::as_u64).unwrap_or(4);
        if !(4..=6).contains(&mode) {
            self.builder.note("points and lines, which have no area: left out");
            return Ok(());
        }
        let own = self.own_primitive(primitive)?;
        if let Some(OwnPrimitive { material, emission, shape: Some((shape, own_place, is_reversed)) }) = own {
            let id = self.builder.add_shape_to(group, shape, place * own_place, material, emission);
            if is_reversed {
                self.builder.reverse(id);
            }
            return Ok(());
        }
        let packed = self.unpacked(primitive)?;
        let rows = packed.as_ref().map(|packed| &packed.rows);
        let Some(vertices) = self.vertices(primitive, rows, morphs)? else { return Ok(()) };
        let Vertices { mut mesh, joints: of_vertices, weights } = vertices;
        let n = mesh.positions.len();
        mesh.triangles = match (packed, index(primitive, "indices")) {
            (Some(packed), _) => triangles(4, &packed.indices),
            (None, Some(accessor)) => {
                let indices: Vec<u32> = self.rows(accessor)?.values.iter().map(|v| *v as u32).collect();
                triangles(mode, &indices)
            }
            (None, None) => triangles(mode, &(0..n as u32).collect::<Vec<u32>>()),
        };
        let place = match joints {
            Some(joints) => {
                skinned(&mut mesh, joints, (&of_vertices, &weights));
                DAffine3::IDENTITY
            }
            None => place,
        };
        mesh.check().map_err(|e| self.fault(e.to_string()))?;
        if mesh.triangles.is_empty() {
            return Ok(());
        }
        if !is_whole(&place) {
            // A node of scale 0 hides what it holds.
            self.builder.note("meshes that a node flattens, left out");
            return Ok(());
        }
        let (material, glow) = match own {
            Some(own) => (own.material, own.emission),
            None => self.material(self.material_of(primitive), !mesh.colors.is_empty())?,
        };
        self.builder.add_shape_to(group, Shape::Mesh(mesh), place, material, glow);
        Ok(())
    }

    /// Unpacks a primitive that is packed by Draco.
    fn unpacked(&self, primitive: &Value) -> Result<Option<draco::Unpacked>, WorldError> {
        let Some(packed) = extension(primitive, "KHR_draco_mesh_compression") else { return Ok(None) };
        let source = self.source();
        let view = index(packed, "bufferView").ok_or_else(|| self.fault("a mesh packed by Draco has no bufferView"))?;
        let (bytes, _) = source.view(view).map_err(|reason| self.fault(reason))?;
        let attributes = packed.get("attributes").and_then(Value::as_object).into_iter().flatten();
        let attributes = attributes.filter_map(|(name, id)| {
            let accessor = primitive.get("attributes").and_then(|of| index(of, name))?;
            let one = accessors::one_of(list(self.root, "accessors").get(accessor));
            Some(draco::Attribute { name: name.clone(), id: u32::try_from(id.as_u64()?).ok()?, one })
        });
        let most_bytes = (bytes.len() as u64).saturating_mul(MOST_EXPANSION).clamp(1 << 20, super::MAX_BYTES);
        let unpacked = draco::unpacked(bytes, attributes.collect(), most_bytes);
        unpacked.map(Some).map_err(|reason| self.fault(format!("a mesh packed by Draco {reason}")))
    }

    /// Returns the material of a primitive, in the variant that is shown.
    fn material_of(&self, primitive: &Value) -> Option<usize> {
        let mappings = extension(primitive, "KHR_materials_variants").map_or(&[][..], |of| list(of, "mappings"));
        let is_shown = |mapping: &&Value| numbers_of(mapping, "variants").iter().any(|of| Some(*of) == self.variant);
        mappings.iter().find(is_shown).and_then(|mapping| index(mapping, "material")).or(index(primitive, "material"))
    }

    fn vertices(
        &mut self,
        primitive: &Value,
        packed: Option<&HashMap<String, Rows>>,
        morphs: &[f64],
    ) -> Result<Option<Vertices>, WorldError> {
        let Some(Value::Object(attributes)) = primitive.get("attributes") else { return Ok(None) };
        let rows = |reader: &Self, name: &str| -> Result<Option<Rows>, WorldError> {
            if let Some(rows) = packed.and_then(|packed| packed.get(name)) {
                return Ok(Some(rows.clone()));
            }
            let accessor = attributes.get(name).and_then(Value::as_u64).and_then(|n| usize::try_from(n).ok());
            accessor.map(|accessor| reader.rows(accessor)).transpose()
        };
        let Some(positions) = rows(self, "POSITION")? else {
            self.builder.note("meshes without positions, left out");
            return Ok(None);
        };
        let mut mesh =
            TriangleMesh { positions: positions.first().map(Vec3::from_array).collect(), ..TriangleMesh::default() };
        let n = mesh.positions.len();
        let mut of_all = |name: &str| -> Result<Option<Rows>, WorldError> {
            let found = rows(self, name)?;
            let found_n = found.as_ref().map_or(n, Rows::len);
            if found_n != n {
                let sentence = "attributes of vertices of another number than the positions, left out";
                self.builder.note_of(sentence, &format!("{name} ({found_n} for {n})"));
            }
            Ok(found.filter(|_| found_n == n))
        };
        if let Some(normals) = of_all("NORMAL")? {
            mesh.normals = normals.first().map(Vec3::from_array).collect();
        }
        // v runs down the picture in glTF.
        let uvs = |rows: Rows| rows.first().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect();
        mesh.uvs = of_all("TEXCOORD_0")?.map_or(Vec::new(), uvs);
        mesh.second_uvs = of_all("TEXCOORD_1")?.map_or(Vec::new(), uvs);
        if let Some(colors) = of_all("COLOR_0")? {
            let has_alpha = colors.width > 3;
            let color = |[r, g, b, a]: [f32; 4]| [r, g, b, if has_alpha { a } else { 1.0 }];
            mesh.colors = colors.first().map(color).collect();
        }
        for name in attributes.keys() {
            let is_read = ["POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0"]
                .contains(&name.as_str())
                || name.starts_with("JOINTS_")
                || name.starts_with("WEIGHTS_")
                || name.starts_with('_');
            if !is_read {
                self.builder.note_of("attributes of vertices that aren't read, left out", name);
            }
        }
        let targets = list(primitive, "targets");
        for name in targets.iter().filter_map(Value::as_object).flat_map(serde_json::Map::keys) {
            if !["POSITION", "NORMAL", "TANGENT"].contains(&name.as_str()) && !name.starts_with('_') {
                self.builder.note_of("attributes of morph targets that aren't read, left out", name);
            }
        }
        for (target, weight) in targets.iter().zip(morphs).filter(|(_, weight)| **weight != 0.0) {
            let moved = |name: &str| index(target, name).map(|accessor| self.rows(accessor)).transpose();
            let by = *weight as f32;
            for (name, values) in [("POSITION", &mut mesh.positions), ("NORMAL", &mut mesh.normals)] {
                let Some(by_rows) = moved(name)? else { continue };
                values.iter_mut().zip(by_rows.first()).for_each(|(value, d)| *value += by * Vec3::from_array(d));
            }
        }
        mesh.normals.iter_mut().for_each(|normal| *normal = normal.normalize_or_zero());
        let (mut joints, mut weights) = (Vec::new(), Vec::new());
        for set in 0..4 {
            let pair = (rows(self, &format!("JOINTS_{set}"))?, rows(self, &format!("WEIGHTS_{set}"))?);
            let (Some(of), Some(by)) = pair else { break };
            joints.push(of);
            weights.push(by);
        }
        Ok(Some(Vertices { mesh, joints, weights }))
    }
}

/// Whether a place keeps what it moves from being flat.
fn is_whole(place: &DAffine3) -> bool {
    place.is_finite() && place.matrix3.determinant().abs() > 0.0 && place.inverse().is_finite()
}

/// Returns the triangles of a list, a strip or a fan.
pub(super) fn triangles(mode: u64, indices: &[u32]) -> Vec<[u32; 3]> {
    let three = |t: &[u32]| [t[0], t[1], t[2]];
    match mode {
        5 => {
            let turned = |(number, t): (usize, &[u32])| if number % 2 == 0 { three(t) } else { [t[1], t[0], t[2]] };
            indices.windows(3).enumerate().map(turned).collect()
        }
        6 => indices.windows(2).skip(1).map(|pair| [indices[0], pair[0], pair[1]]).collect(),
        _ => indices.chunks_exact(3).map(three).collect(),
    }
}

/// Moves vertices by the joints that hold them.
fn skinned(mesh: &mut TriangleMesh, joints: &[DAffine3], (of, by): (&[Rows], &[Rows])) {
    for vertex in 0..mesh.positions.len() {
        let (mut moved, mut total) = (DMat4::ZERO, 0.0);
        for (of, by) in of.iter().zip(by) {
            let at = vertex * of.width;
            let pairs = of.values.get(at..at + of.width).into_iter().flatten();
            let weights = by.values.get(vertex * by.width..(vertex + 1) * by.width).into_iter().flatten();
            for (joint, weight) in pairs.zip(weights) {
                if let Some(joint) = joints.get(*joint as usize).filter(|_| *weight > 0.0) {
                    moved += DMat4::from(*joint) * *weight;
                    total += weight;
                }
            }
        }
        let moved = if total > 0.0 { DAffine3::from_mat4(moved * (1.0 / total)) } else { continue };
        mesh.positions[vertex] = moved.transform_point3(mesh.positions[vertex].as_dvec3()).as_vec3();
        if let Some(normal) = mesh.normals.get_mut(vertex) {
            let by = crate::mesh::normal_matrix(&moved);
            *normal = (by * normal.as_dvec3()).normalize_or(DVec3::ZERO).as_vec3();
        }
    }
}
