//! Primitives in a tree of boxes, so that a ray is tried on few of them.

use glam::{DAffine3, DVec3, UVec2, Vec3, Vec3A};
use multiversion::multiversion;
use obvhs::{
    Boundable, BvhBuildParams,
    aabb::Aabb,
    bvh2::reinsertion::ReinsertionOptimizer,
    cwbvh::{CwBvh, bvh2_to_cwbvh::bvh2_to_cwbvh},
    ploc::PlocBuilder,
    ray::Ray as TreeRay,
    traverse,
};
use rayon::prelude::*;

use crate::{
    WorldError,
    shape::{Quadric, placed_bounds},
    triangle::{ShearedRay, TriangleHit},
};

/// A group of the world that has been placed in another.
#[derive(Clone, Debug)]
pub(crate) struct Instance {
    pub(crate) group: u32,
    pub(crate) place: DAffine3,
    pub(crate) inverse: DAffine3,
}

/// A leaf of the tree: a triangle with its corners, or something else by number.
#[derive(Clone, Copy, Debug)]
struct Slot {
    corners: [Vec3; 3],
    /// The shape that it is part of, or the instance.
    index: u32,
    /// The triangle of a mesh, or [`QUADRIC`] or [`INSTANCE`].
    primitive: u32,
}

const QUADRIC: u32 = u32::MAX;
const INSTANCE: u32 = u32::MAX - 1;

/// Shapes and instances of groups below it, in one frame.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    tree: CwBvh,
    /// In the order of the tree's leaves.
    slots: Vec<Slot>,
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
    Triangle { index: u32, b1: f32, b2: f32 },
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
    /// Checks that everything lies within 1e12 m of the origin, so that areas of boxes stay finite.
    pub(crate) fn check_extent(&self) -> Result<(), WorldError> {
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

/// One box of a list, as the tree's builder takes it.
struct PaddedBox(Aabb);

impl Boundable for PaddedBox {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Group {
    /// Builds the tree over the parts.
    pub(crate) fn build(parts: GroupParts) -> Self {
        let GroupParts { slots, boxes } = parts;
        let bounds =
            boxes.iter().fold((Vec3A::MAX, Vec3A::MIN), |(low, high), aabb| (low.min(aabb.min), high.max(aabb.max)));
        // Rounding moves the crossing of a ray with the side of a box by a few ulps of the coordinates.
        let largest = bounds.0.abs().max(bounds.1.abs()).max_element();
        let pad = if largest.is_finite() { 4.0 * f32::EPSILON * largest.max(1e-3) } else { 0.0 };
        let boxes: Vec<PaddedBox> =
            boxes.into_par_iter().enumerate().map(|(index, b)| PaddedBox(padded(b, pad, index as u32))).collect();
        let tree = build_tree(&boxes);
        drop(boxes);
        let ordered = tree.primitive_indices.par_iter().map(|&index| slots[index as usize]).collect();
        let tree = CwBvh { primitive_indices: Vec::new(), ..tree };
        Self { tree, slots: ordered, bounds: (bounds.0.as_dvec3(), bounds.1.as_dvec3()) }
    }

    /// The corners of an upright box around it; reversed where it is empty.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        self.bounds
    }

    /// Returns the nearest crossing with `0 < t < t_max`.
    pub(crate) fn nearest(&self, parts: &impl Parts, origin: Vec3, direction: Vec3, t_max: f32) -> Option<Crossing> {
        let mut found = None;
        let ray = GroupRay::new(origin, direction, t_max);
        nearest_in(self, parts, ray, &mut found);
        found
    }

    /// Tells whether anything is crossed with `0 < t < t_max`.
    pub(crate) fn is_crossed(&self, parts: &impl Parts, origin: Vec3, direction: Vec3, t_max: f32) -> bool {
        is_crossed_in(self, parts, GroupRay::new(origin, direction, t_max))
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

/// A tree of eight-way nodes over boxes, of which there can be none.
fn build_tree(boxes: &[PaddedBox]) -> CwBvh {
    if boxes.is_empty() {
        return CwBvh::default();
    }
    // The steps of obvhs's own `build_cwbvh`, without its validation in debug builds, which takes minutes.
    let settings = BvhBuildParams::medium_build();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        settings.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        settings.sort_precision,
        settings.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut binary, settings.reinsertion_batch_ratio, None);
    bvh2_to_cwbvh(&binary, 3, true, false)
}

/// A ray in the frame of a group, with what the tests of boxes and triangles need of it.
#[derive(Clone, Copy)]
struct GroupRay {
    tree: TreeRay,
    triangles: ShearedRay,
    origin: Vec3,
    direction: Vec3,
}

/// The box test of the tree takes `t` below 1e-4 for behind the ray; it is given directions shorter by this factor, so
/// that this is 1e-7 of a direction's length.
const SHORTENED: f32 = 1.0 / 1024.0;

impl GroupRay {
    fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Self {
        let shortened = SHORTENED * Vec3A::from(direction);
        // A component of 0 is as good as one so small that the ray doesn't move along it.
        // The tree takes −0 for positive.
        let inverse = |d: f32| match d {
            d if d.abs() >= 1e-18 => 1.0 / d,
            d if d < 0.0 => -1e18,
            _ => 1e18,
        };
        Self {
            tree: TreeRay {
                origin: origin.into(),
                direction: shortened,
                inv_direction: Vec3A::new(inverse(shortened.x), inverse(shortened.y), inverse(shortened.z)),
                tmin: 0.0,
                tmax: t_max / SHORTENED,
            },
            triangles: ShearedRay::new(origin, direction),
            origin,
            direction,
        }
    }

    /// Returns the ray in the frame of an instance; `t` means the same.
    fn within(&self, instance: &Instance, t_max: f32) -> Self {
        let origin = instance.inverse.transform_point3(self.origin.as_dvec3()).as_vec3();
        let direction = instance.inverse.transform_vector3(self.direction.as_dvec3()).as_vec3();
        Self::new(origin, direction, t_max)
    }

    fn meets_quadric(&self, quadric: &Quadric, t_max: f32) -> Option<f32> {
        let t = quadric.meets(self.origin.as_dvec3(), self.direction.as_dvec3(), f64::from(t_max))?;
        Some(t as f32)
    }
}

#[multiversion(targets("x86_64+avx+avx2+bmi1+bmi2+lzcnt+popcnt"), dispatcher = "direct")]
fn nearest_in<P: Parts>(group: &Group, parts: &P, ray: GroupRay, found: &mut Option<Crossing>) {
    let mut tree_ray = ray.tree;
    let mut t_max = tree_ray.tmax * SHORTENED;
    let mut state = group.tree.new_traversal(tree_ray.direction);
    let mut node;
    traverse!(group.tree, node, state, node.intersect_ray(&tree_ray, state.oct_inv4), {
        let slot = &group.slots[state.primitive_id as usize];
        let crossing = match slot.primitive {
            QUADRIC => ray.meets_quadric(parts.quadric(slot.index), t_max).map(|t| Crossing {
                t,
                shape: slot.index,
                primitive: Primitive::Quadric,
                instance: None,
            }),
            INSTANCE => {
                let instance = parts.instance(slot.index);
                let mut within = None;
                nearest_in(parts.group(instance.group), parts, ray.within(instance, t_max), &mut within);
                within.map(|crossing| Crossing { instance: Some(slot.index), ..crossing })
            }
            index => ray.triangles.meets(&slot.corners, t_max).map(|TriangleHit { t, b1, b2 }| Crossing {
                t,
                shape: slot.index,
                primitive: Primitive::Triangle { index, b1, b2 },
                instance: None,
            }),
        };
        if let Some(crossing) = crossing {
            t_max = crossing.t;
            tree_ray.tmax = t_max / SHORTENED;
            *found = Some(crossing);
        }
    });
}

#[multiversion(targets("x86_64+avx+avx2+bmi1+bmi2+lzcnt+popcnt"), dispatcher = "direct")]
fn is_crossed_in<P: Parts>(group: &Group, parts: &P, ray: GroupRay) -> bool {
    let t_max = ray.tree.tmax * SHORTENED;
    let mut state = group.tree.new_traversal(ray.tree.direction);
    let mut node;
    let mut is_crossed = false;
    'tree: {
        traverse!(group.tree, node, state, node.intersect_ray(&ray.tree, state.oct_inv4), {
            let slot = &group.slots[state.primitive_id as usize];
            is_crossed = match slot.primitive {
                QUADRIC => ray.meets_quadric(parts.quadric(slot.index), t_max).is_some(),
                INSTANCE => {
                    let instance = parts.instance(slot.index);
                    is_crossed_in(parts.group(instance.group), parts, ray.within(instance, t_max))
                }
                _ => ray.triangles.meets(&slot.corners, t_max).is_some(),
            };
            if is_crossed {
                break 'tree;
            }
        });
    }
    is_crossed
}
