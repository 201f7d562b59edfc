//! Meshes packed by Draco: the extension `KHR_draco_mesh_compression`.

use std::collections::HashMap;

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};

use super::accessors::Rows;

/// The vertices and triangles of a packed mesh.
pub(super) struct Unpacked {
    pub(super) rows: HashMap<String, Rows>,
    pub(super) indices: Vec<u32>,
}

/// An attribute of a packed mesh.
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) id: u32,
    /// What stands for 1: that of integers which are shares, else 1.
    pub(super) one: f64,
}

/// Unpacks a mesh of at most so many bytes.
pub(super) fn unpacked(bytes: &[u8], attributes: Vec<Attribute>, most_bytes: u64) -> Result<Unpacked, String> {
    let limits = DecodeLimits::default()
        .with_max_points(most_bytes / 8)
        .with_max_faces(most_bytes / 8)
        .with_max_decoded_bytes(most_bytes);
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|e| format!("can't be unpacked: {e}"))?;
    let n = mesh.num_points();
    let rows = attributes.into_iter().map(|Attribute { name, id, one }| {
        let attribute = mesh.attribute_by_unique_id(id).ok_or_else(|| format!("has no attribute {id} for {name}"))?;
        let width = usize::from(attribute.num_components());
        let share = |value: f32| if one == 1.0 { value.into() } else { (f64::from(value) / one).max(-1.0) };
        let values = attribute.read_f32s(n, width).into_iter().map(share).collect();
        Ok((name, Rows { width, values }))
    });
    let indices = mesh.faces().iter().flatten().map(|point| point.0).collect();
    Ok(Unpacked { rows: rows.collect::<Result<_, String>>()?, indices })
}
