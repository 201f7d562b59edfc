//! The frames in which patterns are asked, and what else shapes have that few of them have.

use std::collections::HashMap;

use glam::{DAffine3, DVec3, Vec3};

use crate::{InstanceId, PatternPoint, ShapeId, mesh::normal_matrix};

/// Where the groups of a world stand.
pub(crate) trait Frames {
    /// Returns the place of an instance and its inverse.
    fn instance_place(&self, instance: InstanceId) -> (&DAffine3, &DAffine3);
}

/// What shapes have beyond their own: the frames in which patterns are asked, things that they are parts of.
#[derive(Debug, Default)]
pub(crate) struct Patterned {
    /// The place of each shape in its group; none where no texture is a pattern.
    places: Vec<ShapePlace>,
    things: HashMap<ShapeId, usize>,
}

/// The place of a shape in its group.
#[derive(Debug)]
struct ShapePlace {
    place: DAffine3,
    inverse: DAffine3,
    /// How long a length of the group is in the frame of the shape, on average.
    own_scale: f64,
}

impl ShapePlace {
    fn new(place: DAffine3) -> Self {
        let inverse = place.inverse();
        Self { place, inverse, own_scale: scale_of(&inverse) }
    }
}

fn scale_of(place: &DAffine3) -> f64 {
    place.matrix3.determinant().abs().cbrt()
}

/// The frame of a shape in the world, by way of an instance if any.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OwnFrame<'a> {
    shape: Option<&'a ShapePlace>,
    instance: Option<(&'a DAffine3, &'a DAffine3)>,
}

impl Patterned {
    pub(crate) fn of(has_patterns: bool, places: impl Iterator<Item = DAffine3>, things: &[Vec<ShapeId>]) -> Self {
        let places = places.filter(|_| has_patterns).map(ShapePlace::new).collect();
        let parts =
            |(thing, shapes): (usize, &Vec<ShapeId>)| shapes.iter().map(|&shape| (shape, thing)).collect::<Vec<_>>();
        let things = things.iter().enumerate().flat_map(parts).collect();
        Self { places, things }
    }

    pub(crate) fn are_joined(&self, a: ShapeId, b: ShapeId) -> bool {
        let thing = |shape| self.things.get(&shape);
        thing(a).is_some() && thing(a) == thing(b)
    }

    /// Returns the frame of a shape.
    pub(crate) fn place<'a>(
        &'a self,
        shape: ShapeId,
        instance: Option<InstanceId>,
        frames: &'a impl Frames,
    ) -> OwnFrame<'a> {
        OwnFrame {
            shape: self.places.get(shape.0 as usize),
            instance: instance.map(|instance| frames.instance_place(instance)),
        }
    }
}

impl OwnFrame<'_> {
    /// Returns a point of the world, with its normal, in the frame of the shape.
    pub(crate) fn own(&self, point: Vec3, normal: Vec3, footprint_m: f32) -> PatternPoint {
        PatternPoint {
            point_m: self.own_point(point),
            normal: self.own_normal(normal),
            footprint_m: f64::from(footprint_m) * self.own_scale(),
        }
    }

    /// Returns a point of the world in the frame of the shape.
    fn own_point(&self, point: Vec3) -> DVec3 {
        let in_group =
            self.instance.map_or(point.as_dvec3(), |(_, inverse)| inverse.transform_point3(point.as_dvec3()));
        self.shape.map_or(in_group, |shape| shape.inverse.transform_point3(in_group))
    }

    /// Returns a normal of the world in the frame of the shape.
    fn own_normal(&self, normal: Vec3) -> DVec3 {
        let normal = normal.as_dvec3();
        let in_group = self.instance.map_or(normal, |(place, _)| place.matrix3.transpose() * normal);
        self.shape.map_or(in_group, |shape| shape.place.matrix3.transpose() * in_group).normalize_or(DVec3::Z)
    }

    /// Returns a normal of the shape's frame in the world, of length 1.
    pub(crate) fn world_normal(&self, own: DVec3) -> Vec3 {
        let in_group = self.shape.map_or(own, |shape| normal_matrix(&shape.place) * own);
        self.instance.map_or(in_group, |(place, _)| normal_matrix(place) * in_group).normalize_or(DVec3::Z).as_vec3()
    }

    /// How long a length of the world is in the frame of the shape, on average.
    fn own_scale(&self) -> f64 {
        self.instance.map_or(1.0, |(_, inverse)| scale_of(inverse)) * self.shape.map_or(1.0, |shape| shape.own_scale)
    }
}
