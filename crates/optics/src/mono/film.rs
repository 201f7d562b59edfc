//! The film behind a lens, and rays to it.

use glam::{DVec2, DVec3};
use rayon::iter::{IndexedParallelIterator, ParallelIterator};

use super::CHUNK;
use crate::{
    ImageSurface, MonoLens, Placement, RayBatch, RayBatchF32, Vignetting,
    trace::{self, Goal, Plan},
};

impl MonoLens {
    /// Where a film stands that lies `film_distance_mm` behind the last vertex, its z along the light: behind an odd number of mirrors
    /// the frame is left-handed, so that x and y stay those of the lens.
    pub fn film_placement(&self, film_distance_mm: f64) -> Placement {
        let last_z_mm = self.last_vertex_z_mm();
        match &self.placed {
            None => Placement::centered(last_z_mm + film_distance_mm),
            Some(placed) if placed.is_film_backward => {
                placed.film.after(&Placement::centered(last_z_mm - film_distance_mm)).flipped()
            }
            Some(placed) => placed.film.after(&Placement::centered(last_z_mm + film_distance_mm)),
        }
    }

    /// Returns where a point of the lens frame lies on a film `film_distance_mm` behind the last vertex, mm, along the film's own
    /// x and y: those of the lens, unless the film is tilted or decentered.
    pub(crate) fn on_film_mm(&self, point_mm: DVec3, film_distance_mm: f64) -> DVec2 {
        match &self.placed {
            None => point_mm.truncate(),
            Some(_) => self.film_placement(film_distance_mm).surface_from_lens(point_mm).truncate(),
        }
    }

    /// Traces rays through all surfaces and straight on to the film, `film_distance_mm` behind the last vertex.
    ///
    /// What [`trace`](Self::trace) and [`to_film`](Self::to_film) do, in one go.
    pub fn trace_to_film(&self, rays: &mut RayBatch, rims: Vignetting, film_distance_mm: f64) {
        if !self.has_plain_film() {
            self.trace(rays, rims);
            return self.to_film(rays, film_distance_mm);
        }
        let plan = Plan::new(&self.steps_for(rays.object_z_mm), 0, rims);
        trace::trace_batch(&plan, Goal::Film { film_distance_mm }, rays.slices());
    }

    /// As [`trace_to_film`](Self::trace_to_film), on the threads of the current rayon pool, to the same bits.
    pub fn trace_to_film_parallel(&self, rays: &mut RayBatch, rims: Vignetting, film_distance_mm: f64) {
        if !self.has_plain_film() {
            self.trace_parallel(rays, rims);
            return self.to_film(rays, film_distance_mm);
        }
        let plan = Plan::new(&self.steps_for(rays.object_z_mm), 0, rims);
        let goal = Goal::Film { film_distance_mm };
        rays.par_slices(CHUNK).with_max_len(1).for_each(|chunk| trace::trace_batch(&plan, goal, chunk));
    }

    /// Traces rays in single precision through all surfaces and straight on to the film, `film_distance_mm` behind the last
    /// vertex.
    ///
    /// They land within 0.05 µm of where [`trace_to_film`](Self::trace_to_film) lands them. Through tilted and
    /// decentered surfaces and to curved films they go in double precision, no faster than there.
    pub fn trace_to_film_f32(&self, rays: &mut RayBatchF32, rims: Vignetting, film_distance_mm: f64) {
        if !self.has_plain_film() {
            let mut wide = rays.widened();
            self.trace_to_film(&mut wide, rims, film_distance_mm);
            return rays.set_rounded(&wide, |point, _| point);
        }
        // Where the object plane lies matters to path lengths only.
        let plan = Plan::new(&self.steps, 0, rims);
        trace::trace_batch(&plan, Goal::Film { film_distance_mm }, rays.slices());
    }

    /// Moves rays straight on to the film as it is curved, its vertex `film_distance_mm` behind the last vertex.
    ///
    /// A ray that does not meet a curved film ends as one that missed the surface after the last. Points stay in the lens
    /// frame; [`film_points`](Self::film_points) gives the places on the film itself.
    pub fn to_film(&self, rays: &mut RayBatch, film_distance_mm: f64) {
        let ImageSurface { curvature_per_mm, conic } = self.image_surface;
        if curvature_per_mm == 0.0 {
            return self.to_film_plane(rays, film_distance_mm);
        }
        let medium = (self.image_index(), self.n_surfaces() as u16);
        let placement = self.film_placement(film_distance_mm);
        trace::move_to_placed_conic(&placement, [curvature_per_mm, conic], medium, &mut rays.slices());
    }

    /// Moves rays straight on to the plane through the film's vertex, `film_distance_mm` behind the last vertex, however the film is
    /// curved.
    pub fn to_film_plane(&self, rays: &mut RayBatch, film_distance_mm: f64) {
        match &self.placed {
            None => trace::move_to_plane(rays.slices(), self.last_vertex_z_mm() + film_distance_mm, self.image_index()),
            Some(_) => {
                trace::move_to_placed_plane(
                    &self.film_placement(film_distance_mm),
                    self.image_index(),
                    &mut rays.slices(),
                );
            }
        }
    }

    /// Whether every surface is centered and the film flat: then lens and film are traced in one go.
    pub(crate) fn has_plain_film(&self) -> bool {
        self.placed.is_none() && self.image_surface.curvature_per_mm == 0.0
    }

    /// The shape of the film.
    pub fn image_surface(&self) -> ImageSurface {
        self.image_surface
    }
}
