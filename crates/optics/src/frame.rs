//! Places in the stop and on the film, each in its own frame.
//!
//! A point of the lens frame has three coordinates ([`RayBatch::point_mm`]); a place in the stop or on the film has two, along
//! the axes of that surface. They are types of their own, and only [`MonoLens`] turns one into another, so that the frames
//! of a decentered stop or a tilted film cannot be taken for that of the lens.

use glam::{DVec2, DVec3};

use crate::{MonoLens, Placement, RayBatch};

/// A place in the stop: mm from its center, along its own x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopPoint {
    /// The coordinates, mm.
    pub mm: DVec2,
}

/// A place on the film: mm from its vertex, along its own x and y.
///
/// On a curved film it is the projection onto the plane through the film's vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmPoint {
    /// The coordinates, mm.
    pub mm: DVec2,
}

impl FilmPoint {
    /// Returns the place in the picture, mm from its middle: the film turned by 180°, x to the right, y up.
    #[inline]
    pub fn in_picture_mm(self) -> DVec2 {
        -self.mm
    }
}

impl MonoLens {
    /// Where a surface stands: on the axis at its vertex, unless it is tilted or decentered. Its z is along the light that
    /// leaves it, so that behind an odd number of mirrors the frame is left-handed.
    pub fn surface_placement(&self, surface: usize) -> Placement {
        let Some(placements) = self.placements() else { return Placement::centered(self.vertex_z_mm(surface)) };
        let placement = placements[surface];
        if self.steps()[surface].is_mirror { placement.flipped() } else { placement }
    }

    /// Where the stop stands, its z along the light that leaves it.
    pub fn stop_placement(&self) -> Placement {
        self.surface_placement(self.stop())
    }

    /// Returns the place in the stop of a point of the lens frame.
    pub fn stop_point(&self, point_mm: DVec3) -> StopPoint {
        StopPoint { mm: self.in_stop_mm(point_mm) }
    }

    /// Returns the places in the stop of rays that are there, those that have ended included.
    pub fn stop_points(&self, rays: &RayBatch) -> Vec<StopPoint> {
        (0..rays.len()).map(|ray| self.stop_point(rays.point_mm(ray))).collect()
    }

    /// Returns the place on the film, `film_distance_mm` behind the last vertex, of a point of the lens frame.
    pub fn film_point(&self, point_mm: DVec3, film_distance_mm: f64) -> FilmPoint {
        FilmPoint { mm: self.on_film_mm(point_mm, film_distance_mm) }
    }

    /// Returns the places on the film, `film_distance_mm` behind the last vertex, of rays that are there, those that have ended
    /// included.
    pub fn film_points(&self, rays: &RayBatch, film_distance_mm: f64) -> Vec<FilmPoint> {
        (0..rays.len()).map(|ray| self.film_point(rays.point_mm(ray), film_distance_mm)).collect()
    }

    /// Returns the places on the film, `film_distance_mm` behind the last vertex, of those rays that are in flight there.
    pub fn landed<'a>(&'a self, rays: &'a RayBatch, film_distance_mm: f64) -> impl Iterator<Item = FilmPoint> + 'a {
        let in_flight = (0..rays.len()).filter(|&ray| rays.fate[ray].is_in_flight());
        in_flight.map(move |ray| self.film_point(rays.point_mm(ray), film_distance_mm))
    }
}
