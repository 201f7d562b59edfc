//! Rays from the film through the pupil, layer by layer, and where they end.

use crate::sight::{Met, Sight};

/// A ray from a film point on its way from the nearest layer to the farthest.
pub(crate) struct Ray<'a> {
    sight: &'a Sight,
    /// The position among the samples of the scene where the blur radius is 0, and how far it goes from there in a pixel of blur radius.
    position: [f32; 2],
    per_px: [f32; 2],
    /// The layer passed last.
    last: Met,
    /// Among the first surface and what lies behind it.
    paths: [Path; 2],
}

impl<'a> Ray<'a> {
    /// Returns that through the point so many pixels beside the film point in the layer of a blur radius of 1 pixel. Between the film point and the widest of the layers
    /// that it may meet the map of the film is taken for linear.
    pub(crate) fn new(sight: &'a Sight, from: (f32, f32), beside: (f32, f32), widest_px: f32) -> Self {
        let to = (from.0 + widest_px * beside.0, from.1 + widest_px * beside.1);
        let (position, end) = (sight.position_at(from), sight.position_at(to));
        let per_px = [0, 1].map(|axis| if widest_px == 0.0 { 0.0 } else { (end[axis] - position[axis]) / widest_px });
        let last = Met { layer: 0, radius_px: 0.0, is_of_first: false };
        Self { sight, position, per_px, last, paths: <[Path; 2]>::default() }
    }

    /// Passes the next of the layers that are met; returns the coordinates of the surfaces there.
    #[inline]
    pub(crate) fn pass(&mut self, met: Met) -> [f32; 2] {
        let surfaces = self.surfaces_at(met.radius_px);
        let mut paths = std::mem::take(&mut self.paths);
        for (of, (path, surface)) in paths.iter_mut().zip(surfaces).enumerate() {
            // Between two layers the blur radius goes as the coordinate does.
            path.pass(met.layer, surface, |at| {
                let part = at - self.last.layer as f32;
                self.surfaces_at(self.last.radius_px + part * (met.radius_px - self.last.radius_px))[of]
            });
        }
        self.paths = paths;
        self.last = met;
        surfaces
    }

    /// Whether it reaches a layer past those that are met.
    pub(crate) fn arrives(mut self, layer: usize, met: &[Met]) -> bool {
        for met in met.iter().take_while(|met| met.layer <= layer) {
            self.pass(*met);
            if !self.reaches(layer) {
                return false;
            }
        }
        if self.last.layer < layer {
            // A surface in it may be too small to have been met: what lies before it is passed.
            self.pass_to(layer);
        }
        self.reaches(layer)
    }

    /// Whether it ends in any of the surfaces that it has passed.
    pub(crate) fn ends(mut self) -> bool {
        self.pass_to(self.last.layer + 2);
        self.paths.iter().any(|path| path.ends != usize::MAX)
    }

    /// Passes what lies before a layer in which there is nothing.
    fn pass_to(&mut self, layer: usize) {
        self.paths.iter_mut().for_each(|path| path.pass(layer, f32::NAN, |_| f32::NAN));
    }

    /// Whether it reaches a layer.
    #[inline]
    pub(crate) fn reaches(&self, layer: usize) -> bool {
        self.paths.iter().all(|path| layer < path.ends)
    }

    /// Returns the coordinates of the surfaces where it passes a blur radius.
    #[inline]
    pub(crate) fn surfaces_at(&self, radius_px: f32) -> [f32; 2] {
        self.sight.surfaces_at([0, 1].map(|axis| self.position[axis] + radius_px * self.per_px[axis]))
    }
}

/// How far a ray comes among layers.
struct Path {
    /// The layer passed last, and the coordinate of the surface there.
    last: (usize, f32),
    /// The first of the layers that it does not reach.
    ends: usize,
}

/// The most layers that a surface goes nearer or farther from one layer to the next, as a ray passes them: of more, it is not one surface.
const MOST_OF_SURFACE: f32 = 2.0;

impl Default for Path {
    fn default() -> Self {
        Self { last: (0, f32::NAN), ends: usize::MAX }
    }
}

impl Path {
    /// Passes a layer, in which a surface lies at a coordinate where the ray is; `between` tells where it lies at a coordinate before that.
    ///
    /// The ray ends in a surface that lies behind it in one layer and before it in the next. One that only jumps to before it has an edge there, and the ray passes behind that,
    /// unless it still meets it at the depth at which it lies.
    #[inline]
    fn pass(&mut self, layer: usize, surface: f32, between: impl Fn(f32) -> f32) {
        let (last, last_surface) = self.last;
        let (first, next) = (last as f32, (last + 1) as f32);
        let lies_between = |surface: f32| surface >= first && surface < next;
        // Where no surface lies in the next layer, one can only lie in the last.
        let crosses = if last + 1 == layer {
            let is_one = last_surface >= first && surface < next && (surface - last_surface).abs() <= MOST_OF_SURFACE;
            let meets = |at: f32| lies_between(at) && (first..=at).contains(&between(at));
            is_one || meets(last_surface) || meets(surface)
        } else {
            lies_between(last_surface)
        };
        if crosses {
            // Both layers have a part of that surface.
            self.ends = self.ends.min(last + 2);
        }
        self.last = (layer, surface);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the first layer that a ray does not reach past the coordinates of a surface in layers one after the other, which goes on from one to the next or jumps halfway.
    fn ends(first: usize, surface: &[f32]) -> usize {
        let mut path = Path::default();
        for (i, &here) in surface.iter().enumerate() {
            let before = surface[i.saturating_sub(1)];
            let between = |at: f32| {
                let part = (at - (first + i) as f32 + 1.0).clamp(0.0, 1.0);
                match (here - before).abs() > MOST_OF_SURFACE {
                    true if part < 0.5 => before,
                    true => here,
                    false => before + part * (here - before),
                }
            };
            path.pass(first + i, here, between);
        }
        path.ends
    }

    #[test]
    fn rays_end_where_they_cross_a_surface() {
        // A plane between layers 2 and 3, and in layer 2.
        assert_eq!(ends(0, &[2.4; 6]), 4);
        assert_eq!(ends(0, &[2.0; 6]), 4);
        // A slant that goes away from the ray, and one that comes towards it.
        assert_eq!(ends(0, &[2.0, 2.5, 3.0, 3.5, 4.0, 4.5]), 6);
        assert_eq!(ends(0, &[6.0, 5.0, 4.0, 3.0, 2.0, 1.0]), 5);
        // Behind the edge of something near, and on to what lies far.
        assert_eq!(ends(0, &[9.0, 9.0, 9.0, 0.0, 0.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]), 11);
        assert_eq!(ends(0, &[f32::NAN; 5]), usize::MAX);
    }

    /// Whether a surface between two layers is met where it lies tells, not whether both layers see it.
    #[test]
    fn edges_between_layers_end_rays_at_their_depth() {
        // Its edge lies halfway; beyond, and this side of, the depth at which it lies.
        assert_eq!(ends(0, &[9.0, 9.0, 2.3, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]), 4);
        assert_eq!(ends(0, &[9.0, 9.0, 2.7, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]), usize::MAX);
        assert_eq!(ends(0, &[9.0, 9.0, 9.0, 2.7, 9.0, 9.0, 9.0, 9.0, 9.0]), 4);
        assert_eq!(ends(0, &[9.0, 9.0, 9.0, 2.3, 9.0, 9.0, 9.0, 9.0, 9.0]), usize::MAX);
    }

    #[test]
    fn surfaces_lie_in_the_last_layer_before_a_gap() {
        let mut path = Path::default();
        path.pass(1, 1.0, |_| 1.0);
        path.pass(7, 9.0, |_| 9.0);
        assert_eq!(path.ends, 3);
        let mut path = Path::default();
        path.pass(1, 7.0, |_| 7.0);
        path.pass(7, 7.0, |_| 7.0);
        path.pass(9, f32::NAN, |_| f32::NAN);
        assert_eq!(path.ends, 9);
    }
}
