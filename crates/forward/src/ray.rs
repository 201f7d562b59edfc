//! Rays from the film through the pupil, layer by layer, and where they end.

use crate::sight::{Lanes, Met, RAYS, Surfaces};

/// Rays from film points on their way from the nearest layer to the farthest.
pub(crate) struct Rays<'a> {
    surfaces: Surfaces<'a>,
    /// The positions among the samples of the scene, rows and columns, where the blur radius is 0, and how far they go from there in a pixel of blur radius.
    position: [Lanes; 2],
    per_px: [Lanes; 2],
    /// The layer passed last.
    last: Met,
    /// Among the first surface and what lies behind it.
    paths: [Paths; 2],
}

impl<'a> Rays<'a> {
    /// Returns those from positions among the samples of the scene in focus, which go so far from there in a pixel of blur radius.
    #[inline(always)]
    pub(crate) fn new(surfaces: Surfaces<'a>, position: [Lanes; 2], per_px: [Lanes; 2]) -> Self {
        let last = Met { layer: 0, radius_px: 0.0, is_of_first: false };
        Self { surfaces, position, per_px, last, paths: <[Paths; 2]>::default() }
    }

    /// Passes the next of the layers that are met; returns the coordinates of the surfaces there.
    #[inline(always)]
    pub(crate) fn pass(&mut self, met: Met) -> [Lanes; 2] {
        let surfaces = self.surfaces_at(met.radius_px);
        let (all, position, per_px, last) = (self.surfaces, self.position, self.per_px, self.last);
        for (of, (paths, surfaces)) in self.paths.iter_mut().zip(&surfaces).enumerate() {
            // Between two layers the blur radius goes as the coordinate does.
            paths.pass(met.layer, surfaces, |ray, at| {
                let part = at - last.layer as f32;
                let radius_px = last.radius_px + part * (met.radius_px - last.radius_px);
                all.at([0, 1].map(|axis| position[axis][ray] + radius_px * per_px[axis][ray]))[of]
            });
        }
        self.last = met;
        surfaces
    }

    /// Which of them reach a layer past those that are met.
    #[inline(always)]
    pub(crate) fn arrive(mut self, layer: usize, met: &[Met]) -> [bool; RAYS] {
        for met in met.iter().take_while(|met| met.layer <= layer) {
            self.pass(*met);
        }
        if self.last.layer < layer {
            // A surface in it may be too small to have been met: what lies before it is passed.
            self.pass_to(layer);
        }
        std::array::from_fn(|ray| self.reaches(ray, layer))
    }

    /// Which of them end in any of the surfaces that they have passed.
    #[inline(always)]
    pub(crate) fn ended(mut self) -> [bool; RAYS] {
        self.pass_to(self.last.layer + 2);
        std::array::from_fn(|ray| self.paths.iter().any(|paths| paths.ends[ray] != u32::MAX))
    }

    /// Passes what lies before a layer in which there is nothing.
    #[inline(always)]
    fn pass_to(&mut self, layer: usize) {
        self.paths.iter_mut().for_each(|paths| paths.pass(layer, &[f32::NAN; RAYS], |_, _| f32::NAN));
    }

    /// Whether one reaches a layer.
    #[inline(always)]
    pub(crate) fn reaches(&self, ray: usize, layer: usize) -> bool {
        (layer as u32) < self.paths[0].ends[ray].min(self.paths[1].ends[ray])
    }

    /// Returns the coordinates of the surfaces where they pass a blur radius.
    #[inline(always)]
    pub(crate) fn surfaces_at(&self, radius_px: f32) -> [Lanes; 2] {
        let [rows, columns] = [0, 1].map(|axis| {
            let (position, per_px) = (&self.position[axis], &self.per_px[axis]);
            std::array::from_fn(|ray| position[ray] + radius_px * per_px[ray])
        });
        self.surfaces.at_all(&rows, &columns)
    }
}

/// How far rays come among layers.
struct Paths {
    /// The layer passed last, and the coordinates of the surface there.
    last: usize,
    surfaces: Lanes,
    /// Of each the first of the layers that it does not reach.
    ends: [u32; RAYS],
}

/// The most layers that a surface goes nearer or farther from one layer to the next, as a ray passes them: of more, it is not one surface.
const MOST_OF_SURFACE: f32 = 2.0;

impl Default for Paths {
    fn default() -> Self {
        Self { last: 0, surfaces: [f32::NAN; RAYS], ends: [u32::MAX; RAYS] }
    }
}

impl Paths {
    /// Passes a layer, in which a surface lies at a coordinate where each ray is; `between` tells where it lies for one of them at a coordinate before that.
    ///
    /// A ray ends in a surface that lies behind it in one layer and before it in the next. One that only jumps to before it has an edge there, and the ray passes behind that,
    /// unless it still meets it at the depth at which it lies.
    #[inline(always)]
    fn pass(&mut self, layer: usize, surfaces: &Lanes, between: impl Fn(usize, f32) -> f32) {
        let (first, next) = (self.last as f32, (self.last + 1) as f32);
        let lies_between = |surface: f32| (surface >= first) & (surface < next);
        // Both layers have a part of the surface in which a ray ends.
        let end = self.last as u32 + 2;
        let mut crosses = [false; RAYS];
        if self.last + 1 == layer {
            let mut may_meet = [false; RAYS];
            for ray in 0..RAYS {
                let (last, here) = (self.surfaces[ray], surfaces[ray]);
                crosses[ray] = (last >= first) & (here < next) & ((here - last).abs() <= MOST_OF_SURFACE);
                may_meet[ray] = !crosses[ray] & (lies_between(last) | lies_between(here));
            }
            let meets = |ray: usize, at: f32| lies_between(at) && (first..=at).contains(&between(ray, at));
            for ray in (0..RAYS).filter(|ray| may_meet[*ray]) {
                crosses[ray] = meets(ray, self.surfaces[ray]) || meets(ray, surfaces[ray]);
            }
        } else {
            // Where no surface lies in the next layer, one can only lie in the last.
            crosses = self.surfaces.map(lies_between);
        }
        for (ends, crosses) in self.ends.iter_mut().zip(crosses) {
            *ends = if crosses { (*ends).min(end) } else { *ends };
        }
        (self.last, self.surfaces) = (layer, *surfaces);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns where rays end that are all alike.
    fn end_of(paths: &Paths) -> usize {
        assert!(paths.ends.iter().all(|end| *end == paths.ends[0]));
        if paths.ends[0] == u32::MAX { usize::MAX } else { paths.ends[0] as usize }
    }

    /// Returns the first layer that a ray does not reach past the coordinates of a surface in layers one after the other, which goes on from one to the next or jumps halfway.
    fn ends(first: usize, surface: &[f32]) -> usize {
        let mut paths = Paths::default();
        for (i, &here) in surface.iter().enumerate() {
            let before = surface[i.saturating_sub(1)];
            let between = |_, at: f32| {
                let part = (at - (first + i) as f32 + 1.0).clamp(0.0, 1.0);
                match (here - before).abs() > MOST_OF_SURFACE {
                    true if part < 0.5 => before,
                    true => here,
                    false => before + part * (here - before),
                }
            };
            paths.pass(first + i, &[here; RAYS], between);
        }
        end_of(&paths)
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
        let mut path = Paths::default();
        path.pass(1, &[1.0; RAYS], |_, _| 1.0);
        path.pass(7, &[9.0; RAYS], |_, _| 9.0);
        assert_eq!(end_of(&path), 3);
        let mut path = Paths::default();
        path.pass(1, &[7.0; RAYS], |_, _| 7.0);
        path.pass(7, &[7.0; RAYS], |_, _| 7.0);
        path.pass(9, &[f32::NAN; RAYS], |_, _| f32::NAN);
        assert_eq!(end_of(&path), 9);
    }
}
