//! Primitives in a tree of boxes, so that a ray is tried on few of them.

use glam::{DAffine3, DVec3, Vec3, Vec3A};
use multiversion::multiversion;
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use crate::{
    WorldError,
    shape::{Quadric, placed_bounds},
    tree::{Bounded, BoxRay, Leaf, MOST_THINGS, NONE, Tree},
    triangle::{FourTriangles, LANES, ShearedRay},
};

/// A group of the world that has been placed in another.
#[derive(Clone, Debug)]
pub(crate) struct Instance {
    pub(crate) group: u32,
    pub(crate) place: DAffine3,
    pub(crate) inverse: DAffine3,
}

/// A triangle with its corners, or something else by number.
#[derive(Clone, Copy, Debug)]
struct Slot {
    corners: [Vec3; 3],
    /// The shape that it is part of, or the instance.
    index: u32,
    /// The triangle of a mesh, or [`QUADRIC`] or [`INSTANCE`].
    primitive: u32,
}

/// What a leaf of the tree holds: up to four triangles, or one thing else as the first.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Block {
    triangles: FourTriangles,
    /// Of each triangle, what [`Slot`] has.
    indices: [u32; LANES],
    primitives: [u32; LANES],
}

const QUADRIC: u32 = u32::MAX;
const INSTANCE: u32 = u32::MAX - 1;

/// Shapes and instances of groups below it, in one frame.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    tree: Tree,
    /// One a leaf of the tree.
    blocks: Vec<Block>,
    bounds: (DVec3, DVec3),
}

/// What a group is made of.
#[derive(Debug, Default)]
pub(crate) struct GroupParts {
    slots: Vec<Slot>,
    boxes: Vec<Aabb>,
}

/// All that a ray can meet.
pub(crate) trait Parts: Sync {
    fn quadric(&self, shape: u32) -> &Quadric;
    fn instance(&self, instance: u32) -> &Instance;
    fn group(&self, group: u32) -> &Group;
}

/// The nearest crossing that was found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    /// In lengths of the direction.
    pub(crate) t: f32,
    pub(crate) shape: u32,
    pub(crate) primitive: Primitive,
    pub(crate) instance: Option<u32>,
}

/// Which part of a shape.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Primitive {
    Triangle { index: u32, corners: [Vec3; 3], b1: f32, b2: f32 },
    Quadric,
}

impl GroupParts {
    pub(crate) fn add_triangle(&mut self, corners: [Vec3; 3], shape: u32, triangle: u32) {
        let [a, b, c] = corners;
        self.slots.push(Slot { corners, index: shape, primitive: triangle });
        self.boxes.push(Aabb::new(a.min(b).min(c).into(), a.max(b).max(c).into()));
    }

    pub(crate) fn add_quadric(&mut self, quadric: &Quadric, shape: u32) {
        self.add_other(quadric.bounds(), shape, QUADRIC);
    }

    pub(crate) fn add_instance(&mut self, instance: &Instance, of: &Group, index: u32) {
        let (low, high) = of.bounds;
        self.add_other(placed_bounds(&instance.place, low, high), index, INSTANCE);
    }

    fn add_other(&mut self, (low, high): (DVec3, DVec3), index: u32, primitive: u32) {
        self.slots.push(Slot { corners: [Vec3::ZERO; 3], index, primitive });
        self.boxes.push(Aabb::new(low.as_vec3a(), high.as_vec3a()));
    }
}

impl GroupParts {
    /// Checks that everything lies within 1e12 m of the origin, so that areas of boxes stay finite, and can be numbered.
    pub(crate) fn check_extent(&self) -> Result<(), WorldError> {
        if self.boxes.len() > MOST_THINGS {
            let (what, n) = ("triangles and other shapes in one group", self.boxes.len() as u64);
            return Err(WorldError::TooMany { what, n, limit: MOST_THINGS as u64 });
        }
        let is_near = |corner: Vec3A| corner.is_finite() && corner.abs().max_element() <= 1e12;
        match self.boxes.iter().find(|aabb| !is_near(aabb.min) || !is_near(aabb.max)) {
            None => Ok(()),
            Some(aabb) => Err(WorldError::Setting {
                what: "the extent of a shape",
                value: format!("{} to {} m", aabb.min, aabb.max),
                expected: "coordinates within 1e12 m of the origin",
            }),
        }
    }
}

impl Group {
    /// Builds the tree over the parts.
    pub(crate) fn build(parts: GroupParts) -> Self {
        let GroupParts { slots, boxes } = parts;
        let bounds =
            boxes.iter().fold((Vec3A::MAX, Vec3A::MIN), |(low, high), aabb| (low.min(aabb.min), high.max(aabb.max)));
        // Rounding moves the crossing of a ray with the side of a box, and of a ray with a triangle, by a few ulps of the
        // coordinates.
        let largest = bounds.0.abs().max(bounds.1.abs()).max_element();
        let pad = if largest.is_finite() { 8.0 * f32::EPSILON * largest.max(1e-3) } else { 0.0 };
        let boxes: Vec<Bounded> =
            boxes.into_par_iter().enumerate().map(|(index, b)| Bounded(padded(b, pad, index as u32))).collect();
        let (tree, leaves) = Tree::build(boxes, |index| slots[index as usize].primitive < INSTANCE);
        let blocks = leaves.par_iter().map(|leaf| Block::of(leaf, &slots)).collect();
        Self { tree, blocks, bounds: (bounds.0.as_dvec3(), bounds.1.as_dvec3()) }
    }

    /// The corners of an upright box around it; reversed where it is empty.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        self.bounds
    }

    /// Returns the nearest crossing with `0 < t < t_max`.
    pub(crate) fn nearest(&self, parts: &impl Parts, origin: Vec3, direction: Vec3, t_max: f32) -> Option<Crossing> {
        nearest_in(self, parts, &GroupRay::new(origin, direction), t_max)
    }

    /// Tells whether anything is crossed with `0 < t < t_max`.
    pub(crate) fn is_crossed(&self, parts: &impl Parts, origin: Vec3, direction: Vec3, t_max: f32) -> bool {
        is_crossed_in(self, parts, &GroupRay::new(origin, direction), t_max)
    }
}

/// Returns a box enlarged by one to two times a length.
///
/// How much differs from box to box: the builder joins neighbors that are each other's best, of which there is one pair at
/// a time among boxes that are all alike, and its time grows as the square of their number.
fn padded(aabb: Aabb, pad: f32, index: u32) -> Aabb {
    let hash = |salt: u32| {
        let mixed = (index ^ salt).wrapping_mul(0x9e37_79b1);
        (mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca77) >> 8
    };
    let by = |salt: u32| pad * (1.0 + hash(salt) as f32 / (1 << 24) as f32);
    let three = |salt: u32| Vec3A::new(by(salt), by(salt ^ 0x5bd1_e995), by(salt ^ 0x2722_0a95));
    Aabb::new(aabb.min - three(0x1656_67b1), aabb.max + three(0xd3a2_646c))
}

impl Block {
    fn of(leaf: &Leaf, slots: &[Slot]) -> Self {
        let mut block = Self { triangles: FourTriangles::NONE, indices: [0; LANES], primitives: [0; LANES] };
        for (lane, &thing) in leaf.iter().enumerate().filter(|(_, thing)| **thing != NONE) {
            let Slot { corners, index, primitive } = slots[thing as usize];
            (block.indices[lane], block.primitives[lane]) = (index, primitive);
            if primitive < INSTANCE {
                block.triangles.set(lane, corners);
            }
        }
        block
    }
}

/// A ray in the frame of a group, with what the tests of boxes and triangles need of it.
#[derive(Clone, Copy)]
struct GroupRay {
    boxes: BoxRay,
    triangles: ShearedRay,
    origin: Vec3,
    direction: Vec3,
}

impl GroupRay {
    fn new(origin: Vec3, direction: Vec3) -> Self {
        Self {
            boxes: BoxRay::new(origin.to_array(), direction.to_array()),
            triangles: ShearedRay::new(origin, direction),
            origin,
            direction,
        }
    }

    /// Returns the ray in the frame of an instance; `t` means the same.
    fn within(&self, instance: &Instance) -> Self {
        let origin = instance.inverse.transform_point3(self.origin.as_dvec3()).as_vec3();
        let direction = instance.inverse.transform_vector3(self.direction.as_dvec3()).as_vec3();
        Self::new(origin, direction)
    }

    fn meets_quadric(&self, quadric: &Quadric, t_max: f32) -> Option<f32> {
        let t = quadric.meets(self.origin.as_dvec3(), self.direction.as_dvec3(), f64::from(t_max))?;
        Some(t as f32)
    }
}

#[multiversion(targets("x86_64+avx+avx2+bmi1+bmi2+lzcnt+popcnt"), dispatcher = "direct")]
fn nearest_in<P: Parts>(group: &Group, parts: &P, ray: &GroupRay, t_max: f32) -> Option<Crossing> {
    let mut found = None;
    group.tree.nearest(&ray.boxes, t_max, |leaf, t_max| {
        let block = &group.blocks[leaf];
        let shape = block.indices[0];
        let crossing = match block.primitives[0] {
            QUADRIC => ray.meets_quadric(parts.quadric(shape), *t_max).map(|t| Crossing {
                t,
                shape,
                primitive: Primitive::Quadric,
                instance: None,
            }),
            INSTANCE => {
                let instance = parts.instance(shape);
                nearest_in(parts.group(instance.group), parts, &ray.within(instance), *t_max)
                    .map(|crossing| Crossing { instance: Some(shape), ..crossing })
            }
            _ => ray.triangles.meets(&block.triangles, *t_max).map(|hit| {
                let index = block.primitives[hit.lane];
                let corners = block.triangles.get(hit.lane);
                Crossing {
                    t: hit.t,
                    shape: block.indices[hit.lane],
                    primitive: Primitive::Triangle { index, corners, b1: hit.b1, b2: hit.b2 },
                    instance: None,
                }
            }),
        };
        if let Some(crossing) = crossing {
            *t_max = crossing.t;
            found = Some(crossing);
        }
    });
    found
}

#[multiversion(targets("x86_64+avx+avx2+bmi1+bmi2+lzcnt+popcnt"), dispatcher = "direct")]
fn is_crossed_in<P: Parts>(group: &Group, parts: &P, ray: &GroupRay, t_max: f32) -> bool {
    group.tree.any(&ray.boxes, t_max, |leaf| {
        let block = &group.blocks[leaf];
        match block.primitives[0] {
            QUADRIC => ray.meets_quadric(parts.quadric(block.indices[0]), t_max).is_some(),
            INSTANCE => {
                let instance = parts.instance(block.indices[0]);
                is_crossed_in(parts.group(instance.group), parts, &ray.within(instance), t_max)
            }
            _ => ray.triangles.meets(&block.triangles, t_max).is_some(),
        }
    })
}
