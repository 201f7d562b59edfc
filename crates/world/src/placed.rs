//! Shapes where they stand.

use crate::{Emission, Interface, LightId, MaterialId, TriangleMesh, group::GroupParts, shape::Quadric};

/// A shape in the frame of its group.
#[derive(Debug)]
pub(crate) struct PlacedShape {
    pub(crate) kind: PlacedKind,
    pub(crate) group: u32,
    pub(crate) material: MaterialId,
    pub(crate) emission: Option<Emission>,
    pub(crate) is_reversed: bool,
    pub(crate) light: Option<LightId>,
    /// The media on both sides; none where it is the same.
    pub(crate) interface: Option<Interface>,
}

#[derive(Debug)]
pub(crate) enum PlacedKind {
    Mesh(TriangleMesh),
    Quadric(Box<Quadric>),
}

impl PlacedShape {
    /// Adds what the tree is made of.
    pub(crate) fn add_to(&self, parts: &mut GroupParts, index: u32) {
        match &self.kind {
            PlacedKind::Mesh(mesh) => {
                for triangle in 0..mesh.triangles.len() {
                    parts.add_triangle(mesh.corners(triangle), index, triangle as u32);
                }
            }
            PlacedKind::Quadric(quadric) => parts.add_quadric(quadric, index),
        }
    }
}
