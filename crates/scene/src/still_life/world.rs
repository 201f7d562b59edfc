//! The things of the still life, and which of them a ray meets.

use glam::DVec3;

use super::{
    material::{Material, Surface},
    shape::{Crossing, Frame, Ray, Shape},
    tree::Tree,
};

/// A shape of a material at a place.
#[derive(Clone, Debug)]
pub(super) struct Object {
    pub(super) shape: Shape,
    pub(super) frame: Frame,
    pub(super) material: Material,
    pub(super) casts_shadow: bool,
}

/// All objects; those that belong together, such as a vase and what stands in it, are one thing.
#[derive(Clone, Debug)]
pub(super) struct World {
    objects: Vec<Object>,
    thing_of_object: Vec<usize>,
    tree: Tree,
    /// Of what casts a shadow.
    shadows: Tree,
}

/// Where a ray meets an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) t: f64,
    pub(super) object: usize,
    /// In the room.
    pub(super) point: DVec3,
    /// In the frame of the object.
    crossing: Crossing,
}

/// A hit with its surface; normals face the ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) object: usize,
    pub(super) point: DVec3,
    /// Of the shape, in the room.
    pub(super) flat_normal: DVec3,
    /// With the relief of the material, in the room.
    pub(super) normal: DVec3,
    pub(super) surface: Surface,
}

/// Rays start this far off a surface, m.
const OFFSET_M: f64 = 2e-5;

impl World {
    /// Returns the world of these things.
    pub(super) fn of(things: Vec<Vec<Object>>) -> Self {
        let thing_of_object =
            things.iter().enumerate().flat_map(|(thing, objects)| std::iter::repeat_n(thing, objects.len())).collect();
        let objects: Vec<Object> = things.into_iter().flatten().collect();
        let boxes: Vec<_> = objects.iter().map(|object| object.shape.bounds(&object.frame)).collect();
        let tree = Tree::over(&boxes, 0..objects.len());
        let shadows = Tree::over(&boxes, (0..objects.len()).filter(|&object| objects[object].casts_shadow));
        Self { objects, thing_of_object, tree, shadows }
    }

    /// What each object is made of.
    pub(super) fn materials(&self) -> impl Iterator<Item = Material> {
        self.objects.iter().map(|object| object.material)
    }

    /// The thing that an object belongs to.
    pub(super) fn thing_of(&self, object: usize) -> usize {
        self.thing_of_object[object]
    }

    /// Returns the first hit beyond `t_min`, leaving one thing out.
    pub(super) fn first_hit(&self, ray: Ray, t_min: f64, without: Option<usize>) -> Option<Hit> {
        let mut found: Option<(usize, Crossing)> = None;
        self.tree.walk(ray, f64::INFINITY, |object, t_max| {
            if without == Some(self.thing_of_object[object]) {
                return t_max;
            }
            let Object { shape, frame, .. } = &self.objects[object];
            // Where the faces of two objects lie in each other the first of them is met, in whatever order they are tried.
            match shape.cross(frame.inward(ray), t_min, t_max.next_up()) {
                Some(crossing) if crossing.t < t_max || found.is_none_or(|(other, _)| object < other) => {
                    found = Some((object, crossing));
                    crossing.t
                }
                _ => t_max,
            }
        });
        found.map(|(object, crossing)| Hit {
            t: crossing.t,
            object,
            point: ray.origin + crossing.t * ray.direction,
            crossing,
        })
    }

    /// Tells whether anything casts a shadow on the way from a point, over a length.
    pub(super) fn is_shadowed(&self, ray: Ray, length: f64) -> bool {
        let mut is_shadowed = false;
        self.shadows.walk(ray, length, |object, t_max| {
            let Object { shape, frame, .. } = &self.objects[object];
            if shape.cross(frame.inward(ray), OFFSET_M, length).is_some() {
                is_shadowed = true;
                // Nothing more need be looked at.
                return f64::NEG_INFINITY;
            }
            t_max
        });
        is_shadowed
    }

    /// Returns the surface at a hit of a ray of this direction, details finer than `footprint_m` blurred away.
    pub(super) fn seen(&self, hit: &Hit, direction: DVec3, footprint_m: f64) -> Seen {
        let object = &self.objects[hit.object];
        let surface = object.material.surface(hit.crossing.point, hit.crossing.normal, footprint_m);
        let facing = |normal: DVec3| {
            let normal = object.frame.rotation * normal;
            if normal.dot(direction) > 0.0 { -normal } else { normal }
        };
        Seen {
            object: hit.object,
            point: hit.point,
            flat_normal: facing(hit.crossing.normal),
            normal: facing(surface.normal),
            surface,
        }
    }

    /// How far from a pixel's center line the surface is sloped: the cosine at a hit.
    pub(super) fn cosine(&self, hit: &Hit, direction: DVec3) -> f64 {
        (self.objects[hit.object].frame.rotation * hit.crossing.normal).dot(direction).abs()
    }
}

impl Seen {
    /// Returns a ray that leaves the surface.
    pub(super) fn ray(&self, direction: DVec3) -> Ray {
        Ray { origin: self.point + OFFSET_M * self.flat_normal, direction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::still_life::{noise::unit, pigment::Pigment, room};

    fn ball(z: f64) -> Object {
        Object {
            shape: Shape::Sphere(0.5),
            frame: Frame::at(0.0, 0.0, z),
            material: Material::Matte(Pigment::Paper.index()),
            casts_shadow: true,
        }
    }

    #[test]
    fn the_tree_misses_nothing_in_the_room() {
        let world = room::world();
        let cross = |object: usize, ray: Ray, t_min: f64, t_max: f64| {
            let Object { shape, frame, .. } = &world.objects[object];
            shape.cross(frame.inward(ray), t_min, t_max).map(|crossing| (crossing.t, object))
        };
        let mut n_shadowed = 0;
        for i in 0..20_000 {
            let random = |number: i64| 2.0 * unit(i, number, 77) - 1.0;
            let direction = DVec3::new(random(0), random(1), 1.0).normalize();
            let from_eye = Ray { origin: DVec3::new(0.0, 0.225, 0.0), direction };
            let seen = world.seen(&world.first_hit(from_eye, 0.0, None).unwrap(), direction, 1e-3);
            // Along an axis too, where the ray never meets most faces.
            let axis = DVec3::AXES[i as usize % 3] * random(2).signum();
            for direction in [DVec3::new(random(3), random(4), random(5)).normalize(), axis] {
                let ray = seen.ray(direction);
                let all = (0..world.objects.len()).filter_map(|object| cross(object, ray, 0.0, f64::INFINITY));
                let nearest = all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                assert_eq!(world.first_hit(ray, 0.0, None).map(|hit| (hit.t, hit.object)), nearest, "{ray:?}");
                let casts = |&object: &usize| world.objects[object].casts_shadow;
                let is_shadowed =
                    (0..world.objects.len()).filter(casts).any(|object| cross(object, ray, OFFSET_M, 1.0).is_some());
                assert_eq!(world.is_shadowed(ray, 1.0), is_shadowed, "{ray:?}");
                n_shadowed += usize::from(is_shadowed);
            }
        }
        assert!((2_000..30_000).contains(&n_shadowed), "{n_shadowed}");
    }

    #[test]
    fn the_nearest_thing_is_met_and_things_can_be_left_out() {
        let world = World::of(vec![vec![ball(5.0)], vec![ball(2.0), ball(3.0)]]);
        let ray = Ray { origin: DVec3::ZERO, direction: DVec3::Z };
        let first = world.first_hit(ray, 0.0, None).unwrap();
        assert_eq!((first.object, first.t), (1, 1.5));
        let behind = world.first_hit(ray, 0.0, Some(world.thing_of(first.object))).unwrap();
        assert_eq!((behind.object, behind.t), (0, 4.5));
        assert!(world.is_shadowed(ray, 1.6) && !world.is_shadowed(ray, 1.4));
        let seen = world.seen(&first, ray.direction, 1e-3);
        assert!(seen.normal.dot(ray.direction) < 0.0);
    }
}
