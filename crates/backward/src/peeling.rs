//! Surfaces one behind another along a ray.

use dioptric_world::{Hit, InstanceId, Ray, ShapeId, World};

/// The surfaces that a ray meets, of which each hides the next.
///
/// The other side of a shape that the ray has met counts for none: of a closed object that is its back, which no part of a pupil sees past its
/// front. A shape that is open and folded is taken for closed; walls of several shapes each are surfaces of their own, unless these are one thing.
pub(crate) struct Surfaces<'a> {
    world: &'a World,
    /// From behind the last surface on, the other sides of shapes left out.
    ray: Ray,
    /// The shapes that were met, and whether from the side of their normal.
    met: Vec<(Option<InstanceId>, ShapeId, bool)>,
}

impl<'a> Surfaces<'a> {
    pub(crate) fn along(world: &'a World, ray: Ray) -> Self {
        Self { world, ray, met: vec![] }
    }

    /// Returns the ray that meets the surface after so many first; `None` where there are not so many.
    pub(crate) fn ray_behind(mut self, n_surfaces: u32) -> Option<Ray> {
        for _ in 0..n_surfaces {
            self.next()?;
        }
        // Where nothing lies behind, the ray ends past the last other side.
        let _ = self.skip_other_sides();
        Some(self.ray)
    }

    /// Moves the ray behind the other sides of shapes that were met, and returns the surface that it meets then.
    fn skip_other_sides(&mut self) -> Option<Hit> {
        loop {
            let hit = self.world.intersect(&self.ray, f32::INFINITY)?;
            let faces = faces(&hit, &self.ray);
            let is_other_side = |&(instance, shape, faced): &(Option<InstanceId>, ShapeId, bool)| {
                let is_same = shape == hit.shape;
                instance == hit.instance
                    && (is_same && faced != faces || !is_same && self.world.are_one_thing(shape, hit.shape))
            };
            if !self.met.iter().any(is_other_side) {
                return Some(hit);
            }
            self.ray = hit.ray_towards(self.ray.direction);
        }
    }
}

/// Whether a ray meets a surface from the side of its normal.
fn faces(hit: &Hit, ray: &Ray) -> bool {
    hit.geometric_normal.dot(ray.direction) < 0.0
}

impl Iterator for Surfaces<'_> {
    type Item = Hit;

    fn next(&mut self) -> Option<Hit> {
        let hit = self.skip_other_sides()?;
        self.met.push((hit.instance, hit.shape, faces(&hit, &self.ray)));
        self.ray = hit.ray_towards(self.ray.direction);
        Some(hit)
    }
}
